"""Readings of a sine and a cosine channel: which are on their curve, and why none may be."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ... import _core
from ...errors import NoCurveError
from ...support.arrays import Array
from ...support.layout import counted
from .fault import DataFault

#: Readings that a curve needs.
_LEAST: Final = 12


#: Offset in amplitudes from which the converter has no middle: a magnet's is far below it.
CENTRED: Final = 1.0

#: Flags of the core, by channel.
_RAILS: Final = {"sine": 1, "cosine": 2}
_DROPOUT: Final = 4


@dataclass(frozen=True)
class ChannelReadings:
    """Readings of two channels, finite numbers.

    Attributes
    ----------
    sine, cosine : ndarray
    flags : ndarray of uint8
        0 on the curve; 1 where the sine is at its rail, 2 the cosine, 4 a dropout.
    middle : tuple of float
        Of the sine and the cosine, where the curve does not go round zero; else zeros.
    problem : str
        Why no curve is there and what to do; empty where one is.
    """

    sine: Array
    cosine: Array
    flags: NDArray[np.uint8]
    middle: tuple[float, float]
    problem: str

    @classmethod
    def of(cls, sine: Array, cosine: Array) -> ChannelReadings:
        """The readings with their flags."""
        sine, cosine = (np.ascontiguousarray(v, dtype=np.float64) for v in (sine, cosine))
        flags, wraps, ellipse = _core.channel_faults(sine, cosine)
        middle = (0.0, 0.0)
        if ellipse is not None:
            x, y, a, b, d = ellipse
            if math.hypot(x, y) > CENTRED * 0.5 * math.hypot(a + b, d):
                middle = y, x
        kept = flags == 0
        n = int(kept.sum())
        moments = np.cov(sine[kept], cosine[kept]) if n > 1 else np.zeros((2, 2))
        problem = ""
        if sine.size < _LEAST:
            got = counted(sine.size, "reading")
            problem = f"{got} of the channels, and {_LEAST} are needed: record a turn"
        elif any(wraps):
            name, codes = next(pair for pair in zip(_RAILS, wraps, strict=True) if pair[1])
            problem = (
                f"the {name} channel jumps by {codes:.0f} codes (a counter that wraps): read the "
                "column as signed integers, or as wider ones"
            )
        elif n < _LEAST:
            problem = (
                f"{n} of {flags.size} readings of the channels are on a curve, not at a rail "
                f"(clipped) and no dropouts, and {_LEAST} are needed: lower the gain of the "
                "amplifier"
            )
        else:
            problem = no_curve((float(sine[kept].mean()), float(cosine[kept].mean())), moments)
        return cls(sine, cosine, flags, middle, problem)

    def checked(self, named: str) -> ChannelReadings:
        """Themselves.

        Raises
        ------
        NoCurveError
            No curve: one line that begins with ``named``.
        """
        if self.problem:
            raise NoCurveError(f"{named}: {self.problem}")
        return self

    @property
    def kept(self) -> NDArray[np.bool_]:
        """Readings on the curve."""
        return np.asarray(self.flags == 0)

    @property
    def dropouts(self) -> NDArray[np.bool_]:
        """Readings off the curve of the others."""
        return np.asarray(self.flags == _DROPOUT)

    @cached_property
    def clipped(self) -> dict[str, int]:
        """Readings at a rail, by channel, where there are some."""
        counts = {name: int(np.count_nonzero(self.flags & bit)) for name, bit in _RAILS.items()}
        return {name: count for name, count in counts.items() if count}

    def faults(
        self, runs: Sequence[str], rows: NDArray[np.int64] | None = None, *, falls: bool = False
    ) -> list[DataFault]:
        """Faults that do not forbid a fit; the phase ``falls`` where another angle rises."""
        found: list[DataFault] = []

        def add(name: str, says: str, mend: str, places: Sequence[int] = ()) -> None:
            found.append(DataFault.of(name, runs, places, says, mend))

        for name, count in self.clipped.items():
            are = "is" if count == 1 else "are"
            says = f"{counted(count, 'reading')} of the {name} channel {are} at its rail (clipped)"
            add("clipping", f"{says} and omitted", "lower the gain of the amplifier")
        if (off := np.flatnonzero(self.dropouts)).size:
            places = off + 1 if rows is None else rows[off]
            add("dropouts", *dropout_words(off.size, int(places[0])), places.tolist())
        if any(self.middle):
            y, x = self.middle
            add(
                "no_centre",
                f"the channels do not go round zero but about {y:.6g} (sine) and {x:.6g} (cosine): "
                "their values are not centred on zero",
                "no action is needed: the offsets are estimated and subtracted",
            )
        if falls:
            add(
                "swapped_channels",
                "the channels' phase falls as the recorded angle rises: sine and cosine are "
                "swapped, or the sensor is reversed",
                "no action is needed: the model keeps the direction; or rename them, "
                "`signals={'sine': 'NAME'}`",
            )
        return found


def dropout_words(count: int, first: int) -> tuple[str, str]:
    """What is reported of dropouts, and what to do."""
    is_one = count == 1
    return (
        f"{counted(count, 'reading')} of the channels {'is' if is_one else 'are'} off "
        f"{'the' if is_one else 'their'} curve (dropout), {'at' if is_one else 'the first at'} "
        f"reading {first}",
        "check the wire and the converter",
    )


def no_curve(means: tuple[float, float], moments: Array) -> str:
    """Why channels of these means and second moments draw no curve; empty where they may."""
    spread = np.sqrt(np.maximum(np.diag(moments), 0.0))
    for name, mean, std in zip(_RAILS, means, spread.tolist(), strict=True):
        # Of the other's: a dead channel, or an arc of a few degrees.
        if std <= 0.01 * spread.max():
            return (
                f"the {name} channel is constant ({mean:.6g}): a dead channel or a shaft that "
                "hardly turns; check the wire and turn the shaft"
            )
    agreement = float(moments[0, 1] / spread.prod())
    # Two channels that share all but this are one.
    if max(1.0 - agreement**2, 0.0) < 1e-6:
        return (
            f"sine and cosine are one signal (correlation {agreement:.5f}): the same channel "
            "twice, or a shaft that hardly turns"
        )
    return ""
