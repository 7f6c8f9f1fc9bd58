"""Readings of logs that are kept as they are, in addition to the sums of all."""

from __future__ import annotations

from collections.abc import Hashable
from dataclasses import dataclass, field
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ..support.arrays import Array

#: Number of readings, 16 bytes each, up to which all are read into runs ...
KEPT: Final = 1 << 20
#: ... and of more, the number that is kept: what they decide takes a fraction of a second.
SAMPLE: Final = 1 << 16

#: Readings in a row that are kept or omitted together: neighbours show whether noise correlates.
_BLOCK: Final = 256


@dataclass
class KeptReadings:
    """Blocks of the readings of every run, at random, in their order.

    A block is kept by a number that its place in the log makes: which ones are left does not
    depend on threads or workers. Where the readings get more than ``most``, half of the blocks
    go, but for the first of every run.
    """

    most: int
    part: float = 1.0
    blocks: dict[Hashable, list[tuple[float, Array, Array]]] = field(default_factory=dict)
    readings: int = 0

    def take(self, run: Hashable, salt: int, first: int, x: Array, y: Array) -> None:
        """Readings of a run, the first of them the ``first`` of a segment of its log."""
        places = np.arange(0, x.size, _BLOCK)
        chance = _chance(places // _BLOCK + first // _BLOCK, salt)
        blocks = self.blocks.setdefault(run, [])
        wanted = np.flatnonzero(chance < self.part).tolist()
        for i in wanted if blocks or 0 in wanted else [0, *wanted]:
            place = slice(places[i], places[i] + _BLOCK)
            known = np.isfinite(x[place]) & np.isfinite(y[place])
            if known.any():
                blocks.append((float(chance[i]), x[place][known], y[place][known]))
                self.readings += int(np.count_nonzero(known))
        self._thin()

    def add(self, other: KeptReadings) -> None:
        """The blocks of the next segment, or log."""
        self.part = min(self.part, other.part)
        for run, blocks in other.blocks.items():
            self.blocks.setdefault(run, []).extend(blocks)
        self.readings += other.readings

    def thinned(self, most: int) -> KeptReadings:
        """The same with at most ``most`` readings."""
        self.most = most
        self._thin()
        return self

    def _thin(self) -> None:
        while self.readings > self.most and any(len(b) > 1 for b in self.blocks.values()):
            self.part *= 0.5
            for run, blocks in self.blocks.items():
                kept = [block for block in blocks[1:] if block[0] < self.part]
                self.blocks[run] = [*blocks[:1], *kept]
            sizes = (x.size for blocks in self.blocks.values() for _, x, _ in blocks)
            self.readings = sum(sizes)

    def columns(self, run: Hashable) -> tuple[Array, Array]:
        """Reference and indicated angles of a run."""
        blocks = self.blocks[run]
        return np.concatenate([x for _, x, _ in blocks]), np.concatenate([y for _, _, y in blocks])


def _chance(places: NDArray[np.int64], salt: int) -> Array:
    """A number from 0 to 1 for each place (splitmix64)."""
    state = (places.astype(np.uint64) + np.uint64(salt << 32)) * np.uint64(0x9E3779B97F4A7C15)
    for shift, factor in ((30, 0xBF58476D1CE4E5B9), (27, 0x94D049BB133111EB)):
        state = (state ^ (state >> np.uint64(shift))) * np.uint64(factor)
    return (
        np.asarray((state ^ (state >> np.uint64(31))) >> np.uint64(11), dtype=np.float64) * 2.0**-53
    )
