"""Errors of units where readings of a run go together: drift, and noise that remembers."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from scipy import signal, stats

import trueangle as ta
from trueangle.fleets.calibration import Calibration
from trueangle.fleets.units import Units, louder_orders
from trueangle.joint.shafts import ShaftOrders

from .made import ARCSEC, units

SEED = 52_400


def drift(rng: np.random.Generator, size: int) -> np.ndarray:
    return 8.0 * rng.normal() * np.linspace(-1.0, 1.0, size)


def memory(rng: np.random.Generator, size: int) -> np.ndarray:
    return 3.0 * signal.lfilter([0.6], [1.0, -0.8], rng.normal(size=size + 99))[99:]


def nothing(rng: np.random.Generator, size: int) -> np.ndarray:
    return np.zeros(size)


@pytest.mark.parametrize("more", [nothing, drift, memory])
def test_errors_of_units_are_what_they_scatter_by(
    more: Callable[[np.random.Generator, int], np.ndarray],
) -> None:
    """Amplitudes of ten units in three runs each: 3.2 errors (rms) of a drift, 3.0 of memory."""
    print("seeds", SEED, "to", SEED + 9)
    pulls = []
    for seed in range(SEED, SEED + 10):
        rng = np.random.default_rng(seed)
        own: dict[str, np.ndarray] = {}

        def kept(u, t, b, own=own):
            own[f"u{u}"] = b.copy()
            return b, 0.0

        places = np.arange(0.0, 360.0, 3.0)
        runs = [
            ta.CalibrationRun(
                run.reference,
                run.indicated + ARCSEC * more(rng, len(run)),
                360.0,
                unit=run.unit,
                label=run.label,
            )
            for run in units(rng, 10, noise=1.0, change=kept, places=places)
        ]
        for unit in ta.fleet(runs, orders=[1, 2, 3, 4]).units:
            sizes = np.hypot(*own[unit.unit].T)
            for size, order in zip(sizes, unit.orders, strict=True):
                if size > 5.0 * order.std / ARCSEC:
                    pulls.append((order.amplitude - ARCSEC * size) / order.std)
    rms = float(np.sqrt(np.mean(np.square(pulls))))
    print(len(pulls), rms)
    # Some 380 numbers: 4 %, and what sixty degrees of freedom tell of each order, 9 %.
    assert 0.8 < rms < 1.2


def test_runs_differ_by_more_than_readings_from_one_percent_on() -> None:
    """Two orders of twelve degrees of freedom each: the limit is that of half a per cent."""
    limit = stats.chi2.isf(0.005, 12.0) / 12.0
    for ratio, kept in ((0.99 * limit, 1.0), (1.01 * limit, 1.01 * limit)):
        one = Calibration(
            unit="u",
            when=None,
            coefficients=np.zeros(4),
            inverse=np.eye(4),
            zero=0.0,
            zero_inverse=1.0,
            squares=1.0,
            freedom=9.0,
            readings=36,
            runs=7,
            repeat_squares=np.full(2, 12.0 * ratio),
            repeat_freedom=12.0,
            repeat_white=np.full(2, 6.0),
        )
        found = louder_orders([one], np.array([2.0]))
        assert found == pytest.approx(np.full(2, kept))
        louder = replace(one, louder=found).blocks()
        assert louder == pytest.approx(kept * one.blocks())


def calibration(number: int, squares: float, apart: float) -> Calibration:
    """Of one order in three runs of 40 readings, of variance 2 within runs."""
    return Calibration(
        unit=f"u{number}",
        when=None,
        coefficients=np.array([1.0, 2.0]) * number,
        inverse=np.eye(2) / 60.0,
        zero=0.0,
        zero_inverse=1.0 / 120.0,
        squares=squares,
        freedom=115.0,
        readings=120,
        runs=3,
        repeat_squares=np.array([apart]),
        repeat_freedom=4.0,
        repeat_white=np.array([4.0 / 20.0]),
        within_squares=2.0 * 111.0,
        within_freedom=111.0,
    )


def test_what_runs_differ_by_is_no_noise_of_their_unit() -> None:
    """Squares about the common pattern hold what a few runs drew: units seem to differ by it."""
    shafts = [ShaftOrders("output", 1.0, (1,))]
    alike = [[calibration(k, 2.0 * 115.0, 0.4)] for k in range(8)]
    units = Units(alike, shafts, 360.0)
    assert units.noise.units == pytest.approx(np.full(8, 2.0))
    assert units.run_variance is None
    apart = [[calibration(k, 2.0 * 111.0 + 20.0 * s, s)] for k, s in enumerate(range(4, 12))]
    units = Units(apart, shafts, 360.0)
    assert units.noise.units == pytest.approx(np.full(8, 2.0))
    # Mean of the sums by their freedom, less 2/20 that noise makes of a coefficient of one run.
    assert units.run_variance == pytest.approx(np.full(2, 7.5 / 4.0 - 0.1))
    assert units.own[0] == pytest.approx(np.tile(7.5 / 4.0 / 3.0 * np.eye(2), (8, 1, 1)))
