"""The noise at an order's passing frequency: that of the noise itself, motion taken beside it."""

from __future__ import annotations

import numpy as np
import pytest

import trueangle as ta
from selfcalibration.rotor import ARCSEC
from selfcalibration.test_pulls import LINES, coasting
from trueangle.selfcalibration import orderchoice, spindown, steady

SEED = 71_000
ORDERS = (1.0, 3.0, 5.0)
SIZE = 20.0


def fitted(monkeypatch: pytest.MonkeyPatch, seed: int, memory: float) -> steady.SteadyFit:
    """The fit of a coast of four seconds whose noise remembers."""
    fits: list[steady.SteadyFit] = []

    def asked(fit: steady.SteadyFit, orders: tuple[float, ...]) -> np.ndarray:
        fits.append(fit)
        return orderchoice.noise_spectrum_at(fit, orders)

    monkeypatch.setattr(spindown, "noise_spectrum_at", asked)
    log = coasting(np.random.default_rng(seed), memory, size=SIZE)
    ta.selfcal(log, orders=list(LINES), loop="open", ripple="none")
    return fits[-1]


@pytest.mark.parametrize("memory", [0.7, -0.5])
def test_it_is_the_noise_of_all_readings_where_orders_pass(
    monkeypatch: pytest.MonkeyPatch, memory: float
) -> None:
    """``S(f) = (1 - r²) / |1 - r exp(-2πif)|²`` at ``f = k ω Δt``, times the noise's variance.

    Motion takes most of what is slow, and of noise that remembers that is a fifth of all.
    """
    print("seeds", SEED, "to", SEED + 7)
    ratios = []
    for seed in range(SEED, SEED + 8):
        fit = fitted(monkeypatch, seed, memory)
        passing = np.multiply.outer(ORDERS, fit.readings.speed * np.diff(fit.readings.time).mean())
        shape = (1.0 - memory**2) / np.abs(1.0 - memory * np.exp(-2j * np.pi * passing)) ** 2
        said = orderchoice.noise_spectrum_at(fit, ORDERS) * fit.projected.variance
        ratios.append(said / ((SIZE * ARCSEC) ** 2 * shape.mean(axis=1)))
    first, *others = np.mean(ratios, axis=0)
    # One of 1600 readings scatters by 7 %. Order 1 passes where motion takes noise, too: there it
    # is as loud as a little above, up to a fifth too little.
    assert others == pytest.approx(np.ones(2), abs=0.1)
    assert 0.7 < first < 1.2


def test_parts_make_the_whole_and_slow_ones_are_louder_in_slow_noise(
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    print("seed", SEED + 20)
    fit = fitted(monkeypatch, SEED + 20, 0.7)
    slow = (fit.readings.speed < np.median(fit.readings.speed)).astype(np.int64)
    whole = orderchoice.noise_spectrum_at(fit, ORDERS)
    fast_part, slow_part = orderchoice.noise_spectrum_at(fit, ORDERS, slow)
    share = slow.mean()
    assert (1.0 - share) * fast_part + share * slow_part == pytest.approx(whole, rel=1e-9)
    assert (slow_part > fast_part).all()
    # The higher an order, the farther down the slope its two passing frequencies lie.
    assert (np.diff(slow_part / fast_part) > 0.0).all()


def test_parts_of_white_noise_are_alike(monkeypatch: pytest.MonkeyPatch) -> None:
    print("seed", SEED + 30)
    fit = fitted(monkeypatch, SEED + 30, 0.0)
    halves = np.arange(fit.readings.size) % 2
    assert orderchoice.noise_spectrum_at(fit, ORDERS, halves).tolist() == [[1.0] * 3] * 2
