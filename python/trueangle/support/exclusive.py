"""State that several threads change, one at a time."""

from __future__ import annotations

import os
import threading

from ..errors import ArgumentError

__all__ = ["Exclusive"]

#: Seconds between two looks at whose turn it is.
_PATIENCE = 0.05


class Exclusive:
    """One thread at a time; the others wait, unless nobody can ever be done.

    A process that is forked while another of its threads is at it inherits sums that are
    half added: there it is told so.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._process = os.getpid()

    def __enter__(self) -> None:
        while not self._lock.acquire(timeout=_PATIENCE):
            if self._process != os.getpid():
                raise ArgumentError(
                    "this process was forked while another thread updated these moments: "
                    "make new ones here"
                )
        self._process = os.getpid()

    def __exit__(self, *_: object) -> None:
        self._lock.release()
