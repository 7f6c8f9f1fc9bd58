"""Arrow and Feather logs: numbers where they lie, else record batch by record batch.

Batches that pyarrow has to look at, and are not packed, come from mapped memory.
"""

from __future__ import annotations

import struct
from collections.abc import Iterable, Iterator, Sequence
from contextlib import contextmanager
from io import FileIO
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
from numpy.typing import NDArray

from .ahead import read_ahead
from .arrowtables import (
    ArrowDigest,
    add_corrected,
    arrow_dtype,
    column_batches,
    corrected_schema,
    element_names,
    other_names,
    top_names,
)
from .budget import FileExtent, check_part
from .damage import damage_told
from .format import Batch, Contents, CopyTask, Selection
from .stored import ROWS, stored_values

_FILE_MAGIC = b"ARROW1"
#: Codecs by their number in the format's BodyCompression.
_CODECS = {0: "lz4", 1: "zstd"}
_DICTIONARY, _RECORD_BATCH = 2, 3
#: Rows at once.
_ROWS = 1 << 20
#: Bytes of a segment that is read on its own, and parts of a larger batch at most.
_STRETCH = 1 << 24
_MOST_PARTS = 64


def columns(path: Path, topic: str | None = None) -> list[str]:
    """Names of the top columns, elements of lists of one length as ``state[3]``."""
    with _opened(path) as (schema, _batches, _options):
        return element_names(schema, lambda name: 0)


def unread(path: Path) -> list[str]:
    """Names of columns of other types; see `format.FormatModule`."""
    with _opened(path) as (schema, _batches, _options):
        return other_names(schema)


