"""Diagnosis: what is put into a simulation is named, measured and written back.

The generator here is the library's own; an independent one is in ``hidden``.
"""

from __future__ import annotations

import json
import os
import secrets
import time
from dataclasses import replace

import numpy as np
import pytest

import trueangle as ta
from trueangle import write_runs
from trueangle.cli import main
from trueangle.errors import ArgumentError
from trueangle.simulation import (
    ArgumentShift,
    Backlash,
    DriftWithinRun,
    FilterLag,
    Harmonic,
    HeteroscedasticNoise,
    Joint,
    Latency,
    LoadDependentGearError,
    LocalDefect,
    MissedCounts,
    MissingOrder,
    NonIntegerOrder,
    Outliers,
    PreslidingHysteresis,
    ReferenceLines,
    RunDesign,
    ScaleError,
    Sidebands,
    Simulation,
    StiffeningCompliance,
    ThermalDrift,
    TorsionalCompliance,
    ZeroSlip,
    simulate,
)

NIGHTLY = os.environ.get("TRUEANGLE_NIGHTLY") == "1"

#: Standard errors within which a parameter must come back.
STANDARD_ERRORS = 4.0

JOINT = Joint(50.0, "circular_spline", "motor")
LINES = (
    Harmonic("output", 1, 14.0, 243.0),
    Harmonic("output", 2, 6.0, 20.0),
    Harmonic("motor", 1, 12.0, 46.0),
    Harmonic("motor", 2, 10.0, 248.0),
    Harmonic("wave_generator", 2, 33.0, 115.0),
)

#: cause: (effect, {parameter: value} that must come back).
EFFECTS = {
    "missing_order": (
        MissingOrder("wave_generator", 1, 2.0, 40.0),
        {"amplitude_arcsec": 2.0, "phase_deg": 40.0, "order": 1, "shaft": "wave_generator"},
    ),
    "sidebands": (Sidebands(102.0, (-1.0, 1.0), (2.0, 2.5), (30.0, 70.0)), {"carrier": 102.0}),
    "non_integer_order": (NonIntegerOrder(21.4, 2.0), {"order": 21.4}),
    "backlash": (Backlash(3.0), {"half_width_arcsec": 3.0}),
    "presliding_hysteresis": (
        PreslidingHysteresis(4.0, 3.0),
        {"amplitude_arcsec": 4.0, "length_deg": 3.0},
    ),
    "latency": (Latency(30e-6), {"delay_s": 30e-6}),
    "filter_lag": (FilterLag(75.0), {"cutoff_hz": 75.0}),
    "thermal_drift": (ThermalDrift(0.15), {"zero_arcsec_per_K": 0.15}),
    "torsional_compliance": (TorsionalCompliance(0.6), {"arcsec_per_Nm": 0.6}),
    "stiffening_compliance": (
        StiffeningCompliance(1.0, -0.025),
        {"arcsec_per_Nm": 1.0, "arcsec_per_Nm3": -0.025},
    ),
    "load_dependent_gear_error": (LoadDependentGearError(((102.0, 0.5, 30.0),)), {}),
    "zero_slip": (ZeroSlip(2.4), {"standard_deviation_arcsec": 2.4}),
    "drift_within_run": (DriftWithinRun(0.0, 5.0), {}),
    "scale_error": (ScaleError(1e-5), {"relative_error": 1e-5}),
    "reference_error": (ReferenceLines((1.0, 2.0), (2.0, 1.0), (10.0, 50.0)), {}),
    "argument_error": (ArgumentShift(-1.0), {"coefficient": -1.0}),
    "outliers": (Outliers(0.01, 41.0), {"fraction": 0.01}),
    "missed_counts": (MissedCounts(20.0, 3, 150), {"step_arcsec": 20.0, "row": 150}),
    "heteroscedastic_noise": (HeteroscedasticNoise(0.6, 0.3), {"cosine": 0.6, "sine": 0.3}),
    "local_defect": (
        LocalDefect(77.0, 2.0, 8.0),
        {"place_deg": 77.0, "width_deg": 2.0, "height_arcsec": 8.0},
    ),
}


def rich(seed: int, samples: int = 250) -> list[RunDesign]:
    """16 runs: there and back, two speeds, loads and temperatures, three mounts."""
    rng = np.random.default_rng(seed)
    levels = [(v, load, t) for v in (5.0, 30.0) for load in (0.0, 5.0) for t in (20.0, 35.0)] * 2
    designs = []
    for k, place in enumerate(rng.permutation(len(levels))):
        speed, load, temperature = levels[place]
        designs.append(
            RunDesign(
                direction=1 if k % 2 else -1,
                speed_deg_s=speed,
                samples=samples,
                start_deg=float(rng.uniform(0.0, 360.0)),
                turns=2.1,
                reversals=(0.5, 0.6, 0.7),
                gravity_Nm=load,
                temperature_C=temperature,
                mount_deg=(0.0, 130.0, 250.0)[k % 3],
            )
        )
    return designs


