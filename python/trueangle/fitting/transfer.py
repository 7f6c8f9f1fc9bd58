"""Whether what was found helps where it was not measured: in a further run, or later in one."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import TYPE_CHECKING, Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..errors import NoModelError, TrueAngleError
from ..estimation.linear import NormalEquations, left_out
from ..joint.shafts import ShaftOrders
from ..runs.run import CalibrationRun
from ..runs.travel import CONDITION, travelled_span
from ..support.arrays import Array
from ..support.display_units import brief_number
from ..support.distributions import student_quantile
from .problem import Problem

if TYPE_CHECKING:
    from .summed import SummedReadings

#: Readings looked at, and columns times readings: drawn at random, so that no grid is met.
_LOOKED_AT: Final = 24_000
_CELLS: Final = 8_000_000
#: Readings for each column of what is left of a run's own, at least.
_PER_COLUMN: Final = 2.0
#: Penalty relative to the mean of the diagonal: orders of partial travel nearly cancel.
_RIDGE: Final = 1e-6
#: Standard deviations between runs by which the mean gain must exceed nothing: of forty further
#: runs one may lose then. Runs of one joint have ten and more, those of unlike joints below 1.6.
_SURE: Final = 2.0
#: Orders in which runs may be unlike beside those wanted, and the part of what each shows that
#: they must share to count as alike. Of unlike runs some order agrees by chance: ...
_SHOWN: Final = tuple(range(1, 13))
_ALIKE: Final = 0.5
#: ... in so many of them the gain must be beyond it, at this level all together.
_SEARCHED: Final = 100
_CHANCE: Final = 0.05

#: Stretches of the run, in the order of its readings, that are left out one by one.
_STRETCHES: Final = 4
#: Parts of a turn within which readings are of the same place.
_PLACES: Final = 120
#: Least share of the readings that must lie where other stretches were, and of one stretch.
_COVERED: Final = 0.1
_FEWEST: Final = 10
#: Travel, in turns, below which a run is taken to go on beyond it: a joint with stops moves
#: farther than a sixth of a turn, a telescope followed for an hour does not.
_SHORT: Final = 1.0 / 6.0
#: Standard deviations between stretches by which the mean gain must exceed nothing.
_SURE_LATER: Final = 1.0


class _Gains(NamedTuple):
    """What a fit to the other runs does to each.

    Attributes
    ----------
    gains : ndarray
        Decrease of every run's mean square.
    noise : float
        Variance of the gains by the noise of the readings.
    shown : float
        Mean square that low orders and those wanted explain of each run by itself.
    shared : float
        Of that, what the other runs say of all these orders explains.
    """

    gains: Array
    noise: float
    shown: float
    shared: float


def check_new_run(
    runs: Sequence[CalibrationRun],
    wanted: Sequence[ShaftOrders],
    argument: str,
    summed: SummedReadings | None = None,
) -> None:
    """Raise where orders selected by evidence would not help a further run.

    With ``g_r`` the decrease of the mean square of run r by what the others say, it asks for

    ::

        ḡ > 2√(max(0, var g - mean(4σ_r² cᵀ G_r c/n_r²)))

    the scatter between runs beyond that of the noise. Where the runs share less than half of what
    each shows by itself in low orders, the mean gain must also exceed what chance makes of the
    order that agrees best among a hundred (Student's t, 5 %).

    Raises
    ------
    NoModelError
        The runs contradict each other: says in how many the error would be larger.
    """
    orders = [k * shaft.cycles_per_turn for shaft in wanted for k in shaft.orders]
    found = gains_of_runs(runs, orders, argument, summed)
    if found is None:
        return
    gains, noise, shown, shared = found
    mean, scatter = float(gains.mean()), float(gains.std(ddof=1))
    listed = _listed(orders)
    remedy = "they seem to be of different joints: fit each by itself, or declare the `orders=`"
    if mean <= _SURE * np.sqrt(max(0.0, scatter**2 - noise)):
        worse = int(np.count_nonzero(gains < 0.0))
        raise NoModelError(
            f"no correction can be given: what the other runs indicate of order {listed} would "
            f"make the error of {worse} of {len(gains)} runs larger, and that of the rest unevenly "
            f"smaller; {remedy}"
        )
    bound = student_quantile(1.0 - _CHANCE / _SEARCHED, len(runs) - 1) / np.sqrt(len(runs))
    if max(mean, shared) < _ALIKE * shown and mean <= bound * scatter:
        raise NoModelError(
            "no correction can be given: of what the runs show they share "
            f"{brief_number(100 * mean / shown)} % (order {listed}), no more than {len(runs)} runs "
            "that share nothing may by chance; "
            f"{remedy}"
        )


def gains_of_runs(
    runs: Sequence[CalibrationRun],
    orders: Sequence[float],
    argument: str,
    summed: SummedReadings | None = None,
) -> _Gains | None:
    """Decrease of every run's mean square by a fit to the others, and what noise makes of it.

    None where a run alone, or too few readings, cannot say.
    """
    columns = 2 * len(orders)
    total = sum(map(len, runs)) if summed is None else summed.moments.count
    share = min(1.0, _LOOKED_AT / total, _CELLS / (columns * total))
    if len(runs) < 2 or share * total < _PER_COLUMN * columns * len(runs):
        return None
    every = np.array([*orders, *(k for k in _SHOWN if k not in orders)])
    wanted = np.repeat([np.arange(every.size) < len(orders)], 2, axis=0).ravel()
    wholes: list[NormalEquations] = []
    parts = (
        _looked_at(runs, every, argument, share) if summed is None else summed.parts(every, share)
    )
    shown = []
    for whole in parts:
        if whole.readings < 2:
            return None
        wholes.append(whole)
        by_chance = 2.0 * every.size / whole.readings
        own = _explained(whole)
        shown.append(max(0.0, own - by_chance * max(0.0, whole.squares - own)) / whole.readings)
    sizes = np.array([whole.readings for whole in wholes])
    squares = np.array([whole.squares for whole in wholes])
    sums = [whole.among(wanted) for whole in wholes]
    others, left = left_out(sums, _RIDGE)
    power = np.array([float(b @ one.gram @ b) for b, one in zip(others, sums, strict=True)])
    alone = np.array([max(0.0, one.squares - _explained(one)) for one in sums])
    shared = float(np.mean((squares - left_out(wholes, _RIDGE)[1]) / sizes))
    noise = float(np.mean(4.0 * alone * power / sizes**3))
    return _Gains((squares - left) / sizes, noise, float(np.mean(shown)), shared)


def _looked_at(
    runs: Sequence[CalibrationRun], orders: Array, argument: str, share: float
) -> Iterator[NormalEquations]:
    """Of a share of every run's readings about their mean."""
    rng = np.random.default_rng(0)
    for run in runs:
        keep: Any = slice(None) if share == 1.0 else np.flatnonzero(rng.random(len(run)) < share)
        x = (2.0 * np.pi / run.period * getattr(run, argument))[keep, None] * orders
        weight = np.ones(len(x)) if run.weights is None else run.weights[keep]
        if len(x) < 2 or not weight.any():
            yield NormalEquations(np.zeros((0, 0)), np.zeros(0))
            return
        root = np.sqrt(weight / weight.mean())[:, None]
        design = root * _about(np.hstack([np.cos(x), np.sin(x)]), weight)
        error = root[:, 0] * _about(run.centred_error[keep, None], weight)[:, 0]
        yield NormalEquations.of_rows(design, error)


def _about(columns: Array, weight: Array) -> Array:
    return np.asarray(columns - (weight @ columns) / weight.sum())


def _explained(sums: NormalEquations) -> float:
    """Sum of squares that the readings explain by themselves, as far as the penalty lets them."""
    return float(sums.held(_RIDGE).solved().coefficients[:, 0] @ sums.moment)


def _listed(orders: Sequence[float]) -> str:
    return ", ".join(f"{order:g}" for order in orders[:6]) + (" ..." if orders[6:] else "")


def check_later_segment(problem: Problem, weights: Sequence[Array | None]) -> None:
    """Raise where orders selected by evidence do not hold from one stretch of a run to the next.

    The mean gain of the stretches (`gains_of_segments`) must exceed one standard deviation
    between them. A place passed once says nothing, unless the whole travel is short.

    Raises
    ------
    NoModelError
        What the other stretches say makes them worse, or some of them as much as it helps others.
    """
    gains = gains_of_segments(problem, weights)
    if gains is None or gains.min() > 0.0 or gains.mean() > _SURE_LATER * gains.std(ddof=1):
        return
    orders = [k * s.cycles_per_turn for s in problem.shafts for k in s.orders]
    raise NoModelError(
        "no correction can be given: what the rest of the run indicates of order "
        f"{_listed(orders)} would make the error of {int(np.count_nonzero(gains <= 0.0))} of "
        f"{gains.size} segments of it larger, and that of the others unevenly smaller; the error "
        "is not one of the angle alone: "
        'run `ta.diagnose(...)`, take out what is not the pattern (`nuisance="auto"`), or '
        "declare the `orders=` or the `shafts=`"
    )


def gains_of_segments(problem: Problem, weights: Sequence[Array | None]) -> Array | None:
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
