"""Commands about every joint of a robot: one log, one command each."""

import html
import json
import re

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import build_parser, main
from trueangle.cli.robots import joints_asked
from trueangle.joint.description import load_description

#: Order 1 of the error of each joint, arcsec.
SIZES = {"shoulder": 40.0, "elbow": 90.0, "wrist": 5.0}
NOISE = 1.0
URDF = """<?xml version="1.0"?>
<robot name="arm">
  <joint name="base" type="fixed"/>
  {joints}
  <joint name="finger" type="revolute"><mimic joint="wrist"/></joint>
</robot>
"""
TURNING = """<joint name="{0}" type="revolute"/>
  <transmission name="t"><joint name="{0}"/><actuator name="m">
    <mechanicalReduction>{1}</mechanicalReduction></actuator></transmission>"""


@pytest.fixture(scope="module")
def arm(tmp_path_factory):
    """A folder with a log of three joints and the robot file of them."""
    folder = tmp_path_factory.mktemp("arm")
    rng = np.random.default_rng(71)
    print("seed 71")
    columns = {"time_s": np.arange(1200) * 0.01}
    for j, (name, size) in enumerate(SIZES.items()):
        true = np.linspace(0.0, 360.0 * (j + 2), 1200, endpoint=False)
        error = size * np.sin(np.radians(true) + j) + rng.normal(0.0, NOISE, true.size)
        columns[f"laser {name} [deg]"] = true
        columns[f"q_{name}"] = np.radians(true + error / 3600.0)
    columns["idle"] = np.radians(true + rng.normal(0.0, NOISE, true.size) / 3600.0)
    rows = np.column_stack(list(columns.values()))
    header = ",".join(columns)
    np.savetxt(folder / "arm.csv", rows, "%.12f", ",", header=header, comments="")
    joints = "\n  ".join(TURNING.format(name, -50 - i) for i, name in enumerate(SIZES))
    (folder / "arm.urdf").write_text(URDF.format(joints=joints))
    assert (
        main(["robot", "--from-urdf", str(folder / "arm.urdf"), "-o", str(folder / "u.toml")]) == 0
    )
    text = (folder / "u.toml").read_text()
    for name in SIZES:
        column = f'indicated = "q_{name}:rad"\nreference = "laser {name} [deg]"'
        text = text.replace(f'indicated = "{name}:rad"', column)
    (folder / "robot.toml").write_text(text)
    return folder


def asked(arm, command, *options, capsys):
    """Status and what the command printed as JSON."""
    capsys.readouterr()
    status = main([command, str(arm / "arm.csv"), "--robot", str(arm / "robot.toml"), *options])
    out, err = capsys.readouterr()
    return status, out, err


def test_a_urdf_names_joints_and_ratios(arm):
    text = (arm / "u.toml").read_text()
    assert text.startswith('[robot]\nname = "arm"\n')
    assert [line for line in text.splitlines() if line.startswith("name")][1:] == [
        f'name = "{name}"' for name in SIZES
    ]
    assert [line for line in text.splitlines() if line.startswith("gear")] == [
        f"gear_ratio = {-50.0 - i}" for i in range(3)
    ]
    assert "finger" not in text
    assert "base" not in text


@pytest.mark.parametrize(
    ("text", "says"),
    [
        ("<robot", "is not XML"),
        ("<a/>", "begins with <a>, not with <robot>"),
        ("<robot/>", "names no joint that turns"),
        ('<!DOCTYPE robot [<!ENTITY a "b">]><robot/>', "declares a document type"),
        (URDF.format(joints=TURNING.format("a", "x")), "mechanicalReduction must be a number"),
    ],
)
def test_what_is_no_urdf_is_refused_in_words(text, says, tmp_path, capsys):
    (tmp_path / "a.urdf").write_text(text)
    out = tmp_path / "r.toml"
    assert main(["robot", "--from-urdf", str(tmp_path / "a.urdf"), "-o", str(out)]) == 1
    assert says in capsys.readouterr().err
    assert not out.exists()


