"""Groups of readings with a separate zero, and folds of a single run."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..._core import line_columns
from ...estimation.evidence import RunReadings
from ...runs.aliasing import Positions
from ...runs.run import CalibrationRun
from ...runs.travel import over_turns
from ...support.angles import wrap
from ...support.arrays import Array

#: Readings in a row that are kept together of many, and the turn by which they are chosen evenly.
_TOGETHER: Final = 256
_GOLDEN: Final = 0.5 * (math.sqrt(5.0) - 1.0)

#: Of more units, what is held out in turn are groups of them, dealt in turn.
MOST_UNITS: Final = 96
GROUPS: Final = 32

#: Readings from which orders are chosen; of more, some blocks are taken.
MOST_READINGS: Final = 8000


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
    time : ndarray, shape (n,), or None
    """

    turns: Array
    error: Array
    weights: Array
    label: str
    time: Array | None = None

    def given(self) -> RunReadings:
        """The same as the evidence takes it: angles in radians, no weights where all are 1."""
        return RunReadings(
            2.0 * math.pi * self.turns,
            self.error,
            None if self.time is None or self.time.size < 2 else self.time,
            None if (self.weights == 1.0).all() else self.weights,
        )

    def part(self, mask: NDArray[np.bool_] | slice, label: str) -> ZeroGroupReadings:
        """The readings where ``mask`` is true, or of a slice."""
        time = None if self.time is None else self.time[mask]
        return ZeroGroupReadings(
            self.turns[mask], self.error[mask], self.weights[mask], label, time
        )


def zero_groups(
    runs: Sequence[CalibrationRun], whole: bool
) -> tuple[list[ZeroGroupReadings], NDArray[np.intp]]:
    """Units with a separate zero: runs, split where the mount changes within one.

    Returns the units and the place of each of their readings among all readings of the
    runs. Angles are taken over turns unless ``whole`` (all orders are whole).
    """
    units, places, start = [], [], 0
    for number, (run, error) in enumerate(zip(runs, _centred(runs), strict=True)):
        label = run.label or str(number + 1)
        angle = (run if whole else over_turns(run)).reference
        weights = np.ones(len(run)) if run.weights is None else run.weights
        everything = ZeroGroupReadings(angle / run.period, error, weights, label, run.time)
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


def some_angles(angles: Sequence[Array], period: float) -> Array:
    """Angles of the readings in radians, some thousand of them."""
    every = np.concatenate(angles)
    # Angles that represent the travel.
    return np.asarray(2.0 * math.pi / period * np.sort(every)[:: 1 + every.size // 2000])


def some_readings(
    units: Sequence[ZeroGroupReadings], most: int = MOST_READINGS
) -> list[ZeroGroupReadings]:
    """About ``most`` of the readings, in blocks of consecutive ones spread over the record."""
    total = sum(unit.turns.size for unit in units)
    if total <= most:
        return list(units)
    found, block = [], 0
    for unit in units:
        size = unit.turns.size
        blocks = math.ceil(size / _TOGETHER)
        keep = (np.arange(block, block + blocks) * _GOLDEN) % 1.0 < most / total
        block += blocks
        mask = np.repeat(keep, _TOGETHER)[:size]
        if mask.any():
            time = np.arange(size, dtype=float) if unit.time is None else unit.time
            found.append(unit._replace(time=time).part(mask, unit.label))
    return found


def unit_columns(units: Sequence[ZeroGroupReadings], orders: Sequence[float]) -> list[Array]:
    """Cosine and sine of each order in turn, then the error: a row a reading, a part a unit.

    Less their weighted means in the unit, and times the roots of the weights, so that the products
    of the rows are normal equations with each unit's zero taken out. Of many units some are
    taken together in one part.
    """
    places = np.asarray(orders, dtype=np.float64)
    parts = []
    for unit in units:
        rows = np.empty((unit.turns.size, 2 * places.size + 1))
        rows[:, :-1] = line_columns(2.0 * math.pi * unit.turns, places)
        rows[:, -1] = unit.error
        rows -= unit.weights @ rows / unit.weights.sum()
        rows *= np.sqrt(unit.weights)[:, None]
        parts.append(rows)
    if len(parts) <= MOST_UNITS:
        return parts
    return [np.concatenate(parts[k::GROUPS]) for k in range(GROUPS)]


def _centred(runs: Sequence[CalibrationRun]) -> Iterator[NDArray[np.float64]]:
    """Error of every run unfolded around its zero; of many short runs all at once."""
    sizes = np.array([len(run) for run in runs])
    # Readings a run up to which the call of a function costs more than what it computes.
    if sizes.mean() > 1000 or len({run.period for run in runs}) > 1:
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
    blocks = min(24, len(positions) // 2)
    # Folds of a single run: whole blocks of neighbouring positions, dealt in turn.
    folds = min(6, blocks)
    if folds < 2:
        return []
    fold = (positions.index * blocks // len(positions)) % folds
    return [unit.part(fold == f, f"block {f + 1}") for f in range(folds)]
