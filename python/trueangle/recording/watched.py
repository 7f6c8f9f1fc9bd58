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
from .lines import layout_of_pattern
from .sources import SourceOptions, open_source

#: Seconds between two looks at what has arrived.
_TICK = 0.05


def watched_batches(
    address: str,
    model: HarmonicModel,
    reading: ReadingOptions,
    options: SourceOptions | None = None,
    pattern: str | None = None,
    send: str | None = None,
) -> Iterator[ReadingBatch]:
    """Batches of the rows that arrive from a source, until it ends.

    Parameters
    ----------
    address : str
        See `trueangle.recording.sources.open_source`.
    model : HarmonicModel
    reading : ReadingOptions
    options : SourceOptions, optional
    pattern : str, optional
        Columns of a line as named groups.
    send : str, optional
        Sent to the device at the start.

    Yields
    ------
    ReadingBatch
        The time is that of arrival where the lines have none.

    Raises
    ------
    FileError
        No line is a row, or a column is missing; the source ends by a fault.
    """
    layout = None if pattern is None else layout_of_pattern(pattern)
    source = open_source(address, options or SourceOptions())
    arrivals = Arrivals(source, layout, time.monotonic())
    columns, rejected = None, 0
    try:
        if send is not None:
            source.send(send.encode())
        while True:
            ended = arrivals.is_over and not arrivals.is_behind
            if arrivals.look() and arrivals.layout is not None:
                names = arrivals.layout.names
                if columns is None:
                    given = Conversion.of(checked_reading_options(reading))
                    columns = WatchedColumns.of(address, names, reading, given, None)
                rows = arrivals.take()
                if rows.texts:
                    found = dict(zip(names, np.ascontiguousarray(rows.values.T), strict=True))
                    batch = columns.batch(found.__getitem__, model)
                    yield batch if batch.time is not None else batch._replace(time=rows.time)
            rejected += len(arrivals.rejected)
            arrivals.rejected = []
            if ended:
                break
            if not arrivals.is_behind:
                time.sleep(_TICK)
    finally:
        arrivals.close()
    if rejected and columns is not None:
        warnings.warn(
            f"{address}: {counted(rejected, 'line')} that {'is' if rejected == 1 else 'are'} no "
            "row of numbers rejected",
            MessageLinesWarning,
            stacklevel=level_of_caller(),
        )
    if arrivals.problem is not None:
        raise FileError(address, f"ended by a fault: {arrivals.problem}")
    if columns is None:
        raise FileError(
            address, f"no line is a row of numbers, {counted(rejected, 'line')} rejected"
        )
