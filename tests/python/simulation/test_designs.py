"""Runs as they are designed: time, place, load and warmth at every reading, by their own laws."""

from __future__ import annotations

import secrets
from dataclasses import fields, replace

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import trueangle as ta
from trueangle.cli import main
from trueangle.errors import ArgumentError
from trueangle.joint.joint import Head
from trueangle.joint.pattern import Pattern
from trueangle.simulation import (
    Backlash,
    Harmonic,
    HeteroscedasticNoise,
    Joint,
    Latency,
    MissingOrder,
    ReferenceLines,
    RunDesign,
    Simulation,
    simulate,
    simulate_along,
)
from trueangle.simulation.designs import ARCSEC_PER_RAD, RotorDrive, rotor_angle
from trueangle.simulation.measured import design_of

N = 4_000


def only(design: RunDesign, sim: Simulation = Simulation(), seed: int = 1) -> ta.CalibrationRun:  # noqa: B008
    (run,) = simulate(replace(sim, runs=(design,)), seed)
    return run


@pytest.mark.parametrize("direction", [1, -1])
@pytest.mark.parametrize("spacing", ["uniform", "clock", "jittered"])
def test_a_coasting_shaft_is_where_its_speed_takes_it(spacing, direction):
    """The angle is the integral of the speed, which falls with the travel and with time."""
    run = only(RunDesign(direction=direction, speed_deg_s=40.0, speed_end_deg_s=10.0, samples=N,
                         spacing=spacing, turns=2.0, start_deg=15.0))  # fmt: skip
    time, speed = run.time, run.velocity
    way = np.concatenate([[0.0], np.cumsum(0.5 * np.diff(time) * (speed[1:] + speed[:-1]))])
    # The trapezium is exact to the third power of a step.
    np.testing.assert_allclose(run.reference - run.reference[0], way, atol=1e-3)
    travel = np.abs(run.reference - 15.0)
    np.testing.assert_allclose(np.abs(speed), 40.0 - 30.0 * travel / 720.0, rtol=1e-9)
    np.testing.assert_allclose(np.abs(speed), 40.0 * np.exp(-30.0 / 720.0 * time), rtol=1e-9)
    assert np.all(np.sign(speed) == direction)
    if spacing == "clock":
        np.testing.assert_allclose(np.diff(time), np.diff(time).mean(), rtol=1e-6)
    assert travel[-1] == pytest.approx(720.0, rel=2e-3)


def test_readings_are_jittered_each_within_its_own_step():
    share = only(RunDesign(samples=N)).reference / 360.0 * N - np.arange(N)
    assert share.min() >= 0.0
    assert share.max() < 1.0
    # Uniform: a twelfth, known to 1.4 %.
    assert np.var(share) == pytest.approx(1.0 / 12.0, rel=0.06)
    assert abs(np.corrcoef(share[1:], share[:-1])[0, 1]) < 5.0 / np.sqrt(N)


def test_load_warmth_and_mount_are_those_of_the_place():
    run = only(RunDesign(samples=500, turns=1.5, reversals=(0.4,), start_deg=70.0, torque_Nm=2.0,
                         gravity_Nm=5.0, gravity_deg=30.0, temperature_C=20.0,
                         temperature_end_C=32.0, mount_deg=40.0, shift_deg=25.0))  # fmt: skip
    moment = 2.0 + 5.0 * np.sin(np.radians(run.reference - 30.0))
    np.testing.assert_allclose(run.torque, moment, atol=1e-9)
    way = np.concatenate([[0.0], np.cumsum(np.abs(np.diff(run.reference)))])
    np.testing.assert_allclose(run.temperature, 20.0 + 12.0 * way / 540.0, atol=0.1)
    # A reference that is an encoder turned for this run has turned on its mount.
    np.testing.assert_allclose(run.mount, 65.0)
    np.testing.assert_allclose(run.signals["shift"], 25.0)


