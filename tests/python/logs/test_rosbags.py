"""ROS bags written by rosbags itself: joint states corrected, other topics untouched."""

import bz2
import tempfile
import tracemalloc
from pathlib import Path

import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import FileError
from trueangle.formats.formats import find_format

from .conftest import made_angles, made_model, unwrapped_truth

rosbags = pytest.importorskip("rosbags")

import lz4.frame  # noqa: E402
from rosbags import rosbag1, rosbag2  # noqa: E402
from rosbags.rosbag2 import CompressionFormat, CompressionMode, StoragePlugin  # noqa: E402
from rosbags.typesys import Stores, get_typestore  # noqa: E402

from trueangle.formats import unpacking  # noqa: E402

MESSAGES = 300
JOINTS = ["elbow", "wrist"]
ROS2 = get_typestore(Stores.LATEST)
ROS1 = get_typestore(Stores.ROS1_NOETIC)


def states(store, positions):
    """Joint states; every tenth without the wrist."""
    kinds = store.types
    header, time = kinds["std_msgs/msg/Header"], kinds["builtin_interfaces/msg/Time"]
    for i, row in enumerate(positions):
        names = JOINTS[:1] if i % 10 == 9 else JOINTS
        extra = {"seq": i} if "seq" in header.__dataclass_fields__ else {}
        yield kinds["sensor_msgs/msg/JointState"](
            header=header(stamp=time(sec=i, nanosec=0), frame_id="base", **extra),
            name=names,
            position=np.array(row[: len(names)]),
            velocity=np.full(len(names), 0.5),
            effort=np.zeros(0),
        )


@pytest.fixture
def positions():
    radians = np.radians([made_angles(MESSAGES, seed=1), made_angles(MESSAGES, seed=2)]).T
    return radians.copy()


def write_ros2(path, positions, storage, compression=None):
    writer = rosbag2.Writer(path, version=9, storage_plugin=storage)
    if compression is not None:
        writer.set_compression(compression, CompressionFormat.ZSTD)
    writer.set_custom_data("robot", "r7")
    with writer:
        joints = writer.add_connection(
            "/joint_states", "sensor_msgs/msg/JointState", typestore=ROS2
        )
        texts = writer.add_connection("/log", "std_msgs/msg/String", typestore=ROS2)
        text = ROS2.types["std_msgs/msg/String"]
        for i, state in enumerate(states(ROS2, positions)):
            data = ROS2.serialize_cdr(state, "sensor_msgs/msg/JointState")
            writer.write(joints, 10 * i, data)
            data = ROS2.serialize_cdr(text(data=f"line {i}"), "std_msgs/msg/String")
            writer.write(texts, 10 * i + 3, data)
    return path


def write_ros1(path, positions, compression=None):
    writer = rosbag1.Writer(path)
    if compression is not None:
        writer.set_compression(compression)
    with writer:
        kind = "sensor_msgs/msg/JointState"
        joints = writer.add_connection("/joint_states", kind, typestore=ROS1, latching=1)
        texts = writer.add_connection("/log", "std_msgs/msg/String", typestore=ROS1)
        text = ROS1.types["std_msgs/msg/String"]
        for i, state in enumerate(states(ROS1, positions)):
            writer.write(joints, 10 * i, ROS1.serialize_ros1(state, kind))
            data = ROS1.serialize_ros1(text(data=f"line {i}"), "std_msgs/msg/String")
            writer.write(texts, 10 * i + 3, data)
    return path


def messages(path):
    """Topic -> list of (time, bytes), and the way to decode joint states."""
    found = {}
    is_ros1 = path.suffix == ".bag"
    with rosbag1.Reader(path) if is_ros1 else rosbag2.Reader(path) as reader:
        for connection, time, data in reader.messages():
            found.setdefault(connection.topic, []).append((time, bytes(data)))
    decode = ROS1.deserialize_ros1 if is_ros1 else ROS2.deserialize_cdr
    return found, lambda data: decode(data, "sensor_msgs/msg/JointState")


