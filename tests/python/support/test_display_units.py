"""Numbers as they are printed: read back they are what was measured, in every unit."""

from __future__ import annotations

import math
import re

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

from trueangle.errors import ArgumentError
from trueangle.support.display_units import (
    LARGE,
    ErrorUnit,
    brief_number,
    error_unit,
    rounded_phase,
    significant_digits,
    sine_of_rms,
)

#: Of each unit in a turn.
TURNS = {"arcsec": 1_296_000.0, "deg": 360.0, "mrad": 2000.0 * math.pi, 65536.0: 65536.0}
sizes = st.floats(-9e5, 9e5, allow_nan=False)
spreads = st.floats(1e-4, 1e4)


@pytest.mark.parametrize("asked", TURNS)
@given(value=sizes, std=spreads)
def test_a_number_is_rounded_to_two_digits_of_its_error(asked, value, std) -> None:
    """Read back: within half of the last decimal, and the error has that many decimals."""
    unit = error_unit(asked)
    per = TURNS[asked] / 1_296_000.0
    shown, spread = unit.pair(value, std)
    decimals = len(spread.partition(".")[2])
    assert decimals == len(shown.partition(".")[2])
    assert abs(float(shown) - value * per) <= 0.5000001 * 10.0**-decimals
    assert abs(float(spread) - std * per) <= 0.5000001 * 10.0**-decimals
    if decimals and decimals < 12:
        # Two digits, no more and no fewer.
        assert 9.9 <= float(spread) * 10.0**decimals <= 100.0
    name = asked if isinstance(asked, str) else "count"
    assert unit.text(value, std) == f"{shown} +- {spread} {name}"
    assert unit.text(value) == f"{significant_digits(value * per)} {name}"


@given(value=sizes, digits=st.integers(1, 6))
def test_significant_digits_are_so_many(value: float, digits: int) -> None:
    shown = significant_digits(value, digits)
    assert "e" not in shown
    assert float(shown) == pytest.approx(value, rel=0.5000001 * 10.0 ** (1 - digits), abs=1e-12)
    assert not shown.startswith("-0.") or float(shown) < 0.0


@example(phase=359.996, std=0.1)
@given(phase=st.floats(-720.0, 720.0), std=st.floats(1e-3, 500.0))
def test_a_phase_lies_in_one_turn_and_is_known_to_half_of_it_at_least(phase, std) -> None:
    shown, spread = rounded_phase(phase, std)
    assert 0.0 <= float(shown) < 360.0
    away = (float(shown) - phase + 180.0) % 360.0 - 180.0
    assert abs(away) <= 0.5000001 * 10.0 ** -len(spread.partition(".")[2])
    assert float(spread) == pytest.approx(min(std, 180.0), rel=0.051)
    assert rounded_phase(phase, None)[1] == "-"
    assert 0.0 <= float(rounded_phase(phase, None)[0]) < 360.0


def test_the_unit_by_itself_is_arcsec_below_a_degree() -> None:
    assert LARGE == 3600.0
    assert [error_unit("auto", size).name for size in (3599.9, 3600.0)] == ["arcsec", "deg"]
    wave = 7.0 * np.sin(np.arange(10_000) * 2.0 * np.pi / 10_000)
    assert sine_of_rms(float(np.sqrt(np.mean(wave**2)))) == pytest.approx(7.0)
    assert sine_of_rms(math.inf) == 0.0
    assert error_unit("count", period=4096.0).per_arcsec == pytest.approx(4096.0 / 1_296_000.0)
    for wrong in ({"asked": "count"}, {"asked": "count", "period": 360.0}, {"asked": 0.0}):
        with pytest.raises(ArgumentError, match="counts"):
            error_unit(**wrong)


@pytest.mark.parametrize("asked", ["deg", "mrad"])
def test_sentences_say_their_sizes_in_the_unit(asked: str) -> None:
    unit, per = error_unit(asked), TURNS[asked] / 1_296_000.0
    said = unit.spoken("about 26000 arcsec at order 4, then -1.2e+03 arcsec; 3 arcseconds stay")
    first, second = (float(x) for x in re.findall(rf"(-?[\d.]+) {asked}\b", said))
    assert first == pytest.approx(26000.0 * per, rel=0.03)
    assert second == pytest.approx(-1200.0 * per, rel=0.03)
    assert said.count(f" {asked}") == 2
    assert "order 4, then" in said
    assert said.endswith("3 arcseconds stay")
    assert error_unit("arcsec").spoken("12 arcsec") == "12 arcsec"


@given(value=sizes)
def test_a_size_in_a_sentence_has_two_digits(value: float) -> None:
    assert float(brief_number(value)) == pytest.approx(value, rel=0.0501, abs=0.5)
    assert "e" not in brief_number(value) or abs(value) < 1e-4


@pytest.mark.parametrize("arcsec", [0.0, math.nan, math.inf, 36.0, 0.00123])
def test_decimals_show_two_digits_of_an_error(arcsec: float) -> None:
    unit = ErrorUnit("x", 10.0)
    known = math.isfinite(arcsec) and arcsec != 0.0
    wanted = max(0, 1 - math.floor(math.log10(10.0 * arcsec))) if known else 0
    assert unit.decimals(arcsec) == wanted
