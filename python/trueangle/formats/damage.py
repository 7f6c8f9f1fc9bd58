"""Whatever a library raises over a damaged file, reported with the file's name."""

from __future__ import annotations

import errno
import os
from collections.abc import Iterator
from contextlib import contextmanager

from ..errors import FileError, TrueAngleError


@contextmanager
def damage_told(path: object, name: str, hint: str = "") -> Iterator[None]:
    """Errors of a library that reads ``path`` as a file of the format ``name``.

    Libraries raise almost anything over damaged bytes, so all errors are reported as damage
    except those of this package and of the operating system; the cause stays attached. With a
    damaged length a library requests more memory than a file of this size can need.
    """
    try:
        yield
    except TrueAngleError:
        raise
    except MemoryError:
        raise FileError(
            path, "needs more memory than there is: it is damaged, or its parts are too large"
        ) from None
    except Exception as cause:
        _raise_if_of_machine(cause)
        # An invalid argument is a place that a damaged file named.
        if isinstance(cause, OSError) and (cause.errno or 0) > 0 and cause.errno != errno.EINVAL:
            cause.filename = cause.filename or str(path)
            raise
        raise FileError(path, f"is damaged or not {name}: {_told(cause)}{hint}") from cause


#: What libraries report of a full disk, or of too little memory, in errors of their own types.
_DISK_FULL = ("disk is full", "no space left", "errno = 28")
_NO_MEMORY = ("out of memory", "cannot allocate memory", "malloc of size", "can't start new thread")


def _raise_if_of_machine(cause: Exception) -> None:
    """A full disk and too little memory are no fault of the file that is read."""
    told = str(cause).lower()
    if any(words in told for words in _DISK_FULL):
        # Without a name: what is being written is known further up.
        raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC)) from None
    if any(words in told for words in _NO_MEMORY):
        raise MemoryError(_told(cause)) from None


def _told(error: Exception) -> str:
    """The first line of an error's text, or what kind it is."""
    text = " ".join(str(error).partition("\n")[0].split())
    return text[:200] if text else type(error).__name__
