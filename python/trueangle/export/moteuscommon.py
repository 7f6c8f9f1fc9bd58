"""moteus: the one common-mode value that a port subtracts from sine and cosine."""

from __future__ import annotations

import re
from typing import Final

from ..errors import ArgumentError
from ..model.model import HarmonicModel
from ..runs.rawchannels import Channels
from .channelform import about_offsets, channels_of, made_of_channels, model_of_channels
from .pattern import TurnPattern
from .reading import table_error
from .target import CommentBlock, Made

#: The variant of the target ``moteus``.
COMMON: Final = "common"

#: Counts of the port's converter.
_COUNTS: Final = range(4096)

_LINE = re.compile(r"^(?:conf set )?aux([12])\.sine_cosine\.common\s+(\S+)\s*$", re.MULTILINE)


def common_mode(pattern: TurnPattern, aux: int) -> Made:
    """One offset for both channels: the mean of theirs, which leaves least of order 1."""
    channels = channels_of(pattern, f"moteus of variant {COMMON}")
    if aux not in (1, 2):
        raise ArgumentError(f"aux must be 1 or 2, got {aux}")
    exact = 0.5 * (channels.offset_sine + channels.offset_cosine)
    common = round(exact)
    if common not in _COUNTS:
        raise ArgumentError(
            f"moteus takes counts of a 12-bit converter, and the middle of these channels is "
            f"{exact:.6g}: record the counts of the diagnostic protocol"
        )

    def text(header: CommentBlock) -> str:
        return f"conf set aux{aux}.sine_cosine.common {common}\nconf write\n"

    return made_of_channels(
        pattern,
        text,
        about_offsets(common, common),
        about_offsets(exact, exact),
        entries=1,
        notes=(
            f"one offset for both channels, whose own differ by "
            f"{abs(channels.offset_sine - channels.offset_cosine):.3g} counts; gain and phase "
            "stay. What is left can go into the source's compensation table: fit its position",
        ),
    )


def read_common_mode(text: str, path: str, aux: int) -> HarmonicModel:
    """What a port's common-mode value corrects."""
    found = [m[2] for m in _LINE.finditer(text) if int(m[1]) == aux]
    if not found or not found[-1].isdigit():
        raise table_error(path, f"has no line aux{aux}.sine_cosine.common with counts")
    common = float(found[-1])
    return model_of_channels(Channels(offset_sine=common, offset_cosine=common, period=360.0))
