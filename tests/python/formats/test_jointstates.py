"""Joint states by the block, against messages that rosbags makes and reads."""

import struct

import numpy as np
import pytest

from trueangle.formats.jointstates import JointStateBlock

rosbags = pytest.importorskip("rosbags")

from rosbags.typesys import Stores, get_typestore  # noqa: E402

from trueangle.formats.mcapchunks import _messages  # noqa: E402

KIND = "sensor_msgs/msg/JointState"
STORES = {True: get_typestore(Stores.ROS1_NOETIC), False: get_typestore(Stores.LATEST)}
SEED = 9


def message(is_ros1, names, position, velocity=(), effort=(), frame="base", time=(3, 500_000_000)):
    kinds = STORES[is_ros1].types
    header = kinds["std_msgs/msg/Header"]
    extra = {"seq": 7} if is_ros1 else {}
    stamp = kinds["builtin_interfaces/msg/Time"](sec=time[0], nanosec=time[1])
    made = kinds[KIND](
        header=header(stamp=stamp, frame_id=frame, **extra),
        name=list(names),
        position=np.array(position, dtype=float),
        velocity=np.array(velocity, dtype=float),
        effort=np.array(effort, dtype=float),
    )
    store = STORES[is_ros1]
    return bytes((store.serialize_ros1 if is_ros1 else store.serialize_cdr)(made, KIND))


def decoded(is_ros1, data):
    store = STORES[is_ros1]
    return (store.deserialize_ros1 if is_ros1 else store.deserialize_cdr)(data, KIND)


def mixed(is_ros1):
    """Messages of several layouts, in turns."""
    return [
        message(is_ros1, ["elbow", "wrist"], [0.1, 0.2], [1.0, 2.0], [3.0, 4.0], time=(1, 0)),
        message(is_ros1, ["wrist", "elbow"], [0.3, 0.4], time=(2, 0)),
        message(is_ros1, ["elbow"], [0.5], [9.0], frame=""),
        message(is_ros1, ["elbow", "wrist"], [0.6, 0.7], [5.0, 6.0], [7.0, 8.0], time=(4, 1)),
        message(is_ros1, ["elbow", "wrist"], [], [5.0, 6.0]),
        message(is_ros1, ["elbow", "toe_5"], [0.8, 0.9], [5.0, 6.0], [7.0, 8.0]),
    ]


@pytest.mark.parametrize("is_ros1", [True, False])
def test_numbers_are_those_of_the_messages(is_ros1):
    block = JointStateBlock(mixed(is_ros1), is_ros1)
    assert block.joints == ["elbow", "wrist", "toe_5"]
    nan = np.nan
    np.testing.assert_array_equal(block.values("elbow", "position"), [0.1, 0.4, 0.5, 0.6, nan, 0.8])
    np.testing.assert_array_equal(block.values("wrist", "velocity"), [2.0, nan, nan, 6.0, 6.0, nan])
    np.testing.assert_array_equal(block.values("elbow", "effort"), [3.0, nan, nan, 7.0, nan, 7.0])
    np.testing.assert_allclose(block.times(), [1.0, 2.0, 3.5, 4.000000001, 3.5, 3.5], rtol=1e-15)


@pytest.mark.parametrize("is_ros1", [True, False])
def test_only_positions_change(is_ros1):
    given = mixed(is_ros1)
    wanted = np.arange(6.0)
    made = JointStateBlock(given, is_ros1).with_positions({"elbow": wanted, "nose": wanted})
    for i, (before, after) in enumerate(zip(given, made, strict=True)):
        old, new = decoded(is_ros1, before), decoded(is_ros1, after)
        assert new.name == old.name
        assert new.header == old.header
        for field in ("velocity", "effort"):
            np.testing.assert_array_equal(getattr(new, field), getattr(old, field))
        expected = dict(zip(old.name, old.position, strict=False))
        if "elbow" in expected:
            expected["elbow"] = float(i)
        assert dict(zip(new.name, new.position, strict=False)) == expected
        assert len(before) == len(after)


