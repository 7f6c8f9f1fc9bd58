"""An open bag of ROS 1 or ROS 2: where its joint states are, how it was corrected before.

Bags of ROS 2 hold the note of a correction among the custom data of their metadata, which are in
``metadata.yaml`` and once more inside every storage file; bags of ROS 1 in the headers of the
corrected connections.
"""

from __future__ import annotations

import json
import sqlite3
import struct
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from functools import partial
from pathlib import Path
from typing import Any, NamedTuple

from rosbags.rosbag1 import Reader as Reader1
from rosbags.rosbag1.reader import decompressors
from rosbags.typesys import Stores, get_typestore
from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from ..errors import FileError
from .damage import damage_told
from .format import Addition, note
from .jointstates import JointStateBlock
from .mcapchunks import BagReader, ChunkReader, RecordRows
from .unpacking import unpacked

#: Signals of a joint in the message, under the names of columns.
FIELDS = {"velocity_rad_s": "velocity", "torque_Nm": "effort"}
#: The time of a message, by the stamp in its header.
TIME = "time_s"
#: Messages corrected together.
BLOCK = 4096

#: Of the custom data.
KEY = "trueangle"
_JOINT_STATE = "sensor_msgs/msg/JointState"
#: MCAP: magic at both ends, kind and length of a record, and the kinds looked for.
_MAGIC = b"\x89MCAP0\r\n"
_RECORD = struct.Struct("<BQ")
_FOOTER, _METADATA, _METADATA_INDEX = 0x02, 0x0C, 0x0D
#: Bytes of a footer, and of metadata, at most: a bag has some kilobytes.
_FOOTER_BYTES, _MOST = 20, 1 << 24


def made_note(before: list[dict[str, Any]], additions: Sequence[Addition], topic: str) -> str:
    """The note of a bag whose ``topic`` takes the corrected positions, and its old note."""
    told = json.loads(note(additions))
    told["corrected"] = [*before, *({**entry, "topic": topic} for entry in told["corrected"])]
    return json.dumps(told)


def caller_note(note: str, caller: str | None) -> str:
    """The note as the caller of a connection, which keeps the caller that it had."""
    told = json.loads(note)
    caller = _noted(caller).get("callerid", caller)
    return json.dumps(told if caller is None else {**told, "callerid": caller})


def refuse_again(
    path: Path, before: list[dict[str, Any]], topic: str, additions: Sequence[Addition]
) -> None:
    """Refuse joints of a topic whose positions are corrected ones.

    Raises
    ------
    FileError
        Names the model that they were corrected with.
    """
    columns = {addition.column for addition in additions}
    for entry in before:
        if entry.get("topic") == topic and entry.get("from") in columns:
            sha256 = str(entry.get("model_sha256", ""))[:12]
            raise FileError(
                path,
                f"joint {entry['from']} of topic {topic} was corrected before, with "
                f"{entry.get('model') or 'a model'} (sha256 {sha256}...): its positions are "
                "corrected ones; correct the bag as it was recorded, or name another topic "
                "as `topic=`",
            )


def _corrected_entries(
    connections: Sequence[Any], custom: Mapping[str, str], is_ros1: bool
) -> list[dict[str, Any]]:
    """What was corrected in a bag: entries of its notes, with their topics."""
    found: list[dict[str, Any]] = []
    if is_ros1:
        for connection in connections:
            for entry in _corrected(connection.ext.callerid):
                # The header goes with its connection, whatever that is called by now.
                named = {**entry, "topic": connection.topic}
                found += [] if named in found else [named]
        return found
    topics = {c.topic for c in connections if c.msgtype == _JOINT_STATE}
    # Notes of earlier versions name no topic: where there is one only, it is that.
    only = {"topic": min(topics)} if len(topics) == 1 else {}
    return [{**only, **entry} for entry in _corrected(custom.get(KEY))]


def _corrected(text: Any) -> list[dict[str, Any]]:
    entries = _noted(text).get("corrected")
    return [e for e in entries if isinstance(e, dict)] if isinstance(entries, list) else []


