"""Orders in noise that remembers the reading before: none where there is none, and those there are.

Half of the false orders that are promised are asked for: 1 % of the choices.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

import trueangle as ta
from estimation.test_covariance import correlated
from trueangle.fitting.orders.harmonicsums import harmonic_sums
from trueangle.fitting.orders.noise import run_scatter
from trueangle.fitting.orders.noiseshapes import bend_of
from trueangle.fitting.orders.noisespectrum import noise_spectrum
from trueangle.fitting.orders.ordernoise import OrderNoise
from trueangle.fitting.orders.zerogroups import ZeroGroupReadings
from trueangle.support.arrays import Array

SEED = 20_931
SIGMA = 5.0 / 3600.0
LINES = ((1, 30.0), (17, 2.0))


def runs_of(
    rng: np.random.Generator, count: int, readings: int, memory: float, lines: bool
) -> list[ta.CalibrationRun]:
    """Runs over one turn, each with a zero of its own."""
    runs = []
    for _ in range(count):
        x = np.linspace(0.0, 360.0, readings, endpoint=False)
        error: NDArray[np.float64] = SIGMA * correlated(rng, memory, readings) + rng.uniform(-3, 3)
        for order, arcsec in LINES if lines else ():
            error = error + arcsec / 3600.0 * np.sin(np.radians(order * x) + 0.3)
        runs.append(ta.CalibrationRun(x, x + error, 360.0))
    return runs


@pytest.mark.parametrize("memory", [0.0, 0.6, 0.9])
@pytest.mark.parametrize(("count", "readings"), [(1, 200), (2, 36), (2, 200), (4, 72), (8, 36)])
def test_noise_makes_no_orders(count: int, readings: int, memory: float) -> None:
    """30 seeds: 0.3 choices with an order are expected, 4 and more once in ten thousand."""
    print("seed", SEED)
    kept = 0
    for seed in range(30):
        rng = np.random.default_rng([SEED, seed])
        kept += bool(ta.select_orders(runs_of(rng, count, readings, memory, False)).orders)
    assert kept <= 3


@pytest.mark.parametrize(
    ("count", "readings", "least"), [(1, 400, 5), (2, 200, 24), (2, 36, 26), (4, 36, 29)]
)
def test_orders_stand_out_of_noise_that_remembers(count: int, readings: int, least: int) -> None:
    """30 arcsec and, where there is less noise than on average, 2: of noise of 5."""
    print("seed", SEED)
    found = np.zeros(2, dtype=int)
    for seed in range(30):
        rng = np.random.default_rng([SEED, seed])
        orders = ta.select_orders(runs_of(rng, count, readings, 0.9, True)).orders
        found += [order in orders for order, _ in LINES]
        assert len(set(orders) - {order for order, _ in LINES}) <= 1
    assert found[0] >= 28
    assert found[1] >= least


def test_one_run_over_part_of_a_turn_is_asked_in_white_noise() -> None:
    """A line is seen at its neighbours there: they do not tell the noise."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    x = np.linspace(10.0, 200.0, 300)
    error = 0.4 * np.sin(np.radians(1.7 * x)) + 0.02 * correlated(rng, 0.9, x.size)
    run = ta.CalibrationRun(x, x + error, 360.0)
    auto, white, near = (
        ta.select_orders(run, covariance=kind) for kind in ("auto", "white", "hac")
    )
    chances = [[row.log10_false_alarm for row in found.table] for found in (auto, white, near)]
    assert auto.orders == white.orders
    assert chances[0] == chances[1]
    assert chances[2] != chances[1]


