"""Messages taken as rows of bytes give the very file that they give one by one."""

import struct

import numpy as np
import pytest

import trueangle as ta

pytest.importorskip("rosbags")

from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin
from rosbags.rosbag2 import Reader as PlainReader
from rosbags.rosbag2 import Writer as PlainWriter
from rosbags.typesys import Stores, get_typestore

from trueangle.formats import openbag
from trueangle.formats.mcapchunks import RecordRows, interleaved_rows

SEED = 33
STORE = get_typestore(Stores.LATEST)
KIND = "sensor_msgs/msg/JointState"
#: Three chunks of some megabyte, so that messages stand over their ends.
MESSAGES = 15_000
MODEL = ta.HarmonicModel([ta.Shaft("output", 1, [1, 2], [1e-3, 0.0], [0.0, 2e-3])])


def bag(path, later=(), compressed=False, topics=("/joint_states",)):
    """Joint states of two joints; some of them logged late, others without a wrist."""
    rng = np.random.default_rng(SEED)
    angles = np.mod(np.cumsum(rng.uniform(0.0, 0.002, (MESSAGES, 2)), 0), 2 * np.pi)
    types = STORE.types
    time, header = types["builtin_interfaces/msg/Time"], types["std_msgs/msg/Header"]
    writer = PlainWriter(path, version=9, storage_plugin=StoragePlugin.MCAP)
    if compressed:
        writer.set_compression(CompressionMode.STORAGE, CompressionFormat.ZSTD)
    with writer:
        connections = [writer.add_connection(t, KIND, typestore=STORE) for t in topics]
        for i, position in enumerate(angles):
            count = 1 if i in later else 2
            state = types[KIND](
                header=header(stamp=time(sec=i, nanosec=0), frame_id="base"),
                name=["elbow", "wrist"][:count],
                position=position[:count],
                velocity=np.zeros(count),
                effort=np.zeros(0),
            )
            stamp = i * 1000 - (5000 if i in later else 0)
            for connection in connections:
                writer.write(connection, stamp, bytes(STORE.serialize_cdr(state, KIND)))
    return path


def contents(path):
    with PlainReader(path) as reader:
        return [(c.topic, t, bytes(data)) for c, t, data in reader.messages()]


CASES = {
    "one chunk like the other": {},
    "compressed": {"compressed": True},
    "unlike lengths and late messages in the second chunk": {"later": (7000, 7001)},
    "two topics": {"topics": ("/joint_states", "/other")},
}


@pytest.mark.parametrize("case", CASES)
@pytest.mark.parametrize("output", [None, "/joint_states"])
def test_rows_give_the_file_that_single_messages_give(case, output, tmp_path, monkeypatch):
    source = bag(tmp_path / "bag", **CASES[case])
    made = []
    for name, by_rows in (("a", True), ("b", False)):
        if not by_rows:
            monkeypatch.setattr(openbag, "_chunked", lambda reader: iter(()))
        target = tmp_path / name
        models = {"elbow": MODEL, "wrist": MODEL}
        columns = {joint: joint for joint in models}
        options = {"topic": "/joint_states", "output_topic": output}
        ta.correct_logs(source, models, target, column=columns, **options)
        made.append(contents(target))
        (file,) = target.glob("*.mcap")
        made.append(file.stat().st_size)
    assert made[0] == made[2]
    assert made[1] == made[3]
    assert len(made[0]) == MESSAGES * (len(CASES[case].get("topics", "1")) + (output is None))


def record(channel, time, text, kind=5):
    return struct.pack("<BQHIQQ", kind, 22 + len(text), channel, 7, time, time - 1) + text


def test_only_records_that_are_alike_are_rows():
    alike = record(1, 10, b"abc") + record(1, 10, b"xyz") + record(1, 20, b"ijk")
    (rows,) = RecordRows.of_chunk(alike)
    assert rows.channel == 1
    assert rows.times.tolist() == [10, 10, 20]
    assert rows.messages.tobytes() == b"abcxyzijk"
    other = alike + record(2, 30, b"opq")
    assert RecordRows.of_chunk(other) is None
    assert [part.channel for part in RecordRows.of_chunk(other, mixed=True)] == [1, 2]
    for bad in (
        b"",
        alike[:-1],
        alike + record(1, 5, b"abc"),  # earlier
        alike + record(1, 30, b"abcd"),
        alike + record(1, 30, b"abc", kind=4),
        struct.pack("<BQ", 5, 3) + b"abc" * 20,  # shorter than a head
    ):
        assert RecordRows.of_chunk(bad, mixed=True) is None


def test_rows_are_written_row_by_row_on_their_channels():
    (rows,) = RecordRows.of_chunk(record(1, 10, b"abc") + record(1, 20, b"xyz"))
    made = interleaved_rows([(3, rows), (4, rows.with_messages(rows.messages + np.uint8(1)))])
    heads = [struct.unpack_from("<BQHIQQ", row) for row in made.records]
    assert [head[2:] for head in heads] == [
        (3, 0, 10, 10),
        (4, 0, 10, 10),
        (3, 0, 20, 20),
        (4, 0, 20, 20),
    ]
    assert made.messages.tobytes() == b"abcbcdxyzyz{"
