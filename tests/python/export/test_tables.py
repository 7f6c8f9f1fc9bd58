"""Tables of the generic export: their arithmetic, what is proven of it, what is refused."""

import math
from fractions import Fraction

import numpy as np
import pytest

import trueangle as ta
from trueangle import _core
from trueangle.export.chain import make_chain
from trueangle.export.knots import cubic_knots, linear_knots, rounded_knots
from trueangle.export.pattern import TurnPattern
from trueangle.export.proof import prove_export
from trueangle.export.table import make_table

from .conftest import ARCSEC, truth

#: Figures of the same sizes with other knots and code, arcsec: rms, maximum.
REFERENCE = {
    ("linear", "q15", 128): (1.26, 5.80),
    ("linear", "q31", 128): (1.26, 5.74),
    ("linear", "f32", 128): (1.26, 5.74),
    ("linear", "q15", 256): (0.32, 1.52),
    ("linear", "q15", 512): (0.089, 0.44),
    ("cubic", "q31", 32): (1.75, 4.90),
    ("cubic", "q31", 64): (0.113, 0.31),
    ("cubic", "q31", 128): (0.007, 0.020),
}


def rounded(value):
    """Nearest whole number, halves up: what a shift after adding a half does."""
    return math.floor(value + Fraction(1, 2))


def by_fractions(method, number, bits, shift, knots, angle):
    """The documented formula in exact fractions, each rounding where the code rounds."""
    segment = Fraction(angle * 2**bits, 2**32)
    i = math.floor(segment)
    t = segment - i
    if method == "linear":
        low, high = int(knots[i]), int(knots[i + 1])
        if number == "q15":
            t = Fraction(math.floor(t * 2**16), 2**16)
            return rounded((low + (high - low) * t) * 2**shift)
        t = Fraction(math.floor(t * 2**31), 2**31)
        return low + rounded((high - low) * t)
    t = Fraction(math.floor(t * 2**31), 2**31)
    (y0, m0), (y1, m1) = ([int(n) * 2**shift for n in knot] for knot in (knots[i], knots[i + 1]))
    third = m0 + m1 - 2 * (y1 - y0)
    second = y1 - y0 - m0 - third
    return y0 + rounded((rounded((rounded(third * t) + second) * t) + m0) * t)


@pytest.mark.parametrize("method", ["linear", "cubic"])
@pytest.mark.parametrize("number", ["q15", "q31"])
def test_integer_tables_are_their_formula_to_the_last_bit(method, number):
    seed = 20261121
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    for bits, shift in ((2, 0), (5, 9), (7, 15), (11, 3)):
        shift = shift if number == "q15" else 0
        size = (1 << bits) + 1
        top = 2**12 if number == "q15" else 2**27
        kind = np.int16 if number == "q15" else np.int32
        shape = (size,) if method == "linear" else (size, 2)
        knots = rng.integers(-top, top, shape).astype(kind)
        angles = rng.integers(0, 2**32, 200, dtype=np.uint32)
        angles[:3] = 0, 2**32 - 1, 2**31
        found = _core.table_correction(method, knots.ravel(), bits, shift, angles)
        wanted = [by_fractions(method, number, bits, shift, knots, int(a)) for a in angles]
        assert found.tolist() == wanted


@pytest.mark.parametrize(
    "arguments",
    [
        ("linear", np.zeros(5, np.int16), 3, 0),
        ("linear", np.zeros(5, np.int16), 2, 16),
        ("linear", np.zeros(2, np.int16), 0, 0),
        ("cubic", np.zeros(5, np.int32), 2, 0),
        ("quintic", np.zeros(5, np.int32), 2, 0),
        ("linear", np.zeros(200000, np.int32), 4294967295, 0),
    ],
)
def test_tables_that_do_not_fit_are_refused_before_anything_is_read(arguments):
    with pytest.raises(ta.errors.ArgumentError):
        _core.table_correction(*arguments, np.zeros(1, np.uint32))


