"""Tables over a travel: how steep they are, and what forward and reverse say when read back."""

from __future__ import annotations

import contextlib
import re
import tracemalloc
from types import SimpleNamespace

import numpy as np
import pytest

import trueangle as ta
from trueangle.export import TARGETS
from trueangle.export.pattern import TurnPattern
from trueangle.export.setpoint import _closed, axis_steepness, travel_model
from trueangle.model.terms import Backlash, LocalDefect

DIGIT = 1e-4


@pytest.mark.parametrize("steeper", ["forward", "reverse"])
def test_slope_and_bend_are_those_of_a_parabola(steeper: str) -> None:
    """Of ``c x²`` in degrees over 36 steps of 10 deg: between its last two points, and 2 c."""
    c, x = 2e-6, np.arange(37) * 10.0
    flat = SimpleNamespace(entries=36, forward=c * x / 360.0, reverse=c * x / 360.0)
    setattr(flat, steeper, -c * x**2 / 360.0)
    slope, bend = axis_steepness(flat)
    assert slope == pytest.approx(c * (360.0**2 - 350.0**2) / 10.0)
    assert bend == pytest.approx(2.0 * c)


def test_slope_and_bend_are_told_in_their_own_places(tmp_path) -> None:
    """Of ``c sin k x`` a slope of ``c k`` and a bend of ``c k²``, lines of 2 deg being short."""
    shaft = ta.Shaft("output", 1, [4], [0.0], [0.02])
    model = ta.HarmonicModel([shaft], period=360.0)
    found = ta.export_model(model, "linuxcnc", tmp_path / "axis.comp")
    note = next(note for note in found.notes if "v deg/s" in note)
    slope, bend = map(float, re.findall(r"up to (\S+) v", note))
    k = np.radians(4.0)
    assert slope == pytest.approx(0.02 * k, rel=5e-3)
    assert bend == pytest.approx(0.02 * k**2, rel=5e-3)


def read(tmp_path, half: np.ndarray):
    """A turn of 120 entries whose columns differ by twice ``half``, degrees."""
    nominal = np.arange(121) * 3.0
    pattern = 0.05 * np.sin(np.radians(nominal))
    path = tmp_path / "a.comp"
    path.write_text("table")
    table = np.column_stack([nominal, pattern + half, pattern - half])
    return travel_model(table, str(path), TARGETS["linuxcnc"], DIGIT)


@pytest.mark.parametrize(("play", "seen"), [(0.05, True), (0.02, False), (-300.0, True)])
def test_play_counts_beyond_the_rounding_of_its_mean(tmp_path, play: float, seen: bool) -> None:
    """A digit rounds to 0.29 of it, the mean of 121 to 0.026."""
    model = read(tmp_path, np.full(121, play * DIGIT))
    assert [term.kind for term in model.terms] == ["backlash"] * seen
    for term in model.terms:
        assert term.half_width == pytest.approx(play * DIGIT)
    assert "differ by a pattern" not in model.fit.note


@pytest.mark.parametrize("size", [0.5, 20.0])
def test_what_differs_between_the_ways_beside_its_mean_is_told(tmp_path, size: float) -> None:
    wave = np.sin(np.radians(np.arange(121) * 6.0))
    model = read(tmp_path, 0.01 + size * DIGIT * wave)
    (term,) = model.terms
    assert term.half_width == pytest.approx(0.01, rel=1e-4)
    assert ("differ by a pattern" in model.fit.note) == (size > 2.0)
    if size > 2.0:
        told = float(model.fit.note.split("differ by a pattern of ")[1].split()[0])
        # A sine over both ends of the turn: 120 of 121 squares.
        assert told == pytest.approx(size * DIGIT * 3600.0 * np.sqrt(60.0 / 121.0), rel=1e-3)


@pytest.mark.parametrize("spacing", [0.0001, 0.03, 3.0])
def test_a_table_over_an_arc_takes_no_more_memory_for_close_entries(tmp_path, spacing) -> None:
    """The way back is a cubic: of 3.6 million places of 0.0001 deg it needs few."""
    path = tmp_path / "a.nc"
    path.write_text("table")
    nominal = 20.0 + spacing * np.arange(40)
    pattern = 0.01 * spacing * np.sin(np.arange(40) / 6.0)
    table = np.column_stack([nominal, pattern, pattern])
    tracemalloc.start()
    with contextlib.suppress(ta.errors.TrueAngleError):
        travel_model(table, str(path), TARGETS["linuxcnc"], 1e-9)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 100 << 20


