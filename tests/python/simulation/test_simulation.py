"""Simulation: the file round-trips, the effects do what their formulas say."""

from __future__ import annotations

import math
from dataclasses import MISSING, fields

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.effects import Quantisation
from trueangle.errors import ArgumentError, FileError
from trueangle.simulation import (
    EFFECTS,
    ArgumentShift,
    Backlash,
    FilterLag,
    Harmonic,
    Head,
    Joint,
    Latency,
    LocalDefect,
    MissedCounts,
    MissingOrder,
    PreslidingHysteresis,
    ReferenceLines,
    RunDesign,
    ScaleError,
    Simulation,
    StiffeningCompliance,
    ThermalDrift,
    TorsionalCompliance,
    join_runs,
    simulate,
)

#: Arcsec: angles near 400 deg are held to 6e-14 deg, 2e-10 arcsec.
ROUNDING = 1e-8

JOINT = Joint(100.0, "circular_spline", "motor")
LINES = (Harmonic("output", 1, 14.1, 243.75), Harmonic("wave_generator", 2, 33.4, 115.0))
THERE_AND_BACK = RunDesign(samples=720, reversals=(0.5,), speed_deg_s=10.0)

#: Parameters with which every kind of effect leaves a trace.
SAMPLES = {
    "missing_order": {"shaft": "motor", "order": 2, "amplitude_arcsec": 5.0},
    "sidebands": {
        "carrier": 202.0,
        "offsets": [-1, 1],
        "amplitudes_arcsec": [2, 2],
        "phases_deg": [0, 9],
    },
    "non_integer_order": {"order": 42.3, "amplitude_arcsec": 2.0},
    "backlash": {"half_width_arcsec": 3.0},
    "presliding_hysteresis": {"amplitude_arcsec": 4.0, "length_deg": 3.0},
    "latency": {"delay_s": 30e-6},
    "filter_lag": {"cutoff_hz": 150.0},
    "thermal_drift": {"zero_arcsec_per_K": 0.1, "lines_per_K": [[100, 0.1, 20]]},
    "torsional_compliance": {"arcsec_per_Nm": 2.0},
    "stiffening_compliance": {"arcsec_per_Nm": 2.0, "arcsec_per_Nm3": -0.01},
    "load_dependent_gear_error": {"lines_per_Nm": [[202, 0.3, 20]]},
    "zero_slip": {"standard_deviation_arcsec": 2.0},
    "drift_within_run": {"arcsec_per_s": 0.1, "wander_arcsec": 3.0},
    "scale_error": {"relative_error": 1e-5},
    "reference_error": {"orders": [1], "amplitudes_arcsec": [2], "phases_deg": [10]},
    "argument_error": {"coefficient": -1.0},
    "outliers": {"fraction": 0.02, "size_arcsec": 40.0},
    "missed_counts": {"step_arcsec": 12.0, "run": 0, "row": 100},
    "heteroscedastic_noise": {"cosine": 0.5},
    "current_coupling": {"arcsec_per_A": 1.0},
    "joint_coupling": {"joint": "wrist 2", "factor": 0.1},
    "clock_drift": {"ppm": 50.0},
    "varying_line": {"order": 3.0, "follows": "speed", "amplitude_arcsec": 0.2},
    "wrong_gear_ratio": {"gear_ratio": 80.0},
    "timestamp_jitter": {"sigma_s": 2e-5},
    "quantisation": {"step_arcsec": 5.0},
    "local_defect": {"place_deg": 90.0, "width_deg": 2.0, "height_arcsec": 6.0},
}


def sample(kind):
    """An effect of any kind; one that is not listed has every parameter at 1 or once."""
    effect = EFFECTS[kind]
    plain = {
        "tuple[tuple": [[2.0, 1.0, 30.0]], "tuple[float": [1.0], "str": "output"
    }  # fmt: skip
    generic = {
        field.name: next((v for start, v in plain.items() if field.type.startswith(start)), 1)
        for field in fields(effect)
        if field.default is MISSING
    }
    return effect.from_table(SAMPLES.get(kind, generic))


