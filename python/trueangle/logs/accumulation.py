"""One pass over calibration logs: the moments that any fit of their orders needs."""

from __future__ import annotations

import hashlib
import math
from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Iterator, Mapping, Sequence
from copy import copy, deepcopy
from dataclasses import dataclass, field
from functools import reduce
from itertools import groupby
from operator import itemgetter
from pathlib import Path
from typing import Any, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

import trueangle._core as _core

from ..errors import FileError
from ..estimation.moments import Moments
from ..formats.ahead import side_by_side
from ..formats.columns import find_columns, warn_of_unread
from ..formats.format import Format as LogFormat
from ..formats.format import Labels, Selection, row_labels
from ..formats.formats import find_format
from ..model.model import Argument, HarmonicModel
from ..runs.angles import Facets, RunAngles, find_run_angles
from ..runs.follows import check_usable
from ..runs.paths import unit_of_path
from ..runs.run import CalibrationRun
from ..support.angles import common_sign, wrap
from ..support.arrays import Array
from ..support.decoding import local_day
from ..support.files import partition_keys
from .keeping import SAMPLE, KeptReadings

#: Roles whose columns identify runs.
LABELS = ("unit", "run")

#: Readings taken together: what is computed of them stays in the cache.
_BLOCK = 1 << 16

#: Called after every batch with its rows and the bytes that those took.
Advance: TypeAlias = Callable[[int, float], None]


@dataclass(frozen=True)
class LogFitSettings:
    """What to accumulate; sent to the workers of a cluster.

    ``orders`` maps shaft names to all orders that may be requested, ``shafts`` shaft names
    to their turns per output turn. Of every log ``kept`` readings are kept, a ``part`` of the
    blocks at most, and outliers are omitted where their limits are given.
    """

    orders: Mapping[str, tuple[int, ...]]
    shafts: Mapping[str, float]
    argument: Argument = "reference"
    counts_per_turn: float | None = None
    counts_per_turn_reference: float | None = None
    signals: Mapping[str, tuple[str, str | None]] = field(default_factory=dict)
    topic: str | None = None
    threads: int | None = None
    facets: Facets | None = None
    unit_from: str | None = None
    checksums: bool = False
    kept: int = SAMPLE
    part: float = 1.0
    outliers: OutlierLimits | None = None

    @property
    def is_periodic(self) -> bool:
        """Whether the error repeats after one turn of the output."""
        return all(cycles % 1.0 == 0.0 for cycles in self.shafts.values())


@dataclass(frozen=True)
class OutlierLimits:
    """Readings farther than ``limit`` from a model and the zero of their run."""

    model: HarmonicModel
    zeros: Mapping[Hashable, float]
    limit: float

    def find(self, run: Hashable, x: Array, y: Array, argument: Argument) -> NDArray[np.bool_]:
        """Which of the readings of a run are outliers."""
        angle = y if argument == "indicated" else x
        expected = np.asarray(self.model.error(angle)) - self.model.constant + self.zeros[run]
        return np.asarray(np.abs(wrap(y - x - expected, self.model.period)) > self.limit)


@dataclass
class RunTally:
    """What is counted of a run.

    Attributes
    ----------
    rows : int
        Known readings.
    low, high : float
        Ends of its angles over the turns, where the error does not repeat after one.
    outliers : list of int
        Rows among the known readings of those that were omitted.
    """

    rows: int = 0
    low: float = math.inf
    high: float = -math.inf
    outliers: list[int] = field(default_factory=list)

    def add(self, other: RunTally) -> None:
        """The next readings of the run."""
        self.outliers += [self.rows + row for row in other.outliers]
        self.rows += other.rows
        self.low, self.high = min(self.low, other.low), max(self.high, other.high)


@dataclass
class Accumulated:
    """Moments of some logs, one run per log and label of its columns ``unit`` and ``run``.

    Attributes
    ----------
    moments : Moments
        Runs are labelled ``(file, unit, run)``, and with the day where there is a ``when``.
    files, sha256 : tuple of str
        Checksums are empty where they were not requested, and of folders.
    rows, missing : int
        Readings, and those without a reference or indicated angle.
    tallies : dict
        What is counted of every run.
    kept : Kept
        Some readings of every run.
    indicated_sign : int
        As of `CalibrationRun`.
    """

    moments: Moments
    kept: KeptReadings
    files: tuple[str, ...] = ()
    sha256: tuple[str, ...] = ()
    rows: int = 0
    missing: int = 0
    tallies: dict[Hashable, RunTally] = field(default_factory=dict)
    indicated_sign: int = 1

    def add(self, other: Accumulated) -> Accumulated:
        """Itself with the next segment of the same log, or the next log, added."""
        self.moments.merge(other.moments)
        self.kept.add(other.kept)
        self.rows += other.rows
        self.missing += other.missing
        for run, tally in other.tallies.items():
            self.tallies.setdefault(run, RunTally()).add(tally)
        return self


