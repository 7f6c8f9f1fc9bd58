"""Commands that signals end: Ctrl-C, and what kill, a service manager, a closed terminal send."""

from __future__ import annotations

import contextlib
import signal
import sys
from collections.abc import Callable
from types import FrameType
from typing import Any, Final, NoReturn, Self

from ..support.deadline import ENDINGS

#: Handlers of signals that end a process at once.
_AT_ONCE: Final = (signal.SIG_DFL, signal.default_int_handler)
#: The signal of a timer, which Windows has none of, and seconds after which one is raised again.
_ALARM: Final[int | None] = getattr(signal, "SIGALRM", None)


def own_interrupts() -> None:
    """Let Ctrl-C reach Python alone, before logs are read.

    While it parses a block, pyarrow takes signals itself, and now and then loses one.
    """
    try:
        import pyarrow
    except ImportError:
        return
    pyarrow.enable_signal_handlers(False)


class _Interrupted(KeyboardInterrupt):
    """One that calls ``gone`` once nobody has it any more.

    Not the class itself: Python ends a process by SIGINT if one of that left `eval` or `exec`.
    """

    def __init__(self, gone: Callable[[], None]) -> None:
        super().__init__()
        self._gone = gone

    def __del__(self) -> None:
        self._gone()


class Ending:
    """Ends the work within it by a signal: the first raises KeyboardInterrupt, a second one kills.

    What ignores a signal (``nohup``) or has a handler for it keeps that; so do threads other than
    the main one.

    Attributes
    ----------
    number : int
        The signal that came; Ctrl-C's where none has.
    came : bool
        Whether one has: every error after that is its consequence. Libraries name others (numpy
        that its installation is broken, where a signal ends its import).
    """

    number = int(signal.SIGINT)
    came = False

    def __init__(self) -> None:
        self._before: dict[int, Any] = {}
        self._works = True

    @property
    def status(self) -> int:
        """The exit status, as a shell reports it."""
        return 128 + self.number

    @property
    def text(self) -> str:
        """The message about it."""
        named = "" if self.number == signal.SIGINT else f" by {signal.Signals(self.number).name}"
        return f"interrupted{named}"

    def __enter__(self) -> Self:
        self._unraisable = sys.unraisablehook
        for name in ENDINGS:
            number = getattr(signal, name, None)
            if number is not None and signal.getsignal(number) in _AT_ONCE:
                with contextlib.suppress(ValueError):  # outside the main thread
                    self._before[number] = signal.signal(number, self._end)
        if self._before:
            sys.unraisablehook = self._tell
        return self

    def __exit__(self, *_: object) -> None:
        self._works = False
        if _ALARM in self._before:
            signal.setitimer(signal.ITIMER_REAL, 0.0)
        for number, handler in self._before.items():
            signal.signal(number, handler)
        sys.unraisablehook = self._unraisable

    def _end(self, number: int, frame: FrameType | None) -> None:
        if self.came:  # by both in one moment
            return
        self.number, self.came = number, True
        for other in self._before:
            signal.signal(other, signal.SIG_DFL)
        if _ALARM is not None:
            self._before[_ALARM] = signal.signal(_ALARM, self._interrupt)
        self._interrupt(number, frame)

    def _interrupt(self, number: int, frame: FrameType | None) -> NoReturn:
        raise _Interrupted(self._again)

    def _again(self) -> None:
        """Interrupt once more, as the work goes on: whatever had the exception lost it.

        Python ignores it in callbacks of weak references and in ``__del__``, of which h5py has
        many; libraries clear it in their imports. What catches it and goes on must keep it.
        """
        if self._works and _ALARM is not None:
            signal.setitimer(signal.ITIMER_REAL, 0.01)

    def _tell(self, ignored: sys.UnraisableHookArgs) -> None:
        if not issubclass(ignored.exc_type, _Interrupted):
            self._unraisable(ignored)