BAGS = {
    "sqlite3": ("bag", lambda path, x: write_ros2(path, x, StoragePlugin.SQLITE3)),
    "mcap": ("bag", lambda path, x: write_ros2(path, x, StoragePlugin.MCAP)),
    "mcap, compressed": (
        "bag",
        lambda path, x: write_ros2(path, x, StoragePlugin.MCAP, CompressionMode.STORAGE),
    ),
    "sqlite3, compressed messages": (
        "bag",
        lambda path, x: write_ros2(path, x, StoragePlugin.SQLITE3, CompressionMode.MESSAGE),
    ),
    "sqlite3, compressed file": (
        "bag",
        lambda path, x: write_ros2(path, x, StoragePlugin.SQLITE3, CompressionMode.FILE),
    ),
    "ROS 1": ("a.bag", write_ros1),
    "ROS 1, compressed": (
        "a.bag",
        lambda path, x: write_ros1(path, x, rosbag1.Writer.CompressionFormat.LZ4),
    ),
}


@pytest.mark.parametrize("kind", BAGS)
@pytest.mark.parametrize("replace", [False, True])
def test_joint_states_are_corrected_and_other_topics_untouched(
    kind, replace, positions, tmp_path, monkeypatch
):
    monkeypatch.setattr("trueangle.formats.openbag.BLOCK", 71)
    name, write = BAGS[kind]
    source = write(tmp_path / name, positions)
    models = {"elbow": made_model(period=2 * np.pi), "wrist": made_model(argument="indicated")}
    target = tmp_path / f"out_{name}"
    topic = "/joint_states" if replace else "/joint_states_corrected"
    report = ta.correct_logs(source, models, target, output_topic=topic if replace else None)
    assert report.logs[0].error is None, report.logs[0].error
    assert report.logs[0].result["rows"] == MESSAGES
    before, decode = messages(source)
    after, _ = messages(target)
    assert after["/log"] == before["/log"]
    assert after.keys() == before.keys() | {topic}
    if not replace:
        assert after["/joint_states"] == before["/joint_states"]
    elbow = models["elbow"].correct(positions[:, 0])
    wrist = models["wrist"].correct(np.degrees(positions[:, 1])) * np.pi / 180
    for i, ((time, data), (time_before, given)) in enumerate(
        zip(after[topic], before["/joint_states"], strict=True)
    ):
        found, original = decode(data), decode(given)
        assert time == time_before
        assert (found.name, found.header) == (original.name, original.header)
        np.testing.assert_array_equal(found.velocity, original.velocity)
        expected = [elbow[i], wrist[i]][: len(found.name)]
        np.testing.assert_allclose(found.position, expected, rtol=0, atol=1e-14)


def test_the_kind_of_bag_is_kept(positions, tmp_path):
    models = {"elbow": made_model(period=2 * np.pi)}
    write_ros2(tmp_path / "a", positions, StoragePlugin.MCAP, CompressionMode.STORAGE)
    ta.correct_logs(tmp_path / "a", models, tmp_path / "b")
    assert [p.name for p in (tmp_path / "b").glob("*.mcap")] == ["b.mcap"]
    with rosbag2.Reader(tmp_path / "b") as reader:
        assert {c.compression for c in reader.storage.storages[0].chunks} == {"zstd"}
        custom = reader.storage.metadata.custom
        assert custom["robot"] == "r7"
        assert "model_sha256" in custom["trueangle"]
        qos = {c.topic: c.ext.offered_qos_profiles for c in reader.connections}
        assert qos["/joint_states"] == qos["/joint_states_corrected"]


@pytest.mark.parametrize("storage", list(StoragePlugin))
def test_single_files_stay_single_files(storage, positions, tmp_path):
    ending = ".mcap" if storage == StoragePlugin.MCAP else ".db3"
    (single,) = write_ros2(tmp_path / "a", positions, storage).glob(f"*{ending}")
    models = {"elbow": made_model(period=2 * np.pi)}
    target = tmp_path / f"b{ending}"
    assert ta.correct_logs(single, models, target).is_done
    assert target.is_file()
    assert len(messages(target)[0]["/joint_states_corrected"]) == MESSAGES


