"""Logs of robots, written field by field: ROS bags (``.bag``, ``.db3``, MCAP) and WPILOG."""

from __future__ import annotations

import bz2
import sqlite3
import struct
import zlib
from collections.abc import Callable
from functools import cache
from pathlib import Path

import numpy as np

from pen import Pen

#: Messages of a bag.
_MESSAGES = 8
_KIND = b"sensor_msgs/msg/JointState"
_SECOND = 1_000_000_000


@cache
def _definition(ros: int) -> tuple[bytes, bytes]:
    """The text of the message type, and its checksum."""
    from rosbags.typesys import Stores, get_typestore

    store = get_typestore(Stores.ROS1_NOETIC if ros == 1 else Stores.LATEST)
    text, check = store.generate_msgdef(_KIND.decode(), ros_version=ros)
    return text.encode(), check.encode()


def joint_state(pen: Pen, i: int, aligned: bool, columns: tuple[bytes, ...]) -> bytes:
    """A message as ROS 1 or (aligned) ROS 2 has it: every length is a field."""
    made = bytearray()

    def put(size: int, *fields: bytes) -> None:
        if aligned:
            made.extend(bytes(-len(made) % size))
        for field in fields:
            made.extend(field)

    def string(text: bytes) -> None:
        body = pen.text(text) + (b"\0" if aligned else b"")
        put(4, pen.number("<I", len(body)), body)

    def doubles(values: list[float]) -> None:
        put(4, pen.number("<I", len(values)))
        if values:
            put(8, pen.numbers("<d", values))

    if not aligned:
        put(4, pen.number("<I", i))
    put(4, pen.number("<i", i), pen.number("<I", 0))
    string(b"base")
    put(4, pen.number("<I", len(columns)))
    for name in columns:
        string(name)
    doubles([0.1 * i + j for j in range(len(columns))])
    doubles([1.0 + j for j in range(len(columns))])
    doubles([])
    return (pen.text(b"\0\1\0\0") if aligned else b"") + bytes(made)


_JOINTS = (b"indicated_rad", b"b")


def _fields(pen: Pen, **fields: bytes) -> bytes:
    """The header of a record of ROS 1."""
    made = []
    for name, value in fields.items():
        body = pen.text(name.encode()) + b"=" + value
        made.append(pen.number("<I", len(body)) + body)
    return b"".join(pen.parts(made))


def _record1(pen: Pen, data: bytes, **fields: bytes) -> bytes:
    head = _fields(pen, **fields)
    return pen.number("<I", len(head)) + head + pen.number("<I", len(data)) + data


def _connection(pen: Pen) -> bytes:
    text, check = _definition(1)
    about = _fields(
        pen,
        topic=pen.text(b"/joint_states"),
        type=pen.text(b"sensor_msgs/JointState"),
        md5sum=pen.text(check),
        message_definition=pen.text(text),
    )
    number, topic = pen.number("<I", 0), pen.text(b"/joint_states")
    return _record1(pen, about, op=pen.number("<B", 7), conn=number, topic=topic)


def bag1(pen: Pen, variant: int) -> bytes:
    """A bag of ROS 1: its chunk as it is, or packed."""
    codec, packed = ((b"none", bytes), (b"bz2", bz2.compress), (b"lz4", _lz4))[variant]
    messages, places = [_connection(pen)], []
    for i in range(_MESSAGES):
        time = pen.number("<I", i) + pen.number("<I", 0)
        places.append((i, sum(map(len, messages))))
        state = joint_state(pen, i, False, _JOINTS)
        number, kind = pen.number("<I", 0), pen.number("<B", 2)
        messages.append(_record1(pen, state, op=kind, conn=number, time=time))
    inside = b"".join(pen.parts(messages))
    size = pen.number("<I", len(inside))
    chunk = _record1(
        pen,
        packed(inside),
        op=pen.number("<B", 5),
        compression=pen.text(codec),
        size=size,
    )
    entries = [
        pen.number("<I", second) + pen.number("<I", 0) + pen.number("<I", place)
        for second, place in places
    ]
    index = _record1(
        pen,
        b"".join(pen.parts(entries)),
        op=pen.number("<B", 4),
        ver=pen.number("<I", 1),
        conn=pen.number("<I", 0),
        count=pen.number("<I", _MESSAGES),
    )
    start = 13 + 4096
    info = _record1(
        pen,
        pen.number("<I", 0) + pen.number("<I", _MESSAGES),
        op=pen.number("<B", 6),
        ver=pen.number("<I", 1),
        chunk_pos=pen.number("<Q", start),
        start_time=pen.number("<I", 0) + bytes(4),
        end_time=pen.number("<I", _MESSAGES - 1) + bytes(4),
        count=pen.number("<I", 1),
    )
    head = _fields(
        pen,
        op=pen.number("<B", 3),
        index_pos=pen.number("<Q", start + len(chunk) + len(index)),
        conn_count=pen.number("<I", 1),
        chunk_count=pen.number("<I", 1),
    )
    blanks = b" " * max(4096 - 8 - len(head), 0)
    first = pen.number("<I", len(head)) + head + struct.pack("<I", len(blanks)) + blanks
    return b"#ROSBAG V2.0\n" + b"".join([first, *pen.parts([chunk, index, _connection(pen), info])])


