"""Is a finding confirmed? By its gain on readings held out, or by the noise it explains there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..effects import EFFECTS
from ..effects.drift_within_run import DriftWithinRun
from ..effects.non_integer_order import NonIntegerOrder
from ..effects.time_periodic import FREQUENCY_DRIFT, TimePeriodic
from ..estimation.regression import Extension, Regression
from ..joint.pattern import line_columns
from ..support.arrays import Array, quantile
from ..support.display_units import brief_number
from .gain import Gain
from .goodness import FREE_PATH, Unexplained
from .goodness.periodogram import order_test, time_test
from .penalty import NEW_CAUSE, regression_without
from .remainder import free_paths, remainder_of
from .selection import is_flexible

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
        return NOT_CONFIRMED, (
            "part of the error is unexplained, and this flexible cause would fit it"
        )
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
            return CONFIRMED, ""
        return NOT_CONFIRMED, "the 95 % interval of its gain on held-out data includes zero"
    if regression is not None and group and regression.terms[group[0]].run_effect is not None:
        if _explains_runs(regression, group):
            return CONFIRMED, ""
        return NOT_CONFIRMED, "it explains the noise of some runs only"
    return CONFIRMED, ""


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
