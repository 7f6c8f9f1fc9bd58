"""Runs designed for self-calibration: each obeys its equation, and is calibrated from."""

import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import ArgumentError, FileError
from trueangle.simulation import Harmonic, Head, Joint, ReferenceLines, RunDesign, Simulation

LINES = (
    Harmonic("output", 1, 300.0, 20.0),
    Harmonic("output", 2, 150.0, 60.0),
    Harmonic("output", 4, 50.0, 110.0),
)
#: 10 to 2 turns per second in 20 s, read at 1 kHz.
COAST = {
    "speed_deg_s": 3600.0,
    "speed_end_deg_s": 720.0,
    "turns": 8.0 * 20.0 / np.log(5.0),
    "samples": 20_000,
    "spacing": "clock",
}
STEADY = {"speed_deg_s": 1080.0, "turns": 30.0, "samples": 10_000, "spacing": "clock"}

#: Standard deviations that no estimate of a test may be off: one in 15 000 beyond 4.
FAR = 4.0

#: Runge and Kutta's rule at steps of a tenth of a radian, over a hundred turns.
INTEGRATED = 1e-5


def made(*designs, seed=0, sigma=0.0, lines=LINES, joint=None, effects=()):
    joint = Joint() if joint is None else joint
    sim = Simulation(joint, lines, effects, sigma, tuple(RunDesign(**d) for d in designs))
    print("seed", seed)
    return ta.simulate(sim, seed=seed)


def off(found, lines=LINES):
    """Errors of cosine and sine in standard deviations."""
    want = {line.order: line.coefficients for line in lines}
    return [
        (got - told) / o.std
        for o in found.orders
        for got, told in zip((o.cosine, o.sine), want[int(o.order)], strict=True)
    ]


def at_order(theta_deg, values, order):
    """Complex amplitude at one order of a signal over whole turns."""
    x = np.radians(theta_deg)
    columns = np.column_stack([np.cos(order * x), np.sin(order * x), np.ones(x.size), x])
    a, b = np.linalg.lstsq(columns, values, rcond=None)[0][:2]
    return complex(a, -b)


def test_a_clock_reads_at_equal_times():
    run = made(COAST)[0]
    t = np.arange(20_000) / 1000.0
    assert np.abs(run.time - t).max() < 1e-9
    decay = np.log(5.0) / 20.0
    assert np.abs(run.reference - 3600.0 * -np.expm1(-decay * t) / decay).max() < 1e-6


@pytest.mark.parametrize(
    ("push", "order", "phase"),
    [
        ({"cogging_deg_s2": 300.0, "cogging_order": 6.0, "cogging_phase_deg": 40.0}, 6.0, 40.0),
        ({"imbalance_deg_s2": 60.0, "imbalance_phase_deg": 200.0}, 1.0, 200.0),
    ],
)
def test_a_torque_of_the_angle_conserves_energy_and_moves_as_the_inverse_square(push, order, phase):
    run = made({**STEADY, **push}, lines=())[0]
    size = max(v for name, v in push.items() if name.endswith("deg_s2"))
    x, v = np.radians(run.reference), np.radians(run.velocity)
    energy = 0.5 * v**2 + np.radians(size) / order * np.cos(order * x + np.radians(phase))
    ripple = np.radians(size) / order
    assert np.ptp(energy) < INTEGRATED * ripple
    # Central differences: (m omega h)^2 / 6 of the wave.
    coarse = (order * np.radians(1080.0) * 1e-3) ** 2 / 6.0
    assert np.abs(np.gradient(x, run.time)[1:-1] - v[1:-1]).max() < coarse * np.ptp(v)
    # The shaft's departure from even motion: T / (m omega)^2.
    even = np.polyval(np.polyfit(run.time, x, 1), run.time)
    moved = abs(at_order(np.degrees(even), x - even, order))
    expected = np.radians(size) / (order * np.radians(1080.0)) ** 2
    assert moved == pytest.approx(expected, rel=0.02)


def test_cogging_is_told_from_the_encoder_by_a_coast():
    push = {"cogging_deg_s2": 20.0, "imbalance_deg_s2": 20.0, "cogging_order": 2.0}
    run = made({**COAST, **push}, seed=8501, sigma=20.0)[0]
    found = ta.selfcal(run, orders=[1, 2, 4], loop="open")
    assert np.abs(off(found)).max() < FAR
    probable = {r["order"]: r["probability"] for r in found.beside["ripple"]}
    assert probable[1] > 0.999
    assert probable[2] > 0.999
    ignored = ta.selfcal(run, orders=[1, 2, 4], loop="open", ripple="none")
    assert np.abs(off(ignored)).max() > 3.0 * FAR


