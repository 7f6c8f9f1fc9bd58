"""Moments of runs as the sums that the evidence for orders is taken from."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ...errors import ArgumentError
from ...estimation.moments import Moments
from .harmonicsums import HarmonicSums
from .unitgroups import MOST_UNITS

__all__ = ["sums_of_moments"]

#: Orders this close to a whole multiple of the base shaft are one.
_WHOLE = 1e-9


def sums_of_moments(moments: Moments, orders: Sequence[float]) -> HarmonicSums:
    """Normal equations of output orders, run by run, each run's mean taken out.

    With ``W_m = Σ w e^(imx)``, ``Y_m = Σ w y e^(imx)`` and the mean
    ``ȳ = Y₀ / W₀``, the sums about the mean are ``Y_m - ȳ W_m`` and
    ``Σ w y² - ȳ Y₀``. More than 96 runs are taken together in 32 groups.

    Raises
    ------
    ArgumentError
        Orders that are not whole multiples of the base shaft.
    """
    steps = np.asarray(orders, dtype=np.float64) / moments.cycles
    index = np.rint(steps).astype(np.int64)
    if index.size and np.abs(steps - index).max() > _WHOLE * np.abs(steps).max():
        raise ArgumentError(
            "orders are judged in one pass where all shafts turn a whole number of times in the "
            "turns after which they are back together: fit in memory, or give orders of the others"
        )
    highest = int(index.max(initial=1))
    spectra = [moments.spectrum(run, highest) for run in moments.runs]
    weights = np.array([spectrum.weight[: 2 * highest + 1] for spectrum in spectra])
    errors = np.array([spectrum.error for spectrum in spectra])
    total, first = weights[:, 0].real, errors[:, 0].real
    mean = first / total
    centred = errors[:, index] - mean[:, None] * weights[:, index]
    picked = weights[:, index] / total[:, None]
    squares = np.array([spectrum.squares for spectrum in spectra]) - mean * first
    sums = HarmonicSums(
        index.astype(np.float64).tolist(),
        total,
        np.array([spectrum.samples for spectrum in spectra]),
        np.maximum(squares, 0.0),
        np.concatenate([centred.real, centred.imag], axis=1),
        None,
        weights,
        np.concatenate([picked.real, picked.imag], axis=1),
    )
    sums = sums if sums.units <= MOST_UNITS else sums.in_groups()
    # The spectra count cycles of the base shaft, those who read the sums those of the output.
    return sums.named(orders)
