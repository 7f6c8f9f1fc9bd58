"""The charts of units calibrated again stand on the page as the fleet has their numbers."""

from __future__ import annotations

import numpy as np
import pytest

import trueangle as ta
from fleets.made import units
from plots.strokes import strokes
from trueangle.reports.fleet import FleetReport

SEED = 71_209
MONTHS = tuple(f"2026-{month:02d}-10" for month in (1, 3, 5, 7, 9))


def changed(u: int, t: int, b: np.ndarray) -> tuple[np.ndarray, float]:
    b[0] += np.array([12.0 * t, 0.0]) * (u == 1)  # drifts
    b[1] += np.array([0.0, 60.0 * (t == 2)]) * (u == 2)  # and is as before
    return b, 0.0


@pytest.mark.parametrize("dates", [2, 3, 5])
def test_a_chart_has_every_date_every_order_and_the_limit(dates: int):
    print(f"seed {SEED}")
    made = units(np.random.default_rng(SEED), 8, dates=MONTHS[:dates], change=changed)
    fleet = ta.fleet(made, orders=[1, 2])
    for unit in ("u1", "u2", "u3"):
        chart = FleetReport(fleet)._chart(unit)
        rows = [row for row in fleet.history if row.unit == unit]
        assert len(rows) == dates - 1
        assert chart["x"]["limits"] == (1.5, dates + 0.5)  # half a date on either side
        drawn = strokes(chart)
        limit = [one for one in drawn if "stroke-dasharray" in one.style]
        assert len(limit) == 1
        highest = max(rows[-1].cusum_limit, *(one.cusum for row in rows for one in row.orders))
        assert chart["y"]["limits"] == (0.0, pytest.approx(1.1 * highest))
        if chart["y"]["scale"] == "linear":
            dots = np.vstack([one.points for one in drawn if one.kind == "dots"])
            wanted = [
                (date, row.orders[k].cusum) for k in range(2) for date, row in enumerate(rows, 2)
            ]
            for point in wanted:
                apart = np.abs(dots - point) / np.ptp([chart["x"]["limits"], chart["y"]["limits"]])
                assert apart.max(axis=1).min() < 1e-3
            assert limit[0].points[:, 1] == pytest.approx(rows[-1].cusum_limit, rel=1e-2)
        colours = {one.style["stroke"] for one in drawn if one.kind == "dots"}
        passed = [row.cusum > rows[-1].cusum_limit for row in rows[-1].orders]
        assert ("var(--warning)" in colours) == any(passed)
        assert f"{unit}: " in chart["title"]
        assert f"on {dates - 1} further dates, limit {rows[-1].cusum_limit:.3g}" in chart["alt"]
        if unit == "u1" and dates == 5:
            assert passed == [True, False]
