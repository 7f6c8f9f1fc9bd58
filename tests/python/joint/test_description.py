"""Robot files: what is written is read back, and what is wrong is named by joint and key."""

from __future__ import annotations

from pathlib import Path

import pytest

from trueangle.errors import ArgumentError, FileError
from trueangle.joint.description import (
    MAX_JOINTS,
    JointDescription,
    RobotDescription,
    load_description,
)

WHOLE = RobotDescription(
    'arm "7"',
    (
        JointDescription(
            "base",
            100.5,
            "flexspline",
            {"indicated": "q 1:deg", "motor": "m1"},
            {"worm": 144.0, "belt drive": 0.37},
        ),
        JointDescription("élbow"),
        JointDescription("wrist", 0.5, "none", shafts={"a-b_c": 2.0}),
    ),
)

#: A file whose joint has every key, each of which is then spoiled.
FILE = """\
[robot]
name = "arm"
[[joint]]
name = "base"
gear_ratio = 100
fixed_member = "none"
simulation = "base.toml"
[joint.signals]
indicated = "q"
[joint.shafts]
worm = 144
"""


def _file(folder: Path, text: str) -> Path:
    path = folder / "robot.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_robot_is_written_and_read_back(tmp_path: Path) -> None:
    path = tmp_path / "robot.toml"
    WHOLE.save(path)
    assert load_description(path) == WHOLE
    assert load_description(path).text == WHOLE.text
    assert '"belt drive" = 0.37' in WHOLE.text
    assert "\na-b_c = 2.0\n" in WHOLE.text
    assert WHOLE.text.endswith("2.0\n")


def test_defaults_and_the_simulation_beside_the_file(tmp_path: Path) -> None:
    robot = load_description(_file(tmp_path, FILE))
    (joint,) = robot.joints
    assert robot.name == "arm"
    assert (joint.name, joint.gear_ratio, joint.fixed_member) == ("base", 100.0, "none")
    assert joint.simulation == tmp_path / "base.toml"
    assert (joint.signals, joint.shafts) == ({"indicated": "q"}, {"worm": 144.0})
    again = load_description(_file(tmp_path, robot.text))
    assert again.joints[0].simulation == tmp_path / "base.toml"
    bare = load_description(_file(tmp_path, '[[joint]]\nname = "a"\n'))
    assert bare == RobotDescription("", (JointDescription("a"),))


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ('name = "base"', "", r"joint\[0\].*name"),
        ('name = "base"', 'name = ""', r"joint\[0\].name': .*without '.' and '=' is needed"),
        ('name = "base"', 'name = "a.b"', r"joint\[0\].name"),
        ('name = "base"', 'name = "a=b"', r"joint\[0\].name"),
        ("= 100", "= 0", r"joint\[0\].gear_ratio': must not be 0"),
        ("= 100", "= nan", r"joint\[0\].gear_ratio"),
        ('"none"', '"nome"', r"joint\[0\].fixed_member': must be one of .*none"),
        ('simulation = "base.toml"', "simulation = 3", r"joint\[0\].simulation"),
        ('indicated = "q"', 'indicted = "q"', r"joint\[0\].signals.indicted"),
        ('indicated = "q"', 'indicated = ""', r"signals.indicated': the name of a column"),
        ("worm = 144", "worm = 0", r"joint\[0\].shafts.worm': must be positive, got 0.0"),
        ("[joint.shafts]\nworm = 144", "", None),
        ("[joint.signals]\nindicated = \"q\"", "signals = 1", r"signals': a table is needed"),
        ("worm = 144", '[[joint]]\nname = "base"', r"joint\[1\].name': two joints are called"),
        ("[robot]", "[robots]", "robots"),
        ("[[joint]]", "[[joint]", "not a TOML file"),
    ],
)  # fmt: skip
def test_what_is_wrong_is_named(tmp_path: Path, old: str, new: str, says: str | None) -> None:
    path = _file(tmp_path, FILE.replace(old, new, 1))
    if says is None:
        assert not load_description(path).joints[0].shafts
        return
    with pytest.raises(FileError, match=says):
        load_description(path)


def test_so_many_joints_and_not_one_more(tmp_path: Path) -> None:
    assert MAX_JOINTS == 256
    text = "".join(f'[[joint]]\nname = "j{i}"\n' for i in range(MAX_JOINTS))
    assert len(load_description(_file(tmp_path, text)).joints) == MAX_JOINTS
    with pytest.raises(FileError, match="joint"):
        load_description(_file(tmp_path, text + '[[joint]]\nname = "last"\n'))
    with pytest.raises(FileError, match=r"one .*joint.* at least is needed"):
        load_description(_file(tmp_path, "joint = []\n"))


def test_only_some_joints_in_the_order_of_the_file() -> None:
    assert WHOLE.only(None) == WHOLE.only([]) == WHOLE
    assert [j.name for j in WHOLE.only(["wrist", "base"]).joints] == ["base", "wrist"]
    with pytest.raises(ArgumentError, match=r"no joint 'wirst'; the joints are base, .*mean wrist"):
        WHOLE.only(["wirst"])


@pytest.mark.parametrize("value", ["9" * 5000, "[" * 5000 + "]" * 5000])
def test_numbers_and_lists_that_cannot_be_read_are_told(tmp_path: Path, value: str) -> None:
    path = tmp_path / "robot.toml"
    path.write_text(f'[[joint]]\nname = "a"\ngear_ratio = {value}\n')
    with pytest.raises(FileError, match=r"robot\.toml: holds a number, date or list that cannot"):
        load_description(path)
