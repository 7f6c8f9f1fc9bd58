"""Lines of a budget as a file states them."""

import math

import pytest

from trueangle.certificate.identity import _contribution
from trueangle.errors import ArgumentError


@pytest.mark.parametrize("told", [None, 9, 0.5, float("inf")])
def test_a_line_of_a_file_has_the_freedom_that_it_says(told):
    entry = {"name": "table", "standard_arcsec": 2.0}
    if told is not None:
        entry["degrees_of_freedom"] = told
    freedom = _contribution(1, entry).degrees_of_freedom
    assert freedom == (math.inf if told is None else told)


@pytest.mark.parametrize("told", ["nine", 0, -1, float("nan"), True])
def test_a_freedom_that_is_none_is_refused(told):
    entry = {"name": "table", "standard_arcsec": 2.0, "degrees_of_freedom": told}
    with pytest.raises(ArgumentError, match=r"table.* degrees_of_freedom must"):
        _contribution(1, entry)
