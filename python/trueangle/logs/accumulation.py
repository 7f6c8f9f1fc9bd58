"""One pass over calibration logs: the moments that any fit of their orders needs."""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from functools import reduce
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..angles import UNIT_PERIODS
from ..columns import matching
from ..errors import FileError
from ..model import Argument
from ..moments import Moments
from ..runs import CalibrationRun
from ..units import check_follows
from .ahead import side_by_side
from .columns import RUN_COLUMN, find_angle_column, find_reference
from .formats import Labels, LogFormat, find_format

__all__ = ["Accumulated", "LogFitSettings", "accumulate", "accumulate_each", "merged"]

#: Places in the turn, a degree each, where readings are looked for.
_BINS = 360
#: Readings taken together: what is computed of them stays in the cache.
_BLOCK = 1 << 16
#: Readings, at most, of the first batch that are checked for wrong units and signs.
_LOOKED_AT = 4096
#: Bytes that a reading takes, to tell how much of a log is done.
_BYTES = 16

#: Called after every batch with its rows and the bytes that those took.
Advance: TypeAlias = Callable[[int, float], None]


@dataclass(frozen=True)
class LogFitSettings:
    """What to accumulate; sent to the workers of a cluster.

    ``orders`` maps shaft names to all orders that may be asked for, ``shafts`` shaft names
    to their turns per output turn.
    """

    orders: Mapping[str, tuple[int, ...]]
    shafts: Mapping[str, float]
    argument: Argument = "reference"
    counts_per_turn: float | None = None
    counts_per_turn_reference: float | None = None
    signals: Mapping[str, tuple[str, str | None]] = field(default_factory=dict)
    topic: str | None = None
    threads: int | None = None
    checksums: bool = False


@dataclass
class Accumulated:
    """Moments of some logs, one run per log and label of its ``run`` column.

    Attributes
    ----------
    moments : Moments
        Runs are labelled ``(file, run)``.
    files, sha256 : tuple of str
        Checksums are empty where they were not asked for, and of folders.
    rows, missing : int
        Readings, and those without a reference or indicated angle.
    travel : ndarray
        Readings seen in each degree of the turn, one of 16 looked at.
    """

    moments: Moments
    files: tuple[str, ...] = ()
    sha256: tuple[str, ...] = ()
    rows: int = 0
    missing: int = 0
    travel: NDArray[np.int64] = field(default_factory=lambda: np.zeros(_BINS, dtype=np.int64))

    def add(self, other: Accumulated) -> Accumulated:
        """Itself with the next stretch of the same log taken in."""
        self.moments.merge(other.moments)
        self.rows += other.rows
        self.missing += other.missing
        self.travel += other.travel
        return self


class _Stretch(NamedTuple):
    """A part of a log and how to read it."""

    path: Path
    kind: LogFormat
    part: Any
    is_first: bool
    size: float
    names: Sequence[str]
    period: float
    reference_scale: float
    scale: float


def accumulate(path: Path, settings: LogFitSettings) -> Accumulated:
    """Moments of one log with the columns ``reference_*``, ``indicated_*`` and maybe ``run``.

    Raises
    ------
    FileError
        A column is missing or holds no numbers, the indicated angle does not follow the
        reference, the file is damaged.
    """
    (found,) = accumulate_each([path], settings)
    return found


def accumulate_each(
    paths: Iterable[Path], settings: LogFitSettings, advance: Advance = lambda rows, size: None
) -> Iterator[Accumulated]:
    """Moments of every log in turn, stretches of logs read side by side.

    A log is always cut in the same stretches, merged in their order: the sums are the same,
    bit for bit, whatever the number of threads.
    """
    workers = _core.thread_count(settings.threads)
    stretches = (stretch for path in paths for stretch in _stretches(path, settings))

    def work(stretch: _Stretch) -> tuple[Path, Accumulated]:
        return stretch.path, _accumulate(stretch, settings, advance)

    done = side_by_side(work, stretches, workers)
    for path, parts in groupby(done, key=itemgetter(0)):
        found = reduce(Accumulated.add, (part for _, part in parts))
        if not found.moments.count:
            raise FileError(path, "has no readings")
        yield found


