"""Is a finding confirmed? By its gain on readings held out, or by the noise it explains there."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..effects import EFFECTS
from ..regression.regression import Regression
from .gain import Gain
from .selection import cause_terms, is_flexible

__all__ = ["CONFIRMED", "NOT_CONFIRMED", "status_of"]

Array = NDArray[np.float64]

CONFIRMED, NOT_CONFIRMED = "confirmed", "not_confirmed"

#: Runs from which on the evidence of each can be asked for.
ENOUGH_RUNS = 4

#: Resamples of runs, and the lower quantile that must lie above zero.
RESAMPLES, LOWER = 1000, 0.025


def status_of(
    cause: str,
    gain: Gain | None,
    regression: Regression | None,
    group: Sequence[int],
    unexplained: bool,
) -> tuple[str, str]:
    """Status of a finding and the reason where it is not confirmed.

    A cause that transfers is confirmed by a gain on held-out data whose interval excludes
    zero. One that every run draws anew has none: it must explain the noise of the runs one
    by one. Whatever takes up what is left (`is_flexible`, causes of the scatter) is not
    confirmed while something is unexplained.
    """
    effect = EFFECTS[cause]
    if unexplained and (is_flexible(effect) or _of_scatter(cause)):
        return NOT_CONFIRMED, ("something is unexplained, and this cause takes up whatever is left")
    if effect.transfers and gain is not None and gain.interval is not None:
        if gain.interval[0] > 0.0:
            return CONFIRMED, ""
        return NOT_CONFIRMED, "its gain on the readings held out does not exclude zero"
    if regression is not None and group and regression.terms[group[0]].run_effect is not None:
        if _explains_runs(regression, group):
            return CONFIRMED, ""
        return NOT_CONFIRMED, "it explains the noise of some runs only"
    return CONFIRMED, ""


def _of_scatter(cause: str) -> bool:
    """A cause that is looked for in the scatter about all others."""
    effect = EFFECTS[cause]
    return "find_scatter" in effect.__dict__


def _explains_runs(regression: Regression, group: Sequence[int]) -> bool:
    """The likelihood of the runs one by one is better with it: bootstrap over runs."""
    without = cause_terms(regression, list(group), settled=True)
    gains = _by_run(regression) - _by_run(without)
    if gains.size < ENOUGH_RUNS:
        return True
    rng = np.random.default_rng(0)
    weights = rng.multinomial(gains.size, np.full(gains.size, 1.0 / gains.size), RESAMPLES)
    return float(np.quantile(weights @ gains, LOWER)) > 0.0


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
