"""Klipper's ``[angle]`` section: the values of an existing ``calibrate`` list, made again.

The list is no table of corrections. It holds the sensor's reading at consecutive full steps of
the motor; Klipper solves 64 knots from it. A model of the angle does not contain the position of
step 0 relative to the motor's phases. So Klipper's own list is needed; only its values change.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError, FileError
from ..estimation.linear import least_squares
from ..model.model import HarmonicModel
from ..support.angles import ARCSEC_PER_TURN
from ..support.arrays import Array
from ..support.files import FileKind, read_whole
from .knots import linear_knots, rounded_knots
from .pattern import TurnPattern
from .proof import Correction, Places
from .reading import ReadTable, function_model
from .target import CommentBlock, Made, Option, TablePart, Target

#: Counts to a turn, and knots that Klipper solves.
TURN = 65536
KNOTS = 64
_BUCKET = TURN // KNOTS

Whole = NDArray[np.int64]


class Klipper(Target):
    """Target ``klipper``: the lines of ``calibrate``."""

    name = "klipper"
    what = 'the calibrate list of an [angle] section; needs `existing="printer.cfg"`'
    kind: ClassVar[FileKind] = FileKind("a section of a printer.cfg", (".cfg", ".txt"))
    sign = "absolute"
    files = ("existing",)
    unknown = (
        "Klipper's zero is a full step: corrected angles differ from the model's by a constant, "
        "which is taken out here"
    )
    options = {
        "existing": Option(str, None, "file with the calibrate list that Klipper made"),
        "section": Option(str, None, "of the file, where several have such a list"),
        "bits": Option(int, 16, "bits of a reading: Klipper's are 16"),
    }

    def make(self, pattern: TurnPattern, options: Mapping[str, Any]) -> Made:
        if options["existing"] is None:
            raise ArgumentError(
                "klipper needs `existing=`, the printer.cfg (or its saved part) with the calibrate "
                "list that ANGLE_CALIBRATE made: where the list begins sets the motor's phase"
            )
        if options["bits"] > 16:
            raise ArgumentError("bits must be at most 16: Klipper's angles have 65536 counts")
        path = options["existing"]
        raw = read_whole(path, 8 << 20, "a printer.cfg")
        section, present = _list_of(raw.decode("utf-8", "replace"), path, options["section"])
        pattern.check_one_turn(self.name)
        pattern.check_orders(KNOTS, self.name)
        steps = len(present)
        direction = -1 if is_backwards(present) else 1
        places = direction * np.arange(steps) / steps
        # The position of step 0: the mean over the present list, by this model.
        there = present / TURN - pattern.correction(present / TURN) - pattern.zero - places
        start = float(np.angle(np.mean(np.exp(2j * np.pi * there)))) / (2.0 * math.pi)
        away = there - start
        away -= np.rint(away)
        moved = float(np.sqrt(np.mean(away**2)))
        if moved > 0.25 / steps:
            raise ArgumentError(
                f"{path}: the list and the model disagree by {moved * steps:.2g} full steps rms: "
                "is the model in the sensor's own direction and zero, of this motor?"
            )
        values, knots, zero = _values(pattern, start, places)

        def text(header: CommentBlock) -> str:
            cells = [f"{value:.1f}" for value in values]
            lines = [", ".join(cells[i : i + 8]) for i in range(0, steps, 8)]
            body = ",\n".join(f"\t{line}" for line in lines)
            lines = header.comment("# ", "Readings of the sensor at consecutive full steps.")
            return "\n".join([f"[{section}]", *lines, "calibrate =", body, ""])

        return Made(
            text=text,
            entries=steps,
            bytes=8 * (KNOTS + 1),
            # Klipper's positions count from the full step whose true angle is ``zero``.
            part=TablePart.at_readings(pattern, _device(knots), zero=-zero),
            # Knots and results are whole counts.
            floor_arcsec=math.sqrt(1.0 / 18.0 + 1.0 / 12.0) / TURN * ARCSEC_PER_TURN,
            zero_deg=-zero * 360.0,
            notes=(
                f"replaces the values of calibrate in [{section}]; the other keys of the section "
                "stay as they are",
                f"the present list is {moved * ARCSEC_PER_TURN:.3g} arcsec rms from this model",
            ),
        )

    def read(self, text: str, path: str, options: Mapping[str, Any]) -> HarmonicModel:
        _, present = _list_of(text, path, options["section"])
        knots, _ = solved_knots(present)

        def function(x: Array) -> Array:
            # Interpolated between knots, without Klipper's rounding to whole counts.
            counts = x % 1.0 * TURN
            bucket = np.minimum((counts / _BUCKET).astype(np.intp), KNOTS - 1)
            share = counts / _BUCKET - bucket
            out = knots[bucket] + share * (knots[bucket + 1] - knots[bucket])
            difference = (counts - out) / TURN
            return np.asarray(difference - np.rint(difference - difference[0]))

        mean = float(np.mean(function(np.arange(4096) / 4096)))
        return function_model(
            [ReadTable("output", 1.0, lambda x: function(x) - mean, KNOTS, 1.0 / TURN)],
            path,
            self,
            _device(knots),
            note="solved from a calibrate list as Klipper does; its zero is a full step and "
            "taken out; the uncertainty is that of whole counts",
        )


def _device(knots: Whole) -> Correction:
    def correction(angles: Places) -> Array:
        counts = angles % 2**32 >> 16
        return np.asarray((counts - calibrated(counts, knots)) / TURN)

    return correction


def _values(pattern: TurnPattern, start: float, places: Array) -> tuple[Array, Whole, float]:
    """The list, the knots that Klipper solves from it, and the true angle of its position 0.

    Klipper rounds the knots it solves. The readings of the model would give it knots that are
    rounded each alone; readings moved onto the lines of the best whole knots give it those.
    """
    steps = len(places)
    values = _printed(np.asarray(pattern.reading(start + places)))
    best = linear_knots(pattern.correction, KNOTS)
    for _ in range(2):  # a reading moved over the turn's end makes another entry the first
        if np.any(np.diff(np.sort(values)) <= 0.0):
            raise ArgumentError("klipper: two full steps have one reading; check the direction")
        first = solved_knots(values)[1]
        zero = start + places[first]
        ideal = (np.arange(KNOTS) / KNOTS - best - pattern.zero - zero) * TURN
        whole = rounded_knots(ideal)
        lines = np.concatenate([whole + turn * TURN for turn in (-2, -1, 0, 1, 2)])
        at = np.arange(-2 * KNOTS, 3 * KNOTS) / KNOTS
        direction = np.sign(places[1])
        positions = direction * (np.arange(steps) - first) / steps
        values = _printed(np.interp(positions * TURN, lines, at))
    knots, first = solved_knots(values)
    return values, knots, start + places[first]


def _printed(readings: Array) -> Array:
    return np.asarray(np.round(readings % 1.0 * TURN, 1) % TURN)


def _list_of(text: str, path: str, section: str | None) -> tuple[str, Array]:
    """Section and values of the ``calibrate`` list, also in Klipper's saved part."""
    found: dict[str, tuple[int, str]] = {}
    name, reading = "", False
    for number, line in enumerate(text.split("\n"), 1):
        plain = re.sub(r"^#\*# ?", "", line)
        heading = re.match(r"\[([^\]]+)\]", plain)
        key = re.match(r"(\w+)\s*[:=](.*)", plain)
        if heading:
            name, reading = heading[1].strip(), False
        elif key:
            reading = key[1] == "calibrate"
            if reading:
                found[name] = (number, key[2])
        elif reading and plain[:1] in (" ", "\t"):
            at, values = found[name]
            found[name] = (at, values + " " + re.sub(r"[#;].*", "", plain))
        elif plain.strip():
            reading = False
    chosen = {n: v for n, v in found.items() if section is None or n == section}
    if len(chosen) != 1:
        have = ", ".join(f"[{n}]" for n in found) or "none"
        raise FileError(
            path, f"one section with a calibrate list is wanted, {have} there; give `section=`"
        )
    ((name, (at, cells)),) = chosen.items()
    try:
        readings = np.array([float(cell) for cell in cells.split(",") if cell.strip()])
    except ValueError:
        raise FileError(path, "calibrate holds something that is not a number", line=at) from None
    if len(readings) < KNOTS or not np.all((readings >= 0.0) & (readings < TURN)):
        raise FileError(
            path, f"calibrate must hold one reading from 0 to 65536 per full step, got "
            f"{len(readings)} numbers", line=at
        )  # fmt: skip
    return name, readings


