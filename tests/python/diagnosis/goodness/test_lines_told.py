"""Lines that are drawn anew in every run, as they are told: size, place, and in which unit."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from trueangle.diagnosis.goodness.periodogram import order_test, time_test

from .readings import leftover

SEED = 87_000


@pytest.mark.parametrize("size", [1.5, 6.0])
@pytest.mark.parametrize("timed", [True, False])
def test_a_line_in_time_is_told_with_its_size_and_frequency(timed: bool, size: float) -> None:
    """Root mean square is the amplitude over the root of 2; without stamps readings count."""
    print(f"seed {SEED}")
    left = leftover("rich", "gauss", SEED)
    clock = left.clock if timed else np.arange(len(left)) % 300.0
    phase = np.random.default_rng(SEED).uniform(0.0, 6.0, 24)[left.run]
    line = size * np.cos(2.0 * np.pi * 0.21 * clock + phase)
    found = time_test(replace(left, residual=left.residual + line, clock=clock, timed=timed))
    assert found is not None
    assert found.p < 1e-6
    assert found.at == pytest.approx(0.21, rel=0.02)
    assert found.rms == pytest.approx(size / np.sqrt(2.0), rel=0.15)
    unit = "Hz" if timed else "cycles per reading"
    assert f"a line of {found.at:.5g} {unit}" in found.says
    assert ("or an alias" in found.says) == (not timed)
    assert found.looks_like == "a line in time"


def test_a_line_of_an_order_is_told_with_its_size_and_order() -> None:
    print(f"seed {SEED}")
    left = leftover("rich", "gauss", SEED)
    phase = np.random.default_rng(SEED).uniform(0.0, 6.0, 24)[left.run]
    line = 2.0 * np.cos(9.3 * left.theta + phase)
    found = order_test(replace(left, residual=left.residual + line), 30.0)
    assert found is not None
    assert found.p < 1e-6
    assert found.at == pytest.approx(9.3, rel=0.02)
    assert found.rms == pytest.approx(np.sqrt(2.0), rel=0.15)
    assert f"a line of order {found.at:.5g}" in found.says
    # Of noise alone nothing stands out, and beyond the highest order nothing is looked for.
    none = order_test(left, 30.0)
    beyond = order_test(replace(left, residual=left.residual + line), 6.0)
    assert none is not None
    assert beyond is not None
    assert none.p > 1e-3
    assert beyond.at is not None
    assert beyond.at <= 6.0
