"""Chunks of MCAP files, read and written with one step of Python a message.

rosbags reads and writes them field by field, which takes ten times as long; files and their
index, which are small, stay with it. Format: https://mcap.dev/spec (version 0).
"""

from __future__ import annotations

import struct
import zlib
from collections import defaultdict
from collections.abc import Callable, Collection, Iterator, Sequence
from io import BytesIO
from itertools import chain, pairwise
from operator import itemgetter
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, ClassVar, cast

import numpy as np
from numpy.typing import NDArray
from rosbags.rosbag2 import CompressionMode, Reader, StoragePlugin, Writer
from rosbags.rosbag2.reader import DirectoryReader
from rosbags.rosbag2.storage_mcap import McapReader, McapWriter, PendingChunk, decompress

from .budget import check_part
from .unpacking import unpacked, unpacked_folder

_MESSAGE, _CHUNK, _MESSAGE_INDEX = 0x05, 0x06, 0x07
#: Record: kind and length; of a message also channel, number, times of logging and publishing.
_RECORD = struct.Struct("<BQ")
_HEAD = struct.Struct("<BQHIQQ")
#: What of these the length of a message counts.
_COUNTED = _HEAD.size - _RECORD.size
#: Of a chunk: kind and length; times, size and checksum of what is compressed in it.
_CHUNK_HEAD = struct.Struct("<BQQQQI")
#: Bytes from which on a chunk is closed, as rosbags has it.
_FULL = 1 << 20

_by_time = itemgetter(1)


class ChunkReader(McapReader):  # type: ignore[misc]
    """The MCAP storage of rosbags, with whole chunks of messages taken apart at once."""

    #: Whether messages of one layout may come as `RecordRows`, and their first time before them.
    by_rows = False
    #: Whether the order of messages of different topics does not matter.
    by_topic = False

    def messages(
        self, connections: Collection[Any], start: int | None = None, stop: int | None = None
    ) -> Iterator[tuple[Any, int, bytes | RecordRows]]:
        """Connection, time and data of every message, in the order of time.

        Raises
        ------
        ValueError
            A chunk whose records do not fill it.
        """
        if start is not None or stop is not None or not self._is_in_order():
            yield from super().messages(connections, start, stop)
            return
        wanted = {connection.id: connection for connection in connections}
        for chunk in self.chunks:
            if not any(chunk.channel_count.get(number) for number in wanted):
                continue
            self.bio.seek(chunk.chunk_start_offset)
            *_times, size, check = _CHUNK_HEAD.unpack(self.bio.read(_CHUNK_HEAD.size))
            check_part(self.path, size, "chunk")
            self.bio.seek(4 + len(chunk.compression) + 8, 1)
            packed = self.bio.read(chunk.compressed_size)
            if chunk.compression in ("lz4", "zstd"):  # no farther than the budget
                packed = unpacked(self.path, chunk.compression, "chunk", packed)
            data = decompress(packed, "", size, check)
            mixed = self.by_topic or len(wanted) == 1
            alike = RecordRows.of_chunk(data, mixed) if self.by_rows else None
            if alike is None:
                yield from sorted(_messages(data, wanted), key=_by_time)
                continue
            for rows in alike:
                if rows.channel in wanted:
                    yield wanted[rows.channel], int(rows.times[0]), rows

    def _is_in_order(self) -> bool:
        """Every chunk ends before the next one starts (there are files without any)."""
        chunks = self.chunks
        return bool(chunks) and all(
            a.message_end_time <= b.message_start_time for a, b in pairwise(chunks)
        )


def _messages(data: bytes, wanted: dict[int, Any]) -> Iterator[tuple[Any, int, bytes]]:
    """Messages of wanted channels as they are in a chunk."""
    place, end = 0, len(data)
    head_of, record_of = _HEAD.unpack_from, _RECORD.unpack_from
    last_head = end - _HEAD.size
    while place < end:
        if place <= last_head and data[place] == _MESSAGE:
            _kind, length, channel, _number, time, _published = head_of(data, place)
            after = place + _RECORD.size + length
            if length < _COUNTED or after > end:
                raise ValueError("a message reaches beyond its chunk")
            if channel in wanted:
                yield wanted[channel], time, data[place + _HEAD.size : after]
        else:
            if place + _RECORD.size > end:
                raise ValueError("a record reaches beyond its chunk")
            after = place + _RECORD.size + record_of(data, place)[1]
            if after > end or data[place] == _MESSAGE:
                raise ValueError("a record reaches beyond its chunk")
        place = after