class BatchRange(NamedTuple):
    """Neighbouring record batches, or one of ``parts`` parts of a single large one."""

    batches: range
    part: int = 0
    parts: int = 1

    def of(self, batch: pa.RecordBatch) -> pa.RecordBatch:
        """The rows of a batch that belong to it."""
        start, stop = (batch.num_rows * k // self.parts for k in (self.part, self.part + 1))
        return batch.slice(start, stop - start)


def extent(path: Path, names: Sequence[str] = (), topic: str | None = None) -> FileExtent:
    """Rows and bytes of columns; see `format.FormatModule`."""
    with damage_told(path, "Arrow"):
        rows = sum(max(batch.rows, 0) for batch in _packed(path, _is_file(path)))
    return FileExtent(rows, 8 * rows * len(names))


def stretches(path: Path) -> list[BatchRange | None]:
    """Record batches that are read together; None for the stream format, which has no index."""
    with damage_told(path, "Arrow"):
        if not _is_file(path):
            return [None]
        _check_batches(path, True)
        with pa.memory_map(str(path), "r") as source:
            batches = pa.ipc.open_file(source).num_record_batches
        size = path.stat().st_size
        each = max(1, batches * _STRETCH // size)
        parts = 1
        # A part of a packed batch needs the whole batch unpacked.
        if batches * _STRETCH < size and _compression(path, True) is None:
            parts = min(-(-size // (max(batches, 1) * _STRETCH)), _MOST_PARTS)
    return [
        BatchRange(range(i, min(i + each, batches)), part, parts)
        for i in range(0, batches, each)
        for part in range(parts)
    ] or [None]


def read(path: Path, wanted: Selection) -> Iterator[Batch]:
    """Columns ``names`` in batches; see `format.FormatModule`."""
    stretch: BatchRange | None = wanted.stretch
    if stretch is None:
        with _opened(path) as (_schema, batches, _options):
            yield from read_ahead(column_batches(path, batches, wanted))
        return
    with damage_told(path, "Arrow"), path.open("rb", buffering=0) as raw:
        packed = _compression(path, True) is not None
        if not packed and not set(wanted.names) & set(wanted.texts):
            placed = _placed(path, wanted.names, stretch)
            if placed:
                for found in placed:
                    yield from found.read(raw, stretch.part, stretch.parts)
                return
        with _library(path, wanted.names, packed) as file:
            tops = top_names(file.schema, wanted.names)
            batches = (stretch.of(file.get_batch(i).select(tops)) for i in stretch.batches)
            yield from column_batches(path, _cut(map(_valid, batches)), wanted)


def _placed(path: Path, names: Sequence[str], stretch: BatchRange) -> list[PlacedBatch]:
    """Where the columns of its batches lie; none where pyarrow has to look at one of them."""
    with pa.memory_map(str(path), "r") as mapped:
        file = pa.ipc.open_file(mapped)
        if not set(names) <= set(file.schema.names):
            return []
        found = [placed_batch(mapped, file.get_batch(i), names) for i in stretch.batches]
    return [] if None in found else [batch for batch in found if batch is not None]


@contextmanager
def _library(path: Path, names: Sequence[str], packed: bool) -> Iterator[pa.RecordBatchFileReader]:
    """The file as pyarrow reads it, mapped where it is not packed: a batch may be large."""
    if not packed:
        with pa.memory_map(str(path), "r") as source:
            yield pa.ipc.open_file(source)
        return
    with pa.OSFile(str(path)) as source:
        schema = pa.ipc.open_file(source).schema
        wanted = [schema.get_field_index(name) for name in top_names(schema, names)]
        only = pa.ipc.IpcReadOptions(included_fields=wanted, use_threads=False)
        yield pa.ipc.open_file(source, options=only)


def copy(task: CopyTask) -> Contents:
    """Write ``target`` with the corrected columns; see `format.FormatModule`."""
    digest = ArrowDigest()
    with _opened(task.source) as (schema, batches, options):
        elements = element_names(schema, lambda name: 0)
        channels = task.choose(list(dict.fromkeys([*schema.names, *elements])))
        enlarged = corrected_schema(schema, channels, task.source)
        new = pa.ipc.new_file if _is_file(task.source) else pa.ipc.new_stream
        size = max(task.source.stat().st_size, 1)
        done = 0
        made = (add_corrected(task.source, batch, channels, enlarged) for batch in batches)
        with (
            pa.OSFile(str(task.target), "wb") as file,
            new(file, enlarged, options=options) as writer,
        ):
            for batch in read_ahead(digest.passed(made)):
                writer.write_batch(batch)
                done += batch.nbytes
                task.watch(batch.num_rows, min(1.0, done / size))
    return digest.contents()


def contents(path: Path, topic: str | None = None) -> Contents:
    """Rows and checksums of all columns as they read back."""
    digest = ArrowDigest()
    with _opened(path) as (_schema, batches, _options):
        for batch in batches:
            digest.update(batch)
    return digest.contents()


def _is_file(path: Path) -> bool:
    with path.open("rb") as file:
        return file.read(len(_FILE_MAGIC)) == _FILE_MAGIC


def _valid(batch: pa.RecordBatch) -> pa.RecordBatch:
    """The batch, its offsets and indices held to its buffers: kernels trust them blindly."""
    batch.validate(full=True)
    return batch


@contextmanager
def _opened(
    path: Path,
) -> Iterator[tuple[pa.Schema, Iterator[pa.RecordBatch], pa.ipc.IpcWriteOptions]]:
    """Schema, batches and how they are compressed, of the file or of the stream format."""
    with damage_told(path, "Arrow"), pa.memory_map(str(path), "r") as source:
        is_file = _is_file(path)
        _check_batches(path, is_file)
        options = pa.ipc.IpcWriteOptions(compression=_compression(path, is_file))
        if is_file:
            file = pa.ipc.open_file(source)
            batches = (_valid(file.get_batch(i)) for i in range(file.num_record_batches))
            yield file.schema, _cut(batches), options
        else:
            stream = pa.ipc.open_stream(source)
            yield stream.schema, _cut(map(_valid, stream)), options


def _cut(batches: Iterable[pa.RecordBatch]) -> Iterator[pa.RecordBatch]:
    """The same rows, not too many at once: what is computed of them stays small."""
    for batch in batches:
        if batch.num_rows <= _ROWS:
            yield batch
            continue
        for start in range(0, batch.num_rows, _ROWS):
            yield batch.slice(start, _ROWS)


class _Packed(NamedTuple):
    """What the header of a record batch states: rows, codec, bytes of all columns once unpacked."""

    rows: int
    codec: str | None
    size: int


def _packed(path: Path, is_file: bool) -> Iterator[_Packed]:
    """The headers of all record batches, and of dictionaries, which count as batches of no row."""
    with pa.memory_map(str(path), "r") as source:
        if is_file:
            source.seek(8)  # the magic and its padding; a stream follows
        for message in pa.ipc.MessageReader.open_stream(source):
            if message.type in ("record batch", "dictionary"):
                yield _header(message.metadata.to_pybytes(), message.body)


def _check_batches(path: Path, is_file: bool) -> None:
    """Refuse a batch that unpacks to more than the budget: it is unpacked as a whole."""
    for batch in _packed(path, is_file):
        if batch.codec is None:
            return  # mapped, not unpacked
        check_part(path, batch.size, "record batch")


def _compression(path: Path, is_file: bool) -> str | None:
    """Codec of the first record batch, which only the message's own header contains."""
    return next((batch.codec for batch in _packed(path, is_file) if batch.rows >= 0), None)


def _header(header: bytes, body: pa.Buffer) -> _Packed:
    """What the flatbuffer of a record batch states (Message.fbs of Arrow).

    A buffer that is packed begins with the bytes that it unpacks to, -1 where it is none.
    """

    def field(table: int, number: int) -> int | None:
        vtable = table - struct.unpack_from("<i", header, table)[0]
        if 4 + 2 * number >= struct.unpack_from("<H", header, vtable)[0]:
            return None
        offset = struct.unpack_from("<H", header, vtable + 4 + 2 * number)[0]
        return table + offset if offset else None

    def follow(place: int) -> int:
        return int(place + struct.unpack_from("<I", header, place)[0])

    message = follow(0)
    kind, batch = field(message, 1), field(message, 2)
    rows = 0
    if kind is not None and batch is not None and header[kind] == _DICTIONARY:
        batch, rows = field(follow(batch), 1), -1
    elif kind is None or header[kind] != _RECORD_BATCH:
        batch = None
    if batch is None:
        return _Packed(-1, None, 0)
    table = follow(batch)
    length, buffers, compression = (field(table, number) for number in (0, 2, 3))
    if rows == 0 and length is not None:
        rows = max(int(struct.unpack_from("<q", header, length)[0]), 0)
    if compression is None:
        return _Packed(rows, None, body.size)
    codec = field(follow(compression), 0)
    name = _CODECS[0 if codec is None else header[codec]]
    size = 0
    if buffers is not None:
        place = follow(buffers)
        (count,) = struct.unpack_from("<I", header, place)
        view = memoryview(body)
        for i in range(count):
            start, stored = struct.unpack_from("<qq", header, place + 4 + 16 * i)
            if stored >= 8 and 0 <= start <= body.size - 8:
                (unpacked,) = struct.unpack_from("<q", view, start)
                size += stored if unpacked < 0 else unpacked
    return _Packed(rows, name, size)


class ColumnBuffers(NamedTuple):
    """Where the values of a column lie, and the bits that are 0 where one is null."""

    dtype: np.dtype[Any]
    values: int
    known: int | None

    def read(self, file: FileIO, start: int, stop: int) -> NDArray[Any]:
        """The rows from ``start`` to ``stop``, nulls as NaN."""
        place = self.values + start * self.dtype.itemsize
        values = stored_values(file, place, self.dtype, stop - start)
        if self.known is None:
            return values
        first = start // 8
        bits = stored_values(file, self.known + first, np.uint8, -(-stop // 8) - first)
        known = np.unpackbits(bits, bitorder="little")[start - 8 * first :][: stop - start]
        if values.dtype.kind != "f":
            values = values.astype(np.float64)
        values[known == 0] = np.nan
        return values


class PlacedBatch(NamedTuple):
    """Some columns of a record batch."""

    rows: int
    places: dict[str, ColumnBuffers]

    def read(self, file: FileIO, part: int, parts: int) -> Iterator[dict[str, NDArray[Any]]]:
        """One of ``parts`` parts of the rows, in blocks."""
        first, last = (self.rows * k // parts for k in (part, part + 1))
        for start in range(first, last, ROWS):
            stop = min(start + ROWS, last)
            yield {name: place.read(file, start, stop) for name, place in self.places.items()}


def placed_batch(
    mapped: pa.MemoryMappedFile, batch: pa.RecordBatch, names: Sequence[str]
) -> PlacedBatch | None:
    """Where columns of a batch of a mapped file lie, by the addresses that pyarrow gives them.

    None where pyarrow has to look at them: packed, turned to another byte order, not numbers.
    Of what is mapped nothing is read but what describes the batch.
    """
    size, rows = mapped.size(), batch.num_rows
    mapped.seek(0)
    base = mapped.read_buffer(1).address  # of more, the system would look at every page

    def place(part: pa.Buffer | None, least: int) -> int | None:
        """The byte of the file at which a part of at least ``least`` bytes starts."""
        if part is None or part.size < least:
            return None
        start = part.address - base
        return start if 0 <= start <= size - part.size else None

    places = {}
    for name in names:
        # A name that is there twice has no index.
        if batch.schema.get_field_index(name) < 0 or not _is_number(batch[name].type):
            return None
        column = batch[name]
        dtype, (known, values) = arrow_dtype(column.type), column.buffers()
        at = place(values, rows * dtype.itemsize)
        bits = place(known, -(-rows // 8)) if column.null_count else None
        if column.offset or at is None or (column.null_count and bits is None):
            return None
        places[name] = ColumnBuffers(dtype, at, bits)
    return PlacedBatch(rows, places)


def _is_number(kind: pa.DataType) -> bool:
    types = pa.types
    return bool(types.is_integer(kind) or types.is_float32(kind) or types.is_float64(kind))
