"""Some of many readings: blocks in their order, from everywhere, and none where there are few."""

from __future__ import annotations

import numpy as np
import pytest

from trueangle.fitting.orders.zerogroups import ZeroGroupReadings, some_readings


def unit(size: int, time: bool) -> ZeroGroupReadings:
    number = np.arange(size, dtype=float)
    return ZeroGroupReadings(number, number, np.ones(size), "a", 0.5 * number if time else None)


@pytest.mark.parametrize("time", [False, True])
def test_of_many_readings_as_many_are_kept_in_blocks_of_all_runs(time: bool) -> None:
    units = [unit(size, time) for size in (40_000, 3000, 17_000)]
    found = some_readings(units, 6000)
    kept = sum(part.turns.size for part in found)
    assert 4000 < kept < 8000
    for part, whole in zip(found, units, strict=True):
        share = part.turns.size / whole.turns.size
        assert 0.0 < share < 0.3
        # A gap between blocks is one in time, too.
        assert part.time is not None
        np.testing.assert_array_equal(part.time, part.turns * (0.5 if time else 1.0))
        assert np.mean(np.diff(part.turns) == 1.0) > 0.98
        # From everywhere: no quarter of the run is left out of long ones.
        if whole.turns.size > 16_000:
            assert np.unique(part.turns * 4 // whole.turns.size).size == 4


def test_few_readings_stay_as_they_are() -> None:
    units = [unit(40, False), unit(60, False)]
    assert some_readings(units, 100) == units