def test_least_squares_knots_solve_their_normal_equations():
    def g(x):
        return np.exp(np.sin(2 * np.pi * x)) + 0.3 * np.cos(6 * np.pi * x)

    x = (np.arange(12 * 400) + 0.5) / (12 * 400)
    i, t = np.floor(x * 12).astype(int), x * 12 % 1
    hats = np.zeros((len(x), 12))
    hats[np.arange(len(x)), i] += 1 - t
    hats[np.arange(len(x)), (i + 1) % 12] += t
    dense = np.linalg.lstsq(hats, g(x), rcond=None)[0]
    np.testing.assert_allclose(linear_knots(g, 12), dense, atol=2e-6)
    cubic = np.zeros((len(x), 24))
    rows = np.arange(len(x))
    cubic[rows, 2 * i] += (1 + 2 * t) * (1 - t) ** 2
    cubic[rows, 2 * i + 1] += t * (1 - t) ** 2
    cubic[rows, 2 * ((i + 1) % 12)] += t**2 * (3 - 2 * t)
    cubic[rows, 2 * ((i + 1) % 12) + 1] += t**2 * (t - 1)
    dense = np.linalg.lstsq(cubic, g(x), rcond=None)[0].reshape(12, 2)
    np.testing.assert_allclose(cubic_knots(g, 12), dense, atol=2e-6)


def test_least_squares_knots_leave_less_than_samples_by_the_square_root_of_six():
    def g(x):
        return np.sin(2 * np.pi * 3 * x + 0.4)

    x = np.arange(1 << 16) / (1 << 16)
    places = np.arange(257) / 256

    def left(knots):
        return np.sqrt(np.mean((np.interp(x, places, np.append(knots, knots[0])) - g(x)) ** 2))

    ratio = left(g(places[:-1])) / left(linear_knots(g, 256))
    assert 2.40 < ratio < 2.50  # sqrt(6) = 2.449 for short segments


@pytest.mark.parametrize(("kind", "figures"), REFERENCE.items())
def test_no_worse_than_the_reference(model, kind, figures):
    method, number, entries = kind
    made = ta.export_model(model, "c", method=method, number=number, entries=entries, bits=16)
    assert made.rms_difference_arcsec <= figures[0]
    assert made.max_difference_arcsec <= figures[1]
    # and from below: half of a least-squares line is impossible
    assert made.rms_difference_arcsec > figures[0] / 8


def test_the_maximum_is_that_of_an_independent_inverse(model):
    """The table's numbers, interpolated in float64, against Newton's iteration in numpy."""
    made = ta.export_model(model, "c", entries=128, number="q15", bits=14)
    table = make_table("output", 1.0, TurnPattern(model).correction, "linear", "q15", 128)
    count = np.arange(1 << 14)
    angle = count * (2 * np.pi / (1 << 14))
    places = np.arange(129) / 128
    knots = table.knots.astype(float) * 2.0**table.shift / 2.0**32
    left = np.interp(count / (1 << 14), places, knots) * 1_296_000 - (
        angle - truth(angle)
    ) * 1_296_000 / (2 * np.pi)
    # the table's own arithmetic cuts the place to 2^-16 of a segment: 0.02 arcsec here
    assert abs(np.max(np.abs(left)) - made.max_difference_arcsec) < 0.02
    assert np.max(np.abs(left)) > 0.9 * made.max_difference_arcsec


def test_two_shafts_by_a_chain_of_inverted_tables(joint):
    made = ta.export_model(joint, "c", method="cubic", number="q31", entries=256, bits=22)
    assert made.max_difference_arcsec <= 0.036
    assert [table["shaft"] for table in made.tables] == ["output", "motor"]
    assert made.entries == 512
    # one pass of the plain errors leaves a hundred times as much
    x = np.arange(1 << 16) / (1 << 16)
    pattern = TurnPattern(joint)
    once = (pattern.error(x) - pattern.correction(x)) * 1_296_000
    assert np.max(np.abs(once)) > 3.0


