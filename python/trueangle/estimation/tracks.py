"""Two tracks of a sensor as one: in which sense and with which zero they agree, and how well."""

from __future__ import annotations

import cmath
import math
from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from ..errors import NoCurveError
from ..runs.rawchannels import Channels
from ..support.arrays import Array
from .channels import estimate_channels


class Mismatch(NamedTuple):
    """How far two tracks are off agreeing on a period, in periods: from 0.5 on it is wrong."""

    rms: float
    max: float

    @classmethod
    def of(cls, channels: Channels, readings: Sequence[Array]) -> Mismatch:
        """Of sine, cosine, sine2 and cosine2."""
        off = channels.mismatch(*readings)
        return cls(float(np.sqrt(np.mean(off**2))), float(np.abs(off).max()))

    @property
    def says(self) -> str:
        """The same in words."""
        return (
            f"the second track chooses the period of the first: mismatch {self.rms:.2g} periods "
            f"rms, {self.max:.2g} at most, margin {0.5 - self.max:.2g} (a period is wrong from 0.5 "
            "on)"
        )


def with_second_track(
    channels: Channels, readings: Sequence[Array], periods: int, named: str
) -> Channels:
    """Channels with the second of two tracks, whose constants are fitted without a reference.

    ``readings`` are sine, cosine, sine2 and cosine2.

    Raises
    ------
    NoCurveError
        The second track draws no curve, or the two do not agree.
    """
    sine, cosine = readings[2:]
    second = f"{named}, second track"
    found = estimate_channels(sine, cosine, second, periods=periods, period=channels.period)
    return joined(channels, found.channels, readings, named)


def joined(first: Channels, second: Channels, readings: Sequence[Array], named: str) -> Channels:
    """Two tracks as one, in the sense and with the zero in which they agree.

    Raises
    ------
    NoCurveError
        They do not agree.
    """
    tracks = []
    for sense in (1, -1):
        track = first.replace(second=second.replace(direction=sense), second_zero_deg=0.0)
        off = np.exp(2j * math.pi * track.mismatch(*readings)).mean()
        tracks.append((abs(off), cmath.phase(off), track))
    agreement, phase, track = max(tracks, key=lambda found: found[0])
    periods = first.periods_per_turn, second.periods_per_turn
    # Mean resultant of the mismatch of two tracks that agree: of 0.2 periods rms.
    if agreement < 0.45:
        raise NoCurveError(
            f"{named}: two tracks of {periods[0]} and {periods[1]} periods do not agree on a "
            "period: check the columns and `periods_per_turn`"
        )
    return track.replace(second_zero_deg=math.degrees(phase) / periods[0])
