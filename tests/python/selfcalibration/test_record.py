"""Simulated coasts are calibrated, and reports say that a model had no reference."""

import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import ArgumentError
from trueangle.simulation import Harmonic, RunDesign, Simulation

COAST = RunDesign(
    speed_deg_s=3600.0, speed_end_deg_s=720.0, turns=100.0, samples=20_000, spacing="uniform"
)


@pytest.fixture(scope="module")
def runs():
    lines = (Harmonic("output", 1, 300.0, 20.0), Harmonic("output", 2, 150.0, 60.0))
    return ta.simulate(Simulation(harmonics=lines, sigma_arcsec=20.0, runs=(COAST,)), seed=8401)


def test_a_simulated_coast_slows_down_by_itself(runs):
    run = runs[0]
    speed = np.gradient(run.reference, run.time)
    assert speed[5] == pytest.approx(3600.0, rel=0.01)
    assert speed[-5] == pytest.approx(720.0, rel=0.01)
    # Viscous friction: the logarithm of the speed falls in proportion to time.
    bend = np.polyfit(run.time[1:-1], np.log(speed[1:-1]), 2)
    assert abs(bend[0]) < 1e-4 * abs(bend[1])
    with pytest.raises(ArgumentError, match="speed_end_deg_s"):
        RunDesign(speed_end_deg_s=-1.0)


def test_a_report_says_what_had_no_reference(runs, tmp_path):
    found = ta.selfcal(runs, orders=[1, 2], loop="open", ripple="none")
    assert [round(o.amplitude) for o in found.orders] == [300, 150]
    path = tmp_path / "joint.json"
    found.model.save(path)
    made = ta.report(runs, orders=[1, 2], model=path)
    told = made.content["given_model"]
    assert told["calibrated_without_reference"] is True
    assert any("zero" in said for said in told["blind"])
    assert told["after_arcsec"] == pytest.approx(20.0, rel=0.05)
    assert told["before_arcsec"] > 200.0
    pytest.importorskip("jinja2")
    pytest.importorskip("matplotlib")
    page = made.html
    assert page.index("calibrated without a reference") < page.index('class="verdict') + 400
