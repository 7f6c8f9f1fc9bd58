"""Numbers that lie in a file as they are, read where they lie.

A library that reads them copies them once more, fills the memory first or lets one thread read
at a time. Mapped memory would need no copy, but takes a page fault for every few of them, and
the process ends (SIGBUS) where another program shortens the file meanwhile.
"""

from __future__ import annotations

from io import FileIO
from typing import Any

import numpy as np
from numpy.typing import DTypeLike, NDArray

#: Values at once: two columns of them stay in the second cache until they are used.
ROWS = 1 << 16


def stored_values(file: FileIO, place: int, dtype: DTypeLike, count: int) -> NDArray[Any]:
    """``count`` values from the byte ``place`` of a file, in native order.

    Raises
    ------
    OSError
        The file ends before them.
    """
    values = np.empty(count, dtype)
    room = values.view(np.uint8).data
    file.seek(place)
    while room:
        got = file.readinto(room)
        if not got:
            raise OSError(f"it ends {len(room)} bytes before the end of its numbers")
        room = room[got:]
    return values.astype(values.dtype.newbyteorder("="), copy=False)
