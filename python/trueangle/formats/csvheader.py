"""What comes before the readings of a text file: preamble, names, units."""

from __future__ import annotations

import itertools
import re
from collections.abc import Sequence
from pathlib import Path
from typing import IO

from ..errors import FileError
from .csvcells import (
    COMMA,
    POINT,
    TextLine,
    are_readings,
    cell_number,
    decimal_of,
    delimiter_of,
    first_lines,
    holds_number,
    is_blank_between_commas,
    is_comment,
    line_cells,
)

#: Lines looked at to distinguish readings from a preamble.
_LOOKED_AT = 4

#: A name at the head of a time column of TwinCAT's exports, before the names it is for.
_SCOPE = "Name"
#: What a line of units holds: units in brackets, or short words without digits.
_UNIT = r"[\[(].*[\])]|[^\d\s]{0,8}(?:/[^\d\s]{1,4}\d?)?|-"
# Compiled where a line needs it: that takes longer than to read a small file.
_KNOWN_UNITS = (
    r"[\[(]?(deg(rees?)?|rad(ians?)?|turns?|rev(olutions?)?|counts?|arcsec|arcmin|[°\u2032\u2033\"']|"
    r"m?s|us|µs|ns|sec(onds?)?|volts?|m?v|m?a|[mc]?nm|n·?m|°?c|k|rpm|(deg|rad|turn|°)/s)[\])]?"
)
_BRACKETED = r"[\[(][^\])]*[\])]\s*$"


