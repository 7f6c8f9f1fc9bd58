"""Which method a log allows, and what orders and ripple may be."""

from __future__ import annotations

import numpy as np
import pytest

from trueangle.errors import ArgumentError, NoModelError
from trueangle.selfcalibration.calibrate import _method, _orders, _ripple
from trueangle.selfcalibration.recording import Recording

X = np.zeros(4)


@pytest.mark.parametrize(
    ("channels", "method"),
    [
        ({"motor": X, "indicated": X, "time": X, "heads": {1: X, 2: X}}, "dual"),
        ({"motor": X, "reference": X}, "dual"),
        ({"motor": X, "heads": {1: X, 2: X}, "time": X}, "heads"),
        ({"heads": {1: X, 2: X}, "indicated": X, "time": X}, "heads"),
        ({"heads": {1: X}, "indicated": X, "time": X}, "spin-down"),
        ({"shift": X, "reference": X, "indicated": X, "time": X}, "shifts"),
        ({"shift": X, "indicated": X, "time": X}, "spin-down"),
        ({"reference": X, "indicated": X, "time": X}, "spin-down"),
        ({"indicated": X}, None),
        ({"time": X}, None),
        ({"shift": X, "reference": X, "time": X}, None),
        ({"shift": X, "indicated": X}, None),
        ({"motor": X, "time": X}, None),
    ],
)
def test_the_method_is_that_of_the_columns(channels: dict, method: str | None) -> None:
    recording = Recording("7", **channels)
    if method is None:
        with pytest.raises(NoModelError, match="run 7: these columns do not allow"):
            _method([recording])
    else:
        assert _method([recording]) == method


def test_orders_are_whole_numbers_from_one_to_the_limit() -> None:
    assert _orders("auto") == "auto"
    assert _orders([3, 1.0, np.int64(3)]) == (1.0, 3.0)
    assert _orders([4096]) == (4096.0,)
    for wrong in ("all", [], [0], [0.5], [1, 2.5], [4097], [np.nan], [np.inf], 3, ["one"], [None]):
        with pytest.raises(ArgumentError, match="orders must be 'auto' or whole numbers from 1"):
            _orders(wrong)
    with pytest.raises(ArgumentError, match="too many"):
        _orders(range(1, 5000))


def test_ripple_is_auto_none_or_orders() -> None:
    assert _ripple("auto") == "auto"
    assert _ripple("none") == "none"
    assert _ripple([2, 1]) == (1.0, 2.0)
    with pytest.raises(ArgumentError, match="ripple must be 'auto', 'none' or orders, got 'all'"):
        _ripple("all")
