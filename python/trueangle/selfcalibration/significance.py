"""Orders that stand out of their own standard errors."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ..support.distributions import chi_squared_quantile
from .projected import Projected

__all__ = ["chosen_orders"]

#: Probability of taking up any order that is not there.
_CHANCE: Final = 0.01


def chosen_orders(
    projected: Projected,
    coefficients: NDArray[np.float64],
    covariance: NDArray[np.float64],
    among: Sequence[float],
    source: str | None = None,
) -> tuple[float, ...]:
    """Orders of ``among`` whose cosine and sine together are significant."""
    limit = chi_squared_quantile(1.0 - _CHANCE / max(len(among), 1), 2.0)
    kept = []
    for order in among:
        at = [
            i
            for i, column in enumerate(projected.columns)
            if column.order == order and column.part and source in (None, column.source)
        ]
        block, value = covariance[np.ix_(at, at)], coefficients[at]
        size = float(value @ np.linalg.pinv(block, hermitian=True) @ value)
        if size > limit:
            kept.append(order)
    return tuple(kept)
