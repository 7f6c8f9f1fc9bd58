"""MATLAB files of version 4: matrices one after another; copies get further ones at the end.

Format: https://www.mathworks.com/help/pdf_doc/matlab/matfile_format.pdf (Level 4 MAT-files).
"""

from __future__ import annotations

import json
import struct
import zlib
from collections.abc import Collection, Iterator, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import FileError
from .budget import FileExtent, check_part
from .format import Batch, Contents, CopyTask, Selection, check_lengths, note

#: Kinds of numbers by the tens of the type.
_KINDS = ("f8", "f4", "i4", "i2", "u2", "u1")
_HEAD = struct.Struct("<5i")
#: Matrix of a copy that records how its corrected ones were made.
NOTE = "trueangle_note"


class _Matrix(NamedTuple):
    """Where the numbers of a matrix are."""

    name: str
    kind: np.dtype[np.generic]
    size: int
    place: int
    #: A row or a column of numbers.
    is_vector: bool
    #: Where the matrix itself begins.
    start: int


def columns(path: Path, topic: str | None = None) -> list[str]:
    """Names of the matrices that are vectors of numbers."""
    return list(_vectors(path))


def together(path: Path, needed: Sequence[str], others: Sequence[str]) -> list[str]:
    """Those of ``others`` that are as long as the vectors ``needed``."""
    found = _vectors(path)
    sizes = {found[name].size for name in needed}
    return [name for name in others if found[name].size in sizes]


def extent(path: Path, names: Sequence[str] = (), topic: str | None = None) -> FileExtent:
    """Rows and bytes of vectors; see `format.FormatModule`."""
    found = _vectors(path)
    rows = [found[name].size for name in names or found]
    return FileExtent(max(rows, default=0), 8 * sum(rows) if names else 0)


def read(path: Path, wanted: Selection) -> Iterator[Batch]:
    """Vectors ``names`` as one batch; see `format.FormatModule`."""
    found = _vectors(path)
    check_lengths(path, "vectors", {name: found[name].size for name in wanted.names})
    yield {name: _values(path, found[name]) for name in wanted.names}


def copy(task: CopyTask) -> Contents:
    """Write ``target`` with the corrected vectors; the bytes of the source stay as they are."""
    check_part(task.source, task.source.stat().st_size, "file")
    found = _vectors(task.source)
    additions = task.choose(list(found))
    data = task.source.read_bytes()
    with task.target.open("wb") as file:
        file.write(data)
        rows, sums = 0, {"source": f"{zlib.crc32(data):08x}:{len(data)}"}
        for addition in additions:
            signals = {s: _values(task.source, found[name]) for s, name in addition.signals.items()}
            column = found[addition.column]
            after = addition.correct(_values(task.source, column), signals).astype("<f8")
            file.write(_head(0, len(after), addition.added) + after.tobytes())
            sums[addition.added] = f"{zlib.crc32(after.tobytes()):08x}"
            rows = max(rows, column.size)
            task.watch(column.size, 1.0)
        text = np.frombuffer(note(additions).encode(), np.uint8)
        told = note_name([matrix.name for matrix in _matrices(task.source)])
        file.write(_head(51, 1, told, text.size) + text.tobytes())
    return Contents(rows, sums)


def contents(path: Path, topic: str | None = None) -> Contents:
    """Checksums of the corrected vectors and of all bytes before them."""
    matrices = list(_matrices(path))
    notes = [i for i, matrix in enumerate(matrices) if matrix.name.startswith(NOTE)]
    last = notes[-1] if notes else len(matrices)
    told = _values(path, matrices[last]).astype("u1").tobytes() if notes else b""
    first = last - count_of_added(told)
    made = matrices[first:last]
    data = path.read_bytes()
    end = matrices[first].start if first < len(matrices) else len(data)
    sums = {"source": f"{zlib.crc32(data[:end]):08x}:{end}"}
    for matrix in made:
        sums[matrix.name] = f"{zlib.crc32(_values(path, matrix).astype('<f8').tobytes()):08x}"
    return Contents(max((matrix.size for matrix in made), default=0), sums)


def note_name(names: Collection[str]) -> str:
    """The name of a further note: readers of such files keep one variable of a name."""
    count = sum(name.startswith(NOTE) for name in names)
    return f"{NOTE}_{count + 1}" if count else NOTE


def count_of_added(note: str | bytes) -> int:
    """Variables that a copy put before its note; none where that is damaged."""
    try:
        told = json.loads(note)
    except (ValueError, RecursionError):
        return 0
    entries = told.get("corrected") if isinstance(told, dict) else None
    return len(entries) if isinstance(entries, list) else 0


def _head(kind: int, rows: int, name: str, width: int = 1) -> bytes:
    text = name.encode() + b"\0"
    return _HEAD.pack(kind, rows, width, 0, len(text)) + text


def _vectors(path: Path) -> dict[str, _Matrix]:
    return {matrix.name: matrix for matrix in _matrices(path) if matrix.is_vector}


def _matrices(path: Path) -> Iterator[_Matrix]:
    """Every matrix; of complex ones the real part counts as no vector.

    Raises
    ------
    FileError
        Damage, sparse matrices, and numbers of machines that nobody has any more.
    """
    size = path.stat().st_size
    with path.open("rb") as file:
        start = 0
        while start < size:
            head = file.read(_HEAD.size)
            if len(head) < _HEAD.size:
                raise FileError(path, f"is damaged: a matrix at byte {start} has no header")
            order = "<" if 0 <= _HEAD.unpack(head)[0] < 100 else ">"
            code, rows, width, imaginary, length = struct.unpack(f"{order}5i", head)
            machine, zero, kind, sort = code // 1000, code // 100 % 10, code // 10 % 10, code % 10
            if machine != (order == ">") or zero or kind >= len(_KINDS) or sort > 1:
                raise FileError(
                    path,
                    f"a matrix at byte {start} is not a full one of numbers or text of MATLAB 4 "
                    f"(its type is {code}); save the file with -v7",
                )
            if min(rows, width, length - 1) < 0 or imaginary not in (0, 1):
                raise FileError(path, f"is damaged: the header at byte {start} has wrong sizes")
            name = file.read(min(length, size)).rstrip(b"\0").decode("latin-1")
            dtype = np.dtype(order + _KINDS[kind])
            count, place = rows * width, file.tell()
            end = place + count * dtype.itemsize * (1 + imaginary)
            if end > size or length > size:
                raise FileError(path, "is shorter than its header states", column=name)
            is_vector = sort == 0 and not imaginary and min(rows, width) == 1 < count
            yield _Matrix(name, dtype, count, place, is_vector, start)
            file.seek(end)
            start = end


def _values(path: Path, matrix: _Matrix) -> NDArray[np.generic]:
    """Numbers of a matrix in native order."""
    values = np.fromfile(path, matrix.kind, matrix.size, offset=matrix.place)
    return values.astype(matrix.kind.newbyteorder("="), copy=False)
