"""A pen that writes files field by field and damages those whose turn it is.

A format is written as its specification has it; the pen puts another number, text or order where
it is told to. Lengths, places and checksums are computed from what was written, so that damage
lies behind the first check of a reader and not at it, unless one of them is the field at fault.
"""

from __future__ import annotations

import random
import struct
from collections.abc import Callable, Sequence
from typing import Any

from mutation import NASTY, mutated_bytes

#: Numbers that lengths, counts, types and places go wrong by.
_WHOLE = (
    *(0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10, 11, 12, 14, 15, 16, 31, 32, 64, 100, 127, 128, 255, 256),
    *(1000, 4096, 2**15, 2**16 - 1, 2**24, 10**9, 2**31 - 1, 2**31, 2**32 - 1, 2**40, 2**62),
    *(2**63 - 1, 2**63, 2**64 - 8, 2**64 - 1),
)
_FLOATS = (0.0, -0.0, 1.0, -1.0, 1e300, -1e308, 5e-324, 1e-9, 360.0, float("nan"), float("inf"))
_TEXTS = (
    *(b"", b"x", b"/", b"..", b"a/b", b"\x00", b"\xff\xfe", b"\x1b[31m", b"indicated_deg"),
    *(b"reference_deg", b"corrected_deg", b"time_s", b"deg", b"rad", b"m", "\u0661".encode()),
    *(b"double", b"int64[]", b"zstd", b"lz4", b"none", b"{", b"\n", b"y" * 300, b"z" * 70_000),
)


class Pen:
    """Writes fields, and damages those that are counted in ``hits``."""

    def __init__(self, rng: random.Random | None = None, hits: frozenset[int] = frozenset()):
        self.rng = rng or random.Random(0)
        self.hits = hits
        self.count = 0

    def hit(self) -> bool:
        """Whether the field that is written next is to be damaged."""
        self.count += 1
        return self.count in self.hits

    def number(self, form: str, value: float) -> bytes:
        """A number as ``struct`` has it; others are taken modulo its width."""
        if self.hit():
            value = self._another(form, value)
        return _packed(form, value)

    def numbers(self, form: str, values: Sequence[float]) -> bytes:
        """Numbers that are one field: one of them goes wrong."""
        made = [struct.pack(form, value) for value in values]
        if made and self.hit():
            i = self.rng.randrange(len(made))
            made[i] = _packed(form, self._another(form, values[i]))
        return b"".join(made)

    def _another(self, form: str, value: float) -> float:
        rng = self.rng
        if form[-1] in "fd":
            return rng.choice((*_FLOATS, -value, value * 2.0, value * 1e9, value + 1e-6))
        bits = 8 * struct.calcsize(form)
        near = (
            value + 1,
            value - 1,
            2 * value,
            value // 2,
            -value,
            value ^ (1 << rng.randrange(8)),
        )
        number = int(rng.choice((*near, *near, *_WHOLE, rng.getrandbits(bits)))) % (1 << bits)
        signed = form[-1].islower() and number >= 1 << (bits - 1)
        return number - (1 << bits) if signed else number

    def text(self, value: bytes) -> bytes:
        """Bytes without their length."""
        if not self.hit():
            return value
        if self.rng.random() < 0.5:
            return self.rng.choice(_TEXTS)
        return mutated_bytes(value, self.rng)

    def value(self, value: Any) -> Any:
        """A value of a document or a data base."""
        return self.rng.choice((*NASTY, value)) if self.hit() else value

    def parts(self, made: Sequence[bytes]) -> list[bytes]:
        """Records in their order: one is left out, doubled, exchanged or cut."""
        found = list(made)
        if not found or not self.hit():
            return found
        rng = self.rng
        i, j = rng.randrange(len(found)), rng.randrange(len(found))
        action = rng.randrange(5)
        if action == 0:
            del found[i]
        elif action == 1:
            found.insert(j, found[i])
        elif action == 2:
            found[i], found[j] = found[j], found[i]
        elif action == 3:
            found[i] = found[i][: rng.randrange(len(found[i]) + 1)]
        else:
            found[i:i] = [found[i]] * rng.choice((2, 100))
        return found


def _packed(form: str, value: float) -> bytes:
    try:
        return struct.pack(form, value)
    except OverflowError:  # of float32
        return struct.pack(form, float("inf"))


_COUNTS: dict[tuple[str, int], int] = {}


def penned(name: str, write: Callable[[Pen, int], Any], variants: int, rng: random.Random) -> Any:
    """What ``write`` makes of one of its variants with some fields damaged."""
    variant = rng.randrange(variants)
    key = name, variant
    if key not in _COUNTS:
        pen = Pen()
        write(pen, variant)
        _COUNTS[key] = pen.count
    count = rng.choice((0, 1, 1, 1, 1, 2, 2, 4))
    hits = frozenset(rng.randint(1, _COUNTS[key]) for _ in range(count))
    return write(Pen(rng, hits), variant)