def _noted(text: Any) -> Mapping[str, Any]:
    """The object that a note is; an empty one for any other text."""
    try:
        told = json.loads(text)
    except (TypeError, ValueError, RecursionError):
        return {}
    return told if isinstance(told, dict) else {}


def _bag_custom_data(reader: Any) -> dict[str, str]:
    """The custom data of a bag of ROS 2: of its folder, else of its storage files."""
    storage = reader.storage
    found = dict(storage.metadata.custom or {})
    for part in getattr(storage, "storages", [storage]):
        if KEY in found:
            break
        path = Path(part.path)
        texts = _of_mcap(path) if path.suffix == ".mcap" else _of_sqlite(path)
        for text in texts:
            found = {**_custom(text), **found}
    return {key: value for key, value in found.items() if isinstance(value, str)}


def _custom(text: str) -> dict[str, str]:
    try:
        told = YAML(typ="safe").load(text)
    except YAMLError:
        return {}
    custom = told.get("custom_data") if isinstance(told, dict) else None
    return custom if isinstance(custom, dict) else {}


def _of_sqlite(path: Path) -> list[str]:
    """The metadata that a database of a bag repeats."""
    connection = sqlite3.connect(f"{path.absolute().as_uri()}?immutable=1", uri=True)
    try:
        return [str(text) for (text,) in connection.execute("SELECT metadata FROM metadata")]
    except sqlite3.Error:  # versions before have no such table
        return []
    finally:
        connection.close()


def _of_mcap(path: Path) -> Iterator[str]:
    """The metadata that an MCAP file repeats, found by its summary."""
    with path.open("rb") as file:
        size = file.seek(0, 2)
        end = size - len(_MAGIC) - _FOOTER_BYTES
        if end < _RECORD.size:
            return
        file.seek(end - _RECORD.size)
        kind, _length, place, *_ = struct.unpack("<BQQ", file.read(_RECORD.size + 8))
        while kind == _FOOTER and 0 < place < end - _RECORD.size:
            file.seek(place)
            sort, length = _RECORD.unpack(file.read(_RECORD.size))
            place += _RECORD.size + length
            if sort == _METADATA_INDEX and length >= 16:
                start, long = struct.unpack("<QQ", file.read(16))
                if start + long <= end and long <= _MOST:
                    file.seek(start)
                    yield from _serialized(file.read(long))


def _serialized(record: bytes) -> Iterator[str]:
    """Texts of a metadata record called ``rosbag2``: name, then bytes of pairs of texts."""
    if len(record) < _RECORD.size or record[0] != _METADATA:
        return
    texts: list[str] = []
    place = _RECORD.size
    while place + 4 <= len(record):
        (length,) = struct.unpack_from("<I", record, place)
        if len(texts) == 1 and place + 4 + length == len(record):  # the bytes of all pairs
            place += 4
            continue
        texts.append(record[place + 4 : place + 4 + length].decode("utf-8", "replace"))
        place += 4 + length
    if texts[:1] == ["rosbag2"]:
        yield from (
            text
            for key, text in zip(texts[1::2], texts[2::2], strict=False)
            if key == "serialized_metadata"
        )


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
    """Messages of one connection and one length."""

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
        #: What the writer of a bag of ROS 2 recorded in addition to the messages.
        self.custom = {} if self.is_ros1 else _bag_custom_data(reader)
        self.types = get_typestore(Stores.ROS1_NOETIC if self.is_ros1 else Stores.LATEST)
        self.chunked = [] if self.is_ros1 else list(_chunked(reader))
        for storage in self.chunked:
            storage.by_rows = True

    @property
    def corrected(self) -> list[dict[str, Any]]:
        """What was corrected before: entries of its notes, with their topics."""
        return _corrected_entries(self.reader.connections, self.custom, self.is_ros1)

    def topic(self, name: str | None) -> list[Any]:
        """Connections of the JointState topic ``name``, or of the only one that was recorded."""
        states = [c for c in self.reader.connections if c.msgtype == _JOINT_STATE]
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
        """Messages of these connections, or of all: some thousands, or a group of one length."""
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
    """The bag, its errors reported with its name."""
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
