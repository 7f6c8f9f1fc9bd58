"""Steps of choosing causes: each leaves an account that no such step makes better."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

import trueangle as ta
from trueangle.diagnosis.goodness import estimate_noise
from trueangle.diagnosis.penalty import finding_groups, regression_without, total_penalty
from trueangle.diagnosis.remainder import remainder_of
from trueangle.diagnosis.selection import (
    _droppable,
    _is_beyond_shown,
    _plainest,
    _pruned,
    _takes_up,
    _under_its_noise,
    _without_misfits,
)
from trueangle.effects import EFFECTS, Backlash, MissingOrder
from trueangle.estimation.regression import Regression
from trueangle.estimation.whitening import RunEffect
from trueangle.joint.pattern import line_columns, line_sum
from trueangle.joint.signals import Signals, join_runs
from trueangle.simulation import RunDesign, Simulation

Array = np.ndarray
SEED = 79_000
SIM = Simulation(
    sigma_arcsec=1.0,
    runs=tuple(
        RunDesign(samples=250, start_deg=40.0 * k, turns=1.2, reversals=(0.3, 0.7))
        for k in range(4)
    ),
)


@pytest.fixture(scope="module")
def signals() -> Signals:
    return join_runs(ta.simulate(SIM, 3))


def noise_of(signals: Signals, rho: float, seed: int) -> Array:
    """Of standard deviation 1, each reading holding so much of the one before."""
    print(f"seed {seed}")
    e = np.random.default_rng(seed).standard_normal(len(signals))
    for start, stop in signals.run_bounds():
        for i in range(start + 1, stop):
            e[i] = rho * e[i - 1] + np.sqrt(1.0 - rho**2) * e[i]
    return e


def started(
    signals: Signals, error: Array | float = 0.0, rho: float | None = 0.0, sim: Simulation = SIM
) -> Regression:
    noise = noise_of(signals, 0.0, SEED)
    return Regression.of(signals, noise + error, sim.surroundings, rho=rho)


def with_causes(start: Regression, causes: Sequence[str]) -> Regression:
    """One after the other beside those before."""
    for cause in causes:
        found = EFFECTS[cause].propose(start)
        assert found is not None
        start = start.with_terms([*start.terms, found])
    return start


@pytest.mark.parametrize("fixed", [None, 0.0])
@pytest.mark.parametrize(
    ("rho", "seed"), [(0.5, SEED + 1), (0.9, SEED + 1), (0.97, SEED + 1), (0.97, SEED + 22)]
)
def test_no_drift_is_chosen_for_what_correlated_noise_explains_better(
    rho: float, seed: int, fixed: float | None, signals: Signals
) -> None:
    """None of the correlations within two standard errors explains more in its place."""
    error = noise_of(signals, rho, seed) + 3.0 * signals.direction
    start = Regression.of(signals, error, SIM.surroundings, rho=fixed)
    chosen = with_causes(start, ["backlash", "drift_within_run"])
    rest = chosen.with_terms(chosen.terms[:1])
    noise = estimate_noise(remainder_of(rest))
    assert noise.correlation == pytest.approx(rho, abs=5.0 * noise.std)
    found = _under_its_noise(chosen)
    assert [term.cause for term in found.terms] == ["backlash"]
    trials = [noise.correlation + k * noise.std for k in range(3)]
    tried = [total_penalty(rest.with_terms(rest.terms, x)) for x in trials if x < 0.999]
    assert total_penalty(found) == pytest.approx(min(tried), abs=1e-6)
    assert min(abs(found.whiten.rho - x) for x in trials) < 1e-9


def test_a_drift_that_no_correlation_explains_stays(signals: Signals) -> None:
    ramps = np.array([0.3, -0.2, 0.4, -0.5])[signals.run] * signals.clock
    chosen = with_causes(started(signals, ramps), ["drift_within_run"])
    assert _under_its_noise(chosen) is chosen


LINES = ((3.0, 4.0, 20.0), (5.0, 0.2, 80.0), (9.0, 3.0, 140.0))


def test_what_is_left_is_worth_its_penalty_and_told_with_what_it_saves(signals: Signals) -> None:
    """By lstsq without each; and none of them, nor all of one cause, could be dropped."""
    start = started(signals, 2.0 * signals.direction + line_sum(signals.theta, LINES))
    terms = [MissingOrder.at(start, order, 3.0) for order, _, _ in LINES]
    play = start.propose("backlash", {}, signals.direction[:, None])
    nothing = [
        start.propose("direction_dependent_pattern", {"order": k},
                      signals.direction[:, None] * line_columns(signals.theta, k))
        for k in (2.0, 6.0)
    ]  # fmt: skip
    found = _pruned(start.with_terms([*terms, play, *nothing]))
    assert [(t.cause, t.shape.get("output_order")) for t in found.terms] == [
        ("missing_order", 3.0), ("missing_order", 9.0), ("backlash", None),
    ]  # fmt: skip
    y = start.residual

    def left(columns: list[Array]) -> float:
        design = np.hstack([start.base, *columns])
        rest = y - design @ np.linalg.lstsq(design, y, rcond=None)[0]
        return float(rest @ rest)

    columns = [term.columns for term in found.terms]
    for k, term in enumerate(found.terms):
        saved = left(columns[:k] + columns[k + 1 :]) / left(columns)
        assert term.deviance == pytest.approx(len(y) * np.log(saved), rel=1e-6)
    for group in [*([k] for k in range(3)), *finding_groups(found.terms)]:
        assert total_penalty(regression_without(found, group)) > total_penalty(found)


@pytest.mark.parametrize("beyond", [2.8, 3.2])
def test_a_term_that_is_larger_than_what_the_readings_show_is_dropped(
    beyond: float, signals: Signals
) -> None:
    """Three times as large as all of it: two that take each other off again."""
    start = started(signals, 2.0 * np.cos(4.0 * signals.theta))
    scatter = start.readings.scatter
    wave, other = np.cos(4.0 * signals.theta), np.cos(11.0 * signals.theta)
    # y = c (a + d b) - c a: the size of the first is c, with what is shown in d b.
    first = beyond * scatter / float(np.std(wave))
    pair = [wave, wave + 2.0 / first * wave + 1e-3 * other]
    terms = [start.propose("missing_order", {"output_order": 4.0 + k}, x[:, None])
             for k, x in enumerate(pair)]  # fmt: skip
    fitted = start.with_terms(terms)
    sizes = [float(np.std(term.columns @ c)) for term, c in fitted.fitted()]
    assert [_is_beyond_shown(fitted, k) for k in range(2)] == [s > 3.0 * scatter for s in sizes]
    # What is drawn anew in every run: by its variance.
    drawn = start.propose_run_effect("drift_within_run", {"form": "ramp"}, np.column_stack(pair))
    assert drawn.run_effect is not None
    for ratio in (0.0, 1.0):
        power = np.mean(np.sum(drawn.run_effect.columns**2, axis=1)) * start.variance
        share = ratio * (beyond * scatter) ** 2 / power
        effect = replace(drawn, run_effect=RunEffect(drawn.run_effect.columns, share))
        at = replace(start, terms=(effect,))
        assert _is_beyond_shown(at, 0) == (ratio > 0.0 and beyond > 3.0)


def test_a_special_case_takes_the_place_of_what_contains_it(signals: Signals) -> None:
    """Where it does as well; a spring that builds up over degrees is one."""
    for length, kept in ((None, "backlash"), (12.0, "presliding_hysteresis")):
        signal = signals.direction if length is None else signals.presliding(length, 0.0)
        start = started(signals, 4.0 * signal)
        shape = {"length_deg": length or 0.15, "start_state": 0.0}
        columns = EFFECTS["presliding_hysteresis"].columns(signals, start.around, shape)
        spring = start.propose("presliding_hysteresis", shape, columns, 2, float(np.log(2.0)))
        found = _plainest(start.with_terms([spring]))
        assert [term.cause for term in found.terms] == [kept]


@pytest.mark.parametrize(
    ("cause", "takes_up"),
    [("drift_within_run", True), ("zero_slip", True), ("varying_line", True),
     ("missed_counts", True), ("backlash", False), ("local_defect", False)],
)  # fmt: skip
def test_what_follows_what_noise_does_is_asked_against_its_correlation(
    cause: str, takes_up: bool, signals: Signals
) -> None:
    """Drawn anew in every run, or able to imitate anything."""
    error = np.array([3.0, -4.0, 5.0, -6.0])[signals.run] + signals.direction
    (term,) = with_causes(started(signals, error), [cause]).terms
    assert _takes_up(term) == takes_up


def test_a_term_or_all_of_a_cause_may_be_dropped(signals: Signals) -> None:
    causes = ["direction_dependent_pattern", "backlash"] + ["missing_order"] * 2
    chosen = with_causes(started(signals), [*causes, "direction_dependent_pattern"])
    assert _droppable(chosen) == [[0], [1], [2], [3], [4], [0, 4]]


@pytest.mark.parametrize("size", [100.0, 300.0])
@pytest.mark.parametrize("form", [True, False])
def test_what_the_form_of_a_large_cause_leaves_is_no_cause(
    form: bool, size: float, signals: Signals
) -> None:
    """Play that takes a while to cross may err by 3 % of it; a wave of that size is one."""
    base = started(signals, size * signals.direction)
    play = base.with_terms([base.propose("backlash", {}, signals.direction[:, None])])
    column = Backlash.bends(signals, play.fitted())[:, 2] if form else np.cos(7.0 * signals.theta)
    column = 1.5 * column / float(np.std(column))
    start = started(signals, size * signals.direction + column)
    terms = [
        start.propose("backlash", {}, signals.direction[:, None]),
        start.propose("missing_order", {"output_order": 7.0}, column[:, None]),
    ]
    found = _without_misfits(start.with_terms(terms))
    assert [t.cause for t in found.terms] == ["backlash"] + ["missing_order"] * (not form)
