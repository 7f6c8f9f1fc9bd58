"""Chosen orders fitted to normal equations, and their gain in held-out units."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from ...estimation.linear import pseudo_inverse
from ...support.arrays import Array
from .harmonicsums import HarmonicSums

#: A candidate is an alias of the chosen orders if less than this share of its columns' energy
#: is independent of them.
COLLINEAR: Final = 1e-8


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
    """Held-out sum of squares with and without each order, one unit held out at a time.

    The held-out unit keeps its own zero, the chosen orders come from the other units.

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
    grams = [sums.gram(u, chosen, both) for u in range(sums.units)]
    blocks = [sums.blocks(u, both[size:]) for u in range(sums.units)]
    rhs = [sums.rhs(u, both) for u in range(sums.units)]
    total, whole, every_block = (np.sum(part, axis=0) for part in (grams, rhs, blocks))
    model = 0.0
    dropped, added = np.zeros(size), np.zeros(len(outside))
    for gram, block, mine, squares in zip(grams, blocks, rhs, sums.squares, strict=True):
        train, score = total - gram, whole - mine
        inverse = pseudo_inverse(train[:, base])
        fitted = inverse @ score[base]
        here = gram[:, base]
        left = mine - fitted @ gram
        error = float(squares - fitted @ (mine[base] + left[base]))
        model += error
        # Dropping order j moves all coefficients by -inverse_j inverse_jj^-1 fitted_j.
        pairs = np.stack([np.arange(size), np.arange(size) + size], axis=1)
        own = np.linalg.pinv(inverse[pairs[:, :, None], pairs[:, None, :]], hermitian=True)
        back = np.einsum("bki,kij,kj->bk", inverse[:, pairs], own, fitted[pairs])
        dropped += error + 2.0 * left[base] @ back + np.einsum("bk,bk->k", back, here @ back)
        # Adding an order moves the others by -slope times its own coefficients.
        flat = train[:, other]
        slope = (inverse @ train[:, other.ravel()]).reshape(flat.shape)
        alone = every_block - block - np.einsum("bki,bkj->kij", flat, slope)
        step = np.einsum(
            "kij,kj->ki",
            np.linalg.pinv(alone, rcond=COLLINEAR, hermitian=True),
            score[other] - np.einsum("bki,b->ki", flat, fitted),
        )
        move = np.einsum("bki,ki->bk", slope, step)
        linear = np.einsum("ki,ki->k", step, left[other]) - left[base] @ move
        square = (
            np.einsum("ki,kij,kj->k", step, block, step)
            - 2.0 * np.einsum("bk,bki,ki->k", move, gram[:, other], step)
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
