"""The readings that exported code tries itself at hold what the model makes of them."""

from __future__ import annotations

import re

import numpy as np
import pytest

import trueangle as ta

SHAFTS = {
    "of whole turns": [ta.Shaft("output", 1, [1, 3], [0.3, 0.0], [0.1, 0.05])],
    "of a fraction": [ta.Shaft("motor", 100.5, [1, 2], [0.004, 0.0], [0.002, 0.001])],
    "both": [
        ta.Shaft("output", 1, [1], [0.3], [0.1]),
        ta.Shaft("motor", 50.25, [1, 2], [0.004, 0.0], [0.002, 0.001]),
    ],
}
ROWS = {
    "c": r"\{(-?\d+), UINT32_C\((\d+)\), UINT32_C\((\d+)\)\}",
    # Without turns where one is like the other.
    "rust": r"^ *\((?:(-?\d+), )?(\d+), (\d+)\),$",
}


@pytest.mark.parametrize("target", ROWS)
@pytest.mark.parametrize("argument", ["reference", "indicated"])
@pytest.mark.parametrize("shafts", SHAFTS)
def test_what_a_self_test_wants_is_the_corrected_angle(
    shafts: str, argument: str, target: str
) -> None:
    """Of several turns where a shaft does not come back to its start after one."""
    model = ta.HarmonicModel(SHAFTS[shafts], constant=3.0, period=360.0, argument=argument)
    made = ta.export_model(model, target, bits=10)
    found = re.findall(ROWS[target], made.text, re.M)
    rows = np.array([[float(part or 0) for part in row] for row in found])
    assert len(rows) == 8
    turns, reading, wanted = rows[:, 0], rows[:, 1] / 2.0**32, rows[:, 2] / 2.0**32
    assert (np.ptp(turns) > 0.0) == (shafts != "of whole turns")
    left = np.asarray(model.correct((turns + reading) * 360.0)) / 360.0 - wanted
    left -= np.rint(left)
    assert np.max(np.abs(left)) * 1_296_000.0 <= made.max_difference_arcsec + 0.01
