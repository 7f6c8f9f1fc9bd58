"""The noise at each order, as units of readings and neighbouring orders tell it."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ...support.quantiles import median
from .evidence import COLLINEAR, OVERDISPERSED, fit_subset, log_chi2_tail
from .harmonicsums import HarmonicSums

__all__ = ["NEIGHBOURS", "neighbour_scatter", "pooled_scatter", "run_scatter"]

Array = NDArray[np.float64]

#: Orders next to one that tell the noise there.
NEIGHBOURS: Final = 12


def run_scatter(sums: HarmonicSums, chosen: Sequence[int], orders: Sequence[int]) -> Array:
    """Variance of one reading as each order's coefficients vary between the units.

    ::

        s_k² = (1 / (2(R-1))) Σ_r h_rkᵀ H_rk⁻¹ h_rk

    with the scores ``h = X' W (y - model)`` of each unit about their common fit: the
    noise at that order, whatever its colour, including what really changes from run to
    run. Infinite with one unit.
    """
    index = np.asarray(orders, dtype=np.intp)
    if sums.units < 2 or index.size == 0:
        return np.full(index.size, math.inf)
    coefficients, _, _ = fit_subset(sums, chosen)
    n = index.size
    parts = []
    # What one order has in common with itself does not depend on those chosen.
    own = sums.blocks()[:, index]
    # At one unit's places an order may vanish: it says nothing there.
    least = np.maximum(1e-9 * np.trace(own, axis1=2, axis2=3), 1e-200)
    own = own + least[..., None, None] * np.eye(2)
    for unit, blocks in enumerate(own):
        score = sums.rhs(unit, index) - sums.gram(unit, index, chosen) @ coefficients
        parts.append((blocks, np.stack([score[:n], score[n:]], axis=1)))
    together = np.sum([blocks for blocks, _ in parts], axis=0)
    common = np.linalg.solve(together, np.sum([s for _, s in parts], axis=0)[..., None])
    quadratic = np.zeros(n)
    for blocks, score in parts:
        own = score - (blocks @ common)[..., 0]
        quadratic += np.einsum("ki,ki->k", own, np.linalg.solve(blocks, own[..., None])[..., 0])
    return np.asarray(quadratic / (2.0 * (sums.units - 1)))


def neighbour_scatter(sums: HarmonicSums, chosen: Sequence[int]) -> Array | None:
    """Variance of one reading as the orders next to each say it, for noise that has a colour.

    ::

        s_k² = median_{j~k}{T_j} / (2 ln 2)

    with the reduction ``T`` of the sum of squares by each of the `NEIGHBOURS` nearest orders
    that are not chosen: two squares of normal numbers each, the noise at about that order. None
    where there are too few of them.
    """
    taken = set(chosen)
    others = np.array([i for i in range(sums.orders.size) if i not in taken], dtype=np.intp)
    if others.size < 2 * NEIGHBOURS:
        return None
    total, rhs, _ = sums.total()
    coefficients, inverse, _ = fit_subset(sums, chosen)
    base = sums.columns(chosen)
    n = sums.orders.size
    cosine, sine = others, others + n
    to_cosine, to_sine = total[np.ix_(base, cosine)], total[np.ix_(base, sine)]
    by_cosine, by_sine = inverse @ to_cosine, inverse @ to_sine
    aa = total[cosine, cosine] - np.einsum("bk,bk->k", to_cosine, by_cosine)
    bb = total[sine, sine] - np.einsum("bk,bk->k", to_sine, by_sine)
    ab = total[cosine, sine] - np.einsum("bk,bk->k", to_cosine, by_sine)
    a = rhs[cosine] - to_cosine.T @ coefficients
    b = rhs[sine] - to_sine.T @ coefficients
    det = aa * bb - ab * ab
    seen = det > (COLLINEAR * (total[cosine, cosine] + total[sine, sine])) ** 2
    others, gain = others[seen], (bb * a * a - 2.0 * ab * a * b + aa * b * b)[seen] / det[seen]
    if others.size < 2 * NEIGHBOURS:
        return None
    places = sums.orders[others]
    found = np.empty(n)
    half = NEIGHBOURS // 2
    for k in range(n):
        low = int(np.searchsorted(places, sums.orders[k]))
        first = min(max(0, low - half), others.size - NEIGHBOURS - 1)
        window = np.arange(first, first + NEIGHBOURS + 1)
        window = window[others[window] != k][:NEIGHBOURS]
        found[k] = median(gain[window])
    return np.asarray(np.maximum(found, 0.0) / (2.0 * math.log(2.0)))


def pooled_scatter(scatter: Array, units: int) -> tuple[float, float] | None:
    """Noise common to most orders: mean of their scatter, the overdispersed left out."""
    finite = scatter[np.isfinite(scatter)]
    each = 2 * (units - 1)
    if finite.size * each < 20:
        return None
    # Median of chi-square over its mean (Wilson and Hilferty).
    middle = float(median(finite)) / (1.0 - 2.0 / (9.0 * each)) ** 3
    if middle <= 0.0:  # copies of one run
        return None
    usual = finite[log_chi2_tail(finite / middle * each, each) > math.log(OVERDISPERSED)]
    if usual.size * each < 20:
        return None
    return float(usual.mean()), float(usual.size * each)
