"""ROS 1 and ROS 2 bags: joint states corrected on a topic of their own, all else copied."""

from __future__ import annotations

import struct
import zlib
from collections import defaultdict
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from rosbags.rosbag1 import Reader as Reader1
from rosbags.rosbag1.reader import decompressors
from rosbags.typesys import Stores, get_typestore

from ..errors import FileError
from .budget import FileExtent
from .damage import damage_told
from .format import Addition, Batch, Contents, CopyTask, Selection
from .jointstates import Block
from .mcapchunks import BagReader, ChunkReader
from .mcaprows import RecordRows
from .rosbagmarks import bag_custom_data, corrected_topics, made_note, refuse_again
from .rosbagwriter import opened_writer
from .unpacking import unpacked

_JOINT_STATE = "sensor_msgs/msg/JointState"
#: Signals of a joint in the message, under the names of columns.
_FIELDS = {"velocity_rad_s": "velocity", "torque_Nm": "effort"}
#: The time of a message, by the stamp in its header.
_TIME = "time_s"
#: Messages corrected together.
_BLOCK = 4096
_TIMES = struct.Struct("<q")


def columns(path: Path, topic: str | None = None) -> list[str]:
    """Joints of the JointState topic, their signals as ``JOINT/velocity_rad_s``, the time."""
    with _opened(path) as bag:
        return bag.columns(bag.topic(topic))


def extent(path: Path, names: Sequence[str] = (), topic: str | None = None) -> FileExtent:
    """Messages and bytes of their values; see `format.FormatModule`."""
    with _opened(path) as bag:
        rows = sum(int(c.msgcount) for c in bag.topic(topic))
    return FileExtent(rows, 8 * rows * len(names))


def read(path: Path, wanted: Selection) -> Iterator[Batch]:
    """Positions and signals in batches; see `format.FormatModule`."""
    with _opened(path) as bag:
        connections = bag.topic(wanted.topic)
        joints = bag.joints(connections)
        for block in bag.blocks(connections):
            states = bag.states(block)
            yield {name: _values(states, name, joints) for name in wanted.names}


def copy(task: CopyTask) -> Contents:
    """Write ``target`` with the corrected positions; see `format.FormatModule`.

    They go to the topic ``output_topic`` (default: that of the joint states with
    ``_corrected`` added) in messages that are otherwise the same, at the same times; an
    output topic that is the input topic replaces its positions.
    """
    with _opened(task.source) as bag:
        connections = bag.topic(task.topic)
        channels = task.choose(bag.columns(connections))
        name = connections[0].topic
        output = task.output_topic or f"{name}_corrected"
        refuse_again(task.source, bag, name, channels)
        if output != name and any(c.topic == output for c in bag.reader.connections):
            raise FileError(
                task.source,
                f"topic {output} is there already: corrected before, or `output_topic=`",
            )
        total = max(bag.reader.message_count, 1)
        joints = bag.joints(connections)
        digest = _Digest()
        done = 0
        ours = {c.id for c in connections}
        with opened_writer(bag, task.target, made_note(bag, channels, output)) as writer:
            copies = {
                c.id: writer.add(c, c.topic, output == name and c.id in ours)
                for c in bag.reader.connections
            }
            outputs = {
                c.id: copies[c.id] if output == name else writer.add(c, output, True)
                for c in connections
            }
            for block in bag.blocks():
                if isinstance(block, MessageGroup):
                    connection, rows = block
                    parts = [(copies[connection.id], connection.topic, rows)]
                    if connection.id in outputs:
                        states = bag.states(block)
                        positions = _corrected(states, channels, joints)
                        made = rows.with_messages(states.rows_with_positions(positions))
                        parts = parts[: 1 if output != name else 0]
                        parts.append((outputs[connection.id], output, made))
                    writer.write_rows([(place, some) for place, _topic, some in parts])
                    for _place, topic, some in parts:
                        digest.update_rows(topic, some)
                    done += len(rows)
                    task.watch(len(rows) if connection.id in outputs else 0, done / total)
                    continue
                places = [i for i, message in enumerate(block) if message[0].id in outputs]
                states = Block([block[i][2] for i in places], bag.is_ros1)
                positions = _corrected(states, channels, joints)
                changed = dict(zip(places, states.with_positions(positions), strict=True))
                for i, (connection, time, data) in enumerate(block):
                    replaced = i in changed and output == name
                    if not replaced:
                        writer.write(copies[connection.id], time, data)
                        digest.update(connection.topic, time, data)
                    if i in changed:
                        data = changed[i]
                        writer.write(outputs[connection.id], time, data)
                        digest.update(output, time, data)
                done += len(block)
                task.watch(len(states), done / total)
    return digest.contents()