def test_bags_in_place_and_in_folders(positions, tmp_path):
    models = {"elbow": made_model(period=2 * np.pi)}
    folder = tmp_path / "bags"
    folder.mkdir()
    write_ros2(folder / "one", positions, StoragePlugin.SQLITE3)
    write_ros2(folder / "two", positions, StoragePlugin.MCAP)
    assert len(ta.correct_logs(folder, models, tmp_path / "out").logs) == 2
    report = ta.correct_logs(folder, models, in_place=True)
    assert report.is_done
    for name in ("one", "two"):
        assert messages(folder / name)[0] == messages(tmp_path / "out" / name)[0]
    assert {p.name for p in folder.iterdir()} == {"one", "two", "trueangle-manifest.jsonl"}


def test_turns_are_counted_over_messages(positions, tmp_path, monkeypatch):
    monkeypatch.setattr("trueangle.formats.openbag.BLOCK", 50)
    model = made_model(ratio=50.5, period=2 * np.pi)
    write_ros2(tmp_path / "a", positions, StoragePlugin.MCAP)
    ta.correct_logs(tmp_path / "a", {"elbow": model}, tmp_path / "b")
    found, decode = messages(tmp_path / "b")
    elbow = [decode(data).position[0] for _time, data in found["/joint_states_corrected"]]
    expected = unwrapped_truth(model, positions[:, 0])
    np.testing.assert_allclose(elbow, expected, rtol=0, atol=1e-12)


REFUSED = [
    ({"shoulder": 0}, {}, "no column of joint shoulder.*elbow, wrist"),
    ({"elbow": 0}, {"topic": "/other"}, "no JointState topic /other.*`topic=`.*/joint_states"),
    ({"elbow": 0}, {"output_topic": "/log"}, "/log is there already"),
]


@pytest.mark.parametrize(("joints", "more", "message"), REFUSED)
def test_refused_with_what_to_do(joints, more, message, positions, tmp_path):
    write_ros2(tmp_path / "a", positions, StoragePlugin.MCAP)
    models = dict.fromkeys(joints, made_model(period=2 * np.pi))
    report = ta.correct_logs(tmp_path / "a", models, tmp_path / "b", **more)
    with pytest.raises(ta.errors.FileError, match=message):
        raise report.logs[0].error
    assert not (tmp_path / "b").exists()


