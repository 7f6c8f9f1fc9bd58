"""VESC: offsets, amplitudes and phase of a sine/cosine encoder, as motor configuration."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any, ClassVar, Final

import numpy as np

from ..errors import ArgumentError, FileError
from ..model.model import HarmonicModel
from ..runs.rawchannels import Channels
from ..support.arrays import Array
from ..support.files import FileKind
from .channelform import ChannelTarget, Decode, decimals, made_of_channels, model_of_channels
from .pattern import TurnPattern
from .target import CommentBlock, Made, Option

#: The configuration keeps thousandths in 16 bits.
_MOST: Final = 32.767

_NAMES: Final = (
    "m_encoder_sin_offset",
    "m_encoder_sin_amp",
    "m_encoder_cos_offset",
    "m_encoder_cos_amp",
    "m_encoder_sincos_phase_correction",
)
_ENTRY = re.compile(r"<(m_encoder_\w+)>\s*([^<]+?)\s*</\1>")


class Vesc(ChannelTarget):
    """Target ``vesc``: entries of the motor configuration for a sine/cosine encoder.

    ``s = (V_s - offset) / amp``, likewise ``c``; ``c' = (c + s sin(ph)) / cos(ph)``; the angle is
    ``atan2(s, c')``.
    """

    name = "vesc"
    what = "the sine/cosine encoder of VESC's motor configuration (XML)"
    kind: ClassVar[FileKind] = FileKind("a motor configuration of VESC", (".xml", ".txt"))
    unknown = (
        "needs firmware 6 or later, which keeps amplitudes and a phase; the error of its fast "
        "arc tangent is not included. It rejects readings with a radius outside 0.7 to 1.3 "
        "amplitudes"
    )
    options = {
        "volts_per_count": Option(float, 1.0, "volts at the pin of one unit of the columns"),
    }

    def make(self, pattern: TurnPattern, options: Mapping[str, Any]) -> Made:
        channels, volts = self.channels(pattern), options["volts_per_count"]
        if not volts > 0.0:
            raise ArgumentError(f"volts_per_count must be positive, got {volts:g}")
        exact = dict(
            zip(
                _NAMES,
                (
                    channels.offset_sine * volts,
                    channels.amplitude * channels.gain_ratio * volts,
                    channels.offset_cosine * volts,
                    channels.amplitude * volts,
                    -channels.phase_deg,
                ),
                strict=True,
            )
        )
        # The configuration keeps thousandths in 16 bits.
        written = decimals(exact, 3)
        if max(map(abs, written.values())) > _MOST or min(written[n] for n in _NAMES[1:4:2]) <= 0.0:
            raise ArgumentError(
                "vesc takes volts up to 32.767 at the pin: give what one unit of the columns is, "
                "`volts_per_count=` (3.3 / 4095 of a 12-bit converter)"
            )

        def text(header: CommentBlock) -> str:
            lines = [line.replace("--", "- -") for line in header.comment("  ")]
            rows = [f"  <{name}>{value:.3f}</{name}>" for name, value in written.items()]
            head = ['<?xml version="1.0" encoding="UTF-8"?>', "<!--", *lines, "-->"]
            return "\n".join([*head, "<MCConfiguration>", *rows, "</MCConfiguration>", ""])

        return made_of_channels(
            pattern,
            text,
            _decode(written, volts),
            _decode(exact, volts),
            entries=len(_NAMES),
            notes=("set the sensor port to sine/cosine; find the motor's offset again",),
        )

    def read(self, text: str, path: str, options: Mapping[str, Any]) -> HarmonicModel:
        found = {m[1]: m[2] for m in _ENTRY.finditer(text)}
        missing = [name for name in _NAMES if name not in found]
        if missing:
            raise FileError(path, f"has no entry {missing[0]}: a motor configuration has")
        values = []
        for name in _NAMES:
            try:
                values.append(float(found[name]))
            except ValueError:
                raise FileError(path, f"{name}: {found[name]!r} is not a number") from None
        offset, size, offset_cosine, amplitude, phase = values
        volts = options["volts_per_count"]
        if not (amplitude and size):
            raise FileError(path, "has an amplitude of zero: it was not calibrated")
        return model_of_channels(
            Channels(
                offset_sine=offset / volts,
                offset_cosine=offset_cosine / volts,
                amplitude=amplitude / volts,
                gain_ratio=size / amplitude,
                phase_deg=-phase,
                period=360.0,
            )
        )


def _decode(values: Mapping[str, float], volts: float) -> Decode:
    offset, size, offset_cosine, amplitude, phase = (values[name] for name in _NAMES)
    turn = math.radians(phase)

    def decode(sine: Array, cosine: Array) -> Array:
        s = (sine * volts - offset) / size
        c = (cosine * volts - offset_cosine) / amplitude
        return np.arctan2(s, (c + s * math.sin(turn)) / math.cos(turn))

    return decode
