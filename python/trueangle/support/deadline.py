"""Time of long work: its progress, the time left, when it must end.

Long work consults the `Deadline` that is in force (`current_deadline`) and needs no argument for
it. The caller enters one with `with_deadline`, and may let Ctrl-C end it early (`ending_early`).
"""

from __future__ import annotations

import contextlib
import math
import signal
import sys
import time
from collections.abc import Callable, Iterator
from contextvars import ContextVar
from types import FrameType
from typing import Any, Final, TextIO

from ..errors import ArgumentError
from .suggestions import check_choice

#: Most work where no time was given, in numbers of columns that are fitted or scored: in all, and
#: for each item where that is more. Ordinary readings take a twentieth to a sixth of that.
LEAST, PER_ITEM = 2e8, 1.2e4

#: Signals that end a process.
ENDINGS: Final = ("SIGINT", "SIGTERM", "SIGHUP")

#: Ways of showing progress.
STYLES: Final = ("auto", "text", "json", "none")

#: Seconds before anything is shown, and between two times that it is.
_FIRST, _INTERVAL = 1.0, 0.5


class ProgressLine:
    """Where progress is shown: a line of stderr that rewrites itself, or an object a line.

    Parameters
    ----------
    style : {"auto", "text", "json", "none"}
        ``"auto"`` is text on a terminal and nothing elsewhere.
    stream : text stream, optional
        In place of stderr.
    shown : float
        When it was shown last.
    """

    def __init__(self, style: str, stream: TextIO | None, shown: float) -> None:
        check_choice("progress", style, STYLES)
        found = sys.stderr if stream is None else stream
        # The line that rewrites itself steers the terminal, which printed text must not.
        self._stream: TextIO | None = getattr(found, "steering", found)
        if style == "auto":
            style = "text" if self._stream is not None and self._stream.isatty() else "none"
        self._style = "none" if self._stream is None else style
        self._shown = shown
        self._width = 0

    def is_due(self, now: float) -> bool:
        """Whether it is time to show something; it then counts as shown."""
        due = self._style != "none" and now - self._shown >= _INTERVAL
        if due:
            self._shown = now
        return due

    def show(self, text: str, state: dict[str, Any]) -> None:
        """Show a text, or the object with the same content."""
        if self._style == "json":
            import json  # a help needs none of it

            self._write(json.dumps(state) + "\n")
            return
        self._write("\r" + text.ljust(self._width))
        self._width = max(self._width, len(text))

    def clear(self) -> None:
        """Remove the line of text."""
        if self._width:
            self._write("\r" + " " * self._width + "\r")
            self._width = 0

    def _write(self, text: str) -> None:
        assert self._stream is not None
        with contextlib.suppress(OSError):  # a closed terminal
            self._stream.write(text)
            self._stream.flush()


class Deadline:
    """The progress of a piece of work, and whether it must end.

    Parameters
    ----------
    within : float, optional
        Seconds that it may take; any time where not given.
    style : {"auto", "text", "json", "none"}
        Text rewrites one line of stderr; JSON prints an object a line; ``"auto"`` is text
        on a terminal and nothing elsewhere. Nothing is shown in the first second.
    stream : text stream, optional
        In place of stderr.
    clock : callable
        Seconds that pass.

    Attributes
    ----------
    within : float or None
    stopped : bool
        Ctrl-C requested its end.

    Raises
    ------
    ArgumentError
        A time that is not above zero, or an unknown style.
    """

    def __init__(
        self,
        within: float | None = None,
        style: str = "none",
        stream: TextIO | None = None,
        clock: Callable[[], float] = time.monotonic,
    ) -> None:
        if within is not None and not (within > 0.0 and math.isfinite(within)):
            raise ArgumentError(f"within must be a time above zero in seconds, got {within!r}")
        self._clock = clock
        self._begun = clock()
        self._line = ProgressLine(style, stream, self._begun + _FIRST - _INTERVAL)
        self._share = 1.0
        self._stage, self._entered = "", self._begun
        self._cut = ""
        #: Of `bounded` work: what was done, and what may be.
        self._spent, self._bound = 0.0, math.inf
        self.within = within
        self.stopped = False

    @property
    def seconds(self) -> float:
        """Seconds since it began."""
        return self._clock() - self._begun

    @property
    def over(self) -> bool:
        """The work must end now: its time is up, or Ctrl-C was pressed."""
        if self.within is not None:
            late = self.seconds >= self._share * self.within
        else:
            late = math.isfinite(self._bound) and self._spent >= self._share * self._bound
        if (late or self.stopped) and not self._cut:
            self._cut = self._stage or "starting"
        return late or self.stopped

    def spend(self, numbers: int) -> None:
        """Count ``numbers`` in columns that are fitted or scored as work done."""
        self._spent += numbers

    @property
    def why(self) -> str:
        """The reason for ending the work."""
        if self.stopped:
            return "it was interrupted"
        if self.within is not None:
            return f"the time given, {self.within:g} s, was over"
        return "the usual limit of work was reached"

    @contextlib.contextmanager
    def bounded(self, items: int) -> Iterator[None]:
        """Limit work on ``items`` items where no time was given.

        The work done is counted (`spend`), without a clock: the same readings give the same
        result on any machine, however busy.
        """
        before = self._spent, self._bound, self._cut
        self._spent, self._bound, self._cut = 0.0, max(LEAST, PER_ITEM * items), ""
        try:
            yield
        finally:
            self._spent, self._bound, self._cut = before

    @property
    def cut(self) -> str:
        """What was being done when the end was first requested; empty where it never was."""
        return self._cut

    @contextlib.contextmanager
    def part(self, share: float) -> Iterator[None]:
        """Work that must end after ``share`` of the time; the rest is for later work."""
        before, self._share = self._share, min(share, self._share)
        try:
            yield
        finally:
            self._share = before

    def at(
        self, stage: str, done: int, total: int, then: float = 0.0, bound: str = "at least"
    ) -> None:
        """Report ``done`` of ``total`` of a stage, and the seconds of later stages, if known.

        ``bound`` states how the time left is to be read where none was given.
        """
        now = self._clock()
        if stage != self._stage or done == 0:
            self._stage, self._entered = stage, now
        if not self._line.is_due(now):
            return
        left, open_end = self._left(now, done, total, then)
        text = f"{stage}: {done} of {total}"
        if left is not None:
            text += f", {f'{bound} ' if open_end else ''}{clock_text(left)} left"
        times = {"seconds": round(now - self._begun, 1), "seconds_left": left and round(left, 1)}
        self._line.show(text, {"stage": stage, "done": done, "total": total, **times})

    def clear(self) -> None:
        """Remove the line of text."""
        self._line.clear()

    def _left(self, now: float, done: int, total: int, then: float) -> tuple[float | None, bool]:
        """Seconds left, and whether it may take longer."""
        if self.within is not None:
            return max(self.within - (now - self._begun), 0.0), False
        if done == 0:
            return None, True
        return (now - self._entered) * (total - done) / done + then, True


