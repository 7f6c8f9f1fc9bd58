"""Lines as they arrive: read by a thread for each source, with the time of their arrival."""

from __future__ import annotations

import math
import threading
import time
from collections import deque
from typing import Any, Final, NamedTuple

import numpy as np

from ..support.arrays import Array
from .lines import layout_of, layout_of_columns, layout_of_pattern
from .sources import SourceOptions, open_source

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

    def followed_by(self, later: Rows) -> Rows:
        """These and later ones."""
        if not self.time.size:
            return later
        return Rows(*(np.concatenate(pair) for pair in zip(self, later, strict=True)))


class Arrivals:
    """What arrives from a source, in rows; a thread reads so that a slow disk loses nothing.

    Parameters
    ----------
    address : str
        See `trueangle.recording.sources.open_source`.
    options : SourceOptions
        With the pattern of its lines.
    start : float
        Of the clock (`time.monotonic`) from which seconds count.

    Attributes
    ----------
    rejected : list of bytes
        Lines that are no rows, until they are taken.
    problem : OSError or None
        What ended the source, where it did not end by itself.
    """

    def __init__(self, address: str, options: SourceOptions, start: float) -> None:
        self.layout = None if options.pattern is None else layout_of_pattern(options.pattern)
        self._source = source = open_source(address, options)
        if source.names:
            self.layout = layout_of_columns("CSV", source.names)
        self.rejected: list[bytes] = []
        self.problem: OSError | None = None
        self._start = start
        self._opened, self._before = time.monotonic() - start, math.nan
        self._read: deque[tuple[float, bytes]] = deque()
        self._lines: list[bytes] = []
        self._times: list[float] = []
        self._tail, self._is_cut = b"", False
        self._intervals = np.zeros(3)  # lines, and sums of their intervals and squares
        self._stopped = threading.Event()
        self._thread = threading.Thread(target=self._work, daemon=True)
        self._thread.start()

    @property
    def is_over(self) -> bool:
        """The source gives no more; what it gave can be taken."""
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
            self._source.close()

    def _work(self) -> None:
        before = 0.0
        try:
            while not self._stopped.is_set() and (data := self._source.read()) is not None:
                now = time.monotonic()
                if data:
                    self._read.append((now - self._start, data))
                    if now - before < 2.0 * _PAUSE:  # many lines in one read are cheaper
                        time.sleep(_PAUSE)
                    before = now
        except OSError as error:
            self.problem = error

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
        if math.isnan(self._before):
            self._is_cut = self._source.midway and now - self._opened < _SILENCE
            self._before = now
        data = (self._tail + data).replace(b"\r\n", b"\n").replace(b"\r", b"\n")
        *lines, self._tail = data.split(b"\n")
        if len(self._tail) > _LONGEST:
            lines, self._tail = [*lines, self._tail], b""
        if lines and self._is_cut:
            self.rejected.append(lines.pop(0))
            self._is_cut = False
        if not lines:
            return
        gap, n, (count, total, _) = now - self._before, len(lines), self._intervals
        step = min(gap / n, total / count if count else gap)
        if gap > 0.0:
            self._intervals += n, gap, (n - 1) * step**2 + (gap - (n - 1) * step) ** 2
        step, self._before = max(step, _STEP), max(now, self._before + n * _STEP)
        self._lines += lines
        self._times += [self._before - i * step for i in reversed(range(n))]

    def take(self) -> Rows:
        """Rows that arrived until the last look, whose layout is known."""
        assert self.layout is not None
        lines, rows = self._lines, Rows(self.layout.values(self._lines), np.array(self._times))
        self._lines, self._times = [], []
        good = np.isfinite(rows.values).all(axis=1)
        wrong = [lines[i] for i in np.flatnonzero(~good)]
        self.rejected += [x for x in wrong if x.strip() not in (b"", self.layout.header)]
        return rows.at(good)