def contents(path: Path, topic: str | None = None) -> Contents:
    """Messages of all topics, and a checksum of the messages and times of each."""
    digest = _Digest()
    with _opened(path) as bag:
        for storage in bag.chunked:
            storage.by_topic = True
        for block in bag.blocks():
            if isinstance(block, MessageGroup):
                digest.update_rows(block.connection.topic, block.rows)
                continue
            for connection, time, data in block:
                digest.update(connection.topic, time, data)
    return digest.contents()


class _Bag1(Reader1):  # type: ignore[misc]
    """The reader of rosbags for bags of ROS 1, chunks unpacked no farther than the budget."""

    def __init__(self, path: Path) -> None:
        super().__init__(path)
        #: How its chunks are packed.
        self.codecs: set[str] = set()

    def read_chunk(self) -> Any:
        """Where a chunk is and how it is unpacked."""
        chunk = super().read_chunk()
        codec = next(name for name, made in decompressors.items() if made is chunk.decompressor)
        if codec == "none":
            return chunk
        self.codecs.add(codec)
        return chunk._replace(decompressor=partial(unpacked, self.path, codec, "chunk"))


class MessageGroup(NamedTuple):
    """Messages of a connection that are alike in length."""

    connection: Any
    rows: RecordRows


class Bag:
    """An open bag and where its joint states are.

    Only the JointState type is needed: its wire format is the same in all releases of ROS 1
    and in all of ROS 2, and other types are copied as they are.
    """

    def __init__(self, path: Path, reader: Any) -> None:
        self.path = path
        self.reader = reader
        self.is_ros1 = isinstance(reader, Reader1)
        for connection in reader.connections:
            if not isinstance(connection.topic, str) or not isinstance(connection.msgtype, str):
                told = f"{connection.topic!r:.40} of the type {connection.msgtype!r:.40}"
                raise FileError(path, f"is damaged: a topic is called {told}")
        #: What the writer of a bag of ROS 2 noted beside the messages.
        self.custom = {} if self.is_ros1 else bag_custom_data(reader)
        self.types = get_typestore(Stores.ROS1_NOETIC if self.is_ros1 else Stores.LATEST)
        self.chunked = [] if self.is_ros1 else list(_chunked(reader))
        for storage in self.chunked:
            storage.by_rows = True

    def topic(self, name: str | None) -> list[Any]:
        """Connections of the JointState topic ``name``, or of the only one that was recorded."""
        states = [c for c in self.reader.connections if c.msgtype == _JOINT_STATE]
        topics = list(dict.fromkeys(c.topic for c in states))
        if name is None:
            made = corrected_topics(self)
            recorded = [topic for topic in topics if topic not in made] or topics
            name = recorded[0] if len(recorded) == 1 else None
        if name not in topics:
            listed = ", ".join(topics) or "none"
            problem = (
                "several JointState topics"
                if name is None and topics
                else (f"no JointState topic {name}" if name else "no JointState topic")
            )
            raise FileError(self.path, f"{problem}: name one with `topic=`; there are {listed}")
        return [c for c in states if c.topic == name]

    def joints(self, connections: Sequence[Any]) -> list[str]:
        """Joints of the first messages."""
        first = next(iter(self.blocks(connections)), None)
        return [] if first is None else self.states(first).joints

    def blocks(self, connections: Sequence[Any] = ()) -> Iterator[list[Any] | MessageGroup]:
        """Messages of these connections, or of all: some thousands, or such as are alike."""
        block: list[Any] = []
        for message in self.reader.messages(connections):
            rows = message[2]
            if isinstance(rows, RecordRows):
                if block:
                    yield block
                    block = []
                yield MessageGroup(message[0], rows)
                continue
            block.append(message)
            if len(block) == _BLOCK:
                yield block
                block = []
        if block:
            yield block

    def states(self, block: list[Any] | MessageGroup) -> Block:
        """Joint states of a block."""
        if isinstance(block, MessageGroup):
            return Block(block.rows.messages, self.is_ros1)
        return Block([data for _connection, _time, data in block], self.is_ros1)

    def columns(self, connections: Sequence[Any]) -> list[str]:
        """Joints of the first messages, with their signals."""
        joints = self.joints(connections)
        fields = (f"{joint}/{field}" for joint in joints for field in _FIELDS)
        return [*joints, *fields, *([] if _TIME in joints else [_TIME])]