def errors(effect, design=THERE_AND_BACK, harmonics=LINES, seed=1):
    """Error of the effect alone in arcsec, and the signals of its run."""
    sim = Simulation(JOINT, harmonics, sigma_arcsec=0.0)
    plain = simulate(sim, seed, [design])[0]
    run = simulate(sim.with_effects([effect]), seed, [design])[0]
    return (run.indicated - plain.indicated) * 3600.0, join_runs([run])


def test_every_kind_round_trips_through_the_file_and_leaves_a_trace(tmp_path):
    effects = [sample(kind) for kind in EFFECTS]
    design = RunDesign(
        reversals=(0.4,),
        torque_Nm=5.0,
        gravity_Nm=4.0,
        temperature_C=30.0,
        mount_deg=130.0,
        current_A=3.0,
        coupled={"wrist 2": [0.0, 30.0, -10.0]},
        label='a "b"\\',
    )
    sim = Simulation(JOINT, LINES, tuple(effects), 1.5, (design,))
    sim.save(tmp_path / "joint.toml")
    assert ta.load_simulation(tmp_path / "joint.toml") == sim
    for effect in effects:
        trace, signals = errors(effect, design)
        factor = effect.noise_factor(signals, sim.surroundings)
        assert np.max(np.abs(trace) if factor is None else factor - 1.0) > 0.05, effect.kind


def test_added_effects_leave_the_text_of_the_file_alone(tmp_path):
    path = tmp_path / "joint.toml"
    path.write_text("# my joint\n[joint]\ngear_ratio = 50\n\n[[harmonic]] # seen in May\n"
                    'shaft = "output"\norder = 1\namplitude_arcsec = 3\n')  # fmt: skip
    text = path.read_text()
    longer = ta.load_simulation(path).with_effects([Backlash(3.0)])
    longer.save(tmp_path / "extended.toml")
    written = (tmp_path / "extended.toml").read_text()
    assert written.startswith(text)
    assert ta.load_simulation(tmp_path / "extended.toml").effects == (Backlash(3.0),)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("[joint", "not a TOML file"),
        ("[gear]\nratio = 3", "unknown table 'gear'"),
        ("[joint]\nratio = 3", "[joint]: unknown key 'ratio'"),
        ("[joint]\ngear_ratio = 0", "gear_ratio must be motor turns per output turn"),
        ('[joint]\ngear_ratio = "x"', "gear_ratio must be a finite number"),
        ('[[harmonic]]\nshaft = "motor"', "[[harmonic]] number 1: missing"),
        ('[[harmonic]]\nshaft="x"\norder=1\namplitude_arcsec=1', "shaft must be one of"),
        ('[[effect]]\nkind = "rust"', "[[effect]] number 1: kind must be one of"),
        ('[[effect]]\nkind = "backlash"', "needs the parameter 'half_width_arcsec'"),
        ('[[effect]]\nkind="backlash"\nwidth=1', "has no parameter 'width'"),
        (
            '[[effect]]\nkind="missing_order"\nshaft=""\norder=1\namplitude_arcsec=1',
            "shaft must be one of",
        ),
        (
            '[[effect]]\nkind="local_defect"\nshaft="x"\nplace_deg=1\nwidth_deg=1\nheight_arcsec=1',
            "shaft must be one of",
        ),
        ("[[run]]\nsamples = 1.5", "samples must be a whole number"),
        ("[[run]]\nreversals = [0.5, 0.2]", "reversals must be ascending"),
        ("[noise]\nsigma_arcsec = -1", "sigma_arcsec must not be negative"),
        ("[noise]\nsigma = 1", "[noise]: unknown key 'sigma'"),
    ],
)
def test_a_bad_file_is_named_with_its_table_and_key(tmp_path, text, words):
    path = tmp_path / "joint.toml"
    path.write_text(text)
    with pytest.raises(FileError) as caught:
        ta.load_simulation(path)
    assert words in str(caught.value)
    assert str(path) in str(caught.value)


