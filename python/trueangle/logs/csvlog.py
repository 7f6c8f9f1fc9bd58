"""Correcting a CSV log line by line in blocks: every other column stays as it is."""

from __future__ import annotations

import csv
from collections.abc import Callable, Iterator, Sequence
from os import PathLike
from pathlib import Path

import numpy as np

from ..errors import FileError
from ..files import written_atomically
from ..model import HarmonicModel
from .columns import AngleColumn

__all__ = ["correct_csv"]

#: Lines corrected together: small enough for the cache, large enough for the core.
_BLOCK = 16384


def correct_csv(
    source: str | PathLike[str],
    target: str | PathLike[str],
    model: HarmonicModel,
    choose: Callable[[Sequence[str]], AngleColumn],
) -> int:
    """Copy a CSV log and add the corrected angle as its last column.

    Parameters
    ----------
    source, target : path
    model : HarmonicModel
    choose : callable
        Finds the angle among the names of the header (`find_angle_column`).

    Returns
    -------
    int
        Lines corrected. Empty cells stay empty, NaN stays NaN.

    Raises
    ------
    FileError
        Names the line and column of a cell that is no number, or a line of another
        length than the header. The target is then not written at all.
    """
    path = Path(source)
    with path.open(encoding="utf-8-sig", newline="") as file:
        try:
            first = file.readline()
            if not first.strip():
                raise FileError(path, "is empty; a header line is needed", line=1)
            delimiter = max(",;\t", key=first.count)
            header = next(csv.reader([first], delimiter=delimiter))
            angle = choose([name.strip() for name in header])
            reader = csv.reader(file, delimiter=delimiter, strict=True)
            with written_atomically(target) as output:
                writer = csv.writer(output, delimiter=delimiter, lineterminator="\n")
                writer.writerow([*header, angle.corrected])
                lines = 0
                for block, line in _blocks(reader, len(header), path):
                    texts = _corrected(block, line, header, angle, model, path)
                    writer.writerows([*row, text] for row, text in zip(block, texts, strict=True))
                    lines += len(block)
        except UnicodeDecodeError:
            raise FileError(path, "is not UTF-8 text") from None
        except csv.Error as cause:
            raise FileError(path, f"is not readable as CSV: {cause}") from None
    return lines


def _blocks(
    reader: Iterator[list[str]], width: int, path: Path
) -> Iterator[tuple[list[list[str]], int]]:
    """Rows in blocks, each with the line number of its first row (the header is line 1)."""
    block: list[list[str]] = []
    first = 2
    for line, row in enumerate(reader, 2):
        if not row:
            continue
        if len(row) != width:
            raise FileError(
                path, f"{len(row)} values where the header has {width} columns", line=line
            )
        block.append(row)
        if len(block) == _BLOCK:
            yield block, first
            block, first = [], line + 1
    if block:
        yield block, first


def _corrected(
    block: Sequence[Sequence[str]],
    line: int,
    header: Sequence[str],
    angle: AngleColumn,
    model: HarmonicModel,
    path: Path,
) -> list[str]:
    index = [name.strip() for name in header].index(angle.name)
    cells = [row[index].strip() for row in block]
    try:
        values = np.array([float(cell) if cell else np.nan for cell in cells])
    except ValueError:
        for offset, cell in enumerate(cells):
            try:
                float(cell or "nan")
            except ValueError:
                raise FileError(
                    path,
                    f"a number is needed, got {cell!r}",
                    line=line + offset,
                    column=angle.name,
                ) from None
        raise
    scale = model.period / angle.period
    corrected = model.correct(values * scale) / scale
    return [
        repr(value) if cell else "" for value, cell in zip(corrected.tolist(), cells, strict=True)
    ]
