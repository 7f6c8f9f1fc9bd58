"""moteus: the compensation table of one position source, or a port's common-mode value."""

from __future__ import annotations

import re
from collections.abc import Mapping
from functools import partial
from typing import Any, ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError, FileError
from ..model.model import HarmonicModel
from ..runs.rawchannels import Channels
from ..support.files import FileKind
from .channelform import about_offsets, channels_of, made_of_channels, model_of_channels
from .knots import one_turn_knots, rounded_knots, rounding_floor
from .pattern import TurnPattern
from .proof import Correction, Places
from .reading import sampled_model
from .target import CommentBlock, Made, Option, TablePart, Target

ENTRIES = 256
_INT8 = range(-128, 128)
#: Scales tried above the least, for the one whose rounding is kindest to these knots.
_SCALES = np.linspace(1.0, 1.05, 401)

_LINE = re.compile(
    r"^(?:conf set )?motor_position\.sources\.(\d+)\.compensation_(?:table\.(\d+)|(scale))"
    r"\s+(\S+)\s*$"
)

#: The variant of the target ``moteus``.
_COMMON: Final = "common"

#: Counts of the port's converter.
_COUNTS: Final = range(4096)

_COMMON_LINE = re.compile(
    r"^(?:conf set )?aux([12])\.sine_cosine\.common\s+(\S+)\s*$", re.MULTILINE
)


class Moteus(Target):
    """Target ``moteus``: lines for ``moteus_tool`` to write."""

    name = "moteus"
    what = "conf set lines of a position source's compensation table"
    kind: ClassVar[FileKind] = FileKind("a configuration of moteus", (".cfg", ".txt", ".conf"))
    sign = "add"
    unknown = (
        "firmware 0x0109 or later is wanted (before, 32 floats without a scale). On the source "
        "that commutates, the motor's own calibration was made with the old table: calibrate the "
        "motor again (moteus_tool --calibrate) after writing"
    )
    options = {
        "source": Option(int, 0, "position source 0, 1 or 2 that reads this encoder"),
        "bits": Option(int, 24, "bits of a reading, at most 24: all are evaluated"),
        "variant": Option(
            ("table", _COMMON), "table", "compensation table, or the offset of sine and cosine"
        ),
        "aux": Option(int, 1, "port 1 or 2 that reads sine and cosine"),
    }

    def may_be_empty(self, options: Mapping[str, Any]) -> bool:
        return bool(options["variant"] == _COMMON)

    def sign_of(self, options: Mapping[str, Any]) -> str:
        return "absolute" if options["variant"] == _COMMON else self.sign

    def make(self, pattern: TurnPattern, options: Mapping[str, Any]) -> Made:
        if options["variant"] == _COMMON:
            return _common_mode(pattern, options["aux"])
        source = options["source"]
        if source not in (0, 1, 2):
            raise ArgumentError(f"source must be 0, 1 or 2, got {source}")
        if options["bits"] > 24:
            raise ArgumentError("bits must be at most 24: moteus takes readings as floats")
        knots = -one_turn_knots(pattern, ENTRIES, self.name)
        scale, table = _scaled(knots)

        def text(header: CommentBlock) -> str:
            lead = f"conf set motor_position.sources.{source}.compensation_"
            lines = [f"{lead}scale {float(scale):.9g}"]
            lines += [f"{lead}table.{i} {int(value)}" for i, value in enumerate(table)]
            return "\n".join([*lines, "conf write", ""])

        step = float(scale) / 127.0
        return Made(
            text=text,
            entries=ENTRIES,
            bytes=ENTRIES + 4,
            part=TablePart.at_readings(
                pattern, *_device(table, scale, options["bits"]), zero=pattern.zero
            ),
            floor_arcsec=rounding_floor(step),
            zero_deg=pattern.zero * 360.0,
            notes=(
                "the reading is that of the source with its offset and sign applied, in its own "
                "turns: calibrate the model with that",
            ),
        )

    def read(self, text: str, path: str, options: Mapping[str, Any]) -> HarmonicModel:
        if options["variant"] == _COMMON:
            return _read_common_mode(text, path, options["aux"])
        source = options["source"]
        table = np.zeros(ENTRIES)
        scale, seen = 0.0, 0
        for number, line in enumerate(text.split("\n"), 1):
            found = _LINE.match(line.strip())
            if found is None or int(found[1]) != source:
                continue
            try:
                value = float(found[4])
                if not np.isfinite(value):
                    raise ValueError
            except ValueError:
                raise FileError(path, f"{found[4]!r} is not a number", line=number) from None
            if found[3]:
                scale = value
            elif int(found[2]) >= ENTRIES or value not in _INT8:
                raise FileError(
                    path, f"{line.strip()!r} is not an entry of a table of int8", line=number
                )
            else:
                table[int(found[2])] = value
                seen += 1
        if seen != ENTRIES:
            raise FileError(
                path,
                f"{seen} of {ENTRIES} lines of motor_position.sources.{source}."
                "compensation_table are there; write them by moteus_tool --dump-config",
            )
        if abs(scale) > float(np.finfo(np.float32).max):
            raise FileError(path, f"a scale of {scale:g} is none of the firmware's floats")
        return sampled_model(
            -table * scale / 127.0,
            path,
            self,
            _device(table.astype(np.int8), np.float32(scale), options["bits"])[0],
            step=abs(scale) / 127.0 or 2**-24,
        )


