"""Jumps of a function of the place: ramps over a turn that fall back there."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass
from typing import Final

import numpy as np

from ...joint.pattern import line_columns
from ...support.arrays import Array
from .group import LOW, STANDS_OUT

#: Places that are tried at once, and jumps: a facet has two.
TRIED: Final = 360
ENDS: Final = 2


@dataclass(frozen=True)
class Sawtooth:
    """A ramp over a turn that falls back at one place.

    Attributes
    ----------
    before, after : float
        Neighbouring places, degrees, between which it falls back.
    count : int
        Of how many such gaps.
    """

    before: float
    after: float
    count: int

    @property
    def where(self) -> float:
        """The middle, degrees from 0 to 360."""
        return (0.5 * (self.before + self.after)) % 360.0

    def values(self, degrees: Array) -> Array:
        """The ramp, degrees, as a column."""
        return np.mod(degrees - self.where, 360.0)[:, None]


def less_lines(theta: Array, values: Array, orders: Iterable[float]) -> Array:
    """Columns of values less what lines and a constant take of them."""
    lines = [line_columns(theta, float(m)) for m in orders]
    columns = np.column_stack([np.ones(theta.size), *lines])
    return np.asarray(values - columns @ np.linalg.lstsq(columns, values, rcond=1e-9)[0])


def jumps(degrees: Array, left: Array) -> list[Sawtooth]:
    """Ramps that explain most of values less low orders.

    Of all gaps between places that whose ramp, less its own low orders, explains most, and then the
    next: a sensor that does not use all of its counts jumps where they begin, a facet at both ends.
    """
    places = np.unique(np.round(degrees, 9) % 360.0)
    if places.size <= 2 * LOW + 2:
        return []
    gaps = [
        Sawtooth(float(a), float(b), places.size)
        for a, b in zip(places, np.append(places[1:], places[0] + 360.0), strict=True)
    ]
    coarse = np.unique(np.linspace(0, places.size - 1, min(places.size, TRIED)).astype(int))
    known = _unit_ramps(degrees, [gaps[k] for k in coarse])
    found: list[Sawtooth] = []
    while len(found) < ENDS:
        tried, ramps = coarse, known
        while True:
            best = int(np.argmax((left @ ramps) ** 2))
            if tried.size < 3 or tried[-1] - tried[0] == tried.size - 1:
                break
            tried = np.arange(tried[max(best - 1, 0)], tried[min(best + 1, tried.size - 1)] + 1)
            ramps = _unit_ramps(degrees, [gaps[k] for k in tried])
        size = float(ramps[:, best] @ left)
        if not size**2 > 2.0 * STANDS_OUT * float(left @ left) / left.size:
            break  # noise makes as much of one of many gaps
        found.append(gaps[tried[best]])
        left = left - size * ramps[:, best]
    return found


def _unit_ramps(degrees: Array, gaps: list[Sawtooth]) -> Array:
    """Ramps less their own low orders, of length 1."""
    ramps = np.hstack([gap.values(degrees) for gap in gaps])
    ramps = less_lines(np.radians(degrees), ramps, range(1, LOW + 1))
    return np.asarray(ramps / np.maximum(np.linalg.norm(ramps, axis=0), 1e-6))
