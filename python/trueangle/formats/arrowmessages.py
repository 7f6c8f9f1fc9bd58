"""Where the record batches of an Arrow file lie, and what their messages say of the columns.

The flatbuffers of Arrow's format (File.fbs, Message.fbs, Schema.fbs) as far as they are needed:
pyarrow gives a batch as a whole and does not tell where it found it.
"""

from __future__ import annotations

import os
import struct
from io import FileIO
from typing import Any, NamedTuple

__all__ = ["FILE_MAGIC", "BatchMessage", "Block", "Footer", "batch_message", "codec_of", "footer"]

FILE_MAGIC = b"ARROW1"
#: Codecs by their number in BodyCompression.
_CODECS = {0: "lz4", 1: "zstd"}
_RECORD_BATCH = 3
#: What stands before the length of a message, since version 0.15.
_CONTINUATION = b"\xff\xff\xff\xff"


class Table(NamedTuple):
    """A table of a flatbuffer: fields by their numbers, those that are not there left out."""

    data: bytes
    place: int

    @classmethod
    def root(cls, data: bytes) -> Table:
        """The first table of a buffer."""
        return cls(data, *struct.unpack_from("<I", data))

    def field(self, number: int) -> int | None:
        """Where a field is, None where it is left out."""
        vtable = self.place - struct.unpack_from("<i", self.data, self.place)[0]
        if 4 + 2 * number >= struct.unpack_from("<H", self.data, vtable)[0]:
            return None
        offset = struct.unpack_from("<H", self.data, vtable + 4 + 2 * number)[0]
        return self.place + offset if offset else None

    def number(self, number: int, form: str) -> int:
        """A field that is a number, 0 where it is left out."""
        place = self.field(number)
        return 0 if place is None else int(struct.unpack_from(form, self.data, place)[0])

    def table(self, number: int) -> Table | None:
        """A field that is a table."""
        place = self.field(number)
        return None if place is None else Table(self.data, self._follow(place))

    def structs(self, number: int, form: str) -> list[Any]:
        """A field that is a vector of structs."""
        place = self.field(number)
        if place is None:
            return []
        start = self._follow(place)
        length = struct.unpack_from("<I", self.data, start)[0] * struct.calcsize(form)
        found = self.data[start + 4 : start + 4 + length]
        if len(found) < length:
            raise ValueError("a list of its footer or of a message ends beyond it")
        return list(struct.iter_unpack(form, found))

    def _follow(self, place: int) -> int:
        return int(place + struct.unpack_from("<I", self.data, place)[0])


class Block(NamedTuple):
    """Where a message starts, the bytes that describe it, and those of its body."""

    place: int
    header: int
    body: int


class Footer(NamedTuple):
    """What stands at the end of a file."""

    is_little_endian: bool
    batches: list[Block]


class BatchMessage(NamedTuple):
    """What a record batch says of itself.

    ``nodes`` are rows and nulls of every column, those within columns too, ``buffers`` the
    bytes of the file where they start and how many they are.
    """

    rows: int
    codec: str | None
    nodes: list[tuple[int, int]]
    buffers: list[tuple[int, int]]


def footer(file: FileIO) -> Footer:
    """The footer of a file.

    Raises
    ------
    ValueError, struct.error
        It is damaged.
    """
    end = struct.Struct(f"<i{len(FILE_MAGIC)}s")
    size = file.seek(0, os.SEEK_END)
    length, magic = end.unpack(_bytes(file, size - end.size, end.size))
    if magic != FILE_MAGIC or not 0 < length <= size - end.size:
        raise ValueError("it does not end with a footer")
    found = Table.root(_bytes(file, size - end.size - length, length))
    schema = found.table(1)
    blocks = [Block(*block) for block in found.structs(3, "<qi4xq")]
    return Footer(schema is not None and schema.number(0, "<h") == 0, blocks)


def batch_message(file: FileIO, block: Block) -> BatchMessage:
    """What the record batch of a block says of itself.

    Raises
    ------
    ValueError, struct.error
        It is damaged.
    """
    if not 0 < block.header <= file.seek(0, os.SEEK_END):
        raise ValueError("a record batch is beyond its end")
    header = _bytes(file, block.place, block.header)
    header = header[8 if header.startswith(_CONTINUATION) else 4 :]
    message = Table.root(header)
    batch = message.table(2)
    if message.number(1, "<B") != _RECORD_BATCH or batch is None:
        raise ValueError("there is no record batch where its footer says so")
    body = block.place + block.header
    buffers = batch.structs(2, "<qq")
    if any(start < 0 or size < 0 or start + size > block.body for start, size in buffers):
        raise ValueError("a column lies beyond its record batch")
    placed = [(body + start, size) for start, size in buffers]
    return BatchMessage(batch.number(0, "<q"), _codec(batch), batch.structs(1, "<qq"), placed)


def codec_of(header: bytes) -> str | None:
    """How the record batch of a message's header is compressed."""
    message = Table.root(header)
    batch = message.table(2)
    if message.number(1, "<B") != _RECORD_BATCH or batch is None:
        return None
    return _codec(batch)


def _codec(batch: Table) -> str | None:
    compression = batch.table(3)
    return None if compression is None else _CODECS[compression.number(0, "<B")]


def _bytes(file: FileIO, place: int, count: int) -> bytes:
    file.seek(place)
    found = file.read(count)
    if len(found) < count:
        raise ValueError("it ends before what its footer names")
    return found