class _LogPart(NamedTuple):
    """A part of a log and how to read it."""

    path: Path
    kind: LogFormat
    part: Any
    number: int
    size: float
    angles: RunAngles
    labels: Mapping[str, str]
    unit: str | None


def log_moments(path: Path, settings: LogFitSettings) -> Accumulated:
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
    """Moments of every log in turn, segments of logs read side by side.

    A log is always cut in the same segments, merged in their order: the sums are the same,
    bit for bit, with any number of threads.
    """
    workers = _core.thread_count(settings.threads)
    stretches = (stretch for path in paths for stretch in _found(path, settings))

    def work(stretch: _LogPart) -> tuple[Path, Accumulated]:
        return stretch.path, _accumulate(stretch, settings, advance)

    done = side_by_side(work, stretches, workers)
    for path, parts in groupby(done, key=itemgetter(0)):
        found = reduce(Accumulated.add, (part for _, part in parts))
        found.kept.thinned(settings.kept)
        if not found.moments.count:
            raise FileError(path, "has no readings")
        yield found


def _found(path: Path, settings: LogFitSettings) -> list[_LogPart]:
    with find_format(path).at_header(path):
        return list(_stretches(path, settings))


def _stretches(path: Path, settings: LogFitSettings) -> Iterator[_LogPart]:
    kind = find_format(path)
    header = kind.module.columns(path, settings.topic)
    roles = find_columns(path, header, settings.signals)
    warn_of_unread(path, kind.unread(path), roles)
    angles = find_run_angles(
        path,
        header,
        roles,
        unit=kind.unit,
        counts_per_turn=settings.counts_per_turn,
        counts_per_turn_reference=settings.counts_per_turn_reference,
        facets=settings.facets,
    )
    labels = {role: roles[role].name for role in (*LABELS, "when") if role in roles}
    parts = kind.stretches(path)
    size = path.stat().st_size / len(parts)
    unit = unit_of_path(path, settings.unit_from)
    for i, part in enumerate(parts):
        yield _LogPart(path, kind, part, i, size, angles, labels, unit)


def _accumulate(stretch: _LogPart, settings: LogFitSettings, advance: Advance) -> Accumulated:
    """Moments of one segment of a log."""
    path, period, argument = stretch.path, stretch.angles.period, settings.argument
    is_first = stretch.number == 0
    found = Accumulated(
        Moments(settings.orders, period=period, shafts=settings.shafts),
        KeptReadings(settings.kept, settings.part),
        (str(path),),
        (_sha256(path) if settings.checksums and is_first else "",),
        indicated_sign=stretch.angles.indicated_sign,
    )
    labels = [*stretch.labels.values()]
    names = [*dict.fromkeys([*stretch.angles.names, *labels])]
    wanted = Selection(names, settings.topic, stretch.part, texts=labels)
    left = stretch.size
    folders = partition_keys(path) | ({} if stretch.unit is None else {"unit": stretch.unit})
    taken_of: Counter[Hashable] = Counter()
    for batch in stretch.kind.module.read(path, wanted):
        true, said = stretch.angles.values(batch.__getitem__)
        if is_first and found.rows == 0:
            _check_usable(path, true, said, period)
        columns = [
            _days(batch[name]) if role == "when" else batch[name]
            for role, name in stretch.labels.items()
        ]
        for start in range(0, true.size, _BLOCK):
            block = slice(start, start + _BLOCK)
            for label, rows in _runs(columns, block):
                own = folders | dict(zip(stretch.labels, label, strict=True))
                day = [own.pop("when")] if own.get("when") else []
                run = (found.files[0], *map(own.get, LABELS), *day)
                x = np.ascontiguousarray(true[block][rows], dtype=np.float64)
                y = np.ascontiguousarray(said[block][rows], dtype=np.float64)
                found.rows += x.size
                tally = found.tallies.setdefault(run, RunTally())
                if settings.outliers is not None and run in settings.outliers.zeros:
                    y = _without(settings.outliers, run, x, y, argument, tally)
                known = found.moments.update_known(x, y, argument=argument, run=run)
                if settings.outliers is None:
                    tally.rows += known
                if known and not settings.is_periodic:
                    angle = y if argument == "indicated" else x
                    tally.low = min(tally.low, float(np.nanmin(angle)))
                    tally.high = max(tally.high, float(np.nanmax(angle)))
                found.kept.take(run, stretch.number, taken_of[run], x, y)
                taken_of[run] += x.size
        # Bytes of a reading, to estimate how much of a log is done.
        taken = min(float(true.size * 16), left)
        left -= taken
        advance(true.size, taken)
    advance(0, left)
    found.missing = found.rows - sum(tally.rows for tally in found.tallies.values())
    found.tallies = {run: tally for run, tally in found.tallies.items() if tally.rows}
    return found


