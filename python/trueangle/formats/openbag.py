"""An open bag of ROS 1 or ROS 2, and where its joint states are."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from rosbags.rosbag1 import Reader as Reader1
from rosbags.rosbag1.reader import decompressors
from rosbags.typesys import Stores, get_typestore

from ..errors import FileError
from .damage import damage_told
from .jointstates import JointStateBlock
from .mcapchunks import BagReader, ChunkReader
from .mcaprows import RecordRows
from .rosbagmarks import JOINT_STATE, bag_custom_data, corrected_entries
from .unpacking import unpacked

#: Signals of a joint in the message, under the names of columns.
FIELDS = {"velocity_rad_s": "velocity", "torque_Nm": "effort"}
#: The time of a message, by the stamp in its header.
TIME = "time_s"
#: Messages corrected together.
BLOCK = 4096


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


class OpenBag:
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

    @property
    def corrected(self) -> list[dict[str, Any]]:
        """What was corrected before: entries of its notes, with their topics."""
        return corrected_entries(self.reader.connections, self.custom, self.is_ros1)

    def topic(self, name: str | None) -> list[Any]:
        """Connections of the JointState topic ``name``, or of the only one that was recorded."""
        states = [c for c in self.reader.connections if c.msgtype == JOINT_STATE]
        topics = list(dict.fromkeys(c.topic for c in states))
        if name is None:
            made = {str(entry.get("topic")) for entry in self.corrected}
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
            if len(block) == BLOCK:
                yield block
                block = []
        if block:
            yield block

    def states(self, block: list[Any] | MessageGroup) -> JointStateBlock:
        """Joint states of a block."""
        if isinstance(block, MessageGroup):
            return JointStateBlock(block.rows.messages, self.is_ros1)
        return JointStateBlock([data for _connection, _time, data in block], self.is_ros1)

    def columns(self, connections: Sequence[Any]) -> list[str]:
        """Joints of the first messages, with their signals."""
        joints = self.joints(connections)
        fields = (f"{joint}/{field}" for joint in joints for field in FIELDS)
        return [*joints, *fields, *([] if TIME in joints else [TIME])]


@contextmanager
def opened_bag(path: Path) -> Iterator[OpenBag]:
    """The bag, its errors told with its name."""
    with (
        damage_told(path, "a bag"),
        _Bag1(path) if path.suffix == ".bag" else BagReader(path) as bag,
    ):
        yield OpenBag(path, bag)


def _chunked(reader: Any) -> Iterator[ChunkReader]:
    """The MCAP files of a reader of ROS 2, unless each message is compressed by itself."""
    storage = reader.storage
    if reader.compression_mode != "message":
        parts = getattr(storage, "storages", [storage])
        yield from (part for part in parts if isinstance(part, ChunkReader))
