"""What stands before the readings of a text file: where names, units and readings begin."""

import io
from pathlib import Path

import pytest

from trueangle.errors import FileError
from trueangle.formats.csvheader import Header

PATH = Path("rig.csv")
THREE = "0.0,1.5,2.5\n0.1,1.6,2.6\n0.2,1.7,2.7\n0.3,1.8,2.8\n"


def header(text, encoding="utf-8"):
    file = io.BytesIO(text.encode(encoding))
    found = Header(PATH, file)
    rest = file.read().decode(encoding)
    # What is left to be read begins at the line that it says, and nothing is lost.
    assert b"".join(found.head) + rest.encode(encoding) == text.encode(encoding)
    assert found.line == len(found.head) + 1
    return found


@pytest.mark.parametrize("delimiter", [",", ";", "\t", " "])
@pytest.mark.parametrize("width", [2, 3, 5])
@pytest.mark.parametrize("words", [1, 2, 3, 4, 5, 6, 8])
def test_words_above_readings_are_names_where_they_are_as_many(words, width, delimiter):
    """One cell more or less is an end of the line that was forgotten, but not among blanks; one
    word alone above several columns is what a firmware says."""
    told = delimiter.join("abcdefgh"[:words])
    rows = [delimiter.join(f"{k}.{c}" for c in range(1, width + 1)) for k in range(6)]
    found = header("\n".join([told, *rows, ""]))
    near = 0 if delimiter == " " else 1
    named = abs(words - width) <= near and words > 1
    assert found.place == (0 if named else -1)
    assert found.delimiter == delimiter
    assert found.line == 2
    wanted = list("abcdefgh"[:words]) if named else [f"column{k + 1}" for k in range(width)]
    assert found.names == wanted


@pytest.mark.parametrize(
    ("row", "delimiter", "names"),
    [
        ("0,5 1,25 2", " ", 3),
        ("0,5  1  2,5", " ", 3),
        ("1 2 3", " ", 3),
        ("0,5", ",", 2),
        ("1, 2, 3", ",", 3),
        ("0.5 ,1.25,2", ",", 3),
        ("1,2,3 4", ",", 3),
        ("1,2 ok,3", ",", 3),
    ],
)
def test_commas_between_blanks_are_those_of_numbers(row, delimiter, names):
    """But where one stands at the end of a number, or parts three of them."""
    found = header(f"{row}\n" * 5)
    assert (found.delimiter, len(found.names)) == (delimiter, names)
    assert found.decimal == ("," if delimiter == " " and "," in row else ".")


@pytest.mark.parametrize("first", ["time_s", "# made by a logger\ntime_s", "of the rig\n\ntime_s"])
@pytest.mark.parametrize("rows", [4, 5, 200, 2000])
@pytest.mark.parametrize("end", ["", ","])
def test_names_that_stand_again_begin_no_other_table(end, rows, first):
    """All readings above them were lost, of files that were put one behind the other."""
    names = f"{first},reference_deg,indicated_deg{end}\n"
    one = names + "".join(f"0.{k},{k}.5,{k}.7{end}\n" for k in range(rows))
    found = header(2 * one)
    assert found.names == ["time_s", "reference_deg", "indicated_deg"]
    assert found.line == first.count("\n") + 2


def test_a_preamble_that_speaks_of_columns_has_no_names():
    told = "log of indicated_deg,2026\nrate,1000\ngain,2\n"
    found = header(f"{told}time_s,reference_deg,indicated_deg\n{THREE}")
    assert found.names == ["time_s", "reference_deg", "indicated_deg"]
    assert found.line == 5


@pytest.mark.parametrize("delimiter", [",", ";", "\t"])
@pytest.mark.parametrize("before", ["", "made at the rig\n", "# rig 3\n\n"])
@pytest.mark.parametrize("row", [0, 3, 5])
@pytest.mark.parametrize("end", [(0, 0), (1, 1), (0, 1)])
def test_a_remark_that_is_a_name_makes_no_line_of_names(row, before, end, delimiter):
    names = ["run", "time_s", "indicated_deg", "note"]
    rows = [["a", str(0.5 * k), f"{9.5 * k}", "ok"] for k in range(6)]
    rows[row][3] = "time_s"
    ends = [end[0], *[end[1]] * 6]
    lines = zip((names, *rows), ends, strict=True)
    text = "\n".join(delimiter.join([*cells, *[""] * more]) for cells, more in lines)
    found = header(before + text + "\n")
    assert found.names == names
    assert found.line == before.count("\n") + 2


@pytest.mark.parametrize(
    ("notes", "names", "place"),
    [
        ("# t,x,y\n", ["t", "x", "y"], 0),
        ("# rig 3\n# t,x,y\n", ["t", "x", "y"], 1),
        ("# t,x,y\n# made at the rig\n", ["column1", "column2", "column3"], -1),
        ("# t,x,y\n# a,b,c\n", ["a", "b", "c"], 1),
    ],
)
def test_of_notes_the_last_above_the_readings_may_be_names(notes, names, place):
    found = header(notes + THREE)
    assert (found.names, found.place) == (names, place)
    assert found.line == notes.count("\n") + 1