def test_readings_of_more_than_24_bits_are_bounded(model):
    table = {"method": "cubic", "number": "q31", "entries": 64}
    coarse = ta.export_model(model, "c", bits=24, **table)
    fine = ta.export_model(model, "c", bits=32, **table)
    assert coarse.max_difference_arcsec < fine.max_difference_arcsec
    assert fine.max_difference_arcsec < coarse.max_difference_arcsec + 0.02
    assert "between" in fine.proof
    assert coarse.proof.startswith("every one of 16777216")


def test_max_arcsec_takes_the_smallest_table_that_keeps_it(model):
    made = ta.export_model(model, "c", number="q15", max_arcsec=2.0, bits=16)
    assert made.entries == 256
    assert made.max_difference_arcsec <= 2.0
    half = ta.export_model(model, "c", number="q15", entries=128, bits=16)
    assert half.max_difference_arcsec > 2.0


def test_what_cannot_be_kept_is_refused_and_nothing_written(model, tmp_path):
    with pytest.raises(ta.errors.ArgumentError, match=r"does not keep 0\.0001 arcsec: the best"):
        ta.export_model(
            model, "c", tmp_path / "a.h", number="q15", method="linear", max_arcsec=1e-4, bits=14
        )
    with pytest.raises(ta.errors.ArgumentError, match=r"hold orders up to 7.*order 8.*32"):
        ta.export_model(model, "c", tmp_path / "a.h", entries=16)
    with pytest.raises(
        ta.errors.ArgumentError, match=r"up to 7, the model has order 8.*32` or more"
    ):
        ta.export_model(model, "csv", tmp_path / "a.csv", entries=16)
    with pytest.raises(ta.errors.ArgumentError, match="power of two"):
        ta.export_model(model, "c", tmp_path / "a.h", entries=100)
    with pytest.raises(ta.errors.ArgumentError, match="no target 'pdf'"):
        ta.export_model(model, "pdf")
    with pytest.raises(ta.errors.ArgumentError, match="c has no option `variant=`"):
        ta.export_model(model, "c", variant="a")
    assert list(tmp_path.iterdir()) == []


def test_the_smallest_entries_that_a_refusal_names_are_taken(model):
    made = ta.export_model(model, "c", entries=32, bits=12)
    assert made.entries == 32


def test_terms_that_no_table_holds_are_named(joint):
    model = joint.replace(terms=(ta.Backlash(0.01), ta.ThermalDrift(0.001)))
    made = ta.export_model(model.replace(shafts=model.shafts[:1]), "tinymovr")
    assert [row["term"] for row in made.left_out] == ["backlash", "thermal_drift"]
    assert any("backlash, thermal_drift cannot be held" in note for note in made.notes)
    assert "backlash, thermal_drift" in made.text
    made = ta.export_model(model, "c", bits=14)
    assert [row["term"] for row in made.at_run_time] == ["backlash", "thermal_drift"]
    assert made.left_out == []


def test_a_local_defect_is_held(model):
    defect = ta.LocalDefect(place=2.0, width=0.15, height=0.001)
    made = ta.export_model(model.replace(terms=(defect,)), "c", entries=512, bits=14)
    assert made.left_out == []
    assert made.max_difference_arcsec < 3.0
    assert ta.export_model(model, "c", entries=512, bits=14).text != made.text


def test_the_constant_is_subtracted_first(model):
    for argument in ("reference", "indicated"):
        moved = model.replace(constant=0.7, argument=argument)
        made = ta.export_model(moved, "c", entries=256, bits=14)
        assert made.zero_deg == 0.0
        assert made.max_difference_arcsec < 1.6


def test_the_default_table_is_as_fine_as_the_model_is_known(model):
    size = 1 + 2 * len(model.orders)
    entries = []
    for known in (30.0, 1.0):
        cov = np.eye(size) * (known * ARCSEC) ** 2 / len(model.orders)
        made = ta.export_model(model.replace(covariance=cov), "c", bits=14)
        assert known / 12 < made.rms_difference_arcsec <= known / 3
        entries.append(made.entries)
    assert entries[0] < entries[1]


