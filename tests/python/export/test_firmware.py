"""What tables of firmware leave, and what is told of a list that is there, by closed forms."""

from __future__ import annotations

import math
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import trueangle as ta
from trueangle.export import reading, simplefoc

from .test_bounds import existing


def model(**orders: float) -> ta.HarmonicModel:
    """Sines of some arcsec by order: ``o1=300.0``."""
    sizes = [size / 3600.0 for size in orders.values()]
    shaft = ta.Shaft("output", 1, [int(o[1:]) for o in orders], [0.0] * len(sizes), sizes)
    return ta.HarmonicModel([shaft], period=360.0)


def test_orders_without_a_register_are_told_with_what_they_leave() -> None:
    """Order 4 of 200 arcsec, and the rounding of four magnitudes and phases beside it."""
    made = ta.export_model(model(o1=600.0, o4=200.0), "admt4000", bits=12)
    (note,) = [n for n in made.notes if "no register" in n]
    assert note.startswith("order 4 has no register")
    left = float(re.findall(r"register: (\S+) arcsec rms", note)[0])
    assert left == pytest.approx(200.0 / np.sqrt(2.0), rel=0.02)
    assert made.rms_difference_arcsec == pytest.approx(left, rel=1e-3)
    # A sine whose amplitude is rounded leaves a root of 1/24 of its step; there are four.
    step = 360.0 / 65536.0 / 0.6072 * 3600.0
    assert made.floor_arcsec == pytest.approx(np.sqrt(4.0 / 24.0) * step)
    assert not any(
        "no register" in n for n in ta.export_model(model(o8=90.0), "admt4000", bits=12).notes
    )


def test_a_scaled_table_is_read_with_the_error_of_its_step(tmp_path) -> None:
    """Moteus: 127 steps of int8 to the largest knot, of 256 entries."""
    path = tmp_path / "a.cfg"
    made = ta.export_model(model(o1=900.0), "moteus", path, bits=14)
    scale = float(re.search(r"compensation_scale (\S+)", made.text)[1])
    step = scale / 127.0 * 360.0
    read = ta.import_model(path, "moteus", bits=14)
    assert read.fit.residual == pytest.approx(step / np.sqrt(12.0))
    variance = step**2 / 12.0
    np.testing.assert_allclose(np.diag(read.covariance)[1:], 2.0 * variance / 256.0, rtol=1e-6)
    assert made.floor_arcsec == pytest.approx(step * 3600.0 / np.sqrt(18.0))


@pytest.mark.parametrize(("bits", "entries"), [(13, 128), (13, 256), (14, 256)])
def test_whole_ticks_leave_what_their_rounding_and_their_shift_do(bits: int, entries: int) -> None:
    """Tinymovr: of entries rounded, and of what is between them cut down, in the device's own way.

    The error is steep, so that entries differ by ticks; what their
    curve between entries adds is small. Cutting goes in few steps where entries differ by few.
    """
    ratios = []
    for k in range(12):
        made = ta.export_model(
            model(o1=20_000.0 + 370.0 * k), "tinymovr", bits=bits, entries=entries
        )
        ratios.append(made.rms_difference_arcsec / made.floor_arcsec)
    print(np.mean(ratios), np.std(ratios))
    assert np.sqrt(np.mean(np.square(ratios))) == pytest.approx(1.0, rel=0.08)


def test_knots_and_results_in_whole_counts_leave_what_both_roundings_do(tmp_path) -> None:
    """Klipper: knots differ by tens of counts, and what is between them adds little."""
    ratios = []
    for k in range(12):
        one = model(o1=3000.0 + 7.0 * k, o2=1000.0 + k)
        made = ta.export_model(one, "klipper", existing=existing(tmp_path, one))
        ratios.append(made.rms_difference_arcsec / made.floor_arcsec)
    print(np.mean(ratios), np.std(ratios))
    assert np.sqrt(np.mean(np.square(ratios))) == pytest.approx(1.0, rel=0.04)


def test_a_list_that_is_there_is_told_by_its_distance(tmp_path) -> None:
    """Klipper's of 500 arcsec of order 2, and a model of 800: 300 of a sine, rms."""
    path = existing(tmp_path, model(o2=500.0))
    made = ta.export_model(model(o2=800.0), "klipper", existing=path)
    (note,) = [n for n in made.notes if n.startswith("the present list is")]
    said = float(re.findall(r"is (\S+) arcsec", note)[0])
    # Whole tenths of a count are 2 arcsec.
    assert said == pytest.approx(300.0 / np.sqrt(2.0), rel=0.02)


def test_a_list_that_ends_in_two_equal_readings_counts_as_rising(tmp_path) -> None:
    """As Klipper has it; confused with a falling one it is of no motor with this model."""
    path = Path(existing(tmp_path, model(o2=500.0)))
    *rows, before, _ = path.read_text().split(", ")
    path.write_text(", ".join([*rows, before, before]) + "\n")
    made = ta.export_model(model(o2=500.0), "klipper", existing=str(path))
    (note,) = [n for n in made.notes if n.startswith("the present list is")]
    # One of 200 is a full step off, of 6480 arcsec.
    assert float(re.findall(r"is (\S+) arcsec", note)[0]) == pytest.approx(
        6480.0 / 200.0**0.5, rel=0.05
    )