@pytest.mark.parametrize(
    ("names", "says"),
    [
        (["left.hip", "left=knee", "del\x7f", 'q"\\', "à b"], None),
        (["hip", "knee", "hip"], "two joints are called 'hip': rename one"),
        (["l.hip", "l_hip"], "two joints are called 'l_hip': rename one"),
        ([f"j{k}" for k in range(257)], "holds 257 [[joint]] tables; at most 256 are allowed"),
    ],
)
def test_a_robot_file_that_is_written_can_be_read(names, says, tmp_path, capsys):
    """Each of these was written with status 0, and refused by the next command."""
    joints = "".join(TURNING.format(html.escape(name), 36) for name in names)
    urdf, out = tmp_path / "a.urdf", tmp_path / "r.toml"
    urdf.write_text(URDF.format(joints=joints), encoding="utf-8")
    status = main(["robot", "--from-urdf", str(urdf), "-o", str(out)])
    printed = capsys.readouterr()
    if says is not None:
        assert (status, out.exists()) == (1, False)
        assert "a.urdf" in printed.err
        assert says in printed.err
        return
    assert status == 0
    assert "left_hip ('left.hip' in the URDF): ratio 36\nleft_knee ('left=knee'" in printed.out
    read = load_description(out).joints
    assert [joint.name for joint in read] == ["left_hip", "left_knee", *names[2:]]
    assert [joint.signals["indicated"] for joint in read] == [f"{name}:rad" for name in names]


@pytest.mark.parametrize("command", ["check", "diagnose"])
def test_the_worst_joint_comes_first(command, arm, capsys):
    options = ["--within", "20s"] if command == "diagnose" else []
    status, out, _ = asked(arm, command, "--json", *options, capsys=capsys)
    found = json.loads(out)
    assert status == 0
    assert list(found["joints"]) == list(SIZES)
    ranking = found["ranking"]
    assert [row["joint"] for row in ranking] == ["elbow", "shoulder", "wrist"]
    for row in ranking:
        size = SIZES[row["joint"]]
        assert row["peak_to_peak_before_arcsec"] == pytest.approx(2.0 * size, abs=8.0 * NOISE)
    if command == "diagnose":
        assert [row["first_cause"] for row in ranking[:2]] == ["missing_order"] * 2
        assert all(row["rms_left_arcsec"] < 1.2 * NOISE for row in ranking)


def test_one_command_each_from_a_log_to_its_correction(arm, capsys):
    model, out = arm / "robot.json", arm / "out.csv"
    status, text, _ = asked(
        arm, "fit", "--orders", "1,2", "-o", str(model), "--json", capsys=capsys
    )
    found = json.loads(text)
    assert status == 0
    assert [row["joint"] for row in found["ranking"]] == ["elbow", "shoulder", "wrist"]
    robot = ta.load_robot(model)
    assert (robot.name, robot.joints) == ("arm", tuple(SIZES))
    for name, size in SIZES.items():
        alone = ta.fit(
            ta.read_runs(
                arm / "arm.csv",
                signals={"reference": f"laser {name} [deg]", "indicated": (f"q_{name}", "rad")},
            ),
            orders=[1, 2],
            gear_ratio=50.0,
        )
        assert robot[name].shafts == alone.model.shafts
        amplitude = found["joints"][name]["orders"][0]["amplitude_arcsec"]
        assert amplitude == pytest.approx(size, abs=5.0 * NOISE / 600.0**0.5)
    assert main(["correct", str(arm / "arm.csv"), "-m", str(model), "-o", str(out)]) == 0
    runs = {
        name: ta.read_runs(
            out,
            signals={
                "reference": f"laser {name} [deg]",
                "indicated": (f"{name}_corrected_rad", "rad"),
            },
        )[0]
        for name in SIZES
    }
    for run in runs.values():
        assert float(np.std(run.error)) * 3600.0 < 1.1 * NOISE


def test_a_joint_alone_and_joints_by_signals(arm, capsys):
    wanted = asked(arm, "orders", "--json", "--joint", "elbow", capsys=capsys)[1]
    assert list(json.loads(wanted)["joints"]) == ["elbow"]
    given = []
    for name in ("elbow", "wrist"):
        given += ["--signal", f"{name}.reference=laser {name} [deg]"]
        given += ["--signal", f"{name}.indicated=q_{name}:rad"]
    capsys.readouterr()
    assert main(["check", str(arm / "arm.csv"), *given, "--json"]) == 0
    found = json.loads(capsys.readouterr().out)
    assert list(found["joints"]) == ["elbow", "wrist"]


