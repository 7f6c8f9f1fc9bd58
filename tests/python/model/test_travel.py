"""Partial travel: spans, penalties, and amplitudes that stay small."""

import itertools
import math

import numpy as np
import pytest

import trueangle as ta
from trueangle import _core
from trueangle.fitting import ridge
from trueangle.fitting.problem import Problem
from trueangle.joint.shafts import resolve_orders
from trueangle.model.corrector import _Velocity
from trueangle.runs.travel import Span, covered_span


@pytest.mark.parametrize(
    ("angles", "expected"),
    [
        (np.arange(0, 360, 10.0), (0.0, 360.0, True)),
        (np.arange(0, 360, 60.0), (0.0, 360.0, True)),
        (np.linspace(10, 200, 191), (10.0, 200.0, False)),
        (np.linspace(-100, 90, 191), (260.0, 450.0, False)),
        (np.linspace(0, 339, 340), (0.0, 339.0, False)),
        (np.linspace(0, 341, 342), (0.0, 360.0, True)),
        (np.linspace(0, 190, 191) + 3600.0, (0.0, 190.0, False)),
    ],
)
def test_span(angles, expected):
    assert covered_span([angles], 360.0) == pytest.approx(expected)


@pytest.mark.parametrize(("stop", "full"), [(339.0, False), (341.0, True)])
def test_span_of_many_angles(stop, full):
    """Of many angles, bins of a turn: a few show at first whether any travel may be missing."""
    span = covered_span([np.linspace(0.0, stop, 40_000)], 360.0)
    assert span.full == full
    assert full or span.stop == pytest.approx(stop, abs=360.0 / 4096)


@pytest.mark.parametrize("arc", [90.0, 190.0, 270.0])
@pytest.mark.parametrize("runs", [1, 3])
def test_an_arc_gives_a_usable_model_with_small_amplitudes(arc, runs):
    """True error: not a harmonic series, 0.5 deg; noise 0.1 deg."""

    def truth(x):
        return 0.5 * np.tanh(3 * np.sin(np.radians(x - 20.0))) + 0.2 * np.cos(np.radians(2 * x))

    rng = np.random.default_rng(21)
    data = []
    for _ in range(runs):
        x = rng.uniform(0, arc, 300)
        data.append(ta.CalibrationRun(x, x + truth(x) + 0.1 * rng.normal(size=300) + 5.0, 360.0))
    result = ta.fit(data, orders=range(1, 9))
    inside = np.linspace(0, arc, 400)
    difference = result.model.error(inside) - truth(inside)
    # As good as the noise of one reading, everywhere on the arc.
    assert difference.std() < 0.1
    assert result.model.amplitudes.sum() < 5.0
    assert result.model.partial_span == pytest.approx((0.0, arc), abs=5.0)
    (told,) = (note for note in result.notes if "extrapolated" in note)
    assert " deg only" in told


@pytest.mark.parametrize(
    ("span", "period", "told"),
    [
        ((3.45, 9.11), 2 * np.pi, "-2.833 to 2.827 rad"),
        ((260.0, 450.0), 360.0, "-100 to 90 deg"),
        ((10.0, 200.0), 360.0, "10 to 200 deg"),
        ((0.5, 2.75), 1.0, "0.5 to 2.75 turn"),  # several turns are not folded
    ],
)
def test_a_span_is_told_with_its_unit_within_a_turn(span, period, told):
    assert Span(*span, False).describe(period) == told


@pytest.mark.parametrize("runs", [1, 3])
@pytest.mark.parametrize("count", [300, 6000])  # by rows, and by one pass of moments
@pytest.mark.parametrize("weighted", [False, True])
def test_penalties_are_scored_as_by_a_fit_each(runs, count, weighted):
    """Against one least-squares fit, by numpy, of every fold under every penalty."""
    rng = np.random.default_rng(5)
    data, orders = [], range(1, 6)
    for _ in range(runs):
        x = rng.uniform(-60.0, 120.0, count)
        e = 0.5 * np.tanh(3 * np.sin(np.radians(x))) + 0.1 * rng.normal(size=count)
        w = rng.integers(0, 3, count).astype(float) if weighted else None
        data.append(ta.CalibrationRun(x, x + e + rng.uniform(-9, 9), 360.0, weights=w))
    problem = Problem(data, resolve_orders(orders), "reference")
    found = ridge._folds(problem, problem.base)
    if runs > 1:
        parts = [(run.reference, run.indicated, run.weights) for run in data]
    else:
        (run,) = data
        cuts = np.digitize(run.reference, np.quantile(run.reference, np.arange(1, 10) / 10), True)
        cut = lambda v, j: None if v is None else v[cuts == j]  # noqa: E731
        columns = run.reference, run.indicated, run.weights
        parts = [tuple(cut(column, j) for column in columns) for j in range(10)]

    def rows(part):
        x, y, w = part
        design = np.column_stack([f(k * np.radians(x)) for k in orders for f in (np.cos, np.sin)])
        return design, y - x, np.ones(x.size) if w is None else w

    def centred(design, error, w):
        mean = lambda v: np.average(v, axis=0, weights=w)  # noqa: E731
        return (design - mean(design)) * np.sqrt(w)[:, None], (error - mean(error)) * np.sqrt(w)

    slow = np.zeros(len(ridge._PENALTIES))
    for j, part in enumerate(parts):
        others = [rows(p) for i, p in enumerate(parts) if i != j]
        if runs > 1:
            pieces = [centred(*other) for other in others]
            kept, target = np.vstack([a for a, _ in pieces]), np.concatenate([b for _, b in pieces])
        else:
            design, error, w = (np.concatenate(column) for column in zip(*others, strict=True))
            kept, target = centred(design, error, w)
        total = sum(w.sum() for _, _, w in others)
        held, aim, weight = rows(part)
        for i, penalty in enumerate(ridge._PENALTIES):
            below = np.sqrt(penalty * total) * np.eye(kept.shape[1])
            stacked = np.vstack([kept, below]), np.concatenate([target, np.zeros(len(below))])
            solution = np.linalg.lstsq(*stacked)[0]
            left = aim - held @ solution
            if runs > 1:
                zero = np.average(left, weights=weight)
            else:
                zero = np.average(error - design @ solution, weights=w)
            slow[i] += np.average((left - zero) ** 2, weights=weight)
    _, fast = _core.ridge_path(found, runs > 1, ridge._PENALTIES)
    # Plain least squares on an arc: condition 1e4, so 1e-12 of what the fit loses.
    assert fast == pytest.approx(slow, rel=1e-6)


