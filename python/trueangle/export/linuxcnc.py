"""LinuxCNC: a ``COMP_FILE``, forward and reverse, for a rotary joint in degrees."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from ..errors import ArgumentError, FileError
from ..model.model import HarmonicModel
from ..support.files import FileKind
from .knots import rounding_floor
from .pattern import TurnPattern
from .proof import enough_bits
from .setpoint import (
    ENDS,
    NOMINAL_DECIMALS,
    POSITIONS,
    SetpointTravel,
    axis_steepness,
    travel_model,
)
from .target import CommentBlock, Made, Option, Target

#: EMCMOT_COMP_SIZE.
MOST = 256
#: Decimals of a degree that are printed.
_DECIMALS = 7


class LinuxCnc(Target):
    """Target ``linuxcnc``: the file that ``COMP_FILE`` of a joint names."""

    name = "linuxcnc"
    what = "a COMP_FILE of a rotary joint, forward and reverse"
    kind: ClassVar[FileKind] = FileKind(
        "a compensation file of LinuxCNC", (".comp", ".txt", ".dat")
    )
    sign = "add"
    argument = "reference"
    tried = (12, 18, 24, 36, 48, 60, 72, 90, 120, 180, 240)
    takes_direction = True
    unknown = (
        "BACKLASH of the joint is ignored where a COMP_FILE is given; outside the table the first "
        "and the last value hold"
    )
    options = {
        "type": Option(("0", "1"), "1", "COMP_FILE_TYPE: 0 positions, 1 trims"),
        "entries": Option(
            int, None, "to a turn; 256 in all (default: 180, or what orders and travel leave)"
        ),
        **ENDS,
        "bits": POSITIONS,
    }

    def make(self, pattern: TurnPattern, options: Mapping[str, Any]) -> Made:
        travel = SetpointTravel.of(pattern, self.name, options, MOST, usual=180)
        # The motor is commanded to position + trim: the trim is the error.
        forward, reverse = (
            np.round(values * 360.0, _DECIMALS) for values in (travel.forward, travel.reverse)
        )
        positions = options["type"] == "0"

        def text(header: CommentBlock) -> str:
            rows = []
            for x, f, r in zip(travel.nominal, forward, reverse, strict=True):
                a, b = (x - f, x - r) if positions else (f, r)
                rows.append(f"{x:.{NOMINAL_DECIMALS}f} {a:.{_DECIMALS}f} {b:.{_DECIMALS}f}")
            # LinuxCNC reads up to the first line that is not three numbers.
            own = f"{self.what}, COMP_FILE_TYPE = {options['type']}; degrees."
            return "\n".join([*rows, *header.comment("# ", own), ""])

        slope, bend = axis_steepness(travel)
        step = 10.0**-_DECIMALS / 360.0
        return Made(
            text=text,
            entries=len(forward),
            bytes=24 * len(forward),
            part=travel.part(pattern, forward / 360.0, reverse / 360.0),
            floor_arcsec=rounding_floor(step),
            zero_deg=pattern.zero * 360.0,
            bits=enough_bits(options["bits"], len(forward)),
            lost=lambda: travel.lost(pattern),
            notes=(
                f"set COMP_FILE_TYPE = {options['type']} of the joint",
                f"at v deg/s the trim moves at up to {slope:.3g} v deg/s. It accelerates at up to "
                f"{bend:.3g} v^2 deg/s^2 at its corners: LinuxCNC gives it half of the joint's "
                "MAX_ACCELERATION",
            ),
        )

    def read(self, text: str, path: str, options: Mapping[str, Any]) -> HarmonicModel:
        rows: list[list[float]] = []
        decimals = 0
        for number, line in enumerate(text.split("\n"), 1):
            words = line.split()
            try:
                triplet = [float(word) for word in words[:3]]
                if len(triplet) != 3 or not all(map(math.isfinite, triplet)):
                    raise ValueError
            except ValueError:
                rest = [part.strip() for part in text.split("\n")[number - 1 :]]
                if any(part and part[0] not in "#;" for part in rest):
                    raise FileError(
                        path,
                        f"three numbers are wanted, got {line.strip()[:40]!r}: LinuxCNC stops "
                        "reading here",
                        line=number,
                    ) from None
                break
            if rows and triplet[0] <= rows[-1][0]:
                raise FileError(path, "nominal positions must increase", line=number)
            rows.append(triplet)
            decimals = max(decimals, *(len(word.partition(".")[2]) for word in words[:3]))
        if not 4 <= len(rows) <= MOST:
            raise FileError(path, f"{len(rows)} lines: LinuxCNC takes 4 to {MOST} here")
        table = np.array(rows)
        if options["type"] == "0":
            table[:, 1:] = table[:, :1] - table[:, 1:]
        largest = float(np.max(np.abs(table[:, 1:])))
        # Degrees: no trim of an axis that works is larger.
        if largest > 30.0:
            raise ArgumentError(
                f"{path}: trims of up to {largest:.4g} deg: are these positions? give "
                f"`type={'1' if options['type'] == '0' else '0'!r}`"
            )
        return travel_model(table, path, self, 10.0**-decimals)
