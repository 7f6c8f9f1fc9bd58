"""Faults of rows and runs: twice the same, stuck, out of order."""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ..quantiles import median, quantile
from .fault import DataFault
from .record import Record

__all__ = ["duplicate_rows", "duplicate_runs", "stuck_readings", "unsorted_time"]

Array = NDArray[np.float64]

#: Equal readings in a row that the other channel must have passed by, in its own noise and
#: in steps of the lattice, to be stale: a chance of 1e-9, and no count that is merely long.
FAR, STEPS = 6.0, 2.5

#: Rows from which on stale readings are a fault of the data and no coincidence.
LEAST_STALE = 3

#: Readings in a row at an end of the range that are a limit.
LEAST_STUCK = 5

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
                f"runs {_listed(labels)} are one run {len(labels)} times, to the last digit: "
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


def stuck_readings(records: list[Record]) -> Iterator[DataFault]:
    """Readings that stand still while the other channel moves: at a limit, or stale."""
    for record in records:
        reference, indicated = record.unwrapped
        for name, own, other in (
            ("indicated", indicated, reference),
            ("reference", reference, indicated),
        ):
            yield from _stuck(record, name, own, other)


def _stuck(record: Record, name: str, own: Array, other: Array) -> Iterator[DataFault]:
    if own.size < 2 * LEAST_STUCK or np.ptp(own) == 0.0:
        return
    steps = np.abs(np.diff(own))
    moved = steps[steps > 0.0]
    count = float(quantile(moved, 0.01))  # the lattice, or less than it
    slip = np.diff(own - other)
    noise = 1.4826 * float(median(np.abs(slip - median(slip))))
    still = np.concatenate([[False], steps == 0.0])
    edges = np.flatnonzero(np.diff(np.concatenate([[0], still.astype(np.int8), [0]])))
    low, high = float(own.min()), float(own.max())
    limit: list[int] = []
    stale: list[int] = []
    for first, stop in _pairs(edges):
        # Of the reading before the stretch to its last.
        passed = abs(float(other[stop - 1] - other[first - 1]))
        if passed < max(FAR * noise, STEPS * count):
            continue
        at_end = own[first] in (low, high)
        if at_end and stop - first >= LEAST_STUCK:
            limit += range(first, stop)
        else:
            stale += range(first, stop)
    if limit:
        rows = record.rows[np.array(limit)]
        value = float(own[limit[0]])
        yield DataFault.of(
            "saturated_travel",
            [record.label],
            rows.tolist(),
            f"the {name} angle of run {record.label} stands at {value:g} deg, the end of its "
            f"range, in {rows.size} rows (first: row {rows[0]}) while the joint moves on",
            "leave these rows out, or measure inside the range",
        )
    if len(stale) >= LEAST_STALE:
        rows = record.rows[np.array(stale)]
        yield DataFault.of(
            "stale_samples",
            [record.label],
            rows.tolist(),
            f"{rows.size} {name} readings of run {record.label} (first: row {rows[0]}) repeat "
            "the one before while the joint moves: old samples were logged again",
            "drop these rows, or log each sample once with its own time stamp",
        )


def _pairs(edges: NDArray[np.int64]) -> Iterator[tuple[int, int]]:
    """First and one-past-last reading of every stretch."""
    yield from zip(edges[::2].tolist(), edges[1::2].tolist(), strict=True)


def _listed(labels: list[str]) -> str:
    return f"{', '.join(labels[:-1])} and {labels[-1]}"