def test_friction_wanders_with_its_memory():
    designs = [{**COAST, "friction_deg_s2": 30.0, "friction_memory_s": 2.0}] * 2
    first, other = made(*designs, seed=8502, lines=())
    assert (first.reference != other.reference).any()
    again = made(*designs, seed=8502, lines=())[0]
    assert (first.reference == again.reference).all()
    decay = np.log(5.0) / 20.0
    friction = np.gradient(first.velocity, first.time) + decay * first.velocity
    share = np.corrcoef(friction[10:-2010], friction[2010:-10])[0, 1]
    assert 5.0 < friction[5:-5].std() < 60.0  # some ten memories: 30 give or take
    assert share < 0.85
    assert np.corrcoef(friction[10:-110], friction[110:-10])[0, 1] > 0.8  # exp(-0.05) = 0.95
    found = ta.selfcal(
        made(designs[0], seed=8503, sigma=20.0), orders=[1, 2, 4], loop="open", ripple="none"
    )
    assert np.abs(off(found)).max() < FAR


@pytest.mark.parametrize("bandwidth", [1.0, 4.0])
def test_a_loop_moves_the_shaft_by_what_it_follows(bandwidth):
    run = made({**STEADY, "loop_bandwidth_hz": bandwidth})[0]
    settled = run.time > 4.0 / bandwidth
    t, x = run.time[settled], run.reference[settled]
    wb = 2.0 * np.pi * bandwidth
    moved = (x - np.polyval(np.polyfit(t, x, 1), t)) * 3600.0
    for line in LINES:
        s = 1j * np.radians(1080.0) * line.order
        follows = (wb * s + 0.25 * wb**2) / (s + 0.5 * wb) ** 2
        a, b = line.coefficients
        got = at_order(x, moved, line.order)
        # Second order in the error: a slope of 0.003.
        assert got == pytest.approx(-follows * complex(a, -b), abs=0.01 * line.amplitude_arcsec)


def test_a_loop_is_refused_by_its_bandwidth():
    run = made({**STEADY, "loop_bandwidth_hz": 2.5}, seed=8504, sigma=5.0)[0]
    found = ta.selfcal(run, orders=[1, 2, 4], loop="closed", loop_bandwidth=2.5)
    assert [o.order for o in found.orders] == [2.0, 4.0]
    assert any("encoder or loop" in b.because and b.orders == (1.0,) for b in found.blind)
    # A PI loop still follows 40 % of order 2: the standard error says so.
    assert any("first order" in note for note in found.notes)
    assert np.abs(off(found)).max() < FAR
    second = complex(found.orders[0].cosine, found.orders[0].sine)
    assert abs(second - complex(*LINES[1].coefficients)) > 40.0


def test_the_current_of_a_loop_shows_the_motion_that_it_makes():
    design = {**STEADY, "loop_bandwidth_hz": 2.0, "deg_s2_per_A": 500.0, "current_A": 1.0}
    run = made(design)[0]
    driven = np.gradient(np.gradient(run.reference, run.time), run.time)
    asked = 500.0 * (run.signals["current"] - 1.0)
    # Central differences at 333 readings a second of a wave at 12 Hz: (w h)^2 / 3 of it.
    assert np.abs(driven - asked)[3:-3].max() < 0.01 * np.abs(asked).max()
    noisy = made(design, seed=8505, sigma=5.0)[0]
    found = ta.selfcal(noisy, orders=[1, 2, 4], loop="closed", loop_bandwidth=2.0, ripple="none")
    assert [o.order for o in found.orders] == [1.0, 2.0, 4.0]
    assert np.abs(off(found)).max() < FAR


def test_heads_read_the_disc_where_they_stand():
    angles = (0.0, 119.2, 203.7)
    joint = Joint(heads=tuple(map(Head, angles)))
    design = {"turns": 3.0, "samples": 3000}
    run = made(design, joint=joint)[0]
    for angle, values in zip(angles, run.heads.values(), strict=True):
        place = np.radians(run.reference + angle)
        error = sum(
            line.amplitude_arcsec * np.sin(line.order * place + np.radians(line.phase_deg))
            for line in LINES
        )
        assert np.abs(values - run.reference - angle - error / 3600.0).max() < 1e-10
    noisy = made(design, joint=joint, seed=8506, sigma=5.0)[0]
    assert (noisy.heads["head1"] == noisy.indicated).all()
    found = ta.selfcal(noisy, orders=[1, 2, 3, 4])
    assert found.method == "heads"
    seen = [o for o in found.orders if o.order != 3.0]
    assert {o.order for o in seen} == {1.0, 2.0, 4.0}
    assert found.beside["head_angles_deg"] == pytest.approx(angles, abs=0.02)
    lines = (*LINES, Harmonic("output", 3, 0.0))
    assert np.abs(off(found, lines)).max() < FAR


