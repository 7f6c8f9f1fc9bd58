"""A gear whose motor turns the other way: a negative ratio, with the lines of its size."""

from __future__ import annotations

from dataclasses import replace

import pytest

import trueangle as ta
from trueangle.simulation import Harmonic, Joint, RunDesign, Simulation, simulate

LINES = (Harmonic("motor", 1, 25.0, 40.0), Harmonic("wave_generator", 2, 18.0, 200.0))
RUNS = tuple(RunDesign(samples=900, turns=2.0, start_deg=50.0 * k, label=f"{k}") for k in range(3))


def runs_of(ratio: float) -> list[ta.CalibrationRun]:
    joint = Joint(ratio, "circular_spline", "motor")
    return simulate(Simulation(joint, LINES, sigma_arcsec=2.0, runs=RUNS), 91)


@pytest.mark.parametrize("ratio", [-36.0, -80.5])
def test_a_fit_has_the_lines_of_the_size_of_a_ratio(ratio: float) -> None:
    runs = runs_of(-ratio)
    orders = {"output": [1], "motor": [1], "wave_generator": [2]}
    one, other = (ta.fit(runs, orders, gear_ratio=r).model for r in (ratio, -ratio))
    assert one.shafts == other.shafts
    assert [shaft.cycles_per_turn for shaft in one.shafts] == [1.0, -ratio, 1.0 - ratio]
    found, same = (ta.select_orders(runs, gear_ratio=r) for r in (ratio, -ratio))
    assert found.orders == same.orders
    assert found.gear_ratio == ratio


def test_a_diagnosis_keeps_the_sign_of_the_ratio_that_it_finds() -> None:
    """Lines of another ratio than is assumed; as found as with the motor the other way round."""
    found = []
    for sign in (1.0, -1.0):
        assumed = Simulation(
            Joint(sign * 60.0, "circular_spline", "motor"), LINES, sigma_arcsec=2.0
        )
        diagnosis = ta.diagnose(runs_of(62.0), assumed)
        (wrong,) = [f for f in diagnosis.findings if f.cause == "wrong_gear_ratio"]
        found.append(wrong.parameters["gear_ratio"].value)
        assert diagnosis.simulation().joint.gear_ratio == found[-1]
    assert found == [62.0, -62.0]
    right = Simulation(replace(assumed.joint, gear_ratio=-62.0), LINES, sigma_arcsec=2.0)
    assert not [f for f in ta.diagnose(runs_of(62.0), right).findings if f.confirmed]
