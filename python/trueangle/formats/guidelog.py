"""Guide logs of PHD2: the periodic error of a mount's right ascension axis, guiding taken out.

While a mount tracks, its motor turns the axis by the sidereal angle; how far the star lags behind
it, with all guide pulses so far undone, is the error of the axis:

::

    e_n = (s / cos δ) (x_n + Σ_{k<n} r p_k + d_n)

with the pixel scale s, the declination, the RA distance x in pixels, the guide rate r, the pulses p
(west positive) and the dithers d. Frames without a star, and those while the guiding settles, are
omitted. Format: https://github.com/OpenPHDGuiding/phd2/wiki/PHD2GuideLog
"""

from __future__ import annotations

import io
import math
import re
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, field
from datetime import datetime
from pathlib import Path
from typing import Final, NamedTuple

import numpy as np

from ..errors import FileError, MessageLinesWarning
from .csvcells import cell_number
from .format import Batch, Contents, CopyTask, Selection, row_labels
from .textfile import open_text

#: Degrees a second by which the sky turns.
SIDEREAL: Final = 360.0 / 86164.0905
_COLUMNS = ("run", "when", "time_s", "indicated_deg", "error_arcsec", "declination_arcsec", "snr")
_LABELS = ("run", "when")
_BEGINS = re.compile(r"Guiding Begins at (\d{4}-\d\d-\d\d \d\d:\d\d:\d\d)")
#: A number with at most 9 digits before the point: no angle, scale or rate has more.
_NUMBER = r"(-?\d{1,9}(?:\.\d+)?)\b"
_SCALE = re.compile(rf"Pixel scale = {_NUMBER} arc-sec/px")
_DECLINATION = re.compile(rf"\bDec = {_NUMBER} deg")
_RATE = re.compile(rf"xAngle = {_NUMBER}, xRate = {_NUMBER}")
_LOCK = re.compile(rf"(?:Lock position|new lock pos) = {_NUMBER}, {_NUMBER}")
_NEEDED = ("Time", "mount", "RARawDistance", "RADuration", "RADirection")


@dataclass
class _Section:
    """A segment of guiding, and what its header states."""

    label: str
    begins: datetime
    line: int
    scale: float | None = None
    cosine: float | None = None
    rate: float | None = None
    angle: float = 0.0
    lock: tuple[float, float] | None = None
    names: list[str] = field(default_factory=list)
    settles: bool = False
    #: RA distance in pixels that pulses and dithers have made so far.
    moved: float = 0.0


class _Frame(NamedTuple):
    """A reading of the axis."""

    run: str
    when: str
    time_s: float
    indicated_deg: float
    error_arcsec: float
    declination_arcsec: float
    snr: float
    line: int


def columns(path: Path, topic: str | None = None) -> list[str]:
    """Names of what is made of the frames."""
    return list(_COLUMNS)


def read(path: Path, wanted: Selection) -> Iterator[Batch]:
    """All frames as one batch; see `format.FormatModule`."""
    frames, lost, settling = _frames(path)
    yield {
        name: row_labels([getattr(frame, name) for frame in frames])
        if name in _LABELS
        else np.array([getattr(frame, name) for frame in frames])
        for name in wanted.names
    }
    if lost or settling:
        warnings.warn(
            f"{path}: {lost} frames without a star and {settling} while the guiding settled "
            "are omitted",
            MessageLinesWarning,
            stacklevel=9,
        )


def line_of(path: Path, row: int) -> int:
    """The line of the file that a frame came from."""
    return _frames(path)[0][row].line


def copy(task: CopyTask) -> Contents:
    """Refused: a star's distance is not an angle of the axis."""
    raise FileError(
        task.source,
        "a guide log holds distances of a star, no angles that could be corrected: give the model "
        "to the mount's controller (`ta.export_model(...)`)",
    )


def contents(path: Path, topic: str | None = None) -> Contents:
    """Frames; nothing is ever added to be summed up."""
    return Contents(len(_frames(path)[0]), {})