def _lz4(data: bytes) -> bytes:
    import lz4.frame

    return bytes(lz4.frame.compress(data))


def _zstd(data: bytes) -> bytes:
    from trueangle.formats.unpacking import zstd

    return bytes(zstd.compress(data))


def _string(pen: Pen, text: bytes) -> bytes:
    body = pen.text(text)
    return pen.number("<I", len(body)) + body


def _record(pen: Pen, kind: int, *parts: bytes) -> bytes:
    body = b"".join(parts)
    return pen.number("<B", kind) + pen.number("<Q", len(body)) + body


def _map(pen: Pen, *entries: bytes) -> bytes:
    body = b"".join(pen.parts(entries))
    return pen.number("<I", len(body)) + body


def mcap(pen: Pen, variant: int) -> bytes:
    """MCAP with a chunk as it is, or packed; without chunks where ``variant`` is 3."""
    codec, pack = ((b"", bytes), (b"zstd", _zstd), (b"lz4", _lz4), (b"", bytes))[variant]
    text, _ = _definition(2)
    schema = _record(
        pen,
        3,
        pen.number("<H", 1),
        _string(pen, _KIND),
        _string(pen, b"ros2msg"),
        _string(pen, text),
    )
    quality = _string(pen, b"offered_qos_profiles") + _string(pen, b"")
    channel = _record(
        pen,
        4,
        pen.number("<H", 0),
        pen.number("<H", 1),
        _string(pen, b"/joint_states"),
        _string(pen, b"cdr"),
        _map(pen, quality),
    )
    head = _record(pen, 1, _string(pen, b"ros2"), _string(pen, b"rosbags"))
    made, places = [schema, channel], []
    for i in range(_MESSAGES):
        places.append((i * _SECOND, sum(map(len, made))))
        time = pen.number("<Q", i * _SECOND) * 2
        state = joint_state(pen, i, True, _JOINTS)
        made.append(_record(pen, 5, pen.number("<H", 0), pen.number("<I", i), time, state))
    times = pen.number("<Q", 0), pen.number("<Q", (_MESSAGES - 1) * _SECOND)
    inside = b"".join(pen.parts(made))
    magic = b"\x89MCAP0\r\n"
    begin = len(magic) + len(head)
    index = b""
    if variant == 3:
        data = inside
    else:
        packed = pack(inside)
        check = pen.number("<I", zlib.crc32(inside))
        size, stored = pen.number("<Q", len(inside)), pen.number("<Q", len(packed))
        chunk = _record(pen, 6, *times, size, check, _string(pen, codec), stored, packed)
        entries = [pen.number("<Q", t) + pen.number("<Q", place) for t, place in places]
        listed = _record(pen, 7, pen.number("<H", 0), _map(pen, *entries))
        data = b"".join(pen.parts([chunk, listed]))
        index = _record(
            pen,
            8,
            *times,
            pen.number("<Q", begin),
            pen.number("<Q", len(chunk)),
            _map(pen, pen.number("<H", 0) + pen.number("<Q", begin + len(chunk))),
            pen.number("<Q", len(listed)),
            _string(pen, codec),
            pen.number("<Q", len(packed)),
            pen.number("<Q", len(inside)),
        )
    counts = (pen.number("<Q", _MESSAGES), pen.number("<H", 1), pen.number("<I", 1))
    counts += (bytes(8), pen.number("<I", 0 if variant == 3 else 1))
    each = _map(pen, pen.number("<H", 0) + pen.number("<Q", _MESSAGES))
    statistics = _record(pen, 11, *counts, *times, each)
    body = [head, data, _record(pen, 15, bytes(4))]
    summary = begin + sum(map(len, body[1:]))
    listed = b"".join(pen.parts([schema, channel, statistics, *([index] if index else [])]))
    foot = _record(pen, 2, pen.number("<Q", summary), pen.number("<Q", 0), bytes(4))
    return b"".join([magic, *body, listed, foot, magic])


