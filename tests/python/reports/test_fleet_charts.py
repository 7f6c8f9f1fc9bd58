"""The charts of units calibrated again stand on the page as the fleet has their numbers."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

import trueangle as ta
from fleets.made import units
from trueangle.reports import fleet as page
from trueangle.reports.fleet import FleetReport

SEED = 71_209
MONTHS = tuple(f"2026-{month:02d}-10" for month in (1, 3, 5, 7, 9))


def changed(u: int, t: int, b: np.ndarray) -> tuple[np.ndarray, float]:
    b[0] += np.array([12.0 * t, 0.0]) * (u == 1)  # drifts
    b[1] += np.array([0.0, 60.0 * (t == 2)]) * (u == 2)  # and is as before
    return b, 0.0


@pytest.mark.parametrize("dates", [2, 3, 5])
def test_a_chart_has_every_date_every_order_and_the_limit(dates: int, monkeypatch: Any):
    print(f"seed {SEED}")
    made = units(np.random.default_rng(SEED), 8, dates=MONTHS[:dates], change=changed)
    fleet = ta.fleet(made, orders=[1, 2])
    drawn: list[Any] = []
    monkeypatch.setattr(page, "still_picture", lambda *args: drawn.append(args) or "")
    for unit in ("u1", "u2", "u3"):
        picture = FleetReport(fleet)._chart(unit)
        rows = [row for row in fleet.history if row.unit == unit]
        assert len(rows) == dates - 1
        marks, across, up, *_ = drawn.pop()
        limit, *lines = marks
        assert across.limits == (1.5, dates + 0.5)  # half a date on either side
        assert across.ticks == [float(date) for date in range(2, dates + 1)]
        assert limit.arrays == (across.limits, (rows[-1].cusum_limit,) * 2)
        for k, line in enumerate(lines):
            assert line.arrays[0].tolist() == across.ticks
            assert line.arrays[1].tolist() == [row.orders[k].cusum for row in rows]
            passed = rows[-1].orders[k].cusum > rows[-1].cusum_limit
            assert line.colour == ("warning" if passed else "after")
        assert len(lines) == 2
        highest = max(rows[-1].cusum_limit, *(one.cusum for row in rows for one in row.orders))
        assert up.limits[0] == 0.0
        assert highest < up.limits[1] < 1.5 * highest
        assert f"{unit}: " in picture.title
        assert f"on {dates - 1} further dates, limit {rows[-1].cusum_limit:.3g}" in picture.alt
        if unit == "u1" and dates == 5:
            assert [line.colour for line in lines] == ["warning", "after"]
