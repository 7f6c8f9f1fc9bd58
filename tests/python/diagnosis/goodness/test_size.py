"""Noise alone is called noise, whatever its kind and whatever was run."""

from __future__ import annotations

import numpy as np
import pytest

from trueangle.diagnosis.goodness import LEVEL, Leftover, goodness_of_fit
from trueangle.diagnosis.goodness.periodogram import order_test, time_test

from .readings import DESIGNS, NOISES, leftover, noise

#: Data sets of each design and kind; false alarms allowed of all sets of a kind. At a level of
#: 1 % the 24 sets have 4 or more in 0.01 % of such tests.
SETS, ALARMS = 3, 3

#: Top order that is looked for.
TOP = 110


@pytest.mark.parametrize("kind", NOISES)
def test_noise_alone_is_not_unexplained(kind: str) -> None:
    alarms = []
    for design in DESIGNS:
        for seed in range(SETS):
            fit = goodness_of_fit(leftover(design, kind, 7_000 + seed), TOP)
            if fit.found:
                alarms.append((design, seed, fit.firing[0]))
    assert len(alarms) <= ALARMS, alarms


def test_p_values_are_not_only_small_but_spread() -> None:
    """A test that can never fire has no size: p values below a half must be common."""
    smallest = [
        min(item.p for item in goodness_of_fit(leftover("split", "gauss", 300 + s), TOP).evidence)
        for s in range(8)
    ]
    assert min(smallest) > LEVEL / 100.0
    assert sum(p < 0.5 for p in smallest) >= 4, smallest


@pytest.mark.parametrize("rho", [0.5, 0.95])
def test_evenly_taken_readings_have_no_lines_at_multiples_of_their_rate(rho: float) -> None:
    """Correlated noise at several rates: its slow part comes back at each of them."""
    rng = np.random.default_rng(int(100 * rho))
    p: dict[str, list[float]] = {"time": [], "place": []}
    for _ in range(24):
        rates = np.repeat(rng.uniform(0.5, 4.0, 6), 240)
        run = np.repeat(np.arange(6), 240)
        e = np.concatenate([noise(f"ar {rho}", np.arange(240.0), rng) for _ in range(6)])
        row = np.tile(np.arange(240.0), 6)
        theta = rates * np.abs(row - 120.3) / 25.0
        left = Leftover(e, theta, np.sign(row - 120.3), run, row / rates)
        for name, found in (
            ("time", time_test(left, rho)),
            ("place", order_test(left, TOP, rho)),
        ):
            assert found is not None
            p[name].append(found.p)
    for values in p.values():
        # Alarms at 1 %: 3 or more of 24 have a chance of 0.2 %; some are common.
        assert sum(value < 0.01 for value in values) < 3, sorted(values)[:5]
        assert min(values) < 0.3
