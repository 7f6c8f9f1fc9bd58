"""Groups of readings with a zero of their own, and folds of a single run."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...runs.aliasing import Positions
from ...runs.run import CalibrationRun
from ...runs.travel import over_turns
from ...support.angles import wrap
from ...support.arrays import Array

#: Folds of a single run: whole blocks of neighbouring positions, dealt in turn.
_FOLDS: Final = 6
_BLOCKS: Final = 24

#: Passes of a run: whole turns of its way, the last of half a turn at least; most steps are shorter
#: than this part of a turn, or the readings are not in the order of the places.
_HALF: Final = 0.5
_STEP: Final = 0.125

#: Passes of a run, at most about.
_PASSES: Final = 32

#: Readings a run up to which the call of a function costs more than what it computes.
_SHORT: Final = 1000


class ZeroGroupReadings(NamedTuple):
    """Readings of one unit: a run, or a run on one mount, that has its own zero.

    Attributes
    ----------
    turns : ndarray, shape (n,)
        Reference angle in turns; unwrapped where the orders are not whole.
    error : ndarray, shape (n,)
        Error around its zero, in any unit.
    weights : ndarray, shape (n,)
        Positive.
    label : str
    """

    turns: Array
    error: Array
    weights: Array
    label: str

    def part(self, mask: NDArray[np.bool_] | slice, label: str) -> ZeroGroupReadings:
        """The readings where ``mask`` is true, or of a slice."""
        return ZeroGroupReadings(self.turns[mask], self.error[mask], self.weights[mask], label)


def zero_groups(
    runs: Sequence[CalibrationRun], whole: bool
) -> tuple[list[ZeroGroupReadings], NDArray[np.intp]]:
    """Units with a zero of their own: runs, split where the mount changes within one.

    Returns the units and the place of each of their readings among all readings of the
    runs. Angles are taken over turns unless ``whole`` (all orders are whole).
    """
    units, places, start = [], [], 0
    for number, (run, error) in enumerate(zip(runs, _centred(runs), strict=True)):
        label = run.label or str(number + 1)
        angle = (run if whole else over_turns(run)).reference
        weights = np.ones(len(run)) if run.weights is None else run.weights
        everything = ZeroGroupReadings(angle / run.period, error, weights, label)
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


def _centred(runs: Sequence[CalibrationRun]) -> Iterator[NDArray[np.float64]]:
    """Error of every run unfolded around its zero; of many short runs all at once."""
    sizes = np.array([len(run) for run in runs])
    if sizes.mean() > _SHORT or len({run.period for run in runs}) > 1:
        yield from (run.centred_error for run in runs)
        return
    period = runs[0].period
    error = np.concatenate([run.indicated for run in runs])
    error -= np.concatenate([run.reference for run in runs])
    ends = np.cumsum(sizes)
    vectors = np.add.reduceat(np.exp(error * (2j * math.pi / period)), ends - sizes)
    zero = np.repeat(wrap(np.angle(vectors) * (period / (2.0 * math.pi)), period), sizes)
    yield from np.split(zero + wrap(error - zero, period), ends[:-1])


def folds_of_run(unit: ZeroGroupReadings, positions: Positions) -> list[ZeroGroupReadings]:
    """Folds of a single run: blocks of neighbouring positions, dealt in turn."""
    blocks = min(_BLOCKS, len(positions) // 2)
    folds = min(_FOLDS, blocks)
    if folds < 2:
        return []
    fold = (positions.index * blocks // len(positions)) % folds
    return [unit.part(fold == f, f"block {f + 1}") for f in range(folds)]


def passes_of_run(unit: ZeroGroupReadings, path: Array) -> list[ZeroGroupReadings]:
    """Whole turns that a run took one after the other, to and fro too; none where it took one.

    Of more than 32 as many are taken together.

    ``path`` are the angles of its readings in turns, in the order they were read. Where readings
    are left out between them a new pass begins.
    """
    if path.size < 3:
        return []
    steps = np.abs(np.diff(path))
    far = steps > _STEP
    if far.mean() > _STEP:
        return []
    way = np.concatenate([[0.0], np.cumsum(steps)])
    part = np.concatenate([[0], np.cumsum(far)])
    starts = way[np.searchsorted(part, np.arange(part[-1] + 1))]
    # Of many turns several are taken together.
    turns = max(1.0, math.ceil(way[-1] / _PASSES))
    number = np.floor((way - starts[part] + _HALF / path.size) / turns)
    first = np.flatnonzero(np.concatenate([[True], (np.diff(number) != 0.0) | far]))
    found: list[ZeroGroupReadings] = []
    for begin, end in pairwise([*first.tolist(), path.size]):
        if way[end - 1] - way[begin] >= _HALF:
            found.append(unit.part(slice(begin, end), f"pass {len(found) + 1}"))
    return found if len(found) > 1 else []
