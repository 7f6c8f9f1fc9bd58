"""What a file holds before it is read and decoded: extents, sizes, one budget of memory for all.

The size of a packed file does not show what it unpacks to: kilobytes may become gigabytes. It is
checked before memory is allocated, from what the file declares, and again while it is read.
"""

from __future__ import annotations

from pathlib import Path
from typing import Final, NamedTuple

from ..errors import FileError

#: Bytes of unpacked columns, at most: as much as a table of runs may have as a file.
DECODED_BYTES: Final = 1 << 30


class FileExtent(NamedTuple):
    """What a file holds: its rows, about, and the bytes of columns in memory (0: not known)."""

    rows: int
    size: int


class DecodedSizeError(FileError):
    """What a file unpacks to is more than is held in memory."""


def check_decoded(path: Path, size: int, columns: int) -> None:
    """Refuse ``columns`` of a file that unpack to more than the budget.

    Raises
    ------
    DecodedSizeError
        States how large the file is, how large its columns are, and what reads them.
    """
    if size > DECODED_BYTES:
        raise DecodedSizeError(
            path,
            f"unpacks to {shown_bytes(size)} or more in {columns} columns "
            f"({stored_size(path)} on the disk); a table of runs is read into memory up to "
            f"{shown_bytes(DECODED_BYTES)}; `ta.fit_logs(...)` reads more",
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
            f"one {part} unpacks to {shown_bytes(size)} ({stored_size(path)} on the disk), but at "
            f"most {shown_bytes(DECODED_BYTES)} are unpacked at a time; write it in smaller ones",
            column=column,
        )


def stored_size(path: Path) -> str:
    """What a file takes on the disk, in the unit that fits."""
    try:
        return shown_bytes(path.stat().st_size)
    except OSError:
        return "an unknown size"


def shown_bytes(size: int) -> str:
    """Bytes in the unit that fits.

    Examples
    --------
    >>> shown_bytes(1023), shown_bytes(5 << 20), shown_bytes(3 << 29)
    ('1023 bytes', '5 MiB', '1.5 GiB')
    """
    for shift, unit in ((30, "GiB"), (20, "MiB"), (10, "KiB")):
        if size >= 1 << shift:
            return f"{size / (1 << shift):.3g} {unit}"
    return f"{size} bytes"
