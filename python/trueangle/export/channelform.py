"""Constants of a sine and a cosine channel in the form of some firmware, and what that leaves."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Final, TypeAlias

import numpy as np

from ..errors import ArgumentError
from ..model.model import HarmonicModel
from ..runs.rawchannels import Channels
from ..support.angles import ARCSEC_PER_TURN
from ..support.arrays import Array
from .pattern import TurnPattern
from .proof import Places
from .target import CommentBlock, Made, TablePart, Target

#: Phase in radians of sine and cosine, as a firmware has it.
Decode: TypeAlias = Callable[[Array, Array], Array]


#: Phases at which orders of the difference are found, and the highest order listed.
_SAMPLES: Final = 512


class ChannelTarget(Target):
    """A target that takes constants of channels, with any error of the angle left."""

    sign = "absolute"

    def may_be_empty(self, options: Mapping[str, Any]) -> bool:
        return True

    def channels(self, pattern: TurnPattern) -> Channels:
        """The constants that a model holds (`channels_of`)."""
        return channels_of(pattern, self.name)


def channels_of(pattern: TurnPattern, name: str) -> Channels:
    """The constants that a model holds.

    Raises
    ------
    ArgumentError
        It has none.
    """
    if pattern.source.channels is None:
        raise ArgumentError(
            f"{name} takes constants of a sine and a cosine channel, and the model has none: make "
            "one by `trueangle selfcal LOG --method channels -o MODEL`"
        )
    return pattern.source.channels


def made_of_channels(
    pattern: TurnPattern,
    text: Callable[[CommentBlock], str],
    device: Decode,
    unrounded: Decode,
    *,
    entries: int,
    notes: tuple[str, ...] = (),
) -> Made:
    """The export of a form: ``device`` decodes by the numbers written, ``unrounded`` before that.

    The difference is that of the decoded angle from the model's, over the ellipse of the channels:
    what the form cannot hold, its rounding, and the harmonics of the model.
    """
    # An angle has one place on the ellipse: the harmonics are the model's own correction.
    channels = replace(channels_of(pattern, "this form"), harmonics=())
    scale = channels.direction / (2.0 * math.pi * channels.periods_per_turn)

    def angle(turns: Array, decode: Decode) -> Array:
        """The device's angle, in the period of the channels that holds the reading."""
        phase = turns / scale
        off = decode(*channels.curve(phase)) - phase
        return np.asarray(turns + scale * (off - 2.0 * math.pi * np.round(off / (2.0 * math.pi))))

    turns = np.arange(_SAMPLES) / _SAMPLES / channels.periods_per_turn
    # Offsets that are far off leave no one zero; wrapped differences have a mean all the same.
    off = angle(turns, device) - (turns - pattern.taken_off(turns))
    zero = float(off.mean())
    rounding = angle(turns, device) - angle(turns, unrounded)

    def correction(places: Places) -> Array:
        at = np.asarray(places, dtype=np.float64) * 2.0**-32
        return np.asarray(at - angle(at, device))

    def lost() -> list[dict[str, float]]:
        found = 2.0 * np.abs(np.fft.rfft(off - zero))[1:9] / _SAMPLES
        rows = enumerate((found * ARCSEC_PER_TURN).tolist(), 1)
        periods = channels.periods_per_turn
        # Orders below this are not listed, arcsec.
        return [{"order": float(k * periods), "arcsec": c} for k, c in rows if c > 0.01]

    return Made(
        text=text,
        entries=entries,
        bytes=4 * entries,
        part=TablePart((correction,), lambda x: pattern.taken_off(x) - zero),
        floor_arcsec=float(np.std(rounding)) * ARCSEC_PER_TURN,
        zero_deg=zero * 360.0,
        lost=lost,
        decodes=True,
        # Places of a turn that are evaluated: 2^14 of it.
        bits=14,
        notes=(
            *notes,
            *(
                ("the device's angle rises with the channels' phase, the model's falls",)
                if channels.direction < 0
                else ()
            ),
        ),
    )


def model_of_channels(channels: Channels) -> HarmonicModel:
    """A model that decodes and corrects nothing else."""
    return HarmonicModel((), 0.0, channels.period, channels=channels)


def about_offsets(sine: float, cosine: float) -> Decode:
    """The arc tangent about two offsets, which is all that a form without gains has."""
    return lambda s, c: np.arctan2(s - sine, c - cosine)


def decimals(values: Mapping[str, float], digits: int) -> dict[str, float]:
    """Values as they are written."""
    return {name: round(float(value), digits) for name, value in values.items()}


def ellipse_of(channels: Channels) -> Decode:
    """The whole form: offsets, amplitudes and phase."""
    return lambda s, c: np.asarray(channels.angle(s, c) / channels.constants[-1])
