"""Faults of rows and runs: twice the same, out of order."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np

from .fault import DataFault
from .record import Record

#: Readings that a run must have to be compared as a whole.
LEAST_READINGS = 3


def duplicate_runs(records: list[Record]) -> Iterator[DataFault]:
    """Runs whose readings are equal to the last digit."""
    if len(records) < 2:
        return
    import hashlib

    same: dict[bytes, list[str]] = {}
    for record in records:
        if len(record) >= LEAST_READINGS and np.ptp(record.indicated) > 0.0:
            data = np.concatenate([record.reference, record.indicated]).tobytes()
            same.setdefault(hashlib.sha256(data).digest(), []).append(record.label)
    for labels in same.values():
        if len(labels) > 1:
            yield DataFault.of(
                "duplicate_runs",
                labels,
                (),
                f"runs {_listed(labels)} hold the same readings, to the last digit: "
                "noise and repeatability would come out too good",
                "keep one of them",
            )


def duplicate_rows(records: list[Record]) -> Iterator[DataFault]:
    """Rows with one time stamp and the same readings."""
    for record in records:
        if record.time is None:
            continue
        table = np.column_stack([record.time, record.reference, record.indicated])
        order = np.lexsort(table.T)
        again = np.flatnonzero((np.diff(table[order], axis=0) == 0.0).all(axis=1)) + 1
        if again.size:
            rows = np.sort(record.rows[order[again]])
            yield DataFault.of(
                "duplicate_rows",
                [record.label],
                rows.tolist(),
                f"{rows.size} row{'s' * (rows.size > 1)} of run {record.label} (first: row "
                f"{rows[0]}) are there twice, time stamp and readings",
                "drop the second of each",
            )


def unsorted_time(records: list[Record]) -> Iterator[DataFault]:
    """Time that runs backwards within a run."""
    for record in records:
        if record.time is None:
            continue
        back = np.flatnonzero(np.diff(record.time) < 0.0) + 1
        if back.size:
            k = int(back[0])
            yield DataFault.of(
                "unsorted_time",
                [record.label],
                record.rows[back].tolist(),
                f"time runs backwards in run {record.label}, {back.size} time"
                f"{'s' * (back.size > 1)} (first in row {record.rows[k]}: "
                f"{record.time[k]:g} s after {record.time[k - 1]:g} s)",
                "sort the rows by time, or give what follows another run label",
            )


def _listed(labels: list[str]) -> str:
    return f"{', '.join(labels[:-1])} and {labels[-1]}"
