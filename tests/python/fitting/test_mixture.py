"""The default fit under noise of any correlation: no strong order is left out, none is refused."""

from __future__ import annotations

import itertools
import math
import re

import numpy as np
import pytest

import trueangle as ta

SEED = 2_026_112
ORDERS = (1, 3, 8)
SIZES = (80.0, 35.0, 18.0)
NOISE = 4.0


def noise(kind: str, n: int, rng: np.random.Generator) -> np.ndarray:
    """Of standard deviation 1 over a run."""
    white = rng.normal(size=n)
    if kind == "white":
        return white
    if kind == "drift":
        walk = np.cumsum(rng.normal(size=n))
        return math.sqrt(0.5) * ((walk - walk.mean()) / walk.std() + white)
    if kind == "1/f":
        power = np.maximum(np.fft.rfftfreq(2 * n), 0.5 / n)
        found = np.fft.irfft(np.fft.rfft(rng.normal(size=2 * n)) / np.sqrt(power))[:n]
        return found / found.std()
    memory = float(kind)
    found = white.copy()
    for i in range(1, n):
        found[i] = memory * found[i - 1] + math.sqrt(1.0 - memory**2) * white[i]
    return found


def curve(x: np.ndarray, phases: np.ndarray) -> np.ndarray:
    angles = zip(ORDERS, SIZES, phases, strict=True)
    return sum(a * np.cos(np.radians(k * x) + p) for k, a, p in angles)


def columns(x: np.ndarray, orders: tuple[float, ...]) -> np.ndarray:
    waves = [f(np.radians(k * x)) for k in orders for f in (np.cos, np.sin)]
    return np.stack(waves, axis=1) - np.mean(waves, axis=1)


DESIGNS = {"1 x 700": [700], "2 x 250": [250] * 2, "5 unequal": [40, 200, 90, 150, 70]}
KINDS = ["white", "0.6", "0.9", "1/f", "drift"]


def trial(kind: str, arc: float, design: str, seed: int) -> tuple[float, float, float]:
    """Mean squares left by the fit and by least squares with the true orders; share in the band."""
    rng = np.random.default_rng([SEED, seed])
    phases, runs, rows, errors = rng.uniform(0.0, 6.0, 3), [], [], []
    for k, n in enumerate(DESIGNS[design]):
        there = np.sort(rng.uniform(0.0, arc, n))
        x = np.concatenate([there[::2], there[1::2][::-1]])
        error = curve(x, phases) + NOISE * noise(kind, n, rng)
        shown = x + (error + 500.0 * rng.normal()) / 3600.0
        runs.append(ta.CalibrationRun(x, shown, 360.0, time=0.04 * np.arange(n), label=str(k)))
        rows.append(columns(x, ORDERS))
        errors.append(error - error.mean())
    found = ta.fit(runs)
    if arc > 200.0:
        assert set(ORDERS) <= set(found.orders), (kind, arc, design, seed, found.orders)
    grid = np.linspace(0.05, 0.95, 80) * arc
    wanted = curve(grid, phases) - curve(grid, phases).mean()
    told = 3600.0 * found.model.error(grid)
    own = columns(grid, found.orders)
    std = 3600.0 * np.sqrt(np.einsum("ij,jk,ik->i", own, found.covariance[1:, 1:], own))
    best = np.linalg.lstsq(np.concatenate(rows), np.concatenate(errors), rcond=None)[0]
    apart = told - told.mean() - wanted
    with_truth = columns(grid, ORDERS) @ best - wanted
    held = np.mean(np.abs(apart) < 1.96 * std)
    return float(np.mean(apart**2)), float(np.mean(with_truth**2)), float(held)


@pytest.mark.parametrize("design", DESIGNS)
def test_as_good_as_least_squares_that_knows_the_orders(design: str) -> None:
    print("seed", SEED)
    shares = []
    slack = 0.1 * NOISE / math.sqrt(sum(DESIGNS[design]))
    for arc in (360.0, 220.0, 140.0):
        trials = [trial(kind, arc, design, seed) for kind in KINDS for seed in range(4)]
        left, best, held = np.mean(trials, axis=0)
        assert math.sqrt(left) <= 1.25 * math.sqrt(best) + slack, arc
        shares.append(held)
    assert 0.9 < np.mean(shares) < 0.99