_CURRENT: ContextVar[Deadline | None] = ContextVar("pace", default=None)


def current_deadline() -> Deadline:
    """The pace in force; an endless, silent one where nobody entered any."""
    found = _CURRENT.get()
    return Deadline() if found is None else found


@contextlib.contextmanager
def under_deadline(own: Deadline) -> Iterator[Deadline]:
    """Work at this pace."""
    token = _CURRENT.set(own)
    try:
        yield own
    finally:
        _CURRENT.reset(token)
        own.clear()


@contextlib.contextmanager
def with_deadline(within: float | None = None, style: str = "none") -> Iterator[Deadline]:
    """Work under a deadline of its own; parameters are those of `Deadline`.

    Inner work that sets neither parameter has the deadline of the outer work.
    """
    outer = _CURRENT.get()
    if outer is not None and within is None and style == "none":
        yield outer
        return
    with under_deadline(Deadline(within, style)) as own:
        yield own


class _Interruption:
    """Whether Ctrl-C ended the work."""

    happened = False


@contextlib.contextmanager
def ending_early() -> Iterator[_Interruption]:
    """Let a first Ctrl-C end the work with its results so far; a second acts as usual.

    Where no deadline is in force, outside the main thread, or where Ctrl-C is ignored (a job in
    the background), Ctrl-C acts as usual.
    """
    found = _Interruption()
    ignored = signal.getsignal(signal.SIGINT) in (signal.SIG_IGN, None)
    import threading

    if ignored or threading.current_thread() is not threading.main_thread():
        yield found
        return

    def stop(number: int, frame: FrameType | None) -> None:
        signal.signal(number, before)  # for a second one
        current = _CURRENT.get()
        if current is None:
            signal.raise_signal(number)
        else:
            found.happened = current.stopped = True

    before = signal.signal(signal.SIGINT, stop)
    try:
        yield found
    finally:
        if signal.getsignal(signal.SIGINT) is stop:  # who took it meanwhile keeps it
            signal.signal(signal.SIGINT, before)


@contextlib.contextmanager
def put_off_ending() -> Iterator[Callable[[], bool]]:
    """Within it the first signal is noted and takes effect at the end; a second one kills.

    It gives what returns whether one has come. Threads other than the main one take no signals.
    """
    came: list[int] = []
    before: dict[int, Any] = {}

    def note(number: int, frame: FrameType | None) -> None:
        came.append(number)
        for other in before:
            signal.signal(other, signal.SIG_DFL)

    for name in ENDINGS:
        number = getattr(signal, name, None)
        if number is not None and signal.getsignal(number) is not signal.SIG_IGN:
            with contextlib.suppress(ValueError):
                before[number] = signal.signal(number, note)
    try:
        yield lambda: bool(came)
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)
        if came:
            signal.raise_signal(came[0])


def clock_text(seconds: float) -> str:
    """Seconds, or minutes and seconds, as a clock shows them."""
    minutes, rest = divmod(math.ceil(seconds), 60)
    return f"{minutes}:{rest:02d} min" if minutes else f"{rest} s"
