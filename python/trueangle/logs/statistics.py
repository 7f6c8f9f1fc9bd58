"""What was done to the readings of a joint: counts and the size of the correction."""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..support.angles import arcsec


@dataclass
class CorrectionStatistics:
    """Sums over the corrected readings of one joint in one file, in parts of a turn.

    Attributes
    ----------
    rows : int
        Readings, missing ones included.
    missing : int
        Empty (null) and NaN readings, kept as they are.
    outside : int
        Readings outside the part of the turn that the model was fitted on.
    squares, largest : float
        Sum of squares and greatest magnitude of corrected - indicated.
    """

    rows: int = 0
    missing: int = 0
    outside: int = 0
    squares: float = 0.0
    largest: float = 0.0

    def update(
        self,
        indicated: NDArray[np.generic],
        corrected: NDArray[np.floating],
        period: float,
        span: tuple[float, float] | None,
    ) -> None:
        """Take in a batch, both angles in the unit of ``period``, negative where reversed."""
        change = np.subtract(corrected, indicated, dtype=np.float64)
        squares = _squares(change)
        if not math.isfinite(squares):
            known = np.isfinite(change)
            self.missing += known.size - int(np.count_nonzero(known))
            change = change[known]
            squares = _squares(change)
        self.rows += corrected.size
        self.squares += squares / period**2
        if change.size:
            largest = max(float(change.max()), -float(change.min()))
            self.largest = max(self.largest, largest / abs(period))
        if span is not None:
            start, stop = span
            with np.errstate(invalid="ignore"):
                beyond = np.abs(np.mod(corrected - start, period)) > abs(stop - start)
            self.outside += int(np.count_nonzero(beyond))

    @property
    def rms_arcsec(self) -> float:
        """Root mean square of the correction; 0 without readings."""
        known = self.rows - self.missing
        return arcsec(math.sqrt(self.squares / known), 1.0) if known else 0.0

    @property
    def max_abs_arcsec(self) -> float:
        """Greatest magnitude of the correction."""
        return arcsec(self.largest, 1.0)


def _squares(values: NDArray[np.float64]) -> float:
    """Sum of squares by one thread: that of BLAS wakes threads that fight for the cores."""
    flat = values.ravel()
    return float(np.einsum("i,i->", flat, flat))
