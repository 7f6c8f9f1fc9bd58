"""Beckhoff TwinCAT: the SSFK list of its CNC, and points for the compensation of NC axes."""

from __future__ import annotations

import csv
import io
import math
import re
from collections.abc import Mapping
from dataclasses import replace
from typing import Any, ClassVar

import numpy as np

from ..errors import ArgumentError, FileError
from ..model.model import HarmonicModel
from ..support.files import FileKind
from .knots import rounding_floor
from .pattern import TurnPattern
from .proof import enough_bits
from .setpoint import ENDS, POSITIONS, SetpointTravel, travel_model
from .target import CommentBlock, Made, Option, Target

#: P-COMP-00059, its default.
MOST = 1500
#: Units of 0.0001 deg in a turn.
TENTHS = 3_600_000
_DECIMALS = 9
_LINE = re.compile(r"^\s*kw\.ssfk\.(\w+)(?:\[(\d+)\]\.(\w+))?\s+(-?\d+)")
#: Digits of a whole number, at most: a billion turns in 10^-4 deg.
_DIGITS = 16


class TwinCat(Target):
    """Target ``twincat``: variant ``cnc`` or ``nc``."""

    name = "twincat"
    what = "the leadscrew compensation of a TwinCAT CNC axis, or points for an NC axis"
    kind: ClassVar[FileKind] = FileKind("a compensation list of TwinCAT", (".lis", ".txt", ".csv"))
    sign = "subtract"
    argument = "reference"
    tried = (36, 45, 60, 72, 90, 120, 144, 180, 240, 360, 480, 720, 900, 1200, 1440)
    takes_direction = True
    unknown = (
        "the format is checked against Beckhoff's documentation, not against a control: look at "
        "one known position before trusting it"
    )
    options = {
        "variant": Option(("cnc", "nc"), "cnc", "cnc: kw.ssfk list; nc: Position,Compensation"),
        "entries": Option(int, None, "to a turn (default: 360, or what orders and travel leave)"),
        **ENDS,
        "bits": POSITIONS,
    }

    def sign_of(self, options: Mapping[str, Any]) -> str:
        return "add" if options["variant"] == "nc" else "subtract"

    def make(self, pattern: TurnPattern, options: Mapping[str, Any]) -> Made:
        cnc = options["variant"] == "cnc"
        most, divided = (MOST, TENTHS) if cnc else (100_000, 0)
        travel = SetpointTravel.of(pattern, self.name, options, most, divided=divided)
        made = self._cnc(pattern, travel) if cnc else self._nc(pattern, travel)
        return replace(made, bits=enough_bits(options["bits"], made.entries))

    def _cnc(self, pattern: TurnPattern, travel: SetpointTravel) -> Made:
        if TENTHS % travel.entries:
            raise ArgumentError(
                f"`entries={travel.entries}` a turn are no whole number of 0.0001 deg apart: use "
                "a divisor of 3600000, such as 360 or 720"
            )
        interval = TENTHS // travel.entries
        start = round(travel.start * 1e4)
        if abs(start - travel.start * 1e4) > 1e-6:
            raise ArgumentError(f"start must be a whole number of 0.0001 deg, got {travel.start}")
        # The list holds actual less programmed: minus the error.
        values = [np.rint(-v * TENTHS).astype(int) for v in (travel.forward, travel.reverse)]
        whole = math.isclose(travel.stop - travel.start, 360.0)

        def text(header: CommentBlock) -> str:
            own = "Leadscrew error compensation, 0.0001 deg: actual less programmed position."
            lines = header.comment("# ", own)
            lines += [
                f"kw.ssfk.interval {interval}",
                f"kw.ssfk.kw_startpos {start}",
                f"kw.ssfk.kw_nr_max {len(values[0])}",
                "kw.ssfk.bilateral 1",
                f"kw.ssfk.modulo {int(whole)}",
            ]
            for column, numbers in zip(("pos", "neg"), values, strict=True):
                lines += [f"kw.ssfk.table[{i}].{column} {n}" for i, n in enumerate(numbers)]
            return "\n".join(lines) + "\n"

        step = 1.0 / TENTHS
        return Made(
            text=text,
            entries=len(values[0]),
            bytes=8 * len(values[0]),
            part=travel.part(pattern, *(-v / TENTHS for v in values)),
            floor_arcsec=rounding_floor(step),
            zero_deg=pattern.zero * 360.0,
            lost=lambda: travel.lost(pattern),
            notes=("switch it on by lr_param.ssfk 1 of the axis",),
        )

    def _nc(self, pattern: TurnPattern, travel: SetpointTravel) -> Made:
        columns = [np.round(v * 360.0, _DECIMALS) for v in (travel.forward, travel.reverse)]

        def text(header: CommentBlock) -> str:
            out = io.StringIO()
            writer = csv.writer(out, lineterminator="\n")
            writer.writerow(["Position", "Compensation_positive", "Compensation_negative"])
            for x, f, r in zip(travel.nominal, *columns, strict=True):
                writer.writerow([f"{x:.9f}", f"{f:.9f}", f"{r:.9f}"])
            return out.getvalue()

        step = 10.0**-_DECIMALS / 360.0
        return Made(
            text=text,
            entries=len(travel.nominal),
            bytes=16 * len(travel.nominal),
            part=travel.part(pattern, *(v / 360.0 for v in columns)),
            floor_arcsec=rounding_floor(step),
            zero_deg=pattern.zero * 360.0,
            lost=lambda: travel.lost(pattern),
            notes=(
                "fill the (Position, Compensation) array of the compensation with one of the two "
                "columns, one array per Direction; values are added to the set point",
            ),
        )

    def read(self, text: str, path: str, options: Mapping[str, Any]) -> HarmonicModel:
        if "kw.ssfk." in text:
            return travel_model(_cnc_table(text, path), path, self, 1e-4)
        return travel_model(_nc_table(text, path), path, self, 10.0**-_DECIMALS)


