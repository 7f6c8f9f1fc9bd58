"""CSV logs: the corrected angle is added to every line, whose own text stays as it is.

Blocks of lines without quotes go through pyarrow where it is installed; quoted cells, and
everything without pyarrow, through the standard library.
"""

from __future__ import annotations

import importlib.util
import zlib
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import IO, TypeAlias

from .columns import RUN_COLUMN
from .csvrows import BLOCK, Header, QuotedBlock, quoted_blocks
from .formats import Batch, Choose, Contents, Watch
from .joints import Channel

if importlib.util.find_spec("pyarrow") is not None:
    from .csvblocks import PlainBlock, plain_block
else:
    plain_block = None  # type: ignore[assignment]

__all__ = ["columns", "contents", "copy", "read"]

_Block: TypeAlias = "QuotedBlock | PlainBlock"


def columns(path: Path, topic: str | None = None) -> list[str]:
    """Names in the header line."""
    with path.open("rb") as file:
        return Header(path, file.readline()).names


def read(path: Path, names: Sequence[str], topic: str | None = None) -> Iterator[Batch]:
    """Columns ``names`` in batches, empty cells as NaN; see `formats.FormatModule`.

    Labels of runs are text, whatever they look like.
    """
    angles = [name for name in names if name != RUN_COLUMN]
    texts = [name for name in names if name == RUN_COLUMN]
    with path.open("rb") as file:
        header = Header(path, file.readline())
        for block in _blocks(file, header):
            yield {**block.numbers(angles, texts), **{name: block.labels(name) for name in texts}}


def copy(
    source: Path,
    target: Path,
    choose: Choose,
    watch: Watch,
    topic: str | None = None,
    output_topic: str | None = None,
) -> Contents:
    """Write ``target`` with the corrected columns last; see `formats.FormatModule`."""
    size = max(source.stat().st_size, 1)
    rows, check = 0, 0
    with source.open("rb") as file, target.open("wb") as output:
        header = Header(source, file.readline())
        channels = choose(header.names)
        used = _used(channels)
        added = [channel.angle.corrected for channel in channels]
        line = header.delimiter.join([header.text, *added]) + header.ending
        head = header.mark + line.encode()
        output.write(head)
        check = zlib.crc32(head, check)
        for block in _blocks(file, header):
            values = block.numbers(used)
            corrected = []
            for channel in channels:
                signals = {name: values[column] for name, column in channel.signals.items()}
                indicated = values[channel.angle.name]
                corrected.append((channel.angle.name, channel.correct(indicated, signals)))
            data = block.with_columns(corrected)
            output.write(data)
            check = zlib.crc32(data, check)
            rows += block.rows
            watch(block.rows, file.tell() / size)
    return Contents(rows, {"bytes": f"{check:08x}"})


def contents(path: Path, topic: str | None = None) -> Contents:
    """Rows and checksum of the bytes as they read back."""
    rows, check = 0, 0
    with path.open("rb") as file:
        line = file.readline()
        check = zlib.crc32(line, check)
        for block in _blocks(file, Header(path, line)):
            rows += block.rows
            check = zlib.crc32(block.data, check)
    return Contents(rows, {"bytes": f"{check:08x}"})


def _used(channels: Sequence[Channel]) -> list[str]:
    names = [c.angle.name for c in channels] + [n for c in channels for n in c.signals.values()]
    return list(dict.fromkeys(names))


def _blocks(file: IO[bytes], header: Header) -> Iterator[_Block]:
    """The rest of the file in blocks of whole rows."""
    line, held = 2, b""
    while data := held + file.read(BLOCK):
        if plain_block is None or b'"' in data:
            # A quoted cell may hold line breaks: from here on rows are cut by csv.
            yield from quoted_blocks(data, file, header, line)
            return
        cut = data.rfind(b"\n") + 1
        if len(data) == len(held):  # the end of the file, its last line without an end
            cut = len(data)
        data, held = data[:cut], data[cut:]
        if data:
            yield plain_block(data, header, line) or QuotedBlock.whole(data, header, line)
            line += data.count(b"\n")