class Header:
    """Everything before the first reading, found in the first lines of a file.

    The line of names is the last one before the readings that has as many cells; without
    one the columns are called ``column1``, ``column2`` and so on. A line of units may
    follow the names; notes that begin with # may be anywhere. Where the first line has names
    of this package's columns, it is the line of names.

    Parameters
    ----------
    path : path
        For messages.
    file : binary file
        At its start; is left at the first line of readings.

    Attributes
    ----------
    head : list of bytes
        Every line before the readings, as it is.
    place : int
        Index in ``head`` of the line of names; -1 without.
    names : list of str
        With the unit in brackets where a line of units states it.
    delimiter, decimal, ending, encoding : str
    trailing : bool
        Lines of readings end with a delimiter that the line of names lacks.
    line : int
        Number of the first line of readings.
    """

    def __init__(self, path: Path, file: IO[bytes]) -> None:
        self.path = path
        lines, self.encoding = first_lines(path, file)
        if not any(line.text.strip() for line in lines):
            raise FileError(path, "is empty; a header line and readings are needed", line=1)
        first, data = self._found(lines)
        self.line = lines[data].place if data < len(lines) else len(lines) + 1
        self.head = [line.raw for line in lines[:data]]
        self.place = first
        text = lines[first].text if first >= 0 else lines[data].text
        raw = lines[max(first, 0)].raw
        self.ending = "\r\n" if raw.endswith(b"\r\n") else "\n"
        self.decimal = self._decimal(lines[data:])
        cells = self._cells(text.removeprefix("#").strip() if is_comment(text) else text)
        if first < 0:
            cells = [f"column{i + 1}" for i in range(len(cells))]
        self._is_open = len(cells) > 1 and not cells[-1]
        between = lines[first + 1 : data] if first >= 0 else []
        self.names = _names_with_units(
            cells[:-1] if self._is_open else cells, [self._cells(line.text) for line in between]
        )
        self.trailing = self._trailing(lines[data : data + 1])
        self._all_numbers = data < len(lines) and all(
            cell_number(cell, self.decimal) is not None for cell in self._cells(lines[data].text)
        )
        file.seek(sum(len(line) for line in self.head))

    @property
    def width(self) -> int:
        """Cells of a line of readings."""
        return len(self.names) + self.trailing

    def is_message(self, cells: Sequence[str]) -> bool:
        """Whether a line is words of a firmware among readings: of another width, no number.

        Without names words as many as columns are such too: every column begins with a number.
        """
        if len(cells) == len(self.names) and (self.place >= 0 or not self._all_numbers):
            return False
        return all(cell_number(cell.strip(), self.decimal) is None for cell in cells) and any(cells)

    def with_names(self, added: Sequence[str]) -> bytes:
        """The lines before the readings with further names."""
        head = list(self.head)
        if self.place < 0:
            return b"".join(head)
        for i in range(self.place, len(head)):
            if i > self.place and not self._is_units(head[i]):
                continue
            body = head[i].rstrip(b"\r\n")
            ending = head[i][len(body) :] or self.ending.encode()
            if self._is_open:
                body = body.removesuffix(self.delimiter.encode())
            text = self.delimiter.join(["", *(added if i == self.place else [""] * len(added))])
            head[i] = body + text.encode(self.encoding, "replace") + ending
        return b"".join(head)

    def _is_units(self, raw: bytes) -> bool:
        cells = self._cells(raw.decode(self.encoding, "replace"))
        return _units_of(cells, len(self.names)) is not None

    def _found(self, lines: list[TextLine]) -> tuple[int, int]:
        """Index of the line of names, -1 without, and of the first line of readings."""
        solid = [i for i, line in enumerate(lines) if line.text.strip()]
        plain = [i for i in solid if not is_comment(lines[i].text)]
        first = plain[0] if plain else solid[0]
        self.delimiter = delimiter_of(lines[first].text)
        known = self._known(lines, plain, first)
        if known is not None:
            self.delimiter = delimiter_of(lines[known].text)
            return known, self._after_units(lines, known)
        for delimiter in (";", "\t", ",", " "):
            begin = self._first_reading(lines, plain, delimiter)
            if begin is None:
                continue
            self.delimiter = delimiter
            width = len(self._cells(lines[begin].text))
            before = [i for i in solid if i < begin]
            units = -1
            for i in reversed(before):
                text = lines[i].text
                if is_comment(text):
                    text = text.lstrip("# ")
                    if i != before[-1]:
                        continue
                cells = self._cells(text)
                off = abs(len(cells) - width)  # blanks do not show an empty cell at the end
                if off > (delimiter != " ") or self._is_talk(cells, lines[begin]):
                    continue
                if _units_of(cells, width) is None:
                    return self._scope(lines, before, width, i), begin
                units = i
            return units, begin  # names that look like units are names where nothing else is
        if len(plain) > 1 and cell_number(lines[plain[1]].text.strip(), ",") is not None:
            is_bare = cell_number(lines[first].text.strip(), ",") is not None
            return (-1, first) if is_bare else (first, self._after_units(lines, first))
        if len(plain) == 1 and cell_number(lines[first].text.strip(), ",") is not None:
            return -1, first
        return first, self._after_units(lines, first)

    def _known(self, lines: list[TextLine], plain: list[int], first: int) -> int | None:
        """A line with names of this package, taken at its word wherever the readings begin.

        One among readings is a remark, or begins another file that was put behind this one.
        """
        found, is_sure = None, False
        for i in plain:
            text = lines[i].text
            if is_sure and not self._is_of_words(text):
                break
            if _STANDARD.search(text) and (i == first or self._is_of_words(text)):
                if self._is_names(lines, plain, i):
                    found, is_sure = i, True
                elif i == first:
                    found = i
        return found

    def _is_of_words(self, text: str) -> bool:
        """Whether a line holds fewer numbers than words."""
        delimiter = delimiter_of(text)
        return not are_readings(self._split(text, delimiter), decimal_of(delimiter))

    def _is_names(self, lines: list[TextLine], plain: list[int], place: int) -> bool:
        """Whether a line has as many cells as each of those that follow it."""
        delimiter = delimiter_of(lines[place].text)
        below = [i for i in plain if i > place][:_LOOKED_AT]
        width = len(self._split(lines[place].text, delimiter))
        return bool(below) and all(
            len(self._split(lines[i].text, delimiter)) == width for i in below
        )

    def _is_talk(self, cells: list[str], reading: TextLine) -> bool:
        """One cell above several that are filled: words of a firmware, no names."""
        return len(cells) == 1 and bool(self._cells(reading.text)[-1])

    def _scope(self, lines: list[TextLine], before: list[int], width: int, last: int) -> int:
        """The line of names in a preamble of TwinCAT's exports, else ``last``."""
        rows = {j: self._cells(lines[j].text) for j in before}
        if not any(cells[0] == "Data-Type" for cells in rows.values()):
            return last
        names = [j for j, cells in rows.items() if cells[0] == _SCOPE and len(cells) == width]
        return names[-1] if names else last

    def _after_units(self, lines: list[TextLine], first: int) -> int:
        width = len(self._cells(lines[first].text))
        for i in range(first + 1, len(lines)):
            text = lines[i].text
            if text.strip() and not is_comment(text):
                return i + 1 if _units_of(self._cells(text), width) is not None else first + 1
        return first + 1

    def _first_reading(self, lines: list[TextLine], plain: list[int], delimiter: str) -> int | None:
        """The first of some lines in a row that are equally wide and hold numbers."""
        looked_at = [(i, self._split(lines[i].text, delimiter)) for i in plain]
        decimal = decimal_of(delimiter)

        def is_words(cells: list[str], width: int) -> bool:
            blanks = delimiter == " "  # which do not show how many cells were meant
            return (blanks or len(cells) != width) and not any(
                cell_number(cell, decimal) is not None for cell in cells
            )

        good = [
            len(cells) > 1
            and are_readings(cells, decimal)
            and not (delimiter == "," and is_blank_between_commas(lines[i].text))
            for i, cells in looked_at
        ]
        for k in (k for k in range(len(looked_at)) if good[k]):
            width = len(looked_at[k][1])
            below = (j for j in range(k, len(looked_at)) if not is_words(looked_at[j][1], width))
            next_ones = list(itertools.islice(below, _LOOKED_AT))
            if all(good[j] and len(looked_at[j][1]) == width for j in next_ones):
                kinds = [
                    [holds_number(cell, decimal) for cell in looked_at[j][1]] for j in next_ones
                ]
                if all(len(set(column) - {None}) <= 1 for column in zip(*kinds, strict=True)):
                    return looked_at[k][0]
        return None

    def _decimal(self, lines: list[TextLine]) -> str:
        if self.delimiter == ",":
            return "."
        for line in lines:
            for cell in () if is_comment(line.text) else self._cells(line.text):
                if "," in cell and COMMA.fullmatch(cell) and not POINT.fullmatch(cell):
                    return ","
        return "."

    def _trailing(self, first: list[TextLine]) -> bool:
        if not first:
            return False
        cells = self._cells(first[0].text)
        return len(cells) == len(self.names) + 1 and not cells[-1]

    def _cells(self, text: str) -> list[str]:
        return self._split(text, self.delimiter)

    def _split(self, text: str, delimiter: str) -> list[str]:
        return line_cells(self.path, text, delimiter)


