"""What a page does with lists and arrays, and with a travel that no model describes."""

from __future__ import annotations

import numpy as np
import pytest

import trueangle as ta
from trueangle.plots.curves import travelled_degrees
from trueangle.reports.charts import _short
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
    pytest.importorskip("bokeh")
    made = ta.report(runs)
    assert made.content["model"] is None
    (chart,) = made.figures["errors"]["charts"]
    ranges = [model["attributes"] for model in _models(chart) if model.get("name") == "Range1d"]
    assert any(
        (r.get("start", 0.0), r.get("end", 1.0))
        == (pytest.approx(shown[0]), pytest.approx(shown[1]))
        for r in ranges
    )


def _models(chart):
    from .test_report import models

    return models(chart)


def test_drawn_numbers_are_near_and_short() -> None:
    """Noise cannot be packed: what no screen shows is left out of it."""
    rng = np.random.default_rng(20261122)
    values = np.concatenate([rng.normal(0.0, 10.0 ** rng.uniform(-6, 6, 4000)), [0.0, 360.0, -1.0]])
    drawn = _short(values)
    np.testing.assert_allclose(drawn, values, rtol=2.0**-13)
    assert np.abs(drawn / np.where(values == 0.0, 1.0, values) - 1.0)[:-3].max() > 2.0**-16
    assert not np.any(drawn.view(np.uint32) & 0x3FF)
    assert drawn[-3:].tolist() == [0.0, 360.0, -1.0]
    # One bit below a power of two carries into it; what is not finite stays.
    assert _short(np.array([np.nextafter(np.float32(2.0), 0.0)])).tolist() == [2.0]
    assert np.isnan(_short(np.array([np.nan]))).all()
    assert np.isinf(_short(np.array([np.inf, -np.inf]))).all()
