"""What becomes of logs, one by one and together: progress while they are read, and a report."""

from __future__ import annotations

import threading
import time
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any, TextIO

from ..support.deadline import ProgressLine, clock_text
from ..support.plainresult import PlainResult
from .joints import LogSettings
from .manifest import Manifest
from .sources import LogTarget


@dataclass
class LogReport:
    """What became of one log.

    Attributes
    ----------
    log, output : Path
    size : int
        Bytes of the log.
    status : {"done", "done before", "failed", "not started"}
    result : dict
        Rows, rate and the joints' summaries, see `correction.correct_log`.
    error : Exception or None
    """

    log: Path
    output: Path
    size: int = 0
    status: str = "not started"
    result: Mapping[str, Any] = field(default_factory=dict)
    error: Exception | None = None

    @property
    def is_done(self) -> bool:
        """True when the output is complete and verified."""
        return self.status.startswith("done")

    def to_dict(self) -> dict[str, Any]:
        """Plain values."""
        known = {key: value for key, value in self.result.items() if key != "after"}
        error = {} if self.error is None else {"error": str(self.error)}
        return {
            "log": str(self.log),
            "output": str(self.output),
            "status": self.status,
            **known,
            **error,
        }


@dataclass
class BatchReport(PlainResult):
    """What became of all logs, in the order they were given."""

    logs: list[LogReport]
    seconds: float = 0.0
    #: What ended it early; a command interrupts once more what no longer has it.
    interrupted: KeyboardInterrupt | None = None

    @property
    def is_done(self) -> bool:
        """True when every log is."""
        return all(log.is_done for log in self.logs)

    def to_dict(self) -> dict[str, Any]:
        """Plain values."""
        done = [log for log in self.logs if log.status == "done"]
        return {
            "files": [log.to_dict() for log in self.logs],
            "rows": sum(log.result["rows"] for log in done),
            "seconds": self.seconds,
            "complete": self.is_done,
        }


def done_before(
    place: LogTarget, log: LogReport, settings: LogSettings, manifests: Mapping[Path, Manifest]
) -> bool:
    """Whether the manifest knows the output; the report is then filled from it."""
    if place.manifest is None:
        return False
    known = manifests[place.manifest].done(place.source, place.target, settings.digest)
    if known is not None:
        log.status, log.result = "done before", known
    return known is not None


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
        self._clock = clock
        self._files = files
        self._total = max(total, 1)
        self._start = clock()
        self._line = ProgressLine(style, stream, self._start)
        self._before = 0.0
        self._lock = threading.Lock()
        self._skipped = 0
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
        if self._line.is_due(now):
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
        self._line.clear()

    def _show(self, now: float, size: float) -> None:
        seconds = now - self._start
        worked = size - self._skipped
        left = (self._total - size) * seconds / worked if worked > 0 else None
        rate = self.rows / seconds
        state = {
            "files_done": self.files,
            "files": self._files,
            "rows": self.rows,
            "rows_per_second": round(rate),
            "part": round(size / self._total, 4),
            "seconds_left": None if left is None else round(left, 1),
        }
        text = (
            f"{self.files}/{self._files} files, {self.rows:,} rows, "
            f"{rate:,.0f} rows/s, {100 * size / self._total:.0f} %"
        )
        self._line.show(text + ("" if left is None else f", {clock_text(left)} left"), state)
