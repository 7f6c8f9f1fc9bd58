"""The residual of an account for tests of goodness of fit, and free paths in time."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np

from ..effects import EFFECTS
from ..estimation.cache import Cache
from ..estimation.regression import Regression
from ..estimation.segments import (
    MOST_IN_ROW,
    flagged_segments,
    less_local_level,
    short_segments,
    within_segments,
)
from ..estimation.whitening import Whitener
from ..joint.signals import Signals
from ..support.arrays import Array
from ..support.display_units import brief_number
from ..support.distributions import chi_squared_tail
from .goodness import FREE_PATH, Evidence, Leftover, Unexplained, goodness_of_fit
from .rounding import unrounded

#: Share of a reading's noise that is left when it is forgotten.
FORGOTTEN = 0.05


def leftover_of(signals: Signals, residual: Array, cache: Cache) -> Leftover:
    """Residuals with the signals of their readings; speed, load and temperature as factors."""
    factors: dict[str, Array] = {}
    if signals.velocity is not None:
        factors["speed"] = np.abs(signals.velocity)
    if signals.torque is not None and signals.torque.any():
        factors["torque"] = signals.torque
        factors["sign of the torque"] = np.sign(signals.torque)
    if signals.temperature is not None:
        factors["temperature"] = signals.temperature
    factors["time in the run"] = share_of_run(signals)
    return Leftover(
        residual,
        signals.theta,
        signals.direction,
        signals.run,
        signals.clock,
        signals.time is not None,
        factors,
        cache.of_motion("left over", None, lambda: {"places": signals.places}),
    )


def share_of_run(signals: Signals) -> Array:
    """Time since the start of the run, in shares of its length."""
    found = signals.clock.astype(np.float64)
    for start, stop in signals.run_bounds():
        found[start:stop] -= found[start]
        found[start:stop] /= max(float(found[stop - 1]), 1e-300)
    return found


def free_paths(regression: Regression) -> list[int]:
    """Terms that are a free path in time: they describe noise and are no cause."""
    return [
        k for k, term in enumerate(regression.terms) if EFFECTS[term.cause].describes_noise(term)
    ]


def path_evidence(regression: Regression) -> Evidence | None:
    """That the account needs a free path in time, with its size."""
    found = free_paths(regression)
    if not found:
        return None
    chosen = [k in found for k, term in enumerate(regression.terms) if term.run_effect is not None]
    path = regression.whiten.run_part(regression.left, chosen)
    rms = float(np.std(path))
    deviance = sum(max(regression.terms[k].deviance, 0.0) for k in found)
    return Evidence(
        "free path in time",
        deviance,
        0.5 * chi_squared_tail(deviance, 1.0),
        f"the residual drifts in time by {brief_number(rms)} arcsec rms, anew in every run: "
        "noise that drifts, or an unknown effect of time",
        rms=rms,
        looks_like=FREE_PATH,
    )


def aside_evidence(regression: Regression) -> Evidence | None:
    """That readings are rejected in rows too long for glitches: these are an error of the mean.

    If a share q of n readings is rejected independently, ``n q^m`` rows of m and more are
    expected: none. Rows in correlated noise last as long as its correlation time.
    """
    rho, aside = regression.whiten.rho, regression.outlying
    memory = int(np.ceil(np.log(FORGOTTEN) / np.log(rho))) if rho > 0.0 else 0
    least = MOST_IN_ROW + 1 + memory
    starts, stops = flagged_segments(aside, regression.bounds)
    long = stops - starts >= least
    count = int(np.count_nonzero(long))
    if not count:
        return None
    expected = regression.n * float(np.mean(aside)) ** least
    rows = within_segments(starts[long], stops[long], regression.n)
    away = np.where(rows, regression.left_within_runs, 0.0)
    rms = float(np.sqrt(np.mean(away**2)))
    return Evidence(
        "put aside in a row",
        float(count),
        float(min(expected, 1.0) ** count / np.prod(np.arange(1.0, count + 1.0))),
        f"{int(rows.sum())} outliers are in series of {least} or more consecutive readings: a "
        "lasting error, not single glitches",
        rms=rms,
    )


def remainder_of(
    regression: Regression, without: Collection[int] = (), loose: bool = False
) -> Leftover:
    """What a regression leaves: run effects subtracted, outliers put to the level about them.

    Outliers that last are clipped to the range of the other readings.

    The terms ``without`` are left in it; ``loose`` leaves free paths in time in it, too.
    """
    if loose:
        without = {*without, *free_paths(regression)}
    kept_in = [k not in without for k in range(len(regression.terms))]
    left = regression.left
    for (term, coefficients), taken in zip(regression.fitted(), kept_in, strict=True):
        if not taken and coefficients.size:
            left = left + term.columns @ coefficients
    effects = [
        term.run_effect
        for term, taken in zip(regression.terms, kept_in, strict=True)
        if taken and term.run_effect is not None
    ]
    # Only the subtracted ones: jointly with those left in, each would explain the other's part.
    noise = Whitener(regression.bounds, regression.whiten.rho, effects, regression.readings.weights)
    left = left - noise.run_part(left)
    kept = left[~regression.outlying]
    if regression.outlying.any() and kept.size:
        glitches = short_segments(regression.outlying, regression.bounds)
        left[glitches] -= less_local_level(left, regression.bounds)[glitches]
        left = np.clip(left, float(kept.min()), float(kept.max()))
    return leftover_of(regression.signals, left * regression.root_weights, regression.cache)


def unexplained_remainder(
    regression: Regression, sigma: float | None = None, whole: Regression | None = None
) -> Unexplained:
    """Goodness of fit of what a regression leaves, up to the orders that it looks for.

    Of one of readings without outliers, ``whole`` is that with them.
    """
    regression = unrounded(regression)
    path = path_evidence(regression)
    return goodness_of_fit(
        remainder_of(regression),
        float(regression.lines.orders.max()),
        sigma,
        None if path is None else remainder_of(regression, loose=True),
        path,
        aside_evidence(regression if whole is None else whole),
    )
