"""Readings that count less than those after them."""

from __future__ import annotations

import math
from collections.abc import Hashable, Mapping
from dataclasses import replace

import numpy as np

from ..errors import ArgumentError
from ..support.arrays import Array
from .momentsfit import MomentsFit


class Forgetting:
    """By which factor a reading counts less than the one after it in its run.

    Uncertainties are those of the effective number of readings,
    ``(Σ w)² / Σ w²`` less the unknowns.

    Parameters
    ----------
    factor : float
        Above 0 and at most 1.
    weights : mapping of run to (float, float), optional
        Sums of the weights and of their squares, of readings before.

    Raises
    ------
    ArgumentError
        Another factor.

    Examples
    --------
    >>> forgetting = Forgetting(0.5)
    >>> forgetting.faded(3, None).tolist()
    [0.25, 0.5, 1.0]
    >>> forgetting.follow("day", forgetting.faded(3, None)), forgetting.weights
    (0.125, {'day': (1.75, 1.3125)})
    """

    def __init__(
        self, factor: float, weights: Mapping[Hashable, tuple[float, float]] | None = None
    ) -> None:
        if not 0.0 < factor <= 1.0:
            raise ArgumentError(f"forgetting must lie above 0 and at most at 1, got {factor!r}")
        self.factor = factor
        self._weights = dict(weights or {})

    @property
    def weights(self) -> dict[Hashable, tuple[float, float]]:
        """Sums of weights and of their squares, run by run."""
        return dict(self._weights)

    def copy(self) -> Forgetting:
        """One of its own."""
        return Forgetting(self.factor, self._weights)

    def faded(self, count: int, weights: Array | None) -> Array:
        """Weights of ``count`` successive readings at the time of the last of them."""
        faded = self.factor ** np.arange(count - 1.0, -1.0, -1.0)
        return faded if weights is None else faded * weights

    def follow(self, run: Hashable, weights: Array) -> float:
        """Count readings of these weights; return the factor for all before them."""
        factor = self.factor**weights.size
        first, second = self._weights.get(run, (0.0, 0.0))
        self._weights[run] = (
            factor * first + float(weights.sum()),
            factor * factor * second + float(weights @ weights),
        )
        return float(factor)

    def widened(self, found: MomentsFit, count: int) -> MomentsFit:
        """A fit of ``count`` readings with the uncertainties of their effective number."""
        freedom = found.degrees_of_freedom
        first, second = np.sum([self._weights[run] for run in found.offsets], axis=0)
        unknowns = count - freedom
        effective = max(first * first / second - unknowns, 1e-9)
        spread = math.sqrt(freedom / effective)
        share = first * (1.0 - min(unknowns * second / first**2, 1.0 - 1e-9))
        return replace(
            found,
            covariance=found.covariance * (freedom / effective),
            offset_std={run: std * spread for run, std in found.offset_std.items()},
            residual_variance=found.residual_variance * (freedom / share),
            degrees_of_freedom=effective,
        )
