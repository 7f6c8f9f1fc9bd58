"""What errors that repeat at the positions put into a fit, however often they are read again.

At a position p that is read in every run two errors come back each time: that of a sensor which
rounds (variance v, `trueangle.fitting.rounding`), and that of all orders which the fit omits.
With ``S_p = Σ_(i at p) w_i x̃_i`` and the normal matrix G they move the coefficients by
``G⁻¹ Σ_p S_p e_p``, whose covariance is

::

    G⁻¹ Sᵀ K S G⁻¹,    K_pq = v δ_pq + s² (2/N) Σ_k cos(2πk (t_p - t_q))

The sum is over all orders that are not fitted and that N positions on the turn can resolve, taken
as equally strong: on a whole grid of N they are orthogonal to those fitted and add nothing; on
part of it, and at places on no grid, they leak. The excess of the residual at the positions over
the scatter of the runs there gives ``s²`` (a test of lack of fit, Seber and Lee, Linear Regression
Analysis, 2003, section 4.4).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..estimation.linear import pseudo_inverse
from ..estimation.reference import design_matrix
from ..joint.lattice import UniformGrid, uniform_grid
from ..runs.aliasing import Positions, distinct_positions
from ..runs.run import CalibrationRun
from ..support.arrays import Array
from ..support.distributions import f_tail
from .problem import Problem, SolvedProblem
from .rounding import COUNTED, rounding_variance
from .uncertainty import CovarianceKind, Uncertainty

#: p-value of a scatter below which it is not that of white noise.
SCATTER: Final = 1e-3


class _Repeats(NamedTuple):
    """Weighted sums over the readings; ``k`` regressors and the constant before them."""

    #: ``[1, x]`` at each position, (p, k + 1).
    columns: Array
    #: How an error at a position and at a run's position moves the right sides, (p or m, k + 1).
    scores: Array
    pairs: Array
    #: Run and position of each of the m pairs that occur, its weight and its mean residual.
    of_pair: tuple[NDArray[np.intp], NDArray[np.intp]]
    pair_weight: Array
    residual: Array
    #: From right sides to ``[constant, A, B, ...]``.
    solve: Array
    weight: Array
    readings: int


def covariance_with_repeats(
    found: Uncertainty,
    problem: Problem,
    fitted: SolvedProblem,
    weights: Sequence[Array | None],
    penalty: float,
    asked: CovarianceKind,
) -> Uncertainty:
    """The covariance with that of all errors that repeat at the positions.

    What ``found`` holds of them by itself is not added again: one share of the readings at each
    position is among white residuals, and between runs scatters what differs from run to run.
    Of more than `COUNTED` readings positions are not counted, and where no position was read
    again nothing is known about what repeats. Omitted orders count if the positions scatter more
    than their readings (p-value below `SCATTER`), and not if white noise was requested.
    """
    kept = sum(map(len, problem.runs))
    if kept < problem.readings or kept > COUNTED or not problem.is_periodic:
        return found
    if not 0.0 < fitted.solution.residual_variance < math.inf:
        return found
    if not np.isfinite(found.covariance).all():
        return found
    positions = distinct_positions(problem.runs)
    if len(positions) == kept:
        return found
    rounded = rounding_variance(_weighted(problem, weights), positions)
    basis = None if asked == "white" else _orders_left_out(problem, positions)
    if rounded == 0.0 and basis is None:
        return found
    sums = _repeats(problem, fitted, positions, weights, penalty)
    left, freedom = 0.0, math.inf
    if basis is not None:
        left, freedom = _left_out(sums, basis)
        left = max(left - rounded, 0.0)
    if rounded == left == 0.0:
        return found
    basis = np.zeros((len(positions), 0)) if basis is None else basis
    added = _moved(sums, basis, (rounded, left), found.kind)
    wider = found.beside(added, freedom if left > rounded else math.inf)
    noise, all_of_it = np.diag(found.covariance)[1:].sum(), np.diag(wider.covariance)[1:].sum()
    # Share of a variance from which the contribution of omitted orders is reported.
    if left <= rounded or all_of_it <= 1.1 * noise:
        return wider
    said = (
        "omitted orders repeat at every position and leak into the fitted "
        f"ones: standard errors are {math.sqrt(all_of_it / noise):.2g} times those of noise "
        "alone, which allows for omitted orders of equal size"
    )
    return wider._replace(note="; ".join(filter(None, (found.note, said))))


def _repeats(
    problem: Problem,
    fitted: SolvedProblem,
    positions: Positions,
    weights: Sequence[Array | None],
    penalty: float,
) -> _Repeats:
    """The sums over the readings."""
    place = positions.index
    sizes = [len(run) for run in problem.runs]
    run = np.repeat(np.arange(len(sizes)), sizes)
    given = zip(problem.runs, weights, strict=True)
    w = np.concatenate([np.ones(len(run)) if w is None else w for run, w in given])
    columns = design_matrix(positions.turns, zip(*problem.design, strict=True), 1.0)
    x = columns[:, 1:]
    of_run = _added(run, w, len(sizes))
    used = of_run > 0.0
    whole = np.where(used, of_run, 1.0)
    # In a single run each reading counts by itself.
    units = run if used.sum() > 1 else np.arange(w.size)
    pairs, pair = np.unique((units * len(positions) + place)[w > 0.0], return_inverse=True)
    pair_unit, pair_place = np.divmod(pairs, len(positions))
    pair_run = pair_unit if used.sum() > 1 else run[pair_unit]
    of_pair = _added(pair, w[w > 0.0], pairs.size)
    residuals = np.concatenate(problem.residuals(fitted)[: len(sizes)])
    residual = _added(pair, (w * residuals)[w > 0.0], pairs.size) / of_pair
    rows = of_pair[:, None] * x[pair_place]
    means = _added(pair_run, rows, len(sizes)) / whole[:, None]
    moved = rows - of_pair[:, None] * means[pair_run]
    scores = np.column_stack([of_pair / whole[pair_run] / used.sum(), moved])
    at = _added(pair_place, scores, len(positions))
    gram = at[:, 1:].T @ x + penalty * w.sum() * np.eye(x.shape[1])
    inverse = pseudo_inverse(gram)
    solve = np.zeros((len(inverse) + 1, len(inverse) + 1))
    solve[0, 0], solve[1:, 1:] = 1.0, inverse
    solve[0, 1:] = -means[used].mean(axis=0) @ inverse
    weight = _added(place, w, len(positions))
    of = (pair_run, pair_place)
    return _Repeats(columns, at, scores, of, of_pair, residual, solve, weight, w.size)


def _weighted(problem: Problem, weights: Sequence[Array | None]) -> Sequence[CalibrationRun]:
    """The runs with the weights that a robust loss ended with."""
    if weights is problem.base:
        return problem.runs
    return [replace(run, weights=w) for run, w in zip(problem.runs, weights, strict=True)]


def _added(index: NDArray[np.intp], rows: Array, count: int) -> Array:
    """Sum of the rows of each index."""
    found = np.zeros((count, *rows.shape[1:]))
    np.add.at(found, index, rows)
    return found


def _orders_left_out(problem: Problem, positions: Positions) -> Array | None:
    """``U`` of ``s² U Uᵀ`` at the positions, for omitted orders; None where none leaks.

    Several shifted grids separate the fitted orders from all that one of the grids shows.
    """
    turns = positions.turns
    if positions.divisions is not None and len(positions.offsets) > 1:
        return None
    grid = uniform_grid(2.0 * math.pi * turns)
    count = round(turns.size / positions.span) if grid is None else grid.positions
    # Positions times orders up to which omitted orders are examined: 1000 places of a turn.
    if count * turns.size > 1_000_000:
        return None
    fitted = [s.cycles_per_turn * order for s in problem.shafts for order in s.orders]
    taken = {0.0, *(UniformGrid(count).folded(order) for order in fitted)}
    orders = np.array([k for k in range(1, count // 2 + 1) if k not in taken])
    angles = 2.0 * math.pi * np.outer(turns, orders)
    last = 2 * orders == count
    whole = np.concatenate(
        [
            np.where(last, 1.0, math.sqrt(2.0)) * np.cos(angles),
            math.sqrt(2.0) * np.sin(angles[:, ~last]),
        ],
        axis=1,
    )
    return np.asarray(whole / math.sqrt(count))


def _left_out(sums: _Repeats, basis: Array) -> tuple[float, float]:
    """``s²`` and its degrees of freedom, by how positions scatter and how runs do at each.

    ::

        E[Σ W_p r̄_p²] = σ² tr(W M W⁻¹ Mᵀ) + s² tr(W M U Uᵀ Mᵀ),    M = I - [1, x] G⁻¹ Sᵀ
    """
    weight, u = sums.weight, sums.columns
    v = sums.scores @ sums.solve.T
    seen = weight > 0.0
    crossed = 2.0 * np.einsum("pi,pi->p", u, v)
    over = np.divide(1.0, weight, out=np.zeros(weight.size), where=seen)
    freedom = float((1.0 - crossed)[seen].sum())
    freedom += float(weight @ np.einsum("pi,ij,pj->p", u, (v.T * over) @ v, u))
    if freedom < 1.0:
        return 0.0, math.inf
    rest = basis - u @ (v.T @ basis)
    told = float(weight @ (rest**2).sum(axis=1))
    run, place = sums.of_pair
    means = _added(place, sums.pair_weight * sums.residual, weight.size)
    means = np.divide(means, weight, out=np.zeros(weight.size), where=seen)
    squares = float(weight @ means**2)
    again = run.size - int(seen.sum()) - np.unique(run).size + 1
    if again < 1 or not told > 0.0:
        return 0.0, math.inf
    between = float(sums.pair_weight @ (sums.residual - means[place]) ** 2) / again
    # Rounding is all that copies of one run differ by.
    chance = f_tail(squares / freedom / max(between, 1e-20 * squares), freedom, again)
    if chance >= SCATTER:
        return 0.0, math.inf
    return max(squares - freedom * between, 0.0) / told, freedom


def _moved(sums: _Repeats, basis: Array, sizes: tuple[float, float], kind: str) -> Array:
    """Covariance of the coefficients by what repeats, less that in ``kind``."""
    run, place = sums.of_pair
    runs = np.unique(run)
    found = _spread(sums.scores, basis, sizes)
    if kind == "white":
        found *= 1.0 - len(basis) / sums.readings
    elif kind == "cluster" and runs.size > 1:
        own = [_spread(sums.pairs[run == one], basis[place[run == one]], sizes) for one in runs]
        found = (found - np.sum(own, axis=0)) * (runs.size / (runs.size - 1.0))
        # Where leaks of runs at other positions cancel, their scatter is too wide, and stays.
        values, vectors = np.linalg.eigh(found)
        found = (vectors * np.maximum(values, 0.0)) @ vectors.T
    return np.asarray(sums.solve @ found @ sums.solve.T)


def _spread(scores: Array, basis: Array, sizes: tuple[float, float]) -> Array:
    """``Sᵀ (v I + s² U Uᵀ) S``."""
    held = scores.T @ basis
    return np.asarray(sizes[0] * scores.T @ scores + sizes[1] * held @ held.T)
