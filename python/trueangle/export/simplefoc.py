"""SimpleFOC: the array of CalibratedSensor, for three versions, or the centres of LinearHall."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, ClassVar, Final

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError, FileError
from ..model.model import HarmonicModel
from ..runs.rawchannels import Channels
from ..support.angles import ARCSEC_PER_TURN
from ..support.files import FileKind
from .channelform import about_offsets, channels_of, made_of_channels, model_of_channels
from .codetext import longest_array, number_rows
from .knots import one_turn_knots, rounded_knots, rounding_floor, without_mean
from .pattern import TurnPattern
from .proof import Correction, Places
from .reading import sampled_model
from .target import CommentBlock, Made, Option, TablePart, Target

Single = NDArray[np.float32]

VARIANTS = {
    "minus-u16": "uint16_t table, subtracted (December 2025, PR 75)",
    "minus-float": "float table, subtracted (from March 2025)",
    "plus-float": "float[128] inside the class, added (until July 2024)",
}

#: The library's macro, a float.
_2PI = np.float32(6.28318530718)
#: Value of a uint16 entry: (entry - 32767) / 10430.2192 rad.
_MIDDLE = 32767
#: Entries, at most.
_MOST = 32767
_PER_RADIAN = np.float32(10430.2192)

_SIZES = (16, 24, 32, 48, 64, 100, 128, 200, 256, 400, 512, 800, 1024, 2048, 4096)

#: The variant of the target ``simplefoc``.
_LINEAR_HALL: Final = "linearhall"

_CALL = re.compile(r"LinearHall\s*\([^,()]+,[^,()]+,\s*(-?\d+)\s*,\s*(-?\d+)\s*,\s*(\d+)\s*\)")


class SimpleFoc(Target):
    """Target ``simplefoc``: lines to paste above ``CalibratedSensor``."""

    name = "simplefoc"
    what = "the calibrationLut array of SimpleFOC's CalibratedSensor"
    kind: ClassVar[FileKind] = FileKind(
        "a C++ source for SimpleFOC", (".h", ".cpp", ".hpp", ".ino", ".txt")
    )
    sign = "subtract"
    unknown = (
        "the electrical zero and the sensor's direction belong to the motor: let initFOC() find "
        "zero_electric_angle and sensor_direction again with this table in place"
    )
    options = {
        "variant": Option(
            (*VARIANTS, _LINEAR_HALL),
            "minus-u16",
            "version of the library, or the LinearHall sensor",
        ),
        "bits": Option(int, 24, "bits of a reading, at most 24: all are evaluated"),
        "entries": Option(int, 200, "of the table"),
    }

    def sizes(self, options: Mapping[str, Any]) -> Sequence[int]:
        return () if options["variant"] in ("plus-float", _LINEAR_HALL) else _SIZES

    def may_be_empty(self, options: Mapping[str, Any]) -> bool:
        return bool(options["variant"] == _LINEAR_HALL)

    def sign_of(self, options: Mapping[str, Any]) -> str:
        if options["variant"] == _LINEAR_HALL:
            return "absolute"
        return "add" if options["variant"] == "plus-float" else "subtract"

    def make(self, pattern: TurnPattern, options: Mapping[str, Any]) -> Made:
        variant = options["variant"]
        if variant == _LINEAR_HALL:
            return _linear_hall(pattern)
        old = variant == "plus-float"
        # Entries of the class before its table could be given.
        entries = 128 if old else options["entries"]
        if not 4 <= entries <= _MOST:
            raise ArgumentError(f"entries must be from 4 to {_MOST}, got {entries}")
        if not old:
            knots = one_turn_knots(pattern, entries, self.name, _MOST)
        else:
            knots = one_turn_knots(pattern, entries, f"{self.name} of variant {variant}")
        # What moves with the zero would move the motor's electrical zero.
        knots, zero_deg = without_mean(knots, pattern)
        radians = knots * (2.0 * math.pi)
        if variant == "minus-u16":
            table: NDArray[Any] = rounded_knots(radians * float(_PER_RADIAN)) + _MIDDLE
            if table.min() < 0 or table.max() > 65535:
                raise ArgumentError(f"{self.name}: corrections beyond half a turn")
            table = table.astype(np.uint16)
            step = 1.0 / (float(_PER_RADIAN) * 2.0 * math.pi)
        else:
            table = (-radians if old else radians).astype(np.float32)
            # Printed to 8 decimals; the sensor's own angle is a float of up to a turn.
            step = float(np.spacing(np.float32(2.0 * math.pi))) / (2.0 * math.pi)
        return Made(
            text=lambda header: self._text(header, variant, table),
            entries=entries,
            bytes=table.nbytes,
            part=TablePart.at_readings(
                pattern, *_device(variant, table), zero=zero_deg / 360.0, resolution=3.0 * 2.0**-24
            ),
            floor_arcsec=rounding_floor(step)
            if variant == "minus-u16"
            else step / math.sqrt(12.0) * ARCSEC_PER_TURN,
            zero_deg=zero_deg,
            notes=(
                f"variant {variant}: {VARIANTS[variant]}"
                + (
                    "; its arithmetic follows the published change; that of the float "
                    "tables was run"
                    if variant == "minus-u16"
                    else ""
                ),
            ),
        )

    def _text(self, header: CommentBlock, variant: str, table: NDArray[Any]) -> str:
        array = "calibrationLut"
        kind = "uint16_t" if variant == "minus-u16" else "float"
        if variant == "minus-u16":
            values = [str(int(value)) for value in table]
        else:
            values = [f"{float(value):.9g}" for value in table]
        guard = variant != "plus-float"
        own = [
            f"CalibratedSensor table, variant {variant}: {VARIANTS[variant]}.",
            f"Entry i is at i*2*pi/{len(table)} of the wrapped sensor's mechanical angle, the "
            "indicated one; "
            + (
                "it is minus the error, and added."
                if variant == "plus-float"
                else "it is the error, and subtracted."
            ),
        ]
        if guard:
            own.append(
                "The last number repeats the first: just below a full turn the library may read "
                "one number beyond n_lut."
            )
            values.append(values[0])
        lines = header.comment("// ", *own)
        lines += [
            f"const int n_lut = {len(table)};",
            f"{kind} {array}[{'n_lut + 1' if guard else 'n_lut'}] = {{",
            number_rows(values),
            "};",
        ]
        if guard:
            lines.append(
                f"// CalibratedSensor calibrated = CalibratedSensor(sensor, n_lut, {array});"
            )
        else:
            lines.append("// This version has no way to be given a table: copy it over the member")
            lines.append("// calibrationLut of CalibratedSensor, for example in its constructor.")
        return "\n".join(lines) + "\n"

    def read(self, text: str, path: str, options: Mapping[str, Any]) -> HarmonicModel:
        if options["variant"] == _LINEAR_HALL:
            return _read_linear_hall(text, path)
        said = re.search(r"variant (plus-float|minus-float|minus-u16)", text)
        variant = said[1] if said else options["variant"]
        numbers, line, decimals = longest_array(text, path, self.name)
        declared = re.search(r"\bn_lut\s*=\s*(\d+)", text)
        entries = int(declared[1]) if declared else len(numbers)
        if len(numbers) not in (entries, entries + 1):
            raise FileError(
                path, f"n_lut is {entries}, the table has {len(numbers)} numbers", line=line
            )
        numbers = numbers[:entries]
        whole = bool(np.all(numbers == np.rint(numbers)) and np.ptp(numbers) > 1.0)
        if whole != (variant == "minus-u16"):
            raise FileError(
                path,
                f"these are {'whole numbers' if whole else 'radians'}, not a table of variant "
                f"{variant}; give `variant={'minus-u16' if whole else 'minus-float'!r}`"
                f"{'' if whole else ' or plus-float'}",
                line=line,
            )
        if variant == "minus-u16":
            table: NDArray[Any] = numbers.astype(np.uint16)
            turns = (numbers - _MIDDLE) / (float(_PER_RADIAN) * 2.0 * math.pi)
            step = 1.0 / (float(_PER_RADIAN) * 2.0 * math.pi)
        else:
            table = numbers.astype(np.float32)
            turns = numbers / (2.0 * math.pi) * (-1.0 if variant == "plus-float" else 1.0)
            # The library prints six decimals; a float holds nine of such numbers.
            step = 10.0 ** -min(decimals or 6, 9) / (2.0 * math.pi)
        device = _device(variant, table)[0]
        return sampled_model(turns, path, self, device, step=step)


def _device(variant: str, table: NDArray[Any]) -> tuple[Correction, ...]:
    """What a version of the library subtracts from readings, without and with contraction."""

    def correction(angles: Places, contracted: bool) -> NDArray[np.float64]:
        raw = (angles * (2.0 * math.pi / 2.0**32)).astype(np.float32)
        if variant == "minus-u16":
            out = corrected_short(raw, table, contracted)
        else:
            sign = 1.0 if variant == "plus-float" else -1.0
            out = corrected_float(raw, table, sign, contracted)
        return np.asarray(angles / 2.0**32 - out.astype(np.float64) / (2.0 * math.pi))

    return tuple(partial(correction, contracted=c) for c in (False, True))


def _index(raw: Single, entries: int) -> tuple[NDArray[np.intp], np.float32]:
    resolution = np.float32(_2PI / np.float32(entries))
    return (raw / resolution).astype(np.intp), resolution


def _between(low: Single, high: Single, down: Single, up: Single, contracted: bool) -> Single:
    """``down * low + up * high``; contracted, rounded once, as a compiler may."""
    if contracted:
        return (down.astype(np.float64) * low + up.astype(np.float64) * high).astype(np.float32)
    return np.asarray(down * low + up * high, dtype=np.float32)


def _wrapped(raw: Single) -> Single:
    raw = np.fmod(raw, _2PI)
    return np.where(raw < 0, raw + _2PI, raw).astype(np.float32)


def corrected_float(raw: Single, table: Single, sign: float, contracted: bool = False) -> Single:
    """``getSensorAngle`` of the versions with a float table, for angles in radians.

    ``sign`` is +1 where the table is added (until 2024) and -1 where it is subtracted.
    """
    entries = len(table)
    if sign < 0.0:
        raw = _wrapped(raw)
    i, resolution = _index(raw, entries)
    low, high = table[i % entries], table[(i + 1) % entries]
    if contracted:
        remainder = (raw - i * np.float64(resolution)).astype(np.float32)
    else:
        remainder = raw - i.astype(np.float32) * resolution
    up = remainder / resolution
    if sign > 0.0:
        down = (resolution - remainder) / resolution
        return np.asarray(raw + _between(low, high, down, up, contracted), dtype=np.float32)
    down = np.float32(1.0) - up
    return np.asarray(raw - _between(low, high, down, up, contracted), dtype=np.float32)


def corrected_short(raw: Single, table: NDArray[np.uint16], contracted: bool = False) -> Single:
    """``getSensorAngle`` of the version with a uint16 table: by the reciprocal, then wrapped."""
    entries = len(table)
    raw = _wrapped(raw)
    place = raw * np.float32(np.float32(entries) / _2PI)
    i = place.astype(np.intp)
    up = (place - i.astype(np.float32)).astype(np.float32)
    low, high = (table[k % entries].astype(np.float32) - np.float32(_MIDDLE) for k in (i, i + 1))
    offset = _between(low, high, np.float32(1.0) - up, up, contracted) / _PER_RADIAN
    out = raw - offset
    out = np.where(out < 0, out + _2PI, out)
    return np.asarray(np.where(out >= _2PI, out - _2PI, out), dtype=np.float32)


def _linear_hall(pattern: TurnPattern) -> Made:
    """The constructor with whole centres: gain and phase of the channels stay."""
    channels = channels_of(pattern, f"simplefoc of variant {_LINEAR_HALL}")
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


def _read_linear_hall(text: str, path: str) -> HarmonicModel:
    """What a constructor's centres correct."""
    found = _CALL.search(text)
    if found is None:
        raise FileError(path, "has no LinearHall(pin, pin, centre, centre, pole pairs)")
    sine, cosine, periods = map(int, found.groups())
    return model_of_channels(
        Channels(
            offset_sine=sine, offset_cosine=cosine, periods_per_turn=periods or 1, period=360.0
        )
    )
