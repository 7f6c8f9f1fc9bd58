"""One pass over calibration logs: the moments that any fit of their orders needs."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..angles import UNIT_PERIODS
from ..errors import FileError
from ..moments import Moments
from ..runs import CalibrationRun
from ..units import check_follows
from .columns import find_angle_column, find_reference_column
from .formats import Watch, find_format

__all__ = ["Accumulated", "LogFitSettings", "accumulate", "merged"]

#: Every so many readings one is looked at for the travel covered, in bins of a degree.
_STRIDE = 16
_BINS = 360
#: Readings taken together: what is computed of them stays in the cache.
_BLOCK = 1 << 16
#: Readings, at most, of the first batch that are checked for wrong units and signs.
_LOOKED_AT = 4096


@dataclass(frozen=True)
class LogFitSettings:
    """What to accumulate; sent to the workers of a cluster.

    ``orders`` maps shaft names to all orders that may be asked for, ``shafts`` shaft names
    to their turns per output turn.
    """

    orders: Mapping[str, tuple[int, ...]]
    shafts: Mapping[str, float]
    argument: str = "reference"
    counts_per_turn: float | None = None
    topic: str | None = None
    threads: int | None = None


@dataclass
class Accumulated:
    """Moments of some logs, one run per log and label of its ``run`` column.

    Attributes
    ----------
    moments : Moments
        Runs are labelled ``(file, run)``.
    files : tuple of str
    rows, missing : int
        Readings, and those without a reference or indicated angle.
    travel : ndarray
        Readings seen in each degree of the turn, one of 16 counted.
    """

    moments: Moments
    files: tuple[str, ...] = ()
    rows: int = 0
    missing: int = 0
    travel: NDArray[np.int64] = field(default_factory=lambda: np.zeros(_BINS, dtype=np.int64))


def accumulate(
    path: Path, settings: LogFitSettings, watch: Watch = lambda rows, part: None
) -> Accumulated:
    """Moments of one log with the columns ``reference_*``, ``indicated_*`` and maybe ``run``.

    Raises
    ------
    FileError
        A column is missing or holds no numbers, the indicated angle does not follow the
        reference, the file is damaged.
    """
    kind = find_format(path)
    header = kind.module.columns(path, settings.topic)
    reference = find_reference_column(path, header)
    period = UNIT_PERIODS[reference.rpartition("_")[2]]
    indicated = find_angle_column(
        path, period, header, counts_per_turn=settings.counts_per_turn, fresh=False
    )
    names = [reference, indicated.name, *(["run"] if "run" in header else [])]
    scale = period / indicated.period
    found = Accumulated(
        Moments(settings.orders, period=period, shafts=settings.shafts), (str(path),)
    )
    size = max(path.stat().st_size, 1)
    for batch in kind.module.read(path, names, settings.topic):
        true, said = batch[reference], batch[indicated.name]
        if scale != 1.0:
            said = said * scale
        if found.rows == 0:
            _check_follows(path, true, said, period)
        runs = batch.get("run")
        for start in range(0, true.size, _BLOCK):
            part = slice(start, start + _BLOCK)
            labels = None if runs is None else runs[part]
            _take(found, true[part], said[part], labels, period, settings)
        watch(true.size, min(1.0, found.rows * 16 / size))
    if not found.moments.count:
        raise FileError(path, "has no readings")
    return found


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
        first.rows + second.rows,
        first.missing + second.missing,
        first.travel + second.travel,
    )


def _take(
    found: Accumulated,
    true: NDArray[Any],
    said: NDArray[Any],
    runs: NDArray[Any] | None,
    period: float,
    settings: LogFitSettings,
) -> None:
    """Add one batch."""
    found.rows += true.size
    error = np.subtract(said, true, dtype=np.float64)
    if not np.isfinite(error.sum()):  # some are missing: look closer
        known = np.isfinite(error)
        found.missing += known.size - int(np.count_nonzero(known))
        true, said, error = true[known], said[known], error[known]
        runs = None if runs is None else runs[known]
    theta = true if settings.argument == "reference" else said
    file = found.files[0]
    labels = [None] if runs is None else np.unique(runs)
    for label in labels:
        if runs is None or len(labels) == 1:
            x, y = theta, error
        else:
            rows = runs == label
            x, y = theta[rows], error[rows]
        if x.size:
            found.moments.update(
                x, y, run=(file, None if label is None else float(label)), threads=settings.threads
            )
    places = np.floor(np.mod(theta[::_STRIDE], period) * (_BINS / period)).astype(np.intp)
    found.travel += np.bincount(np.minimum(places, _BINS - 1), minlength=_BINS)


def _check_follows(path: Path, true: NDArray[Any], said: NDArray[Any], period: float) -> None:
    known = np.flatnonzero(np.isfinite(true) & np.isfinite(said))[:_LOOKED_AT]
    if known.size:
        try:
            check_follows(CalibrationRun(true[known], said[known], period))
        except ValueError as cause:
            raise FileError(path, str(cause)) from None
