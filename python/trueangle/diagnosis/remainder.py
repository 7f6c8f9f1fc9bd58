"""What an account leaves of the readings, as goodness of fit asks for it."""

from __future__ import annotations

from collections.abc import Collection

import numpy as np
from numpy.typing import NDArray

from ..estimation.lines import LineBasis
from ..estimation.regression import Regression
from ..estimation.whitening import Whitener
from ..joint.signals import Signals
from .goodness import Leftover, Unexplained, goodness_of_fit
from .unnamed import is_named

__all__ = ["leftover_of", "remainder_of", "unexplained_after"]

Array = NDArray[np.float64]


def leftover_of(signals: Signals, residual: Array, lines: LineBasis) -> Leftover:
    """Residuals with the signals of their readings; speed, load and temperature as factors."""
    factors: dict[str, Array] = {}
    if signals.velocity is not None:
        factors["speed"] = np.abs(signals.velocity)
    if signals.torque is not None and signals.torque.any():
        factors["torque"] = signals.torque
    if signals.temperature is not None:
        factors["temperature"] = signals.temperature
    return Leftover(
        residual,
        signals.theta,
        signals.direction,
        signals.run,
        signals.clock,
        signals.time is not None,
        factors,
        lines.once("left over", None, dict),
    )


def remainder_of(regression: Regression, without: Collection[int] = ()) -> Leftover:
    """What a regression leaves: run effects taken off, outliers put to the limit.

    Structure without a name is left in it, and so are the terms ``without``.
    """
    kept_in = [is_named(t) and k not in without for k, t in enumerate(regression.terms)]
    left = regression.left
    for (term, coefficients), taken in zip(regression.fitted(), kept_in, strict=True):
        if not taken and coefficients.size:
            left = left + term.columns @ coefficients
    effects = [
        term.run_effect
        for term, taken in zip(regression.terms, kept_in, strict=True)
        if taken and term.run_effect is not None
    ]
    # Those kept alone: beside ones that are left in, each would take what the other gives.
    noise = Whitener(regression.bounds, regression.whiten.rho, effects, regression.weights)
    left = left - noise.run_part(left)
    kept = left[~regression.outlying]
    if regression.outlying.any() and kept.size:
        left = np.clip(left, float(kept.min()), float(kept.max()))
    return leftover_of(regression.signals, left * regression.root_weights, regression.lines)


def unexplained_after(
    regression: Regression,
    sigma: float | None = None,
    rounding: float = 0.0,
    without: Collection[int] = (),
) -> Unexplained:
    """Goodness of fit of what a regression leaves, up to the orders that it looks for.

    Terms ``without`` count as left: those of findings that were not confirmed.
    """
    return goodness_of_fit(
        remainder_of(regression, without), float(regression.lines.orders.max()), sigma, rounding
    )
