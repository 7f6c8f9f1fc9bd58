"""Stated errors of parameters against the bound of Cramer and Rao, by the effects' own signals."""

from dataclasses import fields, replace

import numpy as np
import pytest

import trueangle as ta
from diagnosis.test_findings_told import SIM as FEWER
from trueangle.effects import EFFECTS
from trueangle.estimation.regression import Regression
from trueangle.joint.signals import join_runs

#: A stated error is an estimate: the residual of 3 840 readings tells it to 1.2 %, and the
#: linearised bound is that of the true parameters, not of the found ones.
NEAR = (0.85, 1.15)

#: Arcsec: not one, whose root and square are itself.
NOISE = 1.4

#: More readings of the runs that show every effect.
SIM = replace(FEWER, runs=tuple(replace(run, samples=480) for run in FEWER.runs))

#: What is hidden, and which of its fields are reported under their own names.
HIDDEN = {
    "missing_order": (
        {"shaft": "output", "order": 7, "amplitude_arcsec": 3.0, "phase_deg": 70.0},
        ("amplitude_arcsec", "phase_deg"),
    ),
    "backlash": ({"half_width_arcsec": 2.0}, ("half_width_arcsec",)),
    "presliding_hysteresis": (
        {"amplitude_arcsec": 6.0, "length_deg": 9.0},
        ("amplitude_arcsec", "length_deg"),
    ),
    "presliding_hysteresis, long": (
        {"amplitude_arcsec": 6.0, "length_deg": 60.0},
        ("amplitude_arcsec", "length_deg"),
    ),
    "latency": ({"delay_s": 3e-5}, ("delay_s",)),
    "filter_lag, first order": ({"cutoff_hz": 20.0}, ("cutoff_hz",)),
    "filter_lag, second order": (
        {"cutoff_hz": 20.0, "damping": 0.5},
        ("cutoff_hz", "damping"),
    ),
    "thermal_drift": ({"zero_arcsec_per_K": 0.3}, ("zero_arcsec_per_K",)),
    "torsional_compliance": ({"arcsec_per_Nm": -1.5}, ("arcsec_per_Nm",)),
    "stiffening_compliance": (
        {"arcsec_per_Nm": 1.5, "arcsec_per_Nm3": 0.1},
        ("arcsec_per_Nm", "arcsec_per_Nm3"),
    ),
    "stiffening_compliance, knee": (
        {"arcsec_per_Nm": 3.0, "beyond_knee_arcsec_per_Nm": -2.0, "knee_Nm": 2.2},
        ("arcsec_per_Nm", "beyond_knee_arcsec_per_Nm", "knee_Nm"),
    ),
    "torque_hysteresis": (
        {"half_width_arcsec": 4.0, "span_Nm": 3.0},
        ("half_width_arcsec", "span_Nm"),
    ),
    "scale_error": ({"relative_error": 4e-6}, ("relative_error",)),
    "clock_drift": ({"ppm": 3.0}, ("ppm",)),
    "argument_error": ({"coefficient": -1.0}, ("coefficient",)),
    "channel_skew": (
        {"delay_s": 3e-5, "order": 100.0, "phase_deg": 30.0},
        ("delay_s", "phase_deg"),
    ),
    "local_defect, output": (
        {"place_deg": 211.0, "width_deg": 2.5, "height_arcsec": 14.0, "shaft": "output"},
        ("place_deg", "width_deg", "height_arcsec"),
    ),
    "missed_counts": ({"step_arcsec": 9.0, "run": 3, "row": 200}, ("step_arcsec",)),
}


@pytest.fixture(scope="module")
def signals():
    return join_runs(ta.simulate(SIM, 3))


def signal_of(effect, signals):
    return effect.signal(signals, SIM.surroundings, np.random.default_rng(0))


def stated(cause, error, signals, seed):
    """Parameters of the one cause that is asked for."""
    noise = NOISE * np.random.default_rng(seed).standard_normal(len(signals))
    start = Regression.of(signals, noise + error, SIM.surroundings, rho=0.0)
    found = EFFECTS[cause].propose(start)
    full = start.with_terms([found])
    parameters, effects = EFFECTS[cause].report(full, [(*full.fitted()[0], full.covariance(0))])
    return parameters, effects, start.base


def bound_of(effect, names, signals, base):
    """Standard deviations that no estimate of these fields together can fall short of."""
    columns = []
    for name in names:
        value = getattr(effect, name)
        step = 1e-4 * abs(value)
        ahead, behind = (replace(effect, **{name: value + s * step}) for s in (1.0, -1.0))
        columns.append((signal_of(ahead, signals) - signal_of(behind, signals)) / (2.0 * step))
    slopes = np.column_stack(columns)
    q = np.linalg.qr(base)[0]
    slopes -= q @ (q.T @ slopes)
    return NOISE * np.sqrt(np.diag(np.linalg.inv(slopes.T @ slopes)))


@pytest.mark.parametrize("case", HIDDEN)
def test_a_stated_error_is_the_bound_of_cramer_and_rao(case, signals):
    given, names = HIDDEN[case]
    cause = case.partition(",")[0]
    hidden = EFFECTS[cause](**given)
    seed = 61_000 + len(case)
    print(f"seed {seed}")
    parameters, effects, base = stated(cause, signal_of(hidden, signals), signals, seed)
    assert {field.name for field in fields(effects[0])} >= set(names)
    bounds = bound_of(hidden, names, signals, base)
    for name, bound in zip(names, bounds, strict=True):
        told = parameters[name]
        assert NEAR[0] < told.std / bound < NEAR[1], (name, told, bound)
        assert abs(told.value - getattr(hidden, name)) < 4.0 * bound, (name, told, bound)
        # What extends a simulation is what is told.
        assert getattr(effects[0], name) == pytest.approx(told.value, rel=1e-12)