def test_a_full_turn_is_never_penalised():
    theta = np.arange(0.0, 360.0, 5.0)
    run = ta.CalibrationRun(theta, theta + np.sin(np.radians(theta)), 360.0)
    assert ta.fit(run, orders=range(1, 9)).ridge == 0.0


def test_a_given_penalty_is_kept_and_zero_means_none():
    x = np.linspace(0, 200, 300)
    rng = np.random.default_rng(1)
    run = ta.CalibrationRun(x, x + np.sin(np.radians(x)) + 0.1 * rng.normal(size=300), 360.0)
    assert ta.fit(run, orders=range(1, 5), ridge=0.01).ridge == 0.01
    wild = ta.fit(run, orders=range(1, 7), ridge=0.0)
    tame = ta.fit(run, orders=range(1, 7))
    assert wild.condition_number > 1e3
    assert tame.model.amplitudes.sum() < wild.model.amplitudes.sum()


SEED = 40_771
PERIOD = 360.0


def by_loop(angle: list[float], time: list[float], last: float) -> list[float]:
    """Backward differences; of samples before which no time has passed, the velocity before.

    Before any velocity that of the first later sample holds, and 0 where there is none.
    """
    found = [math.nan] * len(angle)
    known = [i for i in range(len(angle)) if math.isfinite(angle[i]) and math.isfinite(time[i])]
    for before, i in itertools.pairwise(known):
        if time[i] > time[before]:
            step = math.remainder(angle[i] - angle[before], PERIOD)
            last = step / (time[i] - time[before])
        found[i] = last
    if known:
        found[known[0]] = math.nan
        later = [found[i] for i in known if math.isfinite(found[i])]
        for i in known:
            if not math.isfinite(found[i]):
                found[i] = later[0] if later else 0.0
    return found


def samples(seed: int, count: int = 60) -> tuple[np.ndarray, np.ndarray]:
    """Samples through many turns, some at equal times, some not finite."""
    print("seed", seed)
    rng = np.random.default_rng(seed)
    angle = np.cumsum(rng.uniform(-170.0, 175.0, count)) % PERIOD
    time = np.cumsum(rng.integers(0, 3, count) * 0.25)
    angle[rng.integers(0, count, 4)] = np.nan
    time[rng.integers(0, count, 4)] = np.nan
    return angle, time


@pytest.mark.parametrize("seed", range(SEED, SEED + 8))
def test_velocity_is_that_of_the_loop(seed: int) -> None:
    angle, time = samples(seed)
    wanted = by_loop(angle.tolist(), time.tolist(), math.nan)
    np.testing.assert_allclose(_Velocity(PERIOD)(angle, time), wanted, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("seed", range(SEED, SEED + 8))
def test_batches_of_any_size_give_what_all_give_at_once(seed: int) -> None:
    """From the first velocity on, also by a state that was kept."""
    angle, time = samples(seed)
    whole = _Velocity(PERIOD)(angle, time)
    rng = np.random.default_rng(seed)
    ends = [0, 12, *sorted(rng.integers(12, len(angle), 6).tolist()), len(angle)]
    parts, state = [], (math.nan, math.nan, math.nan)
    for start, stop in itertools.pairwise(ends):
        velocity = _Velocity(PERIOD)
        velocity.state = state
        parts.append(velocity(angle[start:stop], time[start:stop]))
        state = velocity.state
    np.testing.assert_allclose(np.concatenate(parts), whole, rtol=1e-12)
    known = np.flatnonzero(np.isfinite(angle + time))
    assert state == (angle[known[-1]], time[known[-1]], whole[known[-1]])


def test_samples_before_which_no_time_has_passed_stand_still_until_one_moves() -> None:
    velocity = _Velocity(PERIOD)
    assert velocity([1.0, 2.0], [3.0, 3.0]).tolist() == [0.0, 0.0]
    assert velocity(4.0, 3.5) == 4.0
    assert velocity([4.0, 9.0], [3.5, 3.5]).tolist() == [4.0, 4.0]
    velocity.reset()
    assert velocity([1.0, 2.0, 4.0], [3.0, 3.0, 4.0]).tolist() == [2.0, 2.0, 2.0]
