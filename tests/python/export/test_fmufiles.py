"""Files of a functional mock-up unit before anything compiles them: searches and descriptions."""

import re
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

import trueangle as ta
from trueangle import terms as T
from trueangle.export.fmu import fmu_source, model_description, variables_of

SHAFTS = {
    "one line": ta.Shaft("output", 1, (9,), (0.003,), (-0.004,)),
    "several": ta.Shaft("output", 1, (1, 2, 40), (0.02, 0.0, 1e-4), (0.01, 3e-3, 2e-4)),
    "steep": ta.Shaft("output", 1, (30,), (0.02,), (0.024,)),
    "of a fraction": ta.Shaft("motor", 50.5, (1, 2), (1e-4, 0.0), (0.0, -2e-4)),
}
WORDS = ("true_angle", "indicated")


def searched(model):
    """The step at which a search of the unit's source ends, and the bracket that it begins with."""
    variables = variables_of(model, sensor=False)
    source = fmu_source(model, variables, False, "")
    (near,) = re.findall(r"fabs\(next - x\) <= (\S+) \+ 2e-16", source)
    (size,) = re.findall(r"high = y - sign \* \S+ \+ (\S+);", source)
    return float(near), float(size)


@pytest.mark.parametrize("name", list(SHAFTS))
def test_a_search_ends_where_newtons_last_step_leaves_nothing(name):
    """Half the curvature over the slope times its square: 1e-17 turns, and not much less."""
    shaft = SHAFTS[name]
    near, size = searched(ta.HarmonicModel((shaft,), 0.3, argument="indicated"))
    turns = np.linspace(0.0, 2.0, 400_001)
    wave = np.zeros(turns.size, complex)
    slope, bend = wave.copy(), wave.copy()
    for k, a, b in zip(shaft.orders, shaft.cosine, shaft.sine, strict=True):
        rate = 2j * np.pi * k * shaft.cycles_per_turn
        line = (a - 1j * b) / (2.0 * np.pi) * np.exp(rate * turns)
        wave, slope, bend = wave + line, slope + rate * line, bend + rate**2 * line
    worst = np.abs(bend.real).max() / (2.0 * (1.0 - np.abs(slope.real).max())) * near**2
    assert 2e-18 < worst <= 1e-17
    largest = np.abs(wave.real).max()
    assert largest < size < 2.0 * largest


def test_the_search_of_a_model_without_a_pattern_ends_too():
    near, size = searched(ta.HarmonicModel((), 0.3, argument="indicated"))
    assert 0.0 < near <= 1e-8
    assert 0.0 < size <= 1e-9


def elements(model, sensor, fmi, noise=0.0):
    """Reference, causality, variability, unit and start of every variable by its name."""
    variables = variables_of(model, sensor, noise)
    text = model_description(variables, fmi, sensor, "{token}", "made & tested", "1.0")
    root = ElementTree.fromstring(text.encode())
    rows = {}
    kinds = root.iter("Float64") if fmi == "3" else root.iter("ScalarVariable")
    for row in kinds:
        typed = row if fmi == "3" else row.find("Real")
        rows[row.get("name")] = (
            int(row.get("valueReference")), row.get("causality"), row.get("variability"),
            typed.get("unit"), typed.get("start"),
        )  # fmt: skip
    return root, rows


@pytest.mark.parametrize("fmi", ["3", "2"])
@pytest.mark.parametrize("sensor", [False, True])
def test_a_unit_reads_one_angle_and_gives_the_other(sensor, fmi):
    """Whatever else: inputs before parameters before the one output, numbered from the time on."""
    model = ta.HarmonicModel((SHAFTS["several"],), terms=(T.CurrentCoupling(0.1),))
    root, rows = elements(model, sensor, fmi, 2e-4)
    first, last = WORDS if sensor else WORDS[::-1]
    wanted = {
        "time": ("independent", "continuous", "s", None),
        first: ("input", "continuous", "rad", "0.0"),
        "velocity": ("input", "continuous", "rad/s", "0.0"),
        "torque": ("input", "continuous", "N.m", "0.0"),
        "temperature": ("input", "continuous", "K", "293.15"),
        "current": ("input", "continuous", "A", "0.0"),
        "noise_std": ("parameter", "tunable", "rad", "0.0002"),
        "seed": ("parameter", "fixed", None, "1.0"),
        last: ("output", "continuous", "rad", None),
    }
    if not sensor:
        del wanted["noise_std"], wanted["seed"]
    numbered = {name: (i, *row) for i, (name, row) in enumerate(wanted.items())}
    if fmi == "2":  # whose time is no variable
        del numbered["time"]
    assert list(rows.items()) == list(numbered.items())
    assert root.get("fmiVersion") == {"3": "3.0", "2": "2.0"}[fmi]
    assert ("sensor" in root.get("modelName")) == sensor
    # What is unknown is the output: by its reference, or by its place from 1.
    structure = root.find("ModelStructure")
    if fmi == "3":
        given = {int(row.get("valueReference")) for row in structure.iter("Output")}
    else:
        given = {int(row.get("index")) for row in structure.iter("Unknown")}
    assert given == {len(wanted) - 1}


def test_units_without_a_current_have_no_such_input():
    for sensor in (False, True):
        names = [v.name for v in variables_of(ta.HarmonicModel((SHAFTS["several"],)), sensor)]
        assert "current" not in names
        assert names[-1] == WORDS[1 if sensor else 0]
