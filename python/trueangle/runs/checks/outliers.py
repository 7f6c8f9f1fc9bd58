"""Isolated outliers: readings far off their neighbours in angle, which a fit rejects."""

from __future__ import annotations

from collections.abc import Iterable, Iterator

import numpy as np
from numpy.typing import NDArray

from ...support.arrays import Array
from ...support.display_units import brief_number
from ..outliers import spikes
from .fault import REPEATS, DataFault
from .record import Record


def outliers(records: Iterable[Record], faults: Iterable[DataFault]) -> Iterator[DataFault]:
    """Rows that are isolated outliers, of runs in which no other fault explains them."""
    unsure = {label for fault in faults if fault.fault not in REPEATS for label in fault.runs}
    for record in records:
        if record.label in unsure or len(record) < 2:
            continue
        far, distance = _isolated(record)
        rows = record.rows[far]
        if rows.size:
            most = int(np.argmax(np.where(far, distance, 0.0)))
            yield DataFault.of(
                "outliers",
                [record.label],
                rows.tolist(),
                f"{rows.size} reading{'s' * (rows.size > 1)} of run {record.label} "
                f"{'are' if rows.size > 1 else 'is'} far off the neighbours in angle: row "
                f"{record.rows[most]} by {brief_number(float(distance[most]))} deg",
                "check the rows; `fit` and `diagnose` reject them",
            )


def _isolated(record: Record) -> tuple[NDArray[np.bool_], Array]:
    """Which readings are isolated outliers, and how far each is off its neighbours, deg."""
    far, distance = spikes(record.run.centred_error, record.reference, 360.0)
    if far.any():
        # A sensor that rounds differs from its neighbours by its counts.
        steps = np.diff(np.unique(record.indicated[~far]))
        far &= distance > 2.0 * steps.min(initial=360.0, where=steps > 0.0)
        # What several readings in a row show is an effect, not an outlier.
        far &= np.convolve(far, np.ones(7), "same") < 1.5
    return far, distance
