"""Default sizes of C and Rust tables, and the figures of tables of several shafts."""

import math
import re

import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import ArgumentError
from trueangle.export.pattern import TurnPattern
from trueangle.export.targets import TARGETS

from .conftest import ARCSEC, golden_model

BITS = 12
MOTOR = ta.Shaft("motor", 3, (1, 2, 5), (2e-4, 0.0, 1e-5), (1e-4, -5e-5, 0.0))
PATTERNS = {
    "output": golden_model(),
    "motor": ta.HarmonicModel((MOTOR,)),
}


def known_to(model, arcsec):
    """The model with this uncertainty over a turn."""
    count = 2 * len(model.orders)
    return model.replace(covariance=np.eye(1 + count) * (arcsec * ARCSEC) ** 2 / (count / 2))


def left_by(model, entries, method):
    """What a table of so many entries leaves without the rounding of short numbers, rms."""
    number = {"linear": "f32", "cubic": "q31"}[method]
    made = ta.export_model(model, "c", bits=BITS, method=method, number=number, entries=entries)
    return made.rms_difference_arcsec


def smallest(model, allowed, method="linear"):
    """The first power of two above twice the highest order that leaves no more than allowed."""
    top = max(max(shaft.orders) for shaft in model.shafts)
    sizes = (1 << bits for bits in range(3, 13) if 1 << bits > 2 * top)
    return next(size for size in sizes if left_by(model, size, method) <= allowed)


@pytest.mark.parametrize("name", list(PATTERNS))
@pytest.mark.parametrize("entries", [32, 128, 256])
@pytest.mark.parametrize("side", [1.05, 0.95])
def test_a_default_table_leaves_a_third_of_what_the_model_does_not_know(name, entries, side):
    """From both sides of a size; more than 256 lines are cubics instead, as few as will do."""
    model = PATTERNS[name]
    allowed = left_by(model, entries, "linear") * side
    made = ta.export_model(known_to(model, 3.0 * allowed), "c", bits=BITS)
    (table,) = made.tables
    if side < 1.0 and entries == 256:
        assert (table["method"], table["number"]) == ("cubic", "q31")
        assert table["entries"] == smallest(model, allowed, "cubic") < 256
    else:
        wanted = entries if side > 1.0 else 2 * entries
        assert (table["method"], table["entries"]) == ("linear", wanted)
        assert wanted == smallest(model, allowed)


@pytest.mark.parametrize("name", list(PATTERNS))
def test_of_a_model_that_states_no_uncertainty_a_thousandth_of_its_pattern_is_left(name):
    model = PATTERNS[name]
    pattern = math.sqrt(sum(float(c) ** 2 for c in model.amplitudes) / 2.0) / ARCSEC
    for method, number in (("linear", "f32"), ("cubic", "q31")):
        made = ta.export_model(model, "c", bits=BITS, method=method, number=number)
        assert made.entries == smallest(model, 1e-3 * pattern, method)


@pytest.mark.parametrize("top", [1, 3, 4, 9])
def test_a_shaft_without_an_error_has_the_fewest_entries(top):
    """Any hold it: two a wave and one more, of eight at least."""
    still = ta.Shaft("motor", 3, (top,), (0.0,), (0.0,))
    model = ta.HarmonicModel((*golden_model().shafts, still))
    made = ta.export_model(model, "c", bits=BITS)
    assert [table["shaft"] for table in made.tables] == ["output", "motor"]
    entries = made.tables[1]["entries"]
    assert entries == next(size for size in (8, 16, 32) if size > 2 * top)


@pytest.mark.parametrize(("top", "largest"), [(8, 4096), (1000, 4096), (1024, 8192)])
def test_a_default_table_has_eight_entries_a_wave_at_most_and_4096_anyway(top, largest):
    """However little it should leave; and more than two a wave however much."""
    model = ta.HarmonicModel((ta.Shaft("output", 1, (top,), (1e-5,), (0.0,)),))
    few = ta.export_model(known_to(model, 1e4), "c", bits=BITS).entries
    assert few // 2 <= 2 * top < few
    made = ta.export_model(known_to(model, 1e-9), "c", bits=BITS, method="linear", number="f32")
    assert made.entries == largest


