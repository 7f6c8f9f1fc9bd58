"""What causes of the scatter have in common."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..estimation.estimate import Parameters
from ..estimation.regression import Regression
from .search import Array

if TYPE_CHECKING:
    from .effect import Effect

__all__ = ["NEW_SCATTER", "ScatterFinding", "standardised"]

#: Evidence that uneven noise must bring beyond its penalty. Half of what other causes must:
#: nothing in the mean of the readings imitates it.
NEW_SCATTER = 3.0


@dataclass(frozen=True)
class ScatterFinding:
    """A cause of the scatter with its evidence.

    Attributes
    ----------
    cause : str
    bic_gain : float
    parameters : dict
    effects : list of Effect
    weights : ndarray, shape (n,)
        Inverse variances, of mean 1 (uneven noise), or 0 for outliers.
    size : float
        Of the scatter, in standard deviations of one reading.
    """

    cause: str
    bic_gain: float
    parameters: Parameters
    effects: list[Effect]
    weights: Array
    size: float = 1.0


def standardised(regression: Regression) -> Array:
    """Whitened residuals in robust standard deviations."""
    e = regression.whiten(regression.residual - regression.design @ regression.coefficients)
    spread = 1.4826 * float(np.median(np.abs(e)))
    return np.asarray(e / max(spread, 1e-300))