def test_one_name_above_one_column_that_ends_with_a_delimiter_is_a_name():
    found = header("angle\n1.5,\n2.5,\n3.5,\n4.5,\n")
    assert (found.names, found.place, found.trailing) == (["angle"], 0, True)
    assert found.width == 2


@pytest.mark.parametrize(("last", "trailing"), [("", True), ("4.5", False)])
def test_a_cell_more_than_names_is_the_end_of_a_line_where_it_is_empty(last, trailing):
    rows = "".join(f"{line},{last}\n" for line in THREE.splitlines())
    assert header("t,ref,enc\n" + rows).trailing is trailing


@pytest.mark.parametrize(
    ("units", "line", "names"),
    [
        (
            "s,deg,deg,Nm",
            3,
            ["time_s [s]", "reference_deg [deg]", "indicated_deg [deg]", "load [Nm]"],
        ),
        ("s,deg,deg", 3, ["time_s [s]", "reference_deg [deg]", "indicated_deg [deg]", "load"]),
        ("s,deg", 2, ["time_s", "reference_deg", "indicated_deg", "load"]),
    ],
)
def test_a_line_of_units_may_lack_its_last_cell(units, line, names):
    rows = "".join(f"{row},1.0\n" for row in THREE.splitlines())
    found = header(f"time_s,reference_deg,indicated_deg,load\n{units}\n{rows}")
    assert (found.line, found.names) == (line, names)


@pytest.mark.parametrize(("more", "begins"), [("on,off", 4), ("on,off,up", 2)])
def test_readings_are_lines_of_which_half_are_numbers(more, begins):
    """With 2 numbers of 4 below a preamble of other lines; with 2 of 5 they are words."""
    words = [f"w{k}" for k in range(len(more.split(",")))]
    rows = "".join(f"{k}.5,{k}.25,{more}\n" for k in range(5))
    found = header("Model,DSO-X\nSource,CH1\n" + ",".join(["t", "ref", *words]) + "\n" + rows)
    assert found.line == begins
    if begins == 4:
        assert found.names == ["t", "ref", *words]


def test_time_columns_of_twincat_are_numbered_and_all_in_milliseconds():
    """The last line of names counts; a unit stands before the blank of what it means."""
    cells = ("Name", "axis.ref", "Name", "axis.enc", "axis.load")
    lines = [
        "Name\tProject\tName\tother\tmore", "Data-Type\tREAL64\tData-Type\tREAL64\tREAL64",
        "\t".join(cells), "Unit\tdeg (degrees)\tUnit\t(None)\tNm",
        *("\t".join(f"{k}.{c}" for c in range(5)) for k in range(6)), "",
    ]  # fmt: skip
    found = header("\n".join(lines))
    assert found.place == 2
    assert found.names == [
        "time [ms]", "axis.ref [deg]", "time 2 [ms]", "axis.enc", "axis.load [Nm]"
    ]  # fmt: skip


@pytest.mark.parametrize("below", range(5))
def test_known_names_are_taken_wherever_lines_of_their_width_follow(below):
    """Also where these begin with words, as angles that come later do; else they are talk."""
    names = "time_s,mode,reference_deg,load"
    rows = ["0.5,on,no,up", "0.6,on,no,up", "0.7,off,no,up", "0.8,off,no,up"][:below]
    found = header("\n".join(["rig", "of the lab", names, *rows, ""]))
    assert (found.place, found.line) == ((2, 4) if below else (0, 2))
    assert found.names == (names.split(",") if below else ["rig"])


def test_known_names_in_words_below_the_readings_are_no_names():
    found = header(f"t,ref,enc\n{THREE}the clock of time_s is off\n")
    assert (found.place, found.names, found.line) == (0, ["t", "ref", "enc"], 2)


@pytest.mark.parametrize("ending", ["\n", "\r\n"])
def test_lines_end_as_the_line_of_names_does(ending):
    text = ("# a note\nt,ref,enc\n" + THREE).replace("\n", ending)
    found = header(text)
    assert found.ending == ending
    assert found.with_names(["more"]) == f"# a note{ending}t,ref,enc,more{ending}".encode()


def test_two_names_among_blanks_are_two():
    found = header("reference_deg indicated_deg\n1.5 2.5\n1.6 2.6\n")
    assert found.delimiter == " "
    assert found.names == ["reference_deg", "indicated_deg"]


@pytest.mark.parametrize(
    ("sign", "known"),
    [("\u00b0", True), ("\u00b5", True), ("\u00fc", True), ("\u2019", False), ("\u0192", False)],
)
def test_letters_of_western_europe_are_read_and_signs_of_a_code_page_are_not(sign, known):
    """Bytes from 0xA0 on; those below are curly quotes, or another code page's letters."""
    text = f"t,ref [{sign}],enc\n{THREE}"
    assert header(text).names[1] == f"ref [{sign}]"
    if known:
        found = header(text, "cp1252")
        assert found.encoding == "cp1252"
        assert found.names[1] == f"ref [{sign}]"
    else:
        with pytest.raises(FileError, match="is not UTF-8 text"):
            header(text, "cp1252")


@pytest.mark.parametrize("text", ["", "\n", "  \n\n"])
def test_an_empty_file_is_said_to_be_at_its_first_line(text):
    with pytest.raises(FileError, match="is empty") as refused:
        header(text)
    assert refused.value.line == 1
