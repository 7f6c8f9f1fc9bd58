"""What each order does for readings that are held out, and without it."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from ...estimation.linear import pseudo_inverse
from ...support.arrays import Array

#: A candidate is an alias of the chosen orders if less than this share of its columns' energy
#: is independent of them.
COLLINEAR: Final = 1e-8


class Products(NamedTuple):
    """Products of the columns of a unit, as far as a fit of chosen orders needs them.

    Attributes
    ----------
    mine : ndarray, shape (2 chosen, 2 orders + 1)
        Of the chosen orders' columns with all, the error at last.
    blocks : ndarray, shape (orders, 2, 2)
        Of the two columns of each order.
    scores : ndarray, shape (2 orders,)
        Of the columns with the error.
    """

    mine: Array
    blocks: Array
    scores: Array


def products(unit: Array, chosen: Sequence[int]) -> Products:
    """Those of a unit, as `zerogroups.unit_columns` gives it."""
    columns = unit[:, :-1]
    cosine, sine = columns[:, ::2], columns[:, 1::2]
    both = [np.einsum("nk,nk->k", a, b) for a in (cosine, sine) for b in (cosine, sine)]
    mine = unit[:, np.ravel([(2 * k, 2 * k + 1) for k in chosen]).astype(np.intp)]
    return Products(mine.T @ unit, np.stack(both, axis=1).reshape(-1, 2, 2), unit[:, -1] @ columns)


def held_out_gains(units: Sequence[Array], chosen: Sequence[int]) -> tuple[Array, Array, float]:
    """Held-out sum of squares with and without each order, one unit held out at a time.

    The held-out unit keeps its own zero, the chosen orders come from the other units.

    Parameters
    ----------
    units : sequence of ndarray
        As `zerogroups.unit_columns` gives them.
    chosen : sequence of int
        Places of the chosen orders.

    Returns
    -------
    without, with_ : ndarray, shape (orders,)
        For an order among the chosen ones ``with_`` is the model itself; for another one
        ``without`` is. Entry by entry their difference is the gain of that order.
    model : float
        Held-out sum of squares of the chosen orders.
    """
    pairs = np.arange(units[0].shape[1] - 1).reshape(-1, 2)
    outside = [k for k in range(len(pairs)) if k not in chosen]
    mine, others = pairs[list(chosen)].ravel(), pairs[outside]
    of_mine = np.arange(mine.size).reshape(-1, 2)
    every = [products(unit, chosen) for unit in units]
    total = Products(*(np.sum(each, axis=0) for each in zip(*every, strict=True)))
    model = 0.0
    dropped, added = np.zeros(len(chosen)), np.zeros(len(outside))
    for unit, own in zip(units, every, strict=True):
        train = Products(*(a - b for a, b in zip(total, own, strict=True)))
        inverse = pseudo_inverse(train.mine[:, mine])
        fitted = inverse @ train.mine[:, -1]
        left = unit[:, -1] - unit[:, mine] @ fitted
        error = float(left @ left)
        model += error
        # Dropping order j moves all coefficients by -inverse_j inverse_jj^-1 fitted_j.
        alone = np.linalg.pinv(inverse[of_mine[:, :, None], of_mine[:, None, :]], hermitian=True)
        back = np.einsum("bki,kij,kj->bk", inverse[:, of_mine], alone, fitted[of_mine])
        dropped += ((left[:, None] + unit[:, mine] @ back) ** 2).sum(axis=0)
        # Adding an order moves the others by -slope times its own coefficients.
        both = train.mine[:, others]
        slope = np.tensordot(inverse, both, 1)
        step = np.einsum(
            "kij,kj->ki",
            np.linalg.pinv(
                train.blocks[outside] - np.einsum("bki,bkj->kij", both, slope),
                rcond=COLLINEAR,
                hermitian=True,
            ),
            train.scores[others] - np.einsum("bki,b->ki", both, fitted),
        )
        move = np.einsum("bki,ki->bk", slope, step)
        linear = np.einsum("ki,ki->k", step, (left @ unit[:, :-1])[others])
        linear -= (left @ unit[:, mine]) @ move
        square = np.einsum("ki,kij,kj->k", step, own.blocks[outside], step)
        square -= 2.0 * np.einsum("bk,bki,ki->k", move, own.mine[:, others], step)
        square += np.einsum("bk,bk->k", move, own.mine[:, mine] @ move)
        added += error - 2.0 * linear + square
    without, with_ = np.full(len(pairs), model), np.full(len(pairs), model)
    without[list(chosen)], with_[outside] = dropped, added
    return without, with_, model