@pytest.mark.parametrize("kind", ["sqlite3", "mcap", "mcap, compressed", "ROS 1"])
def test_truncated_bags_are_refused(kind, positions, tmp_path):
    name, write = BAGS[kind]
    source = write(tmp_path / name, positions)
    (file,) = [source] if source.is_file() else [p for p in source.iterdir() if p.suffix != ".yaml"]
    file.write_bytes(file.read_bytes()[: file.stat().st_size * 2 // 3])
    models = {"elbow": made_model(period=2 * np.pi)}
    report = ta.correct_logs(source, models, tmp_path / f"out_{name}")
    assert isinstance(report.logs[0].error, ta.errors.FileError), report.logs[0]
    assert not (tmp_path / f"out_{name}").exists()


@pytest.mark.parametrize("storage", [StoragePlugin.MCAP, StoragePlugin.SQLITE3])
def test_a_bag_is_read_as_runs_with_the_times_of_its_messages(storage, tmp_path):
    turns = np.linspace(0.0, 12.0, MESSAGES)
    path = write_ros2(tmp_path / "bag", np.column_stack([turns, turns + 0.01]), storage)
    signals = {"reference": "elbow", "indicated": "wrist"}
    with pytest.warns(ta.errors.EmptyCellsWarning, match="30 of 300 rows"):
        (run,) = ta.read_runs(path, signals=signals)
    assert run.period == 2.0 * np.pi
    assert run.left_out == 30
    np.testing.assert_allclose(run.error, 0.01, atol=1e-9)
    np.testing.assert_array_equal(run.time[:5], np.arange(5.0))


@pytest.mark.parametrize(
    ("kind", "part"),
    [
        ("mcap, compressed", "chunk"),
        ("sqlite3, compressed messages", "message"),
        ("ROS 1, compressed", "chunk"),
    ],
)
def test_chunks_and_messages_are_unpacked_no_farther_than_the_budget(
    kind, part, tmp_path, positions, monkeypatch
):
    name, write = BAGS[kind]
    path = write(tmp_path / name, positions)
    columns = find_format(path).module.columns
    assert columns(path, None)[:2] == JOINTS[:2]
    monkeypatch.setattr("trueangle.formats.budget.DECODED_BYTES", 100)
    with pytest.raises(FileError, match=f"one {part} unpacks to .* at most 100 bytes"):
        columns(path, None)


def test_a_bag_of_packed_files_takes_no_more_of_the_disk_than_the_limit(
    tmp_path, positions, monkeypatch
):
    path = write_ros2(tmp_path / "bag", positions, StoragePlugin.SQLITE3, CompressionMode.FILE)
    (file,) = (p for p in path.iterdir() if p.suffix == ".zstd")
    work = tmp_path / "work"
    work.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(work))
    columns = find_format(path).module.columns
    before = columns(path, None)
    assert before[:2] == JOINTS[:2]
    size = len(unpacking.zstd.decompress(file.read_bytes()))
    monkeypatch.setenv("TRUEANGLE_UNPACKED_BYTES", str(size))
    assert columns(path, None) == before
    # Whatever its header says, and however often it is packed one after the other.
    file.write_bytes(file.read_bytes() + unpacking.zstd.compress(bytes(1 << 24)))
    with pytest.raises(FileError, match="set the variable TRUEANGLE_UNPACKED_BYTES") as told:
        columns(path, None)
    assert file.name in str(told.value)
    monkeypatch.setenv("TRUEANGLE_UNPACKED_BYTES", "1 GB")
    with pytest.raises(ta.errors.ArgumentError, match=r"must be a number of bytes.*got '1 GB'"):
        columns(path, None)
    assert list(work.iterdir()) == []


def test_packed_files_of_a_bag_share_the_limit(tmp_path, monkeypatch):
    """Three files of 100, 200 and 50 bytes need 350 together; one less, and nothing is left."""
    work = tmp_path / "work"
    work.mkdir()
    monkeypatch.setattr(tempfile, "tempdir", str(work))
    sizes = {"a.db3": 100, "b.db3": 200, "c.db3": 50}
    for name, size in sizes.items():
        (tmp_path / f"{name}.zstd").write_bytes(unpacking.zstd.compress(b"x" * size))
    names = "".join(f"  - {name}.zstd\n" for name in sizes)
    (tmp_path / "metadata.yaml").write_text(
        "rosbag2_bagfile_information:\n  compression_format: zstd\n  compression_mode: FILE\n"
        f"  relative_file_paths:\n{names}"
    )
    monkeypatch.setenv("TRUEANGLE_UNPACKED_BYTES", "350")
    folder = unpacking.unpacked_folder(tmp_path)
    assert folder is not None
    with folder:
        assert {name: Path(folder.name, name).stat().st_size for name in sizes} == sizes
    monkeypatch.setenv("TRUEANGLE_UNPACKED_BYTES", "349")
    with pytest.raises(
        FileError, match=r"above the limit of 349 bytes for the files of a bag"
    ) as told:
        unpacking.unpacked_folder(tmp_path)
    assert "c.db3.zstd" in str(told.value)
    assert list(work.iterdir()) == []


@pytest.mark.parametrize("codec", ["bz2", "lz4", "zstd"])
def test_a_part_that_unpacks_to_gigabytes_takes_no_more_than_the_budget(codec, monkeypatch):
    """Whatever its header says: the unpacking itself is bounded."""
    zeros = bytes(1 << 24)
    packed = {"bz2": bz2.compress, "lz4": lz4.frame.compress, "zstd": unpacking.zstd.compress}[
        codec
    ](zeros)
    assert unpacking.unpacked(Path("a.bag"), codec, "chunk", packed) == zeros
    with pytest.raises(EOFError, match="a chunk ends before its end"):
        unpacking.unpacked(Path("a.bag"), codec, "chunk", packed[:-10])
    monkeypatch.setattr("trueangle.formats.budget.DECODED_BYTES", 1 << 20)
    tracemalloc.start()
    with pytest.raises(FileError, match=r"unpacks to 1 MiB \(.*but at most 1 MiB"):
        unpacking.unpacked(Path("a.bag"), codec, "chunk", packed)
    assert tracemalloc.get_traced_memory()[1] < 4 << 20
    tracemalloc.stop()
