"""Sums over the readings of a run, whole or in stretches, about the run's mean."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from .clusters import Cluster
from .problem import Fitted, Problem

__all__ = ["clusters_of", "coefficients_of", "runs_together", "weight_of"]

Array = NDArray[np.float64]

#: Most clusters: of more runs several are taken together.
_MOST_CLUSTERS: Final = 128


def coefficients_of(fitted: Fitted) -> Array:
    """``A, B`` of every order of every shaft in turn."""
    solution = fitted.solution
    a, b = (np.concatenate([np.zeros(0), *part]) for part in (solution.cosine, solution.sine))
    return np.column_stack([a, b]).ravel()


def weight_of(weights: Array | None, size: int) -> float:
    """Sum of the weights of so many readings."""
    return float(size) if weights is None else float(weights.sum())


def clusters_of(
    problem: Problem, fitted: Fitted, weights: Sequence[Array | None], index: int, count: int
) -> list[Cluster]:
    """Sums of a run in so many stretches of readings in a row, about the run's mean."""
    sums = problem.products(weights, index, count)
    whole = np.sum(sums, axis=0)
    mean = whole[0] / whole[0, 0]
    coefficients = coefficients_of(fitted)
    found = []
    for one in sums:
        about = one - np.outer(mean, one[0]) - np.outer(one[0], mean)
        about += one[0, 0] * np.outer(mean, mean)
        gram = about[1:-1, 1:-1]
        found.append(Cluster(gram, about[1:-1, -1] - gram @ coefficients))
    return found


def runs_together(clusters: list[Cluster]) -> list[Cluster]:
    """At most so many clusters: further runs are dealt to the first ones."""
    if len(clusters) <= _MOST_CLUSTERS:
        return clusters
    return [
        Cluster(*(np.sum(part, axis=0) for part in zip(*clusters[i::_MOST_CLUSTERS], strict=True)))
        for i in range(_MOST_CLUSTERS)
    ]