def test_an_encoder_that_was_turned_reads_with_its_own_error():
    """In runs in which it was not, the same error is one of the joint's readings against it."""
    lines = ReferenceLines((3.0,), (20.0,), (10.0,))
    sim = Simulation(effects=(lines,))
    designs = [RunDesign(samples=300, mount_deg=50.0), RunDesign(samples=300, shift_deg=50.0)]
    for run, turned in zip(simulate(sim, 5, designs), (False, True), strict=True):
        error = 3600.0 * (run.indicated - run.reference)
        place = run.indicated if turned else run.reference
        wanted = 20.0 * np.sin(3.0 * np.radians(place + 50.0) + np.radians(10.0))
        # To first order in the error itself: 20 arcsec of a radian.
        np.testing.assert_allclose(error, wanted, atol=0.02)


@pytest.mark.parametrize("angle", [0.0, 360.0, -360.0])
def test_a_head_whole_turns_away_is_the_joints_own(angle):
    """Its noise as well: it is one reading."""
    sim = Simulation(Joint(heads=(Head(angle), Head(180.0))), sigma_arcsec=4.0)
    run = only(RunDesign(samples=N), sim)
    own, other = (run.signals[f"head{k}"] for k in (1, 2))
    np.testing.assert_allclose(own - angle, run.indicated, atol=1e-9)
    assert np.std(3600.0 * (other - 180.0 - run.indicated)) == pytest.approx(
        4.0 * np.sqrt(2.0), rel=0.05
    )


def test_motor_and_heads_read_where_they_are():
    """A head sees the disc's error at its own place; the motor its own noise, not reduced."""
    line = Harmonic("output", 2, 50.0, 30.0)
    joint = Joint(20.0, heads=(Head(0.0), Head(100.0), Head(360.0)))
    sim = Simulation(joint, (line,), sigma_arcsec=0.0)
    run = only(RunDesign(samples=N, motor_sigma_arcsec=90.0), sim)
    there = np.radians(run.reference + 100.0)
    error = 3600.0 * (run.signals["head2"] - 100.0 - run.reference)
    np.testing.assert_allclose(error, 50.0 * np.sin(2.0 * there + np.radians(30.0)), atol=1e-6)
    np.testing.assert_allclose(run.signals["head1"], run.indicated, atol=1e-12)
    np.testing.assert_allclose(run.signals["head3"], run.indicated + 360.0, atol=1e-12)
    noise = 3600.0 * (run.signals["motor"] - 20.0 * run.reference)
    # A deviation of 4000 is known to 1.1 %.
    assert np.std(noise) == pytest.approx(90.0, rel=0.05)
    noisy = only(RunDesign(samples=N), replace(sim, sigma_arcsec=4.0))
    own, other = (3600.0 * (noisy.signals[f"head{k}"] - at - noisy.reference)
                  for k, at in ((1, 0.0), (2, 100.0)))  # fmt: skip
    own -= 50.0 * np.sin(2.0 * np.radians(noisy.reference) + np.radians(30.0))
    other -= 50.0 * np.sin(2.0 * np.radians(noisy.reference + 100.0) + np.radians(30.0))
    assert np.std([own, other], axis=1) == pytest.approx([4.0, 4.0], rel=0.05)
    assert abs(np.corrcoef(own, other)[0, 1]) < 0.08


def test_uneven_noise_has_the_deviation_of_its_law():
    sim = Simulation(sigma_arcsec=3.0, effects=(HeteroscedasticNoise(per_deg_s=0.05),))
    runs = simulate(sim, 7, [RunDesign(samples=N, speed_deg_s=v) for v in (0.0, 20.0, 60.0)])
    found = [3600.0 * np.std(run.error) for run in runs]
    assert found == pytest.approx(3.0 * np.exp(0.025 * np.array([0.0, 20.0, 60.0])), rel=0.06)


def test_friction_wanders_by_its_size_and_forgets_in_its_memory():
    """By the speed's own changes: an acceleration of its deviation and correlation."""
    run = only(RunDesign(samples=20_000, turns=200.0, speed_deg_s=60.0, spacing="uniform",
                         friction_deg_s2=4.0, friction_memory_s=2.0), seed=9)  # fmt: skip
    step = float(np.median(np.diff(run.time)))
    pushed = np.diff(run.velocity) / np.diff(run.time)
    pushed = pushed[100:] - pushed[100:].mean()
    # 1200 s of a memory of 2 s: some 300 pieces, their deviation known to 4 %.
    assert np.std(pushed) == pytest.approx(4.0, rel=0.2)
    lag = round(2.0 / step)
    found = np.corrcoef(pushed[lag:], pushed[:-lag])[0, 1]
    assert found == pytest.approx(np.exp(-1.0), abs=0.2)