#: Names that this package gives its columns: a line with one is the line of names.
_STANDARD = re.compile(r"(reference|indicated|corrected)_(deg|rad|turn|count)\b|\btime_s\b")


def _units_of(cells: Sequence[str], width: int) -> list[str] | None:
    """Units of a line of units under ``width`` names, or None for another line."""
    if abs(len(cells) - width) > 1 or not any(
        re.fullmatch(_KNOWN_UNITS, cell, re.IGNORECASE) for cell in cells
    ):
        return None
    if not all(re.fullmatch(_UNIT, cell) for cell in cells):
        return None
    return [cell.strip("[]() ") for cell in cells]


def _names_with_units(names: list[str], between: Sequence[Sequence[str]]) -> list[str]:
    """Names with the units in brackets that lines between them and the readings state."""
    if names[0] == _SCOPE and len(names) > 1:
        return _scope_names(names, {cells[0]: cells for cells in between}.get("Unit", ()))
    for cells in between:
        units = _units_of(cells, len(names))
        if units is not None:
            names = [
                f"{name} [{unit}]" if unit and not re.search(_BRACKETED, name) else name
                for name, unit in zip(names, units, strict=False)
            ] + names[len(units) :]
    return names


def _scope_names(cells: Sequence[str], units: Sequence[str]) -> list[str]:
    """Names of TwinCAT's exports: a time column before each group of channels."""
    names, times = [], 0
    for i, cell in enumerate(cells):
        if cell == _SCOPE:
            times += 1
            names.append("time [ms]" if times == 1 else f"time {times} [ms]")
        else:
            unit = units[i].partition(" ")[0] if i < len(units) else ""
            known = unit if unit not in ("", "(None)") else ""
            names.append(f"{cell} [{known}]" if known else cell)
    return names
