"""ROS 1 and ROS 2 bags: joint states corrected on a separate topic, all else copied."""

from __future__ import annotations

import os
import struct
import zlib
from collections import defaultdict
from collections.abc import Collection, Iterator, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.interfaces import MessageDefinitionFormat
from rosbags.rosbag1 import Writer as Writer1
from rosbags.rosbag2 import StoragePlugin
from rosbags.rosbag2.enums import CompressionFormat, CompressionMode

from ..errors import FileError
from .budget import FileExtent
from .format import Addition, Batch, Contents, CopyTask, Selection
from .jointstates import JointStateBlock
from .mcapchunks import ChunkedBagWriter as Writer
from .mcapchunks import ChunkReader, RecordRows
from .openbag import (
    BLOCK,
    FIELDS,
    KEY,
    TIME,
    MessageGroup,
    OpenBag,
    caller_note,
    made_note,
    opened_bag,
    refuse_again,
)

_TIMES = struct.Struct("<q")


def columns(path: Path, topic: str | None = None) -> list[str]:
    """Joints of the JointState topic, their signals as ``JOINT/velocity_rad_s``, the time."""
    with opened_bag(path) as bag:
        return bag.columns(bag.topic(topic))


def extent(path: Path, names: Sequence[str] = (), topic: str | None = None) -> FileExtent:
    """Messages and bytes of their values; see `format.FormatModule`."""
    with opened_bag(path) as bag:
        rows = sum(int(c.msgcount) for c in bag.topic(topic))
    return FileExtent(rows, 8 * rows * len(names))


def read(path: Path, wanted: Selection) -> Iterator[Batch]:
    """Positions and signals in batches; see `format.FormatModule`."""
    with opened_bag(path) as bag:
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
    with opened_bag(task.source) as bag:
        connections = bag.topic(task.topic)
        channels = task.choose(bag.columns(connections))
        name = connections[0].topic
        output = task.output_topic or f"{name}_corrected"
        before = bag.corrected
        refuse_again(task.source, before, name, channels)
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
        before = [e for e in before if not bag.is_ros1 or e["topic"] == output]
        with _opened_writer(bag, task.target, made_note(before, channels, output)) as writer:
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
                states = JointStateBlock([block[i][2] for i in places], bag.is_ros1)
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
    with opened_bag(path) as bag:
        for storage in bag.chunked:
            storage.by_topic = True
        for block in bag.blocks():
            if isinstance(block, MessageGroup):
                digest.update_rows(block.connection.topic, block.rows)
                continue
            for connection, time, data in block:
                digest.update(connection.topic, time, data)
    return digest.contents()


class _Digest:
    """Chained checksum of the messages of every topic."""

    def __init__(self) -> None:
        self._sums: dict[str, tuple[int, int]] = {}
        self._waiting: defaultdict[str, list[bytes]] = defaultdict(list)

    def update(self, topic: str, time: int, data: bytes) -> None:
        waiting = self._waiting[topic]
        waiting += (_TIMES.pack(time), data)
        if len(waiting) >= 2 * BLOCK:
            self._sum(topic)

    def update_rows(self, topic: str, rows: RecordRows) -> None:
        """Add messages of equal layout."""
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


def _values(states: JointStateBlock, name: str, joints: Collection[str]) -> NDArray[np.float64]:
    """A joint's positions, or its velocity or effort; NaN in messages without it."""
    if name == TIME and TIME not in joints:
        return states.times()
    joint, slash, field = name.rpartition("/")
    if slash and field in FIELDS:
        return states.values(joint, FIELDS[field])
    return states.values(name, "position")


def _corrected(
    states: JointStateBlock, channels: Sequence[Addition], joints: Collection[str]
) -> dict[str, NDArray[np.float64]]:
    """Corrected positions of the joints."""
    positions = {}
    for channel in channels if len(states) else ():
        signals = {s: _values(states, column, joints) for s, column in channel.signals.items()}
        indicated = _values(states, channel.column, joints)
        positions[channel.column] = channel.correct(indicated, signals)
    return positions


class BagWriter:
    """A bag being written next to the one read."""

    def __init__(self, bag: OpenBag, writer: Any, note: str) -> None:
        self._bag = bag
        self._writer = writer
        self._note = note
        self.write = getattr(writer, "write_message", writer.write)
        #: Of bags of ROS 2 in MCAP files, from which alone rows are read.
        self.write_rows: Any = getattr(writer, "write_rows", None)

    def add(self, connection: Any, topic: str, is_corrected: bool) -> Any:
        """A connection like one that was read, perhaps of another topic.

        Bags of ROS 1 hold notes only in the headers of connections. The caller of a corrected
        connection is therefore the note, which contains the original caller.

        Raises
        ------
        FileError
            An old bag does not define a type that is not a standard one.
        """
        if self._bag.is_ros1:
            caller = connection.ext.callerid
            caller = caller_note(self._note, caller) if is_corrected else caller
            return self._writer.add_connection(
                topic,
                connection.msgtype,
                msgdef=connection.msgdef.data,
                md5sum=connection.digest,
                callerid=caller,
                latching=connection.ext.latching,
            )
        known = connection.msgdef.format != MessageDefinitionFormat.NONE and connection.digest
        if not known and connection.msgtype not in self._bag.types.fielddefs:
            raise FileError(
                self._bag.path,
                f"topic {connection.topic} is of type {connection.msgtype}, whose definition this "
                "old bag does not hold; convert it with ros2 bag convert first",
            )
        definition: dict[str, Any] = (
            {"msgdef": connection.msgdef.data, "rihs01": connection.digest}
            if known
            else {"typestore": self._bag.types}
        )
        return self._writer.add_connection(
            topic,
            connection.msgtype,
            serialization_format=connection.ext.serialization_format,
            offered_qos_profiles=connection.ext.offered_qos_profiles,
            **definition,
        )


@contextmanager
def _opened_writer(bag: OpenBag, target: Path, note: str) -> Iterator[BagWriter]:
    """A writer of the kind of ``bag``; ``note`` states where the corrected topic is from."""
    if bag.is_ros1:
        made = _ros1(bag, target)
        try:
            with made:
                yield BagWriter(bag, made, note)
        finally:
            with suppress(OSError):  # a full disk leaves it open
                made.abort()
        return
    single = not bag.path.is_dir()
    folder = target.with_name(f"{target.name}.bag") if single else target
    storage = bag.reader.storage
    parts = [storage] if single else storage.storages
    mcap = bool(parts) and isinstance(parts[0], ChunkReader)
    writer = Writer(
        folder, version=9, storage_plugin=StoragePlugin.MCAP if mcap else StoragePlugin.SQLITE3
    )
    mode = bag.reader.compression_mode
    if mcap and any(chunk.compression for part in parts for chunk in part.chunks):
        writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    elif mode:
        writer.set_compression(CompressionMode[mode.upper()], CompressionFormat.ZSTD)
    for key, value in {**bag.custom, KEY: note}.items():
        writer.set_custom_data(key, value)
    with writer:
        yield BagWriter(bag, writer, note)
    if single:
        (file,) = (path for path in folder.iterdir() if path.name != "metadata.yaml")
        os.replace(file, target)


def _ros1(bag: OpenBag, target: Path) -> Any:
    writer = Writer1(target)
    for compression in Writer1.CompressionFormat:
        if compression.name.lower() in bag.reader.codecs:
            writer.set_compression(compression)
    return writer