@contextmanager
def _opened(path: Path) -> Iterator[Bag]:
    """The bag, its errors told with its name."""
    with (
        damage_told(path, "a bag"),
        _Bag1(path) if path.suffix == ".bag" else BagReader(path) as bag,
    ):
        yield Bag(path, bag)


class _Digest:
    """Chained checksum of the messages of every topic."""

    def __init__(self) -> None:
        self._sums: dict[str, tuple[int, int]] = {}
        self._waiting: defaultdict[str, list[bytes]] = defaultdict(list)

    def update(self, topic: str, time: int, data: bytes) -> None:
        waiting = self._waiting[topic]
        waiting += (_TIMES.pack(time), data)
        if len(waiting) >= 2 * _BLOCK:
            self._sum(topic)

    def update_rows(self, topic: str, rows: RecordRows) -> None:
        """Add messages that are alike."""
        if topic in self._waiting:
            self._sum(topic)
        count, check = self._sums.get(topic, (0, 0))
        self._sums[topic] = count + len(rows), rows.checksum(check)

    def _sum(self, topic: str) -> None:
        """Add up what waits: one call for many messages."""
        waiting = self._waiting.pop(topic)
        count, check = self._sums.get(topic, (0, 0))
        self._sums[topic] = (count + len(waiting) // 2, zlib.crc32(b"".join(waiting), check))

    def contents(self) -> Contents:
        for topic in list(self._waiting):
            self._sum(topic)
        return Contents(
            sum(count for count, _check in self._sums.values()),
            {topic: f"{count}:{check:08x}" for topic, (count, check) in self._sums.items()},
        )


def _chunked(reader: Any) -> Iterator[ChunkReader]:
    """The MCAP files of a reader of ROS 2, unless each message is compressed by itself."""
    storage = reader.storage
    if reader.compression_mode != "message":
        parts = getattr(storage, "storages", [storage])
        yield from (part for part in parts if isinstance(part, ChunkReader))


def _values(states: Block, name: str, joints: Collection[str]) -> NDArray[np.float64]:
    """A joint's positions, or its velocity or effort; NaN in messages without it."""
    if name == _TIME and _TIME not in joints:
        return states.times()
    joint, slash, field = name.rpartition("/")
    if slash and field in _FIELDS:
        return states.values(joint, _FIELDS[field])
    return states.values(name, "position")


def _corrected(
    states: Block, channels: Sequence[Addition], joints: Collection[str]
) -> dict[str, NDArray[np.float64]]:
    """Corrected positions of the joints."""
    positions = {}
    for channel in channels if len(states) else ():
        signals = {s: _values(states, column, joints) for s, column in channel.signals.items()}
        indicated = _values(states, channel.column, joints)
        positions[channel.column] = channel.correct(indicated, signals)
    return positions