def test_the_way_back_over_the_rest_of_a_turn_keeps_values_and_slopes(tmp_path) -> None:
    """A cubic table over 300 deg: its way back leaves and arrives as lines beside the ends do."""
    nominal = np.arange(0.0, 301.0, 3.0)
    pattern = 0.05 * np.sin(np.radians(nominal) + 0.4)
    places, values = _closed(nominal, pattern, 3.0)
    assert places[-1] == pytest.approx(360.0)
    assert values[-1] == pytest.approx(pattern[0])
    assert np.array_equal(places[:101], nominal)
    for k, slope in ((100, np.diff(pattern)[-1] / 3.0), (-2, np.diff(pattern)[0] / 3.0)):
        step = (values[k + 1] - values[k]) / (places[k + 1] - places[k])
        assert step == pytest.approx(slope, abs=0.03 * np.abs(np.diff(pattern)).max())


def shown(target: str, **options):
    shaft = ta.Shaft("output", 1, [1, 2], [0.03, 0.0], [0.0, -0.02])
    return ta.export_model(ta.HarmonicModel([shaft], period=360.0), target, bits=12, **options)


def test_a_check_on_the_machine_is_made_where_its_table_has_the_value() -> None:
    """At the largest entry: the position in counts, and what the encoder goes on by."""
    made = shown("pmac", counts_per_turn=36_000, entries=90)
    table = [int(n) for n in made.text.partition("DEFINE COMP 90,36000")[2].split()[:90]]
    place, moved = re.search(r"to (\d+) counts[^.]*\..*?must go on by (\S+) counts",
                             re.sub(r"\n; *", " ", made.text)).groups()  # fmt: skip
    assert float(moved) == pytest.approx(table[int(place) // 400 - 1] / 16.0, rel=1e-5)
    assert abs(float(moved)) == max(map(abs, table)) / 16.0


def test_a_control_is_told_to_hold_every_point() -> None:
    made = shown("siemens840d", entries=72)
    points = {int(n) for n in re.findall(r"^\$AA_ENC_COMP\[0,(\d+),", made.text, re.M)}
    assert points == set(range(73))
    (note,) = [n for n in made.notes if "MAX_POINTS" in n]
    assert int(re.findall(r"MAX_POINTS to (\d+)", note)[0]) == made.entries == 73


def test_errors_of_a_table_that_is_read_are_those_of_its_rounding(tmp_path) -> None:
    """Ticks of 2^13 a turn in 64 entries: uniform, and spread over the coefficients."""
    path = tmp_path / "a.h"
    path.write_text(shown("tinymovr", entries=64).text)
    model = ta.import_model(path, "tinymovr", bits=12)
    tick = (360.0 / 4096.0) ** 2 / 12.0
    expected = [tick / 64.0, *[2.0 * tick / 64.0] * (2 * len(model.orders))]
    np.testing.assert_allclose(np.diag(model.covariance), expected)
    assert model.fit.samples == 64
    assert model.fit.residual == pytest.approx(np.sqrt(tick))


SEED = 55_401
UNITS = (360.0, 1.0, 2.0 * np.pi, 4096.0)
THETA = np.linspace(0.0, 1.0, 997)


def model(period, argument="reference", terms=()):
    """An output and a motor of 7 turns, in any unit; amplitudes of some arcmin."""
    unit = period / 360.0
    shafts = [
        ta.Shaft("output", 1, [1, 3], [0.02 * unit, 0.01 * unit], [0.03 * unit, -0.02 * unit]),
        ta.Shaft("motor", 7, [1, 2], [0.004 * unit, -0.002 * unit], [0.001 * unit, 0.003 * unit]),
    ]
    return ta.HarmonicModel(
        shafts, constant=0.5 * unit, period=period, argument=argument, terms=terms
    )


def defects(period):
    unit = period / 360.0
    return (
        LocalDefect(100.0 * unit, 12.0 * unit, 0.02 * unit),
        LocalDefect(200.0 * unit, 90.0 * unit, 0.01 * unit, 7.0),
    )


@pytest.mark.parametrize("period", UNITS)
def test_patterns_of_shafts_add_up_to_the_whole(period):
    """Each in turns of its own shaft, of which the output sees one in so many."""
    whole = TurnPattern(model(period, terms=defects(period)))
    parts = whole.shafts()
    assert [(name, cycles) for name, cycles, _ in parts] == [("output", 1.0), ("motor", 7.0)]
    total = sum(part.error(cycles * THETA) / cycles for _, cycles, part in parts)
    np.testing.assert_allclose(total, whole.error(THETA), atol=1e-12)
    assert np.ptp(total) > 1e-4
    assert whole.zero == pytest.approx(0.5 / 360.0)


@pytest.mark.parametrize("period", UNITS)
@pytest.mark.parametrize("argument", ["reference", "indicated"])
def test_a_reading_is_corrected_to_where_it_was_read(period, argument):
    pattern = TurnPattern(model(period, argument))
    read = pattern.reading(THETA)
    np.testing.assert_allclose(read - pattern.taken_off(read), THETA, atol=1e-11)
    np.testing.assert_allclose(
        pattern.correction(read), pattern.taken_off(read) - 0.5 / 360.0, atol=1e-12
    )
    at = THETA if argument == "reference" else read
    np.testing.assert_allclose(read - THETA, pattern.error(at) + pattern.zero, atol=1e-11)


@pytest.mark.parametrize("period", UNITS)
def test_each_way_has_its_own_side_of_the_play(period):
    """Play adds its half width one way and takes it off the other, at the same angles."""
    half = 0.01 / 360.0
    with_play = model(period, terms=(*defects(period), Backlash(half * period)))
    pattern = TurnPattern(with_play)
    assert pattern.has_direction
    assert not TurnPattern(model(period)).has_direction
    for direction in (1, -1):
        error = pattern.directed(THETA, direction)
        np.testing.assert_allclose(error, pattern.error(THETA) + direction * half, atol=1e-12)


@pytest.mark.parametrize("period", UNITS)
def test_what_is_known_of_it_is_the_scatter_of_its_draws_over_a_turn(period):
    """Coefficients drawn by their covariance: mean square over the turn, without the zero."""
    print(f"seed {SEED}")
    rng = np.random.default_rng(SEED)
    root = rng.normal(size=(9, 9)) * 1e-3 * period / 360.0
    pattern = TurnPattern(model(period).replace(covariance=root @ root.T))
    x = 2.0 * np.pi * np.arange(256) / 256
    waves = [f(k * x) for k in (1, 3, 7, 14) for f in (np.cos, np.sin)]
    spread = root[1:] @ root[1:].T
    variance = np.mean(np.einsum("ki,kl,li->i", np.array(waves), spread, np.array(waves)))
    wanted = np.sqrt(variance) / period * 1_296_000.0
    assert pattern.uncertainty_arcsec == pytest.approx(wanted, rel=1e-9)
    assert TurnPattern(model(period)).uncertainty_arcsec is None


@pytest.mark.parametrize(("entries", "holds"), [(30, True), (29, True), (28, False)])
def test_a_table_holds_orders_below_half_its_entries(entries, holds):
    pattern = TurnPattern(model(360.0))
    if holds:
        pattern.check_orders(entries, "table", range(65))
    else:
        with pytest.raises(ta.TrueAngleError, match=r"up to 13.* order 14: use `entries=56`"):
            pattern.check_orders(entries, "table", range(65))


@pytest.mark.parametrize("period", UNITS)
@pytest.mark.parametrize("turned", [0.0, 70.0, 180.0])
def test_one_order_of_two_shafts_has_the_amplitude_of_their_sum(period, turned):
    """By the spectrum of the error: in phase they add up, against each other they do not."""
    size, angle = 0.01 * period / 360.0, np.radians(turned)
    shafts = [
        ta.Shaft("output", 1, [2, 7], [0.0, size], [2.0 * size, 0.0]),
        ta.Shaft("motor", 7, [1], [1.5 * size * np.cos(angle)], [1.5 * size * np.sin(angle)]),
    ]
    pattern = TurnPattern(ta.HarmonicModel(shafts, period=period))
    grid = np.arange(64) / 64.0
    spectrum = np.abs(np.fft.rfft(pattern.error(grid))) / 32.0
    assert list(pattern.lines) == [2.0, 7.0]
    for order, amplitude in pattern.lines.items():
        assert amplitude == pytest.approx(spectrum[int(order)], rel=1e-9, abs=1e-15)
