"""Parquet logs: row group by row group, types, metadata, compression and encodings kept."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import pyarrow as pa
import pyarrow.compute as pc
import pyarrow.parquet as pq

from ..errors import FileError
from .ahead import read_ahead
from .arrowtables import (
    ArrowDigest,
    add_corrected,
    column_batches,
    corrected_schema,
    element_names,
    other_names,
    top_names,
)
from .budget import FileExtent
from .damage import damage_told
from .format import Addition, Batch, Contents, CopyTask, Selection

#: Bytes of decoded columns in hand at once; larger row groups are cut.
_BYTES = 1 << 25
#: Rows, at least, of a segment that is read on its own, and of the batches it is read in:
#: these stay in the cache until they are used.
_STRETCH = 1 << 20


class RowGroupRange(NamedTuple):
    """Neighbouring row groups, and the footer that states where they are."""

    groups: list[int]
    footer: pq.FileMetaData


def columns(path: Path, topic: str | None = None) -> list[str]:
    """Names of the top columns, elements of lists as ``state[3]``."""
    with _opened(path) as file:
        return element_names(file.schema_arrow, lambda name: _first_length(file, name))


def unread(path: Path) -> list[str]:
    """Names of columns of other types; see `format.FormatModule`."""
    with _opened(path) as file:
        return other_names(file.schema_arrow)


def extent(path: Path, names: Sequence[str] = (), topic: str | None = None) -> FileExtent:
    """Rows and bytes of columns, by the footer; see `format.FormatModule`."""
    with _opened(path) as file:
        rows = int(file.metadata.num_rows)
    return FileExtent(rows, 8 * rows * len(names))


def stretches(path: Path) -> list[RowGroupRange | None]:
    """Row groups that are read together; None where that is the whole file."""
    with _opened(path) as file:
        footer = file.metadata
    found: list[list[int]] = []
    rows = _STRETCH
    for group in range(footer.num_row_groups):
        if rows >= _STRETCH:
            found.append([])
            rows = 0
        found[-1].append(group)
        rows += footer.row_group(group).num_rows
    return [RowGroupRange(groups, footer) for groups in found] if len(found) > 1 else [None]


def read(path: Path, wanted: Selection) -> Iterator[Batch]:
    """Columns ``names`` in batches; see `format.FormatModule`.

    A segment is read from mapped memory, by the calling thread alone.
    """
    tops = [name for name in wanted.names if "[" not in name]  # elements of lists are no columns
    stretch: RowGroupRange | None = wanted.stretch
    if stretch is None:
        with _opened(path, read_dictionary=tops) as file:
            yield from read_ahead(column_batches(path, _batches(file, wanted.names), wanted))
        return
    mapped = {"metadata": stretch.footer, "memory_map": True, "read_dictionary": tops}
    with _opened(path, **mapped) as file:
        yield from column_batches(path, _batches(file, wanted.names, stretch.groups), wanted)


def _batches(
    file: pq.ParquetFile, names: Sequence[str], groups: list[int] | None = None
) -> Iterator[pa.RecordBatch]:
    tops = top_names(file.schema_arrow, names)
    found: Iterator[pa.RecordBatch] = file.iter_batches(
        1 << 15, row_groups=groups, columns=tops, use_threads=False
    )
    return found


def _first_length(file: pq.ParquetFile, name: str) -> int:
    """Elements of the first list of a column; 0 without."""
    batch = next(file.iter_batches(1, columns=[name], use_threads=False), None)
    length = None if not batch else pc.list_value_length(batch[name])[0].as_py()
    return int(length or 0)


def copy(task: CopyTask) -> Contents:
    """Write ``target`` with the corrected columns; see `format.FormatModule`."""
    digest = ArrowDigest()
    with _whole(task.source) as (file, tables):
        elements = element_names(file.schema_arrow, lambda name: _first_length(file, name))
        channels = task.choose(list(dict.fromkeys([*file.schema_arrow.names, *elements])))
        schema = corrected_schema(file.schema_arrow, channels, task.source)
        made = (add_corrected(task.source, table, channels, schema) for table in tables)
        total = max(file.metadata.num_rows, 1)
        with pq.ParquetWriter(task.target, schema, **_options(file, channels)) as writer:
            for table in read_ahead(digest.passed(made)):
                writer.write_table(table, row_group_size=max(table.num_rows, 1))
                task.watch(table.num_rows, digest.rows / total)
        if digest.rows != file.metadata.num_rows:
            raise FileError(
                task.source, f"{digest.rows} rows read, its footer states {file.metadata.num_rows}"
            )
    return digest.contents()


def contents(path: Path, topic: str | None = None) -> Contents:
    """Rows and checksums of all columns as they read back."""
    digest = ArrowDigest()
    with _whole(path) as (_file, tables):
        for table in tables:
            digest.update(table)
    return digest.contents()


@contextmanager
def _opened(path: Path, **options: Any) -> Iterator[pq.ParquetFile]:
    """The file, its errors reported with its name."""
    # Bytes of a column of the file that are in hand while it is read.
    options = {"page_checksum_verification": True, "buffer_size": 1 << 20, **options}
    with damage_told(path, "Parquet"), pq.ParquetFile(path, **options) as file:
        yield file


@contextmanager
def _whole(path: Path) -> Iterator[tuple[pq.ParquetFile, Iterator[pa.Table]]]:
    """The file with its own schema, and all of its rows."""
    with _opened(path) as file:
        schema = file.schema_arrow
        rows = _rows_at_once(file, schema)
        footer = file.metadata
        with _opened(path, metadata=footer, read_dictionary=_texts(schema)) as reader:
            yield file, _tables(reader, schema, rows)


def _tables(file: pq.ParquetFile, schema: pa.Schema, rows: int) -> Iterator[pa.Table]:
    """The rows in tables of a bounded size in memory, none across a border of row groups.

    Texts come as dictionaries, which take no more memory than the file, and are decoded
    for as many rows as fit: pages of a few bytes can decode to gigabytes.
    """
    for group in range(file.metadata.num_row_groups):
        for batch in file.iter_batches(batch_size=rows, row_groups=[group], use_threads=False):
            for start, stop in _cuts(batch, schema):
                part = batch.slice(start, stop - start)
                columns = [
                    _decoded(column, field.type)
                    for column, field in zip(part.columns, schema, strict=True)
                ]
                yield pa.Table.from_arrays(columns, schema=schema)


def _decoded(column: pa.Array, kind: pa.DataType) -> pa.Array:
    return column if column.type == kind else column.dictionary_decode().cast(kind)


def _cuts(batch: pa.RecordBatch, schema: pa.Schema) -> Iterator[tuple[int, int]]:
    """Ranges of rows whose texts take a bounded size once they are decoded."""
    size = np.zeros(batch.num_rows, dtype=np.int64)
    for column, field in zip(batch.columns, schema, strict=True):
        if column.type != field.type:
            lengths = pc.binary_length(column.dictionary.cast(pa.large_binary()))
            lengths = np.append(lengths.fill_null(0).to_numpy(zero_copy_only=False), 0)
            size += lengths[column.indices.fill_null(lengths.size - 1).to_numpy()]
    until = np.cumsum(size)
    start = 0
    while start < batch.num_rows:
        before = until[start - 1] if start else 0
        stop = int(np.searchsorted(until, before + _BYTES, side="right"))
        stop = min(max(stop, start + 1), batch.num_rows)
        yield start, stop
        start = stop


def _rows_at_once(file: pq.ParquetFile, schema: pa.Schema) -> int:
    """Rows of which the columns of fixed width, decoded, take a bounded size.

    Other columns (lists, long texts without a dictionary) are as wide as their file states,
    though a few rows of them may be far wider than the others.
    """
    width, rows = 0, 1 << 20
    for field in schema:
        try:
            width += max(int(field.type.bit_width) // 8, 1)
        except ValueError:
            width += 8
            encoded = _encoded(file, field.name)
            width += encoded // max(file.metadata.num_rows, 1)
            nested = pa.types.is_nested(field.type)
            if encoded > _BYTES or nested:
                # Rows at once of texts that take more than `_BYTES` in the file.
                rows = min(rows, 64 if encoded > _BYTES else 1024)
    return max(min(rows, _BYTES // width), 1)


def _encoded(file: pq.ParquetFile, name: str) -> int:
    """Bytes of a column as it is encoded, without the compression."""
    groups = range(file.metadata.num_row_groups)
    return sum(int(c.total_uncompressed_size) for g in groups for c in _chunks(file, g, name))


def _chunks(
    file: pq.ParquetFile, group: int, name: str | None = None
) -> list[pq.ColumnChunkMetaData]:
    """The footer's entries of a row group's columns, or of one; the first row is read before.

    Damage there (an unknown codec, statistics of another length) ends the process when an entry
    is accessed, but raises an error when a row is read.
    """
    columns = None if name is None else [name]
    next(file.iter_batches(1, row_groups=[group], columns=columns, use_threads=False), None)
    paths = [file.schema.column(i).path for i in range(len(file.schema))]
    meta = file.metadata.row_group(group)
    return [
        meta.column(i)
        for i, path in enumerate(paths)
        if name is None or path == name or path.startswith(f"{name}.")
    ]


def _texts(schema: pa.Schema) -> list[str]:
    """Columns of texts, which can be read as dictionaries."""
    kinds = (pa.types.is_string, pa.types.is_large_string, pa.types.is_binary)
    return [field.name for field in schema if any(is_kind(field.type) for is_kind in kinds)]


def _options(file: pq.ParquetFile, channels: Sequence[Addition]) -> dict[str, Any]:
    """Settings of a writer that keep how the file is compressed and encoded.

    Where dictionaries of a column overflowed in the source they are not tried again.
    """
    meta = file.metadata
    added = [channel.added for channel in channels]
    options: dict[str, Any] = {
        "version": meta.format_version if meta.format_version in ("1.0", "2.4", "2.6") else "2.6",
        "compression": "snappy",
        "use_dictionary": False,
    }
    if meta.num_row_groups == 0:
        return options
    chunks = _chunks(file, 0)
    codecs = {chunk.path_in_schema: chunk.compression for chunk in chunks}
    angle = channels[0].column
    codecs |= {name: codecs.get(angle, chunks[0].compression) for name in added}
    options["compression"] = {path: _codec(codec) for path, codec in codecs.items()}
    options["use_dictionary"] = [
        chunk.path_in_schema
        for chunk in chunks
        if chunk.has_dictionary_page and not _overflowed(chunk)
    ]
    split = [c.path_in_schema for c in chunks if "BYTE_STREAM_SPLIT" in c.encodings]
    if split:
        options["use_byte_stream_split"] = [*split, *(added if angle in split else [])]
    options["use_deprecated_int96_timestamps"] = any(c.physical_type == "INT96" for c in chunks)
    options["write_page_index"] = all(c.has_offset_index for c in chunks)
    return options


def _codec(name: str) -> str:
    return {"UNCOMPRESSED": "none", "LZ4_RAW": "lz4"}.get(name, name.lower())


def _overflowed(chunk: Any) -> bool:
    """A dictionary that grew too large is followed by pages without it.

    The dictionary's own page is PLAIN in files of today, so encodings alone do not show this.
    A chunk well below its plain size was kept in its dictionary.
    """
    width = {"DOUBLE": 8, "INT64": 8, "FLOAT": 4, "INT32": 4}.get(chunk.physical_type)
    if width is None:
        return False
    return bool(chunk.total_uncompressed_size > width * chunk.num_values)
