"""Is a finding confirmed? By its gain on readings held out, or by the noise it explains there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

import trueangle._core as _core

from ..effects import EFFECTS
from ..effects.drift_within_run import DriftWithinRun
from ..effects.non_integer_order import NonIntegerOrder
from ..effects.time_periodic import FREQUENCY_DRIFT, TimePeriodic
from ..estimation.regression import Extension, Regression
from ..joint.pattern import line_columns
from ..support.arrays import Array, quantile
from ..support.display_units import brief_number
from ..support.distributions import f_tail
from .candidates import propose_candidates
from .gain import Gain
from .goodness import FREE_PATH, Unexplained
from .goodness.periodogram import order_test, time_test
from .goodness.zeros import ZEROS
from .penalty import NEW_CAUSE, regression_without
from .remainder import free_paths, remainder_of
from .selection import acts_on_runs, is_flexible

#: Probability above which the scatter of unexplained zeros may as well have made a cause.
CHANCE = 0.01


def chance_between_runs(
    regression: Regression, group: Sequence[int], unexplained: Unexplained
) -> float:
    """Probability that the scatter of the runs' zeros makes what a finding explains between runs.

    0 where they do not scatter, and where readings within the runs show the cause; else that of
    `scatter_chance` times the number of laws that could have been chosen instead. 1 where no run
    remains to show whether they scatter.
    """
    scatter = zeros_scatter(unexplained)
    if not (scatter or _has_no_run_to_spare(regression)):
        return 0.0
    if not group or any(regression.terms[k].columns.size == 0 for k in group):
        return 0.0
    own = np.hstack([regression.terms[k].columns for k in group])
    runs = _numbered(regression)
    zeros = (runs[:, None] == np.arange(1, int(runs.max()) + 1)).astype(np.float64)
    rest = regression_without(regression, group, settled=True)
    within, _ = rest.jointly_with(zeros).gain(own)
    if within > NEW_CAUSE + own.shape[1] * float(np.log(regression.n)):
        return 0.0
    if not scatter:
        return 1.0 if _freedom(regression, group) < 1 else 0.0
    laws = (propose_candidates(EFFECTS[cause], rest) for cause in acts_on_runs())
    tried = sum(law is not None and law.bic_gain > NEW_CAUSE for law in laws)
    return min(1.0, scatter_chance(regression, group) * max(tried, 1))


def zeros_scatter(unexplained: Unexplained) -> bool:
    """The zeros of the runs differ by more than the noise, and nothing explains it."""
    return any(item.test == ZEROS and item.p < CHANCE for item in unexplained.evidence)


def _has_no_run_to_spare(regression: Regression) -> bool:
    """As many coefficients as there are differences between the runs may explain these."""
    columns = sum(term.columns.shape[1] for term in regression.terms)
    return bool(regression.signals.runs - 1 <= columns)


def scatter_chance(regression: Regression, group: Sequence[int]) -> float:
    """Probability that as much of the runs' means is explained by their residual scatter alone.

    ::

        m_j = a + Σ_i b_i x̄_ij + u_j,   F = (Δ Σ n_j u_j² / k) / (Σ n_j u_j² / ν)

    m_j are the means of the runs less the lines, x̄_ij those of the terms that change from
    run to run, ν the runs less the coefficients. For a cause that changes only from run to run all
    readings of a run count as one: a delay uses up one of four runs.
    """
    without, told, count = _between(regression, group)
    extra, freedom = told.rank - without.rank, count - told.rank
    if extra < 1 or freedom < 1:
        return 1.0
    before, after = float(without.squares[0]), float(told.squares[0])
    f = (before - after) / extra / max(after / freedom, 1e-300)
    return f_tail(f, extra, freedom)


def _freedom(regression: Regression, group: Sequence[int]) -> int:
    """Runs beyond the coefficients of their means."""
    _, told, count = _between(regression, group)
    return count - told.rank


def _between(
    regression: Regression, group: Sequence[int]
) -> tuple[_core.LinearModel, _core.LinearModel, int]:
    """Means of the runs without a finding and with it, and how many they are."""
    runs = _numbered(regression)
    fitted = regression.fitted()
    explained = [fitted[k][0].columns @ fitted[k][1] for k in group]
    others = [
        term.columns[:, _mostly_between(term.columns, runs)]
        for k, term in enumerate(regression.terms)
        if k not in group and term.run_effect is None
    ]
    target, own, beside = (
        _weighted_means(columns, runs)
        for columns in (
            (regression.left + np.sum(explained, axis=0))[:, None],
            np.hstack([regression.terms[k].columns for k in group]),
            np.hstack([np.ones((regression.n, 1)), *others]),
        )
    )
    without = _core.LinearModel.of_rows(beside, target)
    return without, _core.LinearModel.of_rows(np.hstack([beside, own]), target), len(target)


def _numbered(regression: Regression) -> NDArray[np.int64]:
    """The run of every reading, counted from 0."""
    return np.unique(regression.signals.run, return_inverse=True)[1]


def _weighted_means(columns: Array, runs: NDArray[np.int64]) -> Array:
    """Means of every run times the root of its readings."""
    count = np.bincount(runs)
    sums = [np.bincount(runs, column) for column in columns.T]
    return np.stack(sums, axis=1) / np.sqrt(count)[:, None]


def _mostly_between(columns: Array, runs: NDArray[np.int64]) -> NDArray[np.bool_]:
    """Columns that change from run to run more than within: not lines, for example."""
    between = np.sum(_weighted_means(columns - columns.mean(axis=0), runs) ** 2, axis=0)
    return np.asarray(between > 0.5 * len(columns) * np.var(columns, axis=0))


CONFIRMED, NOT_CONFIRMED = "confirmed", "not_confirmed"

#: Distance from a whole order within which a line may be that one, changing over runs.
NEAR = 0.4

#: p-value below which a line in time is there, whatever else is.
SEEN = 1e-6

#: Runs from which on the evidence of each run is tested.
ENOUGH_RUNS = 4

#: Resamples of runs, and the lower quantile that must lie above zero.
RESAMPLES, LOWER = 1000, 0.025


def confirmation_status(
    cause: str,
    gain: Gain | None,
    regression: Regression | None,
    group: Sequence[int],
    unexplained: Unexplained,
) -> tuple[str, str]:
    """Status of a finding and the reason where it is not confirmed.

    A cause that transfers is confirmed by a gain on held-out data whose interval excludes
    zero. One that is new in every run has none: it must explain the noise of the runs one
    by one. A cause that fits any residual (`is_flexible`, causes of the scatter) is not
    confirmed while something is ``unexplained``, but for a line in time that a test which needs
    no name sees at the same frequency. Nor is a cause that is smaller than what is unexplained: it
    may be a part of that. A free path in time follows anything: it is noise to other causes, and
    no cause itself. Nor is a flexible cause confirmed where a larger drift is found.
    """
    effect = EFFECTS[cause]
    takes_up = is_flexible(effect) or _of_scatter(cause)
    if regression is not None and group and set(group) <= {*free_paths(regression)}:
        return NOT_CONFIRMED, (f"it is {FREE_PATH}, which fits anything: it describes the noise")
    if unexplained.found and takes_up and not _is_seen_without_a_name(regression, group):
        return NOT_CONFIRMED, ("it fits nearly any residual, and part of the error is unexplained")
    if regression is not None and group and takes_up and cause != DriftWithinRun.kind:
        drift = _drift(regression)
        is_seen = drift > 0.0 and _is_seen_without_a_name(regression, group)
        if not is_seen and drift > _size(regression, group):
            return NOT_CONFIRMED, (
                f"the drift of {brief_number(drift)} arcsec rms, which is larger, may cause it"
            )
    beside = unexplained.beside_path
    if regression and group and not takes_up and _size(regression, group) < beside:
        return NOT_CONFIRMED, (
            f"{brief_number(beside)} arcsec rms are unexplained, and this may be a part of them"
        )
    if regression is not None and group and cause == NonIntegerOrder.kind:
        order = float(regression.terms[group[0]].shape["order"])
        if _is_whole(regression, group, order):
            return NOT_CONFIRMED, (
                f"order {round(order)} with another size or phase in every run explains as much"
            )
    if effect.transfers and gain is not None and gain.interval is not None:
        if gain.interval[0] > 0.0:
            scattered = _of_scattered_zeros(regression, group, unexplained) if regression else ""
            return (NOT_CONFIRMED, scattered) if scattered else (CONFIRMED, "")
        return NOT_CONFIRMED, "the 95 % interval of its gain on held-out data includes zero"
    if regression is not None and group and regression.terms[group[0]].run_effect is not None:
        if _explains_runs(regression, group):
            return CONFIRMED, ""
        return NOT_CONFIRMED, "it explains the noise of some runs only"
    return CONFIRMED, ""


def _of_scattered_zeros(
    regression: Regression, group: Sequence[int], unexplained: Unexplained
) -> str:
    """That unexplained zeros of the runs may as well have made a finding, where they may."""
    chance = chance_between_runs(regression, group, unexplained)
    if chance <= CHANCE:
        return ""
    if not zeros_scatter(unexplained):
        runs = regression.signals.runs
        return f"it shows only in the zeros of {runs} runs, and every run may have a new zero"
    return (
        "the zeros of the runs scatter more than the noise, and may alone cause an effect of this "
        f"size in {regression.signals.runs} runs (p {chance:.2g})"
    )


def _size(regression: Regression, group: Sequence[int]) -> float:
    """Standard deviation of the error that a finding explains."""
    fitted = regression.fitted()
    parts = [term.columns @ c for term, c in (fitted[k] for k in group) if c.size]
    drawn = [k in group for k, term in enumerate(regression.terms) if term.run_effect is not None]
    if any(drawn):
        parts.append(regression.whiten.run_part(regression.left, drawn))
    return float(np.std(np.sum(parts, axis=0)))


def _drift(regression: Regression) -> float:
    """Standard deviation of the drift that was chosen, or 0."""
    drifts = [k for k, t in enumerate(regression.terms) if t.cause == DriftWithinRun.kind]
    return _size(regression, drifts) if drifts else 0.0


def _is_seen_without_a_name(regression: Regression | None, group: Sequence[int]) -> bool:
    """Whether the residual without it has a line in time at its frequency, and none surer."""
    if regression is None or not group or regression.signals.runs < 2:
        return False
    term = regression.terms[group[0]]
    if term.cause != TimePeriodic.kind:
        return False
    left = remainder_of(regression, without=group)
    rho = regression.whiten.rho
    line = time_test(left, rho)
    if line is None or line.p > SEEN or line.at is None:
        return False
    other = order_test(left, float(regression.lines.orders.max()), rho)
    if other is not None and other.p < SEEN and other.statistic > line.statistic:
        return False
    return is_line_of(term, line.at)


def is_line_of(term: Extension, frequency: float) -> bool:
    """The term is a line in time whose frequencies drift about as far as this one."""
    own = np.asarray(term.shape["frequency_hz"], dtype=np.float64)
    low, high = own.min() * (1.0 - FREQUENCY_DRIFT), own.max() * (1.0 + FREQUENCY_DRIFT)
    return bool(low <= frequency <= high)


def _is_whole(regression: Regression, group: Sequence[int], order: float) -> bool:
    """A whole order that changes from run to run explains as much as a non-integer one."""
    whole = float(round(order))
    if whole < 1.0 or abs(order - whole) > NEAR:
        return False
    rest = regression_without(regression, list(group), settled=True)
    theta = regression.signals.theta
    found, own = (
        rest.propose_run_effect(NonIntegerOrder.kind, {"order": m}, line_columns(theta, m))
        for m in (whole, order)
    )
    return found.deviance > own.deviance - NEW_CAUSE


def _of_scatter(cause: str) -> bool:
    """A cause that is looked for in the scatter about all others."""
    effect = EFFECTS[cause]
    return "find_scatter" in effect.__dict__


def _explains_runs(regression: Regression, group: Sequence[int]) -> bool:
    """The likelihood of the runs one by one is better with it: bootstrap over runs."""
    without = regression_without(regression, list(group), settled=True)
    gains = _by_run(regression) - _by_run(without)
    if gains.size < ENOUGH_RUNS:
        return True
    rng = np.random.default_rng(0)
    weights = rng.multinomial(gains.size, np.full(gains.size, 1.0 / gains.size), RESAMPLES)
    return float(quantile(weights @ gains, LOWER)) > 0.0


def _by_run(regression: Regression) -> Array:
    """2 ln of the likelihood of every run under what was fitted to all, up to a constant."""
    square = regression.r**2
    variance = regression.variance
    found = []
    for k, (start, stop) in enumerate(regression.bounds):
        log_det = regression.whiten.log_determinant_of(k)
        found.append(
            -float(square[start:stop].sum()) / variance
            - (stop - start) * float(np.log(variance))
            - log_det
        )
    return np.array(found)
