"""Speed ripple jointly with the encoder's pattern, both weighted by their evidence.

A torque ``T_k cos kθ`` moves a free shaft by ``T_k / (J k² ω²)``. Where the
speed changes, the ripple is distinguished from the pattern, at the cost of a greater standard
error. Where it is not there, that cost is not due. So its size is given a distribution: nothing
with probability one half, else any size, equally probable per octave; the standard error and the
estimate are averages over it (empirical evidence of each order separately).
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from ..estimation.linear import inverse_and_log_determinant, pseudo_inverse
from ..support.arrays import Array

#: Where separating the ripple multiplies the standard error by more, speeds are too
#: close: the sum is given under both names instead. A ratio of speeds of about 1.2.
LARGEST_COST: Final = 10.0

#: Sizes looked at: from a tenth of the standard error to ten thousand of it.
_SIZES: Final = np.logspace(-1.0, 4.0, 61)

#: Prior probability that there is no ripple.
_NONE: Final = 0.5


def cost_of_ripple(ripple: Array) -> float:
    """Factor of the standard error when ripple columns ``ρ H`` are fitted jointly with ``H``.

    ::

        (1 - ρ̄² / mean(ρ²))^(-1/2)

    Examples
    --------
    >>> round(cost_of_ripple(np.exp(np.linspace(0.0, 2.0 * np.log(5.0), 1000))), 2)
    1.53
    """
    share = 1.0 - float(ripple.mean()) ** 2 / float((ripple**2).mean())
    return float(1.0 / np.sqrt(max(share, 1e-16)))


def averaged_over_ripple(
    unknowns: Array, covariance: Array, orders: Sequence[float], ripple: Sequence[float]
) -> tuple[Array, Array, Array]:
    """Pattern and covariance averaged over the size of the ripple at each order.

    ``unknowns`` and ``covariance`` hold pattern, then ripple, without a prior of the ripple's
    size. Returns both, averaged, and the probability that there is ripple at each order.
    """
    m = 2 * len(orders)
    precision = np.zeros(2 * len(ripple))
    spread = np.zeros((m, m))
    probable = np.zeros(len(ripple))
    for i, order in enumerate(ripple):
        b = slice(m + 2 * i, m + 2 * i + 2)
        estimate, block = unknowns[b], covariance[b, b]
        scale = float(np.sqrt(0.5 * np.trace(block)))
        sizes = np.concatenate([[0.0], scale * _SIZES])
        prior = np.concatenate([[_NONE], np.full(_SIZES.size, (1.0 - _NONE) / _SIZES.size)])
        total = block[None] + sizes[:, None, None] ** 2 * np.eye(2)
        inverse, determinant = inverse_and_log_determinant(total)
        chi = np.einsum("i,nij,j->n", estimate, inverse, estimate)
        log = np.log(prior) - 0.5 * chi - 0.5 * determinant
        weight = np.exp(log - log.max())
        weight /= weight.sum()
        # Sizes below the standard error are as good as none.
        probable[i] = float(weight[sizes > scale].sum())
        mean_inverse = float(0.5 * np.einsum("n,nii->", weight, inverse))
        size = max(1.0 / mean_inverse - scale**2, 0.0)
        precision[2 * i : 2 * i + 2] = size
        if order in orders:
            j = list(orders).index(order)
            a = slice(2 * j, 2 * j + 2)
            moved = np.einsum("ij,njk,k->ni", covariance[a, b], inverse, estimate)
            moved -= weight @ moved
            spread[a, a] += (weight[:, None] * moved).T @ moved
    # Ripple with variances ``precision`` a priori: one step of a Kalman filter.
    rows = slice(m, m + 2 * len(ripple))
    measured = covariance[rows, rows] + np.diag(precision)
    gain = pseudo_inverse(measured) @ covariance[rows, : rows.stop]
    corrected = unknowns[: rows.stop] - gain.T @ unknowns[rows]
    after = covariance[: rows.stop, : rows.stop] - covariance[: rows.stop, rows] @ gain
    after[:m, :m] += spread
    return corrected, 0.5 * (after + after.T), probable