def test_a_report_has_a_page_in_front_and_a_section_for_every_joint(arm, capsys):
    page = arm / "report.html"
    status, out, _ = asked(arm, "report", "--orders", "1", "-o", str(page), "--json", capsys=capsys)
    assert status == 0
    ranking = json.loads(out)["ranking"]
    text = page.read_text()
    assert text.index(">elbow</a>") < text.index(">shoulder</a>") < text.index(">wrist</a>")
    assert text.count("<iframe") == len(ranking) == 3
    assert 'title="report on wrist"' in text
    # A title that is given is that of the whole: every section keeps its joint's name.
    given = ["--title", "Arm of cell 7", "-o", str(page), "--json"]
    assert asked(arm, "report", "--orders", "1", *given, capsys=capsys)[0] == 0
    text = html.unescape(page.read_text())
    assert re.findall("<h1>(.*?)</h1>", text) == ["Arm of cell 7", "elbow", "shoulder", "wrist"]


def test_a_joint_whose_readings_support_nothing_does_not_stop_the_others(arm, tmp_path, capsys):
    text = (arm / "robot.toml").read_text()
    (tmp_path / "robot.toml").write_text(text.replace("q_wrist:rad", "idle:rad"))
    out = tmp_path / "robot.json"
    robot = ["--robot", str(tmp_path / "robot.toml"), "-o", str(out), "--json"]
    assert main(["fit", str(arm / "arm.csv"), *robot]) == 0
    printed = capsys.readouterr()
    assert "joint wrist: no model: " in printed.err
    assert json.loads(printed.out)["ranking"][0]["verdict"].startswith("no model: ")
    assert ta.load_robot(out).joints == ("shoulder", "elbow")


@pytest.mark.parametrize(
    ("options", "says"),
    [
        (["--joint", "elbo"], "did you mean elbow?"),
        (["--gear-ratio", "3"], "--gear-ratio with --robot: the robot file states it"),
        (["--signal", "knee.torque=tau"], "no joint 'knee'; the joints are shoulder, elbow, wrist"),
    ],
)
def test_wrong_options_beside_a_robot_are_named(options, says, arm, capsys):
    status, _, err = asked(arm, "orders", *options, capsys=capsys)
    assert status == 1
    assert says in err


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("[robot]", "[robots]", "key 'robots': is unknown; the keys are robot, joint"),
        ('name = "elbow"', 'name = "wrist"', "two joints are called 'wrist'"),
        ("gear_ratio = -51.0", "gear_ratio = 0.0", "key 'joint[1].gear_ratio': must not be 0"),
        ("reference = ", "refrence = ", "no column has the role 'refrence'"),
        ("fixed_member", "fixed_part", "'joint[0].fixed_part': is unknown"),
        ('name = "arm"', "name = arm", "not a TOML file"),
    ],
)
def test_a_robot_file_that_is_wrong_says_where(old, new, says, arm, tmp_path, capsys):
    text = (arm / "robot.toml").read_text()
    (tmp_path / "r.toml").write_text(text.replace(old, new))
    assert main(["check", str(arm / "arm.csv"), "--robot", str(tmp_path / "r.toml")]) == 1
    assert says in capsys.readouterr().err


def test_the_file_that_is_written_is_the_one_that_was_read(arm, tmp_path):
    from trueangle.joint.description import load_description

    robot = load_description(arm / "robot.toml")
    robot.save(tmp_path / "again.toml")
    assert load_description(tmp_path / "again.toml") == robot


@pytest.mark.parametrize(
    ("header", "joints"),
    [
        ("t,laser1 [deg],q1,laser2 [deg],q2,tau2", {"joint1": 2, "joint2": 3}),
        ("time_s,elbow_laser,elbow_position,wrist_ref,wrist_position", {"elbow": 2, "wrist": 2}),
        ("stamp,ElbowPos,ElbowTrueAngle,elbow_effort", {"elbow": 3}),
        ("joint1/position,joint1/reference,joint1/velocity", {"joint1": 3}),
    ],
)
def test_a_log_of_unknown_columns_is_told_by_their_names(header, joints, tmp_path, capsys):
    log = tmp_path / "arm.csv"
    log.write_text(f"{header}\n" + ",".join("0" for _ in header.split(",")) + "\n")
    assert main(["check", str(log), "--json"]) == 1
    out, err = capsys.readouterr()
    assert "no column reference_deg" in err
    found = json.loads(out)
    assert {joint: len(roles) for joint, roles in found["joints"].items()} == joints
    assert main(["check", str(log)]) == 1
    assert f"--signal {next(iter(joints))}." in capsys.readouterr().out.replace("'", "")


