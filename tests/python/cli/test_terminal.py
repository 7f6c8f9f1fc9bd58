"""What a terminal shows: no wider than it is, in colour where it has colours."""

import io
import re
import sys
from pathlib import Path

import pytest

from trueangle.cli import main
from trueangle.cli.terminal import PlainStream, coloured_text, has_colours, printable_text
from trueangle.support.layout import laid_out, text_columns, wrapped_lines

sys.path.insert(0, str(Path(__file__).resolve().parents[2] / "looks"))

from scenes import furnish, scenes
from transcripts.terminal import ran

COLUMNS = 80

#: Commands that take seconds, and what each of them prints is told by another here.
LONG = ("bench", "rehearse")


@pytest.fixture(scope="module")
def desk(tmp_path_factory):
    folder = tmp_path_factory.mktemp("desk")
    furnish(folder)
    return folder


def test_no_command_is_wider_than_its_terminal(desk):
    for command, lines in scenes().items():
        for line in lines if command not in LONG else ():
            status, *told = ran(line.split(), desk, COLUMNS)
            text = "".join(told)
            assert status == 0, text
            wide = [row for row in text.splitlines() if len(row) > COLUMNS]
            assert not wide, f"{line}: {wide}"


@pytest.mark.parametrize(("wanted", "found"), [("40", 60), ("72", 72), ("500", 100)])
def test_lines_are_as_wide_as_the_terminal_within_bounds(wanted, found, monkeypatch):
    monkeypatch.setenv("COLUMNS", wanted)
    text = "of words " * 60
    assert text_columns() == found
    assert found - 9 < max(map(len, wrapped_lines(text))) <= found
    assert max(map(len, laid_out(["  label    " + text]).splitlines())) <= found


