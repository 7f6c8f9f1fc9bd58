"""Parquet logs: row group by row group, types, metadata, compression and encodings kept."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Any, NamedTuple

import pyarrow as pa
import pyarrow.parquet as pq

from ..errors import FileError
from .ahead import ahead
from .arrowtables import (
    ArrowDigest,
    add_corrected,
    column_batches,
    corrected_schema,
    damage_told,
)
from .formats import Batch, Choose, Contents, Watch
from .joints import Channel

__all__ = ["columns", "contents", "copy", "read", "stretches"]

#: Bytes of decoded columns in hand at once; larger row groups are cut.
_BYTES = 1 << 25
#: Rows, at least, of a stretch that is read on its own, and of the batches it is read in:
#: these stay in the cache until they are used.
_STRETCH = 1 << 20
_BATCH = 1 << 15


class Stretch(NamedTuple):
    """Neighbouring row groups, and the footer that tells where they are."""

    groups: list[int]
    footer: pq.FileMetaData


def columns(path: Path, topic: str | None = None) -> list[str]:
    """Names of the top columns."""
    with _opened(path) as file:
        return list(file.schema_arrow.names)


def stretches(path: Path) -> list[Stretch | None]:
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
    return [Stretch(groups, footer) for groups in found] if len(found) > 1 else [None]


def read(
    path: Path, names: Sequence[str], topic: str | None = None, stretch: Stretch | None = None
) -> Iterator[Batch]:
    """Columns ``names`` in batches; see `formats.FormatModule`.

    A stretch is read from mapped memory, by the calling thread alone.
    """
    if stretch is None:
        with _opened(path) as file:
            yield from ahead(column_batches(path, names, _batches(file, names)))
        return
    with _opened(path, metadata=stretch.footer, memory_map=True) as file:
        yield from column_batches(path, names, _batches(file, names, stretch.groups))


def _batches(
    file: pq.ParquetFile, names: Sequence[str], groups: list[int] | None = None
) -> Iterator[pa.RecordBatch]:
    found: Iterator[pa.RecordBatch] = file.iter_batches(
        _BATCH, row_groups=groups, columns=list(names), use_threads=False
    )
    return found


def copy(
    source: Path,
    target: Path,
    choose: Choose,
    watch: Watch,
    topic: str | None = None,
    output_topic: str | None = None,
) -> Contents:
    """Write ``target`` with the corrected columns; see `formats.FormatModule`."""
    digest = ArrowDigest()
    with _opened(source) as file:
        channels = choose(file.schema_arrow.names)
        schema = corrected_schema(file.schema_arrow, channels, source)

        def corrected() -> Iterator[pa.Table]:
            for table in _tables(file):
                made = add_corrected(source, table, channels, schema)
                digest.update(made)
                yield made

        total = max(file.metadata.num_rows, 1)
        with pq.ParquetWriter(target, schema, **_options(file, channels)) as writer:
            for table in ahead(corrected()):
                writer.write_table(table, row_group_size=max(table.num_rows, 1))
                watch(table.num_rows, digest.rows / total)
        if digest.rows != file.metadata.num_rows:
            raise FileError(
                source, f"{digest.rows} rows read, its footer says {file.metadata.num_rows}"
            )
    return digest.contents()


def contents(path: Path, topic: str | None = None) -> Contents:
    """Rows and checksums of all columns as they read back."""
    digest = ArrowDigest()
    with _opened(path) as file:
        for table in _tables(file):
            digest.update(table)
    return digest.contents()


@contextmanager
def _opened(path: Path, **options: Any) -> Iterator[pq.ParquetFile]:
    """The file, its errors told with its name."""
    with (
        damage_told(path, "Parquet"),
        pq.ParquetFile(path, page_checksum_verification=True, **options) as file,
    ):
        yield file


def _tables(file: pq.ParquetFile) -> Iterator[pa.Table]:
    """One table per row group, or several where it is large; empty row groups left out."""
    for group in range(file.metadata.num_row_groups):
        rows = file.metadata.row_group(group).num_rows
        most = _rows_at_once(file, group)
        if rows <= most:
            if rows:
                yield file.read_row_group(group)
            continue
        for batch in file.iter_batches(batch_size=most, row_groups=[group]):
            yield pa.Table.from_batches([batch])


def _rows_at_once(file: pq.ParquetFile, group: int) -> int:
    meta = file.metadata.row_group(group)
    width = int(meta.total_byte_size) // max(int(meta.num_rows), 1)
    return max(1024, _BYTES // max(width, 1))


def _options(file: pq.ParquetFile, channels: Sequence[Channel]) -> dict[str, Any]:
    """Settings of a writer that keep how the file is compressed and encoded.

    Where dictionaries of a column overflowed in the source they are not tried again.
    """
    meta = file.metadata
    added = [channel.angle.corrected for channel in channels]
    options: dict[str, Any] = {
        "version": meta.format_version if meta.format_version in ("1.0", "2.4", "2.6") else "2.6",
        "compression": "snappy",
        "use_dictionary": False,
    }
    if meta.num_row_groups == 0:
        return options
    chunks = [meta.row_group(0).column(i) for i in range(meta.num_columns)]
    codecs = {chunk.path_in_schema: chunk.compression for chunk in chunks}
    angle = channels[0].angle.name
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

    The dictionary's own page is PLAIN in files of today, so encodings alone do not tell:
    a chunk that stays well below its plain size was kept in its dictionary.
    """
    width = {"DOUBLE": 8, "INT64": 8, "FLOAT": 4, "INT32": 4}.get(chunk.physical_type)
    if width is None:
        return False
    return bool(chunk.total_uncompressed_size > width * chunk.num_values)
