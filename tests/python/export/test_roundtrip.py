"""Tables that come back as models, and the difference of two models."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.errors import ArgumentError, FileError

from .conftest import golden_model


@pytest.mark.parametrize(
    ("target", "ending", "options"),
    [
        ("c", ".h", {"number": "q15", "entries": 128}),
        ("c", ".h", {"number": "q31", "method": "cubic", "entries": 64}),
        ("c", ".h", {"number": "f32", "entries": 256}),
        ("rust", ".rs", {"number": "q15", "method": "cubic", "entries": 64}),
        ("rust", ".rs", {"number": "f32", "method": "cubic", "entries": 64}),
        ("csv", ".csv", {"entries": 90}),
    ],
)
@pytest.mark.parametrize("argument", ["reference", "indicated"])
def test_an_exported_table_is_the_model_again(target, ending, options, argument, model, tmp_path):
    moved = model.replace(argument=argument, constant=0.0 if target == "csv" else -0.4)
    path = tmp_path / f"a{ending}"
    made = ta.export_model(moved, target, path, bits=16, **options)
    back = ta.import_model(path, target)
    result = ta.compare(moved, back)
    assert result.max_abs_arcsec <= made.max_difference_arcsec + 0.01
    assert abs(result.zero_deg) < 1e-4
    x = np.linspace(0.0, 360.0, 4001)
    far = np.asarray(back.correct(x)) - np.degrees(moved.correct(np.radians(x)))
    assert np.max(np.abs(far)) * 3600 <= made.max_difference_arcsec + 0.5


def test_the_resolution_is_the_uncertainty(model, tmp_path):
    ta.export_model(model, "c", tmp_path / "a.h", number="q15", entries=128, bits=12)
    back = ta.import_model(tmp_path / "a.h", "c")
    step = 2.0**9 / 2.0**32 * 360.0
    assert back.fit.residual == pytest.approx(step / 12**0.5)
    assert back.covariance is not None
    assert back.provenance.inputs[0].file.endswith("a.h")


def test_two_shafts_come_back(joint, tmp_path):
    ta.export_model(joint, "rust", tmp_path / "a.rs", method="cubic", entries=128, bits=16)
    result = ta.compare(joint, ta.import_model(tmp_path / "a.rs", "rust"))
    assert result.max_abs_arcsec < 0.01


@pytest.mark.parametrize(
    ("text", "target"),
    [
        ("", "c"),
        ("int main(void) { return 0; }", "c"),
        ("indicated_deg,correction_deg\n0,0\n90,x\n", "csv"),
        ("indicated_deg,correction_deg\n0,0\n90,1\n100,1\n200,1\n360,0\n", "csv"),
        ("indicated_deg,correction_deg\n0,0\n90,nan\n180,1\n270,1\n360,0\n", "csv"),
        ("a,b\n", "csv"),
    ],
)
def test_what_is_no_table_is_refused(text, target, tmp_path):
    path = tmp_path / "table"
    path.write_text(text)
    with pytest.raises(ta.errors.FileError, match="table"):
        ta.import_model(path, target)


def test_a_cut_table_is_refused(model, tmp_path):
    path = tmp_path / "a.h"
    ta.export_model(model, "c", path, entries=64, bits=12)
    path.write_text(path.read_text().replace("    ", "", 1).replace(", ", " ", 1))
    path.write_text("\n".join(path.read_text().split("\n")[:40]))
    with pytest.raises(ta.errors.FileError, match="does not hold 65 numbers"):
        ta.import_model(path, "c")


def test_comparison_of_models_of_one_angle_is_of_their_coefficients():
    a = ta.HarmonicModel((ta.Shaft("output", 1, (1, 3), (0.1, 0.0), (0.0, 0.2)),), period=360.0)
    b = ta.HarmonicModel((ta.Shaft("output", 1, (1, 3), (0.1, 0.2), (0.0, 0.2)),), 0.5, 360.0)
    result = ta.compare(a, b)
    first, third = result.orders
    assert first["amplitude_arcsec"] == 0.0
    assert third["amplitude_arcsec"] == pytest.approx(720.0)
    assert third["phase_deg"] == pytest.approx(90.0)
    assert result.zero_deg == pytest.approx(0.5)
    assert result.rms_arcsec == pytest.approx(720.0 / 2**0.5)
    assert result.max_abs_arcsec == pytest.approx(720.0, rel=1e-4)


def test_comparison_adds_variances_and_names_terms():
    def one(scale, terms=()):
        return ta.HarmonicModel(
            (ta.Shaft("output", 1, (2,), (0.1,), (0.0,)),),
            period=360.0,
            covariance=np.diag([1.0, scale**2, scale**2]),
            terms=terms,
        )

    result = ta.compare(one(3e-4), one(4e-4, (ta.Backlash(0.1),)))
    assert result.orders[0]["std_arcsec"] == pytest.approx(1.8)
    # one order: its cosine and sine, half of the turn each
    assert result.std_arcsec == pytest.approx(1.8)
    assert result.differ_in == ["backlash"]


def test_comparison_of_other_units_and_arguments(model):
    other = ta.HarmonicModel(
        tuple(
            ta.Shaft(s.name, 1, s.orders, np.degrees(s.cosine), np.degrees(s.sine))
            for s in model.shafts
        ),
        period=360.0,
        argument="indicated",
    )
    assert ta.compare(model, other.replace(argument="reference")).max_abs_arcsec < 1e-6
    result = ta.compare(model, other)
    theta = np.linspace(0, 2 * np.pi, 7201)
    other_error = np.radians([x - other.correct(x) for x in np.degrees(theta + model.error(theta))])
    # at the reading the one would give: near enough to tell the size of the difference
    size = np.max(np.abs(other_error - model.error(theta))) * 648_000 / np.pi
    assert result.max_abs_arcsec == pytest.approx(size, rel=0.1)


def test_commands(model, tmp_path, capsys):
    path = tmp_path / "m.json"
    model.save(path)
    out = tmp_path / "m.h"
    assert main(["export", str(path), "--to", "c", "-o", str(out), "--bits", "14", "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert found["target"] == "c"
    assert out.is_file()
    back = tmp_path / "back.json"
    assert main(["import", str(out), "--from", "c", "-o", str(back), "--json"]) == 0
    assert [row["order"] for row in json.loads(capsys.readouterr().out)["orders"]][:2] == [1, 2]
    assert main(["compare", str(path), str(back), "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert set(found) >= {"orders", "rms_arcsec", "max_abs_arcsec", "zero_deg"}
    assert main(["compare", str(path), str(back)]) == 0
    assert "arcsec rms" in capsys.readouterr().out


def test_an_input_is_not_overwritten(model, tmp_path, capsys):
    path = tmp_path / "m"
    model.save(path)
    before = path.read_bytes()
    assert main(["export", str(path), "--to", "c", "-o", str(path), "--bits", "12"]) == 1
    assert "overwritten" in capsys.readouterr().err
    assert main(["export", str(path), "--to", "c", "-o", str(tmp_path / "m.json")]) == 1
    assert path.read_bytes() == before
    table = tmp_path / "table"
    ta.export_model(model, "c", table, bits=12)
    before = table.read_bytes()
    assert main(["import", str(table), "--from", "c", "-o", str(table)]) == 1
    assert table.read_bytes() == before


HEADER = "indicated_deg,correction_deg"


def wave(top):
    return ta.HarmonicModel((ta.Shaft("output", 1, (top,), (1e-4,), (0.0,)),))


@pytest.mark.parametrize("top", [2, 5, 8, 40])
def test_the_entries_that_a_refusal_names_keep_the_order(top):
    with pytest.raises(ArgumentError, match=r"use `entries=\d+` or more") as refused:
        ta.export_model(wave(top), "csv", entries=2 * top)
    named = int(re.search(r"entries=(\d+)", str(refused.value))[1])
    assert ta.export_model(wave(top), "csv", entries=2 * top + 1, bits=8).entries == 2 * top + 1
    made = ta.export_model(wave(top), "csv", entries=named, bits=8)
    assert made.lost[0]["arcsec"] < 0.02 * 1e-4 / (2.0 * np.pi) * 1_296_000.0


def test_four_lines_to_a_million_are_taken():
    assert ta.export_model(wave(1), "csv", entries=4, bits=8).entries == 4
    for entries in (3, 0, -5, 1_000_001):
        with pytest.raises(ArgumentError, match=f"from 4 to 1000000, got {entries}"):
            ta.export_model(wave(1), "csv", entries=entries)


@pytest.mark.parametrize("entries", [17, 36])
def test_a_line_is_two_numbers_of_eight_bytes_and_the_first_stands_at_the_end_again(entries):
    made = ta.export_model(golden_model(), "csv", entries=entries, bits=8)
    rows = [line.split(",") for line in made.text.split(HEADER + "\n")[1].splitlines()]
    assert len(rows) == entries + 1
    assert made.bytes == 16 * len(rows)
    assert float(rows[0][0]) == 0.0
    assert float(rows[-1][0]) == 360.0
    assert rows[0][1] == rows[-1][1]


def read(folder, rows):
    path = folder / "table.csv"
    path.write_text("\n".join([HEADER, *rows, ""]))
    return ta.import_model(path, "csv")


def table(count, moved=0.0):
    """Corrections of 0.1 deg to either side in turn, the second line moved."""
    places = [k * 360.0 / count + (moved if k == 1 else 0.0) for k in range(count + 1)]
    return [f"{x:.9f},{0.1 if k % 2 else -0.1:.9f}" for k, x in enumerate(places)]


@pytest.mark.parametrize("moved", [1e-7, -1e-7, 5e-4, -5e-4])
def test_lines_stand_at_equal_distances_but_for_their_rounding(moved, tmp_path):
    if abs(moved) < 1e-6:
        read(tmp_path, table(36, moved))
    else:
        with pytest.raises(FileError, match="equally spaced from 0 to 360"):
            read(tmp_path, table(36, moved))


def test_a_table_has_four_lines_and_the_first_again_at_least(tmp_path):
    read(tmp_path, table(4))
    with pytest.raises(FileError, match="equally spaced"):
        read(tmp_path, table(3))


@pytest.mark.parametrize("row", [0, 1, 20])
@pytest.mark.parametrize("cells", ["0.1", "0.1,0.2,0.3", "0.1,x", "0.1,nan", "inf,0.1"])
def test_a_line_that_is_no_two_numbers_is_named(cells, row, tmp_path):
    rows = table(36)
    rows[row] = cells
    with pytest.raises(FileError, match="numbers are needed") as refused:
        read(tmp_path, rows)
    assert refused.value.line == row + 2


MODEL = ta.HarmonicModel([ta.Shaft("output", 1, [1, 3], [0.2, 0.05], [0.1, 0.0])], 0.25, 360.0)
ENDINGS = {"c": "joint.h", "rust": "joint.rs"}


@pytest.fixture(
    scope="module", params=[("c", {}), ("c", {"method": "cubic"}), ("rust", {})], ids=str
)
def made(request: pytest.FixtureRequest) -> tuple[str, str]:
    target, options = request.param
    return target, ta.export_model(MODEL, target, **options).text


@pytest.fixture
def exported(made: tuple[str, str], tmp_path: Path) -> tuple[str, Path]:
    target, text = made
    path = tmp_path / ENDINGS[target]
    path.write_text(text, "utf-8")
    return target, path


def changed(path: Path, pattern: str, new: str) -> None:
    text = path.read_text("utf-8")
    said, times = re.subn(pattern, new, text, count=1)
    assert times == 1
    path.write_text(said, "utf-8")


@pytest.mark.parametrize(
    ("pattern", "new", "told"),
    [
        (r"1 cycles", "1e999 cycles", "a shift of .* and 1e999 cycles"),
        (r"1 cycles", "2147483648 cycles", "and 2147483648 cycles"),
        (r"1 cycles", "0 cycles", "and 0 cycles"),
        (r"1 cycles", "-1 cycles", "and -1 cycles"),
        (r"1 cycles", ". cycles", r"and \. cycles"),
        (r"shift \d+", "shift 32", r"a shift of 32 \(0 to 31\)"),
        (r"shift \d+", f"shift {'9' * 400}", "a shift of 99999999999999999999 "),
        (r"Zero: -?\d+", f"Zero: {1 << 63}", "its zero is beyond 64 bits: 9223372036854775808"),
        (r"Zero: -?\d+", f"Zero: -{'9' * 400}", "its zero is beyond 64 bits: -99999"),
    ],
)
def test_what_no_table_has_is_refused_in_one_line(exported, pattern, new, told) -> None:
    target, path = exported
    changed(path, pattern, new)
    with pytest.raises(FileError, match=told) as error:
        ta.import_model(path, target)
    assert path.name in str(error.value)
    assert "\n" not in str(error.value)


@pytest.mark.parametrize("turns", [-3, 0, 2])
def test_whole_turns_of_the_zero_change_no_correction(exported, turns) -> None:
    """From half a turn on a zero is read modulo one, as before turns were counted."""
    target, path = exported
    before = ta.import_model(path, target)
    zero = int(re.search(r"Zero: (-?\d+)", path.read_text("utf-8"))[1])
    assert zero == round(MODEL.constant / 360.0 * 2**32)
    changed(path, r"Zero: -?\d+", f"Zero: {zero + turns * 2**32}")
    after = ta.import_model(path, target)
    angles = [0.0, 77.0, 200.0, 359.0]
    turned = (after.correct(angles) - before.correct(angles)) / 360.0
    assert turned == pytest.approx([round(turned[0])] * 4, abs=1e-9)
