"""How far two findings of an account are collinear, given all the others."""

from __future__ import annotations

import itertools
from collections.abc import Iterator, Sequence

import numpy as np

from ..estimation.projection import EXCITED
from ..estimation.regression import Regression


def finding_overlaps(
    regression: Regression, groups: Sequence[Sequence[int]]
) -> Iterator[tuple[int, int, float]]:
    """Partial correlation of what two findings explain, given the terms of all others.

    ::

        ρ = |p_iᵀ p_j| / (|p_i| |p_j|),    p_i = (I - P) M X_i β_i

    with M the whitening of the fit and P the projection onto its other columns.

    Parameters
    ----------
    regression : Regression
    groups : sequence of sequence of int
        Terms of each finding. Those that are new in every run are omitted.

    Yields
    ------
    i, j : int
        Places among ``groups``.
    correlation : float
        0 to 1.
    """
    # The whitened columns in the coordinates of the orthonormal ones of the fit.
    columns = np.linalg.pinv(regression.back)
    places = {
        k: np.concatenate([regression.place(term) for term in group])
        for k, group in enumerate(groups)
    }
    parts = {k: columns[:, own] @ regression.coefficients[own] for k, own in places.items()}
    for i, j in itertools.combinations([k for k, own in places.items() if own.size], 2):
        pair = np.column_stack([parts[i], parts[j]])
        others = np.delete(columns, np.concatenate([places[i], places[j]]), axis=1)
        beside = pair - others @ np.linalg.lstsq(others, pair, rcond=1e-10)[0]
        own, whole = np.sum(beside**2, axis=0), np.sum(pair**2, axis=0)
        if (own > EXCITED * whole).all():
            yield i, j, abs(float(beside[:, 0] @ beside[:, 1])) / float(np.sqrt(own.prod()))
