"""What the comment of an exported header may state of its tables: all else is refused by name."""

from __future__ import annotations

import re
from pathlib import Path

import pytest

import trueangle as ta
from trueangle.errors import FileError

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
