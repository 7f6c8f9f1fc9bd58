"""The uncertainty budget of one value: propagated covariance, contributions, U."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from functools import cached_property
from types import MappingProxyType
from typing import Final

import numpy as np
from numpy.typing import ArrayLike

from ..errors import ArgumentError
from ..support.arrays import Array
from ..support.distributions import student_quantile

#: Coverage probability of U: two standard deviations of a normal distribution.
LEVEL: Final = 0.9545

#: Half width over standard uncertainty (JCGM 100, 4.3; JCGM 101, 6.4). A normal half width
#: is one of 95.45 %, as a calibration certificate with k = 2 states it.
DISTRIBUTIONS: Final[Mapping[str, float]] = MappingProxyType(
    {
        "normal": 2.0,
        "rectangular": math.sqrt(3.0),
        "triangular": math.sqrt(6.0),
        "arcsine": math.sqrt(2.0),
        "two-point": 1.0,
    }
)


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

    @property
    def standard(self) -> Array:
        """Standard uncertainty of every value."""
        return np.sqrt(np.diag(self.covariance))

    @property
    def correlation(self) -> Array:
        """Correlation coefficients; 0 with a quantity that is known exactly."""
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
        # Step of a central difference in standard uncertainties: so far a measurement model has to
        # be straight anyway for the law of propagation to hold (JCGM 100, 5.1.3 note 2).
        for j, step in enumerate(1e-3 * self.standard):
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


@dataclass(frozen=True)
class Contribution:
    """One line of a budget.

    Parameters
    ----------
    name : str
    standard : float
        Standard uncertainty of the input, in arcsec; not negative.
    kind : {"A", "B"}
        Evaluated from the readings, or otherwise known.
    distribution : str
        One of `DISTRIBUTIONS`, or "t" for what the readings gave.
    degrees_of_freedom : float
        Infinite where the standard uncertainty is taken as known.
    sensitivity : float
        Change of the value for a change of the input.
    """

    name: str
    standard: float
    kind: str = "B"
    distribution: str = "normal"
    degrees_of_freedom: float = math.inf
    sensitivity: float = 1.0

    def __post_init__(self) -> None:
        if not (math.isfinite(self.standard) and self.standard >= 0.0):
            raise ArgumentError(
                f"contribution {self.name!r}: the standard uncertainty must be a finite number "
                f"that is not negative, got {self.standard!r}"
            )
        if not self.degrees_of_freedom > 0.0:
            raise ArgumentError(
                f"contribution {self.name!r}: degrees_of_freedom must be positive, got "
                f"{self.degrees_of_freedom!r}"
            )
        if not math.isfinite(self.sensitivity):
            raise ArgumentError(
                f"contribution {self.name!r}: sensitivity must be finite, got {self.sensitivity!r}"
            )

    @property
    def effect(self) -> float:
        """Its part of the value's standard uncertainty, abs(sensitivity) * standard."""
        return abs(self.sensitivity) * self.standard


@dataclass(frozen=True)
class Budget:
    """Independent contributions to one value.

    ::

        u_c² = Σ_i c_i² u_i²,
        ν_eff = u_c⁴ / (Σ_i (c_i u_i)⁴/ν_i),
        U = k u_c

    with k the quantile of Student's distribution for `LEVEL` and ``ν_eff``
    cut to a whole number (JCGM 100, 5.1.2, G.4.1 and G.6.4); 2 where it is infinite.

    Examples
    --------
    End gauges (JCGM 100, H.1.6): 32 nm with 16 degrees of freedom.

    >>> gauge = Budget((Contribution("standard", 25.0, degrees_of_freedom=18),
    ...                 Contribution("difference", 9.7, "A", "t", 25.6),
    ...                 Contribution("expansion", 2.9, degrees_of_freedom=50),
    ...                 Contribution("temperature", 16.6, degrees_of_freedom=2)))
    >>> round(gauge.standard), int(gauge.degrees_of_freedom)
    (32, 16)
    """

    contributions: tuple[Contribution, ...]

    @cached_property
    def standard(self) -> float:
        """Combined standard uncertainty."""
        return math.hypot(*(item.effect for item in self.contributions))

    @cached_property
    def degrees_of_freedom(self) -> float:
        """Effective degrees of freedom by Welch and Satterthwaite."""
        if self.standard == 0.0:
            return math.inf
        # Relative effects: fourth powers of small numbers stay above the smallest float.
        spent = sum(
            (item.effect / self.standard) ** 4 / item.degrees_of_freedom
            for item in self.contributions
        )
        return 1.0 / spent if spent > 0.0 else math.inf

    @property
    def coverage_factor(self) -> float:
        """K of `LEVEL`."""
        return coverage_factor(self.degrees_of_freedom)

    @property
    def expanded(self) -> float:
        """U, the half width of the interval that holds the value at `LEVEL`."""
        return self.coverage_factor * self.standard

    def shares(self, decimals: int = 1) -> list[float]:
        """Parts of the combined variance in percent, rounded so that they add up to 100.

        Each is rounded down; the largest remainders are rounded up (Hamilton's method).

        Examples
        --------
        >>> thirds = Budget(tuple(Contribution(name, 1.0) for name in "abc"))
        >>> thirds.shares()
        [33.4, 33.3, 33.3]
        """
        whole = 10**decimals * 100
        exact = [whole * self.share(item) for item in self.contributions]
        if not any(exact):
            return exact
        found = [math.floor(value) for value in exact]
        least = sorted(range(len(exact)), key=lambda k: found[k] - exact[k])
        for k in least[: whole - sum(found)]:
            found[k] += 1
        return [value / 10**decimals for value in found]

    def share(self, item: Contribution) -> float:
        """Part of the combined variance that a contribution brings."""
        return (item.effect / self.standard) ** 2 if self.standard > 0.0 else 0.0


def coverage_factor(degrees_of_freedom: float, level: float = LEVEL) -> float:
    """Student's quantile for a two-sided interval; degrees of freedom cut to whole ones.

    Examples
    --------
    >>> round(coverage_factor(16.7, 0.99), 2), round(coverage_factor(math.inf), 2)
    (2.92, 2.0)
    """
    whole = (
        # Whole degrees of freedom that went through a sum of one stay whole.
        max(math.floor(degrees_of_freedom * (1.0 + 1e-12)), 1)
        if math.isfinite(degrees_of_freedom)
        else math.inf
    )
    return student_quantile(0.5 + 0.5 * level, whole)
