"""CSV logs: the corrected angle is added to every line, whose own text stays as it is.

Blocks of lines without quotes go through pyarrow where it is installed; quoted cells, and
everything without pyarrow, through the standard library.
"""

from __future__ import annotations

import contextlib
import functools
import importlib.util
import zlib
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path
from typing import IO, TYPE_CHECKING, TypeAlias

import numpy as np
from numpy.typing import NDArray

from .._core import thread_count
from ..errors import FileError
from .csvcells import LONGEST_LINE
from .csvheader import Header
from .csvrows import BLOCK, QuotedBlock, line_too_long, quoted_blocks
from .format import Addition, Batch, Contents, CopyTask, Selection, refuse_corrected
from .textfile import create_text, open_text, warn_of_messages

if TYPE_CHECKING:
    from .csvblocks import PlainBlock

_Block: TypeAlias = "QuotedBlock | PlainBlock"

#: Bytes of a file that the standard library reads in less time than pyarrow takes to start.
SMALL = 1 << 19


def columns(path: Path, topic: str | None = None) -> list[str]:
    """Names in the header line."""
    with open_text(path) as file:
        return Header(path, file).names


def read(path: Path, wanted: Selection) -> Iterator[Batch]:
    """Columns ``names`` in batches, empty cells as NaN; see `format.FormatModule`.

    Those of ``texts`` are labels, even if they look like numbers.
    """
    labels = [name for name in wanted.names if name in wanted.texts]
    numbers = [name for name in wanted.names if name not in wanted.texts]
    with open_text(path) as file:
        header = Header(path, file)
        small = file.size <= SMALL
        messages: list[tuple[int, str]] = []

        def values(block: _Block) -> Batch:
            found: Batch = dict(block.numbers(numbers, labels, wanted.strict))
            found |= {name: block.labels(name) for name in labels}
            messages.extend(block.messages)
            return found

        blocks = _blocks(file, header, small)
        if small:
            yield from map(values, blocks)
        else:
            from .ahead import side_by_side  # and the threads of the standard library

            yield from side_by_side(values, blocks, thread_count())
        file.warn_of_sheets(path)
    warn_of_messages(path, messages)


def header_line(path: Path) -> int:
    """The line of the names; 1 where there is none."""
    with open_text(path) as file, contextlib.suppress(FileError):
        return max(Header(path, file).place, 0) + 1
    return 1


def line_of(path: Path, row: int) -> int:
    """The line of the file that a row came from."""
    with open_text(path) as file:
        for block in _blocks(file, Header(path, file)):
            if row < block.rows:
                return block.lines[row]
            row -= block.rows
    return row


def copy(task: CopyTask) -> Contents:
    """Write ``target`` with the corrected columns last; see `format.FormatModule`."""
    rows, check = 0, 0
    with open_text(task.source) as file, create_text(task.target) as output:
        header = Header(task.source, file)
        channels = task.choose(header.names)
        used = _used(channels)
        head = header.with_names([channel.added for channel in channels])
        output.write(head)
        check = zlib.crc32(head, check)
        for block in _blocks(file, header):
            # Where nothing names a column, nothing names a corrected one.
            others = _all_numbers(block) if header.place < 0 and not rows else {}
            values = block.numbers(used)
            corrected = []
            for channel in channels:
                signals = {name: values[column] for name, column in channel.signals.items()}
                indicated = values[channel.column]
                after = channel.correct(indicated, signals)
                refuse_corrected(task.source, others, channel, after)
                corrected.append((channel.column, after))
            data = block.with_columns(corrected)
            output.write(data)
            check = zlib.crc32(data, check)
            rows += block.rows
            task.watch(block.rows, file.part)
        file.warn_of_sheets(task.source)
    return Contents(rows, {"bytes": f"{check:08x}"})


def contents(path: Path, topic: str | None = None) -> Contents:
    """Rows and checksum of the bytes as they read back."""
    rows, check = 0, 0
    with open_text(path) as file:
        header = Header(path, file)
        check = zlib.crc32(b"".join(header.head), check)
        for block in _blocks(file, header):
            rows += block.rows
            check = zlib.crc32(block.data, check)
    return Contents(rows, {"bytes": f"{check:08x}"})


def _all_numbers(block: _Block) -> dict[str, NDArray[np.float64]]:
    """Those columns of a block that hold numbers."""
    found: dict[str, NDArray[np.float64]] = {}
    for name in block.header.names:
        with contextlib.suppress(FileError):
            found |= block.numbers([name])
    return found


def _used(channels: Sequence[Addition]) -> list[str]:
    names = [c.column for c in channels] + [n for c in channels for n in c.signals.values()]
    return list(dict.fromkeys(names))


@functools.cache
def _plain_block() -> Callable[[bytes, Header, int], PlainBlock | None] | None:
    """What makes blocks of lines without quotes; None where pyarrow is not installed."""
    if importlib.util.find_spec("pyarrow") is None:
        return None
    from .csvblocks import plain_block

    return plain_block


def _blocks(file: IO[bytes], header: Header, small: bool = False) -> Iterator[_Block]:
    """The remainder of the file in blocks of whole rows; of a ``small`` file, rows cut by csv."""
    line, held = header.line, b""
    plain_block = None if small else _plain_block()
    while data := held + file.read(BLOCK):
        if plain_block is None or b'"' in data:
            # A quoted cell may hold line breaks: from here on rows are cut by csv.
            yield from quoted_blocks(data, file, header, line)
            return
        cut = data.rfind(b"\n") + 1
        if len(data) == len(held):  # the end of the file, its last line without an end
            cut = len(data)
        data, held = data[:cut], data[cut:]
        if len(held) > LONGEST_LINE:
            raise line_too_long(header, line)
        if data:
            block = plain_block(data, header, line)
            yield block or QuotedBlock.whole(data, header, line)
            line += block.rows if block else data.count(b"\n")