def test_shafts_follow_the_fixed_member():
    assert Joint(100.0, "flexspline", "motor").shafts["wave_generator"] == 99.0
    assert Joint().shafts == {"output": 1.0}
    assert JOINT.name_order(202.0) == ("wave_generator", 2)
    assert JOINT.name_order(3.0) == ("output", 3)
    assert any("gain mismatch" in text for text in JOINT.explanations(200.0))
    assert any("splines" in text or "spline" in text for text in JOINT.explanations(202.0))


def test_backlash_changes_sign_with_the_direction():
    trace, signals = errors(Backlash(3.0))
    assert np.abs(trace - 3.0 * signals.direction).max() < ROUNDING


def test_presliding_hysteresis_follows_the_dahl_equation():
    """Against the differential equation dz/dx = (1 - d z)/L, integrated in small steps."""
    design = RunDesign(samples=3000, spacing="uniform", turns=0.2, reversals=(0.3, 0.4, 0.8))
    trace, signals = errors(PreslidingHysteresis(4.0, 3.0), design, harmonics=())
    state, states = 0.0, []
    for step in np.concatenate([[0.0], np.diff(signals.degrees)]):
        for _ in range(64):
            state += (step / 64) / 3.0 * (1.0 - math.copysign(state, step * state))
        states.append(4.0 * state)
    # Euler's error of first order: 4 arcsec * 0.0004 deg / 3 deg, a few times.
    assert np.abs(trace - states).max() < 5e-3


def test_latency_is_the_reading_of_an_earlier_time():
    trace, signals = errors(Latency(1e-3))
    sim = Simulation(JOINT, LINES)
    earlier = signals.theta - np.radians(signals.velocity * 1e-3)
    pattern = sim.pattern
    whole = np.degrees(earlier - signals.theta) * 3600.0
    expected = whole + pattern.value(earlier) - pattern.value(signals.theta)
    assert np.abs(trace - expected).max() < ROUNDING


def test_filter_lag_solves_the_equation_of_a_low_pass():
    """f_c^-1/(2 pi) dy/dt + y = p: the derivative by central differences."""
    design = RunDesign(samples=36_000, spacing="uniform", turns=0.1, speed_deg_s=20.0)
    trace, signals = errors(FilterLag(30.0), design)
    filtered = trace + Simulation(JOINT, LINES).pattern.value(signals.theta)
    rate = np.gradient(filtered, signals.time)
    balance = rate / (2.0 * np.pi * 30.0) + filtered
    pattern = Simulation(JOINT, LINES).pattern.value(signals.theta)
    assert np.abs(balance - pattern)[2:-2].max() < 1e-3  # (2 pi f dt)^2/6 of 33 arcsec


def test_scale_reference_step_thermal_and_load_follow_their_columns():
    design = RunDesign(turns=2.0, mount_deg=90.0, temperature_C=30.0, torque_Nm=5.0)
    trace, signals = errors(ScaleError(1e-5), design)
    assert np.abs(trace - 1e-5 * signals.degrees * 3600.0).max() < ROUNDING
    trace, _ = errors(ReferenceLines((1.0,), (2.0,), (0.0,)), design)
    assert np.abs(trace - 2.0 * np.sin(signals.theta + np.pi / 2)).max() < ROUNDING
    trace, _ = errors(MissedCounts(12.0, 0, 100), design)
    assert np.abs(trace - 12.0 * (np.arange(360) >= 100)).max() < ROUNDING
    trace, _ = errors(ThermalDrift(0.2), design)
    assert np.abs(trace - 2.0).max() < ROUNDING
    trace, _ = errors(TorsionalCompliance(0.2), design)
    assert np.abs(trace - 1.0).max() < ROUNDING
    trace, _ = errors(StiffeningCompliance(0.2, -0.01, 0.5, 4.0), design)
    assert np.abs(trace - (1.0 - 1.25 + 0.5)).max() < ROUNDING