def test_a_folded_line_loses_no_word_and_stands_under_its_text(monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    line = "  noise     " + " ".join(f"word{k}" for k in range(40))
    folded = laid_out([line])
    assert folded.split() == line.split()
    assert {len(row) - len(row.lstrip()) for row in folded.splitlines()[1:]} == {12}
    option = "  --signal " + "'indicated=" + "x y " * 40 + "'"
    assert laid_out([option]) == option  # there to be copied


@pytest.mark.parametrize("blanks", [0, 28, 38, 39, 78, 120])
@pytest.mark.parametrize("label", ["unit", "u" * 90, "noise of one", ""])
def test_words_behind_a_wide_label_stand_below_it(label, blanks, monkeypatch):
    """No word is lost, and no line is wider than words make it, however wide a table's column."""
    monkeypatch.setenv("COLUMNS", "60")
    line = f"  {label}{'' if not label else ' ' * max(blanks, 2)}" + "some words " * 12
    rows = laid_out([line]).splitlines()
    assert " ".join(rows).split() == line.split()
    assert all(len(row) <= 60 or " " not in row.strip() for row in rows)
    assert all(len(row) - len(row.lstrip()) <= 40 for row in rows[1:])


class Terminal(list):
    encoding = "utf-8"
    write = list.append

    def isatty(self):
        return True


def test_a_terminal_has_colours_unless_it_is_told_otherwise(monkeypatch):
    monkeypatch.setenv("TERM", "xterm")
    monkeypatch.delenv("NO_COLOR", raising=False)
    seen = Terminal()
    PlainStream(seen).write("trueangle: error: no\x1b[31m file")
    assert seen == ["trueangle: \x1b[1;31merror:\x1b[0m no\\x1b[31m file"]
    for name, value in (("NO_COLOR", "1"), ("TERM", "dumb")):
        with monkeypatch.context() as changed:
            changed.setenv(name, value)
            assert not has_colours(seen)
            plain = Terminal()
            PlainStream(plain).write("error: x")
            assert plain == ["error: x"]
    assert not has_colours(io.StringIO())
    assert coloured_text('[{"says": "warning: x"}]') == '[{"says": "warning: x"}]'


@pytest.mark.parametrize(
    ("words", "said"),
    [
        ("fti", "there is no command 'fti'; did you mean fit?"),
        ("diganose r.csv", "did you mean diagnose?"),
        ("fit r.csv -o m.json --gaer-ratio 3", "did you mean --gear-ratio?"),
        ("fit r.csv -o m.json --zzz 3", "unrecognized arguments: --zzz"),
        ("fit r.csv -o m.json --loss hubre", "did you mean huber?"),
        ("fit r.csv -o m.json --signal refrence=a", "did you mean reference?"),
        ("fit r.csv -o m.json --signal arm.torqe=a", "did you mean torque?"),
    ],
)
def test_what_is_mistyped_is_answered_by_the_nearest(words, said, capsys):
    with pytest.raises(SystemExit) as left:
        main(words.split())
    assert left.value.code == 2
    told = capsys.readouterr().err.splitlines()
    assert len(told) == 2, told  # how it is used, and what is wrong
    assert said in told[1]


def test_one_model_has_one_picture(desk, capsys):
    ran(["fit", "runs.csv", "-o", "joint.json", "--orders", "1"], desk, COLUMNS)
    for more in (["--kind", "residuals"], [str(desk / "runs.csv")]):
        out = ["-o", str(desk / "x.png")]
        assert main(["plot", str(desk / "joint.json"), *more, *out]) == 1
        assert "one model has one picture" in capsys.readouterr().err


@pytest.mark.parametrize("ending", ["png", "svg", "pdf"])
def test_a_picture_is_of_the_format_that_its_ending_says(ending, desk):
    begins = {"png": b"\x89PNG", "svg": b"<?xml", "pdf": b"%PDF"}
    ran(["fit", "runs.csv", "-o", "joint.json", "--orders", "1"], desk, COLUMNS)
    status, told, _ = ran(f"plot joint.json -o drawn.{ending} --json".split(), desk, COLUMNS)
    assert status == 0
    assert '"shows": "Error of the model' in told
    assert (desk / f"drawn.{ending}").read_bytes().startswith(begins[ending])


@pytest.mark.parametrize("encoding", ["utf-8", "ascii", "latin-1"])
@pytest.mark.parametrize("colours", [False, True])
def test_what_is_written_is_as_long_as_what_was_given(colours, encoding, monkeypatch):
    """Whatever words, colours and escapes make of it: who writes counts letters of his own."""

    class Terminal(io.TextIOWrapper):
        def isatty(self):
            return colours

    for name in ("NO_COLOR", "TERM"):
        monkeypatch.delenv(name, raising=False)
    held = io.BytesIO()
    stream = PlainStream(Terminal(held, encoding, newline=""), wording=lambda text: f"<{text}>")
    for text in ("error: none", "a\x1b[31m", "\u2212 3 \u2192 4\n", "", "Confirmed:\nretained\n"):
        before = len(held.getvalue())
        assert stream.write(text) == len(text)
        stream.flush()
        shown = re.sub(r"\x1b\[[\d;]*m", "", held.getvalue()[before:].decode(encoding))
        plain = f"<{text}>".replace("\x1b", "\\x1b")
        assert shown == plain.encode(encoding, "backslashreplace").decode(encoding)


@pytest.mark.parametrize("byte", [0x80, 0x9B, 0xE9, 0xFF])
def test_a_byte_of_a_name_that_is_no_text_is_shown_as_that_byte(byte):
    name = bytes([0x61, byte, 0x62]).decode("utf-8", "surrogateescape")
    assert printable_text(f"{name}.csv") == f"a\\x{byte:02x}b.csv"
    assert printable_text(chr(0x85) + chr(0x202E)) == "\\x85\\u202e"


def test_two_blanks_of_a_name_stay_two(tmp_path, capsys):
    """Lines of a message become one; what stands within a line is as it is called."""
    name = str(tmp_path / "two  blanks.csv")
    assert main(["check", name]) == 1
    told = capsys.readouterr().err
    assert name in told
    assert told.count("\n") == 1
