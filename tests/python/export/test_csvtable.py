"""A plain table of corrections: how many lines it may have, and what is read of one."""

import re

import pytest

import trueangle as ta
from trueangle.errors import ArgumentError, FileError

from .conftest import golden_model

HEADER = "indicated_deg,correction_deg"


def wave(top):
    return ta.HarmonicModel((ta.Shaft("output", 1, (top,), (1e-4,), (0.0,)),))


@pytest.mark.parametrize("top", [2, 5, 8, 40])
def test_the_entries_that_a_refusal_names_are_the_fewest_that_are_taken(top):
    with pytest.raises(ArgumentError, match=r"use `entries=\d+` or more") as refused:
        ta.export_model(wave(top), "csv", entries=2 * top)
    named = int(re.search(r"entries=(\d+)", str(refused.value))[1])
    assert named == 2 * top + 1
    assert ta.export_model(wave(top), "csv", entries=named, bits=8).entries == named


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