def _frames(path: Path) -> tuple[list[_Frame], int, int]:
    """All readings, and how many frames had no star or fell into settling."""
    frames: list[_Frame] = []
    lost = settling = sections = 0
    first: datetime | None = None
    section: _Section | None = None
    with io.TextIOWrapper(open_text(path), encoding="utf-8", errors="replace") as file:
        place = 0
        # Longest line that is read.
        while text := file.readline(1 << 14):
            place += 1
            text = text.strip()
            begins = _BEGINS.match(text)
            if begins:
                sections += 1
                try:
                    time = datetime.fromisoformat(begins[1])
                except ValueError:
                    raise FileError(path, f"no date and time: {begins[1]}", line=place) from None
                first = first or time
                section = _Section(str(sections), time, place)
            elif text.startswith(("Guiding Ends", "Calibration Begins")):
                section = None
            elif section is None or not text:
                continue
            elif not section.names:
                _take_header(path, section, text, place)
            elif text.startswith("INFO:"):
                _take_info(section, text)
            else:
                assert first is not None
                frame = _frame(path, section, text.split(","), place, first)
                if frame is None:
                    lost += 1
                elif section.settles:
                    settling += 1
                else:
                    frames.append(frame)
    if not frames:
        raise FileError(path, "has no frame of guiding with a star that had settled", line=1)
    return frames, lost, settling


def _take_header(path: Path, section: _Section, text: str, line: int) -> None:
    """Store what a line before the frames states."""
    scale, declination, rate, lock = (
        pattern.search(text) for pattern in (_SCALE, _DECLINATION, _RATE, _LOCK)
    )
    if scale:
        section.scale = float(scale[1])
    if declination and "Cal Dec" not in text:
        section.cosine = math.cos(math.radians(float(declination[1])))
    if rate and section.rate is None:
        section.angle, section.rate = math.radians(float(rate[1])), float(rate[2])
    if lock:
        section.lock = float(lock[1]), float(lock[2])
    if not text.startswith("Frame,"):
        return
    section.names = text.split(",")
    missing = [name for name in _NEEDED if name not in section.names]
    if missing:
        raise FileError(path, f"frames have no column {missing[0]}", line=line)
    for value, what, example in (
        (section.scale, "pixel scale", "Pixel scale = 1.50 arc-sec/px"),
        (section.cosine, "declination", "Dec = 45.0 deg"),
        (section.rate, "guide rate", "xAngle = 0.0, xRate = 7.500"),
    ):
        if value is None or abs(value) < 1e-3:
            raise FileError(
                path,
                f"the guiding that begins at line {section.line} states no {what} that an angle "
                f"of the axis could be made with; write it above this line, as: {example}",
                line=line,
            )


def _take_info(section: _Section, text: str) -> None:
    """A dither, or the begin or end of settling."""
    if "SETTLING STATE CHANGE" in text:
        section.settles = "started" in text
    lock = _LOCK.search(text)
    if lock:
        new = float(lock[1]), float(lock[2])
        if section.lock is not None:
            dx, dy = new[0] - section.lock[0], new[1] - section.lock[1]
            section.moved += dx * math.cos(section.angle) + dy * math.sin(section.angle)
        section.lock = new


def _frame(
    path: Path, section: _Section, cells: list[str], line: int, first: datetime
) -> _Frame | None:
    """The reading of a frame; None without a star. Its pulse counts from the next one on."""
    given = dict(zip(section.names, cells, strict=False))
    if given.get("mount", "").strip('"') == "DROP":
        return None

    def value(name: str, needed: bool = False) -> float:
        cell = given.get(name, "").strip()
        found = cell_number(cell, ".") if cell else (None if needed else math.nan)
        if found is None:
            raise FileError(path, f"a number is needed, got {cell[:60]!r}", line=line, column=name)
        return found

    if given.get("mount", "").strip('"') != "Mount":
        raise FileError(
            path,
            f"frames of {given.get('mount', '')[:20]} are not read: an adaptive optics unit also "
            "moves the star, by an unknown angle",
            line=line,
            column="mount",
        )
    assert section.scale is not None
    assert section.cosine is not None
    assert section.rate is not None
    time, raw = value("Time", True), value("RARawDistance", True)
    seconds = (section.begins - first).total_seconds() + time
    frame = _Frame(
        section.label,
        section.begins.isoformat(),
        seconds,
        SIDEREAL * seconds,
        (raw + section.moved) * section.scale / section.cosine,
        value("DECRawDistance") * section.scale,
        value("SNR"),
        line,
    )
    pulse = value("RADuration")
    if pulse and pulse == pulse:
        west = given.get("RADirection", "").strip('"') == "W"
        section.moved += (1.0 if west else -1.0) * section.rate * pulse / 1000.0
    return frame
