"""The index of a written MCAP file against its records, taken apart by the specification."""

import struct
from collections import Counter

import numpy as np
import pytest

import trueangle as ta

rosbags = pytest.importorskip("rosbags")

from rosbags.rosbag2 import Reader, StoragePlugin, Writer  # noqa: E402
from rosbags.typesys import Stores, get_typestore  # noqa: E402

STORE = get_typestore(Stores.LATEST)
KIND = "sensor_msgs/msg/JointState"
MODEL = ta.HarmonicModel([ta.Shaft("output", 1, [1], [0.0], [0.01])])
COUNT = 12_000


def written(path, others):
    """Joint states, with another topic of unlike messages between them or without."""
    header, stamp = STORE.types["std_msgs/msg/Header"], STORE.types["builtin_interfaces/msg/Time"]
    text = STORE.types["std_msgs/msg/String"]
    with Writer(path, version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        joints = writer.add_connection("/joint_states", KIND, typestore=STORE)
        words = writer.add_connection("/log", "std_msgs/msg/String", typestore=STORE)
        for i in range(COUNT):
            message = STORE.types[KIND](
                header=header(stamp=stamp(sec=i, nanosec=0), frame_id="base"),
                name=["elbow", "wrist"],
                position=np.array([0.001 * i, 0.002 * i]),
                velocity=np.zeros(2),
                effort=np.zeros(2),
            )
            writer.write(joints, 1000 + 10 * i, bytes(STORE.serialize_cdr(message, KIND)))
            if others and i % 7 == 0:
                data = STORE.serialize_cdr(text(data="x" * (i % 50)), "std_msgs/msg/String")
                writer.write(words, 1003 + 10 * i, bytes(data))
    return path


def records(data, place=8):
    """Kind, place and content of every record behind the magic."""
    while place < len(data) - 8:
        kind, length = struct.unpack_from("<BQ", data, place)
        yield kind, place, data[place + 9 : place + 9 + length]
        place += 9 + length


@pytest.mark.parametrize("others", [False, True])
def test_every_chunk_is_where_its_index_says(others, tmp_path):
    source = written(tmp_path / "in", others)
    report = ta.correct_logs(source, {"elbow": MODEL}, tmp_path / "out")
    assert report.is_done, report.logs[0].error
    (file,) = (tmp_path / "out").glob("*.mcap")
    data = file.read_bytes()
    found = list(records(data))
    at = {place: (kind, body) for kind, place, body in found}
    chunks = {place: body for kind, place, body in found if kind == 0x06}
    assert len(chunks) >= 3
    told, counts = {}, Counter()
    for kind, _, body in found:
        if kind != 0x08:  # a chunk index
            continue
        first, last, start, length, size = struct.unpack_from("<QQQQI", body)
        offsets = dict(struct.iter_unpack("<HQ", body[36 : 36 + size]))
        index_length, text = struct.unpack_from("<QI", body, 36 + size)
        packed, unpacked = struct.unpack_from("<QQ", body, 48 + size + text)
        chunk = chunks[start]
        assert length == 9 + len(chunk)
        assert struct.unpack_from("<QQQ", chunk) == (first, last, unpacked)
        (compression,) = struct.unpack_from("<I", chunk, 28)
        (stored,) = struct.unpack_from("<Q", chunk, 32 + compression)
        assert (compression, stored, packed) == (text, packed, packed)
        assert packed == unpacked == len(chunk) - 40 - compression
        inside = chunk[40 + compression :]
        times, places = [], {}
        for sort, place, message in records(inside + b"\0" * 8, 0):
            if sort != 0x05:  # a schema or a channel
                assert sort in (0x03, 0x04)
                continue
            channel, _, time, published = struct.unpack_from("<HIQQ", message)
            assert published == time
            times.append(time)
            places.setdefault(channel, []).append((time, place))
            counts[channel] += 1
        assert (min(times), max(times)) == (first, last)
        behind = start + length
        assert sum(9 + len(at[place][1]) for place in offsets.values()) == index_length
        assert min(offsets.values()) == behind
        for channel, place in offsets.items():
            kind, entries = at[place]
            assert kind == 0x07
            number, bytes_ = struct.unpack_from("<HI", entries)
            assert (number, bytes_) == (channel, len(entries) - 6)
            assert list(struct.iter_unpack("<QQ", entries[6:])) == places[channel]
        told[start] = True
    assert told.keys() == chunks.keys()
    with Reader(tmp_path / "out") as reader:
        wanted = {c.topic: c.msgcount for c in reader.connections}
    assert wanted["/joint_states"] == wanted["/joint_states_corrected"] == COUNT
    assert sorted(counts.values()) == sorted(n for n in wanted.values() if n)
