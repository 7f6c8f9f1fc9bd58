"""Readings too many to keep: sums over all of them, and some as they are."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import ArgumentError
from ..estimation.moments import Moments
from ..model.model import Argument
from ..runs.run import CalibrationRun
from ..support.arrays import Array
from .orders.harmonicsums import HarmonicSums
from .orders.unitgroups import MOST_UNITS


@dataclass(frozen=True, eq=False)
class SummedReadings:
    """What one pass over readings keeps of them.

    Attributes
    ----------
    moments : Moments
        Of all readings but the outliers, run by run.
    runs : tuple of CalibrationRun
        Some readings of every run, in their order: blocks at random.
    ends, reach : ndarray
        Angles that hold both ends of the travel of all readings, within a turn and over the turns.
    argument : {"reference", "indicated"}
        The angle of the moments.
    readings, missing : int
        All readings, and rows of the files that an empty cell kept out.
    outliers : tuple of (str, int)
        Label and row of every reading that was rejected.
    """

    moments: Moments
    runs: tuple[CalibrationRun, ...]
    ends: Array
    reach: Array
    argument: Argument
    readings: int
    missing: int
    outliers: tuple[tuple[str, int], ...] = ()

    def sums(self, orders: Sequence[float]) -> HarmonicSums:
        """Normal equations of orders, run by run, from all readings."""
        return _sums_of_moments(self.moments, orders)

    @property
    def note(self) -> str:
        """What one pass cannot know, in one sentence."""
        kept = sum(map(len, self.runs))
        return (
            "the coefficients, their evidence and the span are of all "
            f"{self.readings} readings, in one pass. Positions, repeats, correlation and "
            f"the ridge are estimated from {kept} of them, in random blocks"
        )


def _sums_of_moments(moments: Moments, orders: Sequence[float]) -> HarmonicSums:
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
    # Orders this close to a whole multiple of the base shaft are one.
    if index.size and np.abs(steps - index).max() > 1e-9 * np.abs(steps).max():
        raise ArgumentError(
            "one pass can only judge orders that are multiples of a common "
            "base order: fit in memory, or give orders of the other shafts"
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