def test_line_and_defect_belong_to_their_shaft():
    trace, signals = errors(MissingOrder("wave_generator", 2, 5.0, 30.0))
    assert np.abs(trace - 5.0 * np.sin(202 * signals.theta + np.pi / 6)).max() < ROUNDING
    trace, signals = errors(LocalDefect(90.0, 2.0, 6.0, "motor"))
    away = (np.degrees(100.0 * signals.theta) - 90.0 + 180.0) % 360.0 - 180.0
    assert np.abs(trace - 6.0 * np.exp(-(away**2) / 8.0)).max() < 1e-6
    assert np.mean(trace > 3.0) == pytest.approx(2 * 1.1774 * 2.0 / 360.0, rel=0.5)


def test_the_pattern_at_the_indicated_angle_is_its_own_fixed_point():
    trace, signals = errors(ArgumentShift(-1.0))
    pattern = Simulation(JOINT, LINES).pattern
    whole = trace + pattern.value(signals.theta)
    again = pattern.value(signals.theta + np.radians(whole / 3600.0))
    assert np.abs(whole - again).max() < ROUNDING


def test_a_stretch_starts_at_its_turning_point():
    run = ta.CalibrationRun([0.0, 2.0, 5.0, 4.0, 1.0], np.zeros(5), period=360.0)
    signals = join_runs([run])
    assert signals.travel.tolist() == [0.0, 2.0, 5.0, 1.0, 4.0]
    assert signals.segment_length.tolist() == [5.0, 4.0]


def test_a_flickering_reference_has_no_reversals():
    rng = np.random.default_rng(5)
    angle = np.repeat(np.arange(0.0, 50.0, 0.5), 3) + 0.01 * rng.standard_normal(300)
    run = ta.CalibrationRun(np.concatenate([angle, angle[::-1]]), np.zeros(600), period=360.0)
    assert join_runs([run]).segment_direction.tolist() == [1.0, -1.0]


def test_seeds_repeat_and_runs_are_needed():
    sim = Simulation(sigma_arcsec=1.0, runs=(RunDesign(),))
    first, again, other = (simulate(sim, seed)[0].indicated for seed in (3, 3, 4))
    assert (first == again).all()
    assert (first != other).any()
    with pytest.raises(ArgumentError, match=r"add a \[\[run\]\]"):
        simulate(Simulation())


def test_the_command_writes_runs_that_read_back_exactly(tmp_path, capsys):
    sim = Simulation(JOINT, LINES, sigma_arcsec=1.0, runs=(THERE_AND_BACK, RunDesign(label="b")))
    sim.save(tmp_path / "joint.toml")
    out = tmp_path / "runs.csv"
    assert main(["simulate", str(tmp_path / "joint.toml"), "-o", str(out), "--seed", "4"]) == 0
    assert "1080 readings in 2 runs" in capsys.readouterr().out
    for read, made in zip(ta.read_runs(out), simulate(sim, 4), strict=True):
        for name in ("reference", "indicated", "time", "torque", "temperature", "mount"):
            assert (getattr(read, name) == getattr(made, name)).all(), name
        assert (read.velocity == made.velocity).all()
    assert main(["simulate", str(tmp_path / "none.toml"), "-o", str(out)]) == 1
    assert "none.toml" in capsys.readouterr().err


def test_a_gear_is_a_strain_wave_gear_unless_said_otherwise(tmp_path):
    path = tmp_path / "joint.toml"
    path.write_text("[joint]\ngear_ratio = 50\n")
    assert ta.load_simulation(path).joint == Joint(50, "circular_spline", "motor")
    path.write_text('[joint]\ngear_ratio = 50\nfixed_member = "none"\n')
    assert ta.load_simulation(path).joint == Joint(50, "none", "motor")
    path.write_text("[joint]\npole_pairs = 4\n")
    assert ta.load_simulation(path).joint.shafts == {"output": 1.0}