def test_the_current_is_what_turns_the_shaft():
    """Speed changes by what cogging, imbalance and the current push: degrees throughout."""
    design = RunDesign(samples=6_000, speed_deg_s=30.0, spacing="clock", turns=1.3,
                       start_deg=40.0, cogging_deg_s2=25.0, cogging_order=3.0,
                       cogging_phase_deg=20.0, imbalance_deg_s2=8.0, imbalance_phase_deg=70.0,
                       loop_bandwidth_hz=3.0, deg_s2_per_A=50.0, current_A=0.7)  # fmt: skip
    run = only(design)
    x = np.radians(run.reference)
    driven = 50.0 * (run.signals["current"] - 0.7)
    pushed = driven + 25.0 * np.sin(3.0 * x + np.radians(20.0)) + 8.0 * np.sin(x + np.radians(70.0))
    slope = np.gradient(run.velocity, run.time)
    # Central differences err by a sixth of a step squared times the third derivative.
    np.testing.assert_allclose(slope[5:-5], pushed[5:-5], atol=0.02)
    assert np.abs(driven).max() > 5.0


TIME = np.sort(np.random.default_rng(3).uniform(0.0, 4.0, 60))
NOTHING = RotorDrive(0.3, 2.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0, 0.0, 2.0)
#: Orders, cosines and sines in arcsec of what the loop sees.
LINES = ((1.0, 900.0, -400.0), (4.0, 0.0, 300.0))

CASES = {
    "nothing": NOTHING,
    "friction": NOTHING._replace(decay=0.7),
    "cogging": NOTHING._replace(cogging=1.5, order=3.0, phase=0.8),
    "imbalance": NOTHING._replace(imbalance=-0.9, low=1.1),
    "backwards": NOTHING._replace(speed=-2.0, decay=0.2, cogging=0.5, imbalance=0.5),
    "a loop": NOTHING._replace(band=6.0),
    "a loop that slows down": NOTHING._replace(band=6.0, decay=0.3, cogging=2.0, order=2.0),
}


def pattern_of(lines):
    orders, cosine, sine = (np.array(column) for column in zip(*lines, strict=True))
    return Pattern(orders, cosine, sine)


@pytest.mark.parametrize("case", CASES)
def test_it_moves_as_its_equation_says(case):
    d = CASES[case]
    waves = [(m, a / ARCSEC_PER_RAD, b / ARCSEC_PER_RAD) for m, a, b in LINES]

    def seen(x):
        return sum(a * np.cos(m * x) + b * np.sin(m * x) for m, a, b in waves)

    def slope(x):
        return sum(m * (b * np.cos(m * x) - a * np.sin(m * x)) for m, a, b in waves)

    def asked(t, x, v):
        """What the loop asks of the motor: the speed and the place of what it reads."""
        speed = d.speed * np.exp(-d.decay * t)
        way = d.speed * t if not d.decay else d.speed * (1.0 - np.exp(-d.decay * t)) / d.decay
        moved = x + seen(x) - d.place - seen(d.place)
        lag = d.band * (speed - v * (1.0 + slope(x))) + d.band**2 / 4.0 * (way - moved)
        return lag - d.decay * speed

    def push(t, state):
        x, v = state
        a = d.cogging * np.sin(d.order * x + d.phase) + d.imbalance * np.sin(x + d.low)
        return v, a + (asked(t, x, v) if d.band else -d.decay * v)

    exact = solve_ivp(push, (0.0, 4.0), (d.place, d.speed), t_eval=TIME, rtol=1e-11, atol=1e-12)
    found = rotor_angle(d, TIME, pattern_of(LINES), np.random.default_rng(0))
    x, v = exact.y
    # The module's rule is right to some 1e-6 of what a term moves.
    np.testing.assert_allclose(found.angle, np.degrees(x), rtol=0.0, atol=2e-3)
    np.testing.assert_allclose(found.speed, np.degrees(v), rtol=0.0, atol=5e-3)
    wanted = np.degrees(asked(TIME, x, v)) if d.band else np.zeros(TIME.size)
    np.testing.assert_allclose(found.driven, wanted, rtol=0.0, atol=5e-2)


