"""Orders, coefficients and noise of runs by the evidence of one linear model of all readings."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from .._core import Evidence
from ..support.arrays import Array

#: Correlation times of the noise's exponential terms, in median steps of a run's time.
CORRELATION_TIMES = tuple(Evidence.CORRELATION_TIMES)


class RunReadings(NamedTuple):
    """Readings of one run in the order in which they were read."""

    theta: Array  #: Angles, radians.
    error: Array  #: Errors, any unit.
    time: Array | None = None  #: Times that do not decrease; None: equally spaced.


class WeightedModel(NamedTuple):
    """One model of a mixture."""

    weight: float  #: Posterior probability.
    tau: Array  #: Prior variance of each order's coefficients; 0: not in the model.
    omega: Array  #: Variance of what differs from run to run, of each order.


@dataclass(frozen=True)
class EvidenceEstimate:
    """Posterior of orders, coefficients and noise.

    Attributes
    ----------
    orders : tuple of int
        The orders that were tested.
    probability : ndarray, shape (K,)
        Posterior probability that each order is in the error.
    mean, covariance : ndarray, shapes (2 K,) and (2 K, 2 K)
        Of the cosine and the sine of every order in turn; the mixture over models and noises.
    noise : ndarray, shape (6,)
        Variances of the noise at the maximum of the evidence: its white part, and the terms with
        the correlation times `CORRELATION_TIMES`.
    models : tuple of WeightedModel
        Models of the mixture, the most probable first.
    """

    orders: tuple[int, ...]
    probability: Array
    mean: Array
    covariance: Array
    noise: Array
    models: tuple[WeightedModel, ...]

    @property
    def included(self) -> tuple[int, ...]:
        """Orders that are more probably in the error than not."""
        return tuple(k for k, p in zip(self.orders, self.probability, strict=True) if p > 0.5)

    def curve(self, theta: Array) -> tuple[Array, Array]:
        """Error curve at angles in radians, less its mean over them, and its standard deviation."""
        waves = np.multiply.outer(theta, self.orders)
        columns = np.stack([np.cos(waves), np.sin(waves)], axis=2).reshape(len(theta), -1)
        columns -= columns.mean(axis=0)
        variance = np.einsum("ij,jk,ik->i", columns, self.covariance, columns)
        return columns @ self.mean, np.sqrt(np.maximum(variance, 0.0))


def estimate_by_evidence(
    runs: Sequence[RunReadings],
    orders: Sequence[int],
    probability: Sequence[float] | None = None,
) -> EvidenceEstimate:
    """Estimate orders, their coefficients and the noise of runs together.

    The model of the readings y of run r, with X the cosines and sines of the orders:

    ::

        y_r = z_r + X_r (b + d_r) + n_r
        b_k ~ 0 or N(0, tau_k I),   d_rk ~ N(0, omega_k I),   z_r flat
        n_r ~ N(0, C),   C = w I + sum_j a_j exp(-|dt| / T_j)

    Noise and variances are those of most evidence, and the result is the mixture over the models
    and noises that are nearly as probable. Nothing is random.

    Parameters
    ----------
    runs : sequence of RunReadings
    orders : sequence of int
        From 1, increasing.
    probability : sequence of float, optional
        Prior probability of each order, above 0 and below 1; 1/K of each by default, or 1/2 of one.

    Raises
    ------
    ArgumentError
        Readings that are not finite or not equally many, times that decrease, orders that do not
        increase.

    Examples
    --------
    >>> theta = np.linspace(0.0, 2.0 * np.pi, 90, endpoint=False)
    >>> ripple = 0.3 * np.cos(np.arange(90.0) ** 2)
    >>> runs = [RunReadings(theta, 5.0 * np.cos(2.0 * theta) + s * ripple) for s in (1.0, -1.0)]
    >>> estimate_by_evidence(runs, [1, 2, 3, 4]).included
    (2,)
    """
    if probability is None:
        probability = [1.0 / max(len(orders), 2)] * len(orders)
    given = [
        (np.asarray(run.theta, float), np.asarray(run.error, float), _times(run.time))
        for run in runs
    ]
    own, mean, covariance, noise, models = Evidence(given, orders).estimate(probability)
    weighted = (WeightedModel(w, np.array(tau), np.array(omega)) for w, tau, omega in models)
    return EvidenceEstimate(tuple(orders), own, mean, covariance, noise, tuple(weighted))


def _times(time: Array | None) -> Array | None:
    return None if time is None else np.asarray(time, float)