def test_the_signals_that_are_printed_are_those_that_are_taken(arm, capsys):
    log = arm / "arm.csv"
    assert main(["check", str(log), "--json"]) == 1
    found = json.loads(capsys.readouterr().out)
    assert list(found["joints"]) == list(SIZES)
    given = [text.replace(":UNIT", ":rad") for text in found["signal"]]
    options = [part for text in given for part in ("--signal", text)]
    assert main(["check", str(log), *options, "--json"]) == 0
    assert list(json.loads(capsys.readouterr().out)["joints"]) == list(SIZES)


def test_columns_that_tell_of_no_joint_are_left_to_the_error(tmp_path, capsys):
    (tmp_path / "a.csv").write_text("foo,bar\n1,2\n")
    assert main(["check", str(tmp_path / "a.csv")]) == 1
    out, err = capsys.readouterr()
    assert (out, "no column reference_deg" in err) == ("", True)


def test_the_page_of_all_joints_is_smaller_than_their_pages(arm, tmp_path):
    pytest.importorskip("matplotlib")
    page = tmp_path / "arm.html"
    command = ["report", str(arm / "arm.csv"), "--robot", str(arm / "robot.toml")]
    assert main([*command, "-o", str(page)]) == 0
    one = tmp_path / "one.html"
    assert main([*command, "--joint", "elbow", "-o", str(one)]) == 0
    sizes = page.stat().st_size, one.stat().st_size
    print(sizes)
    # Style and script are there once.
    assert sizes[0] < 2.95 * sizes[1]


def test_a_log_is_read_once_for_all_joints(arm, capsys, monkeypatch):
    from trueangle.runs import readings

    read, calls = readings._joined, []
    monkeypatch.setattr(readings, "_joined", lambda *given: calls.append(given) or read(*given))
    assert asked(arm, "check", capsys=capsys)[0] == 0
    assert len(calls) == 1
    # One joint after the other gives the same.
    _, together, _ = asked(arm, "check", "--json", capsys=capsys)
    for name in SIZES:
        _, alone, _ = asked(arm, "check", "--joint", name, "--json", capsys=capsys)
        assert json.loads(alone)["joints"][name] == json.loads(together)["joints"][name]
    assert len(calls) == 2 + len(SIZES)


