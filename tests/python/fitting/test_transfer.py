"""What is said of a further run, and of a later stretch, against refits and from both sides."""

from __future__ import annotations

import numpy as np
import pytest
from scipy import stats

import trueangle as ta
from trueangle.errors import NoModelError
from trueangle.fitting import transfer
from trueangle.fitting.problem import Problem
from trueangle.fitting.transfer import (
    check_later_segment,
    check_new_run,
    gains_of_runs,
    gains_of_segments,
)
from trueangle.joint.shafts import resolve_orders

SEED = 20_300
LOW = tuple(range(1, 13))


def run_of(x: np.ndarray, error: np.ndarray, weights: np.ndarray | None = None):
    return ta.CalibrationRun(x, x + error, 360.0, weights=weights)


def rows(run, orders) -> tuple[np.ndarray, np.ndarray]:
    """Weighted columns and errors about the weighted mean; weights of mean 1."""
    weight = np.ones(len(run)) if run.weights is None else run.weights / run.weights.mean()
    angle = np.radians(np.outer(run.reference, orders))
    both = np.column_stack([np.cos(angle), np.sin(angle), run.indicated - run.reference])
    both = np.sqrt(weight)[:, None] * (both - np.average(both, axis=0, weights=weight))
    return both[:, :-1], both[:, -1]


@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize("orders", [[1.0, 4.0], [3.0, 20.5]])
def test_gains_and_what_is_shared_are_those_of_refits_to_the_other_runs(
    orders: list[float], weighted: bool
) -> None:
    """Runs of unlike lengths, and weights whose scale is nobody's."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    runs = []
    for size in (90, 200, 500):
        x = np.sort(rng.uniform(0.0, 360.0, size))
        error = 0.1 * np.sin(np.radians(x)) + rng.uniform(0.02, 0.2) * np.cos(np.radians(4 * x))
        weights = rng.uniform(0.3, 2.0, size) * 10.0 ** rng.integers(-2, 3) if weighted else None
        runs.append(run_of(x, error + 0.05 * rng.normal(size=size), weights))
    found = gains_of_runs(runs, orders, "reference")
    every = [*orders, *(k for k in LOW if k not in orders)]
    gains, shared, noise, shown = [], [], [], []
    for i, run in enumerate(runs):
        decrease = []
        for chosen in (orders, every):
            parts = [rows(other, chosen) for j, other in enumerate(runs) if j != i]
            design, error = (np.concatenate([part[k] for part in parts]) for k in (0, 1))
            b = np.linalg.lstsq(design, error, rcond=None)[0]
            mine, y = rows(run, chosen)
            decrease.append(float(y @ y - (y - mine @ b) @ (y - mine @ b)) / len(run))
            own = y - mine @ np.linalg.lstsq(mine, y, rcond=None)[0]
            if chosen is orders:
                # Of the gain 2 b'm - b'Gb the noise of the run is in m alone.
                power = float((mine @ b) @ (mine @ b))
                noise.append(4.0 * float(own @ own) / len(run) * power / len(run) ** 2)
            else:
                rest = float(own @ own)
                by_chance = mine.shape[1] / len(run) * rest
                shown.append((float(y @ y) - rest - by_chance) / len(run))
        gains.append(decrease[0])
        shared.append(decrease[1])
    np.testing.assert_allclose(found.gains, gains, rtol=1e-4, atol=1e-7)
    assert found.shared == pytest.approx(np.mean(shared), rel=1e-4, abs=1e-7)
    assert found.noise == pytest.approx(np.mean(noise), rel=1e-4)
    assert found.shown == pytest.approx(np.mean(shown), rel=1e-4)


def test_what_a_run_shows_is_without_what_noise_adds() -> None:
    """The power of its lines, by the mean of many: noise as large adds an eighth of it else."""
    print("seed", SEED + 1)
    rng = np.random.default_rng(SEED + 1)
    x = np.arange(200) * 1.8
    line = np.sqrt(2.0) * np.sin(np.radians(3.0 * x))
    found = [
        gains_of_runs(
            [run_of(x, line + rng.normal(size=200)) for _ in range(3)], [3.0], "reference"
        )
        for _ in range(40)
    ]
    # A run's tells it to 0.15.
    assert np.mean([f.shown for f in found]) == pytest.approx(1.0, abs=4.0 * 0.15 / np.sqrt(120.0))


@pytest.mark.parametrize(("size", "told"), [(3, False), (4, True)])
def test_readings_for_each_column_of_each_run(size: int, told: bool) -> None:
    """Two at least: of one order and two runs eight in all."""
    x = np.linspace(0.0, 300.0, size)
    runs = [run_of(x, np.sin(np.radians(x))) for _ in range(2)]
    assert (gains_of_runs(runs, [1.0], "reference") is not None) == told
    assert gains_of_runs(runs[:1], [1.0], "reference") is None


@pytest.mark.parametrize(
    ("spread", "noise", "refused"),
    [(0.49, 0.0, False), (0.51, 0.0, True), (0.9, 0.57, False), (0.9, 0.55, True),
     (0.3, 0.5, False)],
)  # fmt: skip
def test_the_mean_gain_exceeds_twice_the_scatter_beyond_that_of_noise(
    spread: float, noise: float, refused: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of a mean of 1: sqrt(0.81 - 0.56) is a half."""
    gains = 1.0 + spread * np.array([1.0, -1.0, 0.0])  # of this deviation
    given = transfer._Gains(gains, noise, 1.0, 1.0)
    monkeypatch.setattr(transfer, "gains_of_runs", lambda *given_: given)
    wanted = resolve_orders([2, 3])
    if not refused:
        check_new_run([None] * 3, wanted, "reference")
        return
    with pytest.raises(NoModelError, match="order 2, 3 would make the error of 0 of 3 runs larger"):
        check_new_run([None] * 3, wanted, "reference")