def is_backwards(readings: Array) -> bool:
    """Whether the sensor counts against the steps: Klipper goes by the last two readings."""
    return bool(readings[-2] > readings[-1])


def solved_knots(values: Array) -> tuple[Whole, int]:
    """The 65 knots that Klipper solves from a list, and which of its entries is position 0.

    One equation per full step: the line between the two knots around its reading meets the
    step's position; least squares, rounded to whole counts.
    """
    angles = np.asarray(values, dtype=np.float64)
    steps = len(angles)
    order = np.arange(steps)[::-1] if is_backwards(angles) else np.arange(steps)
    first = int(np.argmin(angles[order]))
    order = np.roll(order, -first)
    angles = angles[order]
    bucket = (np.floor(angles + 0.5) % TURN).astype(np.int64) // _BUCKET
    share = (angles - bucket * _BUCKET) / _BUCKET
    equations = np.zeros((steps, KNOTS))
    rows = np.arange(steps)
    equations[rows, bucket] = 1.0 - share
    equations[rows, (bucket + 1) % KNOTS] = share
    wanted = rows * (TURN / steps) - np.where(bucket + 1 >= KNOTS, share * TURN, 0.0)
    solution = least_squares(equations, np.asarray(wanted, dtype=np.float64))
    whole = np.trunc(solution + 0.5).astype(np.int64)
    return np.append(whole, whole[0] + TURN), int(order[0])


def calibrated(counts: Whole, knots: Whole) -> Whole:
    """Klipper's integer interpolation: positions in counts of readings in counts."""
    shift = 10
    bucket = (counts & 0xFFFF) >> shift
    low, high = knots[bucket], knots[bucket + 1]
    adjusted = low + (((counts & (_BUCKET - 1)) * (high - low) + (1 << (shift - 1))) >> shift)
    difference = (adjusted - counts) & 0xFFFF
    difference -= (difference & 0x8000) << 1
    return np.asarray(counts + difference)
