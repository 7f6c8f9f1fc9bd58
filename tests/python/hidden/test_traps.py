"""Traps: aliases, wraps, duplicate end points, and changes that must change nothing."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

import trueangle as ta

from .answer import diagnose
from .case import Case, Question, pose
from .joint import Joint, Line

#: Positions of the paper's design.
POSITIONS = 36

#: Standard errors by which an estimate may move when only the run order or the unit changes.
SAME_ANSWER = 0.05


def names(report: dict) -> list[str]:
    return [finding["cause"] for finding in report["findings"]]


def reasons(report: dict) -> str:
    return str(report["not_identifiable"]).lower()


def folded(joint: Joint) -> Joint:
    """The low orders that agree with a joint's lines at the 36 positions."""
    lines = []
    for line, order in zip(joint.lines, joint.orders, strict=True):
        low = (int(order) + POSITIONS // 2) % POSITIONS - POSITIONS // 2
        phase = line.phase if low >= 0 else 180.0 - line.phase
        if low != 0:
            lines.append(Line("output", abs(low), line.amplitude, phase % 360.0))
    return replace(joint, lines=tuple(lines))


@pytest.mark.parametrize("seed", range(4))
def test_lines_behind_aliases_are_not_named(seed: int) -> None:
    question = pose(Case((), 1.0, seed, "paper"))
    simple = question.joint.without(keep=("output",)).simulation(question.habit.sigma)
    report, _ = diagnose(question, simple)
    assert names(report) == []
    assert "missing_order" in reasons(report)
    assert "alias" in reasons(report)


def test_an_aliased_simulation_is_not_refuted_on_the_grid() -> None:
    on_grid = pose(Case((), 1.0, 1, "paper"))
    report, _ = diagnose(on_grid, folded(on_grid.joint).simulation(on_grid.habit.sigma))
    assert names(report) == []
    assert "alias" in reasons(report)


def test_an_aliased_simulation_is_refuted_off_the_grid() -> None:
    free = pose(Case((), 1.0, 1))
    report, _ = diagnose(free, folded(free.joint).simulation(free.habit.sigma))
    assert names(report)[0] == "missing_order"


def test_the_repeated_end_point_is_no_new_position() -> None:
    question = pose(Case((), 1.0, 2, "paper"))
    assert all(
        abs(run.reference[-1] - run.reference[0] - 360.0) < 1e-9 for run in question.runs
    )  # fmt: skip
    report, _ = diagnose(question)
    assert names(report) == []
    # 6 runs of 37 readings: the standard deviation of a pure error of some 180 degrees of
    # freedom is known to 5 %.
    assert report["noise_arcsec"] == pytest.approx(question.habit.sigma, rel=0.2)


def with_runs(question: Question, change: Callable[[dict], dict]) -> Question:
    """The question with every run's columns changed by ``change(dict) -> dict``."""
    names = ("reference", "indicated", "period", "time", "temperature", "torque", "mount",
             "label", "velocity")  # fmt: skip
    runs = [
        ta.CalibrationRun(**change({name: getattr(run, name) for name in names}))
        for run in question.runs
    ]
    return replace(question, runs=runs)


@pytest.fixture(scope="module")
def question() -> Question:
    return pose(Case(("backlash",), 0.3, 11))


@pytest.fixture(scope="module")
def report(question: Question) -> dict:
    found, _ = diagnose(question)
    assert names(found) == ["backlash"]
    return found


def same(found: dict, report: dict) -> None:
    assert names(found) == names(report)
    for a, b in zip(found["findings"], report["findings"], strict=True):
        for name, value in a["parameters"].items():
            other = b["parameters"][name]
            if isinstance(value["value"], (int, float)) and value["std"]:
                assert abs(abs(value["value"]) - abs(other["value"])) <= SAME_ANSWER * other["std"]


def test_the_order_of_the_runs_does_not_matter(question: Question, report: dict) -> None:
    order = np.random.default_rng(5).permutation(len(question.runs))
    shuffled = replace(question, runs=[question.runs[i] for i in order])
    same(diagnose(shuffled)[0], report)


@pytest.mark.parametrize("period", [2.0 * np.pi, 1.0])
def test_the_unit_does_not_matter(question: Question, report: dict, period: float) -> None:
    factor = period / 360.0

    def convert(columns: dict) -> dict:
        scaled = {name: columns[name] * factor for name in ("reference", "indicated", "mount")}
        if columns["velocity"] is not None:
            scaled["velocity"] = columns["velocity"] * factor
        return {**columns, **scaled, "period": period}

    same(diagnose(with_runs(question, convert))[0], report)


@pytest.mark.parametrize("zero", [180.0, 179.9995, -90.0])
def test_an_arbitrary_zero_of_the_encoder_does_not_matter(
    question: Question, report: dict, zero: float
) -> None:
    def shift(columns: dict) -> dict:
        return {**columns, "indicated": (columns["indicated"] + zero) % 360.0}

    same(diagnose(with_runs(question, shift))[0], report)


def test_a_turned_origin_only_turns_the_phases(question: Question, report: dict) -> None:
    delta = 37.3

    def turn(columns: dict) -> dict:
        return {
            **columns,
            "reference": columns["reference"] + delta,
            "indicated": columns["indicated"] + delta,
        }

    joint = question.joint
    lines = tuple(
        replace(line, phase=line.phase - order * delta)
        for line, order in zip(joint.lines, joint.orders, strict=True)
    )
    turned = with_runs(replace(question, joint=replace(joint, lines=lines)), turn)
    same(diagnose(turned)[0], report)


def test_a_mirrored_joint_has_the_same_cause(question: Question, report: dict) -> None:
    def mirror(columns: dict) -> dict:
        flipped = {name: -columns[name] for name in ("reference", "indicated", "mount", "torque")}
        if columns["velocity"] is not None:
            flipped["velocity"] = -columns["velocity"]
        return {**columns, **flipped}

    lines = tuple(replace(line, phase=-line.phase) for line in question.joint.lines)
    mirrored = replace(question, joint=replace(question.joint, lines=lines))
    same(diagnose(with_runs(mirrored, mirror))[0], report)


def test_a_shuffled_load_explains_nothing() -> None:
    question = pose(Case(("torsional_compliance",), 1.0, 3, "rich_constant_load"))
    assert names(diagnose(question)[0]) == ["torsional_compliance"]
    torques = [run.torque for run in question.runs]
    order = np.random.default_rng(8).permutation(len(torques))
    donors = iter(order)

    def shuffle(columns: dict) -> dict:
        return {**columns, "torque": torques[next(donors)]}

    found = names(diagnose(with_runs(question, shuffle))[0])
    assert "torsional_compliance" not in found
    assert "stiffening_compliance" not in found