def test_a_shaft_that_runs_away_is_refused():
    away = NOTHING._replace(speed=0.0, imbalance=1e12, low=1.0)
    with pytest.raises(ArgumentError, match="runs away: make cogging, imbalance and loop weaker"):
        rotor_angle(away, TIME, pattern_of(LINES), np.random.default_rng(0))


def test_a_friction_that_wanders_pushes_by_its_size_and_forgets():
    """Each reading's own, until the next; its correlation falls by e in its memory."""
    time = np.arange(40_000) * 0.05
    drive = NOTHING._replace(friction_deg_s2=3.0, memory_s=0.5)
    from trueangle.simulation.designs import _drift

    pushed = _drift(drive, time, np.random.default_rng(7))
    assert np.std(pushed) == pytest.approx(3.0, rel=0.05)
    assert np.mean(pushed[10:] * pushed[:-10]) / 9.0 == pytest.approx(np.exp(-1.0), abs=0.03)


FULL = RunDesign(
    label="a",
    samples=500,
    direction=-1,
    reversals=(0.3, 0.6),
    speed_deg_s=7.0,
    start_deg=33.0,
    turns=2.3,
    torque_Nm=2.0,
    gravity_Nm=4.0,
    gravity_deg=25.0,
    temperature_C=20.0,
    temperature_end_C=26.0,
    mount_deg=40.0,
    current_A=1.5,
    coupled={"wrist": [0.0, 40.0, -20.0]},
)
#: A step of the readings, as a share of the travel.
STEP = 1.0 / 500.0


def test_a_design_is_found_again():
    (run,) = ta.simulate(Simulation(runs=(FULL,)), 3)
    found = design_of(run)
    assert (found.label, found.samples, found.direction) == ("a", 500, -1)
    assert found.speed_deg_s == pytest.approx(7.0)
    assert found.turns == pytest.approx(2.3, rel=2.0 * STEP)
    assert found.start_deg == pytest.approx(33.0, abs=360.0 * 2.3 * STEP)
    assert found.reversals == pytest.approx((0.3, 0.6), abs=2.0 * STEP)
    for name in ("torque_Nm", "gravity_Nm", "gravity_deg", "mount_deg", "current_A"):
        assert getattr(found, name) == pytest.approx(getattr(FULL, name)), name
    assert found.temperature_C == pytest.approx(20.0, abs=0.05)
    assert found.temperature_end_C == pytest.approx(26.0, abs=0.05)
    # The runs of both are alike, the other joint's way too.
    (again,) = ta.simulate(Simulation(runs=(found,)), 4)
    for mine, other in (
        (again.reference, run.reference),
        (again.signals["coupled_wrist"], run.signals["coupled_wrist"]),
    ):
        assert np.max(np.abs(mine - other)) < 3.0 * 360.0 * 2.3 * STEP


def test_a_run_at_rest_and_one_without_anything():
    (rest,) = ta.simulate(Simulation(runs=(RunDesign(speed_deg_s=0.0, spacing="uniform"),)))
    found = design_of(rest)
    assert (found.speed_deg_s, found.spacing) == (0.0, "uniform")
    assert found.turns == pytest.approx(1.0)
    bare = ta.CalibrationRun([0.0, 0.0], [0.0, 0.0], period=360.0)
    assert design_of(bare).samples == 2
    turned = ta.CalibrationRun(np.linspace(0.0, 6.0, 50), np.linspace(0.0, 6.0, 50))
    assert design_of(turned).turns == pytest.approx(6.0 * 50 / 49 / (2.0 * np.pi))


