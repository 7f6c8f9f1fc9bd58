"""The residual of the readings once everything known is subtracted, as plain arrays."""

from __future__ import annotations

import itertools
from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...runs.aliasing import count_positions
from ...support.arrays import Array

Index = NDArray[np.int64]

#: Runs from which on they alone are the independent units; fewer are cut into pieces.
ENOUGH_RUNS = 8

#: Pieces that fewer runs are cut into together, and readings of the least of them.
PIECES, LEAST_PIECE = 12, 30


@dataclass(frozen=True, eq=False)
class Leftover:
    """Residuals with what the joint did at each, runs one after the other.

    Attributes
    ----------
    residual : ndarray, shape (n,)
        Measured less expected error, any unit.
    theta : ndarray
        True output angle, radians, unwrapped within a run.
    direction : ndarray
        -1, 0 or +1.
    run : ndarray of int
        Run of every reading; equal ones side by side.
    clock : ndarray
        Seconds since the start of the run, or the row where no time was recorded.
    timed : bool
        ``clock`` holds seconds.
    factors : mapping of str to ndarray
        Further channels whose product with place may matter: speed, torque, temperature.
    kept : dict
        What tests made of the motion alone; other residuals of the same readings may share it.
    """

    residual: Array
    theta: Array
    direction: Array
    run: Index
    clock: Array
    timed: bool = True
    factors: Mapping[str, Array] = field(default_factory=dict)
    kept: dict[str, Any] = field(default_factory=dict)

    def __len__(self) -> int:
        return int(self.residual.size)

    @property
    def bounds(self) -> list[tuple[int, int]]:
        """First and one-past-last reading of every run."""
        cuts = np.flatnonzero(np.diff(self.run)) + 1
        return list(itertools.pairwise([0, *cuts.tolist(), len(self)]))

    @property
    def places(self) -> int:
        """Distinct places of a turn."""
        if "places" not in self.kept:
            self.kept["places"] = count_positions(self.theta / (2.0 * np.pi))
        found: int = self.kept["places"]
        return found

    @property
    def turns(self) -> float:
        """Largest travel of a run between its ends, output turns."""
        return max(float(np.ptp(self.theta[a:b])) for a, b in self.bounds) / (2.0 * np.pi)

    def units(self) -> list[tuple[int, int]]:
        """Segments that noise makes independent of each other: runs, or pieces of few runs."""
        bounds = self.bounds
        if len(bounds) >= ENOUGH_RUNS:
            return bounds
        per_run = -(-PIECES // len(bounds))
        found = []
        for start, stop in bounds:
            pieces = max(min(per_run, (stop - start) // LEAST_PIECE), 1)
            edges = np.linspace(start, stop, pieces + 1).astype(np.int64).tolist()
            found += list(itertools.pairwise(edges))
        return found

    def centred(self, bounds: list[tuple[int, int]]) -> Array:
        """The residual less its mean in every one of some segments."""
        out = self.residual.copy()
        for start, stop in bounds:
            out[start:stop] -= out[start:stop].mean()
        return out
