"""Evidence for orders: log chances with a bound for the search, forward choice, held-out gain.

All of it works on the normal equations of `HarmonicSums`; the readings are not touched
again. An order has two coefficients, so that with noise variance s^2 known from v
degrees of freedom the statistic ``T = gain / s^2`` of a line that is not there follows
``2 F(2, v)``, whose tail is ``(1 + T / v)^(-v / 2)``.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ...estimation.linear import pseudo_inverse
from ...support.arrays import Array
from .harmonicsums import HarmonicSums
from .noisespectrum import NoiseSpectrum, log_chance

Index = NDArray[np.intp]

#: A candidate whose columns keep less than this of their energy beside those already
#: chosen is an alias of them.
COLLINEAR: Final = 1e-8

#: Least degrees of freedom that a residual must keep.
_LEAST_DOF: Final = 3


def log_chi_squared_tail(x: Array, dof: int) -> Array:
    """Log of the upper tail of chi-square with an even number of degrees of freedom."""
    half = 0.5 * np.asarray(x, dtype=np.float64)[..., None]
    i = np.arange(dof // 2)
    terms = i * np.log(np.maximum(half, 1e-300)) - np.array([math.lgamma(j + 1.0) for j in i])
    top = terms.max(axis=-1, keepdims=True)
    return np.asarray(-half[..., 0] + top[..., 0] + np.log(np.exp(terms - top).sum(axis=-1)))


def _pairs(matrix: Array, n: int) -> tuple[Array, Array, Array]:
    """Entries aa, ab, bb of the 2x2 diagonal blocks of orders."""
    i = np.arange(n)
    return matrix[i, i], matrix[i, i + n], matrix[i + n, i + n]


def choose_forward(
    sums: HarmonicSums,
    log_limits: Array,
    readings: int,
    noise: NoiseSpectrum | None,
    forced: Sequence[int] = (),
    barred: Sequence[int] = (),
) -> list[int]:
    """Indices of orders, taken one by one while the best of the rest is significant.

    ``log_limits`` is the log of the false-alarm probability that each order may use up,
    ``readings`` their number less that of the zeros, ``noise`` that of every order (None: the
    residual of the orders chosen so far, the one on trial included). ``forced`` orders are taken
    first, whatever they bring, ``barred`` ones never; among aliases the lowest of the likeliest is
    taken.
    """
    gram, rhs, rest = sums.total()
    rhs, n = rhs.copy(), sums.orders.size
    # Rows and factors of the chosen orders: of what these leave of the matrix only each order's own
    # block and the rows of the next one are asked for.
    rows = factors = np.empty((0, 2 * n))
    aa, ab, bb = (part.copy() for part in _pairs(gram, n))
    # Scale free: energy of both columns, the smaller direction counts.
    energy = 0.5 * (aa + bb)
    alive = energy > 0.0
    alive[list(barred)] = False
    chosen: list[int] = []
    queue = list(forced)
    while alive.any():
        dof = readings - 2 * len(chosen) - 2
        if dof < _LEAST_DOF:
            break
        det = aa * bb - ab * ab
        alive &= det > (COLLINEAR * energy) ** 2
        alive &= np.minimum(aa, bb) > COLLINEAR * energy
        safe = np.where(alive, det, 1.0)
        a, b = rhs[:n], rhs[n:]
        gain = np.where(alive, (bb * a * a - 2.0 * ab * a * b + aa * b * b) / safe, 0.0)
        if queue:
            best = queue.pop(0)
            if not alive[best]:
                continue
        else:
            if noise is None:
                # Of collinear columns rounding makes a gain beyond all there is.
                left = np.maximum(rest - gain, 1e-200)
                score = log_chance(gain * dof / left, dof) - log_limits
            else:
                score = noise.log_chance(gain) - log_limits
            score = np.where(alive, score, math.inf)
            top = int(np.argmin(score))
            if not score[top] <= 0.0:
                break
            # Aliases explain equally much: keep one that was asked for, and the lowest.
            same = np.flatnonzero(alive & (gain >= gain[top] * (1.0 - 1e-9)))
            best = int(same[np.lexsort((sums.orders[same], -log_limits[same]))[0]])
        chosen.append(best)
        pivot = sums.columns([best])
        row = gram[pivot] - rows[:, pivot].T @ factors
        factor = np.linalg.solve(row[:, pivot], row)
        rows, factors = np.vstack([rows, row]), np.vstack([factors, factor])
        aa -= (row[:, :n] * factor[:, :n]).sum(axis=0)
        ab -= (row[:, :n] * factor[:, n:]).sum(axis=0)
        bb -= (row[:, n:] * factor[:, n:]).sum(axis=0)
        rest -= float(gain[best])
        rhs -= factor.T @ rhs[pivot]
        alive[best] = False
    return chosen


def fit_chosen_orders(sums: HarmonicSums, chosen: Sequence[int]) -> tuple[Array, Array, float]:
    """Coefficients of the chosen orders, inverse normal matrix, residual sum of squares."""
    gram, rhs, squares = sums.total()
    columns = sums.columns(chosen)
    if columns.size == 0:
        return np.zeros(0), np.zeros((0, 0)), squares
    inverse = pseudo_inverse(gram[columns[:, None], columns])
    coefficients = inverse @ rhs[columns]
    return coefficients, inverse, max(0.0, squares - float(rhs[columns] @ coefficients))


def held_out_gains(
    sums: HarmonicSums, chosen: Sequence[int], orders: Sequence[int]
) -> tuple[Array, Array, float]:
    """Held-out sum of squares with and without each order, one unit left out at a time.

    The left-out unit keeps its own zero, the chosen orders come from the other units.

    Returns
    -------
    without, with_ : ndarray, shape (len(orders),)
        For an order among the chosen ones ``with_`` is the model itself; for another one
        ``without`` is. Entry by entry their difference is the gain of that order.
    model : float
        Held-out sum of squares of the chosen orders.
    """
    position = {k: i for i, k in enumerate(chosen)}
    outside = [k for k in orders if k not in position]
    both = np.asarray([*chosen, *outside], dtype=np.intp)
    size, every = len(chosen), both.size
    base = np.concatenate([np.arange(size), np.arange(size) + every])
    other = np.stack([np.arange(size, every), np.arange(size, every) + every], axis=1)
    grams = [sums.gram(u, both) for u in range(sums.units)]
    rhs = [sums.rhs(u, both) for u in range(sums.units)]
    total, whole = np.sum(grams, axis=0), np.sum(rhs, axis=0)
    model = 0.0
    dropped, added = np.zeros(size), np.zeros(len(outside))
    for gram, mine, squares in zip(grams, rhs, sums.squares, strict=True):
        train, score = total - gram, whole - mine
        inverse = pseudo_inverse(train[np.ix_(base, base)])
        fitted = inverse @ score[base]
        here = gram[np.ix_(base, base)]
        left = mine - gram[:, base] @ fitted
        error = float(squares - fitted @ (mine[base] + left[base]))
        model += error
        # Dropping order j moves all coefficients by -inverse_j inverse_jj^-1 fitted_j.
        pairs = np.stack([np.arange(size), np.arange(size) + size], axis=1)
        own = np.linalg.pinv(inverse[pairs[:, :, None], pairs[:, None, :]], hermitian=True)
        back = np.einsum("bki,kij,kj->bk", inverse[:, pairs], own, fitted[pairs])
        dropped += error + 2.0 * left[base] @ back + np.einsum("bk,bk->k", back, here @ back)
        # Adding an order moves the others by -slope times its own coefficients.
        slope = (inverse @ train[np.ix_(base, other.ravel())]).reshape(2 * size, len(outside), 2)
        flat = train[np.ix_(base, other.ravel())].reshape(2 * size, len(outside), 2)
        blocks = train[other[:, :, None], other[:, None, :]] - np.einsum(
            "bki,bkj->kij", flat, slope
        )
        step = np.einsum(
            "kij,kj->ki",
            np.linalg.pinv(blocks, rcond=COLLINEAR, hermitian=True),
            score[other] - np.einsum("bki,b->ki", flat, fitted),
        )
        move = np.einsum("bki,ki->bk", slope, step)
        linear = np.einsum("ki,ki->k", step, left[other]) - left[base] @ move
        mixed = gram[np.ix_(base, other.ravel())].reshape(2 * size, len(outside), 2)
        square = (
            np.einsum("ki,kij,kj->k", step, gram[other[:, :, None], other[:, None, :]], step)
            - 2.0 * np.einsum("bk,bki,ki->k", move, mixed, step)
            + np.einsum("bk,bk->k", move, here @ move)
        )
        added += square - 2.0 * linear
    without, with_ = np.full(len(orders), model), np.full(len(orders), model)
    for i, k in enumerate(orders):
        if k in position:
            without[i] = dropped[position[k]]
        else:
            with_[i] += added[outside.index(k)]
    return without, with_, model
