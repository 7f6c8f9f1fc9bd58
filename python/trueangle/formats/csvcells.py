"""How a text is cut into lines and cells: its first lines decoded, and which cells are numbers."""

from __future__ import annotations

import codecs
import csv
import re
from collections.abc import Iterable, Iterator, Sequence
from pathlib import Path
from typing import IO, NamedTuple

from ..errors import FileError

#: Fortran writes exponents with D, and those of three digits without a letter.
_EXPONENT = r"(?:[eEdD][+-]?\d+|(?<=[\d.,])[+-]\d{3})?"
#: Numbers with a point; and those with a comma or a point.
POINT = re.compile(rf"[+-]?(?:\d+\.?\d*|\.\d+){_EXPONENT}", re.ASCII)
COMMA = re.compile(rf"[+-]?(?:\d+[.,]?\d*|[.,]\d+){_EXPONENT}", re.ASCII)
_LETTER = re.compile(r"[dD]|(?<=[\d.])(?=[+-])")
_WORDS = frozenset({"nan", "inf", "infinity", "+inf", "-inf", "+infinity", "-infinity", "-nan"})

#: Bytes and lines within which the readings must begin.
_HEAD = 1 << 18
_LINES = 1000
#: Bytes of a line, at most: memory follows the longest.
LONGEST_LINE = 1 << 24


class TextLine(NamedTuple):
    """A line as it is in the file, and as text without its end."""

    raw: bytes
    text: str
    #: Number of the line, from 1.
    place: int


def first_lines(path: Path, file: IO[bytes]) -> tuple[list[TextLine], str]:
    """The first lines of a file and their encoding, UTF-8 or Western Europe's code page.

    Raises
    ------
    FileError
        Another encoding; names the line.
    """
    found: list[TextLine] = []
    encoding = "utf-8"
    data = file.read(_HEAD)
    if data.startswith((codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)):
        raise FileError(path, "is UTF-16 text; save it as CSV in UTF-8", line=1)
    parts = data.splitlines(keepends=True) if b"\n" not in data else _split(data)
    if len(data) == _HEAD:
        while len(parts) == 1 and not parts[0].endswith(b"\n"):
            more = file.readline(LONGEST_LINE)
            parts[0] += more
            if not more or len(parts[0]) > LONGEST_LINE:
                break
        parts = parts[:-1] if len(parts) > 1 else parts
    for i, raw in enumerate(parts[:_LINES]):
        body = raw.removeprefix(codecs.BOM_UTF8) if i == 0 else raw
        text = body.decode(errors="surrogateescape")
        if not _is_utf8(text):
            text = western_text(text)
            if not _is_utf8(text):
                raise FileError(path, "is not UTF-8 text; save it as CSV in UTF-8", line=i + 1)
            encoding = "cp1252"
        found.append(TextLine(raw, text.rstrip("\r\n"), i + 1))
    return found, encoding


def _split(data: bytes) -> list[bytes]:
    parts = data.split(b"\n")
    return [*(part + b"\n" for part in parts[:-1]), *([parts[-1]] if parts[-1] else [])]


def western_text(text: str) -> str:
    """Decode text with surrogates for bytes that are not UTF-8 by Western Europe's code page.

    It is decoded where every byte beyond ASCII is a letter or sign: °, µ, ± or a letter with an
    accent, in a preamble, a unit or a label. Other text stays as it is.
    """
    if _is_utf8(text):
        return text
    data = text.encode(errors="surrogateescape")
    is_western = all(byte < 0x80 or 0xA0 <= byte < 0xFF for byte in data)
    return data.decode("cp1252") if is_western else text


def _is_utf8(text: str) -> bool:
    return text.isascii() or not any("\udc80" <= sign <= "\udcff" for sign in text)


def cut_rows(lines: Iterable[str], delimiter: str, *, strict: bool = False) -> Iterator[list[str]]:
    """Cells of lines; blanks between cells count as one, however many."""
    blanks = delimiter == " "
    if blanks:  # and tabs among them
        lines = (line.replace("\t", " ") for line in lines)
    return csv.reader(lines, delimiter=delimiter, skipinitialspace=blanks, strict=strict)


def line_cells(path: Path, text: str, delimiter: str) -> list[str]:
    """Cells of one line, without the blanks about them.

    Raises
    ------
    FileError
        An end of line within a cell, or a cell of more than 131 072 characters.
    """
    try:
        cells = next(cut_rows([text], delimiter), [""])
    except csv.Error as cause:
        raise not_cut(path, cause, 1) from None
    if delimiter == " " and len(cells) > 1 and not cells[-1]:
        cells = cells[:-1]  # blanks at the end are none between cells
    return [cell.strip() for cell in cells] or [""]


def not_cut(path: Path, cause: csv.Error, line: int) -> FileError:
    """The error of a line that csv does not cut."""
    if "new-line" in str(cause):
        return FileError(
            path, "a line ends with CR alone; save it with LF or CRLF at the ends", line=line
        )
    return FileError(path, f"is not readable as CSV: {cause}", line=line)


def delimiter_of(text: str) -> str:
    """The delimiter between the names of a line: the most frequent sign, else blanks."""
    found = max(",;\t", key=text.count)
    return found if found in text or len(text.split()) < 2 else " "


def decimal_of(delimiter: str) -> str:
    """Whether numbers may have a comma for the point: where it does not part the cells."""
    return "." if delimiter == "," else ","


def is_blank_between_commas(text: str) -> bool:
    """Whether blanks part numbers, some with a decimal comma: ``0,5 1 1,25``.

    Commas would part them as well, into other numbers.
    """
    cells = text.split()
    return (
        len(cells) > 1
        and any("," in cell for cell in cells)
        and all(COMMA.fullmatch(cell) and cell[-1] != "," for cell in cells)
    )


def is_comment(text: str) -> bool:
    """True for a note: a line that begins with #, and the mark of an end of file."""
    start = text.lstrip()
    return start.startswith("#") or (start.startswith("EOF") and start.rstrip() == "EOF")


def cell_number(cell: str, decimal: str) -> float | None:
    """The number that a cell holds, or None: no underscores, digits of ASCII only."""
    pattern = POINT if decimal == "." else COMMA
    if pattern.fullmatch(cell):
        plain = cell.replace(",", ".") if decimal == "," else cell
        try:
            return float(plain)
        except ValueError:
            return float(_LETTER.sub("e", plain, 1))
    return float(cell) if cell.lower() in _WORDS else None


def are_readings(cells: Sequence[str], decimal: str) -> bool:
    """Whether half of the cells that are filled, and more, hold numbers."""
    filled = [cell for cell in cells if cell]
    count = sum(cell_number(cell, decimal) is not None for cell in filled)
    return count > 0 and 2 * count >= len(filled)


def holds_number(cell: str, decimal: str) -> bool | None:
    """Whether a cell holds a number; None for an empty one."""
    return cell_number(cell, decimal) is not None if cell else None
