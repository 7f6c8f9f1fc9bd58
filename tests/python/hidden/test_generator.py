"""The generator itself: sizes, other forms than the library's, and what a design cannot see."""

from __future__ import annotations

import tomllib

import numpy as np
import pytest

from .blind import BLIND
from .case import Case, Question, pose
from .causes import CAUSES
from .designs import DESIGNS
from .motion import strokes
from .reversal import BoucWen, MaxwellSlip
from .source import spread

#: The signal's rms is found by iteration; six steps leave less than this.
SIZE_TOLERANCE = 2e-3

#: Chi-square below which a signal is buried: one parameter would not be noticed.
BURIED = 4.0


#: Causes whose size is not the rms of a signal.
OTHERWISE_SIZED = ("heteroscedastic_noise", "stiffening_compliance")


@pytest.mark.parametrize("cause", [c for c in CAUSES if c not in OTHERWISE_SIZED])
@pytest.mark.parametrize("scale", [1.0, 0.1])
def test_a_signal_has_its_size(cause: str, scale: float) -> None:
    question = pose(Case((cause,), scale, seed=3))
    (source,) = question.sources
    found = spread(source.signals(question.joint, question.scenes))
    assert found == pytest.approx(scale * CAUSES[cause][1], rel=SIZE_TOLERANCE)


def test_a_stiffening_spring_is_told_from_a_linear_one_by_what_that_leaves() -> None:
    question = pose(Case(("stiffening_compliance",), 1.0, seed=3))
    signal = np.concatenate(question.sources[0].signals(question.joint, question.scenes))
    torque = np.concatenate([scene.torque for scene in question.scenes])
    rest = signal - torque * (signal @ torque) / (torque @ torque)
    assert rest.std() == pytest.approx(0.28 * 1.1, rel=SIZE_TOLERANCE)
    assert 1.1 < signal.std() < 8.0


def test_uneven_noise_changes_by_a_third() -> None:
    question = pose(Case(("heteroscedastic_noise",), 1.0, seed=3))
    factors = np.concatenate(question.sources[0].noise_factors(question.scenes))
    assert factors.min() == pytest.approx(0.65, abs=0.02)
    assert factors.max() == pytest.approx(1.35, abs=0.02)


def test_the_rich_design_is_rich_and_its_factors_are_not_confounded() -> None:
    question = pose(Case((), seed=1))
    runs = question.runs
    assert len(runs) == 24
    assert sum(len(run) for run in runs) == pytest.approx(10_000, rel=0.02)
    for run in runs:
        assert set(np.unique(run.direction)) == {-1.0, 1.0}
        assert np.abs(np.diff(np.sort(run.reference % 360.0))).max() < 10.0
    speed = [np.median(np.abs(scene.velocity)) > 15.0 for scene in question.scenes]
    load = [np.abs(scene.torque).max() > 1.0 for scene in question.scenes]
    warm = [scene.temperature.mean() > 27.0 for scene in question.scenes]
    first = [scene.mount[0] == 0.0 for scene in question.scenes]
    factors = np.array([speed, load, warm, first], dtype=float)
    assert np.abs(np.corrcoef(factors) - np.eye(4)).max() < 1e-9
    # The runs are taken in a random order.
    drawn = {
        tuple(s.temperature.mean() > 27.0 for s in pose(Case((), seed=seed)).scenes)
        for seed in range(4)
    }  # fmt: skip
    assert len(drawn) == 4


def test_motion_is_continuous_and_reaches_its_corners() -> None:
    motion = strokes(10.0, [100.0, -3.0, 50.0], speed=30.0, acceleration=60.0, dwell=0.2)
    time = np.linspace(0.0, motion.time[-1], 200_001)
    angle, speed = motion.angle(time), motion.speed(time)
    assert np.abs(np.diff(angle)).max() < 30.1 * time[1]
    assert np.abs(np.diff(speed)).max() < 60.1 * time[1]
    assert motion.angle(motion.stops) == pytest.approx([110.0, 107.0, 157.0])
    # A short stroke does not reach full speed.
    assert np.abs(speed[(time > motion.stops[0]) & (time < motion.stops[1])]).max() < 15.0
    stretch, direction, travel = motion.since_reversal(motion.stops)
    assert list(stretch) == [0, 1, 2]
    assert list(direction) == [1.0, -1.0, 1.0]
    assert travel == pytest.approx([100.0, 3.0, 50.0])


