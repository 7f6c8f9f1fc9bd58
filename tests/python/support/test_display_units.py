"""Numbers as they are printed: read back they are what was measured, in every unit."""

from __future__ import annotations

import math
import re
import warnings
from datetime import UTC, datetime, timedelta, timezone

import numpy as np
import pytest
from hypothesis import example, given
from hypothesis import strategies as st

import trueangle as ta
from trueangle.errors import ArgumentError, UnitWarning
from trueangle.formats import seriallog
from trueangle.formats.format import Selection
from trueangle.support.decoding import elapsed_seconds, local_day
from trueangle.support.display_units import (
    LARGE,
    ErrorUnit,
    brief_number,
    error_unit,
    rounded_phase,
    significant_digits,
    sine_of_rms,
)
from trueangle.support.roles import unit_in_name

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


THETA = np.arange(0.0, 360.0, 5.0)


def said(theta):
    rng = np.random.default_rng(7)
    return theta + 0.5 * np.sin(np.radians(theta + 20.0)) + 0.01 * rng.standard_normal(theta.size)


def test_degrees_without_their_period_are_warned_of():
    with pytest.warns(UnitWarning, match=r"monday goes to 355.*give `period=360`"):
        ta.fit(ta.CalibrationRun(THETA, said(THETA), label="monday"), orders=[1])


@pytest.mark.parametrize(
    ("theta", "period"),
    [
        (THETA, 360.0),
        (np.radians(THETA), 2.0 * np.pi),
        (np.linspace(0.0, 355.0, 700), 2.0 * np.pi),  # a motor of 56 turns, in radians
    ],
    ids=["degrees", "radians", "many turns"],
)
def test_right_units_are_not(theta, period):
    error = 1e-3 * np.sin(2.0 * np.pi * theta / period)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ta.fit(ta.CalibrationRun(theta, theta + error, period=period), orders=[1])


@pytest.mark.parametrize(
    ("name", "role", "unit"),
    [
        ("pos_deg", "indicated", "deg"),
        ("pos_rad", "reference", "rad"),
        ("pos (deg)", "reference", "deg"),
        ("bus/pos_arcsec", "reference", "arcsec"),
        # Of a speed the second is a part of its own.
        ("w_deg_s", "velocity", "deg/s"),
        ("axis/w_rad_s", "velocity", "rad/s"),
        ("w_deg", "velocity", None),
        ("t_s", "time", "s"),
        ("t_ms", "time", "ms"),
        ("t_s", "reference", None),
        ("w", "velocity", None),
        ("w_s", "velocity", None),
        ("pos_fast", "indicated", None),
    ],
)
def test_a_unit_is_read_from_a_name(name, role, unit):
    assert unit_in_name(name, role) == unit


SEED = 5_150


def test_a_day_is_that_of_the_texts_own_zone():
    """The first ten letters, whatever the zone and however near to midnight."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    start = datetime(2026, 2, 27)
    for _ in range(300):
        clock = start + timedelta(seconds=int(rng.integers(0, 4 * 86400)))
        zone = timezone(timedelta(minutes=15 * int(rng.integers(-48, 57))))
        for text in (clock.isoformat(), clock.replace(tzinfo=zone).isoformat(" ")):
            assert local_day(text) == text[:10], text


def test_seconds_do_not_depend_on_the_zone_that_they_are_written_in():
    print("seed", SEED)
    rng = np.random.default_rng(SEED + 1)
    start = datetime(2026, 12, 31, 22, tzinfo=UTC)
    wanted = np.append(0.0, rng.uniform(-1e5, 1e5, 200).round(6))
    texts = []
    for seconds in wanted.tolist():
        zone = timezone(timedelta(minutes=15 * int(rng.integers(-48, 57))))
        texts.append((start + timedelta(seconds=seconds)).astimezone(zone).isoformat())
    found, wrong = elapsed_seconds(texts)
    assert wrong is None
    np.testing.assert_allclose(found, wanted, atol=1e-6)
    # One without a zone cannot be told from them.
    for place in (1, 7, 200):
        mixed = [*texts]
        mixed[place] = mixed[place][:19]
        assert elapsed_seconds(mixed)[1] == place


def test_a_clock_that_is_set_back_is_not_midnight(tmp_path):
    """Of a terminal: days and nights pass, and now and then it is put right by some seconds."""
    print("seed", SEED)
    rng = np.random.default_rng(SEED + 2)
    for draw in range(5):
        # Half an hour from reading to reading, and a few corrections apart from midnight.
        seconds = 1800.0 * np.arange(1, 150) + rng.uniform(0.0, 600.0, 149).round(3)
        for place in rng.choice(np.flatnonzero(seconds % 86400.0 > 7200.0), 8, replace=False):
            seconds[place] = seconds[place - 1] - round(rng.uniform(0.5, 60.0), 3)
        clocks = seconds % 86400.0
        lines = [
            f"{t // 3600:02.0f}:{t // 60 % 60:02.0f}:{t % 60:06.3f} -> a:1,b:{i}"
            for i, t in enumerate(clocks.tolist())
        ]
        path = tmp_path / f"{draw}.log"
        path.write_text("\n".join(lines) + "\n")
        (batch,) = seriallog.read(path, Selection(["time_s", "b"]))
        found = batch["time_s"] - batch["time_s"][0]
        np.testing.assert_allclose(found, seconds - seconds[0], atol=2e-3)