ODD_FILES = {
    "a huge number": ("[noise]\nsigma_arcsec = " + "9" * 400, "sigma_arcsec.*finite"),
    "thousands of digits": ("[noise]\nsigma_arcsec = " + "9" * 5000, "cannot be read"),
    "deep nesting": ("x = " + "[" * 5000 + "]" * 5000, "list that cannot be read"),
    "a date": ("[noise]\nsigma_arcsec = 1979-05-27", "sigma_arcsec"),
    "a kind that is a list": ("[[effect]]\nkind = []", "kind must be one of"),
    "a huge parameter": (
        '[[effect]]\nkind = "backlash"\nhalf_width_arcsec = ' + "9" * 400,
        "half_width_arcsec.*finite",
    ),
    "too many samples": ("[[run]]\nsamples = 1000000000", "samples must be from 1 to"),
    "too many in all": ("[[run]]\nsamples = 20000000\n" * 2, "40000000 samples"),
    "too many turns": ("[[run]]\nturns = 1e300", "turns must be"),
    "infinite turns": ("[[run]]\nturns = inf", "turns must be a finite number"),
    "true for a number": ("[[run]]\nsamples = true", "samples must be a finite number"),
}


@pytest.mark.parametrize("case", ODD_FILES)
def test_values_that_no_joint_has_are_refused_with_their_place(case, tmp_path):
    text, message = ODD_FILES[case]
    path = tmp_path / "odd.toml"
    path.write_text(text)
    with pytest.raises(FileError, match=message) as caught:
        ta.load_simulation(path)
    assert str(caught.value).startswith(str(path))


#: Arcsec that a whole turn in degrees keeps of a lattice: 360 deg in 53 bits are 2e-10 arcsec.
LATTICE = 1e-6


def test_a_reading_is_rounded_with_its_noise():
    step, sigma = 7.0, 3.0
    runs = (RunDesign(samples=4000, spacing="random"),)
    joint = Joint(heads=(Head(0.0), Head(180.0)))
    sim = Simulation(joint, (), (Quantisation(step),), sigma, runs)
    (run,) = ta.simulate(sim, 3)
    for reading in (run.indicated, run.signals["head1"], run.signals["head2"]):
        counts = reading * 3600.0 / step
        assert np.abs(counts - np.round(counts)).max() < LATTICE
    # Sheppard: the variances add where the noise is a good part of the step; 4 standard errors.
    expected = math.hypot(sigma, step / math.sqrt(12.0))
    found = float(np.std((run.indicated - run.reference) * 3600.0))
    assert abs(found / expected - 1.0) < 4.0 / math.sqrt(2.0 * 4000)


@pytest.mark.parametrize(
    ("table", "what"),
    [
        ('[[effect]]\nkind = "latency"\ndelay_s = 1e308\n', "the effect latency"),
        ('[[harmonic]]\nshaft = "output"\norder = 1\namplitude_arcsec = 1e308\n'
         'phase_deg = 20.0\n[[harmonic]]\nshaft = "output"\norder = 1\n'
         'amplitude_arcsec = 1.7e308\nphase_deg = 20.0\n', "its harmonics"),
    ],
)  # fmt: skip
def test_numbers_without_an_end_are_told_by_what_holds_them(table, what, tmp_path):
    path = tmp_path / "joint.toml"
    path.write_text(f"[joint]\ngear_ratio = 50.0\n{table}[[run]]\nsamples = 30\nspeed_deg_s = 20\n")
    sim = ta.load_simulation(path)
    with np.errstate(all="ignore"), pytest.raises(ta.errors.ArgumentError) as caught:
        ta.simulate(sim)
    assert str(caught.value).startswith(f"{path}: simulated readings are not finite: ")
    assert f"numbers of {what} are too large" in str(caught.value)
