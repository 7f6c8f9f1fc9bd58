"""Estimates with their covariance, and the law of propagation of uncertainty."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

import numpy as np
from numpy.typing import ArrayLike

from ..errors import ArgumentError
from ..support.arrays import Array

#: Step of a central difference in standard uncertainties: so far a measurement model has to
#: be straight anyway for the law of propagation to hold (JCGM 100, 5.1.3 note 2).
_STEP = 1e-3


@dataclass(frozen=True, eq=False)
class Estimates:
    """Values of several quantities and their covariance.

    Attributes
    ----------
    values : ndarray, shape (n,)
    covariance : ndarray, shape (n, n)
    degrees_of_freedom : float
        Of the covariance; infinite where it is known.
    """

    values: Array
    covariance: Array
    degrees_of_freedom: float = np.inf

    @classmethod
    def from_observations(cls, observations: ArrayLike) -> Self:
        """Means of simultaneous observations (Type A, JCGM 100, 4.2 and 5.2.3).

        ::

            u(q̄, r̄) = Σ_k (q_k - q̄)(r_k - r̄) / (n (n - 1))

        Parameters
        ----------
        observations : array_like, shape (k, n)
            k >= 2 observations of each of n quantities, taken together.
        """
        sets = np.asarray(observations, dtype=np.float64)
        if sets.ndim != 2 or sets.shape[0] < 2:
            raise ArgumentError(
                "observations must be a table of two rows or more, a column for each "
                f"quantity; got shape {sets.shape}"
            )
        count = sets.shape[0]
        covariance = np.atleast_2d(np.cov(sets, rowvar=False)) / count
        return cls(sets.mean(axis=0), covariance, count - 1.0)

    @property
    def standard(self) -> Array:
        """Standard uncertainty of every value."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def correlation(self) -> Array:
        """Correlation coefficients; 0 beside a quantity that is known exactly."""
        scale = np.where(self.standard > 0.0, self.standard, 1.0)
        return np.asarray(self.covariance / np.outer(scale, scale))

    def through(self, model: Callable[[Array], ArrayLike]) -> Estimates:
        """What a measurement model makes of the values (JCGM 100, 5.2.2).

        ::

            V_y = J V_x Jᵀ,    J_ij = ∂ f_i / ∂ x_j

        The sensitivities are central differences over a thousandth of the standard
        uncertainty.

        Examples
        --------
        >>> two = Estimates(np.array([3.0, 4.0]), np.diag([0.01, 0.04]))
        >>> product = two.through(lambda x: [x[0] * x[1]])
        >>> round(float(product.standard[0]), 4)
        0.7211
        """
        values = np.atleast_1d(np.asarray(model(self.values), dtype=np.float64))
        jacobian = np.zeros((values.size, self.values.size))
        for j, step in enumerate(_STEP * self.standard):
            if step > 0.0:
                shift = np.zeros(self.values.size)
                shift[j] = step
                above = np.asarray(model(self.values + shift), dtype=np.float64)
                below = np.asarray(model(self.values - shift), dtype=np.float64)
                jacobian[:, j] = (above - below) / (2.0 * step)
        return Estimates(values, propagated(jacobian, self.covariance), self.degrees_of_freedom)


def propagated(jacobian: ArrayLike, covariance: ArrayLike) -> Array:
    """Covariance ``J V Jᵀ`` of linear functions, shape (m, m), exactly symmetric."""
    rows = np.asarray(jacobian, dtype=np.float64)
    result = rows @ np.asarray(covariance, dtype=np.float64) @ rows.T
    return np.asarray(0.5 * (result + result.T))
