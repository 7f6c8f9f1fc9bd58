"""What bags say of their own correction: a note that goes with them, and is asked before the next.

Bags of ROS 2 hold it among the custom data of their metadata, which stand in ``metadata.yaml``
and once more inside every storage file; bags of ROS 1 in the headers of the corrected connections.
"""

from __future__ import annotations

import json
import sqlite3
import struct
from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

from ruamel.yaml import YAML
from ruamel.yaml.error import YAMLError

from ..errors import FileError
from .format import Addition, note

#: Of the custom data.
KEY = "trueangle"
JOINT_STATE = "sensor_msgs/msg/JointState"
#: MCAP: magic at both ends, kind and length of a record, and the kinds looked for.
_MAGIC = b"\x89MCAP0\r\n"
_RECORD = struct.Struct("<BQ")
_FOOTER, _METADATA, _METADATA_INDEX = 0x02, 0x0C, 0x0D
#: Bytes of a footer, and of metadata, at most: a bag has some kilobytes.
_FOOTER_BYTES, _MOST = 20, 1 << 24


def made_note(before: list[dict[str, Any]], additions: Sequence[Addition], topic: str) -> str:
    """The note of a bag whose ``topic`` takes the corrected positions, with what it said before."""
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


def corrected_entries(
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
    topics = {c.topic for c in connections if c.msgtype == JOINT_STATE}
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


def bag_custom_data(reader: Any) -> dict[str, str]:
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