@pytest.mark.parametrize(
    "source",
    [
        MaxwellSlip(slips=(1.0, 4.0), shares=(0.5, 0.5)),
        BoucWen(length=4.0, sharpness=1.5, beta=0.7),
    ],
)
def test_hysteresis_saturates_and_remembers(source: MaxwellSlip | BoucWen) -> None:
    question = pose(Case((), seed=2))
    motion = strokes(0.0, [200.0, -100.0, 5.0, -5.0, 50.0], 30.0, 60.0, 0.0)
    scene = question.scenes[0]
    times = motion.stops
    here = type(scene)(
        motion, times, motion.angle(times), motion.speed(times), *[np.zeros(5)] * 3, label="x"
    )
    error = source.signal(question.joint, here, 0)
    assert error[0] == pytest.approx(1.0, abs=1e-4)
    assert error[1] == pytest.approx(-1.0, abs=1e-4)
    assert -1.0 < error[2] < 1.0
    if isinstance(source, MaxwellSlip):  # return-point memory
        assert error[3] == pytest.approx(error[1], abs=1e-9)
    assert error[4] == pytest.approx(1.0, abs=1e-4)


def _columns(question: Question) -> np.ndarray:
    """Constant per run, base harmonics: what any joint may have without a cause."""
    theta = np.concatenate([scene.theta for scene in question.scenes])
    angle = np.radians(theta)[:, None] * question.joint.orders
    return np.column_stack([np.ones(theta.size), np.cos(angle), np.sin(angle)])


#: Blind designs in which the effect leaves no trace at all; in the others another cause
#: (backlash for latency at one speed) explains all of it.
TRACELESS = [
    ("one_direction", "backlash"),
    ("one_direction", "presliding_hysteresis"),
    ("one_load", "torsional_compliance"),
    ("one_load_constant", "torsional_compliance"),
    ("one_load_constant", "stiffening_compliance"),
    ("one_load_constant", "load_dependent_gear_error"),
    ("one_temperature", "thermal_drift"),
    ("one_mount", "reference_error"),
    ("one_run", "zero_slip"),
    ("paper", "backlash"),
    ("paper", "latency"),
    ("paper", "filter_lag"),
    ("paper", "torsional_compliance"),
    ("one_of_everything", "latency"),
    ("one_of_everything", "backlash"),
    ("static_dense", "latency"),
    ("static_dense", "backlash"),
]


@pytest.mark.parametrize(("design", "cause"), TRACELESS)
def test_a_blind_design_does_not_see_the_effect(design: str, cause: str) -> None:
    assert cause in BLIND[design]
    assert pose(Case((cause,), 1.0, 5, design)).visible() < BURIED
    assert pose(Case((cause,), 1.0, 5)).visible() > 100.0


def test_one_speed_makes_latency_a_reversal_error() -> None:
    question = pose(Case(("latency",), 1.0, 7, "one_speed"))
    signal = np.concatenate(question.sources[0].signals(question.joint, question.scenes))
    sign = np.sign(np.concatenate([scene.velocity for scene in question.scenes]))
    columns = np.column_stack([_columns(question), sign])
    rest = signal - columns @ np.linalg.lstsq(columns, signal, rcond=None)[0]
    assert rest.std() < 0.25 * signal.std()


@pytest.mark.parametrize("design", DESIGNS)
def test_every_design_gives_runs_and_a_simulation_file(design: str) -> None:
    question = pose(Case((), 1.0, 0, design))
    noise = question.habit.sigma
    for run, scene in zip(question.runs, question.scenes, strict=True):
        truth = question.joint.pattern(scene.theta) + question.joint.zero
        assert (run.error * 3600.0 - truth).std() == pytest.approx(noise, rel=0.45)
        assert (run.time is None) == (design == "no_columns")
    simulation = tomllib.loads(question.simulation)
    assert simulation["joint"]["gear_ratio"] == question.joint.gear_ratio
    assert len(simulation["harmonic"]) == len(question.joint.lines)


def test_the_same_case_gives_the_same_data_and_the_scale_changes_only_the_size() -> None:
    one, same = pose(Case(("backlash",), 1.0, 4)), pose(Case(("backlash",), 1.0, 4))
    assert all((a.indicated == b.indicated).all() for a, b in zip(one.runs, same.runs, strict=True))
    small = pose(Case(("backlash",), 0.1, 4))
    assert one.joint == small.joint
    assert one.sources[0].size == pytest.approx(10.0 * small.sources[0].size)
