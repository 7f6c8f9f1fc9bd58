"""Signals that ask a command to end: as Ctrl-C does, with all that is half-written removed."""

from __future__ import annotations

import signal
from collections.abc import Iterator
from contextlib import contextmanager, suppress
from types import FrameType
from typing import Any

__all__ = ["ending_by_signals"]

#: Beside Ctrl-C: what kill, a service manager and a closed terminal send.
_NAMES = ("SIGTERM", "SIGHUP")


class Ending:
    """The signal that ended the work; Ctrl-C's where none of the others came."""

    number = int(signal.SIGINT)

    @property
    def status(self) -> int:
        """The exit status, as a shell tells it."""
        return 128 + self.number

    @property
    def text(self) -> str:
        """What is told of it."""
        named = "" if self.number == signal.SIGINT else f" by {signal.Signals(self.number).name}"
        return f"interrupted{named}"


@contextmanager
def ending_by_signals() -> Iterator[Ending]:
    """Let SIGTERM and SIGHUP raise KeyboardInterrupt, where they would end the process at once.

    What ignores them (``nohup``) or has handlers of its own keeps them; so do threads other
    than the main one. A second one does not disturb the clearing up after the first.
    """
    found = Ending()
    before: dict[int, Any] = {}

    def end(number: int, frame: FrameType | None) -> None:
        found.number = number
        for other in before:
            signal.signal(other, signal.SIG_IGN)
        raise KeyboardInterrupt

    for name in _NAMES:
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) is signal.SIG_DFL:
            with suppress(ValueError):  # outside the main thread
                signal.signal(number, end)
                before[number] = signal.SIG_DFL
    try:
        yield found
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
