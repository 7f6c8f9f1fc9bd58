"""Readings of one run as they are in a file, before the checks that a run has passed."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field
from functools import cached_property
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...support.angles import unwrapped, wrap
from ...support.arrays import Array
from ...support.layout import run_name
from ...support.roles import offsets_of, unit_in_name
from ...support.signals import FIELDS
from ..files import read_columns
from ..readings import FileReadings
from ..run import CalibrationRun
from ..source import checked_reading_options
from .fault import DataFault

#: Readings from which a search for orders is sound: of fewer more are asked for.
FEW: Final = 20

#: Readings that a run must have to be compared as a whole, and a level to be more than noise.
LEAST_READINGS = 3


class RecordedChannels(NamedTuple):
    """Sine and cosine of the rows in which both are numbers, and whether their phase falls."""

    sine: Array
    cosine: Array
    rows: NDArray[np.int64]
    falls: bool


@dataclass(frozen=True, eq=False)
class Record:
    """One run before it is trusted.

    Attributes
    ----------
    label : str
    reference, indicated : ndarray, shape (n,)
        Degrees, as they were read.
    time, velocity, temperature, torque, mount : ndarray or None
        s, deg/s, Celsius, Nm, degrees.
    columns : mapping of role to (name, unit)
        The columns of the file that were understood, with a minus those of a reversed sensor.
    deviations : tuple of str
        Columns of no role that look like deviations from a nominal angle.
    clocks : tuple of str
        Columns of no role that are called like a time, where none was understood.
    channels : RecordedChannels or None
        Of the first run of a file: the channels of all its runs.
    stride : int
        Every so many readings of the run are in it.
    rows : ndarray of int or None
        Row of each reading in its file, from 1, where there is one.
    """

    label: str
    reference: Array
    indicated: Array
    time: Array | None = None
    velocity: Array | None = None
    temperature: Array | None = None
    torque: Array | None = None
    mount: Array | None = None
    columns: Mapping[str, tuple[str, str | None]] = field(default_factory=dict)
    deviations: tuple[str, ...] = ()
    clocks: tuple[str, ...] = ()
    channels: RecordedChannels | None = None
    stride: int = 1
    rows: NDArray[np.int64] | None = None

    def __len__(self) -> int:
        return int(self.reference.size)

    @property
    def name(self) -> str:
        """What texts call it."""
        return run_name(self.label)

    @cached_property
    def unwrapped(self) -> tuple[Array, Array]:
        """Reference and indicated without jumps of a turn, those of single outliers included."""
        indicated, error = self.run.indicated.copy(), self.run.error
        if len(self) > 2:
            # One reading off by more than a quarter of a turn, there and back, is no motion.
            step = np.abs(wrap(np.diff(error), 360.0)) > 90.0
            across = np.abs(wrap(error[2:] - error[:-2], 360.0)) < 90.0
            alone = np.flatnonzero(step[:-1] & step[1:] & across) + 1
            indicated[alone] = self.reference[alone] + error[alone - 1]
        return unwrapped(self.reference, 360.0), unwrapped(indicated, 360.0)

    def fault(self, fault: str, at: Iterable[int], says: str, mend: str) -> DataFault:
        """A fault of it, in its readings ``at``, from 0."""
        rows = [self.number(k) if self.rows is None else int(self.rows[k]) for k in at]
        return DataFault.of(fault, [self.label], rows, says, mend)

    def number(self, at: int) -> int:
        """Of a reading in its run, from 1."""
        return self.stride * at + 1

    @cached_property
    def run(self) -> CalibrationRun:
        """Its angles as a run."""
        return CalibrationRun(self.reference, self.indicated, 360.0, roles=self.columns)


def records_of(runs: Iterable[CalibrationRun]) -> list[Record]:
    """Records of runs that were read already, angles in degrees."""
    found = []
    for k, run in enumerate(runs):
        channels = None
        if run.channels is not None:
            sine, cosine = run.signals["sine"], run.signals["cosine"]
            rows = np.arange(1, len(run) + 1)
            channels = RecordedChannels(sine, cosine, rows, run.channels.direction < 0)
        label, signals = run.label or str(k + 1), {name: getattr(run, name) for name in FIELDS}
        found.append(
            _record(label, run, slice(None), signals, columns=run.roles, channels=channels)
        )
    return found


def _record(
    label: str, of: Any, at: Any, signals: Mapping[str, Array | None], **known: Any
) -> Record:
    """Some rows of a run or a table, its angles and signals in degrees."""
    scale = 360.0 / of.period
    return Record(
        label,
        of.reference[at] * scale,
        of.indicated[at] * scale,
        **{
            name: values[at] * (scale if name in ("velocity", "mount") else 1.0)
            for name, values in signals.items()
            if name in FIELDS and values is not None
        },
        **known,
    )


def read_records(data: Any, reading: Mapping[str, Any]) -> list[Record]:
    """One record per run of every file or table; time may run backwards.

    Raises
    ------
    FileError
        No table of runs: a missing column, text where a number belongs.
    """
    found: list[Record] = []
    for table in read_columns(data, checked_reading_options(reading)):
        channels = None
        if table.channels is not None:
            sine, cosine = table.signals["sine"], table.signals["cosine"]
            known = np.flatnonzero(np.isfinite(sine) & np.isfinite(cosine))
            falls = table.channels.direction < 0
            channels = RecordedChannels(sine[known], cosine[known], known + 1, falls)
        for i, (labels, rows) in enumerate(table.groups):
            found.append(
                _record(
                    labels.run or str(len(found) + 1),
                    table,
                    rows,
                    table.signals,
                    columns=table.table.named,
                    deviations=_deviations(table.table),
                    clocks=_clocks(table.table),
                    channels=channels if i == 0 else None,
                    rows=np.arange(1, table.reference.size + 1)[rows],
                )
            )
    return found


def _deviations(table: FileReadings) -> tuple[str, ...]:
    """Unused columns of numbers whose names suggest small angular deviations."""
    if offsets_of(table.roles):
        return ()
    used = {column.name for column in table.roles.values()}
    return tuple(
        name
        for name, values in table.columns.items()
        if name not in used and values.dtype != object and _is_deviation(name)
    )


def _clocks(table: FileReadings) -> tuple[str, ...]:
    """Columns that are called like a time, where none is known to be one."""
    used = {column.name for column in table.roles.values()}
    unused = () if "time" in table.roles else tuple(n for n in table.columns if n not in used)
    return tuple(name for name in unused if _CLOCK.match(name.strip()))


_CLOCK = re.compile(r"(time|timestamp|stamp|t|date)(_?(s|ms|us|ns|iso|utc))?$", re.IGNORECASE)


def _is_deviation(name: str) -> bool:
    small = unit_in_name(name, "reference_offset") in ("arcsec", "arcmin")
    return small or re.search("deviation|autocoll", name, re.IGNORECASE) is not None
