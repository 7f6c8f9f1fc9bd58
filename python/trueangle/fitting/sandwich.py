"""How a robust loss changes variances: Huber's covariance of an M-estimate.

Where the weights of a loss are treated as those of the readings, a reading far off counts in the
noise by its distance, though it moves the coefficients by a bounded step.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..support.arrays import Array
from .problem import Problem, SolvedProblem
from .robust import SETTLED


class Sandwich(NamedTuple):
    """Factors for variances that were computed with the loss's weights as those of the readings.

    ``white``: of covariances of white noise; ``bread``: of those by how scores scatter;
    ``scores``: of the variance of a score.
    """

    white: float = 1.0
    bread: float = 1.0
    scores: float = 1.0


def sandwich(
    problem: Problem, fitted: SolvedProblem, weights: Sequence[Array | None], loss: str
) -> Sandwich:
    """The factors of an M-estimate; 1 for least squares, whether readings were rejected or not.

    With ``ψ = w r`` and the weights b as given, its covariance is

    ::

        K² [Σ b ψ² / (n - p)] / m² (X' B X)⁻¹,    m = Σ b ψ' / Σ b,
        K = 1 + (p / n) var(ψ') / m²

    and ``X' W X ≈ w̄ X' B X``. Source: Huber, Robust Statistics (1981), section 7.6.
    """
    if loss not in ("huber", "tukey"):
        return Sandwich()
    parts = problem.residuals(fitted)
    rest = np.concatenate(parts)
    base, both = (
        np.concatenate(
            [np.ones(r.size) if w is None else w for w, r in zip(of, parts, strict=True)]
        )
        for of in (problem.base, weights)
    )
    used = base > 0.0
    rest, base, both = rest[used], base[used], both[used]
    weight, squares = both / base, float(both @ rest**2)
    slope = _slope(weight, loss)
    mean, bend = float(np.average(weight, weights=base)), float(np.average(slope, weights=base))
    if not (squares > 0.0 and bend > 0.0):
        return Sandwich()
    spread = float(np.average((slope - bend) ** 2, weights=base)) / bend**2
    few = 1.0 + (problem.unknowns + len(problem.runs)) / rest.size * spread
    scores = float((both * weight) @ rest**2) / squares / mean
    bread = (few * mean / bend) ** 2
    return Sandwich(scores * bread, bread, scores)


def _slope(weight: Array, loss: str) -> Array:
    """``ψ'`` of readings of these weights."""
    if loss == "huber":
        return np.where(weight >= 1.0 - SETTLED, 1.0, 0.0)
    root = np.sqrt(weight)
    return np.asarray(root * (5.0 * root - 4.0))