class _Directory(DirectoryReader):  # type: ignore[misc]
    STORAGE_PLUGINS: ClassVar[Any] = {**DirectoryReader.STORAGE_PLUGINS, "mcap": ChunkReader}
    metadata: Any
    path: Path
    #: Where its files are unpacked.
    _unpacked: TemporaryDirectory[str] | None = None

    def open(self) -> None:
        """As of rosbags; files that are packed as a whole, no farther than a limit."""
        packed, self._unpacked = self.path, unpacked_folder(self.path)
        if self._unpacked is None:
            super().open()
            return
        self.path = Path(self._unpacked.name)
        try:
            super().open()
        finally:
            self.path = packed
        self.metadata = self.metadata._replace(compression_mode="file", compression_format="zstd")

    def close(self) -> None:
        """Close the files, and remove what was unpacked."""
        try:
            super().close()
        finally:
            if self._unpacked is not None:
                self._unpacked.cleanup()

    def messages(
        self, connections: Collection[Any], start: int | None = None, stop: int | None = None
    ) -> Iterator[tuple[Any, int, Any]]:
        """As of rosbags; messages that are packed one by one, no farther than the budget."""
        told = self.metadata
        if told.compression_mode != "message":
            yield from super().messages(connections, start, stop)
            return
        path = self.path
        self.metadata = told._replace(compression_mode=None)  # packed, as they are
        try:
            for connection, time, data in super().messages(connections, start, stop):
                yield connection, time, unpacked(path, "zstd", "message", data)
        finally:
            self.metadata = told


class BagReader(Reader):  # type: ignore[misc]
    """The reader of rosbags for bags of ROS 2, with `ChunkReader`."""

    STORAGE_PLUGINS: ClassVar[Any] = {
        **Reader.STORAGE_PLUGINS,
        "dir": _Directory,
        ".mcap": ChunkReader,
    }