@pytest.mark.parametrize("count", [3, 6])
@pytest.mark.parametrize(
    ("share", "shared", "beyond", "refused"),
    [
        (0.49, 0.49, 0.99, True),
        (0.49, 0.49, 1.01, False),
        (0.51, 0.1, 0.99, False),
        (0.1, 0.51, 0.99, False),
    ],
)
def test_runs_that_share_little_must_gain_more_than_the_best_of_a_hundred_by_chance(
    count: int, share: float, shared: float, beyond: float, refused: bool,
    monkeypatch: pytest.MonkeyPatch,
) -> None:  # fmt: skip
    """Student's t at 5 % over a hundred, of the mean of so many runs."""
    limit = stats.t.isf(0.05 / 100.0, count - 1) / np.sqrt(count)
    spread = np.linspace(-1.0, 1.0, count)
    mean = share
    gains = mean + mean / (beyond * limit) * spread / spread.std(ddof=1)
    # All of the scatter is the noise's.
    given = transfer._Gains(gains, 10.0, 1.0, shared)
    monkeypatch.setattr(transfer, "gains_of_runs", lambda *given_: given)
    runs = [None] * count
    if not refused:
        check_new_run(runs, resolve_orders([2]), "reference")
        return
    with pytest.raises(NoModelError, match=rf"they share 49 % \(order 2\), no more than {count}"):
        check_new_run(runs, resolve_orders([2]), "reference")


def gains(x: np.ndarray, orders=(1,)) -> np.ndarray | None:
    rng = np.random.default_rng(SEED + 2)
    run = run_of(x, 0.1 * np.sin(np.radians(x)) + 0.01 * rng.normal(size=x.size))
    problem = Problem([run], resolve_orders(list(orders)), "reference")
    return gains_of_segments(problem, problem.base)


@pytest.mark.parametrize(("travel", "looked_at"), [(59.0, 4), (61.0, None), (375.0, None),
                                                   (385.0, 2), (720.0, 4)])  # fmt: skip
def test_places_count_where_another_stretch_was_or_travel_is_short(
    travel: float, looked_at: int | None
) -> None:
    """A sixth of a turn is short; 25 deg twice are 13 % of the readings, 15 deg are 8 %."""
    size = 400 if travel > 300.0 else 100
    found = gains(np.linspace(0.0, travel, size, endpoint=False))
    assert (None if found is None else found.size) == looked_at


@pytest.mark.parametrize(("size", "told"), [(39, False), (40, True)])
def test_a_stretch_has_ten_readings_at_least(size: int, told: bool) -> None:
    found = gains(np.linspace(0.0, 50.0, size))
    assert (found is not None) == told


@pytest.mark.parametrize(
    ("mean", "std", "refused"),
    [(1.0, 0.99, False), (1.0, 1.01, True), (1.0, 0.8, False), (-1.0, 0.1, True)],
)
def test_the_mean_gain_of_stretches_exceeds_their_deviation(
    mean: float, std: float, refused: bool, monkeypatch: pytest.MonkeyPatch
) -> None:
    found = mean + std * np.sqrt(1.5) * np.array([1.0, 0.0, -1.0, 0.0])
    run = run_of(np.arange(40.0), np.zeros(40))
    problem = Problem([run], resolve_orders([1]), "reference")
    monkeypatch.setattr(transfer, "gains_of_segments", lambda *given: found)
    if refused:
        worse = np.count_nonzero(found <= 0.0)
        with pytest.raises(NoModelError, match=f"error of {worse} of 4 segments"):
            check_later_segment(problem, problem.base)
    else:
        check_later_segment(problem, problem.base)
    # Better everywhere is enough, however unevenly.
    uneven = np.array([0.1, 0.1, 5.0, 0.1])
    monkeypatch.setattr(transfer, "gains_of_segments", lambda *given: uneven)
    check_later_segment(problem, problem.base)
