"""Robust fits that may have broken down: too many readings stand apart, or stand together."""

from __future__ import annotations

import math
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ..support.display_units import brief
from .problem import Problem
from .robust import FAR, MANY, Weighted, robust_scale

__all__ = ["breakdown_sentence"]

Array = NDArray[np.float64]

#: With this share of them a robust fit of several orders is at its end wherever they are ...
_MOST: Final = 0.15
#: ... and with `MANY` where neighbours in angle agree so many times better than the fit:
#: the readings that stand apart stand together, and the model has bent towards them.
_BENT: Final = 3.0


def breakdown_sentence(problem: Problem, weighted: Weighted) -> str:
    """What to tell of a robust fit at the end of its powers; empty where it is not."""
    share, robust = weighted.far, weighted.weights is not None or weighted.wild > 0
    if share <= MANY and not robust:
        return ""
    rest = problem.residuals(weighted.fitted)
    scale, near = robust_scale(np.concatenate(rest)), _between_neighbours(problem, rest)
    bent = scale > _BENT * near
    if robust and share > (MANY if bent else _MOST):
        return (
            f"{100.0 * share:.0f} % of the readings lie beyond {FAR:g} robust standard deviations "
            "(0.7 % of normal ones do): more than a robust fit holds out against, where they stand "
            "together; the coefficients may be off by far more than their errors. Look at the "
            "residuals, and give the readings that are wrong weight 0"
        )
    # Most neighbours are equal where a joint rests or a grid is coarse: they tell nothing.
    if not bent or near == 0.0:
        return ""
    # A block of readings that the few orders cannot follow widens the scale it is judged by.
    many = ", more than a robust fit holds out against" if robust else ""
    return (
        f"the residuals are {brief(scale / near)} times what neighbours in angle differ by: the "
        f"model lacks an effect, or wrong readings stand together{many}; look at the residuals"
    )


def _between_neighbours(problem: Problem, residuals: list[Array]) -> float:
    """Standard deviation of a reading by how neighbours in angle differ, run by run."""
    steps = [
        np.diff(rest[np.argsort(np.mod(x, problem.period), kind="stable")])
        for rest, x in zip(residuals, problem.angles, strict=True)
    ]
    return robust_scale(np.concatenate(steps)) / math.sqrt(2.0)
