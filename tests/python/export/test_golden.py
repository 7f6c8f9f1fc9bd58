"""Restated arithmetic of the targets against pairs made by their own code."""

import math

import numpy as np
import pytest

import trueangle as ta
from trueangle.export.klipper import calibrated, solved_knots
from trueangle.export.moteus import compensated
from trueangle.export.simplefoc import corrected_float
from trueangle.export.tinymovr import tinymovr_rectified

from .conftest import DATA, columns, golden_model, truth

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
