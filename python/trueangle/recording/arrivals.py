"""Lines as they arrive: read by a thread for each source, with the time of their arrival."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from collections.abc import Iterator
from typing import Any, Final, NamedTuple

import numpy as np

from ..support.arrays import Array
from .lines import layout_of, layout_of_columns, layout_of_pattern
from .sources import Source, SourceOptions

#: Seconds between two reads of a fast source, between two looks at what was read, and of silence
#: after which a line is whole.
_PAUSE: Final = 0.002
TICK: Final = 0.05
_SILENCE: Final = 0.02
#: Seconds after which a layout is found by the lines there are.
_HURRY: Final = 0.2
#: Seconds between two times at least: those of a run differ.
_STEP: Final = 1e-6
#: Lines that are taken at once: memory does not depend on pauses of this program.
_BATCH: Final = 1024
#: Bytes of a line, and lines that are looked at for their layout.
_LONGEST: Final = 4096
_LOOKED_AT: Final = 200


class Rows(NamedTuple):
    """Rows of one source, shape (n, columns), and the seconds of their arrival."""

    values: Array
    time: Array

    def at(self, places: Any) -> Rows:
        """Those at some places: numbers or truth values."""
        return Rows(self.values[places], self.time[places])


class Arrivals:
    """What arrives from a source, in rows; a thread reads so that a slow disk loses nothing.

    Parameters
    ----------
    source : Source
        Opened; closed by `close`.
    options : SourceOptions
        With the pattern of its lines, and what is sent to it.
    start : float
        Of the clock (`time.monotonic`) from which seconds count.

    Attributes
    ----------
    rejected : list of bytes
        Lines that are no rows, until they are taken.
    problem : OSError or None
        What ended the source, where it did not end by itself.
    """

    def __init__(self, source: Source, options: SourceOptions, start: float) -> None:
        self.source = source
        self.layout = None if options.pattern is None else layout_of_pattern(options.pattern)
        if source.names:
            self.layout = layout_of_columns("CSV", source.names)
        if options.send is not None:
            source.send(f"{options.send}\n".encode())
        self.rejected: list[bytes] = []
        self.problem: OSError | None = None
        self._start, self._opened = start, time.monotonic()
        self._read: deque[tuple[float, bytes]] = deque()
        self._lines: list[bytes] = []
        self._times: list[float] = []
        self._tail, self._partial = b"", False
        self._before, self._stamp = math.nan, -math.inf
        self._intervals = np.zeros(3)  # lines, and sums of their intervals and squares
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
        count, total, squares = self._intervals.tolist()
        spread = squares / count - (total / count) ** 2 if count > 1 else math.nan
        return math.sqrt(max(spread, 0.0) / 2.0)

    def close(self) -> None:
        """Stop reading; what has been read can still be taken."""
        if not self._stopped.is_set():
            self._stopped.set()
            self._thread.join(2.0)
            self.source.close()

    def _work(self) -> None:
        before = 0.0
        try:
            while not self._stopped.is_set() and (data := self.source.read()) is not None:
                now = time.monotonic()
                if data:
                    self._read.append((now, data))
                    if now - before < 2.0 * _PAUSE:  # many lines in one read are cheaper
                        time.sleep(_PAUSE)
                    before = now
        except OSError as error:
            self.problem = error

    def batches(self) -> Iterator[Rows]:
        """Rows until the source ends, none where none are known by a look."""
        over = False
        while not over:
            over = self.is_over and not self._read
            yield self.take() if self.look() else Rows(np.empty((0, 0)), np.empty(0))
            if not (over or self._read):
                time.sleep(TICK)

    def look(self) -> bool:
        """Take lines apart that have arrived; whether their layout is known by now."""
        over = self.is_over
        while self._read and len(self._lines) < _BATCH:
            self._split(*self._read.popleft())
        if over and not self._read and self._tail and not self._stopped.is_set():
            self.rejected.append(self._tail)  # no line: it was not ended
            self._tail = b""
        if self.layout is None and self._lines:
            waited = time.monotonic() - self._start - self._times[0]
            self.layout = layout_of(self._lines[:_LOOKED_AT], over or waited > _HURRY)
            if self.layout is None and (over or len(self._lines) > _LOOKED_AT):
                gone = len(self._lines) - (0 if over else _LOOKED_AT // 2)
                self.rejected += self._lines[:gone]  # the oldest are not looked at again
                del self._lines[:gone], self._times[:gone]
        return self.layout is not None

    def _split(self, now: float, data: bytes) -> None:
        """Take lines apart, and give each its time.

        Of several in one read the last came now, the others evenly since the read before, at the
        mean interval at most.
        """
        seconds = now - self._start
        if math.isnan(self._before):
            self._partial = self.source.midway and now - self._opened < _SILENCE
            self._before = seconds
        data = (self._tail + data).replace(b"\r\n", b"\n").replace(b"\r", b"\n")
        *lines, self._tail = data.split(b"\n")
        if len(self._tail) > _LONGEST:
            lines.append(self._tail)
            self._tail = b""
        if lines and self._partial:
            self.rejected.append(lines.pop(0))
            self._partial = False
        if not lines:
            return
        gap, (count, total, _), within = seconds - self._before, self._intervals, len(lines) - 1
        step = min(gap / len(lines), total / count if count else gap)
        if gap > 0.0:
            squares = within * step**2 + (gap - within * step) ** 2
            self._intervals += len(lines), gap, squares
        first = max(seconds - within * max(step, _STEP), self._stamp + _STEP)
        step = max((seconds - first) / max(within, 1), _STEP)
        self._lines += lines
        self._times += [first + i * step for i in range(len(lines))]
        self._before, self._stamp = seconds, self._times[-1]

    def take(self) -> Rows:
        """Rows that arrived until the last look, whose layout is known."""
        assert self.layout is not None
        lines, rows = self._lines, Rows(self.layout.values(self._lines), np.array(self._times))
        self._lines, self._times = [], []
        good = np.isfinite(rows.values).all(axis=1)
        passed = (b"", self.layout.header)
        wrong = [lines[i] for i in np.flatnonzero(~good)]
        self.rejected += [line for line in wrong if line.strip() not in passed]
        return rows.at(good)
