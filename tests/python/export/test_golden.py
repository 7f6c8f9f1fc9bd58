"""Restated arithmetic of the targets against pairs made by their own code."""

import math
import re
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

import trueangle as ta
from trueangle.export import reading, simplefoc
from trueangle.export.klipper import calibrated, solved_knots
from trueangle.export.moteus import compensated
from trueangle.export.simplefoc import corrected_float
from trueangle.export.tinymovr import tinymovr_rectified

from .conftest import DATA, columns, golden_model, truth
from .test_bounds import existing

#: What the targets' own code leaves of the model with these tables, arcsec rms.
LEFT = {"simplefoc": 3.11, "moteus": 6.83, "klipper": 9.35}

#: Those figures are of other inputs than the pairs: 500 of them tell an rms to half a percent.
OF_OTHER_INPUTS = 0.02


def rms_arcsec(turns):
    turns = turns - np.rint(turns)
    return float(np.sqrt(np.mean(turns**2))) * 1_296_000


def test_simplefoc_to_the_last_bit():
    table = columns("simplefoc_f7a91fa_table.csv").astype(np.float32)
    raw, out = columns("simplefoc_f7a91fa.csv").astype(np.float32).T
    found = corrected_float(raw, table, +1.0)
    assert found.tobytes() == out.tobytes()
    # a flipped sign, and a table shifted by one entry, are seen
    assert np.max(np.abs(corrected_float(raw, -table, +1.0) - out)) > 0.02
    assert np.any(corrected_float(raw, np.roll(table, 1), +1.0) != out)
    left = found - truth(raw.astype(float))
    assert abs(rms_arcsec(left / (2 * np.pi)) - LEFT["simplefoc"]) < OF_OTHER_INPUTS


def test_moteus_to_the_last_bit():
    table = columns("moteus_db1a762_table.csv").astype(np.int8)
    scale = np.float32(0.00274660555)
    value, out = columns("moteus_db1a762.csv").T
    found = compensated(value.astype(np.uint32), table, scale, 16384)
    assert np.array_equal(found.astype(np.float32), out.astype(np.float32))
    every = np.arange(16384)
    left = compensated(every.astype(np.uint32), table, scale, 16384) / 16384
    left -= truth(every * (2 * np.pi / 16384)) / (2 * np.pi)
    assert abs(rms_arcsec(left) - LEFT["moteus"]) < OF_OTHER_INPUTS


def test_moteus_unit_test_of_the_firmware():
    """MotorPositionCompensation of fw/test/motor_position_test.cc: entries 0.1, 0, -0.05, -0.02."""
    table = np.zeros(256, np.int8)
    table[:4] = 10, 0, -5, -2
    wanted = {
        0: 1638.4, 32: 851.2, 63: 88.6, 64: 64.0, 96: 16070.4, 127: 15704.6, 128: 15692.8,
        160: 15970.56, 192: 16248.32,
    }  # fmt: skip
    found = compensated(np.array(list(wanted), np.uint32), table, np.float32(1.27), 16384)
    np.testing.assert_allclose(found, list(wanted.values()), rtol=1e-4)


def test_klipper_count_for_count():
    values = columns("klipper_0a7a14e_calibrate.csv")
    raw, out = columns("klipper_0a7a14e.csv").astype(np.int64).T
    knots, first = solved_knots(values)
    assert first == 1
    assert calibrated(raw, knots).tolist() == out.tolist()
    assert not np.array_equal(calibrated(raw, knots + 1), out)
    left = calibrated(raw, knots) / 65536 - truth(raw * (2 * np.pi / 65536)) / (2 * np.pi)
    left -= np.rint(left)
    assert abs(rms_arcsec(left - left.mean()) - LEFT["klipper"]) < OF_OTHER_INPUTS


def test_tinymovr_shifts_down():
    """(7 - 2) * 3 >> 2 is 3, and (2 - 7) * 3 >> 2 is -4: an arithmetic shift, as in C on ARM."""
    table = np.array([2, 7, 2, -3])
    assert tinymovr_rectified(np.array([3, 7, 15]), table, 4).tolist() == [
        3 + 2 + 3,
        7 + 7 - 4,
        15 - 3 + 3,
    ]


@pytest.mark.parametrize("name", ["simplefoc", "moteus", "klipper"])
def test_no_worse_than_the_reference(name, tmp_path):
    """rms of least-squares knots in each target's own arithmetic, arcsec."""
    model = golden_model()
    options = {
        "simplefoc": {"variant": "minus-float", "bits": 18},
        "moteus": {"bits": 16},
        "klipper": {"existing": printer_config(tmp_path)},
    }[name]
    wanted = {"simplefoc": 0.511, "moteus": 6.3, "klipper": 9.3}[name]
    made = ta.export_model(model, name, **options)
    assert wanted / 2 < made.rms_difference_arcsec <= wanted
    assert made.rms_difference_arcsec < LEFT[name]


def printer_config(folder, reversed_=False):
    cells = [f"{value:.1f}" for value in columns("klipper_0a7a14e_calibrate.csv")]
    if reversed_:  # as Klipper saves it: from the largest reading's place, a multiple of 4 steps
        cells = cells[::-1]
        cells = cells[196:] + cells[:196]
    lines = ",\n\t".join(", ".join(cells[i : i + 8]) for i in range(0, len(cells), 8))
    path = folder / "printer.cfg"
    path.write_text(
        "[stepper_x]\nmicrosteps: 16\n[angle my_angle]\nsensor_type: as5047d\n"
        f"calibrate =\n\t{lines}\nstepper: stepper_x\n[fan]\npin: x\n"
    )
    return str(path)


def test_magalpha_example():
    """Orders 1 to 4 in the indicated angle, fitted on even rows: 0.49 deg on the odd ones."""
    reference, indicated = columns("mps_magalpha_example.csv").T
    order = np.argsort(indicated)
    reference, indicated = reference[order], indicated[order]
    run = ta.CalibrationRun(reference[::2], indicated[::2], period=360.0)

    def left(argument):
        fit = ta.fit([run], orders=[1, 2, 3, 4], argument=argument, loss="linear")
        off = np.asarray(fit.model.correct(indicated[1::2])) - reference[1::2]
        return float(np.sqrt(np.mean((off - np.round(off / 360.0) * 360.0) ** 2)))

    print(f"indicated {left('indicated'):.4f}, reference {left('reference'):.4f}")
    assert left("indicated") <= 0.49
    assert left("reference") <= 0.52
    assert left("indicated") < left("reference")


def test_data_is_named():
    named = (DATA / "README.md").read_text()
    for path in DATA.glob("*.csv"):
        assert path.name.split("_")[0] in named
    assert math.isclose(len(list(DATA.glob("*.csv"))), 7)


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
