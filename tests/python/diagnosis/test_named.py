"""Causes that explain as much as the one that was chosen."""

from __future__ import annotations

import pytest

import trueangle as ta
from trueangle.diagnosis.named import _equals
from trueangle.diagnosis.penalty import NEW_CAUSE
from trueangle.simulation import Backlash, Harmonic, Joint, RunDesign, Simulation, simulate

ALMOST, ENOUGH = NEW_CAUSE - 0.1, NEW_CAUSE + 0.1


@pytest.mark.parametrize(
    ("cause", "rivals", "causes"),
    [
        ("clock_drift", [("backlash", -3.0), ("latency", ALMOST)],
         ("clock_drift", "backlash", "latency")),
        ("clock_drift", [("backlash", ENOUGH), ("latency", 90.0)], None),
        # What takes up anything is no cause, nor a wider form another one.
        ("latency", [("zero_slip", -500.0), ("backlash", 20.0)], None),
        ("backlash", [("presliding_hysteresis", 1.0)], None),
        ("presliding_hysteresis", [("backlash", 1.0)], None),
        ("zero_slip", [("latency", 1.0)], None),
        # A line and a ramp are what is seen, whatever makes them.
        ("missing_order", [("local_defect", 1.0)], None),
        ("scale_error", [("clock_drift", -4.0)], None),
    ],
)  # fmt: skip
def test_what_explains_as_much_is_named_beside_it(cause, rivals, causes) -> None:
    found = _equals(cause, rivals)
    assert (found and found.causes) == causes
    if found:
        assert found.supported
        assert "in one run" in found.measure


def test_play_of_one_sweep_there_and_back_is_no_drift_of_clocks() -> None:
    """At one speed a step at the reversal may be play, a delay or a drift of clocks."""
    sim = Simulation(
        joint=Joint(gear_ratio=50.0),
        sigma_arcsec=2.0,
        harmonics=(Harmonic("output", 1.0, 20.0, 10.0),),
        runs=(RunDesign("a", reversals=(0.5,), samples=200),),
    )
    for seed in (402, 403):
        found = ta.diagnose(simulate(sim.with_effects([Backlash(4.0)]), seed), sim)
        assert not [finding.cause for finding in found.findings if finding.confirmed], seed
        seen = [spot for spot in found.not_identifiable if spot.supported]
        assert any("backlash" in spot.causes for spot in seen), seed
        assert not found.unexplained.found, seed
    (spot,) = [spot for spot in seen if "backlash" in spot.causes]
    assert spot.causes == ("clock_drift", "backlash", "latency")
    size = spot.estimates["backlash"]["half_width_arcsec"]
    assert abs(size.value - 4.0) < 3.0 * size.std