def test_json_carries_every_figure(model, tmp_path):
    made = ta.export_model(model, "c", tmp_path / "a.h", entries=128, bits=16)
    found = made.to_dict()
    assert {
        "target", "sign", "argument", "entries", "bytes", "max_difference_arcsec",
        "rms_difference_arcsec", "floor_arcsec", "lost", "proven",
    } <= set(found)  # fmt: skip
    assert [row["order"] for row in found["lost"]] == [1, 2, 4, 8]
    assert all(row["arcsec"] < 0.1 for row in found["lost"])
    assert found["proven"] is True
    assert f"at most {made.max_difference_arcsec:.6g} arcsec" in made.text


def test_a_shaft_that_does_not_come_back_gets_a_function_of_its_own(joint):
    odd = joint.replace(
        shafts=(joint.shafts[0], ta.Shaft("motor", 100.5, (1,), (30 / 3600,), (0.0,)))
    )
    made = ta.export_model(odd, "c", bits=14)
    assert "_correct(uint32_t indicated)" not in made.text
    assert any("correct_unwrapped takes the turns" in note for note in made.notes)
    with pytest.raises(ta.errors.ArgumentError, match="shaft motor is not periodic in it"):
        ta.export_model(odd, "csv")


def test_cubics_are_tried_where_lines_do_not_keep_the_maximum(model):
    made = ta.export_model(model, "c", max_arcsec=0.05, bits=14)
    assert made.max_difference_arcsec <= 0.05
    assert made.tables[0]["method"] == "cubic"
    assert made.bytes < 2000
    with pytest.raises(ta.errors.ArgumentError, match=r"does not keep 0\.05"):
        ta.export_model(model, "c", max_arcsec=0.05, bits=14, method="linear", number="q15")


def test_a_model_of_nothing_is_refused():
    for target in ("c", "simplefoc", "linuxcnc"):
        with pytest.raises(ta.errors.ArgumentError, match="no harmonics"):
            ta.export_model(ta.HarmonicModel(()), target)


def test_what_is_not_known_is_not_called_proven(model):
    made = ta.export_model(model, "admt4000", bits=12)
    assert made.proven is False
    assert "not known" in made.proof


def test_shafts_of_one_name_after_cleaning_get_two(joint):
    motor = joint.shafts[1]
    both = joint.replace(
        shafts=(
            ta.Shaft("Wheel 1", 1, (1,), (0.1,), (0.0,)),
            ta.Shaft("wheel_1", 100, motor.orders, motor.cosine, motor.sine),
        )
    )
    text = ta.export_model(both, "c", bits=12).text
    assert "angle_wheel_1_correction(" in text
    assert "angle_wheel_1_2_correction(" in text


def test_a_lowered_maximum_is_not_kept(model):
    """The bound is tight: a tenth less is exceeded by the very input that was found worst."""
    pattern = TurnPattern(model)
    chain = make_chain(pattern, "linear", "q15", 128)
    proof = prove_export([chain.correction], pattern.correction, 20, 1.0)
    at = np.array([proof.worst], dtype=np.uint32)
    left = abs(float((chain.correction(at) - pattern.correction(at / 2.0**32))[0])) * 1_296_000
    assert left == pytest.approx(proof.max_arcsec)
    assert left > 0.9 * proof.max_arcsec


def test_whole_knots_are_never_worse_than_rounded_ones():
    seed = 7
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)

    def left(knots, whole):
        error = whole - knots
        return float(np.sum(error * (2.0 * error + np.roll(error, 1))))

    for count in (5, 64, 129, 256):
        knots = rng.normal(0.0, 40.0, count)
        whole = rounded_knots(knots)
        assert np.array_equal(whole, np.rint(whole))
        assert np.max(np.abs(whole - knots)) <= 0.55
        assert left(knots, whole) <= left(knots, np.rint(knots))
