"""Siemens SINUMERIK 840D and 808D: the compensation of a rotary axis' encoder."""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np

from ..errors import FileError
from ..model.model import HarmonicModel
from ..support.files import FileKind
from .knots import rounding_floor
from .pattern import TurnPattern
from .proof import enough_bits
from .setpoint import ENDS, POSITIONS, SetpointTravel, travel_model
from .target import CommentBlock, Made, Option, Target

#: MD38000 MM_ENC_COMP_MAX_POINTS.
MOST = 5000
_DECIMALS = 7
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_POINT = re.compile(rf"^\$AA_ENC_COMP\[(\d+),(\d+),(\w+)\]\s*=\s*({_NUMBER})$")
_SETTING = re.compile(rf"^\$AA_ENC_COMP_(\w+)\[(\d+),(\w+)\]\s*=\s*({_NUMBER})$")


class Siemens840d(Target):
    """Target ``siemens840d``: ``$AA_ENC_COMP`` of a machine axis, in degrees."""

    name = "siemens840d"
    what = "the $AA_ENC_COMP table of a rotary axis of a SINUMERIK"
    kind: ClassVar[FileKind] = FileKind(
        "a compensation file of SINUMERIK", (".ini", ".mpf", ".spf", ".txt")
    )
    sign = "add"
    tried = (36, 45, 60, 72, 90, 120, 144, 180, 240, 360, 480, 720, 1440)
    unknown = (
        "written by the maker's documentation and not run on the device: make the check in the "
        "file before the axis works with it"
    )
    options = {
        "entries": Option(int, None, "to a turn (default: 360, or what orders and travel leave)"),
        **ENDS,
        "axis": Option(str, "AX1", "name of the machine axis"),
        "encoder": Option(("0", "1"), "0", "measuring system of the axis, from 0"),
        "bits": POSITIONS,
    }

    def make(self, pattern: TurnPattern, options: Mapping[str, Any]) -> Made:
        travel = SetpointTravel.of(pattern, self.name, options, MOST, pattern.correction)
        # The value is added to the actual position, and the correction is subtracted.
        values = np.round(-travel.forward * 360.0, _DECIMALS) + 0.0
        whole = math.isclose(travel.stop - travel.start, 360.0)
        if whole:
            values[-1] = values[0]
        place = f"{options['encoder']},{options['axis']}"

        def text(header: CommentBlock) -> str:
            k = int(np.argmax(np.abs(values)))
            own = [
                f"Encoder compensation of axis {options['axis']}, degrees. The value at a position "
                "is added to the actual position of the axis (a positive value moves the axis in "
                "the negative direction); lines between points.",
                f"Check 1: move to {travel.nominal[k]:.6g} deg and switch the compensation on "
                "(MD32700 ENC_COMP_ENABLE = 1, axis referenced).",
                f"Check 2: the axis must move by {-values[k]:.6g} deg; where it moves the other "
                "way, turn the sign of every value.",
            ]
            lines = header.comment("; ", *own)
            lines.append("CHANDATA(1)")
            lines += [
                f"$AA_ENC_COMP[{options['encoder']},{i},{options['axis']}]={v:.{_DECIMALS}f}"
                for i, v in enumerate(values)
            ]
            settings = {
                "STEP": f"{360.0 / travel.entries:.9g}",
                "MIN": f"{travel.nominal[0]:.9g}",
                "MAX": f"{travel.nominal[-1]:.9g}",
                "IS_MODULO": f"{int(whole)}",
            }
            lines += [f"$AA_ENC_COMP_{key}[{place}]={v}" for key, v in settings.items()]
            return "\n".join([*lines, "M17", ""])

        step = 10.0**-_DECIMALS / 360.0
        return Made(
            text=text,
            entries=len(values),
            bytes=8 * len(values),
            part=travel.at_readings(pattern, -values / 360.0),
            floor_arcsec=rounding_floor(step),
            zero_deg=pattern.zero * 360.0,
            bits=enough_bits(options["bits"], len(values)),
            lost=lambda: travel.lost(pattern),
            notes=(
                f"set MD38000 MM_ENC_COMP_MAX_POINTS to {len(values)} or more, and load the file "
                "while MD32700 ENC_COMP_ENABLE is 0",
                "the axis jumps by the value at its reference point: best where that is 0",
            ),
        )

    def read(self, text: str, path: str, options: Mapping[str, Any]) -> HarmonicModel:
        points: dict[int, float] = {}
        settings: dict[str, float] = {}
        axis = ""
        for number, line in enumerate(text.split("\n"), 1):
            plain = line.partition(";")[0].replace(" ", "").upper()
            point, setting = _POINT.match(plain), _SETTING.match(plain)
            if point is not None:
                axis = axis or point[3]
                if point[3] == axis:
                    points[int(point[2])] = float(point[4])
            elif setting is not None:
                if setting[3] == (axis or setting[3]):
                    settings[setting[1]] = float(setting[4])
            elif plain.startswith("$AA_ENC_COMP"):
                raise FileError(
                    path, f"{line.strip()[:50]!r} is not a value of $AA_ENC_COMP", line=number
                )
        missing = [key for key in ("STEP", "MIN", "MAX") if key not in settings]
        if not points or missing:
            what = f"$AA_ENC_COMP_{missing[0]}" if missing else "$AA_ENC_COMP"
            raise FileError(path, f"no table of {self.name}: {what} is missing")
        step = settings["STEP"]
        steps = (settings["MAX"] - settings["MIN"]) / step if step > 0.0 else 0.0
        count = round(steps) + 1 if abs(steps) < MOST else 0  # a damaged span may be endless
        if not 4 <= count <= MOST or any(i not in points for i in range(count)):
            raise FileError(
                path,
                f"STEP, MIN and MAX are of {steps + 1:.6g} points, and {len(points)} are there",
            )
        nominal = settings["MIN"] + step * np.arange(count)
        values = -np.array([points[i] for i in range(count)])
        table = np.array([nominal, values, values]).T
        return travel_model(table, path, self, 10.0**-_DECIMALS, forward=False)
