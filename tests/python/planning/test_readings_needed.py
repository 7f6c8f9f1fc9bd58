"""How many readings a standard error takes, and sizes that are none."""

from __future__ import annotations

import math
import re

import pytest

import trueangle as ta
from trueangle.errors import ArgumentError
from trueangle.planning import plan_arc, plan_mounts
from trueangle.planning.plan import check_readings, readings_needed

NO_SIZE = [0.0, -1.0, math.nan, math.inf]


@pytest.mark.parametrize("factor", [1.0, 1.02, 3.0])
@pytest.mark.parametrize(("noise", "wanted"), [(5.0, 0.5), (0.3, 0.007), (1.0, 40.0)])
def test_one_reading_less_is_too_few(noise: float, wanted: float, factor: float) -> None:
    count = readings_needed(noise, wanted, factor)
    assert factor * noise * math.sqrt(2.0 / count) <= wanted * (1.0 + 1e-12)
    assert count == 1 or factor * noise * math.sqrt(2.0 / (count - 1)) > wanted


@pytest.mark.parametrize("name", ["noise", "standard_error", "factor"])
@pytest.mark.parametrize("value", NO_SIZE)
def test_a_size_is_positive_and_finite(name: str, value: float) -> None:
    given = {"noise": 5.0, "standard_error": 0.5, "factor": 1.0, name: value}
    with pytest.raises(ta.errors.ArgumentError, match=f"^{name} must be positive and finite"):
        readings_needed(**given)
    if name != "factor":
        with pytest.raises(ta.errors.ArgumentError, match=f"^{name} must be positive and finite"):
            plan_mounts(100, noise=given["noise"], standard_error=given["standard_error"])


@pytest.mark.parametrize("name", ["noise", "standard_error", "uncertainty"])
@pytest.mark.parametrize("value", NO_SIZE)
def test_a_size_of_an_arc_is_positive_and_finite(name: str, value: float) -> None:
    """Whatever else is wanted: a noise of nan once ended in a ValueError of Python's own."""
    for wanted in ({"uncertainty": 3.0}, {"standard_error": 1.0}, {"readings": 14}):
        given = {"noise": 2.0, **wanted, name: value}
        with pytest.raises(ta.errors.ArgumentError, match=f"^{name} must be positive and finite"):
            plan_arc(0.0, 90.0, [1, 2], **given)


@pytest.mark.parametrize("given", [{"uncertainty": 1e-3}, {"standard_error": 1e-3},
                                   {"uncertainty": 5e-324}, {"readings": 10**7}])  # fmt: skip
def test_an_arc_is_not_read_a_million_times(given: dict[str, float]) -> None:
    """Of so many readings the places once took more memory than there is."""
    with pytest.raises(ta.errors.ArgumentError, match="1000000"):
        plan_arc(0.0, 90.0, [1, 2], noise=5.0, **given)


@pytest.mark.parametrize(("noise", "wanted"), [(1e308, 1.0), (5.0, 5e-324), (1.0, 1e-6)])
def test_more_readings_than_anybody_takes_are_refused(noise: float, wanted: float) -> None:
    with pytest.raises(ta.errors.ArgumentError, match=r"takes more than 1e\+12 readings"):
        readings_needed(noise, wanted)
    assert readings_needed(1.0, 1.5e-6) == pytest.approx(2.0 / 1.5e-6**2)


@pytest.mark.parametrize("readings", [None, 1, 7, 7.0])
def test_whole_numbers_of_readings_from_one_to_the_most_are_taken(readings: float | None) -> None:
    check_readings(readings, 7)


@pytest.mark.parametrize("readings", [0, 8, 2.5, -1])
def test_other_numbers_of_readings_are_refused_with_the_most(readings: float) -> None:
    told = rf"^readings must be a whole number from 1 to 7, got {re.escape(repr(readings))}$"
    with pytest.raises(ArgumentError, match=told):
        check_readings(readings, 7)