def test_big_endian_messages():
    body = struct.pack(">iI", 3, 0) + struct.pack(">I", 1) + b"\0" + b"\0\0\0"
    body += struct.pack(">I", 1) + struct.pack(">I", 2) + b"j\0" + b"\0\0"
    body += struct.pack(">I", 1)
    body += b"\0" * (-len(body) % 8) + struct.pack(">d", 0.25) + struct.pack(">II", 0, 0)
    block = JointStateBlock([b"\0\0\0\0" + body], is_ros1=False)
    assert block.values("j", "position") == [0.25]
    (made,) = block.with_positions({"j": np.array([0.5])})
    assert JointStateBlock([made], is_ros1=False).values("j", "position") == [0.5]
    np.testing.assert_array_equal(decoded(False, made).position, [0.5])


@pytest.mark.parametrize("is_ros1", [True, False])
def test_damaged_messages_are_refused_or_read(is_ros1):
    """Whatever bytes: an answer or one kind of error, and no message changes its length."""
    rng = np.random.default_rng(SEED)
    good = mixed(is_ros1)[0]
    for cut in range(len(good)):
        with pytest.raises(ValueError, match=r"cut short|plain CDR"):
            JointStateBlock([good[:cut]], is_ros1)
    refused = 0
    for _ in range(400):
        bad = bytearray(good)
        for place in rng.integers(len(bad), size=3):
            bad[place] = rng.integers(256)
        try:
            (made,) = JointStateBlock([bytes(bad)], is_ros1).with_positions({"elbow": np.zeros(1)})
        except ValueError:
            refused += 1
        else:
            assert len(made) == len(bad)
    assert 50 < refused < 400


def test_chunks_of_damaged_records_are_refused():
    record = struct.pack("<BQHIQQ", 5, 22 + 3, 1, 0, 10, 10) + b"abc"
    other = struct.pack("<BQ", 4, 2) + b"xy"
    assert list(_messages(other + record, {1: "c"})) == [("c", 10, b"abc")]
    assert list(_messages(other + record, {2: "c"})) == []
    longer = struct.pack("<BQHIQQ", 5, 1 << 40, 1, 0, 10, 10) + b"abc"
    shorter = struct.pack("<BQHIQQ", 5, 3, 1, 0, 10, 10) + b"abc"
    for bad in (record[:-1], other[:-1], longer, shorter, record + b"\5", record + b"\4" * 9):
        with pytest.raises(ValueError, match="beyond its chunk"):
            list(_messages(bad, {1: "c"}))


def test_a_bags_columns_are_the_fields_of_the_message():
    """Velocity in rad/s and effort in Nm, as sensor_msgs/JointState has them."""
    rosbag = pytest.importorskip("trueangle.formats.rosbag")

    class States:
        def values(self, joint, field):
            return joint, field

    for name, wanted in (
        ("elbow", ("elbow", "position")),
        ("elbow/velocity_rad_s", ("elbow", "velocity")),
        ("elbow/torque_Nm", ("elbow", "effort")),
    ):
        assert rosbag._values(States(), name, ["elbow"]) == wanted


@pytest.mark.parametrize(
    ("head", "taken"),
    [(b"\0\1\0\0", True), (b"\0\1\0\3", True), (b"\0\1\5\0", True), (b"\0\2\0\0", False),
     (b"\1\1\0\0", False), (b"\0\7\0\0", False)],
)  # fmt: skip
def test_plain_cdr_is_told_by_its_two_first_bytes(head, taken):
    """The two behind are options: padding at the end, or anything."""
    data = head + message(False, ["elbow"], [0.5], [1.5])[4:]
    if taken:
        assert JointStateBlock([data], False).values("elbow", "velocity").tolist() == [1.5]
        return
    with pytest.raises(ValueError, match="a joint state is not in plain CDR, which alone is under"):
        JointStateBlock([data], False)