def _days(column: Any) -> Any:
    """The days of dates and times; nothing of what is none."""
    if not isinstance(column, Labels):
        return Labels(np.zeros(len(column), dtype=np.intp), [""])
    days = row_labels([local_day(text) for text in column.names])
    return Labels(days.codes[column.codes], days.names)


def _without(
    outliers: OutlierLimits, run: Hashable, x: Array, y: Array, argument: Argument, tally: RunTally
) -> Array:
    """The readings with NaN for the outliers, which are noted."""
    known = np.flatnonzero(np.isfinite(x) & np.isfinite(y))
    far = np.flatnonzero(outliers.find(run, x[known], y[known], argument))
    tally.outliers += (tally.rows + far).tolist()
    tally.rows += known.size
    if far.size:
        y = y.copy()
        y[known[far]] = np.nan
    return y


def _runs(
    columns: Sequence[NDArray[Any] | Labels], block: slice
) -> Iterator[tuple[tuple[str | float | None, ...], Any]]:
    """Every label in a block of readings, in the order of their first, and its readings."""
    codes = [(c.codes if isinstance(c, Labels) else c)[block] for c in columns]
    if all(code.size == 0 or (code == code[0]).all() for code in codes):
        if not codes or codes[0].size:
            yield (
                tuple(_name(c, code[0]) for c, code in zip(columns, codes, strict=True)),
                slice(None),
            )
        return
    place = np.zeros(codes[0].size, dtype=np.int64)
    for code in codes:
        values, own = np.unique(code, return_inverse=True)
        place = place * values.size + own
    _, first, place = np.unique(place, return_index=True, return_inverse=True)
    for i in np.argsort(first).tolist():
        at = first[i]
        label = tuple(_name(c, code[at]) for c, code in zip(columns, codes, strict=True))
        yield label, place == i


def _name(column: NDArray[Any] | Labels, code: Any) -> str | float | None:
    if isinstance(column, Labels):
        return column.names[int(code)]
    value: float = code.item()
    return value if value == value else None  # NaN


def merged_moments(parts: Sequence[Accumulated]) -> Accumulated:
    """All parts as one, in their order."""
    for part in parts[1:]:
        if part.moments.period != parts[0].moments.period:
            raise FileError(
                part.files[0],
                f"its reference is in another unit than that of {parts[0].files[0]}; convert one",
            )
    # On a cluster a part may be merged again, after its worker was lost: none is changed.
    common_sign(part.indicated_sign for part in parts)
    found = copy(parts[0])
    found.moments, found.kept = found.moments.copy(), deepcopy(found.kept)
    found.tallies = deepcopy(found.tallies)
    for part in parts[1:]:
        found.add(part)
        found.files, found.sha256 = found.files + part.files, found.sha256 + part.sha256
    return found


def _sha256(path: Path) -> str:
    if not path.is_file():
        return ""
    with path.open("rb") as file:
        return hashlib.file_digest(file, "sha256").hexdigest()


def _check_usable(path: Path, true: NDArray[Any], said: NDArray[Any], period: float) -> None:
    # The first readings are checked for wrong units and signs.
    known = np.flatnonzero(np.isfinite(true) & np.isfinite(said))[:4096]
    if known.size:
        try:
            check_usable([CalibrationRun(true[known], said[known], period)])
        except ValueError as cause:
            raise FileError(path, str(cause)) from None