def test_shifts_turn_the_other_encoder():
    other = ReferenceLines((1.0, 3.0), (200.0, 40.0), (10.0, 80.0))
    shifts = (0.0, 84.4, 240.7)
    designs = [{"samples": 512, "shift_deg": s} for s in shifts]
    for shift, run in zip(shifts, made(*designs, effects=(other,)), strict=True):
        theta = run.reference.copy()
        for _ in range(6):
            x = np.radians(theta + shift)
            read = 200.0 * np.sin(x + np.radians(10.0)) + 40.0 * np.sin(3.0 * x + np.radians(80.0))
            theta = run.reference + read / 3600.0
        error = sum(
            line.amplitude_arcsec
            * np.sin(line.order * np.radians(theta) + np.radians(line.phase_deg))
            for line in LINES
        )
        assert np.abs(run.indicated - theta - error / 3600.0).max() < 1e-9
    found = ta.selfcal(made(*designs, effects=(other,), seed=8507, sigma=2.0), orders=[1, 2, 3, 4])
    assert found.method == "shifts"
    assert np.abs(off(found, (*LINES, Harmonic("output", 3, 0.0)))).max() < FAR
    sizes = {o["order"]: (o["amplitude_arcsec"], o["std_arcsec"]) for o in found.beside["other"]}
    for order, size in ((1, 200.0), (3, 40.0)):
        assert abs(sizes[order][0] - size) < FAR * sizes[order][1]


def test_a_motor_that_is_recorded_gives_sums():
    joint = Joint(7.3, "none", "output")
    lines = (*LINES, Harmonic("motor", 1, 60.0, 5.0))
    design = {"turns": 3.0, "samples": 6000, "motor_sigma_arcsec": 0.0}
    exact = made(design, joint=joint, lines=lines)[0]
    assert np.abs(exact.signals["motor"] - 7.3 * exact.reference).max() < 1e-9
    found = ta.selfcal(made(design, joint=joint, lines=lines, seed=8508, sigma=5.0), gear_ratio=7.3)
    assert found.method == "dual"
    sizes = {round(o.order, 3): o.amplitude for o in found.orders}
    assert set(sizes) == {1.0, 2.0, 4.0, 7.3}
    assert sizes[7.3] == pytest.approx(60.0, abs=0.5)


TEXT = """
[[head]]
angle_deg = 0.0
[[head]]
angle_deg = 119.2

[[run]]
speed_deg_s = 3600.0
speed_end_deg_s = 720.0
spacing = "clock"
cogging_deg_s2 = 45.0
imbalance_deg_s2 = 10.0
friction_deg_s2 = 30.0

[[run]]
loop_bandwidth_hz = 2.0
deg_s2_per_A = 100.0
shift_deg = 40.0
motor_sigma_arcsec = 1.0
"""


def test_the_file_says_all_of_it(tmp_path):
    path = tmp_path / "joint.toml"
    path.write_text(TEXT)
    sim = ta.load_simulation(path)
    assert [head.angle_deg for head in sim.joint.heads] == [0.0, 119.2]
    assert sim.runs[0].cogging_deg_s2 == 45.0
    assert sim.runs[1].loop_bandwidth_hz == 2.0
    copy = tmp_path / "copy.toml"
    Simulation(sim.joint, sim.harmonics, sim.effects, sim.sigma_arcsec, sim.runs).save(copy)
    assert ta.load_simulation(copy) == sim
    path.write_text(TEXT.replace("119.2", "719.2"))
    with pytest.raises(FileError, match=r"\[\[head\]\] number 2: angle_deg must be within"):
        ta.load_simulation(path)


@pytest.mark.parametrize(
    ("design", "words"),
    [
        ({"loop_bandwidth_hz": -1.0}, "loop_bandwidth_hz must be positive"),
        ({"cogging_deg_s2": -1.0}, "cogging_deg_s2 must be positive, or 0"),
        ({"imbalance_deg_s2": 5.0, "speed_deg_s": 0.0}, "need a speed_deg_s"),
        ({"loop_bandwidth_hz": 1.0, "reversals": (0.5,)}, "no reversals"),
        ({"deg_s2_per_A": 10.0}, "given with loop_bandwidth_hz"),
        ({"motor_sigma_arcsec": -1.0}, "motor_sigma_arcsec must be positive"),
    ],
)
def test_designs_that_no_shaft_follows_are_refused(design, words):
    with pytest.raises(ArgumentError, match=words):
        RunDesign(**design)
