"""Readings of a live source as they are watched: in batches, while they arrive."""

from __future__ import annotations

import time
import warnings
from collections.abc import Iterator

import numpy as np

from ..errors import FileError, MessageLinesWarning, level_of_caller
from ..model.batches import ReadingBatch, WatchedColumns
from ..model.model import HarmonicModel
from ..runs.files import Conversion
from ..runs.source import ReadingOptions, checked_reading_options
from ..support.layout import counted
from .arrivals import Arrivals
from .sources import SourceOptions, open_source


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
    arrivals = Arrivals(open_source(address, options), options, time.monotonic())
    columns, rejected = None, 0
    try:
        for rows in arrivals.batches():
            rejected += len(arrivals.rejected)
            arrivals.rejected = []
            names = arrivals.layout.names if arrivals.layout is not None else ()
            if columns is None and names:
                given = Conversion.of(checked_reading_options(reading))
                columns = WatchedColumns.of(address, names, reading, given, None)
            if columns is not None and rows.time.size:
                found = dict(zip(names, np.ascontiguousarray(rows.values.T), strict=True))
                batch = columns.batch(found.__getitem__, model)
                yield batch if batch.time is not None else batch._replace(time=rows.time)
    finally:
        arrivals.close()
    lines = counted(rejected, "line")
    if rejected and columns is not None:
        be = "is" if rejected == 1 else "are"
        text = f"{address}: {lines} that {be} no row of numbers rejected"
        warnings.warn(text, MessageLinesWarning, stacklevel=level_of_caller())
    if arrivals.problem is not None:
        raise FileError(address, f"ended by a fault: {arrivals.problem}")
    if columns is None:
        raise FileError(address, f"no line is a row of numbers, {lines} rejected")
