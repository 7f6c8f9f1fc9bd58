"""A line is confirmed as a line and a ramp as a ramp, whatever made it."""

from __future__ import annotations

import os
from dataclasses import replace

import numpy as np
import pytest

import trueangle as ta
from trueangle.simulation import Harmonic, Joint, Simulation

from .sweeps import ROUTES, measured, route

#: Readings at the ends of an arc lie outside of it by their noise.
pytestmark = pytest.mark.filterwarnings("ignore::trueangle.errors.OutsideSpanWarning")

#: Seeds that nothing was chosen on; `make exam` asks more.
LARGE = os.environ.get("TRUEANGLE_EXAM_SEEDS")
SEEDS = range(7100, 7100 + int(LARGE)) if LARGE else range(7100, 7102)

#: Amplitude and noise, arcsec; relative error of a scale.
AMPLITUDE, SIGMA, SCALE = 80.0, 4.0, 6e-5

#: Standard errors within which a size must come out: 1 in 16 000 lies beyond 4.
WITHIN = 4.0

#: What is believed: a gear, and no line.
BELIEVED = Simulation(joint=Joint(gear_ratio=100.0, fixed_member="circular_spline"))


def runs_with(error, kind, rng, count):
    """Runs with an error of the angle, of one route each."""
    found = []
    for k in range(count):
        theta, time = route(kind, rng)
        noise = rng.normal(0.0, SIGMA, theta.size)
        found.append(measured(theta, time, error(theta, time) + noise, f"run {k}"))
    return found


def left_of(result, runs):
    """Error of the runs corrected by what was confirmed, arcsec rms without the zero."""
    model = result.correction()
    left = []
    for run in runs:
        off = np.unwrap(model.correct(run.indicated) - run.reference)
        left.append(np.degrees(off - off.mean()) * 3600.0)
    return float(np.std(np.concatenate(left)))


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("kind", ROUTES)
@pytest.mark.parametrize("order", [1, 2])
def test_a_line_of_a_geared_joint_without_torque(order, kind, seed):
    print(f"seed {seed}")
    rng = np.random.default_rng([seed, order])
    phase = rng.uniform(0.0, 360.0)

    def error(theta, time):
        return AMPLITUDE * np.sin(np.radians(order * theta + phase))

    runs = runs_with(error, kind, rng, int(rng.integers(1, 4)))
    result = ta.diagnose(runs, BELIEVED)
    lines = [f for f in result.findings if f.cause == "missing_order" and f.confirmed]
    assert [f.parameters["output_order"].value for f in lines] == [order], result.summary()
    found = lines[0].parameters
    amplitude, angle = found["amplitude_arcsec"], found["phase_deg"]
    assert abs(amplitude.value - AMPLITUDE) < WITHIN * amplitude.std
    assert abs((angle.value - phase + 180.0) % 360.0 - 180.0) < WITHIN * angle.std
    # It is written back and taken off.
    written = [e.to_table() for e in result.extended.effects if e.kind == "missing_order"]
    assert [table["order"] for table in written] == [order]
    again = runs_with(error, kind, rng, 1)
    assert left_of(result, again) < 1.2 * SIGMA
    # Gravity may have made order 1: said with the finding, and what would tell it.
    gravity = [e for e in found["explanations"].value if e.startswith("torsional_compliance")]
    spots = [s for s in result.not_identifiable if "torsional_compliance" in s.causes]
    assert len(gravity) == (order == 1)
    assert [spot.supported for spot in spots] == [order == 1]
    assert "load" in spots[0].measure


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("kind", ["turn", "there and back"])
def test_a_ramp_of_runs_at_one_speed(kind, seed):
    print(f"seed {seed}")
    rng = np.random.default_rng([seed, 3])

    def error(theta, time):
        return SCALE * 3600.0 * theta

    runs = runs_with(error, kind, rng, int(rng.integers(1, 4)))
    result = ta.diagnose(runs, BELIEVED)
    ramps = [f for f in result.findings if f.confirmed]
    assert [f.cause for f in ramps] == ["scale_error"], result.summary()
    scale = ramps[0].parameters["relative_error"]
    assert abs(scale.value - SCALE) < WITHIN * scale.std
    said = " ".join(ramps[0].parameters["explanations"].value)
    assert "clock_drift" in said
    assert ("drift_within_run" in said) == (kind == "turn")
    assert left_of(result, runs) < 1.2 * SIGMA


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("believed", [False, True])
def test_a_sideband_at_the_order_of_another_shaft(believed, seed):
    """Of order 202 of the wave generator the lower one is order 2 of the motor, too."""
    print(f"seed {seed}")
    rng = np.random.default_rng([seed, 4])
    phases = rng.uniform(0.0, 360.0, 4)
    sizes = {202: 30.0, 200: 35.0, 204: 20.0}
    lines = [Harmonic("wave_generator", 2, 30.0, phases[0])]
    # The lower sideband, of 20 arcsec as the upper one, and the motor's own line.
    motor = sizes[200] * np.exp(1j * np.radians(phases[1]))
    sum_of_both = motor + sizes[204] * np.exp(1j * np.radians(phases[2]))
    if believed:
        lines.append(Harmonic("motor", 2, sizes[200], phases[1]))
    sim = replace(BELIEVED, harmonics=tuple(lines), sigma_arcsec=SIGMA)

    def error(theta, time):
        angle = np.radians(theta)
        upper = sizes[204] * np.sin(204.0 * angle + np.radians(phases[3]))
        own = sizes[202] * np.sin(202.0 * angle + np.radians(phases[0]))
        return own + upper + np.imag(sum_of_both * np.exp(200j * angle))

    result = ta.diagnose(runs_with(error, "there and back", rng, 3), sim)
    (finding,) = result.findings
    assert (finding.cause, finding.status) == ("sidebands", "confirmed")
    amplitudes = finding.parameters["amplitudes"]
    found = dict(
        zip(
            finding.parameters["orders"].value,
            zip(amplitudes.value, amplitudes.std, strict=True),
            strict=True,
        )
    )
    assert abs(found[204.0][0] - sizes[204]) < WITHIN * found[204.0][1]
    told = {belief.what: belief.measured["amplitude_arcsec"] for belief in result.beliefs}
    lower = told["motor order 2"] if believed else found[200.0][0]
    assert (200.0 in found) == (not believed)
    assert abs(lower - abs(sum_of_both)) < WITHIN * 1.1 * found[204.0][1]
    (spot,) = [spot for spot in result.not_identifiable if "sidebands" in spot.causes]
    assert spot.supported
    assert "order 200 is motor order 2" in spot.because
    assert "motor order 2" in " ".join(finding.parameters["explanations"].value)
