"""Lines from standard input, a pipe, and a file that grows."""

from __future__ import annotations

import os
import select
import sys
import time
from typing import Any

from ...errors import ArgumentError
from .source import MOST, SourceOptions

#: Seconds between two looks at a file that may have grown.
_LOOK = 0.02


class LineStream:
    """Standard input (``-``) or a pipe: it ends where its writer closes it."""

    midway = False
    names: tuple[str, ...] = ()

    def __init__(self, address: str, options: SourceOptions) -> None:
        self._file: Any = sys.stdin if address == "-" else open(address, "rb", buffering=0)  # noqa: SIM115
        self._file = getattr(self._file, "buffer", self._file)
        try:
            self._handle: int | None = self._file.fileno()
        except OSError:  # text that is in memory
            self._handle = None

    def read(self, timeout: float) -> bytes | None:
        """See `Source.read`."""
        if self._handle is None:
            data = self._file.read(MOST)
            return (data.encode() if isinstance(data, str) else data) or None
        if os.name != "nt" and not select.select([self._handle], [], [], timeout)[0]:
            return b""
        return os.read(self._handle, MOST) or None

    def send(self, data: bytes) -> None:
        """Refuse: nothing is sent against the stream.

        Raises
        ------
        ArgumentError
        """
        raise ArgumentError("send: lines are only read here")

    def close(self) -> None:
        """See `Source.close`."""
        if self._file is not getattr(sys.stdin, "buffer", sys.stdin):
            self._file.close()


class GrowingFile(LineStream):
    """A file from its beginning on, and what is added to it; it ends where it gets shorter."""

    def read(self, timeout: float) -> bytes | None:
        """See `Source.read`."""
        assert self._handle is not None
        data = os.read(self._handle, MOST)
        if not data and os.fstat(self._handle).st_size < os.lseek(self._handle, 0, os.SEEK_CUR):
            return None
        if not data:
            time.sleep(min(timeout, _LOOK))
        return data
