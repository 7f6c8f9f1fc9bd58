"""Lattices that readings lie on: counts of a sensor, digits that were cut off, steps of a table."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..runs.aliasing import count_positions
from ..runs.run import CalibrationRun
from ..support.angles import ARCSEC_PER_TURN
from ..support.arrays import Array, distinct

#: Positions beyond which a grid is not looked for.
MOST_POSITIONS = 10_000

#: Positions that part of a grid has at least, and share of those between its ends.
LEAST_OF_ARC, FILLED = 6, 0.5


@dataclass(frozen=True)
class UniformGrid:
    """Equal steps of one turn."""

    positions: int

    def folded(self, order: float) -> float:
        """The lowest order with the same values at the positions.

        Examples
        --------
        >>> UniformGrid(36).folded(202)
        14
        """
        return folded_order(order, self.positions)

    def aliases(self, order: float, count: int) -> list[float]:
        """Further orders with the same values, ascending."""
        return aliases_of(order, self.positions, count)


def folded_order(order: float, rate: float) -> float:
    """The lowest order with the same values at ``rate`` equal steps a turn."""
    rest = order % rate
    return min(rest, rate - rest)


def aliases_of(order: float, rate: float, count: int) -> list[float]:
    """Further orders with the same values, ascending."""
    low = folded_order(order, rate)
    found = sorted({abs(s * low + k * rate) for k in range(count + 2) for s in (1, -1)})
    return [m for m in found if m != order][:count]


def uniform_grid(theta: NDArray[np.float64]) -> UniformGrid | None:
    """The uniform grid that all angles (radians) lie on, or None.

    Equal steps that close after a turn, or an arc of them, with gaps allowed: at a polygon's places
    the same orders are collinear wherever the joint stops.

    Examples
    --------
    >>> uniform_grid(np.radians(np.arange(40.0, 240.0, 10.0)))
    UniformGrid(positions=36)
    >>> uniform_grid(np.radians([3.0, 41.0, 77.0, 122.0])) is None
    True
    """
    turns = np.sort(np.mod(theta / (2.0 * np.pi), 1.0))
    # Positions are groups of angles closer than the finest grid looked for.
    gaps = np.diff(np.append(turns, turns[0] + 1.0))
    steps = gaps[gaps > 0.2 / MOST_POSITIONS]
    if not 3 <= steps.size <= MOST_POSITIONS:
        return None
    if _lies_on(turns, steps.size):
        return UniformGrid(steps.size)
    # Readings cut to a last digit lie on a lattice too: what is filled by half is a design.
    positions = round(1.0 / float(steps.min()))
    on_arc = positions * (1.0 - float(steps.max())) + 1.0
    filled = LEAST_OF_ARC <= steps.size >= FILLED * on_arc
    if filled and positions <= MOST_POSITIONS and _lies_on(turns, positions):
        return UniformGrid(positions)
    return None


def _lies_on(turns: NDArray[np.float64], positions: int) -> bool:
    """Whether all places, in turns, lie on a grid of ``positions`` equal steps."""
    shift = np.angle(np.mean(np.exp(2j * np.pi * positions * turns))) / (2.0 * np.pi)
    away = turns * positions - shift
    # Departure from the grid, in shares of its step, up to which readings lie on it.
    return float(np.abs(away - np.round(away)).max()) < 0.02


#: Departure of differences from a lattice, in shares of its step; differences below this
#: share of the largest value are the rounding of sums.
ON_LATTICE = 0.05
LEAST_STEP = 1e-9

#: Probability below which moves do not lie on a finer lattice by chance, and steps tried in the
#: search for it.
BY_CHANCE, STEPS_TRIED = 1e-3, 200


#: Cells of a turn beyond which digits that were cut off are not looked behind, steps within the
#: travel from which on they are a lattice, and share of one that a cell may be.
MOST_CELLS, LEAST_STEPS, WIDEST_CELL = 400_000, 20, 0.3

#: Coherence of readings on a lattice, in shares of what cutting their digits off leaves of it; that
#: of the true positions from which on it is the design's.
ON_COUNTS, OF_DESIGN = 0.97, 0.5

#: Difference of coherences that readings cannot resolve.
ALIKE = 0.004

#: Share of the moves from reading to reading that stay where they are, as at turning points, or
#: omit positions, up to which readings are a table: a sensor that rounds repeats its counts.
LINGERS = 0.05

#: Share of a step by which the steps of a table may miss to fill a turn, as rounded angles do.
CLOSES = 0.25


def sensor_lattice(runs: Sequence[CalibrationRun], theta: Array) -> tuple[float, int]:
    """Count of the sensor in arcsec and positions of a table in a turn; of each 0 where none.

    A table shows in the moves of the indicated angles, or in the true ones (radians), in any order.
    """
    turns = [run.indicated / run.period for run in runs]
    values = distinct(np.concatenate(turns))
    step = lattice_step(values)
    move = table_move(turns, step)
    if move and abs(1.0 / move - round(1.0 / move)) < CLOSES:
        return finer_step(values, step) * ARCSEC_PER_TURN, round(1.0 / move)
    grid, true = uniform_grid(theta), theta / (2.0 * np.pi)
    table = 0 if grid is None else grid.positions
    # At even places, values that all lie one step apart lie on any lattice of that step.
    if move or (grid is not None and np.diff(values).max(initial=0.0) < 1.5 * step):
        step = finer_step(values, step)
    step = step or finer_step(values)
    if is_of_design(np.concatenate(turns), true, step):
        step = finer_step(values, step)
    return (step_behind(values, true, step) or step) * ARCSEC_PER_TURN, table


def lattice_step(values: NDArray[np.float64]) -> float:
    """Step of the lattice that all values lie on; 0 where they lie on none.

    Examples
    --------
    >>> lattice_step(np.array([0.5, 1.25, 3.0, 2.5]))
    0.25
    >>> lattice_step(np.array([0.5, 1.25, 3.0, 2.6]))
    0.0
    """
    moves = _moves(values)
    if moves.size < 3:
        return 0.0
    # The finest difference may be several counts: the step is then a whole part of it.
    tried, _ = _refined(_some_of(moves), float(moves.min()) / np.array([1.0, 2.0, 3.0]))
    return next((step for step in (_shared(moves, s) for s in tried.tolist()) if step), 0.0)


def _moves(values: NDArray[np.float64]) -> NDArray[np.float64]:
    """Moves from each value to the next, but those that are the rounding of sums."""
    moves = np.diff(distinct(values))
    return moves[moves > LEAST_STEP * float(np.abs(values).max(initial=1.0))]


def _some_of(moves: NDArray[np.float64]) -> NDArray[np.float64]:
    """Moves that steps are tried on, ascending."""
    return distinct(moves[:: max(1, moves.size // STEPS_TRIED)])


def _refined(moves: Array, steps: Array) -> tuple[Array, Array]:
    """Steps by least squares over the counts of moves, short ones first: each a longer rule.

    A last digit that was cut off hides a small share of many counts and a large one of a single.
    With them, by how much of each step the moves are no multiples of it at most.
    """
    along, counted, found = np.zeros_like(steps), np.zeros_like(steps), steps
    for move in moves.tolist():
        counts = np.round(move / found)
        along, counted = along + move * counts, counted + counts * counts
        found = np.divide(along, counted, out=steps.copy(), where=counted > 0.0)
    counts = moves / found[:, None]
    return found, np.abs(counts - np.round(counts)).max(axis=1, initial=0.0)


def _shared(moves: NDArray[np.float64], step: float) -> float:
    """The step, known better over all moves from value to value; 0 where they do not keep it."""
    places, counts = np.cumsum(moves), np.cumsum(np.round(moves / step))
    step = float(places[-1] / counts[-1])
    return step if np.ptp(places / step - counts) < ON_LATTICE else 0.0


def finer_step(values: NDArray[np.float64], below: float = np.inf) -> float:
    """Step of the lattice that all values lie on to their last digit; 0 where there is none.

    At places of equal steps all counts of a sensor lie near a lattice of those steps, and the
    differences between moves from count to count give the step: 113 and 114 are not both
    multiples of 113.

    Parameters
    ----------
    values : ndarray
    below : float
        Step of a design, which is none of the sensor's.

    Examples
    --------
    >>> places = np.arange(36) / 36.0
    >>> counts = np.round(4096 * places) / 4096
    >>> 1.0 / finer_step(counts, 1.0 / 36.0)
    4096.0
    >>> finer_step(places, 1.0 / 36.0)
    0.0
    """
    some = _some_of(moves := _moves(values))
    tried = distinct(np.concatenate([some, _moves(some)]))
    # Most of them miss one of the first moves already.
    near, aways = _refined(some[:8], tried[(tried < 0.5 * below)][::-1])
    near, aways = _refined(some, near[aways < ON_LATTICE])
    for k in np.flatnonzero(aways < ON_LATTICE).tolist():
        told = distinct(np.round(some / near[k])).size - 1
        # That each further move is a whole number of counts, as near as they all are.
        if tried.size * (2.0 * aways[k]) ** told < BY_CHANCE:
            return _shared(moves, near[k])
    return 0.0


def is_of_design(values: NDArray[np.float64], true: NDArray[np.float64], step: float) -> bool:
    """Whether readings lie on a lattice because the places do: no error is as large as a step.

    Parameters
    ----------
    values, true : ndarray
        Readings and true angles, turns.
    step : float
        Of the lattice that the readings lie near, turns.

    Examples
    --------
    >>> places = np.sort(np.append(np.arange(36) / 36.0, np.arange(36) / 36.0 + 1.0 / 180.0))
    >>> is_of_design(places + 1e-5 * np.sin(np.arange(72)), places, 1.0 / 180.0)
    True
    >>> is_of_design(np.round(places * 180.0 + np.sin(np.arange(72))) / 180.0, places, 1.0 / 180.0)
    False
    """
    if step <= 0.0:
        return False
    phase = np.angle(np.mean(np.exp(2j * np.pi * true / step))) / (2.0 * np.pi)
    counts = true / step - phase
    error = values - true
    error = error - np.angle(np.mean(np.exp(2j * np.pi * error))) / (2.0 * np.pi)
    wrapped = (error - np.round(error)) / step
    return bool(
        np.abs(counts - np.round(counts)).max() < ON_LATTICE and np.abs(wrapped).max() < 0.5
    )


def step_behind(values: NDArray[np.float64], true: NDArray[np.float64], digit: float) -> float:
    """Step of the sensor whose readings were cut to a last digit; 0 where none shows.

    ::

        R(N) = |mean exp(2πi N v)| = sinc(N digit)

    for N counts in a turn; for other N, R is random with the tail ``exp(-n R²)``.

    Parameters
    ----------
    values, true : ndarray
        Readings and true angles, turns.
    digit : float
        Turns.

    Examples
    --------
    >>> places = np.arange(36) / 36.0 + 0.01 * np.sin(np.arange(36))
    >>> degrees = np.round(np.round(4096 * places) / 4096 * 360.0, 2)
    >>> 1.0 / step_behind(degrees / 360.0, np.arange(36) / 36.0, 0.01 / 360.0)
    4096.0
    """
    cells = round(1.0 / digit) if digit * MOST_CELLS > 1.0 else MOST_CELLS
    if abs(cells * digit - 1.0) > LEAST_STEP:
        cells = MOST_CELLS
        # Counts behind finer digits repeat their moves, of three cells and more.
        moves = (cell := np.round(np.diff(values) * cells))[cell > 0.0]
        near = np.count_nonzero(moves == 1.0) > LINGERS * moves.size
        if near or 10 * distinct(moves).size > 9 * moves.size:
            return 0.0
    digit = max(digit, 1.0 / cells)  # of finer digits the first are looked at
    places = distinct(np.mod(np.round(values * cells).astype(np.int64), cells))
    marks = np.bincount(places, minlength=cells)
    coherence = np.abs(np.fft.rfft(marks)) / places.size
    counts = np.flatnonzero(coherence**2 > np.log(cells / BY_CHANCE) / places.size)
    counts = counts[(counts * np.ptp(values) > LEAST_STEPS) & (counts * digit < WIDEST_CELL)]
    told = coherence[counts] / np.sinc(counts * digit)
    top = int(counts[np.argmax(coherence[counts])]) if counts.size else 0
    # Its multiples are as coherent as a lattice; on even places aliases nearly are.
    count = min((c for c in counts[told > ON_COUNTS].tolist() if top % c == 0), default=0)
    if not count or (counts[told > told[counts == count] - ALIKE] % count).any():
        return 0.0
    of_design = abs(np.exp(2j * np.pi * count * true).mean()) > OF_DESIGN
    # Even places read with a slope are even, too: one place in each of adjacent cells.
    seen = distinct(np.mod(np.round(values * count).astype(np.int64), count))
    adjacent = np.count_nonzero(np.diff(seen) == 1) >= (1.0 - LINGERS) * (seen.size - 1)
    of_design |= adjacent and count_positions(true) <= seen.size
    return 0.0 if of_design else 1.0 / count


def table_move(runs: Sequence[NDArray[np.float64]], step: float) -> float:
    """Move from each reading of a table of equal steps to the next, in turns; 0 for no table.

    If all readings are the same number of steps apart, the design placed them: such a lattice
    is no property of the sensor. A few positions may be missing.

    ``runs`` are the angles of each run and ``step`` that of their lattice (`lattice_step`), in
    turns.

    Examples
    --------
    >>> round(1.0 / table_move([np.arange(81) / 80.0], 1.0 / 80.0))
    80
    >>> table_move([np.array([0.0, 0.1, 0.4, 0.5])], 0.1)
    0.0
    """
    if step <= 0.0:
        return 0.0
    moves = np.concatenate([np.diff(run) for run in runs])
    moves = np.abs(moves - np.round(moves))
    counts = np.round(moves / step)
    moved = counts[counts > 0.0]
    if moved.size < max(3.0, (1.0 - LINGERS) * counts.size):
        return 0.0
    least = moved.min()
    gaps = moved > least
    if np.count_nonzero(gaps) > LINGERS * moved.size or (moved % least).any():
        return 0.0
    return float(least * moves[counts > 0.0].sum() / moved.sum())