def test_the_file_of_a_robot_is_a_model_of_each_joint(arm, tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert asked(arm, "fit", "--orders", "1", "-o", "robot.json", capsys=capsys)[0] == 0
    robot = ta.load_robot("robot.json")
    robot["elbow"].save("elbow.json")

    def said(*command):
        status = main(list(command))
        return status, capsys.readouterr()

    for command in (["export", "robot.json", "--to", "csv", "-o", "a.csv"],
                    ["watch", str(arm / "arm.csv"), "-m", "robot.json"],
                    ["compare", "robot.json", "elbow.json"]):  # fmt: skip
        status, told = said(*command)
        assert status == 1
        assert "shoulder, elbow, wrist: name one with --joint NAME" in told.err
        status, told = said(*command, "--joint", "elbo")
        assert status == 1
        assert "did you mean elbow?" in told.err
    for path, more in (("robot.json", ["--joint", "elbow"]), ("elbow.json", [])):
        options = ["--to", "csv", "--bits", "12", "-o", f"{path}.csv", *more]
        assert said("export", path, *options)[0] == 0
    read = [[line for line in (tmp_path / f"{path}.csv").read_text().splitlines()
             if not line.startswith("#")] for path in ("robot.json", "elbow.json")]  # fmt: skip
    assert len(read[0]) > 100
    assert read[0] == read[1]
    # What it is written from is not written over.
    before = (tmp_path / "robot.json").read_bytes()
    assert said("export", "robot.json", "--to", "csv", "-o", "robot.json", "--joint", "elbow")[0]
    assert (tmp_path / "robot.json").read_bytes() == before
    _, told = said("compare", "robot.json", "elbow.json", "--joint", "elbow", "--json")
    assert json.loads(told.out)["max_abs_arcsec"] == 0.0
    watch = ["watch", str(arm / "arm.csv"), "-m", "robot.json", "--json"]
    status, told = said(*watch, "--joint", "elbow", "--signal", "reference=laser elbow [deg]")
    assert status == 0
    status, beside = said(*watch, "--joint", "elbow", "--robot", str(arm / "robot.toml"))
    assert beside.out == told.out != ""


def test_a_joint_that_rests_does_not_stop_the_others(tmp_path, capsys, monkeypatch):
    monkeypatch.chdir(tmp_path)
    true = np.arange(120) * 9.0
    moved = true + 0.02 * np.sin(np.radians(true))
    rows = np.column_stack([true, moved, 0.0 * true + 12.0, 0.0 * true + 12.001])
    np.savetxt("arm.csv", rows, "%.9f", ",", header="a_ref,a_enc,b_ref,b_enc", comments="")
    signals = [f"--signal={j}.{role}={j}_{name}:deg" for j in "ab"
               for role, name in (("reference", "ref"), ("indicated", "enc"))]  # fmt: skip
    fitted = ["fit", "arm.csv", *signals, "--orders", "1,2", "-o", "robot.json"]
    assert main(fitted) == 0
    told = capsys.readouterr()
    assert "warning: joint b: readings at 1 distinct angle cannot" in told.err
    # The worst first, and not folded: why it has no model is told beside the table.
    assert told.out.splitlines()[3].split() == ["b", "0", "-", "no", "model", "-"]
    assert ta.load_robot("robot.json").joints == ("a",)
    assert main(["report", "arm.csv", *signals, "-o", "arm.html"]) == 0
    page = (tmp_path / "arm.html").read_text()
    assert "There is none, as stated above." in page
    assert "The orders that were looked for" not in page


@pytest.mark.parametrize("joint", SIZES)
def test_one_joint_without_usable_data_is_told_by_the_status(arm, tmp_path, joint, capsys):
    """Its indicated angle runs against its reference; those of the others are sound."""
    assert asked(arm, "check", capsys=capsys)[0] == 0
    lines = (arm / "arm.csv").read_text().splitlines()
    column = lines[0].split(",").index(f"q_{joint}")
    rows = [line.split(",") for line in lines[1:]]
    for row in rows:
        row[column] = f"{-float(row[column]):.12f}"
    (tmp_path / "arm.csv").write_text("\n".join([lines[0], *map(",".join, rows)]))
    (tmp_path / "robot.toml").write_text((arm / "robot.toml").read_text())
    status, out, _ = asked(tmp_path, "check", "--json", capsys=capsys)
    usable = {name: found["usable"] for name, found in json.loads(out)["joints"].items()}
    assert usable == {name: name != joint for name in SIZES}
    assert status == 1


def test_columns_that_are_typed_go_before_those_of_the_robot_file(arm):
    """Of the joint named before those of every joint; what is not typed is the file's."""
    robot = ["--robot", str(arm / "robot.toml"), "--joint", "elbow"]

    def columns(*typed):
        options = [word for each in typed for word in ("--signal", each)]
        words = ["check", str(arm / "arm.csv"), *robot, *options]
        args = build_parser(words, words[:1]).parse_args(words)
        ((_, joint),) = [(j.name, j.args.signal) for j in joints_asked(args)[1]]
        return {entry[1]: entry[2] for entry in joint if not entry[1].startswith("coupled")}

    of_file = {"indicated": "q_elbow", "reference": "laser elbow [deg]"}
    assert columns() == of_file
    assert columns("elbow.indicated=other") == {**of_file, "indicated": "other"}
    assert columns("indicated=all") == {**of_file, "indicated": "all"}
    assert columns("indicated=all", "elbow.indicated=own") == {**of_file, "indicated": "own"}
    assert columns("torque=tau") == {**of_file, "torque": "tau"}
    both = columns("torque=tau", "elbow.torque=own", "wrist.torque=not")
    assert both == {**of_file, "torque": "own"}


def test_a_ratio_of_a_urdf_is_printed_as_it_is(tmp_path, capsys):
    joints = "".join(TURNING.format(f"j{k}", r) for k, r in enumerate((100.5, -50, 24.375)))
    (tmp_path / "a.urdf").write_text(URDF.format(joints=joints))
    assert main(["robot", "--from-urdf", str(tmp_path / "a.urdf"), "-o", str(tmp_path / "r")]) == 0
    told = capsys.readouterr().out
    for ratio in ("ratio 100.5", "ratio -50", "ratio 24.375"):
        assert ratio in told
