"""What a set of positions can separate: distinct positions, folded orders, closure errors.

On N equispaced positions the orders m and k are one column of numbers wherever
``m = k`` or ``m = -k`` modulo N: a tooth mesh 202 times per turn, read every 10
degrees, is an order 14 that repeats perfectly.
"""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError
from ..support.angles import power_sums
from ..support.arrays import Array, median
from .run import CalibrationRun, as_runs

#: Positions closer than this (turns) count as one: 0.01 degree, which turns the phase
#: of order 202 by 2 degrees, so that no order of interest depends on the difference.
POSITION_TOLERANCE: Final = 1.0 / 36_000.0


#: Up to this many positions their spectrum is summed exactly, beyond by a histogram.
_BLOCK: Final = 1 << 18
_CELLS: Final = 1 << 16


@dataclass(frozen=True, eq=False)
class Positions:
    """Distinct positions of some readings modulo a turn.

    Attributes
    ----------
    turns : ndarray, shape (p,)
        Distinct positions in turns, ascending in [0, 1).
    index : ndarray of int, shape (n,)
        Position of each reading, the runs one after the other.
    divisions : int or None
        The greatest N such that the positions are uniform grids of N, each shifted;
        None when there is no such N (free angles, part of a turn).
    offsets : tuple of float
        Shift of each of these grids in turns, in [0, 1/N).
    """

    turns: Array
    index: NDArray[np.intp]
    divisions: int | None
    offsets: tuple[float, ...]

    def __len__(self) -> int:
        return int(self.turns.size)

    @property
    def span(self) -> float:
        """Part of the turn that is covered: 1, or less where an arc was not travelled."""
        gaps = np.diff(self.turns, append=self.turns[0] + 1.0)
        largest = float(gaps.max())
        # A gap counts as missing travel when wider than this part of a turn (20 deg) and than three
        # usual ones.
        return 1.0 if largest <= max(20.0 / 360.0, 3.0 * float(median(gaps))) else 1.0 - largest

    def of_rows(self, rows: NDArray[np.intp]) -> Positions:
        """The same positions for the readings in another order, or for some of them."""
        return replace(self, index=self.index[rows])

    def spectrum(self, highest: int) -> Array:
        """``|mean exp(2 pi i m t)|`` for m = 0 .. highest, by a histogram for many t."""
        # Of more positions a histogram serves.
        if len(self) > 4096:
            cells = (self.turns * _CELLS).astype(np.int64) % _CELLS
            counts = np.bincount(cells, minlength=_CELLS)
            return np.asarray(np.abs(np.fft.rfft(counts))[: highest + 1] / len(self))
        sums = power_sums(self.turns, np.ones((len(self), 1)), highest + 1)
        return np.asarray(np.abs(sums[:, 0]) / len(self))

    @property
    def highest_order(self) -> int:
        """Highest order below the Nyquist limit of the positions (17 for 36 of them).

        For several shifted grids the limit of one grid: beyond it the mounts together
        separate only orders that are named.
        """
        count = self.divisions if self.divisions is not None else len(self)
        return max(0, (count - 1) // 2)

    def has_alias(self, highest: int) -> bool:
        """Whether orders up to ``highest`` that are not neighbours are identical at the positions.

        Over part of a turn neighbours always are: they are distinguished from aliases by the width
        of their coherence.

        Examples
        --------
        >>> run = CalibrationRun(np.arange(36) * 10.0, np.arange(36) * 10.0, period=360.0)
        >>> distinct_positions(run).has_alias(35), distinct_positions(run).has_alias(36)
        (False, True)
        """
        first = math.ceil(1.0 / self.span)
        return bool(may_pass(self.turns, max(highest, first))[first:].any())

    def describe(self) -> str:
        """The positions in words, as in ``36 positions, 10 deg apart``."""
        count = f"{len(self)} distinct position{'s' if len(self) != 1 else ''}"
        if self.divisions is None:
            part = "" if self.span == 1.0 else f" over {360.0 * self.span:.0f} deg"
            return count + part
        pitch = f"{360.0 / self.divisions:g} deg"
        if len(self.offsets) == 1:
            return f"{count}, {pitch} apart"
        shifts = ", ".join(f"{360.0 * (o - self.offsets[0]):.4g}" for o in self.offsets)
        return f"{count}: {len(self.offsets)} grids of {pitch}, shifted by {shifts} deg"


def may_pass(turns: Array, highest: int) -> NDArray[np.bool_]:
    """Whether orders m apart may pass for one another at places, for m = 0 to ``highest``.

    ::

        |mean exp(2πi m t)| > 1/2
    """
    # Cells of a turn for each order: within one it turns by a fifth of a radian at most.
    cells = 1 << int(32 * highest).bit_length()
    counts = np.bincount((turns * cells).astype(np.int64) % cells, minlength=cells)
    return np.asarray(2.0 * np.abs(np.fft.rfft(counts)[: highest + 1]) > turns.size)


def distinct_positions(
    runs: CalibrationRun | Iterable[CalibrationRun], tolerance: float | None = None
) -> Positions:
    """Distinct reference angles of all runs modulo a turn.

    0 and 360 degrees are one position, and so are repeats: they add no rank, only
    knowledge of the noise and a check of closure.

    Parameters
    ----------
    runs : CalibrationRun or iterable of them
    tolerance : float, optional
        Angles closer than this count as one, in the unit of the runs; a cluster is never wider
        than it. Default: 0.01 degree (`POSITION_TOLERANCE`), and up to 0.028 degree, where
        order 404 turns by 0.2 radians, between clearly separate places.

    Returns
    -------
    Positions

    Examples
    --------
    >>> run = CalibrationRun([0.0, 90.0, 180.0, 270.0, 360.0], [0.0] * 5, period=360.0)
    >>> distinct_positions(run).describe()
    '4 distinct positions, 90 deg apart'
    """
    found = as_runs(runs)
    period = found[0].period
    width = POSITION_TOLERANCE if tolerance is None else tolerance / period
    if not 0.0 < width < 0.5:
        raise ArgumentError(f"tolerance must lie between 0 and half a turn, got {tolerance!r}")
    turns = np.concatenate([run.reference for run in found]) / period
    order, unrolled, cluster = _sorted_clusters(turns, None if tolerance is None else width)
    count = np.bincount(cluster)
    place = np.bincount(cluster, weights=unrolled) / count
    place -= np.floor(place)
    # Means like 1 - 1e-17 belong to 0.
    place[place > 1.0 - 1e-12] = 0.0
    rank = np.empty(place.size, dtype=np.intp)
    ascent = np.argsort(place, kind="stable")
    rank[ascent] = np.arange(place.size)
    index = np.empty(turns.size, dtype=np.intp)
    index[order] = rank[cluster]
    distinct = place[ascent]
    divisions, offsets = _grids(distinct, width)
    return Positions(distinct, index, divisions, offsets)


def count_positions(turns: Array) -> int:
    """Number of distinct positions of angles in turns, modulo a turn.

    Examples
    --------
    >>> count_positions(np.array([0.0, 0.25, 0.5, 1.0, 1.25]))
    3
    """
    return int(_sorted_clusters(turns, None)[2][-1]) + 1


def _sorted_clusters(
    turns: Array, width: float | None
) -> tuple[NDArray[np.intp], Array, NDArray[np.intp]]:
    """Order in which angles ascend, the angles in it, and the cluster of each."""
    turns = turns - np.floor(turns)
    order = np.argsort(turns, kind="stable")
    ascending = turns[order]
    # Begin behind the largest gap: no cluster is then cut at 0 = 1 without need.
    gaps = np.diff(ascending, append=ascending[0] + 1.0)
    first = (int(np.argmax(gaps)) + 1) % ascending.size
    order = np.roll(order, -first)
    unrolled = np.roll(ascending, -first)
    unrolled[ascending.size - first :] += 1.0
    cluster = _places(unrolled) if width is None else None
    if cluster is None:
        cluster = _clusters(unrolled, POSITION_TOLERANCE if width is None else width)
    return order, unrolled, cluster


def closure_errors(
    runs: CalibrationRun | Iterable[CalibrationRun], tolerance: float | None = None
) -> Array:
    """Closure error of each run that ends at its first position after whole turns.

    Drift, slip or a lost count within a run show here. A small closure error does not exclude
    them at other places. Runs that do not end where they began have no entry.

    Returns
    -------
    ndarray
        Error of the last reading less that of the first, unit of the runs.

    Examples
    --------
    >>> run = CalibrationRun([0.0, 120.0, 240.0, 360.0], [0.0, 120.0, 240.0, 360.1], 360.0)
    >>> closure_errors(run).round(9)
    array([0.1])
    """
    found = []
    for run in as_runs(runs):
        # Readings that a turn takes at least, in steps below half of it.
        if len(run) < 3:
            continue
        width = run.period * POSITION_TOLERANCE if tolerance is None else tolerance
        reference = run.unwrapped_reference
        travel = reference[-1] - reference[0]
        turns = round(float(travel / run.period))
        if turns and abs(travel - turns * run.period) <= width:
            error = run.centred_error
            found.append(float(error[-1] - error[0]))
    return np.array(found, dtype=np.float64)


def _places(ascending: Array) -> NDArray[np.intp] | None:
    """Clearly separate clusters, none so wide that an order varies within it; or None."""
    # Highest order that is named as an alias where no gear is declared, and the phase by which it
    # may turn within a place.
    width = 0.2 / (2.0 * math.pi * 404)
    gaps = np.diff(ascending)
    starts = gaps > width
    if starts.all() or not starts.any():
        return None
    bounds = np.flatnonzero(starts)
    first = ascending[np.append(0, bounds + 1)]
    last = ascending[np.append(bounds, ascending.size - 1)]
    widest = float((last - first).max())
    # Places visited again lie nearer to each other than to the next, by this factor.
    if widest > width or float(gaps[bounds].min()) < 5.0 * widest:
        return None
    return np.concatenate([[0], np.cumsum(starts)]).astype(np.intp)


def _clusters(ascending: Array, width: float) -> NDArray[np.intp]:
    """Number of the cluster of each of the ascending angles; none wider than ``width``."""
    starts = np.diff(ascending, prepend=-math.inf) > width
    cluster = np.cumsum(starts) - 1
    first = ascending[np.flatnonzero(starts)]
    last = ascending[np.append(np.flatnonzero(starts)[1:] - 1, ascending.size - 1)]
    if (last - first <= width).all():
        return np.asarray(cluster, dtype=np.intp)
    # Dense angles chain together: cut each chain in cells of the width.
    cell = np.floor((ascending - first[cluster]) / width).astype(np.int64)
    new = (np.diff(cell, prepend=-1) != 0) | starts
    return np.asarray(np.cumsum(new) - 1, dtype=np.intp)


def _grids(turns: Array, width: float) -> tuple[int | None, tuple[float, ...]]:
    """Divisions and offsets of the uniform grids that make up the positions."""
    # Most shifted uniform grids that a union of mounts is searched for.
    for grids in range(1, min(24, turns.size // 2) + 1):
        if turns.size % grids:
            continue
        divisions = turns.size // grids
        step = np.roll(turns, -grids) - turns
        step -= np.floor(step)
        # Each end of a step is the mean of a cluster and may be off by its width.
        if divisions > 2 and np.abs(step - 1.0 / divisions).max() <= 2.0 * width:
            # A dense log is not a grid: its neighbours are as close as the tolerance.
            if 1.0 / turns.size <= 2.0 * width:
                return None, ()
            pitch = 1.0 / divisions
            return divisions, tuple(float(o) for o in turns[:grids] % pitch)
    return None, ()


def fold(order: int, divisions: int) -> tuple[int, int]:
    """Order at which ``order`` appears on ``divisions`` equispaced positions, and sign.

    ``|((m + N/2) mod N) - N/2|``; sign +1 where the phase is kept, -1 where it becomes
    180 degrees minus the phase.

    Examples
    --------
    >>> fold(202, 36), fold(300, 36), fold(1, 36)
    ((14, -1), (12, 1), (1, 1))
    """
    rest = order % divisions
    return (rest, 1) if 2 * rest <= divisions else (divisions - rest, -1)


def position_coherence(
    positions: Positions, order: float, others: Sequence[float] | Array
) -> Array:
    """How collinear ``order`` and each of ``others`` are at these positions, 0 to 1.

    ::

        max_± |Σ_p e^(2π i (m ± k) t_p)| / P

    1 means that no reading at these positions separates them: they are aliases.
    """
    m = np.asarray(others, dtype=np.float64)
    down, up = np.abs(m - order), m + order
    whole = float(order).is_integer() and (m == np.round(m)).all()
    if not whole or up.max(initial=0.0) >= _CELLS // 4:
        return np.maximum(_spectrum(positions.turns, down), _spectrum(positions.turns, up))
    # Rounded up, so that the orders of one selection share one spectrum.
    spectrum = _cached_spectrum(positions, 1 << int(up.max(initial=0.0)).bit_length())
    return np.maximum(spectrum[down.astype(np.int64)], spectrum[up.astype(np.int64)])


@lru_cache(maxsize=8)
def _cached_spectrum(positions: Positions, highest: int) -> Array:
    return positions.spectrum(highest)


def _spectrum(turns: Array, orders: Array) -> Array:
    """``|mean exp(2 pi i m t)|`` for each m."""
    return np.array([abs(np.exp(2j * math.pi * m * turns).mean()) for m in orders])


def energy_near_nyquist(
    orders: Sequence[float], amplitudes: Sequence[float], highest: int
) -> float:
    """Share of the energy in the upper half of the orders ``1 .. highest``.

    A spectrum that does not fall towards its end is the mark of under-sampling: the
    paper's joints hold 74 % and 31 % there.
    """
    power = np.asarray(amplitudes, dtype=np.float64) ** 2
    total = float(power.sum())
    upper = np.asarray(orders, dtype=np.float64) >= 0.5 * (highest + 1)
    return float(power[upper].sum()) / total if total > 0.0 else 0.0
