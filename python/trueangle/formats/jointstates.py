"""Joint states as their messages hold them: read, and written with other positions, by the block.

Messages of one robot differ in times and numbers only: a layout is read from one of them, and
those that have the same lengths and names are an array of bytes. What is not changed keeps
its bytes.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

#: Numbers of a joint, in the order in which the message holds them.
FIELDS = ("position", "velocity", "effort")


class _Layout(NamedTuple):
    """Where everything of a message is.

    Attributes
    ----------
    order : str
        "<" or ">", of its bytes.
    stamp : int
        Place of the two halves of the time.
    names : tuple of str
    fields : dict of str to (int, int)
        Place and number of the values of each list.
    free : ndarray of bool
        Bytes in which messages of one layout may differ: times, numbers, padding.
    """

    order: str
    stamp: int
    names: tuple[str, ...]
    fields: Mapping[str, tuple[int, int]]
    free: NDArray[np.bool_]


class _Cursor:
    """Reads a message from its start; alignment counts from the end of the encapsulation."""

    def __init__(self, data: bytes, start: int, order: str, aligned: bool) -> None:
        self.data = data
        self.at = self.start = start
        self.kind = "little" if order == "<" else "big"
        self.aligned = aligned
        self.free = np.zeros(len(data), dtype=bool)

    def skip(self, size: int, free: bool = False) -> int:
        """Pass over bytes; where they begin."""
        place = self.at
        if size < 0 or place + size > len(self.data):
            raise ValueError(f"a joint state of {len(self.data)} bytes is cut short")
        self.free[place : place + size] = free
        self.at += size
        return place

    def align(self, size: int) -> None:
        if self.aligned:
            self.skip(-(self.at - self.start) % size, free=True)

    def count(self) -> int:
        """A length."""
        self.align(4)
        place = self.skip(4)
        value = int.from_bytes(self.data[place : place + 4], self.kind)  # type: ignore[arg-type]
        # Longest string or list that a message may state.
        if value > 1 << 20:
            raise ValueError(f"a joint state of {len(self.data)} bytes states {value} entries")
        return value

    def string(self) -> str:
        size = self.count()
        place = self.skip(size)
        return self.data[place : place + size].rstrip(b"\0").decode()


def _layout(data: bytes, is_ros1: bool) -> _Layout:
    """The layout of a message of ROS 1, or of ROS 2 in plain CDR."""
    if is_ros1:
        order, cursor = "<", _Cursor(data, 0, "<", aligned=False)
        cursor.skip(4, free=True)  # number of the message
    else:
        if len(data) < 4 or data[0] != 0 or data[1] not in (0, 1):
            raise ValueError("a joint state is not in plain CDR, which alone is understood")
        order = "<" if data[1] else ">"
        cursor = _Cursor(data, 4, order, aligned=True)
    stamp = cursor.skip(8, free=True)
    cursor.string()
    names = tuple(cursor.string() for _ in range(cursor.count()))
    fields = {}
    for field in FIELDS:
        count = cursor.count()
        if count:
            cursor.align(8)
        fields[field] = cursor.skip(8 * count, free=True), count
    cursor.skip(len(data) - cursor.at, free=True)
    return _Layout(order, stamp, names, fields, cursor.free)


class _LayoutGroup(NamedTuple):
    """Messages of one layout: their places in the block, and their bytes, one a row."""

    layout: _Layout
    rows: NDArray[np.intp]
    data: NDArray[np.uint8]

    def numbers(self, field: str) -> NDArray[np.float64]:
        """A list of every message, one a row, as a view."""
        place, count = self.layout.fields[field]
        part = np.ascontiguousarray(self.data[:, place : place + 8 * count])
        return part.view(f"{self.layout.order}f8")


class JointStateBlock:
    """Some messages one after the other.

    Messages are bytes each, or an array of one a row; of ROS 1, else CDR of ROS 2.

    Raises
    ------
    ValueError
        A message is cut short or in another encoding.
    """

    def __init__(self, messages: Sequence[bytes] | NDArray[np.uint8], is_ros1: bool) -> None:
        self._messages = messages
        self._parts = list(_alike(messages, is_ros1))

    def __len__(self) -> int:
        return len(self._messages)

    @property
    def joints(self) -> list[str]:
        """Names of all joints, in the order in which messages bring them."""
        first = sorted(self._parts, key=lambda part: int(part.rows[0]))
        return list(dict.fromkeys(name for part in first for name in part.layout.names))

    def times(self) -> NDArray[np.float64]:
        """Seconds of the stamps in the headers."""
        found = np.empty(len(self))
        for part in self._parts:
            order, place = part.layout.order, part.layout.stamp
            halves = np.ascontiguousarray(part.data[:, place : place + 8])
            seconds = halves[:, :4].copy().view(f"{order}i4")[:, 0]
            found[part.rows] = seconds + 1e-9 * halves[:, 4:].copy().view(f"{order}u4")[:, 0]
        return found

    def values(self, joint: str, field: str) -> NDArray[np.float64]:
        """A number of a joint in every message; NaN in those without it."""
        found = np.full(len(self), np.nan)
        for part in self._parts:
            names, (_, count) = part.layout.names, part.layout.fields[field]
            if joint in names and count == len(names):
                found[part.rows] = part.numbers(field)[:, names.index(joint)]
        return found

    def with_positions(self, positions: Mapping[str, NDArray[np.float64]]) -> list[bytes]:
        """The messages with other positions of some joints, where they have one."""
        made = [bytes(message) for message in self._messages]
        for part, data in self._changed(positions):
            text, size = data.tobytes(), data.shape[1]
            for i, row in enumerate(part.rows.tolist()):
                made[row] = text[i * size : (i + 1) * size]
        return made

    def rows_with_positions(
        self, positions: Mapping[str, NDArray[np.float64]]
    ) -> NDArray[np.uint8]:
        """The same as an array, one message a row; of messages that were given as one."""
        made = np.array(self._messages, dtype=np.uint8)
        for part, data in self._changed(positions):
            made[part.rows] = data
        return made

    def _changed(
        self, positions: Mapping[str, NDArray[np.float64]]
    ) -> Iterator[tuple[_LayoutGroup, NDArray[np.uint8]]]:
        for part in self._parts:
            names, (place, count) = part.layout.names, part.layout.fields["position"]
            if count != len(names):
                continue
            data = part.data.copy()
            for joint in positions.keys() & set(names):
                at = place + 8 * names.index(joint)
                values = positions[joint][part.rows].astype(f"{part.layout.order}f8")
                data[:, at : at + 8] = values.view(np.uint8).reshape(-1, 8)
            yield part, data


def _alike(messages: Sequence[bytes] | NDArray[np.uint8], is_ros1: bool) -> Iterator[_LayoutGroup]:
    """The messages by their layouts."""
    for rows, data in _by_size(messages):
        while rows.size:
            layout = _layout(data[0].tobytes(), is_ros1)
            fixed = ~layout.free
            same = (data[:, fixed] == data[0, fixed]).all(axis=1)
            if same.all():
                yield _LayoutGroup(layout, rows, data)
                break
            yield _LayoutGroup(layout, rows[same], data[same])
            rows, data = rows[~same], data[~same]


def _by_size(
    messages: Sequence[bytes] | NDArray[np.uint8],
) -> Iterator[tuple[NDArray[np.intp], NDArray[np.uint8]]]:
    """Places and bytes of the messages of each length, one a row."""
    if isinstance(messages, np.ndarray):
        yield np.arange(len(messages)), messages
        return
    sizes = np.fromiter(map(len, messages), dtype=np.intp, count=len(messages))
    for size in np.unique(sizes).tolist():
        rows = np.flatnonzero(sizes == size)
        text = b"".join([messages[row] for row in rows.tolist()])
        yield rows, np.frombuffer(text, dtype=np.uint8).reshape(rows.size, size)
