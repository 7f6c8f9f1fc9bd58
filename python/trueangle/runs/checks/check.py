"""Check data before anything is fitted."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import TYPE_CHECKING, Any, Unpack

import numpy as np

from ...errors import ArgumentError
from ...support.argumentkinds import told_kinds
from ..follows import unrelated_angles
from ..run import runs_or_data
from ..source import ReadingOptions
from .angles import UNUSABLE_ANGLES, mixed_units, swapped_channels, told_ratio
from .fault import UNUSABLE, DataFault
from .record import Record, read_records, records_of
from .rows import duplicate_rows, duplicate_runs, missed_counts, outliers
from .still import stuck_readings

if TYPE_CHECKING:
    from .result import Check

#: Faults after which the angles of a run mean nothing to further tests.
UNSURE = ("mixed_units", "wrapped_reference", "unsorted_time")


@told_kinds
def check(data: Any, **reading: Unpack[ReadingOptions]) -> Check:
    """Check data for faults before a fit.

    Parameters
    ----------
    data : path, table, CalibrationRun, or iterable of them
        Files and tables as `trueangle.read_runs` takes them, which may be faulty, or runs.
    **reading
        As in `trueangle.read_runs`.

    Returns
    -------
    Check
        Faults of the data, the ratio of the two angles, what was moved, and what can and
        cannot be known. About 0.1 s for 100 000 readings; no model is fitted.

    Raises
    ------
    FileError
        A file that holds no table of runs at all.
    ArgumentError
        No data.

    Examples
    --------
    >>> import numpy as np
    >>> theta = np.linspace(0.0, 350.0, 60)
    >>> run = ta.CalibrationRun(theta, 3.0 - theta, period=360.0, label="a")
    >>> [fault.fault for fault in check(run).data_faults]
    ['wrong_sign']
    """
    from .result import Check, extent_of, extent_verdicts

    records = _records(data, reading)
    if not records:
        raise ArgumentError("no data: give at least one file or run")
    extent = extent_of(records)
    can, cannot = extent_verdicts(extent)
    unused = sorted({name for record in records for name in record.deviations})
    if unused:
        what = "the true angle where the reference is nominal (a polygon)"
        because = f"column '{unused[0]}' is not used"
        measure = "nothing new: give it the role reference_offset"
        cannot.append({"what": what, "because": because, "measure": measure})
    clocks = sorted({name for record in records for name in record.clocks})
    for entry in cannot if clocks else ():
        if entry["because"] == "no time stamps":
            entry["because"] = f"column '{clocks[0]}' is not used"
            entry["measure"] = "nothing new: give it the role time, with its unit"
    faults = data_faults(records)
    ratio, suggestion = told_ratio(records)
    if any(fault.fault == "unrelated_angles" for fault in faults):
        suggestion = "they do not follow each other"
    return Check(
        (*faults, *outliers(records, faults)),
        ratio,
        suggestion,
        extent,
        tuple(can),
        tuple(cannot),
        {role: found for record in records for role, found in record.columns.items()},
    )


def _records(data: Any, reading: Mapping[str, Any]) -> list[Record]:
    runs, data = runs_or_data(data)
    if runs is not None:
        return records_of(runs)
    return read_records(data, reading)


def unsorted_time(records: list[Record]) -> Iterator[DataFault]:
    """Time that runs backwards within a run."""
    for record in records:
        if record.time is None:
            continue
        back = np.flatnonzero(np.diff(record.time) < 0.0) + 1
        if back.size:
            k = int(back[0])
            yield record.fault(
                "unsorted_time",
                back,
                f"time runs backwards in {record.name}, {back.size} time"
                f"{'s' * (back.size > 1)} (first at reading {k + 1}: "
                f"{record.time[k]:g} s after {record.time[k - 1]:g} s)",
                "sort the readings by time, or give those after it another run label",
            )


def channel_faults(records: list[Record]) -> Iterator[DataFault]:
    """Faults of the readings of a sine and a cosine channel."""
    given = [(record.label, record.channels) for record in records if record.channels is not None]
    if not given:
        return
    from .channelreadings import ChannelReadings  # most records have no channels

    parts = [channels for _, channels in given]
    sine, cosine, rows = (np.concatenate([part[i] for part in parts]) for i in range(3))
    labels = [record.label for record in records]
    falls = any(part.falls for part in parts)
    yield from ChannelReadings.of(sine, cosine).faults(labels, rows, falls=falls)


#: Every test of the data, in the order in which they are reported.
TESTS = (
    unsorted_time,
    channel_faults,
    *UNUSABLE_ANGLES,
    unrelated_angles,
    swapped_channels,
    duplicate_runs,
    duplicate_rows,
    stuck_readings,
    missed_counts,
)


def data_faults(records: list[Record]) -> list[DataFault]:
    """Faults of the data; where units are mixed, consequences of that are not reported."""
    found: list[DataFault] = []
    for test in TESTS:
        # Of angles that are known to be wrong it is said once.
        unsure = UNUSABLE if test is unrelated_angles else UNSURE
        mixed = {label for fault in found if fault.fault in unsure for label in fault.runs}
        angles = test not in (
            duplicate_runs,
            duplicate_rows,
            unsorted_time,
            mixed_units,
            channel_faults,
        )
        found += test([r for r in records if not (angles and r.label in mixed)])
    return found
