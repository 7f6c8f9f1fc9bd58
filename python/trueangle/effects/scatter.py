"""What causes of the scatter share: standardised residuals and their clipped squares."""

from __future__ import annotations

import numpy as np

from ..estimation.regression import Regression
from ..support.distributions import chi_squared_tail
from .search import Array

#: Multiple of their variances to which squared residuals are clipped.
SQUARE_CLIP = 9.0

# Of z^2 of a normal z where it is below the clip, moments by tails of chi squared (1, 3 and 5
# degrees of freedom): E[z^2], and of min(z^2, clip) mean and mean square.
_ABOVE = chi_squared_tail(SQUARE_CLIP, 1)
_BELOW_SQUARE = 1.0 - chi_squared_tail(SQUARE_CLIP, 3)
CLIPPED_MEAN = _BELOW_SQUARE + SQUARE_CLIP * _ABOVE
_CLIPPED_POWER = 3.0 * (1.0 - chi_squared_tail(SQUARE_CLIP, 5)) + SQUARE_CLIP**2 * _ABOVE

#: Variance of the logarithm of a variance estimated from one clipped square; 2 without the clip.
CLIPPED_VARIANCE = (_CLIPPED_POWER - CLIPPED_MEAN**2) / _BELOW_SQUARE**2

#: Evidence that uneven noise must bring beyond its penalty. Half of what other causes must:
#: nothing in the mean of the readings imitates it.
NEW_SCATTER = 3.0


def standardised_residuals(regression: Regression) -> Array:
    """Whitened residuals in robust standard deviations."""
    e = regression.whiten(regression.residual - regression.design @ regression.coefficients)
    spread = 1.4826 * float(np.median(np.abs(e)))
    return np.asarray(e / max(spread, 1e-300))


def clipped_squares(square: Array, variance: Array) -> Array:
    """Squared residuals in their own variances, clipped, with the mean 1 for normal noise."""
    return np.asarray(np.minimum(square / variance, SQUARE_CLIP) / CLIPPED_MEAN)