def believed(designs) -> Simulation:
    return Simulation(JOINT, LINES, sigma_arcsec=1.5, runs=tuple(designs))


def causes(result) -> list[str]:
    return [finding.cause for finding in result.findings]


@pytest.mark.parametrize("cause", EFFECTS)
def test_an_effect_is_named_and_its_parameters_come_back(cause):
    effect, truth = EFFECTS[cause]
    sim = believed(rich(5))
    result = ta.diagnose(simulate(sim.with_effects([effect]), 5), sim)
    assert causes(result) == [cause], result.summary()
    finding = result.findings[0]
    for name, value in truth.items():
        found = finding.parameters[name]
        if isinstance(value, str | int):
            assert abs(found.value - value) <= 3 if name == "row" else found.value == value
        else:
            limit = STANDARD_ERRORS * found.std if found.std else 1e-6
            assert abs(found.value - value) <= limit, (name, found)
    assert finding.sentence
    if cause not in ("outliers", "heteroscedastic_noise"):
        assert 0.0 < result.structure[cause] <= 1.0
    if finding.gain is not None and finding.gain.reducible_share is not None:
        assert finding.gain.reducible_share > 0.85
        assert finding.gain.control_share < 0.3
        low, high = finding.gain.interval
        assert low <= finding.gain.reducible_share <= high
    # The extended simulation leaves nothing to find of what can be predicted.
    if finding.gain is not None and finding.gain.reducible_share is not None:
        again = ta.diagnose(simulate(sim.with_effects([effect]), 6), result.extended, gain=False)
        assert cause not in causes(again), again.summary()


@pytest.mark.parametrize("seed", [0, 1, 2] + [secrets.randbelow(10**6)] * NIGHTLY)
def test_nothing_is_named_where_nothing_is_hidden(seed):
    sim = believed(rich(seed))
    result = ta.diagnose(simulate(sim, seed), sim)
    assert result.findings == [], f"seed {seed}\n{result.summary()}"
    assert result.noise == pytest.approx(1.5, rel=0.05)
    assert "Nothing beyond the simulation" in result.summary()
    assert not any(spot.supported for spot in result.not_identifiable)


def test_a_believed_line_of_another_size_is_corrected():
    sim = believed(rich(1))
    truth = Simulation(JOINT, (*LINES[:-1], Harmonic("wave_generator", 2, 36.0, 115.0)), (), 1.5)
    result = ta.diagnose(simulate(truth, 1, sim.runs), sim)
    # What the simulation has already is corrected, and is no missing order.
    assert causes(result) == []
    (wrong,) = [belief for belief in result.beliefs if belief.verdict != "confirmed"]
    assert (wrong.what, wrong.verdict) == ("wave_generator order 2", "underestimated")
    assert wrong.believed["amplitude_arcsec"] == pytest.approx(33.0)
    assert wrong.measured["amplitude_arcsec"] == pytest.approx(36.0, abs=4 * 0.04)
    assert wrong.gain.interval[0] > 0.0
    assert "Wrong in the simulation" in result.summary()
    (line,) = [h for h in result.extended.harmonics if (h.shaft, h.order) == ("wave_generator", 2)]
    assert line.amplitude_arcsec == pytest.approx(36.0, abs=4 * 0.04)


def test_gear_orders_behind_the_paper_grid_are_not_accepted():
    """36 positions, one direction, at rest; true orders 100 and 102 look like 8 and 6."""
    designs = [RunDesign(samples=36, spacing="uniform", speed_deg_s=0.0)] * 5
    sim = Simulation(JOINT, LINES[:2], sigma_arcsec=2.0)
    truth = Simulation(JOINT, LINES, sigma_arcsec=2.0)
    result = ta.diagnose(simulate(truth, 2, designs), sim)
    assert result.findings == [], result.summary()
    shown = [spot for spot in result.not_identifiable if spot.supported]
    assert shown
    assert any("36 positions" in spot.because for spot in shown)
    assert any("2.14" in spot.measure for spot in shown)


