"""Readings of a live source as they are watched: in batches, while they arrive."""

from __future__ import annotations

import time
import warnings
from collections.abc import Iterator
from contextlib import closing

import numpy as np

from ..errors import FileError, MessageLinesWarning, level_of_caller
from ..model.batches import ReadingBatch, WatchedColumns
from ..model.model import HarmonicModel
from ..runs.files import Conversion
from ..runs.source import ReadingOptions, checked_reading_options
from ..support.layout import counted
from .arrivals import TICK, Arrivals
from .sources import SourceOptions


def watched_batches(
    address: str, model: HarmonicModel, reading: ReadingOptions, options: SourceOptions
) -> Iterator[ReadingBatch]:
    """Batches of the rows that arrive from a source, until it ends.

    Parameters
    ----------
    address : str
        See `trueangle.recording.sources.open_source`.
    model : HarmonicModel
    reading : ReadingOptions
    options : SourceOptions

    Yields
    ------
    ReadingBatch
        The time is that of arrival where the lines have none.

    Raises
    ------
    FileError
        No line is a row, or a column is missing; the source ends by a fault.
    """
    given = Conversion.of(checked_reading_options(reading))
    columns, rejected, over = None, 0, False
    with closing(Arrivals(address, options, time.monotonic())) as arrivals:
        while not over:
            over = arrivals.is_over and not arrivals.is_behind
            if arrivals.look() and arrivals.layout is not None:
                names, rows = arrivals.layout.names, arrivals.take()
                columns = columns or WatchedColumns.of(address, names, reading, given, None)
                if rows.time.size:
                    found = dict(zip(names, np.ascontiguousarray(rows.values.T), strict=True))
                    batch = columns.batch(found.__getitem__, model)
                    yield batch if batch.time is not None else batch._replace(time=rows.time)
            rejected += len(arrivals.rejected)
            arrivals.rejected = []
            if not (over or arrivals.is_behind):
                time.sleep(TICK)
    lines = counted(rejected, "line")
    if rejected and columns is not None:
        text = f"{address}: {lines} rejected: no row of numbers"
        warnings.warn(text, MessageLinesWarning, stacklevel=level_of_caller())
    if arrivals.problem is not None:
        raise FileError(address, f"ended by a fault: {arrivals.problem}")
    if columns is None:
        raise FileError(address, f"{lines}, none of numbers; check the baud rate")
