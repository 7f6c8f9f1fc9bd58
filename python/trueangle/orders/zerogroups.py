"""Units of readings with a zero of their own, and folds of a single run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ..aliasing import Positions
from ..fitting.travel import over_turns
from ..runs import CalibrationRun
from .harmonicsums import Readings

__all__ = ["angle_blocks", "units_of"]

#: Folds of a single run: whole blocks of neighbouring positions, dealt in turn.
_FOLDS: Final = 6
_BLOCKS: Final = 24


def units_of(
    runs: Sequence[CalibrationRun], whole: bool
) -> tuple[list[Readings], NDArray[np.intp]]:
    """Units with a zero of their own: runs, split where the mount changes within one.

    Returns the units and the place of each of their readings among all readings of the
    runs. Angles are taken over turns unless ``whole`` (all orders are whole).
    """
    units, places, start = [], [], 0
    for number, run in enumerate(runs):
        label = run.label or str(number + 1)
        angle = (run if whole else over_turns(run)).reference
        weights = np.ones(len(run)) if run.weights is None else run.weights
        everything = Readings(angle / run.period, run.centred_error, weights, label)
        place = np.arange(start, start + len(run))
        if run.mount is not None and np.unique(run.mount).size > 1:
            for mount in np.unique(run.mount):
                mask = run.mount == mount
                units.append(everything.part(mask, f"{label}, mount {mount:g}"))
                places.append(place[mask])
        else:
            units.append(everything)
            places.append(place)
        start += len(run)
    return units, np.concatenate(places)


def angle_blocks(unit: Readings, positions: Positions) -> list[Readings]:
    """Folds of a single run: blocks of neighbouring positions, dealt in turn."""
    blocks = min(_BLOCKS, len(positions) // 2)
    folds = min(_FOLDS, blocks)
    if folds < 2:
        return []
    fold = (positions.index * blocks // len(positions)) % folds
    return [unit.part(fold == f, f"block {f + 1}") for f in range(folds)]
