"""Corrections as a plain table of text, for anything that interpolates between lines."""

from __future__ import annotations

import csv
import io
import math
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError, FileError
from ..model.model import HarmonicModel
from ..support.angles import ARCSEC_PER_TURN
from ..support.files import FileKind
from .knots import linear_knots
from .pattern import TurnPattern
from .proof import Correction, Places, enough_bits
from .reading import sampled_model
from .target import CommentBlock, Made, Option, TablePart, Target

#: Distance of two printed numbers, in degrees: 9 decimals.
_LAST_DIGIT = 1e-9

#: Lines to a turn, at most.
_MOST = 1_000_000


class CsvTable(Target):
    """Target ``csv``: ``indicated_deg, correction_deg``, to be interpolated linearly."""

    name = "csv"
    what = "lines of indicated_deg,correction_deg to interpolate between"
    kind: ClassVar[FileKind] = FileKind("a table of corrections (CSV)", (".csv", ".txt"))
    sign = "subtract"
    tried = (36, 45, 60, 72, 90, 120, 180, 240, 360, 720, 1440, 3600, 7200, 36000)
    options = {
        "bits": Option(int, 20, "2^bits readings are evaluated, and more where entries are many"),
        "entries": Option(int, 360, "lines to a turn (the first one is repeated at 360)"),
    }

    def make(self, pattern: TurnPattern, options: Mapping[str, Any]) -> Made:
        entries = options["entries"]
        if not 4 <= entries <= _MOST:
            raise ArgumentError(f"entries must be from 4 to {_MOST}, got {entries}")
        pattern.check_one_turn(self.name)
        pattern.check_orders(entries, self.name, range(4, _MOST + 1))
        values = np.round(linear_knots(pattern.correction, entries) * 360.0, 9)
        knots = np.concatenate([values, values[:1]])
        places = np.arange(entries + 1) * 360.0 / entries

        def text(header: CommentBlock) -> str:
            out = io.StringIO()
            writer = csv.writer(out, lineterminator="\n")
            writer.writerow(["indicated_deg", "correction_deg"])
            writer.writerows((f"{x:.9f}", f"{y:.9f}") for x, y in zip(places, knots, strict=True))
            return out.getvalue()

        return Made(
            text=text,
            entries=entries,
            bytes=16 * (entries + 1),
            part=TablePart.at_readings(
                pattern, _interpolated(values), zero=pattern.zero, continuous=True
            ),
            floor_arcsec=_LAST_DIGIT / math.sqrt(18.0) / 360.0 * ARCSEC_PER_TURN,
            zero_deg=pattern.zero * 360.0,
            bits=enough_bits(options["bits"], entries),
        )

    def read(self, text: str, path: str, options: Mapping[str, Any]) -> HarmonicModel:
        try:
            rows = list(csv.reader(text.splitlines()))
        except csv.Error as cause:
            raise FileError(path, f"is no table: {cause}") from cause
        if not rows or [cell.strip() for cell in rows[0]] != ["indicated_deg", "correction_deg"]:
            raise FileError(
                path, "the header of such a table is indicated_deg,correction_deg", line=1
            )
        numbers = []
        for i, row in enumerate(rows[1:], 2):
            try:
                place, value = map(float, row)
            except ValueError:
                raise FileError(
                    path, f"two numbers are needed, got {','.join(row)!r}", line=i
                ) from None
            if not (math.isfinite(place) and math.isfinite(value)):
                raise FileError(path, f"finite numbers are needed, got {','.join(row)!r}", line=i)
            numbers.append((place, value))
        table = np.array(numbers)
        if len(table) < 5 or not np.allclose(
            table[:, 0], np.arange(len(table)) * 360.0 / (len(table) - 1), atol=1e-6
        ):
            raise FileError(path, "lines must be equally spaced from 0 to 360 degrees")
        values = table[:-1, 1]
        return sampled_model(
            values / 360.0, path, self, _interpolated(values), step=_LAST_DIGIT / 360.0
        )


def _interpolated(values: NDArray[np.float64]) -> Correction:
    """Of values in degrees at equal distances; the first one again at the end of the turn."""
    knots = np.append(values, values[0])
    places = np.arange(len(knots)) * (2.0**32 / len(values))

    def correction(angles: Places) -> NDArray[np.float64]:
        return np.asarray(np.interp(angles % 2**32, places, knots) / 360.0)

    return correction
