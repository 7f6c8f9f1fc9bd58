"""Times and turns as they are typed, and what is no time."""

import argparse

import pytest

from trueangle.cli.values import seconds, turns

SECONDS = {
    "10": 10.0, "10s": 10.0, "0.5 s": 0.5, "500ms": 0.5, "2min": 120.0, "1h": 3600.0, "1H": 3600.0,
}  # fmt: skip


@pytest.mark.parametrize("text", SECONDS)
def test_a_time_is_in_seconds(text):
    assert seconds(text) == pytest.approx(SECONDS[text])


@pytest.mark.parametrize(
    "text", ["10x", "s", "-1s", "0", "nan", "inf", "1e999h", "1 2s", "10us", ""]
)
def test_what_is_no_time_is_refused(text):
    with pytest.raises(argparse.ArgumentTypeError, match="a time above zero"):
        seconds(text)


@pytest.mark.parametrize(
    ("text", "wanted"), [("1turn", 1.0), ("5turns", 5.0), ("0.5", 0.5), (" 2 turns ", 2.0)]
)
def test_travel_is_in_turns(text, wanted):
    assert turns(text) == wanted