def test_one_coefficient_has_one_standard_error_wherever_it_is_told() -> None:
    rng = np.random.default_rng([SEED, 7])
    x = np.linspace(0.0, 720.0, 400, endpoint=False)
    runs = []
    for _ in range(3):
        error = 30.0 * np.cos(np.radians(x)) + 3.0 * noise("0.9", x.size, rng)
        runs.append(ta.CalibrationRun(x, x + error / 3600.0, 360.0))
    fit, orders = ta.fit(runs), ta.select_orders(runs)
    assert fit.orders == (1,)
    row = orders.row(1)
    assert row.standard_error == pytest.approx(float(fit.standard_errors[0][0]), rel=1e-9)
    assert row.probability > 0.99
    white = 3.0 / 3600.0 * math.sqrt(2.0 / 1200.0)
    assert 2.0 * white < row.standard_error < 6.0 * white


def test_runs_of_nothing_have_no_order() -> None:
    found = 0
    for kind, seed in itertools.product(KINDS, range(4)):
        rng = np.random.default_rng([SEED, 100 + seed])
        runs = []
        for _ in range(2):
            x = np.sort(rng.uniform(0.0, 300.0, 200))
            shown = x + 4.0 / 3600.0 * noise(kind, 200, rng)
            runs.append(ta.CalibrationRun(x, shown, 360.0))
        found += bool(ta.select_orders(runs).orders)
    assert found == 0


@pytest.mark.parametrize("count", [3, 6])
def test_intervals_hold_what_runs_differ_by(count):
    """Orders 1 and 2 differ from run to run by 7 and 3 arcsec: no slow noise is it."""
    rng = np.random.default_rng([SEED, count])
    held, size = [], np.array([[100.0, 30.0], [20.0, -30.0]])
    for _ in range(30):
        runs = []
        for _ in range(count):
            x = np.sort(rng.uniform(0.0, 360.0, 120))
            own = size + rng.normal(size=(2, 2)) * [[7.0], [3.0]]
            error = 4.0 * rng.normal(size=120)
            for k in (1, 2):
                turn = np.radians(k * x)
                error += own[k - 1, 0] * np.cos(turn) + own[k - 1, 1] * np.sin(turn)
            runs.append(ta.CalibrationRun(x, x + error / 3600.0, 360.0))
        found = ta.fit(runs)
        assert {1, 2} <= set(found.orders)
        at = 1 + 2 * found.orders.index(1)
        low, high = 3600.0 * found.interval()[at : at + 4].T
        held.append((low < size.ravel()) & (size.ravel() < high))
    print(np.mean(held))
    assert 0.91 <= np.mean(held) <= 0.99


def test_one_sweep_states_what_it_took_as_drift() -> None:
    """A curve of the angle that no few orders are, read once from 10 to 210 deg; then back too."""
    rng = np.random.default_rng(97)
    theta = np.linspace(10.0, 210.0, 400)
    runs = []
    for size, wide in ((0.3, 60), (0.3, 1)):
        curve = np.convolve(np.cumsum(rng.normal(size=399 + wide)), np.ones(wide) / wide, "valid")
        error = size * curve / curve.std() + 0.004 * rng.normal(size=(2, 400))
        runs.append([ta.CalibrationRun(x, x + e, 360.0)
                     for x, e in ((theta, error[0]), (theta[::-1], error[1, ::-1]))])  # fmt: skip
    (one, back), (rough, _) = runs
    found, both = ta.fit(one), ta.fit([one, back])
    (note,) = [note for note in found.notes if "taken as drift: one sweep" in note]
    assert note.startswith(found.summary().splitlines()[1])
    (size,) = re.findall(r"^Not corrected: (\S+) arcsec rms, taken", note)
    assert 0.5 < float(size) / (3600.0 * found.residual_std) < 1.0
    # Without noise, and with printed digits alone, nothing was taken.
    for digits in (12, 4, 3):
        error = 0.9 * np.sin(np.radians(3.0 * theta))
        bare = ta.CalibrationRun(theta, np.round(theta + error, digits), 360.0)
        assert not any("one sweep" in note for note in ta.fit(bare).notes), digits
    assert not any("one sweep" in note for note in both.notes)
    with pytest.raises(ta.errors.NoOrderError, match="one sweep cannot"):
        ta.fit(rough)
