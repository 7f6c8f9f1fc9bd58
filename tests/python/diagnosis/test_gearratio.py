"""Ratios that the readings show: all lines of geared shafts together, and nothing less."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import trueangle as ta
from trueangle.diagnosis.discrepancy import unfolded_error
from trueangle.diagnosis.gearedlines import GearedLines
from trueangle.diagnosis.gearratio import find_ratio
from trueangle.effects.wrong_gear_ratio import WrongGearRatio
from trueangle.estimation.regression import Regression
from trueangle.joint.lattice import UniformGrid
from trueangle.joint.signals import join_runs
from trueangle.simulation import Harmonic, Joint, RunDesign, Simulation, simulate

#: Standard errors within which a ratio is the hidden one.
STANDARD_ERRORS = 4.0


def believed_and_measured(ratio, believed, lines, runs, seed, member="flexspline"):
    """A joint of a ratio, read with 0.5 arcsec of noise, and the simulation with another one."""
    true = Simulation(Joint(ratio, member, "output"), lines, (), 0.5, runs)
    belief = replace(true, joint=replace(true.joint, gear_ratio=believed))
    return belief, simulate(true, seed)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("ratio", "believed"), [(60.6, 60.0), (60.8, 60.0)])
def test_a_line_of_one_shaft_in_the_place_of_anothers_is_no_ratio(ratio, believed, seed):
    """A small line next to the place of a large one: by the two of them one half is there.

    Another ratio, at which 2 % of the believed power stands, was confirmed.
    """
    lines = (Harmonic("motor", 2, 4.0, 20.0), Harmonic("wave_generator", 2, 26.0, 140.0))
    runs = (RunDesign(samples=130, turns=2.0),) * 2
    belief, measured = believed_and_measured(ratio, believed, lines, runs, seed)
    found = ta.diagnose(measured, belief)
    (named,) = [finding for finding in found.findings if finding.confirmed]
    assert named.cause == "wrong_gear_ratio"
    told = named.parameters["gear_ratio"]
    assert abs(told.value - ratio) < STANDARD_ERRORS * told.std
    assert named.parameters["share_found"].value > 0.9
    assert all(belief.verdict == "confirmed" for belief in found.beliefs)


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize(("ratio", "believed", "positions"), [(50.0, 51.0, 44), (71.0, 70.0, 60)])
def test_ratios_that_even_steps_do_not_tell_apart_are_told(ratio, believed, positions, seed):
    """The nearest to the believed one is meant; of those that look alike any had been confirmed."""
    lines = (Harmonic("motor", 2, 9.0, 20.0),)
    runs = (RunDesign(samples=positions, spacing="uniform"),) * 2
    belief, measured = believed_and_measured(ratio, believed, lines, runs, seed, "none")
    geared = GearedLines.of(belief, join_runs(measured), unfolded_error(measured))
    found = find_ratio(geared)
    assert abs(found.gear_ratio - ratio) < STANDARD_ERRORS * found.std
    grid = UniformGrid(positions)
    every = np.arange(np.ceil(0.75 * believed), np.floor(1.25 * believed) + 1.0)
    alike = [r for r in every if grid.folded(2.0 * r) == grid.folded(2.0 * ratio) and r != ratio]
    assert len(alike) >= 1
    assert found.alike == pytest.approx(alike, abs=0.05)
    told = ta.diagnose(measured, belief)
    (named,) = [f for f in told.findings if f.cause == "wrong_gear_ratio"]
    assert named.parameters["aliases"].value == [*found.alike]
    # Any of them may be the joint's: none is confirmed, written or corrected.
    assert not named.confirmed
    assert all(f"{other:.6g}" in named.reason for other in found.alike)
    assert told.extended.joint.gear_ratio == believed
    assert "Confirmed" not in told.summary().split("Measured minus")[0]


def test_free_angles_leave_one_ratio():
    lines = (Harmonic("motor", 2, 9.0, 20.0),)
    belief, measured = believed_and_measured(
        50.0, 51.0, lines, (RunDesign(samples=60),) * 2, 4, "none"
    )
    found = ta.diagnose(measured, belief).findings[0]
    assert found.cause == "wrong_gear_ratio"
    assert "aliases" not in found.parameters
    assert found.confirmed


@pytest.mark.parametrize("seed", range(2))
def test_a_ratio_of_whole_teeth_on_even_steps_is_the_nearest(seed):
    """Two lines of one ratio, searched as a cause of its own: 26 had been confirmed for 80."""
    ratio = 64.0
    lines = (Harmonic("motor", 2, 15.0, 20.0), Harmonic("wave_generator", 2, 12.0, 200.0))
    runs = (RunDesign(samples=90, spacing="uniform"),) * 3
    belief, measured = believed_and_measured(ratio, 67.0, lines, runs, seed)
    left = unfolded_error(measured) - belief.predict(measured)
    start = Regression.of(join_runs(measured), left, belief.surroundings)
    searched = WrongGearRatio.propose(start)
    assert searched.shape["gear_ratio"] == ratio
    told, effects = WrongGearRatio.report(start, [(searched, np.zeros(0), np.zeros((0, 0)))])
    grid = UniformGrid(90)

    def seen(r: float) -> set[float]:
        return {grid.folded(2.0 * r), grid.folded(2.0 * (r - 1.0))}

    aliases = told["aliases"].value
    alike = [r for r in range(2, int(max(aliases)) + 1) if seen(r) == seen(ratio)]
    assert aliases == [r for r in alike if r != ratio]
    assert [effect.gear_ratio for effect in effects] == [ratio]


def test_the_end_of_the_search_is_searched():
    """A joint of 100 believed to be one of 80."""
    runs = (RunDesign(samples=150, turns=2.0),)
    lines = (Harmonic("motor", 1, 12.0, 20.0),)
    belief, measured = believed_and_measured(100.0, 80.0, lines, runs, 3, "none")
    found = find_ratio(GearedLines.of(belief, join_runs(measured), unfolded_error(measured)))
    assert found.gear_ratio == 100.0
    assert found.alike == ()
