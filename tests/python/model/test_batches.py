"""Readings of a log as a watched model takes them: its angle, its unit, seconds."""

import numpy as np
import pytest

import trueangle as ta
from trueangle.model.batches import read_batches
from trueangle.runs.source import ReadingOptions

TURN = np.array([0.05, 0.3, 0.55, 0.8, 1.05])
ERROR = 1e-3 * np.array([1.0, -2.0, 0.5, 3.0, -1.5])
PERIODS = {"deg": 360.0, "rad": 2.0 * np.pi, "turn": 1.0}


def model(period, argument):
    shaft = ta.Shaft("output", 1, [1], [1e-4 * period], [0.0])
    return ta.HarmonicModel([shaft], period=period, argument=argument)


def text(unit, clock):
    turn, seconds = PERIODS[unit], {"s": 1.0, "ms": 1e-3}[clock]
    lines = [f"time_{clock},reference_{unit},indicated_{unit}"]
    for i, (x, e) in enumerate(zip(TURN.tolist(), ERROR.tolist(), strict=True)):
        lines.append(f"{0.5 * i / seconds!r},{x * turn!r},{(x + e) * turn!r}")
    return "\n".join(lines) + "\n"


@pytest.mark.parametrize("argument", ["reference", "indicated"])
@pytest.mark.parametrize("period", PERIODS.values())
@pytest.mark.parametrize(("unit", "clock"), [("deg", "s"), ("rad", "ms"), ("turn", "s")])
def test_angle_and_error_are_in_the_unit_of_the_model(unit, clock, period, argument, tmp_path):
    (tmp_path / "log.csv").write_text(text(unit, clock))
    watched, reading = model(period, argument), ReadingOptions()
    (whole,) = read_batches(tmp_path / "log.csv", watched, reading)
    angle = TURN if argument == "reference" else TURN + ERROR
    for found, wanted in zip(
        whole, (angle * period, ERROR * period, 0.5 * np.arange(5)), strict=True
    ):
        np.testing.assert_allclose(found, wanted, atol=1e-12 * period)
