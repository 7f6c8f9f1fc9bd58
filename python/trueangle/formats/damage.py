"""Whatever a library raises over a damaged file, told with the file's name."""

from __future__ import annotations

import errno
from collections.abc import Iterator
from contextlib import contextmanager

from ..errors import FileError, TrueAngleError

__all__ = ["damage_told"]


@contextmanager
def damage_told(path: object, name: str, hint: str = "") -> Iterator[None]:
    """Errors of a library that reads ``path`` as a file of the format ``name``.

    Libraries raise almost anything over damaged bytes, so everything is taken for damage
    but errors of this package and of the operating system; the cause stays attached. A
    length that was damaged asks for memory that no file of this size can need.
    """
    try:
        yield
    except TrueAngleError:
        raise
    except MemoryError:
        raise FileError(
            path, "asks for more memory than there is: it is damaged, or its parts are too large"
        ) from None
    except OSError as cause:
        # An invalid argument is a place that a damaged file named.
        if cause.errno is not None and cause.errno > 0 and cause.errno != errno.EINVAL:
            raise
        raise FileError(path, f"is damaged or not {name}: {_told(cause)}{hint}") from cause
    except Exception as cause:
        raise FileError(path, f"is damaged or not {name}: {_told(cause)}{hint}") from cause


def _told(error: Exception) -> str:
    """The first line of an error's text, or what kind it is."""
    text = " ".join(str(error).partition("\n")[0].split())
    return text[:200] if text else type(error).__name__
