"""Isolated outliers: readings far off their neighbours in angle, which a fit rejects."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np

from ...support.display_units import brief_number
from .fault import REPEATS, DataFault
from .record import Record


def outliers(records: Iterable[Record], faults: Iterable[DataFault]) -> Iterator[DataFault]:
    """Rows that are isolated outliers, of runs in which no other fault explains them."""
    unsure = {label for fault in faults if fault.fault not in REPEATS for label in fault.runs}
    for record in records:
        if record.label in unsure or len(record) < 2:
            continue
        wild, distance = record.spikes
        rows = record.rows[wild]
        if rows.size:
            most = int(np.argmax(np.where(wild, distance, 0.0)))
            yield DataFault.of(
                "outliers",
                [record.label],
                rows.tolist(),
                f"{rows.size} reading{'s' * (rows.size > 1)} of run {record.label} "
                f"{'are' if rows.size > 1 else 'is'} far off the neighbours in angle: row "
                f"{record.rows[most]} by {brief_number(float(distance[most]))} deg",
                "check the rows; `fit` and `diagnose` reject them",
            )
