"""The readings of a joint in a log: counts, the size of the correction, the unit they are in."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ..runs.checks.channelreadings import dropout_words, no_curve
from ..runs.rawchannels import Channels
from ..support.angles import UNIT_PERIODS, arcsec, unit_name

#: Readings fill a turn of another unit, and nothing beyond it, to this share ...
_FILLED: Final = 0.9

#: Turns from which whole numbers or angles of one turn at most are likelier another unit.
_MANY: Final = 10.0


#: Mismatch of two tracks, in periods, from which a reading is nearer to a wrong period than to
#: none.
_NEAR: Final = 0.25


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


class ChannelStatistics:
    """How the readings of a sine and a cosine channel are off the curve of a model's constants."""

    def __init__(self, channels: Channels) -> None:
        self.channels = channels
        self._sums = np.zeros(9)
        self._rows = 0
        self._first: int | None = None
        self.mismatch = 0.0
        self._near = 0

    def update(self, sine: NDArray[Any], cosine: NDArray[Any], *second: NDArray[Any]) -> None:
        """Take in a batch."""
        if second:
            off = np.abs(self.channels.mismatch(sine, cosine, *second))
            self.mismatch = float(np.fmax.reduce(off, initial=self.mismatch))
            self._near += int(np.count_nonzero(off > _NEAR))
        sums, first = self.channels.off(sine, cosine)
        if self._first is None and first is not None:
            self._first = self._rows + first + 1
        self._rows += sine.size
        self._sums += sums

    @property
    def sentence(self) -> str:
        """The warning: in the words of `check`; empty without a fault."""
        n, off, exchanged, far, sine, cosine, *squares, product = self._sums.tolist()
        if not n:
            return ""
        known, (y, x) = self.channels, (sine / n, cosine / n)
        moments = np.array([[squares[0] / n - y * y, product / n - x * y], [0.0, 0.0]])
        moments[1] = moments[0, 1], squares[1] / n - x * x
        # Standard deviation of a channel that goes round, relative to its amplitude.
        if math.sqrt(max(moments.diagonal().max(), 0.0)) > 0.5 * known.amplitude:
            problem = no_curve((y + known.offset_sine, x + known.offset_cosine), moments)
            if problem:
                return problem
        # Times that exchanged channels are nearer to the curve, in squares, from which on they are.
        if off > 4.0 * exchanged:
            return (
                "the channels are nearer to the curve of the model with sine and cosine exchanged: "
                "they are swapped; rename them, `signals={'sine': 'NAME', 'cosine': 'NAME'}`"
            )
        if 2.0 * far > n:
            return (
                f"{far:.0f} of {n:.0f} readings of the channels are off the curve of the model: "
                "another sensor or gain, or a counter that wraps; check the log: trueangle check"
            )
        if self._near:
            return (
                f"the two tracks differ by up to {self.mismatch:.2g} periods, {self._near} of "
                f"{n:.0f} readings by more than {_NEAR:g}, and from 0.5 on a period is wrong; "
                "calibrate both tracks again"
            )
        return "; ".join(dropout_words(int(far), self._first)) if self._first else ""


class UnitEvidence:
    """Extent of the readings of one column whose unit nobody stated.

    A joint that moves little near zero is no evidence, nor is one that makes many turns.

    ``period`` is one turn in the unit that the readings are read as.

    Examples
    --------
    >>> seen = UnitEvidence(360.0)
    >>> seen.update(np.linspace(-3.1, 3.1, 500))
    >>> seen.unit(None)
    'rad'
    >>> resting = UnitEvidence(360.0)
    >>> resting.update(np.full(500, 1.2))
    >>> resting.unit(None) is None
    True
    """

    def __init__(self, period: float) -> None:
        self.period = period
        self.readings = 0
        self.low, self.high = math.inf, -math.inf
        self._travel = self._jump = 0.0
        self._whole = True
        self._last: float | None = None

    def update(self, angle: NDArray[np.generic]) -> None:
        """Take in the next readings."""
        known = np.asarray(angle, dtype=np.float64)
        known = known[np.isfinite(known)]
        if not known.size:
            return
        self.low = min(self.low, float(known.min()))
        self.high = max(self.high, float(known.max()))
        first = known[:1] if self._last is None else np.array([self._last])
        steps = np.abs(np.diff(known, prepend=first))
        self._travel += float(steps.sum())
        self._jump = max(self._jump, float(steps.max()))
        self._whole = self._whole and bool((known == np.floor(known)).all())
        self._last = float(known[-1])
        self.readings += known.size

    def unit(self, span: tuple[float, float] | None) -> str | None:
        """The unit that the readings look like, where it is another; ``span`` was calibrated."""
        # Fewest readings from which a unit is suspected.
        if self.readings < 20:
            return None
        extent = self.high - self.low
        largest = max(abs(self.low), abs(self.high))
        for unit, turn in UNIT_PERIODS.items():
            if math.isclose(turn, self.period, rel_tol=1e-6):
                continue
            within = _FILLED * turn <= extent <= 1.001 * turn
            usual = self._travel / self.readings
            # ... and jump over its border by as much, while a usual step is below a tenth.
            if within and self._jump >= 0.8 * turn and usual <= 0.1 * turn:
                return unit
            if unit == "turn":
                continue
            if turn < self.period and largest <= 1.001 * turn and extent >= 0.5 * _FILLED * turn:
                return unit
            if turn > self.period and _MANY * self.period < largest <= 1.001 * turn:
                return unit
            if span is not None and self._fits(span, self.period / turn):
                return unit
        if self._whole and largest > _MANY * self.period:
            return "count"
        return None

    def _fits(self, span: tuple[float, float], factor: float) -> bool:
        """Whether the readings lie outside the span, and inside it in another unit."""
        if self.high - self.low <= 0.0:
            return False

        def outside(low: float, high: float) -> bool:
            # By whole turns the span is any.
            start = math.floor((low - span[0]) / self.period) * self.period
            return low - start < span[0] or high - start > span[1]

        apart = self.high < span[0] or self.low > span[1]
        turn = [(self.low + k * self.period, self.high + k * self.period) for k in (-1, 1)]
        apart = apart and all(high < span[0] or low > span[1] for low, high in turn)
        return apart and not outside(self.low * factor, self.high * factor)

    def sentence(self, column: str, span: tuple[float, float] | None) -> str | None:
        """The warning, or None."""
        unit = self.unit(span)
        if unit is None:
            return None
        more = " and `counts_per_turn=N`" if unit == "count" else ""
        return (
            f"the readings of column '{column}' go from {self.low:.6g} to {self.high:.6g} and are "
            f"read as {unit_name(self.period)}, the model's unit, but look like {unit}; if so, "
            f"give `unit={unit!r}`{more} (else `unit={unit_name(self.period)!r}`)"
        )
