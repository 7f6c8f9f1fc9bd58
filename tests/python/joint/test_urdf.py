"""Joints of a URDF: those that turn, in their order, with their reductions."""

from __future__ import annotations

from pathlib import Path

import pytest

from trueangle.errors import FileError
from trueangle.joint.description import JointDescription, robot_of_urdf

FILE = """\
<robot name="arm">
  <joint name="base" type="revolute"/>
  <joint name="rail" type="prismatic"/>
  <joint name="wrist" type="continuous"/>
  <joint name="finger" type="revolute"><mimic joint="wrist"/></joint>
  <joint type="revolute"/>
  <joint name="tool" type="revolute"/>
  <transmission name="a"><joint name="wrist"/>
    <actuator name="m"><mechanicalReduction>-50.5</mechanicalReduction></actuator></transmission>
  <transmission name="b"><joint> tool </joint>
    <actuator name="m"><mechanicalReduction>100</mechanicalReduction></actuator></transmission>
  <transmission name="c"/>
</robot>
"""


def _load(folder: Path, text: str):
    path = folder / "arm.urdf"
    path.write_text(text, encoding="utf-8")
    return robot_of_urdf(path)


def test_joints_that_turn_and_their_ratios(tmp_path: Path) -> None:
    robot = _load(tmp_path, FILE)
    assert robot.name == "arm"
    assert robot.joints == (
        JointDescription("base", None, "none", {"indicated": "base:rad"}),
        JointDescription("wrist", -50.5, "circular_spline", {"indicated": "wrist:rad"}),
        JointDescription("tool", 100.0, "circular_spline", {"indicated": "tool:rad"}),
    )
    assert _load(tmp_path, FILE.replace(' name="arm"', "")).name == ""


def test_a_joint_has_one_reduction_and_those_of_a_differential_have_each_their_own(
    tmp_path: Path,
) -> None:
    again = (
        "<transmission><joint name='wrist'/><actuator>"
        "<mechanicalReduction>{}</mechanicalReduction></actuator></transmission>"
    )
    same = FILE.replace('<transmission name="c"/>', again.format("-50.5"))
    assert _load(tmp_path, same).joints == _load(tmp_path, FILE).joints
    other = FILE.replace('<transmission name="c"/>', again.format("24"))
    with pytest.raises(FileError, match=r"joint 'wrist' has two reductions, -50\.5 and 24: keep"):
        _load(tmp_path, other)
    own = "<joint name='{}'><mechanicalReduction>{}</mechanicalReduction></joint>"
    both = f"<transmission>{own.format('base', 20)}{own.format('tool', 30)}</transmission>"
    found = _load(tmp_path, f"{FILE[: FILE.index('  <transmission')]}{both}</robot>")
    assert [joint.gear_ratio for joint in found.joints] == [20.0, None, 30.0]


@pytest.mark.parametrize(
    ("old", "new", "says"),
    [
        ("-50.5", "fifty", "joint 'wrist': mechanicalReduction must be a number, got 'fifty'"),
        ("-50.5", "0", "got '0'"),
        ("-50.5", "inf", "got 'inf'"),
        ("-50.5", "", "got ''"),
        ("</robot>", "", "is not XML: (?!.*xacro)"),
        ("</robot>", "xacro", "expand xacro first"),
        ("<robot", "<!DOCTYPE robot><robot", "declares a document type"),
        ('name="tool" type', 'name="base" type', "two joints are called 'base'"),
        ("revolute", "fixed", None),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, old: str, new: str, says: str | None) -> None:
    if says is None:
        none = FILE.replace(old, new).replace("continuous", new)
        with pytest.raises(FileError, match=r"no joint that turns .*revolute or continuous"):
            _load(tmp_path, none)
        with pytest.raises(FileError, match="begins with <sdf>, not with <robot>"):
            _load(tmp_path, "<sdf></sdf>")
        return
    with pytest.raises(FileError, match=says):
        _load(tmp_path, FILE.replace(old, new, 1))
