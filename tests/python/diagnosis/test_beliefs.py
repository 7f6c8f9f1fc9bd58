"""What a simulation claims and the joint does otherwise: at another place, or twice as strong."""

from __future__ import annotations

from dataclasses import replace

import pytest

import trueangle as ta
from trueangle.effects import Backlash, LocalDefect
from trueangle.simulation import Harmonic, Joint, RunDesign, Simulation, simulate

JOINT = Joint(50.0, "circular_spline", "motor")
LINES = (Harmonic("output", 1, 14.0, 243.0), Harmonic("motor", 1, 12.0, 46.0))
RUNS = tuple(
    RunDesign(samples=700, reversals=(0.5,), turns=2.0, speed_deg_s=v, start_deg=20.0 * k)
    for k, v in enumerate((5.0, 30.0, 5.0, 30.0))
)
SIGMA = 1.0


def judged(truth: Simulation, believed: Simulation, seed: int) -> ta.Diagnosis:
    return ta.diagnose(simulate(truth, seed, RUNS), believed)


def test_a_line_of_another_order_is_at_a_wrong_place():
    truth = Simulation(JOINT, (*LINES, Harmonic("motor", 3, 8.0, 100.0)), (), SIGMA, RUNS)
    believed = replace(truth, harmonics=(*LINES, Harmonic("motor", 2, 8.0, 60.0)))
    result = judged(truth, believed, 3)
    (wrong,) = [belief for belief in result.beliefs if belief.verdict != "confirmed"]
    assert (wrong.what, wrong.verdict) == ("motor order 2", "wrong_place")
    assert (wrong.believed["order"], wrong.measured["order"]) == (2.0, 3.0)
    assert wrong.measured["amplitude_arcsec"] == pytest.approx(8.0, abs=0.3)
    assert wrong.gain.interval[0] > 0.0
    assert result.findings == []
    assert "wrong place" in result.summary()
    (effect,) = result.extended.effects
    assert (effect.shaft, effect.order) == ("motor", 3)
    assert all((h.shaft, h.order) != ("motor", 2) for h in result.extended.harmonics)


def test_a_line_of_another_size_and_order_is_absent_and_another_is_missing():
    truth = Simulation(JOINT, (*LINES, Harmonic("motor", 3, 3.0, 100.0)), (), SIGMA, RUNS)
    believed = replace(truth, harmonics=(*LINES, Harmonic("motor", 2, 8.0, 60.0)))
    result = judged(truth, believed, 4)
    (wrong,) = [belief for belief in result.beliefs if belief.verdict != "confirmed"]
    assert wrong.verdict == "absent"
    assert [finding.cause for finding in result.findings] == ["missing_order"]


def test_a_defect_elsewhere_is_at_a_wrong_place():
    truth = Simulation(JOINT, LINES, (LocalDefect(200.0, 8.0, 4.0),), SIGMA, RUNS)
    believed = replace(truth, effects=(LocalDefect(110.0, 8.0, 4.0),))
    result = judged(truth, believed, 5)
    (wrong,) = [belief for belief in result.beliefs if belief.verdict != "confirmed"]
    assert (wrong.what, wrong.verdict) == ("local_defect", "wrong_place")
    assert wrong.believed["place_deg"] == 110.0
    assert wrong.measured["place_deg"] == pytest.approx(200.0, abs=2.0)
    assert result.findings == []


def test_what_a_corrected_effect_gains_is_measured_on_other_runs():
    truth = Simulation(JOINT, LINES, (Backlash(3.0),), SIGMA, RUNS)
    result = judged(truth, replace(truth, effects=(Backlash(6.0),)), 6)
    (wrong,) = [belief for belief in result.beliefs if belief.verdict != "confirmed"]
    assert (wrong.what, wrong.verdict) == ("backlash", "overestimated")
    # Three arcsec too much of either sign, and the noise.
    assert wrong.gain.before[0] == pytest.approx((3.0**2 + SIGMA**2) ** 0.5, rel=0.05)
    assert wrong.gain.after[0] == pytest.approx(SIGMA, rel=0.05)
    assert wrong.gain.interval[0] > 0.9
    assert wrong.to_dict()["gain"]["reducible_share"] > 0.9
