"""Causes that explain as much as the one that was chosen."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import trueangle as ta
from trueangle.diagnosis.discrepancy import unfolded_error
from trueangle.diagnosis.penalty import NEW_CAUSE
from trueangle.diagnosis.rivals import equal_causes, rivals_of
from trueangle.effects import EFFECTS
from trueangle.estimation.regression import Regression
from trueangle.joint.signals import join_runs
from trueangle.simulation import (
    Backlash,
    Harmonic,
    Joint,
    MissedCounts,
    RunDesign,
    Simulation,
    ThermalDrift,
    TorsionalCompliance,
    ZeroSlip,
    simulate,
)

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
        ("zero_slip", [("missed_counts", 1.0)], None),
        # A line and a ramp are what is seen, whatever makes them.
        ("missing_order", [("local_defect", 1.0)], None),
        ("scale_error", [("clock_drift", -4.0)], None),
        # But what follows a recorded load or temperature is not seen to follow the angle.
        ("scale_error", [("thermal_drift", ALMOST), ("clock_drift", 0.0)],
         ("scale_error", "thermal_drift")),
        ("scale_error", [("torsional_compliance", ENOUGH)], None),
    ],
)  # fmt: skip
def test_what_explains_as_much_is_named_beside_it(cause, rivals, causes) -> None:
    found = equal_causes(cause, rivals, [])
    assert (found and found.causes) == causes
    if found:
        assert found.supported
        assert "in one run" in found.measure or cause == "scale_error"


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


@pytest.mark.parametrize("seed", range(4))
def test_what_a_fault_of_the_data_scatters_is_no_property_of_the_sensor(seed: int) -> None:
    """Old samples logged again are as far off as the joint has moved since."""
    print("seed", [47, seed])
    rng = np.random.default_rng([47, seed])
    theta = np.arange(0.0, 360.0, 5.0)
    indicated = theta + (30.0 * np.sin(np.radians(theta)) + rng.normal(0.0, 1.0, 72)) / 3600.0
    first = int(rng.integers(5, 50))
    indicated[first : first + 12] = indicated[first]
    run = ta.CalibrationRun(theta, indicated, period=360.0)
    found = ta.diagnose([run], Simulation(sigma_arcsec=1.0))
    assert [fault.fault for fault in found.data_faults] == ["stale_samples"]
    scatter = {"outliers", "heteroscedastic_noise"}
    assert not scatter & {finding.cause for finding in found.findings if finding.confirmed}
    assert not any(scatter & set(spot.causes) for spot in found.not_identifiable if spot.supported)
    (line,) = [finding for finding in found.findings if finding.confirmed]
    size = line.parameters["amplitude_arcsec"]
    assert abs(size.value - 30.0) < 4.0 * size.std < 3.0


@pytest.mark.parametrize(("runs", "seed"), [(2, 4), (2, 6), (2, 8), (3, 1), (3, 3), (3, 8)])
def test_a_zero_of_a_run_is_no_step_at_its_end(runs, seed):
    """A step of which five readings of 300 lie before it: confirmed in 8 of 20 joints that slip."""
    out_and_back = RunDesign(samples=300, turns=2.0, reversals=(0.5,))
    base = Simulation(
        sigma_arcsec=2.0, harmonics=(Harmonic("output", 1, 40.0),), runs=(out_and_back,) * runs
    )
    found = ta.diagnose(simulate(base.with_effects([ZeroSlip(1.5)]), seed=seed), base)
    assert not any(finding.confirmed for finding in found.findings)
    said = [spot for spot in found.not_identifiable if spot.causes[0] == "missed_counts"]
    assert [spot.causes for spot in said] == [("missed_counts", "zero_slip")]
    assert said[0].measure == "longer runs: the step has to fall inside one"


@pytest.mark.parametrize("row", [20, 150, 280])
def test_a_step_inside_a_run_is_one(row):
    out_and_back = RunDesign(samples=300, turns=2.0, reversals=(0.5,))
    base = Simulation(
        sigma_arcsec=2.0, harmonics=(Harmonic("output", 1, 40.0),), runs=(out_and_back,) * 2
    )
    found = ta.diagnose(simulate(base.with_effects([MissedCounts(20.0, 1, row)]), seed=1), base)
    assert [finding.cause for finding in found.findings if finding.confirmed] == ["missed_counts"]


@pytest.mark.parametrize("hidden", [ThermalDrift(50.0), TorsionalCompliance(25.0)])
@pytest.mark.parametrize("seed", range(20, 23))
def test_causes_that_are_one_column_are_named_together_however_large(hidden, seed):
    """One run of four is loaded and cooler, by so much that without a cause its noise is another.

    The spring was confirmed, whichever of the two was hidden.
    """
    sweep = RunDesign(
        samples=72, turns=6.0, reversals=(0.25, 0.5, 0.75), gravity_Nm=4.0, temperature_C=31.0
    )
    loaded = replace(sweep, samples=60, torque_Nm=8.0, temperature_C=27.0)
    runs = (loaded, sweep, replace(sweep, start_deg=70.0), replace(sweep, samples=45))
    lines = (Harmonic("output", 1, 18.0), Harmonic("output", 4, 20.0))
    base = Simulation(sigma_arcsec=3.0, harmonics=lines, runs=runs)
    measured = simulate(base.with_effects([hidden]), seed)
    found = ta.diagnose([replace(run, time=None, velocity=None) for run in measured], base)
    assert not [finding.cause for finding in found.findings if finding.confirmed]
    seen = [spot for spot in found.not_identifiable if spot.supported]
    (spot,) = [spot for spot in seen if hidden.kind in spot.causes]
    assert {"thermal_drift", "torsional_compliance"} <= set(spot.causes)
    name = next(iter(hidden.to_table().keys() - {"kind"}))
    size = spot.estimates[hidden.kind][name]
    assert abs(size.value - getattr(hidden, name)) < 4.0 * size.std


def test_a_rival_is_as_far_behind_as_its_own_account():
    """Both fitted with all else: a line that varies in time instead of one that stays."""
    base = Simulation(sigma_arcsec=1.0, runs=(RunDesign(samples=150, turns=2.0),) * 3)
    runs = simulate(base.with_effects([MissedCounts(60.0, 1, 70)]), seed=5)
    signals = join_runs(runs)
    start = Regression.of(signals, unfolded_error(runs), base.surroundings)
    chosen = start.with_terms([MissedCounts.propose(start)])
    for cause, gap in rivals_of(chosen, [0]):
        forms = (EFFECTS[cause].propose(start), EFFECTS[cause].imitate(start))
        told = [start.with_terms([form]).bic - chosen.bic for form in forms if form is not None]
        assert gap == pytest.approx(min(told), abs=1e-6), cause


@pytest.mark.parametrize("seed", range(4_301, 4_315))
def test_a_zero_of_one_of_two_runs_is_no_step(seed):
    """Slips of less than the noise: a step a few rows from an end of its run had been confirmed."""
    print(f"seed {seed}")
    out_and_back = RunDesign(samples=280, turns=1.9, reversals=(0.47,))
    base = Simulation(
        sigma_arcsec=2.0, harmonics=(Harmonic("output", 1, 40.0),), runs=(out_and_back,) * 2
    )
    slips = np.array([0.0, float(np.random.default_rng(seed).choice([-1.9, 1.3, 2.4]))])
    runs = [
        replace(run, indicated=run.indicated + slip / 3600.0)
        for run, slip in zip(simulate(base, seed), slips, strict=True)
    ]
    found = ta.diagnose(runs, base)
    assert not [finding.cause for finding in found.findings if finding.confirmed]


@pytest.mark.parametrize("seed", [4_331, 4_333, 4_337, 4_339, 4_343])
@pytest.mark.parametrize("speeds", [(6.0, 25.0), (13.0, 13.0)])
def test_the_zeros_of_two_runs_are_no_law(speeds, seed):
    """Two runs of one way: a delay, or a ratio and a clock that make up for each other."""
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    designs = tuple(
        RunDesign(samples=260, speed_deg_s=v, turns=1.1, start_deg=float(rng.uniform(0.0, 360.0)))
        for v in speeds
    )
    base = Simulation(sigma_arcsec=1.5, runs=designs)
    slips = (0.0, float(rng.choice([-1.0, 1.0]) * rng.uniform(2.0, 9.0)))
    runs = [
        replace(run, indicated=run.indicated + slip / 3600.0)
        for run, slip in zip(simulate(base, seed), slips, strict=True)
    ]
    found = ta.diagnose(runs, base)
    assert not [finding.cause for finding in found.findings if finding.confirmed]
