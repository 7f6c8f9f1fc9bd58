"""A bag that was corrected is known by itself, wherever it goes: it is not corrected again."""

import shutil

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main

from .conftest import made_model

pytest.importorskip("rosbags")

from rosbags.rosbag2 import StoragePlugin
from ruamel.yaml import YAML

from .test_rosbags import BAGS, messages, positions, write_ros1, write_ros2  # noqa: F401


def single(storage, ending):
    def write(path, x):
        (made,) = write_ros2(path.with_name("made"), x, storage).glob(f"*{ending}")
        made.rename(path)
        shutil.rmtree(made.parent)
        return path

    return f"a{ending}", write


KINDS = {
    **BAGS,
    "sqlite3, a file": single(StoragePlugin.SQLITE3, ".db3"),
    "mcap, a file": single(StoragePlugin.MCAP, ".mcap"),
}


@pytest.fixture
def model_file(tmp_path):
    made_model(period=2 * np.pi).save(tmp_path / "elbow.json")
    return tmp_path / "elbow.json"


def command(log, model_file, *more):
    return ["correct", str(log), "-m", str(model_file), "--column", "elbow", *map(str, more)]


def values(path, topic="/joint_states"):
    found, decode = messages(path)
    return np.array([decode(data).position[0] for _time, data in found[topic]])


@pytest.mark.parametrize("way", ["in place", "to another"])
@pytest.mark.parametrize("kind", KINDS)
def test_positions_are_corrected_once(kind, way, positions, model_file, tmp_path, capsys):  # noqa: F811
    name, write = KINDS[kind]
    log = write(tmp_path / name, positions)
    replaced = ("--output-topic", "/joint_states")
    if way == "in place":
        assert main(command(log, model_file, "--in-place", *replaced)) == 0
    else:
        assert main(command(log, model_file, "-o", tmp_path / f"2{name}", *replaced)) == 0
        log = tmp_path / f"2{name}"
    once = values(log)
    expected = ta.load_model(model_file).correct(positions[:, 0])
    np.testing.assert_allclose(once, expected, rtol=0, atol=1e-14)
    # Copied, under another name, with another model, to another topic: it is known.
    copied = tmp_path / f"copy_{name}"
    (shutil.copytree if log.is_dir() else shutil.copy)(log, copied)
    made_model(period=2 * np.pi, argument="indicated").save(tmp_path / "other.json")
    for model in (model_file, tmp_path / "other.json"):
        for more in (("--in-place",), ("-o", tmp_path / f"3{name}")):
            for topic in (replaced, ("--output-topic", "/better"), ()):
                capsys.readouterr()
                assert main(command(copied, model, *more, *topic)) == 1
                told = capsys.readouterr().err
                assert "corrected before" in told
                assert "elbow.json" in told
                assert told.count("\n") == 1
    np.testing.assert_array_equal(values(copied), once)
    assert not (tmp_path / f"3{name}").exists()


@pytest.mark.parametrize("kind", KINDS)
def test_another_joint_of_the_same_topic_is_still_to_be_corrected(kind, positions, tmp_path):  # noqa: F811
    name, write = KINDS[kind]
    log = write(tmp_path / name, positions)
    model = made_model(period=2 * np.pi)
    for joint in ("elbow", "wrist"):
        report = ta.correct_logs(log, {joint: model}, in_place=True, output_topic="/joint_states")
        assert report.is_done, report.logs[0].error
    for joint in ("elbow", "wrist"):
        report = ta.correct_logs(log, {joint: model}, in_place=True, output_topic="/joint_states")
        assert "corrected before" in str(report.logs[0].error)
        assert joint in str(report.logs[0].error)


@pytest.mark.parametrize("kind", KINDS)
def test_the_corrected_topic_is_no_recorded_one(kind, positions, model_file, tmp_path, capsys):  # noqa: F811
    name, write = KINDS[kind]
    log = write(tmp_path / name, positions)
    out = tmp_path / f"2{name}"
    assert main(command(log, model_file, "-o", out)) == 0
    again = command(out, model_file, "-o", tmp_path / f"3{name}")
    assert main([*again, "--topic", "/joint_states_corrected"]) == 1
    assert "corrected before" in capsys.readouterr().err
    # What was recorded is beside it, and is found without its name.
    assert main(again) == 1
    assert "/joint_states_corrected is there already" in capsys.readouterr().err
    assert main([*again, "--output-topic", "/second"]) == 0
    np.testing.assert_array_equal(
        values(tmp_path / f"3{name}", "/second"), values(out, "/joint_states_corrected")
    )


@pytest.mark.parametrize("storage", list(StoragePlugin))
def test_the_note_is_inside_the_storage_file_too(storage, positions, tmp_path):  # noqa: F811
    """A file taken out of its folder, and a folder whose metadata were made anew."""
    model = {"elbow": made_model(period=2 * np.pi)}
    log = write_ros2(tmp_path / "bag", positions, storage)
    assert ta.correct_logs(log, model, in_place=True, output_topic="/joint_states").is_done
    (file,) = (path for path in log.iterdir() if path.name != "metadata.yaml")
    shutil.copy(file, tmp_path / file.name)
    told = YAML(typ="safe").load(log / "metadata.yaml")
    told["rosbag2_bagfile_information"]["custom_data"] = {}
    YAML().dump(told, log / "metadata.yaml")
    for path in (log, tmp_path / file.name):
        report = ta.correct_logs(path, model, in_place=True, output_topic="/joint_states")
        assert "corrected before" in str(report.logs[0].error), path


def test_the_caller_of_a_connection_stays_in_its_note(positions, tmp_path):  # noqa: F811
    import json

    from rosbags import rosbag1

    log = write_ros1(tmp_path / "a.bag", positions)
    with rosbag1.Reader(log) as reader, rosbag1.Writer(tmp_path / "b.bag") as writer:
        ids = {}
        for c in reader.connections:
            ids[c.id] = writer.add_connection(
                c.topic, c.msgtype, msgdef=c.msgdef.data, md5sum=c.digest, callerid="/driver"
            )
        for c, time, data in reader.messages():
            writer.write(ids[c.id], time, data)
    model = {"elbow": made_model(period=2 * np.pi)}
    done = ta.correct_logs(
        tmp_path / "b.bag", model, tmp_path / "c.bag", output_topic="/joint_states"
    )
    assert done.is_done
    with rosbag1.Reader(tmp_path / "c.bag") as reader:
        callers = {c.topic: c.ext.callerid for c in reader.connections}
    assert callers["/log"] == "/driver"
    assert json.loads(callers["/joint_states"])["callerid"] == "/driver"


@pytest.mark.parametrize("kind", ["CSV", "numpy"])
def test_a_table_without_names_is_corrected_once(kind, tmp_path, capsys):
    made_model().save(tmp_path / "m.json")
    angles = np.random.default_rng(3).uniform(0.0, 360.0, (50, 2))
    log = tmp_path / ("a.csv" if kind == "CSV" else "a.npy")
    if kind == "CSV":
        log.write_text("".join(f"{a!r},{b!r}\n" for a, b in angles.tolist()))
    else:
        np.save(log, angles)
    asked = ["correct", str(log), "-m", str(tmp_path / "m.json"), "--in-place"]
    asked += ["--column", "column2", "--unit", "deg"]
    assert main(asked) == 0
    once = log.read_bytes()
    capsys.readouterr()
    assert main(asked) == 1
    assert "corrected before" in capsys.readouterr().err
    assert log.read_bytes() == once
    assert main([*asked[:-3], "column1", *asked[-2:]]) == 0  # another column of it