def test_what_extend_writes_repeats_the_measurement(tmp_path, capsys):
    truth = Simulation(
        sigma_arcsec=2.0,
        effects=(Backlash(9.0),),
        runs=tuple(RunDesign(reversals=(0.5,), speed_deg_s=v) for v in (5.0, 40.0, 5.0)),
    )
    runs = ta.simulate(truth, 20)
    ta.write_runs(runs, tmp_path / "runs.csv")
    believed = tmp_path / "joint.toml"
    believed.write_text("# mine\n[joint]\ngear_ratio = 1.0\n")
    better = tmp_path / "better.toml"
    files = [str(tmp_path / "runs.csv"), "--simulation", str(believed), "--extend", str(better)]
    assert main(["diagnose", *files]) == 0
    capsys.readouterr()
    # What was there stays as it was written.
    assert better.read_text().startswith(believed.read_text())
    extended = ta.load_simulation(better)
    assert extended.sigma_arcsec == pytest.approx(2.0, rel=0.1)
    assert [effect.kind for effect in extended.effects] == ["backlash"]
    again = ta.simulate(extended, 21)
    assert [len(run) for run in again] == [len(run) for run in runs]
    assert ta.diagnose(again, extended).findings == []
    # What the simulation states itself is kept.
    stated = Simulation(sigma_arcsec=1.5, runs=(RunDesign(),))
    found = ta.diagnose(runs, stated).simulation()
    assert (found.sigma_arcsec, found.runs) == (1.5, stated.runs)


@pytest.mark.parametrize("period", [1.0, 2.0 * np.pi, 4096.0])
def test_a_design_is_the_same_whatever_the_unit_of_the_readings(period):
    """Travel, speed, mount, shift and the ways of other joints, all angles."""
    (run,) = ta.simulate(Simulation(runs=(replace(FULL, shift_deg=12.0),)), 3)
    scale = period / 360.0
    angles = ("shift", "coupled_wrist")
    other = ta.CalibrationRun(
        scale * run.reference, scale * run.indicated, period, time=run.time,
        temperature=run.temperature, torque=run.torque, mount=scale * run.mount,
        label=run.label, velocity=scale * run.velocity,
        signals={n: v * (scale if n in angles else 1.0) for n, v in run.signals.items()},
    )  # fmt: skip
    one, found = design_of(run), design_of(other)
    for field in fields(RunDesign):
        mine, its = getattr(found, field.name), getattr(one, field.name)
        if field.name == "coupled":
            assert [name for name, _ in mine] == [name for name, _ in its]
            mine, its = (np.concatenate([way for _, way in ways]) for ways in (mine, its))
            np.testing.assert_allclose(mine, its, atol=1e-6)
        elif isinstance(its, float | tuple):
            assert mine == pytest.approx(its, abs=1e-6), field.name
        else:
            assert mine == its, field.name


@pytest.mark.parametrize("gravity_deg", [-170.0, -25.0, 0.0, 80.0])
@pytest.mark.parametrize("gravity", [0.5, 4.0])
def test_a_weight_is_told_from_a_constant_load_by_its_share(gravity_deg, gravity):
    """Noise of 1 Nm beside it: a weight of 0.5 is a half of less than its variance."""
    design = replace(FULL, gravity_Nm=gravity, gravity_deg=gravity_deg, turns=2.0)
    (run,) = ta.simulate(Simulation(runs=(design,)), 5)
    noise = np.random.default_rng(6).normal(size=500)
    found = design_of(replace(run, torque=run.torque + noise))
    if gravity < 1.0:
        assert (found.gravity_Nm, found.gravity_deg) == (0.0, 0.0)
        assert found.torque_Nm == pytest.approx(float((run.torque + noise).mean()))
    else:
        # Each coefficient to sqrt(2 / 500) of the noise, to 4.5 of them.
        about = 4.5 * np.sqrt(2.0 / 500.0)
        assert found.gravity_Nm == pytest.approx(4.0, abs=about)
        assert found.torque_Nm == pytest.approx(2.0, abs=about)
        away = (found.gravity_deg - gravity_deg + 180.0) % 360.0 - 180.0
        assert abs(away) < np.degrees(about / 4.0)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_speed_is_that_of_most_readings(sign):
    """Two thirds at 4 deg/s, some at 90 and some at rest: neither a mean nor with the rest."""
    speed = np.repeat([4.0, 90.0, 0.0], [200, 60, 90])
    time = np.arange(350) * 0.05
    angle = sign * np.concatenate([[0.0], np.cumsum(speed[1:] * 0.05)])
    found = design_of(ta.CalibrationRun(angle, angle, 360.0, time=time, velocity=sign * speed))
    assert (found.speed_deg_s, found.direction) == (pytest.approx(4.0), sign)


