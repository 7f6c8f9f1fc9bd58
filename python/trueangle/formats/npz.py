"""Tables of numpy: archives (.npz) of one array a column, read and copied in parts."""

from __future__ import annotations

import io
import math
import shutil
import zipfile
import zlib
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import IO, Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import FileError
from .budget import FileExtent, check_part
from .damage import damage_told
from .format import Addition, Batch, Contents, CopyTask, Selection, check_lengths, note, row_labels
from .npy import BLOCK, read_header, write_header

#: Member of a copy that records how its arrays were made.
_NOTE = "trueangle.json"


class _ArrayHeader(NamedTuple):
    """An array of one dimension: its type and length."""

    kind: np.dtype[Any]
    size: int


def columns(path: Path, topic: str | None = None) -> list[str]:
    """Names of the arrays that are vectors of numbers or texts."""
    with _opened(path) as archive:
        return list(_columns(archive))


def unread(path: Path) -> list[str]:
    """Names of the other arrays; see `format.FormatModule`."""
    with _opened(path) as archive:
        arrays = {name for name in archive.namelist() if name.endswith(".npy")}
        return sorted({name.removesuffix(".npy") for name in arrays} - _columns(archive).keys())


def extent(path: Path, names: Sequence[str] = (), topic: str | None = None) -> FileExtent:
    """Rows and bytes of arrays; see `format.FormatModule`."""
    with _opened(path) as archive:
        found = _columns(archive)
    rows = max((found[name].size for name in names or found), default=0)
    return FileExtent(
        rows, sum(found[name].size * max(found[name].kind.itemsize, 8) for name in names)
    )


def together(path: Path, needed: Sequence[str], others: Sequence[str]) -> list[str]:
    """Those of ``others`` that are as long as the arrays ``needed``."""
    with _opened(path) as archive:
        found = _columns(archive)
    sizes = {found[name].size for name in needed}
    return [name for name in others if found[name].size in sizes]


def read(path: Path, wanted: Selection) -> Iterator[Batch]:
    """Arrays ``names`` in batches; see `format.FormatModule`."""
    with _opened(path) as archive:
        yield from _batches(path, archive, wanted.names)


def copy(task: CopyTask) -> Contents:
    """Write ``target`` with the corrected arrays; see `format.FormatModule`."""
    sums: dict[str, str] = {}
    with (
        _opened(task.source) as archive,
        zipfile.ZipFile(task.target, "w", allowZip64=True) as output,
    ):
        found = _columns(archive)
        additions = task.choose(list(found))
        for member in archive.infolist():
            if member.filename == _NOTE:
                continue
            kept = zipfile.ZipInfo(member.filename, member.date_time)
            kept.compress_type = member.compress_type
            with archive.open(member) as given, output.open(kept, "w", force_zip64=True) as put:
                shutil.copyfileobj(given, put, 1 << 20)
            sums[member.filename] = f"{member.CRC:08x}"
        total = max(sum(found[a.column].size for a in additions), 1)
        # As `contents` finds them: arrays next to the corrected ones may be longer.
        rows, done = max((column.size for column in found.values()), default=0), 0
        for addition in additions:
            name = f"{addition.added}.npy"
            kept = zipfile.ZipInfo(name)
            kept.compress_type = archive.getinfo(f"{addition.column}.npy").compress_type
            with output.open(kept, "w", force_zip64=True) as put:
                column = found[addition.column]
                kind = _kind_of_copy(column)
                head = io.BytesIO()
                write_header(head, kind, (column.size,))
                put.write(head.getvalue())
                check = zlib.crc32(head.getvalue())
                for part in _corrected(task.source, archive, addition, kind):
                    data = part.tobytes()
                    put.write(data)
                    check = zlib.crc32(data, check)
                    done += part.size
                    task.watch(part.size, done / total)
            sums[name] = f"{check:08x}"
        told = note(additions).encode()
        # Of no time of day: the same log gives the same bytes.
        output.writestr(zipfile.ZipInfo(_NOTE), told)
        sums[_NOTE] = f"{zlib.crc32(told):08x}"
    return Contents(rows, sums)


def contents(path: Path, topic: str | None = None) -> Contents:
    """Rows, and a checksum of every member as it reads back."""
    sums = {}
    with _opened(path) as archive:
        rows = max((column.size for column in _columns(archive).values()), default=0)
        for member in archive.infolist():
            check = 0
            with archive.open(member) as given:
                while part := given.read(1 << 20):
                    check = zlib.crc32(part, check)
            sums[member.filename] = f"{check:08x}"
    return Contents(rows, sums)


@contextmanager
def _opened(path: Path) -> Iterator[zipfile.ZipFile]:
    """The archive, its errors reported with its name."""
    with damage_told(path, "an archive of numpy"), zipfile.ZipFile(path) as archive:
        yield archive


def _columns(archive: zipfile.ZipFile) -> dict[str, _ArrayHeader]:
    found = {}
    for member in archive.infolist():
        if member.filename.endswith(".npy"):
            with archive.open(member) as given:
                column = _header(given)
            if column is not None:
                found[member.filename.removesuffix(".npy")] = column
    return found


def _header(given: IO[bytes]) -> _ArrayHeader | None:
    """Type and length of a vector of numbers or texts; None for other arrays."""
    try:
        shape, kind = read_header(given)
    except ValueError:
        return None
    size = math.prod(shape)
    if kind.kind not in "fiuSU" or not shape or max(shape) != size:
        return None
    return _ArrayHeader(kind, size)


def _batches(path: Path, archive: zipfile.ZipFile, names: Sequence[str]) -> Iterator[Batch]:
    with ExitStack() as stack:
        streams = {}
        for name in names:
            given = stack.enter_context(archive.open(f"{name}.npy"))
            column = _header(given)
            assert column is not None  # `columns` lists no other
            check_part(path, column.kind.itemsize * min(column.size, BLOCK), "array", name)
            streams[name] = (given, column)
        sizes = {name: column.size for name, (_given, column) in streams.items()}
        check_lengths(path, "arrays", sizes)
        size = next(iter(sizes.values()), 0)
        for start in range(0, size, BLOCK):
            count = min(BLOCK, size - start)
            yield {name: _part(path, name, *stream, count) for name, stream in streams.items()}


def _part(path: Path, name: str, given: IO[bytes], column: _ArrayHeader, count: int) -> Any:
    data = given.read(count * column.kind.itemsize)
    if len(data) != count * column.kind.itemsize:
        raise FileError(path, "is damaged: it ends too early; copy it again", column=name)
    values: NDArray[Any] = np.frombuffer(data, column.kind)
    if column.kind.kind in "fiu":
        return values.astype(column.kind.newbyteorder("="), copy=False)
    return row_labels(values.tolist())


def _kind_of_copy(column: _ArrayHeader) -> np.dtype[Any]:
    """Of a corrected array: float32 where its source is, else float64."""
    return np.dtype(np.float32 if column.kind.newbyteorder("=") == np.float32 else np.float64)


def _corrected(
    path: Path, archive: zipfile.ZipFile, addition: Addition, kind: np.dtype[Any]
) -> Iterator[NDArray[Any]]:
    """The values of a corrected array, part by part."""
    names = [addition.column, *addition.signals.values()]
    for batch in _batches(path, archive, list(dict.fromkeys(names))):
        signals = {signal: batch[name] for signal, name in addition.signals.items()}
        yield addition.correct(batch[addition.column], signals).astype(kind)
