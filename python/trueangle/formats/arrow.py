"""Arrow and Feather logs: numbers where they lie, else record batch by record batch.

Batches that pyarrow has to look at, and are not packed, come from mapped memory.
"""

from __future__ import annotations

from collections.abc import Collection, Iterable, Iterator, Sequence
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import NamedTuple

import pyarrow as pa

from .ahead import ahead
from .arrowmessages import FILE_MAGIC, batch_message, codec_of, footer
from .arrowplaces import placed_batch
from .arrowtables import (
    ArrowDigest,
    add_corrected,
    column_batches,
    corrected_schema,
)
from .damage import damage_told
from .format import TEXTS, Batch, Choose, Contents, Watch

__all__ = ["columns", "contents", "copy", "read", "stretches"]

#: Rows at once.
_ROWS = 1 << 20
#: Bytes of a stretch that is read on its own, and parts of a larger batch at most.
_STRETCH = 1 << 24
_MOST_PARTS = 64


def columns(path: Path, topic: str | None = None) -> list[str]:
    """Names of the top columns."""
    with _opened(path) as (schema, _batches, _options):
        return list(schema.names)


class Stretch(NamedTuple):
    """Neighbouring record batches, or one of so many parts of a single large one."""

    batches: range
    part: int = 0
    parts: int = 1

    def of(self, batch: pa.RecordBatch) -> pa.RecordBatch:
        """The rows of a batch that belong to it."""
        start, stop = (batch.num_rows * k // self.parts for k in (self.part, self.part + 1))
        return batch.slice(start, stop - start)


def stretches(path: Path) -> list[Stretch | None]:
    """Record batches that are read together; None for the stream format, which has no index."""
    with damage_told(path, "Arrow"):
        if not _is_file(path):
            return [None]
        with path.open("rb", buffering=0) as raw:
            batches = len(footer(raw).batches)
        size = max(path.stat().st_size, 1)
        each = max(1, batches * _STRETCH // size)
        parts = 1
        # A part of a packed batch needs all of it unpacked.
        if batches * _STRETCH < size and _compression(path, True) is None:
            parts = min(-(-size // (max(batches, 1) * _STRETCH)), _MOST_PARTS)
    return [
        Stretch(range(i, min(i + each, batches)), part, parts)
        for i in range(0, batches, each)
        for part in range(parts)
    ] or [None]


def read(
    path: Path,
    names: Sequence[str],
    topic: str | None = None,
    stretch: Stretch | None = None,
    *,
    texts: Collection[str] = TEXTS,
    strict: bool = False,
) -> Iterator[Batch]:
    """Columns ``names`` in batches; see `format.FormatModule`."""
    if stretch is None:
        with _opened(path) as (_schema, batches, _options):
            yield from ahead(column_batches(path, names, batches))
        return
    with damage_told(path, "Arrow"), path.open("rb", buffering=0) as raw, ExitStack() as opened:
        with pa.OSFile(str(path)) as source:
            schema = pa.ipc.open_file(source).schema
        end, library = footer(raw), None
        for number in stretch.batches:
            placed = placed_batch(raw, end, end.batches[number], schema, names)
            if placed is not None:
                yield from placed.read(raw, stretch.part, stretch.parts)
                continue
            if library is None:
                library = opened.enter_context(_library(path, names))
            batch = stretch.of(library.get_batch(number).select(names))
            yield from column_batches(path, names, _cut([_valid(batch)]))


@contextmanager
def _library(path: Path, names: Sequence[str]) -> Iterator[pa.RecordBatchFileReader]:
    """The file as pyarrow reads it, mapped where it is not packed: a batch may be large."""
    if _compression(path, True) is None:
        with pa.memory_map(str(path), "r") as source:
            yield pa.ipc.open_file(source)
        return
    with pa.OSFile(str(path)) as source:
        schema = pa.ipc.open_file(source).schema
        wanted = [schema.get_field_index(name) for name in names]
        only = pa.ipc.IpcReadOptions(included_fields=wanted, use_threads=False)
        yield pa.ipc.open_file(source, options=only)


def copy(
    source: Path,
    target: Path,
    choose: Choose,
    watch: Watch,
    topic: str | None = None,
    output_topic: str | None = None,
) -> Contents:
    """Write ``target`` with the corrected columns; see `format.FormatModule`."""
    digest = ArrowDigest()
    with _opened(source) as (schema, batches, options):
        channels = choose(schema.names)
        enlarged = corrected_schema(schema, channels, source)
        new = pa.ipc.new_file if _is_file(source) else pa.ipc.new_stream
        size = max(source.stat().st_size, 1)
        done = 0

        def corrected() -> Iterator[pa.RecordBatch]:
            for batch in batches:
                made = add_corrected(source, batch, channels, enlarged)
                digest.update(made)
                yield made

        with pa.OSFile(str(target), "wb") as file, new(file, enlarged, options=options) as writer:
            for batch in ahead(corrected()):
                writer.write_batch(batch)
                done += batch.nbytes
                watch(batch.num_rows, min(1.0, done / size))
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
        return file.read(len(FILE_MAGIC)) == FILE_MAGIC


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


def _compression(path: Path, is_file: bool) -> str | None:
    """Codec of the first record batch, which only its own message tells."""
    if is_file:
        with path.open("rb", buffering=0) as raw:
            blocks = footer(raw).batches
            return batch_message(raw, blocks[0]).codec if blocks else None
    with pa.memory_map(str(path), "r") as source:
        for message in pa.ipc.MessageReader.open_stream(source):
            if message.type == "record batch":
                return codec_of(message.metadata.to_pybytes())
    return None