@pytest.mark.parametrize("memory", [0.0, 0.9])
def test_turns_of_one_run_tell_its_noise_as_runs_do(memory: float) -> None:
    """Five turns, 20 seeds: no order that is not there, and both that are."""
    print("seed", SEED)
    x = np.linspace(0.0, 5.0 * 360.0, 600, endpoint=False)
    wrong, found = 0, 0
    for seed in range(20):
        rng = np.random.default_rng([SEED, seed])
        error: NDArray[np.float64] = SIGMA * correlated(rng, memory, x.size)
        wrong += bool(ta.select_orders(ta.CalibrationRun(x, x + error, 360.0)).orders)
        for order, arcsec in LINES:
            error = error + arcsec / 3600.0 * np.sin(np.radians(order * x))
        found += {1, 17} <= set(ta.select_orders(ta.CalibrationRun(x, x + error, 360.0)).orders)
    assert wrong <= 2
    assert found >= 16


def test_turns_have_the_freedom_of_their_number() -> None:
    """Of six turns each order has ten degrees of freedom, and white noise those of all orders."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    orders = tuple(range(1, 21))
    turns = [
        ZeroGroupReadings(rng.uniform(size=50), rng.normal(size=50), np.ones(50), str(k))
        for k in range(6)
    ]
    whole = ZeroGroupReadings(*(np.concatenate([t[i] for t in turns]) for i in range(3)), "")  # type: ignore[arg-type]
    one, six = harmonic_sums([whole], orders), harmonic_sums(turns, orders)
    alone, told = OrderNoise(one, 299), OrderNoise(one, 299, passes=six)
    noise, scatter = told.near(())
    assert (alone.own_freedom, told.own_freedom) == (1, 10)
    assert alone.near(())[1] is None
    np.testing.assert_allclose(scatter, run_scatter(six, (), range(20)))
    white = noise.freedoms[int(np.argmin(np.ptp(noise.variances, axis=1)))]
    np.testing.assert_allclose(white, 20 * 10 / bend_of(10).widening)


@pytest.mark.parametrize(("ratio", "asked"), [(None, True), (100.0, True), (1.94, False)])
def test_other_orders_tell_the_noise_of_an_error_that_closes(
    ratio: float | None, asked: bool
) -> None:
    """Lines of a shaft that is elsewhere after a turn are seen at every order."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    (run,) = runs_of(rng, 1, 400, 0.6, True)
    kinds = ("auto", "white", "hac")
    tables = [ta.select_orders(run, gear_ratio=ratio, covariance=kind).table for kind in kinds]
    auto, white, near = ([row.log10_false_alarm for row in table] for table in tables)
    assert auto == (near if asked else white)
    assert near != white


def test_the_noise_near_an_order_makes_its_error() -> None:
    """Memory of 0.9 makes 19 times the variance at the lowest orders, a nineteenth at the highest.

    In readings that go round once in 200: the root of the spectrum, by as many as tell it.
    """
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    table = ta.select_orders(runs_of(rng, 8, 200, 0.9, False)).table
    told = {row.order: row.standard_error * 3600.0 for row in table}
    white = 5.0 * np.sqrt(2.0 / 200.0 / 8.0)
    for order in (2, 5, 20, 90):
        w = 2.0 * np.pi * order / 200.0
        spectrum = np.sqrt((1.0 - 0.81) / abs(1.0 - 0.9 * np.exp(1j * w)) ** 2)
        assert told[order] / white == pytest.approx(spectrum, rel=0.25)


@pytest.mark.parametrize("count", [3, 8])
def test_noise_near_the_same_orders_is_estimated_once(
    count: int, monkeypatch: pytest.MonkeyPatch
) -> None:
    asked: list[bytes] = []

    def counted(orders: Array, told: Array, *rest: Any) -> object:
        asked.append(told.tobytes())
        return noise_spectrum(orders, told, *rest)

    monkeypatch.setattr("trueangle.fitting.orders.ordernoise.noise_spectrum", counted)
    runs = runs_of(np.random.default_rng(SEED), count, 200, 0.6, lines=True)
    assert 1 in ta.select_orders(runs).orders
    assert 0 < len(asked) == len(set(asked))
