"""Shafts and bearings that a simulation file declares: read, written, explained, found."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import FileError
from trueangle.joint.joint import Bearing, DeclaredShaft, Joint

FILE = """
[[shaft]]
name = "worm"
teeth = 144

[[shaft]]
name = "belt"
cycles_per_turn = 0.37

[[bearing]]
shaft = "worm"
balls = 9
diameter_ratio = 0.2

[[harmonic]]
shaft = "worm"
order = 1
amplitude_arcsec = 9.0

[[run]]
samples = 600
"""


def _load(folder: Path, text: str) -> ta.Simulation:
    path = folder / "mount.toml"
    path.write_text(text)
    return ta.load_simulation(path)


def test_declared_shafts_turn_as_declared(tmp_path: Path) -> None:
    sim = _load(tmp_path, FILE)
    assert sim.joint.shafts == {"output": 1.0, "worm": 144.0, "belt": 0.37}
    assert sim.pattern.orders.tolist() == [144.0]
    assert sim.joint.name_order(288.0) == ("worm", 2)
    assert sim.joint.name_order(5.0) == ("output", 5)
    assert sim.joint.explanations(144.0)[0] == "worm, once per turn (wheel of 144 teeth)"
    # Cage of the worm's bearing, 0.4 of its turns, 1 % of slip.
    assert sim.joint.bearing_lines(0.4 * 144.0 * 0.99) == ["bearing on worm: cage"]
    assert sim.joint.bearing_lines(0.4 * 144.0 * 0.96) == []


def test_they_are_written_and_read_back(tmp_path: Path) -> None:
    sim = _load(tmp_path, FILE)
    for source in (sim, ta.Simulation(joint=sim.joint, harmonics=sim.harmonics, runs=sim.runs)):
        out = tmp_path / "again.toml"
        source.save(out)
        assert ta.load_simulation(out) == sim


def test_a_bearing_rolls_by_its_geometry() -> None:
    # n = 9, x = 0.2, inner ring turning, as handbooks give it.
    rates = dict(Bearing("output", 9, 0.2).lines())
    assert rates == pytest.approx(
        {"cage": 0.4, "outer race": 3.6, "inner race": 5.4, "ball": 2.4}, rel=1e-12
    )


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (("teeth = 144", ""), "either cycles_per_turn or teeth"),
        (("teeth = 144", "teeth = 144\ncycles_per_turn = 2"), "either cycles_per_turn or teeth"),
        (("teeth = 144", "teeth = 0"), "must be positive"),
        (('"belt"', '"worm"'), "declared twice"),
        (('"belt"', '"motor"'), "a shaft's own"),
        (("cycles_per_turn = 0.37", "speed = 1"), "unknown key 'speed'"),
        (("balls = 9", "balls = 1"), "balls must be at least 3"),
        (('shaft = "worm"\nballs', 'shaft = "wrom"\nballs'), "shaft must be one of output, worm"),
    ],
)
def test_what_is_wrong_is_named(tmp_path: Path, change: tuple[str, str], says: str) -> None:
    with pytest.raises(FileError, match=says):
        _load(tmp_path, FILE.replace(*change, 1))


def test_a_line_of_a_declared_shaft_is_found_as_its_own() -> None:
    """The worm's error, beside a wander of its size, on less than one turn of the wheel."""
    rng = np.random.default_rng(144)
    joint = Joint(declared=(DeclaredShaft("worm", teeth=144),))
    theta = np.linspace(20.0, 34.0, 800)
    time = np.linspace(0.0, 3400.0, 800)
    walk = np.cumsum(rng.normal(0.0, 0.25, 800))
    # Not a sine alone: a worm's error has corners.
    wave = 9.0 * np.arcsin(0.97 * np.sin(np.radians(144.0 * theta + 50.0)))
    error = wave + walk + rng.normal(0.0, 1.8, 800)
    run = ta.CalibrationRun(theta, theta + error / 3600.0, 360.0, time=time)
    found = ta.diagnose(run, ta.Simulation(joint=joint), gain=False)
    lines = [f for f in found.findings if f.cause == "missing_order"]
    assert lines, found.summary()
    assert lines[0].parameters["shaft"].value == "worm"
    assert lines[0].parameters["order"].value == 1
    amplitude = lines[0].parameters["amplitude_arcsec"].value
    # First harmonic of that wave.
    assert amplitude == pytest.approx(11.1, rel=0.25)


def test_the_worm_of_a_telescope_comes_before_its_wander(data_dir: Path) -> None:
    sim = ta.Simulation(joint=Joint(declared=(DeclaredShaft("worm", teeth=144),)))
    found = ta.diagnose(ta.read_runs(data_dir / "telescope_worm.csv"), sim)
    (first,) = [f for f in found.findings if f.cause == "missing_order" and f.confirmed]
    assert first.parameters["output_order"].value == 144.0
    # About 9 arcsec by a spline and two orders; the drift beside it takes a part.
    assert 6.0 < first.parameters["amplitude_arcsec"].value < 11.0
    # One direction: its ramp is also one in angle, but it wanders beside a ramp.
    assert "drift_within_run" in {finding.cause for finding in found.findings}
