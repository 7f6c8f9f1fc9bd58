"""Tests of what is bound to time: even p values for noise, and each sees what it is for."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from trueangle.diagnosis.goodness import Evidence, Leftover
from trueangle.diagnosis.goodness.events import reversal_test, start_test, steps_test

from .readings import Array

RUNS, READINGS, SEEDS = 10, 240, 240

TESTS: dict[str, Callable[[Leftover], Evidence | None]] = {
    "steps between levels": steps_test,
    "relaxes after reversals": reversal_test,
    "relaxes after the start of a run": start_test,
}


def readings(kind: str, seed: int) -> Leftover:
    """Runs there and back three times, a reading every tenth of a second, with noise alone."""
    rng = np.random.default_rng([seed, *map(ord, kind)])
    white = rng.normal(size=(READINGS, RUNS))
    if kind == "t5":
        white = rng.standard_t(5, (READINGS, RUNS))
    elif kind == "uniform":
        white = rng.uniform(-1.7, 1.7, (READINGS, RUNS))
    elif kind.startswith("ar"):
        rho = float(kind.split()[1])
        for i in range(1, READINGS):
            white[i] = rho * white[i - 1] + np.sqrt(1.0 - rho**2) * white[i]
    elif kind == "walk":
        white = 0.2 * np.cumsum(white, axis=0) + rng.normal(size=(READINGS, RUNS))
    clock = np.tile(np.arange(READINGS) * 0.1, RUNS)
    saw = np.mod(clock / 8.0 + np.repeat(rng.uniform(size=RUNS), READINGS), 1.0)
    direction = np.where(saw < 0.5, 1.0, -1.0)
    theta = 2.0 - 4.0 * np.abs(saw - 0.5)
    run = np.repeat(np.arange(RUNS), READINGS)
    return Leftover(white.T.ravel(), theta, direction, run, clock)


@pytest.mark.parametrize("kind", ["gauss", "t5", "uniform", "ar 0.5", "ar 0.95", "ar 0.99", "walk"])
@pytest.mark.parametrize("looks_like", TESTS)
def test_p_values_of_noise_are_even(looks_like: str, kind: str) -> None:
    p = []
    for seed in range(SEEDS):
        found = TESTS[looks_like](readings(kind, seed))
        assert found is not None
        p.append(found.p)
    # Kolmogorov and Smirnov: the chance of more is 1e-3. Tests may be careful, never hasty.
    p.sort()
    even = (np.arange(SEEDS) + 1.0) / SEEDS
    above = float(np.max(even - np.array(p)))
    assert above < 1.95 / np.sqrt(SEEDS), (looks_like, kind, above)
    below = float(np.max(np.array(p) - even))
    assert below < 0.5, (looks_like, kind, below)


def seats(left: Leftover, rng: np.random.Generator) -> Array:
    flips = rng.uniform(size=len(left)) < 4.0 / READINGS
    return np.where(np.cumsum(flips) % 2, 1.0, -1.0)


def relaxing(left: Leftover, rng: np.random.Generator) -> Array:
    turned = (np.diff(left.direction, prepend=0.0) != 0.0) | (np.diff(left.run, prepend=-1) != 0)
    since = left.clock - left.clock[np.flatnonzero(turned)][np.cumsum(turned) - 1]
    return left.direction * np.exp(-since / 0.8)


def settling(left: Leftover, rng: np.random.Generator) -> Array:
    return np.exp(-left.clock / 4.0)


HIDDEN = dict(zip(TESTS, (seats, relaxing, settling), strict=True))


@pytest.mark.parametrize("kind", ["gauss", "ar 0.5"])
@pytest.mark.parametrize("looks_like", TESTS)
def test_each_sees_what_it_is_for(looks_like: str, kind: str) -> None:
    rng = np.random.default_rng(5)
    left = readings(kind, 9_000)
    hidden = HIDDEN[looks_like](left, rng)
    left.residual[:] += 2.0 * hidden / float(np.std(hidden))
    found = TESTS[looks_like](left)
    assert found is not None
    assert found.looks_like == looks_like
    assert found.p < 1e-4, found
    # At least half of what is there is told, and not twice of it.
    assert 1.0 < found.rms < 4.0, found
