"""Moments of runs as the sums that the evidence for orders is taken from."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..errors import ArgumentError
from ..moments import Moments
from ..orders.harmonicsums import HarmonicSums

__all__ = ["sums_of"]


def sums_of(moments: Moments, orders: Sequence[float]) -> HarmonicSums:
    r"""Normal equations of output orders, run by run, each run's mean taken out.

    With :math:`W_m = \sum w e^{imx}`, :math:`Y_m = \sum w y e^{imx}` and the mean
    :math:`\bar y = Y_0 / W_0`, the sums about the mean are :math:`Y_m - \bar y W_m` and
    :math:`\sum w y^2 - \bar y Y_0`.

    Raises
    ------
    ArgumentError
        Orders that are not whole multiples of the base shaft.
    """
    spectra = [moments.spectrum(run) for run in moments.runs]
    cycles = spectra[0].cycles
    steps = np.asarray(orders) / cycles
    index = np.rint(steps).astype(np.int64)
    if np.abs(steps - index).max() > 1e-9:
        raise ArgumentError(
            "orders are selected in one pass where all shafts turn a whole number of times per "
            "output turn: give them with --orders"
        )
    weights = np.array([spectrum.weight for spectrum in spectra])
    errors = np.array([spectrum.error for spectrum in spectra])
    total, first = weights[:, 0].real, errors[:, 0].real
    mean = first / total
    centred = errors[:, index] - mean[:, None] * weights[:, index]
    picked = weights[:, index] / total[:, None]
    return HarmonicSums(
        index.astype(np.float64).tolist(),
        total,
        np.array([spectrum.samples for spectrum in spectra]),
        np.array([s.squares for s in spectra]) - mean * first,
        np.concatenate([centred.real, centred.imag], axis=1),
        None,
        weights,
        np.concatenate([picked.real, picked.imag], axis=1),
    )
