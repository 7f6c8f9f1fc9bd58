"""Readings that are there again: of copies, noise and repeatability come out too good."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Final

import numpy as np

from ...support.arrays import Array
from .fault import DataFault
from .record import LEAST_READINGS, Record

#: Readings that are looked for before all are: where one is alone, not all are copied.
_TRIED: Final = 8


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
    """Rows with one time stamp and the same readings; without times, all rows several times.

    Some equal readings without times are those of a coarse scale.
    """
    for record in records:
        timed = record.time is not None
        columns = [record.reference, record.indicated, *([record.time] if timed else [])]
        table = np.stack([column for column in columns if column is not None])
        if np.all(np.diff(table[-1]) > 0.0) if timed else _is_alone(table):
            continue
        order = np.lexsort(table)
        again = np.append(False, (np.diff(table[:, order]) == 0.0).all(axis=0))
        rows = np.sort(record.rows[order[again]])
        if timed and rows.size:
            yield DataFault.of(
                "duplicate_rows",
                [record.label],
                rows.tolist(),
                f"{rows.size} row{'s' * (rows.size > 1)} of run {record.label} (first: row "
                f"{rows[0]}) are there twice, time stamp and readings",
                "drop the second of each",
            )
        counts = np.diff(np.append(np.flatnonzero(~again), again.size))
        times = int(np.gcd.reduce(counts))
        if not timed and times > 1 and counts.size >= LEAST_READINGS:
            yield DataFault.of(
                "duplicate_rows",
                [record.label],
                rows.tolist(),
                f"every reading of run {record.label} is there {times} times, to the last digit "
                f"(first again: row {rows[0]}): uncertainties would come out too small",
                "drop the copies",
            )


def _is_alone(table: Array) -> bool:
    """Whether one of the first readings is there once."""
    first = table[:, :_TRIED].T
    return any(np.count_nonzero((one == table.T).all(axis=1)) < 2 for one in first)


def _listed(labels: list[str]) -> str:
    return f"{', '.join(labels[:-1])} and {labels[-1]}"
