"""What terms that were chosen become: findings with the evidence, gain and status of their own."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

import trueangle as ta
from trueangle.diagnosis import findings as made
from trueangle.diagnosis.confirmation import CONFIRMED, NOT_CONFIRMED
from trueangle.diagnosis.findings import NOT_HELD_OUT, findings_of, reconsidered_findings
from trueangle.diagnosis.gain import Gain, measure_gain
from trueangle.diagnosis.goodness import Noise, Unexplained
from trueangle.effects.ambiguity import Ambiguity
from trueangle.estimation.extension import Extension
from trueangle.estimation.regression import Regression
from trueangle.joint.pattern import line_columns
from trueangle.joint.signals import join_runs
from trueangle.simulation import RunDesign, Simulation

SEED = 84_000
SIM = Simulation(
    sigma_arcsec=1.0,
    runs=tuple(
        RunDesign(
            samples=150, start_deg=40.0 * k, turns=1.3, reversals=(0.3, 0.7),
            speed_deg_s=(5.0, 12.0, 30.0)[k % 3], temperature_C=(20.0, 35.0)[k % 2],
        )
        for k in range(6)
    ),
)  # fmt: skip
CALM, MORE = (
    Unexplained(found, 1.0, 0.1, [], Noise(1.0, 0.0, 0.0, 0.0, 100.0, 0.0))
    for found in (False, True)
)


@pytest.fixture(scope="module")
def fitted() -> Regression:
    """Four lines and play, of which two terms make one finding, and a temperature."""
    print(f"seed {SEED}")
    signals = join_runs(ta.simulate(SIM, 3))
    direction, waves = signals.direction, {k: line_columns(signals.theta, k) for k in range(2, 8)}
    temperature = signals.temperature - 27.5
    error = 3.0 * direction + 0.2 * temperature + np.random.default_rng(SEED).normal(size=900)
    for k in (3, 5, 7):
        error += 2.0 * waves[k][:, 0]
    for k in (2, 4):
        error += 1.5 * direction * waves[k][:, 1]
    start = Regression.of(signals, error, SIM.surroundings, rho=0.0)
    by_direction, line = "direction_dependent_pattern", "missing_order"
    parts = [
        (by_direction, {"order": 2.0}, direction[:, None] * waves[2], 1.5),
        (line, {"output_order": 3.0, "alike": []}, waves[3], 2.5),
        ("backlash", {}, direction[:, None], 0.0),
        (by_direction, {"order": 4.0}, direction[:, None] * waves[4], 3.5),
        (line, {"output_order": 5.0, "alike": []}, waves[5], 4.5),
        (line, {"output_order": 7.0, "alike": []}, waves[7], 5.5),
        ("thermal_drift", {"what": "zero"}, temperature[:, None], 0.5),
    ]
    terms = [start.propose(cause, shape, x, None, grid) for cause, shape, x, grid in parts]
    return start.with_terms(terms)


def test_a_finding_has_the_evidence_of_all_its_terms_and_of_no_other(
    fitted: Regression, monkeypatch: pytest.MonkeyPatch
) -> None:
    """In the order found; others are tried in the place of the first four."""
    tried: list[list[int]] = []

    def rivals(regression: Regression, group: list[int]) -> list[tuple[str, float]]:
        tried.append(group)
        return [("latency", 77.0 + group[0])]

    monkeypatch.setattr(made, "rivals_of", rivals)
    found, spots, doubtful = findings_of(fitted, [], False, CALM)
    assert [finding.group for finding in found] == [(0, 3), (1,), (2,), (4,), (5,), (6,)]
    assert tried == [[0, 3], [1], [2], [4]]
    assert [f.rivals for f in found] == [[("latency", 77.0 + k)] for k in (0, 1, 2, 4)] + [[], []]
    assert (spots, doubtful) == ([], [])
    for finding in found:
        terms = [fitted.terms[k] for k in finding.group]
        assert finding.cause == terms[0].cause
        assert finding.gain is None
        assert finding.confirmed
        assert finding.evidence == pytest.approx(
            {
                "bic_gain": sum(term.bic_gain for term in terms),
                "deviance": sum(term.deviance for term in terms),
                "parameters": sum(term.parameters for term in terms),
                "log_grid": sum(term.log_grid for term in terms),
            }
        )
    lines = {f.parameters["output_order"].value for f in found if f.cause == "missing_order"}
    assert lines == {3.0, 5.0, 7.0}
    (play,) = [f for f in found if f.cause == "backlash"]
    size = play.parameters["half_width_arcsec"]
    assert abs(size.value - 3.0) < 4.0 * size.std


def test_each_finding_has_the_errors_of_its_own_terms(fitted: Regression) -> None:
    """By least squares: of what follows the temperature a tenth of those of the lines."""
    found, _, _ = findings_of(fitted, [], False, CALM)
    design = np.hstack([fitted.base, *(term.columns for term in fitted.terms)])
    std = np.sqrt(np.diag(np.linalg.inv(design.T @ design)))
    at = np.cumsum([fitted.base.shape[1], *(term.columns.shape[1] for term in fitted.terms)])
    (play,) = [f for f in found if f.cause == "backlash"]
    (drift,) = [f for f in found if f.cause == "thermal_drift"]
    # As wide as noise makes them, or wider where runs disagree.
    for finding, name in ((play, "half_width_arcsec"), (drift, "zero_arcsec_per_K")):
        told = finding.parameters[name].std
        assert isinstance(told, float)
        assert 0.9 < told / std[at[finding.group[0]]] < 2.0


def test_a_cause_in_doubt_is_no_finding_and_told_with_its_evidence(
    fitted: Regression, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Of all its terms; a blind spot that named it before is told no more beside that."""
    spot = Ambiguity(("direction_dependent_pattern", "backlash"), "one way", "turn round")
    other = Ambiguity(("latency",), "one speed", "two speeds")

    def doubt(term: Extension, regression: Regression, spots: list[Ambiguity]) -> Ambiguity | None:
        return spot if term.cause == spot.causes[0] else None

    monkeypatch.setattr(made, "ambiguity_of_cause", doubt)
    monkeypatch.setattr(made, "rivals_of", lambda regression, group: [])
    found, spots, doubtful = findings_of(fitted, [spot, other], False, CALM)
    assert [finding.group for finding in found] == [(1,), (2,), (4,), (5,), (6,)]
    assert [(s.causes, s.because) for s in spots] == [
        (other.causes, "one speed"), (spot.causes, "one way"),
    ]  # fmt: skip
    assert spots[1].evidence == pytest.approx(sum(fitted.terms[k].bic_gain for k in (0, 3)))
    assert spots[1].supported
    assert doubtful == []


