"""Errors of the system over an output, told by its own name; whether its disk is full."""

from __future__ import annotations

import contextlib
import errno
import os
from collections.abc import Iterator
from os import PathLike
from pathlib import Path

from .workplace import PARTIAL

#: What the system says of writing only.
_OF_WRITING = (errno.ENOSPC, errno.EDQUOT, errno.EFBIG)

#: Bytes that a file must take for its disk not to be full.
_ROOM = 1 << 16


@contextlib.contextmanager
def named_output(
    path: str | PathLike[str],
    making: contextlib.AbstractContextManager[Path],
    read: str | PathLike[str] | None = None,
) -> Iterator[Path]:
    """What ``making`` makes, in which ``path`` is written; errors of the system are told by name.

    Libraries tell of a full disk in words of their own, or as damage of what they read: whether
    that is the cause is asked of the disk. An error without a name, and not of writing alone, is
    one of reading ``read`` (default: of ``path``).
    """
    try:
        with making as place:
            try:
                yield place
            except Exception:
                _check_room(place)
                raise
    except OSError as error:
        named = None if error.filename is None else os.fsdecode(error.filename)
        if not error.errno or not (named is None or PARTIAL in named):
            raise
        of_reading = named is None and error.errno not in _OF_WRITING
        told = path if read is None or not of_reading else read
        raise OSError(error.errno, error.strerror, os.fspath(told)) from None


def _check_room(place: Path) -> None:
    """Write on at the end of every file of a place that is given up, and of a new one.

    Raises
    ------
    OSError
        Of the first that takes nothing more.
    """
    aside = place.parent if place.parent.name.endswith(PARTIAL) else None
    found = [place] if aside is None else [p for p in aside.rglob("*") if p.is_file()]
    for file in found if aside is None else [*found, aside / "more"]:
        with named_by(file), open(file, "ab", buffering=0) as more:
            block = memoryview(bytes(_ROOM))
            while block:
                block = block[more.write(block) :]
            os.fsync(more.fileno())


@contextlib.contextmanager
def named_by(path: str | PathLike[str]) -> Iterator[None]:
    """Errors of the system without a name, or with another, told by this one."""
    try:
        yield
    except OSError as error:
        raise OSError(error.errno, error.strerror, os.fspath(path)) from None