def _cnc_table(text: str, path: str) -> np.ndarray[Any, np.dtype[np.float64]]:
    settings: dict[str, int] = {}
    columns: dict[str, dict[int, int]] = {}
    for number, line in enumerate(text.split("\n"), 1):
        found = _LINE.match(line)
        if found is None:
            if line.strip().startswith("kw.ssfk."):
                raise FileError(
                    path, f"{line.strip()[:50]!r} is not a whole number of a key", line=number
                )
            continue
        if len(found[4]) > _DIGITS:
            raise FileError(path, f"{found[4][:_DIGITS]}... is no number of a key", line=number)
        if found[2] is None:
            settings[found[1]] = int(found[4])
        else:
            columns.setdefault(found[3], {})[int(found[2])] = int(found[4])
    count = settings.get("kw_nr_max", 0)
    pos = columns.get("pos", {})
    neg = columns.get("neg", pos) if settings.get("bilateral") else pos
    points = columns.get("setpoint", {})
    interval = settings.get("interval", 0)
    if count < 4 or any(set(c) != set(range(count)) for c in (pos, neg)):
        raise FileError(
            path, f"kw_nr_max is {count}, but pos has {len(pos)} and neg {len(neg)} lines"
        )
    if interval:
        nominal = settings.get("kw_startpos", 0) + interval * np.arange(count)
    elif set(points) == set(range(count)):
        nominal = np.array([points[i] for i in range(count)])
    else:
        raise FileError(path, "interval is 0 or missing, and not every table entry has a setpoint")
    if np.any(np.diff(nominal) <= 0):
        raise FileError(path, "positions must increase")
    values = [[-column[i] for i in range(count)] for column in (pos, neg)]
    return np.array([nominal, *values]).T / 1e4


def _nc_table(text: str, path: str) -> np.ndarray[Any, np.dtype[np.float64]]:
    rows: list[tuple[float, ...]] = []
    for number, row in enumerate(csv.reader(io.StringIO(text)), 1):
        if number == 1 and row and not row[0].strip().lstrip("-").replace(".", "").isdigit():
            continue
        try:
            values = [float(cell) for cell in row]
            if len(values) not in (2, 3) or not all(map(math.isfinite, values)):
                raise ValueError
        except ValueError:
            raise FileError(
                path, f"Position,Compensation is wanted, got {row!r}", line=number
            ) from None
        if rows and values[0] <= rows[-1][0]:
            raise FileError(path, "positions must increase", line=number)
        rows.append((*values, values[-1])[:3])
    if len(rows) < 4:
        raise FileError(path, f"holds {len(rows)} points: no table of {TwinCat.name}")
    return np.array(rows)
