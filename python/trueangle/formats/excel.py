"""Excel files: the first sheet that holds cells, as the text of a CSV file, a line a row."""

from __future__ import annotations

import csv
import io
import re
import zipfile
from collections.abc import Iterator
from datetime import date, time, timedelta
from functools import lru_cache
from pathlib import Path
from typing import Any

from ..errors import FileError, MissingExtraError
from .budget import DECODED_BYTES, DecodedSizeError, check_part
from .damage import damage_told

#: Where a cell or a row is: ``r="AB12"``, ``r="12"``.
_PLACE = re.compile(rb"""\br=["']([A-Z]{0,3})(\d{1,7})["']""")


def sheet_text(path: Path) -> tuple[bytes, tuple[str, ...]]:
    """The text of the first sheet that holds cells, and the names of the others that do.

    Raises
    ------
    FileError
        The file is damaged, unpacks to more than memory takes, or no sheet holds a cell.
    MissingExtraError
        python-calamine is not installed.
    """
    found = path.stat()
    return _sheet_text(path, found.st_mtime_ns, found.st_size)


@lru_cache(maxsize=1)  # a file is opened for its names, its first rows and its columns
def _sheet_text(path: Path, _time: int, _size: int) -> tuple[bytes, tuple[str, ...]]:
    try:
        import python_calamine as calamine
    except ModuleNotFoundError:
        raise MissingExtraError(
            f"{path}: Excel files need python-calamine: pip install 'trueangle[excel]', or save "
            "the sheet as CSV"
        ) from None
    with damage_told(path, "an Excel file", "; save it again, or as CSV"):
        _check_size(path)
        with calamine.CalamineWorkbook.from_path(path) as book:
            names = [
                sheet.name
                for sheet in book.sheets_metadata
                if sheet.typ == calamine.SheetTypeEnum.WorkSheet
            ]
            filled = [n for n in names if book.get_sheet_by_name(n).start is not None]
            if not filled:
                raise FileError(
                    path, "no sheet holds a cell; a header line and readings are needed"
                )
            text = io.StringIO(newline="")
            csv.writer(text, lineterminator="\n").writerows(
                map(_cells, book.get_sheet_by_name(filled[0]).iter_rows())
            )
            return text.getvalue().encode(), tuple(filled[1:])


def _check_size(path: Path) -> None:
    """Refuse what unpacks to more than memory takes: calamine ends the process there.

    It holds every cell between the first and the last that is filled, however few are.
    """
    with zipfile.ZipFile(path) as archive:
        members = archive.infolist()
        check_part(path, sum(member.file_size for member in members), "workbook")
        for member in members:
            rows = columns = 1
            with archive.open(member) as part:
                for letters, row in _places(part):
                    rows = max(rows, row)
                    columns = max(columns, letters)
            # Bytes in memory of a cell, empty ones among them, and of its text.
            if rows * columns * 64 > DECODED_BYTES:
                raise DecodedSizeError(
                    path,
                    f"a sheet reaches from its first cell to row {rows}, column {columns}: more "
                    "than is held in memory; delete the cells far from the readings, or save them "
                    "as CSV",
                )


def _places(part: Any) -> Iterator[tuple[int, int]]:
    """Column and row of what the XML of a sheet places; read to its end, which checks its sum."""
    held = b""
    while data := part.read(1 << 20):
        held += data
        end = 0
        for found in _PLACE.finditer(held):
            column = 0
            for letter in found[1]:
                column = 26 * column + letter - 64
            yield column, int(found[2])
            end = found.end()
        held = held[max(end, len(held) - 16) :]


def _cells(row: list[Any]) -> list[str]:
    """Cells as CSV has them; a line without any is blank."""
    return [_text(cell) for cell in row] if any(cell != "" for cell in row) else []


def _text(cell: Any) -> str:
    if isinstance(cell, float):
        return str(int(cell)) if cell.is_integer() else repr(cell)
    if isinstance(cell, timedelta):
        return repr(cell.total_seconds())
    if isinstance(cell, date | time):
        return cell.isoformat()
    return " ".join(str(cell).split())  # a row is a line