def _device(table: NDArray[np.int8], scale: np.float32, bits: int) -> tuple[Correction, ...]:
    """What the firmware subtracts from readings, without and with contracted products."""

    def correction(angles: Places, contracted: bool) -> NDArray[np.float64]:
        reading = angles % 2**32 >> (32 - bits)
        out = compensated(reading, table, scale, 1 << bits, contracted)
        return np.asarray((reading - out) / (1 << bits))

    return tuple(partial(correction, contracted=c) for c in (False, True))


def _scaled(knots: NDArray[np.float64]) -> tuple[np.float32, NDArray[np.int8]]:
    """Scale and int8 entries whose rounding leaves least."""
    largest = float(np.max(np.abs(knots)))
    if largest == 0.0:
        return np.float32(0.0), np.zeros(len(knots), np.int8)
    best, chosen, table = np.inf, np.float32(0.0), np.zeros(len(knots))
    for factor in _SCALES:
        scale = np.float32(largest * factor)
        rounded = np.clip(rounded_knots(knots / float(scale) * 127.0), -127, 127)
        error = rounded * float(scale) / 127.0 - knots
        left = float(np.sum(error * (2.0 * error + np.roll(error, 1))))
        if left < best:
            best, chosen, table = left, scale, rounded
    return chosen, table.astype(np.int8)


def compensated(
    reading: NDArray[np.integer[Any]],
    table: NDArray[np.int8],
    scale: np.float32,
    cpr: int,
    contracted: bool = False,
) -> NDArray[np.float64]:
    """``compensated_value`` of readings in counts: the firmware's lerp and wrap, in float32.

    ``contracted`` rounds sums of products once only, as a compiler may.
    """
    size = len(table)
    turn = np.float32(cpr)
    value = reading.astype(np.float32)
    ratio = value / turn
    left = np.minimum(size - 1, (ratio * np.float32(size)).astype(np.int32))
    right = (left + 1) % size
    fraction = (ratio - left.astype(np.float32) / np.float32(size)) * np.float32(size)
    step = np.float32(np.float32(scale) / np.float32(127.0))
    low, high = table[left].astype(np.float32) * step, table[right].astype(np.float32) * step
    weight = np.float32(1.0) - fraction
    if contracted:
        wide = low.astype(np.float64) * weight + high.astype(np.float64) * fraction
        out = (value + wide.astype(np.float32).astype(np.float64) * turn).astype(np.float32)
    else:
        out = value + (low * weight + high * fraction) * turn
    whole = (out / turn).astype(np.int32).astype(np.float32)
    wrapped = out - whole * turn
    return np.asarray(np.where(wrapped >= 0, wrapped, wrapped + turn), dtype=np.float64)


def _common_mode(pattern: TurnPattern, aux: int) -> Made:
    """One offset for both channels: the mean of theirs, which leaves least of order 1."""
    channels = channels_of(pattern, f"moteus of variant {_COMMON}")
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
            "stay. The residual can go into the source's compensation table: fit its position",
        ),
    )


def _read_common_mode(text: str, path: str, aux: int) -> HarmonicModel:
    """What a port's common-mode value corrects."""
    found = [m[2] for m in _COMMON_LINE.finditer(text) if int(m[1]) == aux]
    if not found or not found[-1].isdigit():
        raise FileError(path, f"has no line aux{aux}.sine_cosine.common with counts")
    common = float(found[-1])
    return model_of_channels(Channels(offset_sine=common, offset_cosine=common, period=360.0))
