"""Progress of long work on stderr: files, rows, rate, time left."""

from __future__ import annotations

import json
import sys
import threading
import time
from collections.abc import Callable
from typing import TextIO

#: Seconds between two lines.
_INTERVAL = 0.5


class Progress:
    """Counts what is done and shows it now and then.

    Parameters
    ----------
    files : int
    total : int
        Bytes of all files: the time left goes by them.
    style : {"auto", "text", "json", "none"}
        Text rewrites one line; JSON prints an object a line; ``"auto"`` is text on a
        terminal and nothing elsewhere.
    """

    def __init__(
        self,
        files: int,
        total: int,
        style: str = "auto",
        stream: TextIO | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        found = sys.stderr if stream is None else stream
        # The line that rewrites itself steers the terminal, which printed text must not.
        self._stream: TextIO = getattr(found, "steering", found)
        if style == "auto":
            style = "text" if self._stream.isatty() else "none"
        self._style = style
        self._clock = clock
        self._files = files
        self._total = max(total, 1)
        self._start = self._shown = clock()
        self._before = 0.0
        self._lock = threading.Lock()
        self._skipped = 0
        self._width = 0
        self._size = 0
        self.files = 0
        self.rows = 0

    def start_file(self, size: int) -> None:
        """A file of ``size`` bytes is in hand."""
        self._size = size

    def advance(self, rows: int, part: float) -> None:
        """``rows`` more are done, now ``part`` of the file in hand."""
        self.rows += rows
        now = self._clock()
        if self._style != "none" and now - self._shown >= _INTERVAL:
            self._shown = now
            self._show(now, self._before + part * self._size)

    def add(self, rows: int, size: float) -> None:
        """``rows`` more are done, of files side by side, and ``size`` bytes more."""
        with self._lock:
            self._before += size
            self.advance(rows, 0.0)

    def finish_file(self, size: int, skipped: bool = False) -> None:
        """A file is done, or was done before (``skipped``), or failed."""
        self._before += size
        self._skipped += size if skipped else 0
        self._size = 0
        self.files += 1

    def clear(self) -> None:
        """Remove the line of text."""
        if self._width:
            self._stream.write("\r" + " " * self._width + "\r")
            self._stream.flush()
            self._width = 0

    def _show(self, now: float, size: float) -> None:
        seconds = now - self._start
        worked = size - self._skipped
        left = (self._total - size) * seconds / worked if worked > 0 else None
        rate = self.rows / seconds
        if self._style == "json":
            state = {
                "files_done": self.files,
                "files": self._files,
                "rows": self.rows,
                "rows_per_second": round(rate),
                "part": round(size / self._total, 4),
                "seconds_left": None if left is None else round(left, 1),
            }
            self._stream.write(json.dumps(state) + "\n")
        else:
            text = (
                f"{self.files}/{self._files} files, {self.rows:,} rows, "
                f"{rate:,.0f} rows/s, {100 * size / self._total:.0f} %"
            )
            text += "" if left is None else f", {_clock_text(left)} left"
            self._stream.write("\r" + text.ljust(self._width))
            self._width = max(self._width, len(text))
        self._stream.flush()


def _clock_text(seconds: float) -> str:
    minutes, rest = divmod(round(seconds), 60)
    hours, minutes = divmod(minutes, 60)
    return f"{hours}:{minutes:02d}:{rest:02d}" if hours else f"{minutes}:{rest:02d}"
