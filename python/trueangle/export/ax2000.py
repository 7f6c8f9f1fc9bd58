"""Beckhoff AX2000: offsets of a sine encoder's channels, as ASCII commands."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, ClassVar

from ..errors import ArgumentError, FileError
from ..model.model import HarmonicModel
from ..runs.rawchannels import Channels
from ..support.files import FileKind
from .channelform import ChannelTarget, about_offsets, made_of_channels, model_of_channels
from .pattern import TurnPattern
from .target import CommentBlock, Made, Option

#: Millivolts that a command takes, at most.
_MOST = 10_000
_LINE = re.compile(r"^\s*(HISOFFS|HICOFFS)\s+(-?\d+)\s*$", re.MULTILINE)


class Ax2000(ChannelTarget):
    """Target ``ax2000``: ``HISOFFS`` and ``HICOFFS``, whole millivolts."""

    name = "ax2000"
    what = "offsets of a sine encoder for AX2000 (HISOFFS, HICOFFS)"
    kind: ClassVar[FileKind] = FileKind("ASCII commands of AX2000", (".txt", ".cmd"))
    arithmetic_known = False
    unknown = (
        "the scale of HIFACT1 is not documented: the drive finds it (RK, CALCRK); it is omitted; "
        "the sign of the offsets is that of the signal: check one reading"
    )
    options = {"volts_per_count": Option(float, 1.0, "volts at the pin of one unit of the columns")}

    def make(self, pattern: TurnPattern, options: Mapping[str, Any]) -> Made:
        channels, unit = self.channels(pattern), options["volts_per_count"] * 1e3
        exact = (channels.offset_sine, channels.offset_cosine)
        sine, cosine = (round(value * unit) for value in exact)
        if not unit > 0.0 or max(abs(sine), abs(cosine)) > _MOST:
            raise ArgumentError(
                "ax2000 takes offsets up to 10000 mV: give what one unit of the columns is, "
                "`volts_per_count=`"
            )

        def text(header: CommentBlock) -> str:
            return f"HISOFFS {sine}\nHICOFFS {cosine}\nSAVE\n"

        written = about_offsets(sine / unit, cosine / unit)
        return made_of_channels(pattern, text, written, about_offsets(*exact), entries=2)

    def read(self, text: str, path: str, options: Mapping[str, Any]) -> HarmonicModel:
        found = {name: int(value) for name, value in _LINE.findall(text)}
        if len(found) < 2:
            raise FileError(path, "has no lines HISOFFS and HICOFFS with millivolts")
        unit = options["volts_per_count"] * 1e3
        sine, cosine = found["HISOFFS"] / unit, found["HICOFFS"] / unit
        return model_of_channels(Channels(offset_sine=sine, offset_cosine=cosine, period=360.0))
