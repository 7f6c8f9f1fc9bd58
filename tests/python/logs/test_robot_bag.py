"""A robot of six joints in one ROS bag: check, fit, diagnose, correct, report, a command each."""

from __future__ import annotations

import json

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main

rosbags = pytest.importorskip("rosbags")

from rosbags.rosbag2 import Reader, StoragePlugin, Writer  # noqa: E402
from rosbags.typesys import Stores, get_typestore  # noqa: E402

STORE = get_typestore(Stores.LATEST)
KIND = "sensor_msgs/msg/JointState"
#: Order 1 of every joint, arcsec; the last is turned along by the one before.
SIZES = {"j1": 40.0, "j2": 90.0, "j3": 15.0, "j4": 60.0, "j5": 25.0, "j6": 30.0}
FACTOR = 0.08
NOISE = 2.0
ROWS = 900


def truth():
    """Angles of all joints, degrees: each goes there and back at a pace of its own."""
    share = np.linspace(0.0, 1.0, ROWS)
    return {
        name: 200.0 * np.sin(2.0 * np.pi * ((1.0 + 0.37 * j) * share + 0.1 * j))
        for j, name in enumerate(SIZES)
    }


def read(true):
    """What the encoders say, degrees."""
    rng = np.random.default_rng(81)
    print("seed 81")
    found = {}
    for j, (name, size) in enumerate(SIZES.items()):
        error = size * np.sin(np.radians(true[name]) + j) + rng.normal(0.0, NOISE, ROWS)
        found[name] = true[name] + error / 3600.0
    found["j6"] = found["j6"] + FACTOR * found["j5"]
    return found


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    """A folder with the bag and its robot file."""
    folder = tmp_path_factory.mktemp("arm")
    true = truth()
    said = read(true)
    kinds = STORE.types
    header, time = kinds["std_msgs/msg/Header"], kinds["builtin_interfaces/msg/Time"]
    names = [*SIZES, *(f"{name}_laser" for name in SIZES)]
    values = np.radians(np.column_stack([*said.values(), *true.values()]))
    with Writer(folder / "bag", version=9, storage_plugin=StoragePlugin.MCAP) as writer:
        topic = writer.add_connection("/joint_states", KIND, typestore=STORE)
        for i, row in enumerate(values):
            at = 20_000_000 * i
            stamp = time(sec=at // 10**9, nanosec=at % 10**9)
            state = kinds[KIND](
                header=header(stamp=stamp, frame_id="base"),
                name=names,
                position=row,
                velocity=np.zeros(0),
                effort=np.zeros(0),
            )
            writer.write(topic, at, STORE.serialize_cdr(state, KIND))
    joints = (
        f'[[joint]]\nname = "{name}"\ngear_ratio = {100.0 + j}\n[joint.signals]\n'
        f'indicated = "{name}:rad"\nreference = "{name}_laser:rad"\ntime = "time_s"\n'
        for j, name in enumerate(SIZES)
    )
    (folder / "robot.toml").write_text('[robot]\nname = "arm"\n' + "".join(joints))
    return folder


def asked(arm, capsys, command, *options):
    """What a command about the bag prints; it succeeds."""
    capsys.readouterr()
    status = main([command, str(arm / "bag"), *options])
    out, err = capsys.readouterr()
    assert status == 0, err
    return out


def test_every_job_is_one_command(arm, capsys):
    robot = ("--robot", str(arm / "robot.toml"))
    checked = json.loads(asked(arm, capsys, "check", *robot, "--json"))
    assert list(checked["joints"]) == list(SIZES)
    assert checked["ranking"][0]["joint"] == "j6"

    better = arm / "better.json"
    found = json.loads(
        asked(arm, capsys, "diagnose", *robot, "--json", "--corrected-model", str(better))
    )
    assert list(found["joints"]) == list(SIZES)
    (coupling,) = [
        finding
        for finding in found["joints"]["j6"]["findings"]
        if finding["cause"] == "joint_coupling"
    ]
    assert coupling["status"] == "confirmed"
    assert coupling["parameters"]["joint"]["value"] == "j5"
    factor = coupling["parameters"]["factor"]
    assert abs(factor["value"] - FACTOR) < 4.0 * factor["std"]
    for name in list(SIZES)[:5]:
        causes = {f["cause"] for f in found["joints"][name]["findings"]}
        assert "joint_coupling" not in causes, name

    out = arm / "corrected"
    asked(arm, capsys, "correct", "-m", str(better), "-o", str(out))
    check_corrected(out)

    fitted = arm / "fitted.json"
    asked(arm, capsys, "fit", *robot, "--orders", "1,2", "-o", str(fitted))
    assert ta.load_robot(fitted).joints == tuple(SIZES)

    page = arm / "report.html"
    asked(arm, capsys, "report", *robot, "-o", str(page))
    text = page.read_text()
    assert all(name in text for name in SIZES)


def check_corrected(path):
    """Every joint is within its noise, the coupled one too."""
    true, rows = truth(), []
    with Reader(path) as reader:
        topics = [c for c in reader.connections if c.topic.endswith("corrected")]
        for _, _, data in reader.messages(topics):
            state = STORE.deserialize_cdr(data, KIND)
            rows.append(dict(zip(state.name, state.position, strict=True)))
    assert len(rows) == ROWS
    for name, angle in true.items():
        left = np.degrees([row[name] for row in rows]) - angle
        assert np.std(left) * 3600.0 < 1.3 * NOISE, name
