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
    grid = uniform_grid(theta)
    table = 0 if grid is None else grid.positions
    # At even places, values that all lie one step apart lie on any lattice of that step.
    even = grid is not None and np.diff(values).max(initial=0.0) < 1.5 * step
    if move or even or abs(step * table - 1.0) < CLOSES * step:
        step = finer_step(values, step)
    step = step or finer_step(values)
    true = theta / (2.0 * np.pi)
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
    steps = np.diff(distinct(values))
    rounding = LEAST_STEP * float(np.abs(values).max(initial=1.0))
    steps = steps[steps > rounding]
    if steps.size < 3:
        return 0.0
    step = float(steps.min())
    # The finest difference may be several counts: the step is then a whole part of it.
    for parts in (1, 2, 3):
        away = steps * (parts / step)
        if np.abs(away - np.round(away)).max() < ON_LATTICE:
            return step / parts
    return 0.0


def even_rate(runs: Sequence[NDArray[np.float64]]) -> float:
    """Equal steps in a turn that all runs keep to, each from its own start; 0 for none.

    There, a line whose phase is new in every run has the same values as one whose order is higher
    or lower by this rate, whether the steps close after a turn or not.

    ``runs`` are the angles of each run, in turns.

    Examples
    --------
    >>> round(even_rate([np.arange(20) * 0.8 / 98.0, 0.3 - np.arange(30) * 0.8 / 98.0]), 6)
    122.5
    >>> even_rate([np.array([0.0, 0.11, 0.43, 0.5, 0.58])])
    0.0
    """
    step = lattice_step(np.concatenate([run - run[0] for run in runs]))
    return 1.0 / step if step > 0.0 else 0.0


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
    moves = np.diff(distinct(values))
    rounding = LEAST_STEP * float(np.abs(values).max(initial=1.0))
    moves = moves[moves > rounding]
    some = distinct(moves[:: max(1, moves.size // STEPS_TRIED)])
    tried = distinct(np.concatenate([some, np.diff(some)]))
    tried = tried[(tried > rounding) & (tried < 0.5 * below)][::-1]
    # Most of them miss one of the first moves already.
    # Most steps are tried on the first moves.
    near = tried[_aways(some[:8], tried) < ON_LATTICE]
    aways = _aways(some, near)
    for k in np.flatnonzero(aways < ON_LATTICE).tolist():
        step, away = float(near[k]), float(aways[k])
        told = distinct(np.round(some / step)).size - 1
        # That each further move is a whole number of counts, as near as they all are.
        if tried.size * (2.0 * away) ** told < BY_CHANCE:
            off = np.abs(moves / step - np.round(moves / step)).max()
            return step if off < ON_LATTICE else 0.0
    return 0.0


def _aways(moves: NDArray[np.float64], steps: NDArray[np.float64]) -> NDArray[np.float64]:
    """Largest departure of the moves from multiples of each step, in steps."""
    counts = moves / steps[:, None]
    return np.asarray(np.abs(counts - np.round(counts)).max(axis=1, initial=0.0))


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
    cells = round(1.0 / digit) if digit > 0.0 else 0
    if not 0 < cells <= MOST_CELLS or abs(cells * digit - 1.0) > LEAST_STEP:
        return 0.0
    places = distinct(np.mod(np.round(values * cells).astype(np.int64), cells))
    marks = np.zeros(cells)
    marks[places] = 1.0
    coherence = np.abs(np.fft.rfft(marks)) / places.size
    counts = np.arange(coherence.size)
    possible = (counts * float(np.ptp(values)) > LEAST_STEPS) & (counts * digit < WIDEST_CELL)
    possible &= cells * np.exp(-places.size * coherence**2) < BY_CHANCE
    told = np.where(possible, coherence / np.sinc(counts * digit), 0.0)
    top, lattices = int(np.argmax(told)), np.flatnonzero(told > ON_COUNTS)
    # Its multiples are as coherent as a lattice; on even places aliases nearly are.
    count = min((c for c in lattices.tolist() if top % c == 0), default=0)
    if not count or (np.flatnonzero(told > told[count] - ALIKE) % count).any():
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
