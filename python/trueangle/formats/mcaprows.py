"""Messages of one channel and one length, as a chunk of an MCAP file holds them: an array of bytes.

A robot's joint states differ in their numbers only, and a chunk holds thousands: as rows of
an array they are read, checked and written without a step of Python for each.
"""

from __future__ import annotations

import zlib
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

Bytes = NDArray[np.uint8]

#: Of a message record: its kind; places of length, channel, number, times of logging and
#: publishing; and where the message begins.
_MESSAGE = 0x05
_LENGTH, _CHANNEL, _NUMBER = slice(1, 9), slice(9, 11), slice(11, 15)
_LOGGED, _PUBLISHED = slice(15, 23), slice(23, 31)
_HEAD = 31
#: What of the head the length does not count.
_UNCOUNTED = 9
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
        return self.records[:, _HEAD:]

    def with_messages(self, messages: Bytes) -> RecordRows:
        """Other messages of the same length at the same times."""
        return RecordRows(np.concatenate([self.records[:, :_HEAD], messages], axis=1))

    def checksum(self, before: int) -> int:
        """CRC-32 of time and message of every row, after ``before``."""
        told = np.concatenate([self.records[:, _LOGGED], self.messages], axis=1)
        return zlib.crc32(told.tobytes(), before)

    @classmethod
    def of_chunk(cls, data: bytes, mixed: bool = False) -> list[RecordRows] | None:
        """The records of a chunk, some thousands at a time; None where kind or length differ.

        Of several channels where ``mixed``, one channel after the other.
        """
        if len(data) < _HEAD or data[0] != _MESSAGE:
            return None
        width = _UNCOUNTED + int.from_bytes(data[_LENGTH], "little")
        if width < _HEAD or len(data) % width:
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