@pytest.mark.parametrize(
    ("effect", "change", "blind"),
    [
        (Backlash(3.0), {"reversals": (), "direction": 1}, {"backlash"}),
        (Latency(1e-4), {"speed_deg_s": 30.0}, {"backlash", "latency"}),
        (ThermalDrift(0.3), {"temperature_C": 35.0}, {"thermal_drift"}),
        (TorsionalCompliance(1.0), {"gravity_Nm": 5.0}, {"torsional_compliance"}),
    ],
)
def test_a_design_that_cannot_tell_says_so(effect, change, blind):
    sim = believed([replace(design, **change) for design in rich(3)])
    result = ta.diagnose(simulate(sim.with_effects([effect]), 3), sim)
    assert result.findings == [], result.summary()
    told = {cause for spot in result.not_identifiable for cause in spot.causes}
    assert blind <= told
    assert all(spot.because and spot.measure for spot in result.not_identifiable)


def test_a_line_of_the_reference_or_of_the_joint_is_a_line():
    sim = believed([replace(design, mount_deg=0.0) for design in rich(3)])
    effect = ReferenceLines((3.0,), (3.0,), (0.0,))
    result = ta.diagnose(simulate(sim.with_effects([effect]), 3), sim)
    (line,) = result.findings
    assert (line.cause, line.status) == ("missing_order", "confirmed")
    amplitude = line.parameters["amplitude_arcsec"]
    assert abs(amplitude.value - 3.0) < 4.0 * amplitude.std
    assert any("reference_error" in text for text in line.parameters["explanations"].value)
    (spot,) = [spot for spot in result.not_identifiable if "reference_error" in spot.causes]
    assert spot.supported
    assert "turn the reference" in spot.measure
    # Without readings no further runs are planned, which takes ten times as long as the rest.
    assert "Detected, not distinguished" not in replace(result, runs=[]).summary()


def test_units_order_of_runs_and_zero_do_not_matter():
    sim = believed(rich(4))
    runs = simulate(sim.with_effects([Backlash(3.0)]), 4)
    plain = ta.diagnose(runs, sim, gain=False).findings[0].parameters["half_width_arcsec"]
    turned = []
    for run in reversed(runs):
        turned.append(
            ta.CalibrationRun(
                np.radians(run.reference),
                np.radians(run.indicated + 170.0),
                time=run.time,
                temperature=run.temperature,
                torque=run.torque,
                mount=np.radians(run.mount),
                velocity=np.radians(run.velocity),
            )
        )
    other = ta.diagnose(turned, sim, gain=False).findings[0].parameters["half_width_arcsec"]
    assert other.value == pytest.approx(plain.value, rel=1e-6)


def test_the_command_prints_the_contract_and_writes_the_extension(tmp_path, capsys):
    sim = believed(rich(2))
    sim.save(tmp_path / "joint.toml")
    write_runs(simulate(sim.with_effects([Backlash(3.0)]), 2), tmp_path / "runs.csv")
    better = tmp_path / "better.toml"
    command = ["diagnose", str(tmp_path / "runs.csv"), "--simulation"]
    command += [str(tmp_path / "joint.toml"), "--extend", str(better)]
    assert main([*command, "--json"]) == 0
    report = json.loads(capsys.readouterr().out)
    assert {"simulation", "noise_arcsec", "findings", "not_identifiable"} <= set(report)
    (finding,) = report["findings"]
    assert finding["cause"] == "backlash"
    assert set(finding["parameters"]["half_width_arcsec"]) == {"value", "std"}
    assert finding["gain"]["rms_before_arcsec"] > finding["gain"]["rms_after_arcsec"]
    assert all({"cause", "bic_gap"} == set(rival) for rival in finding["rivals"])
    assert report["extended_simulation"] == str(better)
    assert ta.load_simulation(better).effects[0].half_width_arcsec == pytest.approx(3.0, rel=0.05)
    assert main(command) == 0
    text = capsys.readouterr().out
    assert "peak-to-peak" in text
    assert "half_width_arcsec" in text
    assert main(["diagnose", str(tmp_path / "no.csv"), "--simulation", str(better)]) == 1
    assert "no.csv" in capsys.readouterr().err


def test_too_few_readings_are_refused():
    run = ta.CalibrationRun(np.arange(5.0), np.arange(5.0), period=360.0)
    with pytest.raises(ArgumentError, match="5 readings cannot support"):
        ta.diagnose(run, Simulation())


@pytest.mark.skipif(not NIGHTLY, reason="set TRUEANGLE_NIGHTLY=1")
def test_a_million_readings_take_seconds_and_little_memory():
    import resource

    sim = believed(rich(1, samples=62_500))
    runs = simulate(sim.with_effects([Backlash(1.0)]), 1)
    start = time.perf_counter()
    result = ta.diagnose(runs, sim)
    seconds = time.perf_counter() - start
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20
    print(f"1 000 000 readings: {seconds:.1f} s, peak {peak:.2f} GiB")
    assert causes(result) == ["backlash"]
    assert result.readings_used == 40_000
    assert peak < 2.0
