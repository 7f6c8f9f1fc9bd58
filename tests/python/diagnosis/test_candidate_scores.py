"""Scores of candidates: by how much each would lower the criterion of the whole account."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
import pytest

import trueangle as ta
from trueangle.diagnosis.candidates import (
    Candidate,
    CandidateScores,
    candidate_extensions,
    candidates_above,
    propose_candidates,
)
from trueangle.diagnosis.formerrors import beside_form_errors, share_beside_form_errors
from trueangle.diagnosis.penalty import total_penalty
from trueangle.effects import EFFECTS, Backlash
from trueangle.estimation.regression import Regression
from trueangle.joint.signals import Signals, join_runs
from trueangle.simulation import RunDesign, Simulation

Array = np.ndarray
SEED = 83_000
SIM = Simulation(
    sigma_arcsec=1.0,
    runs=tuple(
        RunDesign(
            samples=200,
            start_deg=40.0 * k,
            turns=1.3,
            reversals=(0.3, 0.7),
            speed_deg_s=(5.0, 12.0, 30.0)[k % 3],
            coupled={"wrist": [10.0 * k, 50.0, -30.0 * k, 20.0]},
        )
        for k in range(6)
    ),
)

CAUSES = ["backlash", "latency", "missing_order", "presliding_hysteresis", "joint_coupling",
          "direction_dependent_pattern", "varying_line"]  # fmt: skip


@pytest.fixture(scope="module")
def signals() -> Signals:
    return join_runs(ta.simulate(SIM, 3))


def chosen(signals: Signals, error: Array | float, causes: Sequence[str]) -> Regression:
    """With these causes, one after the other."""
    print(f"seed {SEED}")
    noise = np.random.default_rng(SEED).standard_normal(len(signals))
    found = Regression.of(signals, noise + error, SIM.surroundings, rho=0.0)
    for cause in causes:
        term = EFFECTS[cause].propose(found)
        assert term is not None
        found = found.with_terms([*found.terms, term])
    return found


def errors_of(signals: Signals) -> Array:
    return np.asarray(
        3.0 * signals.direction
        + 2.0 * np.cos(3.0 * signals.theta)
        + 2e-5 * 3600.0 * (signals.coupled["wrist"] - 20.0)
    )


@pytest.mark.parametrize("causes", [[], ["backlash"], ["missing_order", "joint_coupling"],
                                    ["backlash", "missing_order"], ["latency"]])  # fmt: skip
def test_a_score_is_what_the_whole_account_becomes_better_by(
    causes: list[str], signals: Signals
) -> None:
    """Criterion before less after, with what a wider cause takes the place of."""
    regression = chosen(signals, errors_of(signals), causes)
    found = candidate_extensions(regression, CAUSES)
    scores = CandidateScores()
    assert len(found) >= 3
    places = [CAUSES.index(extension.cause) for extension, _, _ in found]
    assert places == sorted(places)
    for candidate in found:
        extension, start, gain = candidate
        after = start.with_terms([*start.terms, extension])
        better = total_penalty(regression) - total_penalty(after)
        # But for shares of teeth, which are told apart from forms, and readings left out since.
        exact = extension.cause != "joint_coupling" and not after.outlying.any()
        near = 1e-6 if exact else 0.05
        if extension.cause != "varying_line":  # which counts beside a line that does not vary
            assert scores.score(candidate) == pytest.approx(better, rel=near)
        assert scores.score(candidate) < better + near * abs(better)
        contained = {special.kind for special in EFFECTS[extension.cause].contains}
        kept = [term.cause for term in regression.terms if term.cause not in contained]
        assert [term.cause for term in start.terms] == kept
        less = total_penalty(start) - total_penalty(regression)
        assert gain == pytest.approx(extension.bic_gain - less, abs=1e-6)


def test_an_exact_form_leaves_nothing_to_be_allowed_for(signals: Signals) -> None:
    """A share of teeth explains as much as you like, and no further cause pays for that."""
    large = 3e-4 * 3600.0 * (signals.coupled["wrist"] - 20.0)
    regression = chosen(signals, 3.0 * signals.direction, ["backlash"])
    big = chosen(signals, 3.0 * signals.direction + large, ["backlash"])
    for given in (regression, big):
        (candidate,) = candidate_extensions(given, ["joint_coupling"])
        assert 6.0 <= candidate[2] - CandidateScores().score(candidate) < 30.0
        assert (candidate[2] > 1000.0) == (given is big)
    # As large a line leaves a thousandth of its energy, which a further cause has to beat.
    wave = 45.0 * np.cos(5.0 * signals.theta)
    (candidate,) = candidate_extensions(chosen(signals, wave, ["backlash"]), ["missing_order"])
    assert candidate[2] - CandidateScores().score(candidate) > 200.0


def test_the_best_is_that_with_the_highest_score_beside_forms(signals: Signals) -> None:
    """Of what the form of a large cause may leave nothing counts, by the columns themselves."""
    base = chosen(signals, 10.0 * signals.direction, [])
    play = base.with_terms([base.propose("backlash", {}, signals.direction[:, None])])
    bend = Backlash.bends(signals, play.fitted())[:, 2]
    bend = 0.8 * bend / float(np.std(bend))
    error = 10.0 * signals.direction + bend + 1.0 * np.cos(9.0 * signals.theta)
    start = chosen(signals, error, [])
    start = start.with_terms([start.propose("backlash", {}, signals.direction[:, None])])
    candidates: list[Candidate] = []
    for cause, column in (
        ("missing_order", bend),
        ("latency", np.cos(9.0 * signals.theta)),
        ("thermal_drift", np.cos(4.0 * signals.theta)),
    ):
        extension = start.propose(cause, {}, column[:, None])
        candidates.append((extension, start, extension.bic_gain))
    scores = CandidateScores()
    plain = [scores.score(candidate) for candidate in candidates]
    told = []
    for score, (extension, _, _) in zip(plain, candidates, strict=True):
        beside = beside_form_errors(start, {extension.cause})
        share = share_beside_form_errors(start, beside, [extension])
        told.append(score - (1.0 - share) * extension.deviance)
    assert int(np.argmax(plain)) == 0
    assert int(np.argmax(told)) == 1
    assert [CandidateScores().told_score(c) for c in candidates] == pytest.approx(told)
    for given in (candidates, candidates[::-1]):
        best = CandidateScores().best(given)
        assert best is not None
        assert best[0] == pytest.approx(told[1])
        assert best[1] is candidates[1]
        # What a further one needs to be the best: asked after each new one.
        asked = CandidateScores()
        least = [asked.least(given[: k + 1]) for k in range(3)]
        so_far = [told[candidates.index(c)] for c in given]
        assert least == pytest.approx([max(0.0, *so_far[: k + 1]) for k in range(3)])
    assert CandidateScores().best(candidates[2:]) is None
    assert CandidateScores().best([]) is None


def test_what_is_contained_in_a_chosen_cause_is_not_proposed(signals: Signals) -> None:
    """A search that was cut short by a low limit is made again for a higher one."""
    spring = chosen(signals, 4.0 * signals.presliding(9.0, 0.0), ["presliding_hysteresis"])
    assert propose_candidates(Backlash, spring) is None
    assert candidate_extensions(spring, ["backlash"]) == []
    start = chosen(signals, 3.0 * signals.direction, [])
    first = candidates_above(start, "backlash", 50.0)
    assert first is not None
    assert candidates_above(start, "backlash", 60.0) is first
    again = candidates_above(start, "backlash", 0.0)
    assert again is not None
    assert again is not first
    assert candidates_above(start, "backlash", 10.0) is again
    # What is proposed beside other terms is asked of these.
    alone = candidates_above(start, "latency")
    beside = candidates_above(start.with_terms([again]), "latency")
    fresh = candidates_above(chosen(signals, 3.0 * signals.direction, ["backlash"]), "latency")
    assert alone is not None
    assert beside is not None
    assert fresh is not None
    assert beside.deviance == pytest.approx(fresh.deviance, rel=1e-9)
    assert beside.deviance < 0.1 * alone.deviance
