"""What is computed of a finding decides whether it is confirmed."""

from __future__ import annotations

import dataclasses

import numpy as np
import pytest

import trueangle as ta
from trueangle.diagnosis import gates
from trueangle.diagnosis.confirmation import CONFIRMED, NOT_CONFIRMED
from trueangle.diagnosis.finding import Finding
from trueangle.estimation.quantity import quantity
from trueangle.estimation.regression import Regression
from trueangle.joint.signals import join_runs
from trueangle.simulation import Joint, RunDesign, Simulation

SIM = Simulation(
    Joint(50.0, "circular_spline", "motor"),
    sigma_arcsec=1.0,
    runs=tuple(
        RunDesign(samples=200, start_deg=31.0 * k, speed_deg_s=v, reversals=(0.3, 0.6))
        for k, v in enumerate((5.0, 30.0) * 4)
    ),
)


def finding(cause: str, parameters: dict | None = None) -> Finding:
    return Finding(cause, parameters or {}, {"bic_gain": 50.0}, None, [])


@pytest.fixture(scope="module")
def fitted():
    """Direction, a column that is nearly it, and one of its own, each of three arcsec."""
    signals = join_runs(ta.simulate(SIM, 11))
    rng = np.random.default_rng(77)
    n = len(signals)
    columns = {
        "backlash": signals.direction,
        "latency": signals.direction + 0.1 * rng.standard_normal(n),
        "thermal_drift": rng.standard_normal(n),
    }
    y = 3.0 * np.sum(list(columns.values()), axis=0) + rng.standard_normal(n)
    start = Regression.of(signals, y, SIM.surroundings, rho=0.0)
    terms = [start.propose(cause, {}, column[:, None]) for cause, column in columns.items()]
    return start.with_terms(terms)


def test_two_causes_that_are_one_column_are_not_told_apart(fitted):
    findings = [
        dataclasses.replace(finding(term.cause), group=(k,)) for k, term in enumerate(fitted.terms)
    ]
    pairs = [*gates.alike_columns(fitted, findings)]
    assert [(i, j) for i, j, _ in pairs] == [(0, 1)]
    # By lstsq: what each adds to the zero and to the third.
    beside = np.column_stack([fitted.base, fitted.terms[2].columns])
    own = [
        x - beside @ np.linalg.lstsq(beside, x, rcond=None)[0]
        for x in (fitted.terms[0].columns[:, 0], fitted.terms[1].columns[:, 0])
    ]
    assert pairs[0][2] == pytest.approx(np.corrcoef(own)[0, 1], abs=1e-9)
    told, spots, shared = gates.gated_findings(fitted, findings)
    assert [f.status for f in told] == [NOT_CONFIRMED, NOT_CONFIRMED, CONFIRMED]
    assert "with latency" in told[0].reason
    assert "with backlash" in told[1].reason
    assert [(spot.causes, spot.supported) for spot in spots] == [(("backlash", "latency"), True)]
    assert shared == {0, 1}


@pytest.mark.parametrize(("correlation", "alike"), [(0.93, False), (0.97, True), (-0.97, True)])
def test_columns_are_one_from_a_correlation_on(correlation, alike):
    """Of either sign; below it each has a part of its own."""
    signals = join_runs(ta.simulate(SIM, 11))
    rng = np.random.default_rng(77)
    own = rng.standard_normal((2, len(signals)))
    other = correlation * own[0] + np.sqrt(1.0 - correlation**2) * own[1]
    y = 3.0 * own[0] + 3.0 * other + rng.standard_normal(len(signals))
    start = Regression.of(signals, y, SIM.surroundings, rho=0.0)
    terms = [start.propose(cause, {}, column[:, None])
             for cause, column in (("backlash", own[0]), ("latency", other))]  # fmt: skip
    findings = [dataclasses.replace(finding(t.cause), group=(k,)) for k, t in enumerate(terms)]
    pairs = [*gates.alike_columns(start.with_terms(terms), findings)]
    assert [(i, j) for i, j, _ in pairs] == [(0, 1)] * alike


def test_many_causes_are_said_to_be_implausible_with_what_they_share():
    causes = ["backlash", "presliding_hysteresis", "missing_order", "thermal_drift"]
    found = [finding(cause) for cause in causes]
    assert gates.many_causes(found[: gates.MANY]) == ""
    # Lines count once, and what is not confirmed does not count.
    assert gates.many_causes([*found[: gates.MANY], finding("missing_order")]) == ""
    doubtful = dataclasses.replace(found[3], status=NOT_CONFIRMED)
    assert gates.many_causes([*found[: gates.MANY], doubtful]) == ""
    told = gates.many_causes(found)
    assert told.startswith("4 causes at once are unlikely; one unknown cause")
    assert "backlash, presliding_hysteresis all follow the direction of travel" in told
    # One that follows a factor alone shares it with none.
    apart = ["backlash", "missing_order", "thermal_drift", "latency"]
    assert "all follow" not in gates.many_causes([finding(cause) for cause in apart])


def test_a_ratio_that_is_one_of_several_is_not_confirmed():
    for aliases, said in (([31.0, 71.5], "31, 71.5"), ([31.0], "31"), (None, "")):
        parameters = {"gear_ratio": quantity(51.0)}
        if aliases is not None:
            parameters["aliases"] = quantity(aliases)
        told = gates.not_the_only_ratio(finding("wrong_gear_ratio", parameters))
        assert told.startswith(f"at these positions {said} would give") == bool(said)
        assert (told == "") == (not said)
        # Of other causes aliases are told, and are no doubt.
        assert gates.not_the_only_ratio(finding("non_integer_order", parameters)) == ""