class _ChunkWriter(McapWriter):  # type: ignore[misc]
    """The MCAP storage of rosbags, with messages written in one step."""

    chunk: Any
    message_start_time: int
    message_end_time: int

    def write(self, connection: Any, timestamp: int, data: bytes | memoryview) -> None:
        """Write one message."""
        chunk, number = self.chunk, connection.id
        if timestamp < chunk.message_start_time:
            chunk.message_start_time = timestamp
        if timestamp > chunk.message_end_time:
            chunk.message_end_time = timestamp
        place = chunk.bio.tell()
        chunk.msgs[number].append((timestamp, place))
        size = len(data)
        head = _HEAD.pack(_MESSAGE, _COUNTED + size, number, 0, timestamp, timestamp)
        chunk.bio.write(head)
        chunk.bio.write(data)
        if place + size > _FULL:
            self.close_chunk()

    def write_rows(self, parts: Sequence[tuple[Any, RecordRows]]) -> None:
        """Write rows of several connections, row by row: as `write` would, one by one."""
        rows = interleaved_rows([(connection.id, rows) for connection, rows in parts])
        width, size = rows.records.shape[1], rows.messages.shape[1]
        done, turn = 0, len(parts)
        while done < len(rows):
            chunk = self.chunk
            place = chunk.bio.tell()
            most = max(0, (_FULL - size - place) // width + 1) + 1
            part = RecordRows(rows.records[done : done + most])
            times = part.times
            chunk.message_start_time = min(chunk.message_start_time, int(times[0]))
            chunk.message_end_time = max(chunk.message_end_time, int(times[-1]))
            places = place + width * np.arange(len(part))
            for i, (connection, _) in enumerate(parts):
                mine = slice((i - done) % turn, None, turn)
                entries = zip(times[mine].tolist(), places[mine].tolist(), strict=True)
                if some := list(entries):
                    chunk.msgs[connection.id].extend(some)
            chunk.bio.write(part.records.data)
            done += len(part)
            if len(part) == most:
                self.close_chunk()

    def close_chunk(self) -> None:
        """Write the waiting messages, and an index of where they are."""
        chunk = self.chunk
        if not chunk.bio.tell():
            return
        self.message_start_time = min(self.message_start_time, chunk.message_start_time)
        self.message_end_time = max(self.message_end_time, chunk.message_end_time)
        data = chunk.bio.getvalue()
        packed = self.compressor(data)
        span = chunk.message_start_time, chunk.message_end_time
        body = (
            struct.pack("<QQQI", *span, len(data), 0),
            _text(self.compression),
            struct.pack("<Q", len(packed)),
        )
        start = self.bio.tell()
        self.bio.write(_RECORD.pack(_CHUNK, sum(map(len, body)) + len(packed)))
        self.bio.writelines([*body, packed])
        end = self.bio.tell()
        places = []
        for number, entries in chunk.msgs.items():
            self.channel_stats[number] += len(entries)
            places.append(struct.pack("<HQ", number, self.bio.tell()))
            index = struct.pack(f"<{2 * len(entries)}Q", *chain.from_iterable(entries))
            self.bio.write(_RECORD.pack(_MESSAGE_INDEX, 6 + len(index)))
            self.bio.write(struct.pack("<HI", number, len(index)) + index)
        told = BytesIO()
        told.write(struct.pack("<QQQQI", *span, start, end - start, 10 * len(places)))
        told.write(b"".join(places) + struct.pack("<Q", self.bio.tell() - end))
        told.write(_text(self.compression) + struct.pack("<QQ", len(packed), len(data)))
        self.chunks.append(told)
        # Start of a chunk without messages.
        self.chunk = PendingChunk((1 << 63) - 1, 0, BytesIO(), defaultdict(list))


def _text(text: str) -> bytes:
    return struct.pack("<I", len(text)) + text.encode()


class ChunkedBagWriter(Writer):  # type: ignore[misc]
    """The writer of rosbags for bags of ROS 2, with `_ChunkWriter`."""

    STORAGE_PLUGINS: ClassVar[Any] = {
        **Writer.STORAGE_PLUGINS,
        StoragePlugin.MCAP: _ChunkWriter,
    }

    @property
    def write_message(self) -> Callable[[Any, int, bytes], None]:
        """The shortest way to write one: connection, time, data."""
        is_plain = self.compression_mode != CompressionMode.MESSAGE
        if is_plain and isinstance(self.storage, _ChunkWriter):
            return cast("Callable[[Any, int, bytes], None]", self.storage.write)
        return cast("Callable[[Any, int, bytes], None]", self.write)

    def write_rows(self, parts: Sequence[tuple[Any, RecordRows]]) -> None:
        """Write rows of several connections, row by row."""
        self.storage.write_rows(parts)

    def close(self) -> None:
        """Count what was written by the short way, and close."""
        if isinstance(self.storage, _ChunkWriter):
            self.storage.close_chunk()
            self.counts = dict(self.storage.channel_stats)
            self.min_timestamp = self.storage.message_start_time
            self.max_timestamp = self.storage.message_end_time
        super().close()


Bytes = NDArray[np.uint8]

#: Of a message record: its kind; places of length, channel, number, times of logging and
#: publishing; and where the message begins.
_LENGTH, _CHANNEL, _NUMBER = slice(1, 9), slice(9, 11), slice(11, 15)
_LOGGED, _PUBLISHED = slice(15, 23), slice(23, 31)
#: Rows that are given at a time: some megabytes.
_MOST = 16_384


class RecordRows:
    """Whole records of one channel and one length, one a row, in the order of time.

    Parameters
    ----------
    records : ndarray of uint8, shape (n, 31 + size)
    """

    def __init__(self, records: Bytes) -> None:
        self.records = records

    def __len__(self) -> int:
        return len(self.records)

    @property
    def channel(self) -> int:
        """Number of the channel."""
        return int(self.records[0, _CHANNEL].copy().view("<u2")[0])

    @property
    def times(self) -> NDArray[np.uint64]:
        """Nanoseconds at which the messages were logged."""
        stamps = np.ascontiguousarray(self.records[:, _LOGGED]).view("<u8")[:, 0]
        return np.asarray(stamps, dtype=np.uint64)

    @property
    def messages(self) -> Bytes:
        """The messages without their heads, one a row."""
        return self.records[:, _HEAD.size :]

    def with_messages(self, messages: Bytes) -> RecordRows:
        """Other messages of the same length at the same times."""
        return RecordRows(np.concatenate([self.records[:, : _HEAD.size], messages], axis=1))

    def checksum(self, before: int) -> int:
        """CRC-32 of time and message of every row, after ``before``."""
        told = np.concatenate([self.records[:, _LOGGED], self.messages], axis=1)
        return zlib.crc32(told.tobytes(), before)

    @classmethod
    def of_chunk(cls, data: bytes, mixed: bool = False) -> list[RecordRows] | None:
        """The records of a chunk, some thousands at a time; None where kind or length differ.

        Of several channels where ``mixed``, one channel after the other.
        """
        if len(data) < _HEAD.size or data[0] != _MESSAGE:
            return None
        # What of the head the length does not count.
        width = 9 + int.from_bytes(data[_LENGTH], "little")
        if width < _HEAD.size or len(data) % width:
            return None
        records = np.frombuffer(data, dtype=np.uint8).reshape(-1, width)
        # Kind and length of every record as those of the first.
        if (records[:, : _LENGTH.stop] != records[0, : _LENGTH.stop]).any():
            return None
        times = cls(records).times
        if (times[1:] < times[:-1]).any():
            return None
        numbers = np.ascontiguousarray(records[:, _CHANNEL]).view("<u2")[:, 0]
        if (numbers == numbers[0]).all():
            parts = [records]
        elif mixed:
            parts = [records[numbers == number] for number in np.unique(numbers)]
        else:
            return None
        return [cls(part[i : i + _MOST]) for part in parts for i in range(0, len(part), _MOST)]


def interleaved_rows(parts: Sequence[tuple[int, RecordRows]]) -> RecordRows:
    """Row 0 of every part, row 1 of every part and so on, each on the channel of its part.

    Numbers are 0 and times of publishing those of logging, as for messages written one by one.
    """
    made = np.stack([rows.records for _, rows in parts], axis=1)
    for i, (channel, _) in enumerate(parts):
        made[:, i, _CHANNEL] = np.frombuffer(channel.to_bytes(2, "little"), dtype=np.uint8)
    made[:, :, _NUMBER] = 0
    made[:, :, _PUBLISHED] = made[:, :, _LOGGED]
    return RecordRows(made.reshape(-1, made.shape[2]))
