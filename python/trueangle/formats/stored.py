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


_MODULUS = 1 << 64
#: Words taken together: their places stay in cache.
_BLOCK = 1 << 16
_PLACES = np.arange(1, _BLOCK + 1, dtype=np.uint64)


class Checksum:
    """Sums of 64-bit words, plain and weighted by place, modulo ``2⁶⁴``.

    ::

        s₀ = Σ_i w_i,    s₁ = Σ_i i w_i

    A changed, lost, doubled or displaced value changes them, while it does not matter how
    the values were cut into batches. Bits are compared, so NaN equals itself. About 1 ns a
    word, near the speed of memory. It finds damage, not forgery.

    Examples
    --------
    >>> whole, parts = Checksum(), Checksum()
    >>> whole.update(np.array([1.0, 2.0, np.nan]))
    >>> parts.update(np.array([1.0])); parts.update(np.array([2.0, np.nan]))
    >>> whole.text() == parts.text()
    True
    """

    __slots__ = ("count", "placed", "plain")

    def __init__(self) -> None:
        self.count = 0
        self.plain = 0
        self.placed = 0

    def update(self, values: NDArray[np.generic]) -> None:
        """Take in an array of items of 1, 2, 4, 8 or a multiple of 8 bytes."""
        contiguous = np.ascontiguousarray(values).reshape(-1)
        width = contiguous.dtype.itemsize
        words = contiguous.view(f"u{width}" if width < 8 else np.uint64)
        for start in range(0, words.size, _BLOCK):
            block = words[start : start + _BLOCK].astype(np.uint64, copy=False)
            plain = int(block.sum(dtype=np.uint64))
            self.placed += self.count * plain + int(np.dot(block, _PLACES[: block.size]))
            self.plain += plain
            self.count += block.size
        self.placed %= _MODULUS
        self.plain %= _MODULUS

    def text(self) -> str:
        """Count and sums as text, to compare and to keep."""
        return f"{self.count}:{self.plain:016x}:{self.placed:016x}"
