"""A gear ratio that is wrong by less than a run's travel resolves."""

from dataclasses import replace

import numpy as np
import pytest

import trueangle as ta
from trueangle.diagnosis.discrepancy import unfolded_error
from trueangle.diagnosis.gearedlines import GearedLines
from trueangle.diagnosis.gearratio import find_ratio, near_ratio
from trueangle.joint.signals import join_runs
from trueangle.simulation import Harmonic, Joint, RunDesign, Simulation

pytestmark = pytest.mark.usefixtures("patient")

#: Simulated joints of the test of standard errors.
JOINTS = 80

#: Pulls of that many joints have a standard deviation within this of 1, but once in 10 000
#: times: four of 1/sqrt(2 n), with a sixth of the joints left out as not seen.
PULLS = 4.0 / np.sqrt(2.0 * JOINTS * 5.0 / 6.0)

#: Standard errors between what is told and what is hidden, of a handful of joints.
NEAR = 4.0


def joint_pair(rng, ratio, departure, turns, runs, samples, reversals):
    """A joint, and what is believed of it: another ratio."""
    design = tuple(
        RunDesign(
            samples=samples,
            turns=turns,
            start_deg=float(rng.uniform(0.0, 360.0)),
            reversals=reversals,
            direction=1 if k % 2 else -1,
            speed_deg_s=(10.0, 30.0)[k // 2 % 2],
        )
        for k in range(runs)
    )
    lines = tuple(
        Harmonic(shaft, order, float(rng.uniform(4.0, 20.0)), float(rng.uniform(0.0, 360.0)))
        for shaft, order in (("output", 1), ("motor", 1), ("motor", 2), ("wave_generator", 2))
    )
    believed = Simulation(Joint(ratio, "circular_spline", "motor"), lines, (), 1.5, design)
    true = Joint(ratio + departure, "circular_spline", "motor")
    return Simulation(true, lines, (), 1.5, design), believed


def seen(believed, measured):
    """The lines that are believed, in what was measured."""
    return GearedLines.of(believed, join_runs(measured), unfolded_error(measured))


@pytest.mark.parametrize(
    ("ratio", "departure", "reversals"),
    [(100.0, 0.03, ()), (50.0, -0.02, (0.5, 0.8)), (26.85, 0.05, (0.5, 0.8))],
)
def test_lines_out_of_step_are_another_ratio(ratio, departure, reversals):
    seed = round(1000.0 * ratio) + len(reversals)
    rng = np.random.default_rng(seed)
    print(f"seed {seed}")
    true, believed = joint_pair(rng, ratio, departure, 1.3, 6, 500, reversals)
    diagnosis = ta.diagnose(ta.simulate(true, 5), believed, gain=False)
    (finding,) = diagnosis.findings
    assert finding.cause == "wrong_gear_ratio"
    found = finding.parameters["gear_ratio"]
    assert abs(found.value - ratio - departure) < NEAR * found.std
    assert not diagnosis.unexplained.found


def test_the_standard_error_of_a_near_ratio_is_honest():
    seed = 20261122
    rng = np.random.default_rng(seed)
    print(f"seed {seed}")
    pulls = []
    for k in range(JOINTS):
        ratio = float(rng.choice([100.0, 50.0, 46.656, 7.31]))
        turns = float(rng.uniform(0.6, 3.0))
        departure = float(rng.choice([-0.06, 0.04])) / turns
        back = (0.5,) if rng.random() < 0.5 else ()
        runs, samples = int(rng.integers(2, 8)), int(rng.integers(200, 800))
        true, believed = joint_pair(rng, ratio, departure, turns, runs, samples, back)
        measured = ta.simulate(true, k)
        found = near_ratio(seen(believed, measured))
        if found is not None:
            pulls.append((found.gear_ratio - ratio - departure) / found.std)
    assert len(pulls) > JOINTS * 5 / 6
    assert abs(np.std(pulls) - 1.0) < PULLS
    assert np.abs(pulls).max() < 5.0


def test_the_right_ratio_is_not_tried():
    rng = np.random.default_rng(4)
    for k in range(20):
        true, believed = joint_pair(rng, 100.0, 0.0, float(rng.uniform(0.5, 3.0)), 4, 400, (0.5,))
        measured = ta.simulate(true, k)
        assert near_ratio(seen(believed, measured)) is None


@pytest.mark.parametrize("turns", [0, 1])
def test_a_reference_that_was_wrapped_hides_the_turn(turns):
    """Runs begin in turns of their own: phases differ, and are no further lines."""
    rng = np.random.default_rng(8)
    true, believed = joint_pair(rng, 20.0, 0.04, 1.5, 4, 600, (0.6,))
    runs = []
    for k, run in enumerate(ta.simulate(true, 3)):
        shift = 360.0 * turns * (5 * k % 7)
        there = {"indicated": run.indicated - shift, "reference": run.reference - shift}
        runs.append(replace(run, **there))
    diagnosis = ta.diagnose(runs, believed, gain=False)
    assert [finding.cause for finding in diagnosis.findings] == ["wrong_gear_ratio"]


@pytest.mark.parametrize("seed", range(62_000, 62_006))
def test_lines_a_tooth_away_stand_where_others_are_believed(seed):
    """At one tooth less the wave generator's line is where the motor's second is believed."""
    rng = np.random.default_rng(seed)
    print(f"seed {seed}")
    true, believed = joint_pair(rng, 101.0, -1.0, float(rng.uniform(1.0, 1.8)), 12, 300, (0.6,))
    sizes = rng.uniform([2.0, 3.0, 15.0, 15.0], [12.0, 9.0, 30.0, 30.0])
    lines = tuple(
        replace(line, amplitude_arcsec=float(size))
        for line, size in zip(believed.harmonics, sizes, strict=True)
    )
    joint = replace(true, harmonics=lines)
    measured = ta.simulate(joint, seed=seed)
    found = find_ratio(seen(replace(believed, harmonics=lines), measured))
    assert found is not None
    assert found.gear_ratio == 100.0
    assert found.found > 0.97 > 0.8 > found.left
    # Where they stand as believed there is nothing to look for.
    assert find_ratio(seen(joint, measured)) is None
