"""What a page does with lists and arrays, and with a travel that no model describes."""

from __future__ import annotations

import numpy as np
import pytest

import trueangle as ta
from trueangle.plots.curves import travelled_degrees
from trueangle.reports.diagnosed import _parameter


def test_hundreds_of_rows_are_not_printed() -> None:
    """The rows that a run's outliers stand in were once a column taller than the page."""
    rows = [["monday", row] for row in range(400)]
    text = _parameter(0, "rows", {"value": rows, "std": None}, named=False)["text"]
    assert text.splitlines()[:2] == ["monday row 0", "monday row 1"]
    assert text.splitlines()[-1] == "and 394 more"
    few = _parameter(0, "rows", {"value": rows[:3], "std": None}, named=False)["text"]
    assert few.splitlines() == ["monday row 0", "monday row 1", "monday row 2"]


@pytest.mark.parametrize(
    ("low", "high", "shown"),
    [(-93.0, 100.0, (-93.0, 100.0)), (20.0, 200.0, (20.0, 200.0)), (0.0, 350.0, (0.0, 360.0)),
     (170.0, 350.0, (170.0, 350.0)), (300.0, 420.0, (-60.0, 60.0)), (200.0, 440.0, (-160.0, 80.0)),
     (100.0, 359.0, (100.0, 359.0))],
)  # fmt: skip
def test_a_travel_without_a_model_is_drawn_in_one_piece(low, high, shown) -> None:
    theta = np.linspace(low, high, 200)
    rng = np.random.default_rng(20261122)
    error = rng.normal(0.0, 0.01, (2, theta.size))
    runs = [ta.CalibrationRun(theta % 360.0, theta % 360.0 + e, 360.0) for e in error]
    assert travelled_degrees(runs) == pytest.approx(shown)
    pytest.importorskip("matplotlib")
    made = ta.report(runs)
    assert made.content["model"] is None
    (chart,) = made.figures["errors"]["charts"]
    assert chart["x"]["limits"] == pytest.approx(shown)
