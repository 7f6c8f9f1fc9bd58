"""Mechaduino: the ``lookup`` array of 16384 corrected angles in degrees."""

from __future__ import annotations

import contextlib
import math
from collections.abc import Iterator, Mapping
from typing import Any, ClassVar

import numpy as np

from ..errors import ArgumentError, FileError
from ..model.model import HarmonicModel
from ..model.validity import check_lines
from ..support.angles import ARCSEC_PER_TURN
from ..support.arrays import Array
from ..support.files import FileKind, read_whole
from .codetext import longest_array, number_rows
from .pattern import TurnPattern
from .proof import Correction, Places
from .reading import sampled_model
from .target import CommentBlock, Made, Option, TablePart, Target

ENTRIES = 16384
_BITS = 14
_DECIMALS = 4


class Mechaduino(Target):
    """Target ``mechaduino``: the array to paste into ``Parameters.cpp``."""

    name = "mechaduino"
    what = "the lookup array of Mechaduino's Parameters.cpp"
    kind: ClassVar[FileKind] = FileKind(
        "a C++ source for Mechaduino", (".h", ".cpp", ".ino", ".txt")
    )
    sign = "absolute"
    files = ("existing",)
    options = {
        "existing": Option(str, None, "Parameters.cpp whose lookup gives the zero to keep"),
    }

    def make(self, pattern: TurnPattern, options: Mapping[str, Any]) -> Made:
        pattern.check_one_turn(self.name)
        pattern.check_orders(ENTRIES, self.name)
        counts = np.arange(ENTRIES) / ENTRIES
        exact = counts - pattern.correction(counts)
        zero, notes = 0.0, list[str]()
        if options["existing"] is None:
            notes.append(
                "the zero of lookup sets the phase of the motor's currents: give "
                '`existing="Parameters.cpp"` to keep the one that its own calibration found'
            )
        else:
            path = options["existing"]
            raw = read_whole(path, 8 << 20, "a source with the lookup array")
            present = _lookup(raw.decode("utf-8", "replace"), path)[0] / 360.0
            away = np.exp(2j * np.pi * (present - exact))
            zero = float(np.angle(np.mean(away))) / (2.0 * math.pi)
            notes.append(f"the zero of {path} is kept: {zero * 360.0:.6g} deg")
        table = np.round((exact + zero) % 1.0 * 360.0, _DECIMALS) % 360.0

        def text(header: CommentBlock) -> str:
            own = "Corrected angle in degrees of every count of the encoder, the indicated angle."
            lines = header.comment("// ", own)
            body = number_rows([f"{value:.{_DECIMALS}f}" for value in table], lead="")
            lines += [f"const PROGMEM float lookup[{ENTRIES}] = {{", body, "};", ""]
            return "\n".join(lines)

        step = 10.0**-_DECIMALS / 360.0
        return Made(
            text=text,
            entries=ENTRIES,
            bytes=4 * ENTRIES,
            part=TablePart.at_readings(pattern, _device(table), zero=pattern.zero + zero),
            floor_arcsec=step / math.sqrt(12.0) * ARCSEC_PER_TURN,
            zero_deg=(pattern.zero + zero) * 360.0,
            notes=tuple(notes),
            bits=_BITS,
        )

    def read(self, text: str, path: str, options: Mapping[str, Any]) -> HarmonicModel:
        table, decimals = _lookup(text, path)
        away = np.arange(ENTRIES) * (360.0 / ENTRIES) - table
        first = (away[0] + 180.0) % 360.0 - 180.0
        away = first + (away - away[0] + 180.0) % 360.0 - 180.0
        if np.max(np.abs(np.diff(np.append(away, away[0])))) > 180.0:
            raise ArgumentError(f"{path}: the angles of lookup do not go once around")
        step = 10.0 ** -min(decimals, 6) / 360.0
        for smooth, note in _smoothed(away, step):
            model = sampled_model(smooth / 360.0, path, self, _device(table), step=step, note=note)
            with contextlib.suppress(ArgumentError):  # too steep for so many orders
                check_lines(model.shafts, model.period)
                break
        return model


def _smoothed(away: Array, step: float) -> Iterator[tuple[Array, str]]:
    """Errors in degrees of a lookup whose angles increase, and what was done for that.

    The fewest orders within whose rounding the lookup is: a number is at most half a ``step``
    (turns) off, and angles that rise evenly round to a pattern with orders of its own, in the
    thousands. Where there are none, a lookup that the firmware measured holds the sensor's noise,
    which may be more than the 0.022 deg from one entry to the next. Centred means over entries
    take it out, the shortest first; up to a 64th of a turn, above which the lookup is no noise.
    """
    spectrum = np.fft.rfft(away)
    for order in range(ENTRIES // 128):
        first = np.fft.irfft(spectrum[: order + 1], ENTRIES)
        # Coefficients are off by the rounding as well: three standard deviations of their sum.
        slack = 6.0 * math.sqrt((2 * order + 1) / (12.0 * ENTRIES))
        if np.ptp(away - first) <= 360.0 * step * (1.0 + slack):
            yield first, f"orders above {order} are the rounding of its numbers and left out"
            break
    entry = 360.0 / ENTRIES
    backward = int(np.count_nonzero(np.diff(away, append=away[:1]) >= entry))
    width, smooth, note = 1, away, ""
    while width < ENTRIES // 64:
        if not np.any(np.diff(smooth, append=smooth[:1]) >= entry):
            yield smooth, note
        width = 2 * width + 1
        sums = np.cumsum(np.concatenate([[0.0], away[-(width // 2) :], away, away[: width // 2]]))
        smooth = (sums[width:] - sums[:-width]) / width
        note = (
            f"{backward} steps of the lookup go backward (noise of its measurement): smoothed over "
            f"{width} entries, by {np.std(smooth - away):.2g} deg rms"
        )
    yield smooth, note


def _device(table: Array) -> Correction:
    """What the firmware subtracts from readings, by degrees that it holds as floats."""
    single = table.astype(np.float32).astype(np.float64) / 360.0

    def correction(angles: Places) -> Array:
        return np.asarray(angles / 2.0**32 - single[angles % 2**32 >> (32 - _BITS)])

    return correction


def _lookup(text: str, path: str) -> tuple[Array, int]:
    table, line, decimals = longest_array(text, path, Mechaduino.name)
    if len(table) != ENTRIES or np.any((table < 0.0) | (table > 360.0)):
        got = f"lookup must hold {ENTRIES} angles from 0 to 360, got {len(table)} numbers"
        raise FileError(path, got, line=line)
    return table, decimals
