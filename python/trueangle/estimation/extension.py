"""A candidate extension of the regression, with its evidence and penalty."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ..support.arrays import Array
from .whitening import RunEffect

#: Size at which an effect is expected, in standard deviations of one reading. A coefficient
#: costs ln(size^2 n) (Kass and Wasserman 1995; size 1 is Schwarz's penalty). Up to
#: `FEW_READINGS` effects must be as large as the noise to matter; of many more are taken
#: because effects are smaller.
EXPECTED_SIZE = 0.3
FEW_READINGS = 900


@dataclass(frozen=True, eq=False)
class Extension:
    """A candidate extension with its evidence.

    ::

        bic gain = 2 Δ ln L - k ln n_e - 2 ln(grid)

    with ``n_e`` the readings, or the runs for the variance of a run effect, that
    inform on a parameter.

    Attributes
    ----------
    cause : str
    shape : dict
        What was searched for: order, length, place ... enough to rebuild the columns.
    columns : ndarray, shape (n, p)
        Regressors; none for a run effect.
    run_effect : RunEffect or None
    parameters : int
        k.
    log_grid : float
        ln of the number of alternatives that were searched.
    deviance : float
        2 ln of the likelihood ratio.
    line : float or None
        Output order, where it adds a line to the joint's pattern.
    """

    cause: str
    shape: dict[str, Any]
    columns: Array
    parameters: int
    log_grid: float = 0.0
    deviance: float = 0.0
    log_n: float = 0.0
    run_effect: RunEffect | None = None
    coefficients: Array = field(default_factory=lambda: np.zeros(0))
    line: float | None = None

    @property
    def bic_gain(self) -> float:
        """Evidence: the deviance less the penalty of its parameters and of the search."""
        return self.deviance - self.parameters * self.log_n - 2.0 * self.log_grid


def penalty_of_parameter(readings: int) -> float:
    """Units of BIC that a coefficient costs."""
    informing = max(min(readings, FEW_READINGS), EXPECTED_SIZE**2 * readings)
    return float(np.log(max(informing, 2.0)))