@pytest.mark.parametrize("zero", [-47.0, 0.5, 123.0])
def test_the_zero_of_a_lookup_that_is_kept_is_told_in_degrees(zero, tmp_path) -> None:
    places = np.arange(16384) * (360.0 / 16384)
    table = np.mod(places - model(o1=700.0).error(places) + zero, 360.0)
    path = tmp_path / "Parameters.cpp"
    body = ", ".join(f"{value:.3f}" for value in table)
    path.write_text(f"const PROGMEM float lookup[16384] = {{\n{body}\n}};\n")
    made = ta.export_model(model(o1=700.0), "mechaduino", existing=str(path))
    (note,) = [n for n in made.notes if "is kept" in n]
    told = re.search(r"is kept: (\S+) deg", note)
    assert told is not None
    # An error at the reading is not one at the reference: 700 arcsec times its slope.
    assert float(told[1]) == pytest.approx(zero, abs=1e-3)


def test_entries_of_a_scaled_table_are_int8(tmp_path) -> None:
    """Moteus: from -128 to 127, which is one less than the other side has."""
    path = tmp_path / "a.cfg"
    ta.export_model(model(o1=900.0), "moteus", path, bits=14)
    lines = path.read_text("utf-8").splitlines()
    at = next(k for k, line in enumerate(lines) if re.search(r"compensation_table\.7 ", line))

    def read(entry: str) -> object:
        lines[at] = re.sub(r"\S+$", entry, lines[at])
        path.write_text("\n".join(lines), "utf-8")
        return ta.import_model(path, "moteus", bits=14)

    for entry in ("-128", "127"):
        read(entry)
    for entry in ("-129", "128", "1.5"):
        with pytest.raises(ta.errors.FileError, match=f"line {at + 1}.*table of int8"):
            read(entry)


#: A model that takes a quarter of a turn off, and nothing else.
QUARTER = ta.HarmonicModel(
    [ta.Shaft("output", 1, [1], [0.0], [0.0])], 90.0, 360.0, argument="indicated"
)


@pytest.mark.parametrize("size", [0.01, -0.01])
@pytest.mark.parametrize("argument", ["indicated", "reference"])
@pytest.mark.parametrize("whole", [False, True])
@pytest.mark.parametrize("travel", [None, (90.0, 180.0), (-30.0, 60.0), (180.0, 450.0)])
def test_a_pulse_beside_the_model_has_its_rms_and_its_maximum(size, argument, whole, travel):
    """Over the travel alone, its mean apart, and a jump by a whole turn is none."""
    start, stop = travel or (0.0, 360.0)
    share = 0.2
    begin = start + 0.3 * (stop - start)
    end = begin + share * (stop - start)

    def device(places: np.ndarray) -> np.ndarray:
        angle = places * (360.0 / 2.0**32)
        assert start <= angle.min() < angle.max() < stop
        pulse = np.where((angle >= begin) & (angle < end), size, 0.0)
        return pulse + (np.where(angle > 0.5 * (start + stop), 1.0, 0.0) if whole else 0.0)

    target = SimpleNamespace(argument=argument)
    rms, largest = reading._arithmetic(QUARTER, target, device, 1, travel)
    assert rms == pytest.approx(abs(size) * math.sqrt(share * (1.0 - share)), rel=1e-4)
    assert largest == pytest.approx(abs(size) * (1.0 - share), rel=1e-4)


SEED = 63
#: Single precision of angles up to a turn, and of places among the entries.
SINGLE = 4e-6


@pytest.mark.parametrize("entries", [16, 50, 128])
@pytest.mark.parametrize("contracted", [False, True])
def test_the_short_table_is_interpolated_and_wrapped(entries, contracted):
    print(f"seed {SEED}")
    rng = np.random.default_rng(SEED)
    table = (simplefoc._MIDDLE + rng.integers(-300, 300, entries)).astype(np.uint16)
    raw = rng.uniform(-2.0, 8.0, 500).astype(np.float32)
    found = simplefoc.corrected_short(raw, table, contracted)
    knots = (np.append(table, table[0]).astype(float) - simplefoc._MIDDLE) / simplefoc._PER_RADIAN
    turn = np.mod(raw.astype(float), 2.0 * np.pi)
    offset = np.interp(turn / (2.0 * np.pi) * entries, np.arange(entries + 1), knots)
    apart = np.mod(found - (turn - offset) + np.pi, 2.0 * np.pi) - np.pi
    np.testing.assert_allclose(apart, 0.0, atol=SINGLE)
    assert ((found >= 0.0) & (found < 6.2832)).all()
