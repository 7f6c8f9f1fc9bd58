"""SimpleFOC's LinearHall: the two centre values that it subtracts before its arc tangent."""

from __future__ import annotations

import re
from typing import Final

from ..model.model import HarmonicModel
from ..runs.rawchannels import Channels
from .channelform import about_offsets, channels_of, made_of_channels, model_of_channels
from .pattern import TurnPattern
from .reading import table_error
from .target import CommentBlock, Made

#: The variant of the target ``simplefoc``.
LINEAR_HALL: Final = "linearhall"

_CALL = re.compile(r"LinearHall\s*\([^,()]+,[^,()]+,\s*(-?\d+)\s*,\s*(-?\d+)\s*,\s*(\d+)\s*\)")


def linear_hall(pattern: TurnPattern) -> Made:
    """The constructor with whole centres: gain and phase of the channels stay."""
    channels = channels_of(pattern, f"simplefoc of variant {LINEAR_HALL}")
    exact = (channels.offset_sine, channels.offset_cosine)
    sine, cosine = (round(value) for value in exact)

    def text(header: CommentBlock) -> str:
        own = "Centres in counts of analogRead; gain and phase of the channels are not corrected."
        call = f"LinearHall(PIN_SINE, PIN_COSINE, {sine}, {cosine}, {channels.periods_per_turn})"
        lines = header.comment("// ", own)
        return "\n".join([*lines, f"LinearHall sensor = {call};", ""])

    return made_of_channels(
        pattern, text, about_offsets(sine, cosine), about_offsets(*exact), entries=2
    )


def read_linear_hall(text: str, path: str) -> HarmonicModel:
    """What a constructor's centres correct."""
    found = _CALL.search(text)
    if found is None:
        raise table_error(path, "has no LinearHall(pin, pin, centre, centre, pole pairs)")
    sine, cosine, periods = map(int, found.groups())
    return model_of_channels(
        Channels(
            offset_sine=sine, offset_cosine=cosine, periods_per_turn=periods or 1, period=360.0
        )
    )
