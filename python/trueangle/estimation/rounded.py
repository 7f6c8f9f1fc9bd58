"""Errors of readings that were rounded: a reading shows only in which step the angle was.

A reading rounded to whole steps q holds its own error to an interval,

::

    ε_i ∈ [e_i - q/2, e_i + q/2],    e_i = y_i - x_i β,

and is fitted by the probability of that interval under ``ε ~ N(0, σ²)``. It enters the
estimate of β by the expected error within it, whose mean is zero at every angle. That of ``e_i``
is not, unless noise moves readings by half a step and more: on the same positions the rounding is
the same in every run, and looks like a property of the joint. Source: Gourieroux, Monfort, Renault
and Trognon (1987), J. Econometrics 34; residuals sampled within the intervals: Dunn and Smyth
(1996), J. Comp. Graph. Stat. 5.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import trueangle._core as _core

from ..support.arrays import Array

#: Share of the residual from which on the rounding of the readings is a part that matters.
LEAST_SHARE = 0.2

#: Times the variance that is there which the rounding of a sensor may have: on few positions it
#: errs by other numbers than on all, but on none that does not scatter.
MOST_SHARE = 2.0

#: Standard deviation of the noise, in steps, below which readings do not determine it: only one in
#: a dozen is then within two of them of the border of its step.
LEAST_NOISE = 0.03

#: Standard deviations of it by which a reading may be outside of its step.
WITHIN = 2.0

#: Passes at most, and the change of the fit, in steps, at which it has settled.
PASSES, SETTLED = 100, 1e-3


@dataclass(frozen=True)
class Rounded:
    """A fit of readings that were rounded.

    Attributes
    ----------
    fitted : ndarray, shape (n,)
    left : ndarray, shape (n,)
        What it leaves of the readings, in their unit.
    step, sigma : float
        Of the rounding; standard deviation of the noise before it.
    log_likelihood : float
        Of the steps in which the readings are.
    within : bool
        Every reading is the fitted angle, rounded: nothing more can be known from them.
    """

    fitted: Array
    left: Array
    step: float
    sigma: float
    log_likelihood: float
    within: bool

    def drawn(self, rng: np.random.Generator) -> Array:
        """Errors before the rounding, sampled among those that the steps allow.

        Where the fit is right, they are independent and normal of standard deviation ``sigma``,
        wherever readings are in their steps.
        """
        shares = rng.uniform(size=self.left.size)
        return _core.rounded_drawn(self.left, self.step, self.sigma, shares)


def fit_rounded(
    columns: Array, y: Array, step: float, aside: NDArray[np.bool_] | None = None
) -> Rounded:
    """Fit readings that were rounded to whole steps, by maximum likelihood.

    Parameters
    ----------
    columns : ndarray, shape (n, p)
        Orthonormal.
    y : ndarray, shape (n,)
        The readings less what they are expected to be.
    step : float
    aside : ndarray of bool, shape (n,), optional
        Readings without information: outliers.

    Returns
    -------
    Rounded
        Expectation and maximisation, sped up by the share of what rounding hides; at most
        `PASSES` passes of ``n p`` products and n errors.

    Examples
    --------
    >>> places = np.linspace(0.0, 7.3, 200)
    >>> readings = np.round(places + 0.2)
    >>> fit = fit_rounded(np.full((200, 1), 200**-0.5), readings - places, 1.0)
    >>> fit.within, float(np.abs(fit.fitted - 0.2).max()) < 0.05
    (True, True)
    """
    kept = np.ones(y.size, dtype=np.bool_) if aside is None else ~aside
    n, least, error = int(kept.sum()), LEAST_NOISE * step, np.zeros(y.size)
    fitted = columns @ (columns.T @ np.where(kept, y, np.median(y[kept])))
    sigma = max(float(np.std((y - fitted)[kept])), least)
    for _ in range(PASSES):
        left = y - fitted
        error[kept], squares, log_likelihood = _core.rounded(left[kept], step, sigma)
        within = float(np.abs(left[kept]).max()) <= 0.5 * step + WITHIN * least
        if within and sigma == least:
            break
        hidden = (squares - float(error @ error)) / n / sigma**2
        # Least share of the readings' information that a pass counts on: a longer step may go
        # astray.
        change = columns @ (columns.T @ error) / max(1.0 - hidden, 0.05)
        before, sigma = sigma, max(float(np.sqrt(squares / n)), least)
        if max(float(np.abs(change).max()), abs(sigma - before)) < SETTLED * step:
            break
        fitted = fitted + change
    return Rounded(fitted, left, step, sigma, log_likelihood, within)


def is_rounding_visible(rounding: float, left: float, scatter: float) -> bool:
    """Whether rounding is a large part of the residual variance and agrees with the scatter."""
    return LEAST_SHARE * left < rounding < MOST_SHARE * scatter