def gain_of(low: float) -> Gain:
    return Gain("runs", (3.0, 9.0, 5.0), (1.0, 6.0, 3.0), 0.9, (low, 0.95), -1.0, "")


def test_a_finding_has_its_own_gain_and_none_is_confirmed_without(
    fitted: Regression, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Terms of those that are not confirmed are in doubt, unless they explain it together."""
    groups = [[0, 3], [1], [2], [4], [5], [6]]
    gains = [gain_of(low) for low in (0.5, 0.6, -0.1, 0.7, 0.8, 0.9)]
    asked: list[list[list[int]]] = []

    def measured(regression: Regression, named: list[list[int]]) -> list[Gain] | None:
        asked.append(named)
        return gains

    monkeypatch.setattr(made, "measure_gain", measured)
    monkeypatch.setattr(made, "rivals_of", lambda regression, group: [])
    found, _, doubtful = findings_of(fitted, [], True, CALM)
    assert asked == [groups]
    assert all(finding.gain is gain for finding, gain in zip(found, gains, strict=True))
    assert [finding.confirmed for finding in found] == [True, True, False, True, True, True]
    assert found[2].reason == "the 95 % interval of its gain on held-out data includes zero"
    assert doubtful == [2]
    monkeypatch.setattr(made, "measure_gain", lambda regression, named: None)
    found, _, doubtful = findings_of(fitted, [], True, CALM)
    assert {(f.status, f.reason) for f in found} == {(NOT_CONFIRMED, NOT_HELD_OUT)}
    assert sorted(doubtful) == [*range(7)]
    # Once something is unexplained, what takes up anything is confirmed no longer.
    taking = [replace(f, status=CONFIRMED, reason="", gain=gain_of(0.5)) for f in found]
    flexible = replace(taking[0], cause="varying_line")
    refused = replace(flexible, status=NOT_CONFIRMED, reason="other")
    nothing = replace(flexible, group=())
    told = reconsidered_findings(fitted, [*taking, flexible, refused, nothing], MORE)
    assert [f.status for f in told[:6]] == [CONFIRMED] * 6
    assert told[6].status == NOT_CONFIRMED
    assert "part of the error is unexplained" in told[6].reason
    assert (told[7], told[8]) == (refused, nothing)
    assert reconsidered_findings(fitted, [flexible], CALM)[0].confirmed


def test_real_gains_are_those_of_the_same_findings(fitted: Regression) -> None:
    found, _, _ = findings_of(fitted, [], True, CALM)
    wanted = measure_gain(fitted, [list(finding.group) for finding in found])
    assert wanted is not None
    for finding, gain in zip(found, wanted, strict=True):
        assert finding.gain is not None
        assert finding.gain.after == pytest.approx(gain.after)
        assert finding.gain.before == pytest.approx(gain.before)
