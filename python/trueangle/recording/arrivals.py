"""Lines as they arrive: read by a thread for each source, with the time of their arrival."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from itertools import chain
from typing import Any, Final, NamedTuple

import numpy as np

from ..support.arrays import Array
from .lines import LineLayout, layout_of, layout_of_names
from .sources import Source

#: Seconds between two reads of a fast source, and seconds of silence after which a line is whole.
PAUSE: Final = 0.002
_SILENCE: Final = 0.02
#: Seconds that a read waits, and after which a layout is found by the lines there are.
_WAIT: Final = 0.1
_HURRY: Final = 0.2
#: Seconds between two times at least: those of a run differ.
_STEP: Final = 1e-6
#: Lines that are taken at once: memory does not depend on pauses of this program.
_BATCH: Final = 1024
#: Bytes of a line, and lines that are looked at for their layout.
_LONGEST: Final = 4096
_LOOKED_AT: Final = 200


class Rows(NamedTuple):
    """Rows of one source.

    Attributes
    ----------
    texts : list of sequences of bytes
        Cells as they came.
    values : ndarray, shape (n, columns)
    time : ndarray
        Seconds of arrival.
    """

    texts: list[Any]
    values: Array
    time: Array


class Arrivals:
    """What arrives from a source, in rows; a thread reads so that a slow disk loses nothing.

    Parameters
    ----------
    source : Source
        Opened; closed by `close`.
    layout : LineLayout, optional
        Else it is found by the first lines.
    start : float
        Of the clock (`time.monotonic`) from which seconds count.

    Attributes
    ----------
    rejected : list of bytes
        Lines that are no rows, until they are taken.
    problem : OSError or None
        What ended the source, where it did not end by itself.
    """

    def __init__(self, source: Source, layout: LineLayout | None, start: float) -> None:
        self.source, self.layout = source, layout or layout_of_names(source.names)
        self.rejected: list[bytes] = []
        self.problem: OSError | None = None
        self._start, self._opened = start, time.monotonic()
        self._read: deque[tuple[float, bytes]] = deque()
        self._waiting: list[tuple[bytes, float]] = []
        self._tail = b""
        self._partial = False
        self._before, self._stamp = math.nan, -math.inf
        self._intervals = [0, 0.0, 0.0]  # lines, and sums of their intervals and squares
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._work, daemon=True)
        self._thread.start()

    @property
    def is_over(self) -> bool:
        """The source gives no more; what it gave is there to be taken."""
        return not self._thread.is_alive()

    @property
    def is_behind(self) -> bool:
        """More has been read than one look takes."""
        return bool(self._read)

    @property
    def jitter(self) -> float:
        """Standard deviation of a time of arrival, seconds, were the lines sent evenly."""
        count, total, squares = self._intervals
        if count < 2:
            return math.nan
        return math.sqrt(max(squares / count - (total / count) ** 2, 0.0) / 2.0)

    def close(self) -> None:
        """Stop reading; what has been read can still be taken."""
        if not self._stopped.is_set():
            self._stopped.set()
            self._thread.join(2.0)
            self.source.close()

    def _work(self) -> None:
        before = 0.0
        while not self._stopped.is_set():
            try:
                data = self.source.read(_WAIT)
            except OSError as error:
                self.problem = error
                return
            if data is None:
                return
            now = time.monotonic()
            if data:
                self._read.append((now, data))
                if now - before < 2.0 * PAUSE:  # many lines in one read are cheaper
                    time.sleep(PAUSE)
                before = now

    def look(self) -> bool:
        """Take lines apart that have arrived; whether their layout is known by now."""
        over = not self._thread.is_alive()
        while self._read and len(self._waiting) < _BATCH:
            self._split(*self._read.popleft())
        if (
            over and not self._read and self._tail and not self._stopped.is_set()
        ):  # no line: it was not ended
            self.rejected.append(self._tail)
            self._tail = b""
        if self.layout is None and self._waiting:
            lines = [line for line, _time in self._waiting[:_LOOKED_AT]]
            waited = time.monotonic() - self._start - self._waiting[0][1]
            self.layout = layout_of(lines, over or waited > _HURRY)
            if self.layout is None and (over or len(self._waiting) > _LOOKED_AT):
                kept = 0 if over else _LOOKED_AT // 2  # the oldest are not looked at again
                gone = len(self._waiting) - kept
                self.rejected += [line for line, _time in self._waiting[:gone]]
                del self._waiting[:gone]
        return self.layout is not None

    def _split(self, now: float, data: bytes) -> None:
        """Take lines apart, and give each its time.

        Of several in one read the last came now, the others evenly since the read before, at the
        mean interval at most.
        """
        seconds = now - self._start
        if math.isnan(self._before):
            self._partial = self.source.midway and now - self._opened < _SILENCE
        *lines, self._tail = (
            (self._tail + data).replace(b"\r\n", b"\n").replace(b"\r", b"\n").split(b"\n")
        )
        if len(self._tail) > _LONGEST:
            lines.append(self._tail)
            self._tail = b""
        if lines and self._partial:
            self.rejected.append(lines.pop(0))
            self._partial = False
        if not lines:
            self._before = seconds if math.isnan(self._before) else self._before
            return
        step, within = 0.0, len(lines) - 1
        if not math.isnan(self._before):
            gap, (count, total, _) = seconds - self._before, self._intervals
            step = min(gap / len(lines), total / count if count else gap)
            self._intervals[0] += len(lines)
            self._intervals[1] += gap
            self._intervals[2] += within * step**2 + (gap - within * step) ** 2
        first = max(seconds - within * max(step, _STEP), self._stamp + _STEP)
        step = max((seconds - first) / max(within, 1), _STEP)
        self._waiting += [(line, first + i * step) for i, line in enumerate(lines)]
        self._before, self._stamp = seconds, first + within * step

    def take(self) -> Rows:
        """Rows that arrived until the last look, whose layout is known."""
        assert self.layout is not None
        lines = [line for line, _ in self._waiting]
        texts: list[Any] = self.layout.rows(lines)
        times = np.array([seconds for _, seconds in self._waiting])
        self._waiting = []
        none = [b"nan"] * len(self.layout.names)
        numbers = map(float, chain.from_iterable(none if row is None else row for row in texts))
        values = np.fromiter(numbers, float).reshape(len(texts), len(none))
        good = np.isfinite(values).all(axis=1)
        if good.all():
            return Rows(texts, values, times)
        kept = good.tolist()
        self.rejected += [
            line
            for line, is_row in zip(lines, kept, strict=True)
            if not is_row and line.strip() and line != self.layout.header
        ]
        return Rows(
            [row for row, is_row in zip(texts, kept, strict=True) if is_row],
            values[good],
            times[good],
        )
