"""What became of logs, one by one and together."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

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