def _stretches(path: Path, settings: LogFitSettings) -> Iterator[_Stretch]:
    kind = find_format(path)
    header = kind.module.columns(path, settings.topic)
    wanted = dict(settings.signals)
    reference = find_reference(path, header, wanted)
    reference = reference._replace(unit=reference.unit or kind.unit)
    period = UNIT_PERIODS.get(reference.unit or "", 360.0)
    if reference.unit is None or (
        reference.unit == "count" and settings.counts_per_turn_reference is None
    ):
        raise FileError(
            path,
            "its unit is not known: give it as --signal reference=NAME:UNIT, counts with "
            "--counts-per-turn-reference",
            line=1,
            column=reference.name,
        )
    asked, unit = wanted.get("indicated", (None, None))
    indicated = find_angle_column(
        path,
        period,
        header,
        column=asked,
        unit=unit or kind.unit,
        counts_per_turn=settings.counts_per_turn,
        fresh=False,
    )
    run = wanted["run"][0] if "run" in wanted else RUN_COLUMN
    run = matching(path, header, run) if "run" in wanted else run
    names = [reference.name, indicated.name, *([run] if run in header else [])]
    parts = kind.stretches(path)
    size = path.stat().st_size / len(parts)
    scales = (
        reference.scale(period, settings.counts_per_turn_reference)[0],
        period / indicated.period,
    )
    for i, part in enumerate(parts):
        yield _Stretch(path, kind, part, i == 0, size, names, period, *scales)


def _accumulate(stretch: _Stretch, settings: LogFitSettings, advance: Advance) -> Accumulated:
    """Moments of one stretch of a log."""
    path, period = stretch.path, stretch.period
    found = Accumulated(
        Moments(settings.orders, period=period, shafts=settings.shafts),
        (str(path),),
        (_sha256(path) if settings.checksums and stretch.is_first else "",),
    )
    reference, indicated, *run = stretch.names
    left = stretch.size
    for batch in stretch.kind.read(
        path, stretch.names, settings.topic, stretch.part, texts=stretch.names[2:]
    ):
        true, said = batch[reference], batch[indicated]
        if stretch.reference_scale != 1.0:
            true = true * stretch.reference_scale
        if stretch.is_first and found.rows == 0:
            _check_follows(path, true, said * stretch.scale, period)
        runs = batch[run[0]] if run else None
        for start in range(0, true.size, _BLOCK):
            block = slice(start, start + _BLOCK)
            for label, rows in _runs(runs, block):
                x = np.ascontiguousarray(true[block][rows], dtype=np.float64)
                y = np.ascontiguousarray(said[block][rows], dtype=np.float64)
                known = found.moments.update_known(
                    x,
                    y if stretch.scale == 1.0 else y * stretch.scale,
                    travel=found.travel,
                    argument=settings.argument,
                    run=(found.files[0], label),
                )
                found.rows += x.size
                found.missing += x.size - known
        taken = min(float(true.size * _BYTES), left)
        left -= taken
        advance(true.size, taken)
    advance(0, left)
    return found


def _runs(
    runs: NDArray[Any] | Labels | None, block: slice
) -> Iterator[tuple[str | float | None, Any]]:
    """Every label in a block of readings, None where there is none, and its readings."""
    if runs is None:
        yield None, slice(None)
        return
    codes = (runs.codes if isinstance(runs, Labels) else runs)[block]
    if codes.size and (codes == codes[0]).all():
        found, each = codes[:1], [slice(None)]
    else:
        found, place = np.unique(codes, return_inverse=True)
        each = [place == i for i in range(found.size)]
    for code, rows in zip(found.tolist(), each, strict=True):
        if isinstance(runs, Labels):
            yield runs.names[code], rows
        else:
            yield (code if code == code else None), rows  # NaN


def merged(parts: Sequence[Accumulated]) -> Accumulated:
    """All parts as one; neighbours are merged first, in a tree."""
    while len(parts) > 1:
        parts = [_merged_pair(*parts[i : i + 2]) for i in range(0, len(parts), 2)]
    return parts[0]


def _merged_pair(first: Accumulated, second: Accumulated | None = None) -> Accumulated:
    if second is None:
        return first
    if first.moments.period != second.moments.period:
        raise FileError(
            second.files[0],
            f"its reference is in another unit than that of {first.files[0]}; convert one",
        )
    return Accumulated(
        first.moments + second.moments,
        first.files + second.files,
        first.sha256 + second.sha256,
        first.rows + second.rows,
        first.missing + second.missing,
        first.travel + second.travel,
    )


def _sha256(path: Path) -> str:
    if not path.is_file():
        return ""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _check_follows(path: Path, true: NDArray[Any], said: NDArray[Any], period: float) -> None:
    known = np.flatnonzero(np.isfinite(true) & np.isfinite(said))[:_LOOKED_AT]
    if known.size:
        try:
            check_follows(CalibrationRun(true[known], said[known], period))
        except ValueError as cause:
            raise FileError(path, str(cause)) from None
