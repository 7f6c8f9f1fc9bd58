"""Tinymovr: the rectification table of a sensor, in its ticks."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError, FileError
from ..model.model import HarmonicModel
from ..support.files import FileKind
from .codetext import longest_array, number_rows
from .knots import one_turn_knots, rounded_knots, rounding_floor
from .pattern import TurnPattern
from .proof import Correction, Places
from .reading import sampled_model
from .target import CommentBlock, Made, Option, TablePart, Target

Whole = NDArray[np.int64]


class Tinymovr(Target):
    """Target ``tinymovr``: ``rec_table`` of a sensor's configuration."""

    name = "tinymovr"
    what = "the rec_table of a Tinymovr sensor"
    kind: ClassVar[FileKind] = FileKind("a C source for Tinymovr", (".h", ".c", ".txt"))
    sign = "add"
    unknown = (
        "no command is known that writes rec_table: the firmware fills it by its own "
        "calibration. Paste the lines where the sensor is configured and set "
        "rec_calibrated"
    )
    options = {
        "bits": Option(int, 13, "bits of the sensor: 13 or 14, as its driver has them"),
        "entries": Option(int, 64, "ECN_SIZE of the firmware, a power of two"),
    }

    def make(self, pattern: TurnPattern, options: Mapping[str, Any]) -> Made:
        bits, entries = options["bits"], options["entries"]
        if not 8 <= bits <= 20:
            raise ArgumentError(f"bits must be from 8 to 20, got {bits}")
        if entries & (entries - 1) or not 4 <= entries <= 1 << bits:
            raise ArgumentError(f"entries must be a power of two up to 2^bits, got {entries}")
        ticks = 1 << bits
        most = ticks if "entries" in self.options else 0
        knots = -one_turn_knots(pattern, entries, self.name, most, binary=True) * ticks
        # The shift between two entries cuts down: half a tick less on the mean.
        tried = [rounded_knots(knots + lift).astype(np.int64) for lift in (0.0, 0.5)]
        readings = np.arange(ticks)
        exact = pattern.correction(readings / ticks) * ticks
        left = [
            float(np.sum((readings - tinymovr_rectified(readings, t, bits) - exact) ** 2))
            for t in tried
        ]
        table = tried[int(np.argmin(left))]

        return Made(
            text=lambda header: self.write(table, bits, header),
            entries=entries,
            bytes=4 * entries,
            part=TablePart.at_readings(pattern, _device(table, bits), zero=pattern.zero),
            # Whole ticks: of the entries, and of what is between them.
            floor_arcsec=rounding_floor(1.0 / ticks) * 2.5**0.5,
            zero_deg=pattern.zero * 360.0,
            bits=bits,
        )

    def write(self, table: Whole, bits: int, header: CommentBlock) -> str:
        """The file's text."""
        own = (
            f"rec_table for a sensor of {bits} bits and ECN_SIZE {len(table)}: ticks that are "
            "added at the indicated angle."
        )
        values = number_rows([str(int(value)) for value in table])
        return "\n".join(
            [
                *header.comment("// ", own),
                ".rec_table = {",
                values,
                "},",
                ".rec_calibrated = true,",
                "",
            ]
        )

    def read(self, text: str, path: str, options: Mapping[str, Any]) -> HarmonicModel:
        table, line, _ = longest_array(text, path, self.name)
        if len(table) & (len(table) - 1) or np.any(table != np.rint(table)):
            raise FileError(path, "the table holds whole ticks, a power of two of them", line=line)
        ticks = 1 << options["bits"]
        device = _device(table.astype(np.int64), options["bits"])
        return sampled_model(-table / ticks, path, self, device, step=1.0 / ticks)


def _device(table: Whole, bits: int) -> Correction:
    def correction(angles: Places) -> NDArray[np.float64]:
        reading = angles % 2**32 >> (32 - bits)
        return np.asarray((reading - tinymovr_rectified(reading, table, bits)) / (1 << bits))

    return correction


def tinymovr_rectified(reading: Whole, table: Whole, bits: int) -> Whole:
    """``sensor_get_angle_rectified``: the firmware's interpolation, in whole ticks."""
    size = len(table)
    shift = bits - (size.bit_length() - 1)
    i = reading >> shift
    low, high = table[i % size], table[(i + 1) % size]
    return np.asarray(reading + low + (((high - low) * (reading - (i << shift))) >> shift))
