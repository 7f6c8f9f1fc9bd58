"""Search of mount offsets and facet shifts with the least worst noise factor."""

from __future__ import annotations

import itertools
import math
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ..support.arrays import first_largest
from .noisefactors import facet_noise_factor, mount_noise_factors

Array = NDArray[np.floating[Any]]

#: A mount may be off by the tolerance as long as no factor exceeds this times ideal.
TOLERATED_FACTOR: Final = 2.0

#: Steps in which offsets are searched, per pitch (0.01 deg for 36 facets).
_STEPS: Final = 1000

#: Rounding of a factor that is ideal, 1.
_IDEAL: Final = 1e-9

#: Sets of facet shifts that are all tried: four mounts of 48 facets.
_SHIFTS: Final = 17_000

_STARTS: Final = 4000  # random starts of the search for three mounts and more
_REFINED: Final = 8  # of these, the best are refined
_SWEEPS: Final = 6  # coordinate sweeps of a refinement


def _worst(positions: int, offsets: Array, orders: Sequence[float]) -> Array:
    return np.asarray(mount_noise_factors(positions, offsets, orders).max(axis=-1))


def search_offsets(positions: int, mounts: int, orders: Sequence[float]) -> list[float]:
    """Offsets in degrees with the least worst factor, the first one 0.

    Even parts of the pitch where none are better: of all offsets that serve the wanted orders
    equally they tell the others apart up to the highest, that of one grid of all positions.
    """
    if mounts == 1:
        return [0.0]
    pitch = 360.0 / positions
    even = np.arange(mounts) * (pitch / mounts)
    if float(_worst(positions, even[None], orders)[0]) <= 1.0 + _IDEAL:
        return [round(float(o), 9) for o in even]
    steps = np.arange(1, _STEPS) * (pitch / _STEPS)
    if mounts == 2:
        trial = np.stack([np.zeros_like(steps), steps], axis=1)
        # Mirror images are equally good: take the smaller offset.
        best = [trial[first_largest(-_worst(positions, trial, orders))]]
    else:
        random = np.random.default_rng(0)
        starts: Array = np.zeros((_STARTS, mounts))
        starts[:, 1:] = random.choice(steps, size=(_STARTS, mounts - 1))
        ranked = np.argsort(_worst(positions, starts, orders), kind="stable")[:_REFINED]
        best = [_refine(positions, starts[i], steps, orders) for i in ranked]
    scores = np.array([float(_worst(positions, o[None], orders)[0]) for o in best])
    chosen = best[first_largest(-scores)]
    return sorted(round(float(o), 9) for o in chosen)


def _refine(positions: int, start: Array, steps: Array, orders: Sequence[float]) -> Array:
    """One offset at a time moved to its best place, until none moves."""
    offsets: Array = start.copy()
    for _ in range(_SWEEPS):
        before = offsets.copy()
        for j in range(1, offsets.size):
            trial = np.repeat(offsets[None], steps.size, axis=0)
            trial[:, j] = steps
            offsets = trial[first_largest(-_worst(positions, trial, orders))]
        if (offsets == before).all():
            break
    return offsets


def search_shifts(positions: int, mounts: int) -> tuple[tuple[int, ...], float]:
    """Facet shifts with the least worst factor: all of a few mounts, then one by one."""
    if mounts == 1:
        return (0,), math.inf
    head = max(h for h in (2, 3, 4) if h == 2 or math.comb(positions - 1, h - 1) <= _SHIFTS)
    head = min(head, mounts, positions)
    combinations = itertools.combinations(range(1, positions), head - 1)
    trial = np.array([(0, *rest) for rest in combinations], dtype=np.int64)
    best = trial[first_largest(-facet_noise_factor(positions, trial))]
    while best.size < mounts:
        more = np.array([[*best, s] for s in range(1, positions)])
        best = more[first_largest(-facet_noise_factor(positions, more))]
    return tuple(int(s) for s in best), float(facet_noise_factor(positions, best))


def offset_tolerance(
    positions: int, offsets: Sequence[float], orders: Sequence[float], worst: float
) -> float:
    """Largest error of every offset at once with all factors below the tolerated one."""
    if len(offsets) == 1 or worst >= TOLERATED_FACTOR:
        return 0.0
    if len(offsets) <= 5:
        signs = np.array(list(itertools.product((-1.0, 0.0, 1.0), repeat=len(offsets) - 1)))
    else:
        unit = np.eye(len(offsets) - 1)
        signs = np.concatenate([unit, -unit])
    step = 360.0 / positions / _STEPS
    error = 0.0
    while error < 0.25 * 360.0 / positions:
        trial = np.tile(np.asarray(offsets), (len(signs), 1))
        trial[:, 1:] += (error + step) * signs
        if _worst(positions, trial, orders).max() > TOLERATED_FACTOR:
            break
        error += step
    return round(error, 9)
