"""How much of a file may be in memory once it is unpacked: one budget for all formats.

A packed file says nothing of what it unpacks to: kilobytes stand for gigabytes. It is asked
before memory is taken, from what the file says of itself, and again while it is read.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final

from ..errors import FileError

__all__ = ["DECODED_BYTES", "DecodedSizeError", "check_decoded", "check_part"]

#: Bytes of unpacked columns, at most: as much as a table of runs may have as a file.
DECODED_BYTES: Final = 1 << 30


class DecodedSizeError(FileError):
    """What a file unpacks to is more than is held in memory."""


def check_decoded(path: Path, size: int, columns: int) -> None:
    """Refuse ``columns`` of a file that unpack to more than the budget.

    Raises
    ------
    DecodedSizeError
        Says how large the file is, how large its columns are, and what reads them.
    """
    if size > DECODED_BYTES:
        raise DecodedSizeError(
            path,
            f"unpacks to {_shown(size)} or more in {columns} columns ({_stored(path)} on the "
            f"disk), but a table of runs is held in memory up to {_shown(DECODED_BYTES)} only; "
            "`ta.fit_logs(...)` reads more, in constant memory",
        )


def check_part(path: Path, size: int, part: str, column: str | None = None) -> None:
    """Refuse a part of a file that can be unpacked as a whole only.

    Raises
    ------
    DecodedSizeError
    """
    if size > DECODED_BYTES:
        raise DecodedSizeError(
            path,
            f"one {part} unpacks to {_shown(size)} ({_stored(path)} on the disk), but at most "
            f"{_shown(DECODED_BYTES)} are unpacked at a time; write it in smaller ones",
            column=column,
        )


def _stored(path: Path) -> str:
    try:
        return _shown(path.stat().st_size)
    except OSError:
        return "an unknown size"


def _shown(size: int) -> str:
    """Bytes in the unit that fits.

    Examples
    --------
    >>> _shown(1023), _shown(5 << 20), _shown(3 << 29)
    ('1023 bytes', '5 MiB', '1.5 GiB')
    """
    for shift, unit in ((30, "GiB"), (20, "MiB"), (10, "KiB")):
        if size >= 1 << shift:
            return f"{size / (1 << shift):.3g} {unit}"
    return f"{size} bytes"
