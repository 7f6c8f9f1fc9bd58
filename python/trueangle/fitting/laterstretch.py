"""Would a later stretch of a run gain by what the rest says? An error that changes would not."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ..errors import NoModelError, TrueAngleError
from ..runs.run import CalibrationRun
from ..runs.travel import CONDITION, travelled_span
from .problem import Problem

__all__ = ["check_later_stretch", "gains_of_stretches"]

Array = NDArray[np.float64]

#: Stretches of the run, in the order of its readings, that are left out one by one.
_STRETCHES: Final = 4
#: Readings looked at: drawn at random, so that no grid is met.
_LOOKED_AT: Final = 24_000
#: Parts of a turn within which readings are of the same place.
_PLACES: Final = 120
#: Least share of the readings that must lie where other stretches were, and of one stretch.
_COVERED: Final = 0.1
_FEWEST: Final = 10
#: Travel, in turns, below which a run is taken to go on beyond it: a joint with stops moves
#: farther than a sixth of a turn, a telescope followed for an hour does not.
_SHORT: Final = 1.0 / 6.0
#: Standard deviations between stretches by which the mean gain must exceed nothing.
_SURE: Final = 1.0


def check_later_stretch(problem: Problem, weights: Sequence[Array | None]) -> None:
    """Raise where orders selected by evidence do not hold from one stretch of a run to the next.

    The mean gain of the stretches (`gains_of_stretches`) must exceed one standard deviation
    between them. A place passed once says nothing, unless the whole travel is short.

    Raises
    ------
    NoModelError
        What the other stretches say makes them worse, or some of them as much as it helps others.
    """
    gains = gains_of_stretches(problem, weights)
    if gains is None or gains.min() > 0.0 or gains.mean() > _SURE * gains.std(ddof=1):
        return
    orders = [k * s.cycles_per_turn for s in problem.shafts for k in s.orders]
    listed = ", ".join(f"{order:g}" for order in orders[:6]) + (" ..." if orders[6:] else "")
    raise NoModelError(
        f"no correction can be given: what the rest of the run indicates of order {listed} would "
        f"make the error of {int(np.count_nonzero(gains <= 0.0))} of {gains.size} segments of it "
        "larger, and that of the others unevenly smaller; the error is not one of the angle alone: "
        'run `ta.diagnose(...)`, take out what is not the pattern (`nuisance="auto"`), or '
        "declare the `orders=` or the `shafts=`"
    )


def gains_of_stretches(problem: Problem, weights: Sequence[Array | None]) -> Array | None:
    """Decrease of the mean square of each quarter of a run by a fit to the rest of it.

    Looked at are readings at places (3 deg) where the rest of the run was as well; all of them
    where the travel is short, because the next stretch lies beyond it. None for several runs,
    and where too few readings can say.
    """
    if len(problem.runs) != 1:
        return None
    run, weight = problem.runs[0], weights[0]
    rows = np.arange(len(run)) if weight is None else np.flatnonzero(weight > 0.0)
    if rows.size > _LOOKED_AT:
        rng = np.random.default_rng(0)
        rows = np.sort(rng.choice(rows, _LOOKED_AT, replace=False))
    angle = problem.angles[0][rows]
    if not problem.is_periodic or rows.size < _STRETCHES * _FEWEST:
        return None
    short = float(np.ptp(run.unwrapped_reference)) < _SHORT * problem.period
    place = np.floor(angle / problem.period % 1.0 * _PLACES).astype(np.intp) % _PLACES
    gains, looked_at = [], 0
    for held in np.array_split(np.arange(rows.size), _STRETCHES):
        rest = np.delete(np.arange(rows.size), held)
        if not short:
            held = held[np.isin(place[held], place[rest])]
        if held.size < _FEWEST:
            continue
        looked_at += held.size
        try:
            left = _left(problem, rows[rest], rows[held])
        except TrueAngleError:
            gains.append(0.0)
            continue
        error = run.centred_error[rows[held]]
        gains.append(float(error.var() - left.var()))
    if len(gains) < 2 or looked_at < _COVERED * rows.size:
        return None
    return np.array(gains)


def _left(problem: Problem, kept: NDArray[np.intp], held: NDArray[np.intp]) -> Array:
    """Error of the readings held out less what a fit to those kept says."""
    run = problem.runs[0]
    mine = CalibrationRun(
        run.reference[kept],
        run.indicated[kept],
        run.period,
        weights=None if run.weights is None else run.weights[kept],
    )
    part = Problem([mine], problem.shafts, problem.argument)
    fitted = part.solve(part.base)
    span = travelled_span(part.angles, part.period, part.is_periodic)
    if not span.full and fitted.solution.condition_number >= CONDITION:
        from .ridge import choose_ridge

        fitted = part.solve(part.base, choose_ridge(part, part.base))
    return np.asarray(run.centred_error[held] - fitted.predict(problem.angles[0][held]))
