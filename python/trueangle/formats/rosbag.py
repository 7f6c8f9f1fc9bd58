"""ROS 1 and ROS 2 bags: joint states corrected on a topic of their own, all else copied."""

from __future__ import annotations

import zlib
from collections.abc import Collection, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from rosbags.rosbag1 import Reader as Reader1
from rosbags.rosbag2 import Reader as Reader2
from rosbags.typesys import Stores, get_typestore

from ..errors import FileError
from .damage import damage_told
from .format import TEXTS, Addition, Batch, Choose, Contents, Watch, note
from .rosbagwriter import opened_writer

__all__ = ["columns", "contents", "copy", "read"]

_JOINT_STATE = "sensor_msgs/msg/JointState"
#: Signals of a joint in the message, under the names of columns.
_FIELDS = {"velocity_rad_s": "velocity", "torque_Nm": "effort"}
#: The time of a message, by the stamp in its header.
_TIME = "time_s"
#: Messages corrected together.
_BLOCK = 4096


def columns(path: Path, topic: str | None = None) -> list[str]:
    """Joints of the JointState topic, their signals as ``JOINT/velocity_rad_s``, the time."""
    with _opened(path) as bag:
        return bag.columns(bag.topic(topic))


def read(
    path: Path,
    names: Sequence[str],
    topic: str | None = None,
    stretch: None = None,
    *,
    texts: Collection[str] = TEXTS,
    strict: bool = False,
) -> Iterator[Batch]:
    """Positions and signals in batches; see `format.FormatModule`."""
    with _opened(path) as bag:
        connections = bag.topic(topic)
        block: list[Any] = []
        for _connection, _stamp, data in bag.reader.messages(connections):
            block.append(bag.decoded(data))
            if len(block) == _BLOCK:
                yield {name: _values(block, name) for name in names}
                block = []
        if block:
            yield {name: _values(block, name) for name in names}


def copy(
    source: Path,
    target: Path,
    choose: Choose,
    watch: Watch,
    topic: str | None = None,
    output_topic: str | None = None,
) -> Contents:
    """Write ``target`` with the corrected positions; see `format.FormatModule`.

    They go to the topic ``output_topic`` (default: that of the joint states with
    ``_corrected`` added) in messages that are otherwise the same, at the same times; an
    output topic that is the input topic replaces its positions.
    """
    with _opened(source) as bag:
        connections = bag.topic(topic)
        channels = choose(bag.columns(connections))
        name = connections[0].topic
        output = output_topic or f"{name}_corrected"
        if output != name and any(c.topic == output for c in bag.reader.connections):
            raise FileError(
                source, f"topic {output} is there already: corrected before, or --output-topic"
            )
        total = max(bag.reader.message_count, 1)
        digest = _Digest()
        done = 0
        with opened_writer(bag, target, note(channels)) as writer:
            copies = {c.id: writer.add(c, c.topic) for c in bag.reader.connections}
            outputs = {
                c.id: copies[c.id] if output == name else writer.add(c, output) for c in connections
            }
            for block in _blocks(bag.reader.messages()):
                states = [(i, bag.decoded(m[2])) for i, m in enumerate(block) if m[0].id in outputs]
                made = dict(_corrected(states, channels))
                for i, (connection, time, data) in enumerate(block):
                    replaced = i in made and output == name
                    if not replaced:
                        writer.write(copies[connection.id], time, data)
                        digest.update(connection.topic, time, data)
                    if i in made:
                        data = bag.encoded(made[i])
                        writer.write(outputs[connection.id], time, data)
                        digest.update(output, time, data)
                done += len(block)
                watch(len(states), done / total)
    return digest.contents()


def contents(path: Path, topic: str | None = None) -> Contents:
    """Messages of all topics, and a checksum of the messages and times of each."""
    digest = _Digest()
    with _opened(path) as bag:
        for connection, time, data in bag.reader.messages():
            digest.update(connection.topic, time, data)
    return digest.contents()


