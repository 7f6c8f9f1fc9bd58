"""The line of a watched window: its largest order, in the unit asked for, of readings in any."""

import argparse
import json
import re

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli.watch import _line
from trueangle.model.monitor import WatchedOrder, WatchedWindow

TURNS = {"deg": 360.0, "rad": 2.0 * np.pi, "turn": 1.0, "count": 8192.0}
ARCSEC = 1_296_000.0
SIZE = 2372.0

#: What a size of 2372 arcsec is in each unit, of 8192 counts to a turn or of 4096 asked for.
SHOWN = {
    ("auto", None): (SIZE, "arcsec"),
    ("arcsec", None): (SIZE, "arcsec"),
    ("deg", None): (SIZE / 3600.0, "deg"),
    ("mrad", None): (SIZE / ARCSEC * 2000.0 * np.pi, "mrad"),
    ("count", 4096.0): (SIZE / ARCSEC * 4096.0, "count"),
    ("count", None): (SIZE / ARCSEC * 8192.0, "count"),
}


def window(turn, alarm=False, scale=1.0):
    """Order 3 is the largest, and neither the first nor that with the largest sum."""
    orders = tuple(
        WatchedOrder(order, part * scale * SIZE * turn / ARCSEC, 10.0, statistic)
        for order, part, statistic in ((1.0, 0.2, 4.0), (3.0, 1.0, 2.0), (2.0, 0.9, 9.0))
    )
    because = "order 2 by 2134.8 arcsec since window 3" if alarm else ""
    return WatchedWindow(7, 0.0, None, 90, orders, 9.0, 8.5, alarm, because)


@pytest.mark.parametrize("readings", list(TURNS))
@pytest.mark.parametrize("asked", list(SHOWN), ids=str)
def test_a_size_is_in_the_unit_asked_for(asked, readings):
    turn, (name, counts) = TURNS[readings], asked
    if name == "count" and counts is None and readings != "count":
        return
    model = ta.HarmonicModel([ta.Shaft("output", 1, [1], [0.0], [0.0])], period=turn)
    args = argparse.Namespace(json=False, errors_in=name, counts_per_turn=counts)
    value, unit = SHOWN[asked]
    for alarm in (False, True):
        line = _line(window(turn, alarm), model, args)
        found = re.match(r"window +7  order 3 is (\S+) (\w+) off  chart  9.00 of 8.50", line)
        assert float(found[1]) == pytest.approx(value, rel=1e-3)
        assert found[2] == unit
        assert ("ALARM" in line) == alarm
        if alarm:
            told = re.search(r"ALARM order 2 by (\S+) (\w+) since window 3", line)
            assert float(told[1]) == pytest.approx(0.9 * value, rel=2e-3)
            assert told[2] == unit


@pytest.mark.parametrize("readings", list(TURNS))
@pytest.mark.parametrize(("scale", "unit"), [(3590.0 / SIZE, "arcsec"), (3610.0 / SIZE, "deg")])
def test_by_itself_it_is_in_degrees_from_one_on(scale, unit, readings):
    turn = TURNS[readings]
    model = ta.HarmonicModel([ta.Shaft("output", 1, [1], [0.0], [0.0])], period=turn)
    args = argparse.Namespace(json=False, errors_in="auto", counts_per_turn=None)
    assert f" {unit} off" in _line(window(turn, scale=scale), model, args)
    args.json = True
    plain = json.loads(_line(window(turn, scale=scale), model, args))
    sizes = [row["amplitude_arcsec"] for row in plain["orders"]]
    np.testing.assert_allclose(sizes, np.array([0.2, 1.0, 0.9]) * scale * SIZE)
