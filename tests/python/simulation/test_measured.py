"""Designs of measured runs: what they hold, and that a simulation repeats the measurement."""

import secrets
from dataclasses import fields, replace

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.errors import ArgumentError
from trueangle.simulation import (
    Backlash,
    Harmonic,
    HeteroscedasticNoise,
    Latency,
    MissingOrder,
    RunDesign,
    Simulation,
    simulate,
    simulate_along,
)
from trueangle.simulation.measured import design_of

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