class Bag:
    """An open bag and how its joint states are decoded.

    Only the JointState type is needed: its wire format is the same in all releases of ROS 1
    and in all of ROS 2, and other types are copied as they are.
    """

    def __init__(self, path: Path, reader: Any) -> None:
        self.path = path
        self.reader = reader
        self.is_ros1 = isinstance(reader, Reader1)
        self.types = get_typestore(Stores.ROS1_NOETIC if self.is_ros1 else Stores.LATEST)

    def topic(self, name: str | None) -> list[Any]:
        """Connections of the JointState topic ``name``, or of the only one."""
        states = [c for c in self.reader.connections if c.msgtype == _JOINT_STATE]
        topics = list(dict.fromkeys(c.topic for c in states))
        if name is None and len(topics) == 1:
            (name,) = topics
        if name not in topics:
            listed = ", ".join(topics) or "none"
            problem = (
                "several JointState topics"
                if name is None and topics
                else (f"no JointState topic {name}" if name else "no JointState topic")
            )
            raise FileError(self.path, f"{problem}: name one with --topic; there are {listed}")
        return [c for c in states if c.topic == name]

    def columns(self, connections: Sequence[Any]) -> list[str]:
        """Joints of the first messages, with their signals."""
        joints: dict[str, None] = {}
        for i, (_connection, _time, data) in enumerate(self.reader.messages(connections)):
            joints |= dict.fromkeys(self.decoded(data).name)
            if i == _BLOCK:
                break
        fields = (f"{joint}/{field}" for joint in joints for field in _FIELDS)
        return [*joints, *fields, *([] if _TIME in joints else [_TIME])]

    def decoded(self, data: bytes) -> Any:
        """A JointState message."""
        if self.is_ros1:
            return self.types.deserialize_ros1(data, _JOINT_STATE)
        return self.types.deserialize_cdr(data, _JOINT_STATE)

    def encoded(self, message: Any) -> bytes:
        """The bytes of a JointState message."""
        serialize = self.types.serialize_ros1 if self.is_ros1 else self.types.serialize_cdr
        return bytes(serialize(message, _JOINT_STATE))


@contextmanager
def _opened(path: Path) -> Iterator[Bag]:
    """The bag, its errors told with its name."""
    with (
        damage_told(path, "a bag"),
        Reader1(path) if path.suffix == ".bag" else Reader2(path) as bag,
    ):
        yield Bag(path, bag)


class _Digest:
    """Chained checksum of the messages of every topic."""

    def __init__(self) -> None:
        self._sums: dict[str, tuple[int, int]] = {}

    def update(self, topic: str, time: int, data: bytes) -> None:
        count, check = self._sums.get(topic, (0, 0))
        check = zlib.crc32(data, zlib.crc32(time.to_bytes(8, "little", signed=True), check))
        self._sums[topic] = (count + 1, check)

    def contents(self) -> Contents:
        return Contents(
            sum(count for count, _check in self._sums.values()),
            {topic: f"{count}:{check:08x}" for topic, (count, check) in self._sums.items()},
        )


def _blocks(messages: Iterator[Any]) -> Iterator[list[Any]]:
    block: list[Any] = []
    for message in messages:
        block.append(message)
        if len(block) == _BLOCK:
            yield block
            block = []
    if block:
        yield block


def _values(messages: Sequence[Any], name: str) -> NDArray[np.float64]:
    """A joint's positions, or its velocity or effort; NaN in messages without it."""
    if name == _TIME and not any(_TIME in message.name for message in messages[:1]):
        stamps = (message.header.stamp for message in messages)
        return np.array([stamp.sec + 1e-9 * stamp.nanosec for stamp in stamps])
    joint, slash, field = name.rpartition("/")
    if not slash or field not in _FIELDS:
        joint, attribute = name, "position"
    else:
        attribute = _FIELDS[field]
    values = np.full(len(messages), np.nan)
    for i, message in enumerate(messages):
        given = getattr(message, attribute)
        if joint in message.name and len(given) == len(message.name):
            values[i] = given[message.name.index(joint)]
    return values


def _corrected(
    states: Sequence[tuple[int, Any]], channels: Sequence[Addition]
) -> Iterator[tuple[int, Any]]:
    """The messages with the positions of the joints replaced by corrected ones."""
    messages = [message for _place, message in states]
    if not messages:
        return
    results: list[Mapping[str, Any]] = []
    for channel in channels:
        signals = {s: _values(messages, column) for s, column in channel.signals.items()}
        joint = channel.column
        results.append(
            {"joint": joint, "values": channel.correct(_values(messages, joint), signals)}
        )
    for i, (place, message) in enumerate(states):
        position = np.array(message.position)
        for result in results:
            if result["joint"] in message.name and len(position) == len(message.name):
                position[message.name.index(result["joint"])] = result["values"][i]
        yield place, replace(message, position=position)