@pytest.mark.parametrize("top", [*range(1, 17), 31, 32])
def test_the_size_that_a_refusal_names_is_taken_and_four_to_a_wave(top):
    model = ta.HarmonicModel((ta.Shaft("output", 1, (top,), (1e-6,), (0.0,)),))
    taken = []
    for entries in (4, 8, 16, 32, 64, 128):
        try:
            taken.append(ta.export_model(model, "c", bits=8, number="q31", entries=entries).entries)
        except ArgumentError as refused:
            assert not taken
            named = int(re.search(r"use `entries=(\d+)` or more", str(refused))[1])
    if top > 1:
        assert 4 * top <= named < 8 * top
        assert named in taken


def chained(argument="reference", constant=0.4):
    """An output shaft, and a motor of a fraction or a whole number of turns."""
    shaft = ta.Shaft("output", 1, (1, 2), (3e-3, 0.0), (1e-3, 5e-4))
    return ta.HarmonicModel((shaft, MOTOR), constant=constant, argument=argument)


@pytest.mark.parametrize("argument", ["reference", "indicated"])
def test_what_tables_of_two_shafts_lose_is_that_of_each_alone(argument):
    """A motor that turns thrice at the orders of the output; floors add up as squares."""
    options = {"bits": BITS, "number": "q31", "entries": 32}
    whole = chained(argument)
    both = ta.export_model(whole, "c", **options)
    alone = [
        ta.export_model(whole.replace(shafts=(shaft,)), "c", **options) for shaft in whole.shafts
    ]
    found = {row["order"]: row["arcsec"] for row in both.lost}
    assert set(found) == {1.0, 2.0, 3.0, 6.0, 15.0}
    for made in alone:
        for row in made.lost:
            assert found[row["order"]] == pytest.approx(row["arcsec"], rel=1e-6, abs=1e-9)
    sizes = {
        shaft.cycles_per_turn * k: math.hypot(a, b) / ARCSEC
        for shaft in whole.shafts
        for k, a, b in zip(shaft.orders, shaft.cosine, shaft.sine, strict=True)
    }
    # Lines between 32 knots, by least squares, make a wave of order k smaller by less than this.
    for order, size in sizes.items():
        k = order if order < 3.0 else order / 3.0
        assert 0.0 <= found[order] < size * (np.pi * k / 32) ** 4
    assert both.floor_arcsec == pytest.approx(math.hypot(*(made.floor_arcsec for made in alone)))
    assert both.entries == 64


@pytest.mark.parametrize("target", ["c", "rust"])
@pytest.mark.parametrize("cycles", [3.0, 2.5])
def test_the_variants_of_the_arithmetic_and_the_turns_are_those_of_the_chain(target, cycles):
    """Floats are proven with contracted products as well; a fraction over turns, with a note."""
    model = chained()
    motor = ta.Shaft("motor", cycles, MOTOR.orders, MOTOR.cosine, MOTOR.sine)
    pattern = TurnPattern(model.replace(shafts=(model.shafts[0], motor)))
    for number, variants in (("q31", 1), ("f32", 2)):
        options = TARGETS[target].checked({"number": number, "entries": 64, "name": "a"})
        made = TARGETS[target].make(pattern, options)
        assert len(made.part.corrections) == variants
        assert made.part.turns == (1 if cycles == 3.0 else 2)
        assert any("-ffp-contract=off" in note for note in made.notes) == (number == "f32")
        assert any("unwrapped" in note for note in made.notes) == (cycles != 3.0)
        # Two tables round to a unit of 2^-32 turns each; to either side.
        assert made.part.resolution == 4.0 / 2.0**32


@pytest.mark.parametrize("constant", [-7.0, -0.4, 0.4, 9.0])
@pytest.mark.parametrize("cycles", [3.0, 2.5])
def test_the_zero_of_a_fraction_keeps_its_turns(cycles, constant):
    """Where a shaft's place depends on the turn; else the zero is within one."""
    motor = ta.Shaft("motor", cycles, MOTOR.orders, MOTOR.cosine, MOTOR.sine)
    model = chained(constant=constant).replace(shafts=(motor,))
    text = ta.export_model(model, "c", bits=BITS, number="q31", entries=64).text
    zero = int(re.search(r"Zero: (-?\d+) is subtracted first", text)[1])
    wanted = constant / (2.0 * np.pi)
    assert zero / 2.0**32 == pytest.approx(wanted % 1.0 if cycles == 3.0 else wanted, abs=1e-9)