_TABLES = (
    "CREATE TABLE schema(schema_version INTEGER PRIMARY KEY, ros_distro TEXT NOT NULL)",
    "CREATE TABLE metadata(id INTEGER PRIMARY KEY, metadata_version, metadata TEXT)",
    "CREATE TABLE topics(id, name, type, serialization_format, offered_qos_profiles,"
    " type_description_hash)",
    "CREATE TABLE message_definitions(id INTEGER PRIMARY KEY, topic_type, encoding,"
    " encoded_message_definition, type_description_hash)",
    "CREATE TABLE messages(id, topic_id, timestamp, data)",
)


def sqlite_bag(pen: Pen, variant: int, path: Path) -> bytes:
    """A data base of ROS 2 whose values, columns and messages go wrong."""
    path.unlink(missing_ok=True)
    text, _ = _definition(2)
    with sqlite3.connect(path) as base:
        base.execute("PRAGMA journal_mode=OFF")
        base.execute("PRAGMA synchronous=OFF")
        for table in _TABLES:
            told = pen.text(table.encode()).decode("utf-8", "replace").replace("\0", "")
            try:
                base.execute(told)
            except (sqlite3.Error, sqlite3.Warning):
                base.execute(table)

        def put(table: str, *values: object) -> None:
            try:
                holders = ",".join("?" * len(values))
                base.execute(
                    f"INSERT INTO {table} VALUES({holders})", [pen.value(v) for v in values]
                )
            except Exception:
                pass

        put("schema", 4, "rosbags")
        kind = _KIND.decode()
        put("message_definitions", 1, kind, "ros2msg", text.decode(), "")
        put("topics", 1, "/joint_states", kind, "cdr", "", "")
        for i in range(_MESSAGES):
            put("messages", i + 1, 1, i * _SECOND, joint_state(pen, i, True, _JOINTS))
    base.close()
    return path.read_bytes()


def _wpi(pen: Pen, number: int, time: int, data: bytes) -> bytes:
    lengths = pen.number("<B", 0b0111_0000 if time > 0 else 0b0011_0000)
    wide = "<Q" if time > 0 else "<I"
    size = pen.number("<B", len(data) % 256)
    return lengths + pen.number("<B", number) + size + pen.number(wide, time) + data


def wpilog(pen: Pen, variant: int) -> bytes:
    """Entries of numbers and arrays with records in turn; one ends and starts again."""

    def start(number: int, name: bytes, kind: bytes) -> bytes:
        body = pen.number("<B", 0) + pen.number("<I", number)
        return _wpi(pen, 0, 0, body + _string(pen, name) + _string(pen, kind) + _string(pen, b"{}"))

    kinds: list[tuple[bytes, Callable[[float], bytes]]] = [
        (b"double", lambda x: pen.number("<d", x)),
        (b"float", lambda x: pen.number("<f", x)),
        (b"int64", lambda x: pen.number("<q", int(x))),
        (b"boolean", lambda x: pen.number("<B", int(x) % 2)),
        (b"double[]", lambda x: pen.numbers("<d", [x, 2 * x, 3.0])),
        (b"string", lambda x: pen.text(b"text")),
    ]
    names = (b"indicated_deg", b"reference_deg", b"count", b"flag", b"list", b"words")
    if variant == 1:
        kinds[0], kinds[1] = kinds[1], kinds[2]
    parts = [
        start(i + 1, *pair[::-1])
        for i, pair in enumerate(zip((kind for kind, _ in kinds), names, strict=True))
    ]
    for i in range(12):
        angle = 30.0 * i + 0.25 * float(np.sin(i))
        for number, (_kind, value) in enumerate(kinds, 1):
            if number <= 2 or i % 3 == number % 3:
                parts.append(_wpi(pen, number, 20_000 * i + 1, value(angle)))
        if i == 6:
            parts.append(_wpi(pen, 0, 0, pen.number("<B", 1) + pen.number("<I", 3)))
            parts.append(start(3, b"count", kinds[2][0]))
    told = b"extra"
    head = b"WPILOG" + pen.number("<H", 0x100) + pen.number("<I", len(told)) + told
    return head + b"".join(pen.parts(parts))