SIM = Simulation(
    harmonics=(Harmonic("output", 3, 20.0, 10.0),),
    effects=(Backlash(5.0),),
    runs=(RunDesign("a", reversals=(0.5,), samples=400), RunDesign("b", samples=300)),
)


def test_without_noise_it_is_what_the_runs_of_the_simulation_read():
    own = simulate(SIM, 4)
    again = simulate_along(SIM, own)
    for one, other in zip(own, again, strict=True):
        np.testing.assert_allclose(one.indicated, other.indicated, rtol=0, atol=1e-9)
        assert one.label == other.label


def test_angles_keep_their_unit():

    turns = [
        replace(
            run,
            reference=run.reference / 360.0,
            indicated=run.indicated / 360.0,
            period=1.0,
            velocity=run.velocity / 360.0,
            mount=None,
        )
        for run in simulate(SIM, 4)
    ]
    read = simulate_along(SIM, turns)[0]
    np.testing.assert_allclose(read.indicated * 360.0, simulate(SIM, 4)[0].indicated, atol=1e-9)


def test_noise_is_correlated_within_runs_and_has_its_deviation():
    seed = secrets.randbits(32)
    print("seed", seed)
    long = Simulation(sigma_arcsec=3.0, runs=(RunDesign(samples=40_000), RunDesign(samples=9)))
    error = simulate_along(long, simulate(long, 1), seed, correlation=0.8)[0].error * 3600.0
    # Of a correlated series as many readings count as (1 - rho) / (1 + rho) of it, squares more.
    assert error.std() == pytest.approx(3.0, rel=5.0 * (4.6 / 80_000) ** 0.5)
    found = np.corrcoef(error[1:], error[:-1])[0, 1]
    assert found == pytest.approx(0.8, abs=5.0 * (0.36 / 40_000) ** 0.5)


def test_what_is_no_correlation_is_refused():
    with pytest.raises(ArgumentError, match="correlation must be from 0 to below 1"):
        simulate_along(SIM, simulate(SIM, 1), correlation=1.0)


def test_a_delay_moves_the_lines_that_an_effect_adds_as_well():
    """By the chain of angles itself: what is read was so a moment before."""
    effects = (MissingOrder("output", 7.0, 40.0, 25.0), Latency(2e-3))
    believed = replace(SIM, harmonics=SIM.harmonics, effects=effects)
    design = RunDesign("a", samples=300, speed_deg_s=50.0)
    (run,) = simulate(believed, 4, [design])

    def lines(angle):
        first = 20.0 * np.sin(np.radians(3.0 * angle + 10.0))
        return first + 40.0 * np.sin(np.radians(7.0 * angle + 25.0))

    # To first order in the delay: the true angle moves by it, and the lines with it.
    back = 2e-3 * run.velocity
    wanted = lines(run.reference - back) - 3600.0 * back
    np.testing.assert_allclose(3600.0 * run.error, wanted, atol=0.02)
    (along,) = simulate_along(believed, [run])
    np.testing.assert_allclose(3600.0 * along.error, wanted, atol=0.02)
    np.testing.assert_allclose(believed.predict(run), wanted, atol=0.02)


@pytest.mark.parametrize("correlation", [0.0, 0.5])
def test_noise_that_grows_with_speed_has_the_deviation_of_its_law_along_runs(correlation):
    sim = Simulation(sigma_arcsec=3.0, effects=(HeteroscedasticNoise(per_deg_s=0.05),))
    speeds = np.array([0.0, 20.0, 60.0])
    ideal = simulate(Simulation(), 7, [RunDesign(samples=4000, speed_deg_s=v) for v in speeds])
    found = [3600.0 * np.std(run.error) for run in simulate_along(sim, ideal, 8, correlation)]
    assert found == pytest.approx(3.0 * np.exp(0.025 * speeds), rel=0.08)
