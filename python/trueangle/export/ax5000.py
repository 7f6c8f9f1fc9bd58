"""Beckhoff AX5000: offsets and gains of a feedback's channels (P-0-0150)."""

from __future__ import annotations

import re
from collections.abc import Mapping
from typing import Any, ClassVar, Final

import numpy as np

from ..errors import ArgumentError, FileError
from ..model.model import HarmonicModel
from ..runs.rawchannels import Channels
from ..support.arrays import Array
from ..support.files import FileKind
from .channelform import ChannelTarget, Decode, made_of_channels, model_of_channels
from .pattern import TurnPattern
from .target import CommentBlock, Made, Option

_NAMES: Final = ("Sin offset", "Cos offset", "Sin gain", "Cos gain")
_LINE = re.compile(r"^\s*(?:P-0-0150\.)?((?:Sin|Cos) (?:offset|gain))\s*=\s*(-?\d+)", re.MULTILINE)


class Ax5000(ChannelTarget):
    """Target ``ax5000``: offsets in increments and gains of both channels.

    The gain of the weaker channel is raised: ``gain = gain_one * largest / amplitude``.
    """

    name = "ax5000"
    what = "offsets and gains of a sine encoder for AX5000 (P-0-0150)"
    kind: ClassVar[FileKind] = FileKind("parameters of AX5000", (".txt",))
    arithmetic_known = False
    unknown = (
        "neither the number for a gain of 1 nor the arithmetic is documented: give `gain_one=` "
        "as the drive shows it at first; check one reading after writing"
    )
    options = {"gain_one": Option(int, 65536, "value that means a gain of 1")}

    def make(self, pattern: TurnPattern, options: Mapping[str, Any]) -> Made:
        channels, one = self.channels(pattern), options["gain_one"]
        if one < 1:
            raise ArgumentError(f"gain_one must be from 1 on, got {one}")
        size = max(1.0, channels.gain_ratio)
        exact = (
            channels.offset_sine,
            channels.offset_cosine,
            one * size / channels.gain_ratio,
            one * size,
        )
        written = tuple(round(value) for value in exact)

        def text(header: CommentBlock) -> str:
            rows = zip(_NAMES, written, strict=True)
            return "".join(f"P-0-0150.{name} = {value}\n" for name, value in rows)

        notes = ("offsets are in the increments of the columns; the phase of the channels stays",)
        return made_of_channels(
            pattern, text, _decode(written), _decode(exact), entries=4, notes=notes
        )

    def read(self, text: str, path: str, options: Mapping[str, Any]) -> HarmonicModel:
        found = {name: float(value) for name, value in _LINE.findall(text)}
        if len(found) < len(_NAMES) or not min(found["Sin gain"], found["Cos gain"]) > 0.0:
            raise FileError(path, f"has not all of {', '.join(_NAMES)}, gains above zero")
        return model_of_channels(
            Channels(
                offset_sine=found["Sin offset"],
                offset_cosine=found["Cos offset"],
                gain_ratio=found["Cos gain"] / found["Sin gain"],
                period=360.0,
            )
        )


def _decode(values: tuple[float, ...]) -> Decode:
    sine_offset, cosine_offset, sine_gain, cosine_gain = values

    def decode(sine: Array, cosine: Array) -> Array:
        return np.arctan2((sine - sine_offset) * sine_gain, (cosine - cosine_offset) * cosine_gain)

    return decode
