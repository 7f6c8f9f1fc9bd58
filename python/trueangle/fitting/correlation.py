"""Whether residuals correlate in time, their correlation time, and clusters of them."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from typing import Final, NamedTuple

import numpy as np

import trueangle._core as _core

from ..estimation.linear import NormalEquations, total
from ..support.arrays import Array
from .problem import Problem, SolvedProblem


class Share(NamedTuple):
    """Expected ``rᵀ A r / rᵀ r`` of white noise, and its standard deviation."""

    expected: float
    deviation: float


class ResidualSpace:
    """The space that a fit has taken from its readings.

    Parameters
    ----------
    basis : ndarray, shape (n, m)
        Orthonormal columns; readings run after run in the order of time.
    sizes : sequence of int
        Readings of each run.
    """

    def __init__(self, basis: Array, sizes: Sequence[int]) -> None:
        self._basis, self._sizes = basis, tuple(sizes)

    @classmethod
    def of(
        cls, problem: Problem, weights: Sequence[Array | None], used: Sequence[int]
    ) -> ResidualSpace | None:
        """That of a fit of these runs; None of sums, of no orders, and where readings abound."""
        sizes = [len(problem.runs[i]) for i in used]
        width = problem.unknowns + len(used)
        # Readings times columns up to which the columns are written out.
        if not problem.unknowns or problem.summed or sum(sizes) * width > 4_000_000:
            return None
        # Columns in square roots of readings below which the fit changes no such form by a tenth of
        # what is looked for: its share of the noise is then far below the form's own deviation.
        if width < 0.3 * math.sqrt(sum(sizes)):
            return None
        own = [problem.private(i) for i in used]
        starts = np.cumsum([0, *(part.shape[1] for part in own)])
        rows = []
        for place, i in enumerate(used):
            alone = np.zeros((sizes[place], starts[-1]))
            alone[:, starts[place] : starts[place + 1]] = own[place]
            columns = np.hstack([alone, problem.columns(i)])
            weight = weights[i]
            rows.append(columns if weight is None else np.sqrt(weight)[:, None] * columns)
        columns = np.vstack(rows)
        columns /= np.maximum(np.sqrt((columns**2).sum(axis=0)), 1e-300)
        values, vectors = np.linalg.eigh(columns.T @ columns)
        # Part of the largest eigenvalue below which columns add nothing new.
        kept = values > 1e-10 * values[-1]
        return cls(columns @ (vectors[:, kept] / np.sqrt(values[kept])), sizes)

    def neighbours(self) -> Share:
        """Of the products of neighbours in each run."""
        pairs = sum(self._sizes) - len(self._sizes)
        return self._share(self._next, 0.0, 0.5 * pairs)

    def means(self, length: int) -> Share:
        """Of the squared means of ``length`` neighbours, times their number."""
        blocks = sum(size // length for size in self._sizes)

        def spread(columns: Array) -> Array:
            found = np.zeros_like(columns)
            for part, out in zip(self._runs(columns), self._runs(found), strict=True):
                whole = len(part) // length * length
                means = part[:whole].reshape(-1, length, part.shape[1]).mean(axis=1)
                out[:whole] = np.repeat(means, length, axis=0)
            return found

        return self._share(spread, float(blocks), float(blocks))

    def _next(self, columns: Array) -> Array:
        """Half of both neighbours of each row."""
        found = np.zeros_like(columns)
        for part, out in zip(self._runs(columns), self._runs(found), strict=True):
            out[1:] += 0.5 * part[:-1]
            out[:-1] += 0.5 * part[1:]
        return found

    def _runs(self, columns: Array) -> list[Array]:
        return np.split(columns, np.cumsum(self._sizes)[:-1])

    def _share(self, form: Callable[[Array], Array], trace: float, square: float) -> Share:
        """By A itself, its trace and that of its square."""
        left = len(self._basis) - self._basis.shape[1]
        if left < 1:
            return Share(0.0, math.inf)
        turned = form(self._basis)
        inner = self._basis.T @ turned
        first = trace - float(np.trace(inner))
        second = square - 2.0 * float((turned**2).sum()) + float((inner**2).sum())
        variance = 2.0 * max(second - first**2 / left, 0.0)
        return Share(first / left, math.sqrt(variance) / left)


#: Most clusters: of more runs several are taken together.
_MOST_CLUSTERS: Final = 128

#: Fewest runs that show by themselves how coefficients scatter.
ENOUGH_RUNS: Final = 8


#: Standard errors from which a correlation counts; white noise reaches it once in 1000.
_FOUND: Final = 3.1
#: p-value of a scatter below which it is not that of white noise.
SCATTER: Final = 1e-3


#: Segments of a run, most and fewest.
FEWEST_STRETCHES: Final = 8


def coefficients_of(fitted: SolvedProblem) -> Array:
    """``A, B`` of every order of every shaft in turn."""
    solution = fitted.solution
    a, b = (np.concatenate([np.zeros(0), *part]) for part in (solution.cosine, solution.sine))
    return np.column_stack([a, b]).ravel()


def weight_sum(weights: Array | None, size: int) -> float:
    """Sum of the weights of ``size`` readings."""
    return float(size) if weights is None else float(weights.sum())


def clusters_of(
    problem: Problem, fitted: SolvedProblem, weights: Sequence[Array | None], index: int, count: int
) -> list[NormalEquations]:
    """Sums of a run in ``count`` consecutive segments, about the run's mean and the fit."""
    sums = problem.products(weights, index, count)
    whole = np.sum(sums, axis=0)
    mean, found = whole[0] / whole[0, 0], coefficients_of(fitted)
    # Of nuisances nothing is left in the readings.
    coefficients = np.concatenate([found, np.zeros(mean.size - 2 - found.size)])
    return [NormalEquations.of_products(one, mean).about(coefficients) for one in sums]


def runs_together(clusters: list[NormalEquations]) -> list[NormalEquations]:
    """At most `_MOST_CLUSTERS` clusters: further runs are added to the first ones in turn."""
    if len(clusters) <= _MOST_CLUSTERS:
        return clusters
    return [total(clusters[i::_MOST_CLUSTERS]) for i in range(_MOST_CLUSTERS)]


def _in_time(
    problem: Problem, fitted: SolvedProblem, weights: Sequence[Array | None], used: Sequence[int]
) -> list[Array]:
    """Weighted residuals of the first readings of every run, in the order they were taken."""
    # Readings in a row whose correlation is looked at.
    most = max(64, 65_536 // len(used))
    found = []
    for i in used:
        run, weight = problem.runs[i], weights[i]
        offset = fitted.offsets[i] - fitted.solution.constant
        rest = fitted.predict(problem.angles[i][:most])
        _core.residuals(run.indicated[:most], run.reference[:most], offset, problem.period, rest)
        found.append(rest if weight is None else rest * np.sqrt(weight[:most]))
    return found


def correlation_found(
    problem: Problem,
    fitted: SolvedProblem,
    weights: Sequence[Array | None],
    used: Sequence[int],
) -> str:
    """What speaks against white noise, in words; empty where nothing does."""
    solution = fitted.solution
    if not (solution.residual_variance > 0.0 and solution.degrees_of_freedom > problem.unknowns):
        return ""
    parts = _in_time(problem, fitted, weights, used)
    count = sum(part.size for part in parts)
    power = sum(float(part @ part) for part in parts)
    pairs = count - len(parts)
    if power <= 0.0 or pairs < 20:
        return ""
    near = sum(float(part[1:] @ part[:-1]) for part in parts) / power
    space = ResidualSpace.of(problem, weights, used)
    # Low orders that were taken out leave white noise a little anticorrelated.
    white = Share(-(problem.unknowns + 1.0) / count, 1.0 / math.sqrt(pairs))
    white = white if space is None else space.neighbours()
    if near - white.expected > _FOUND * white.deviation:
        return f"neighbours in time correlate by {near - white.expected:.2f}"
    # Readings in a row that are averaged when slow correlation is looked for.
    for length in (8, 64):
        blocks = [part[: part.size // length * length].reshape(-1, length) for part in parts]
        means = np.concatenate([block.mean(axis=1) for block in blocks])
        if means.size < 20:
            break
        share = length * float((means**2).sum()) / power
        white = Share(means.size / count, math.sqrt(2.0 * means.size) / count)
        white = white if space is None else space.means(length)
        ratio = share / white.expected
        if share - white.expected > _FOUND * white.deviation:
            return (
                f"means of {length} neighbours in time scatter {math.sqrt(ratio):.2g} times as much"
            )
    return ""


def residual_memory(
    problem: Problem, fitted: SolvedProblem, weights: Sequence[Array | None], used: Sequence[int]
) -> tuple[float, list[int]]:
    """Correlation time of the residuals in readings, and segments to cut each run into."""
    parts = _in_time(problem, fitted, weights, used)
    power = sum(float(part @ part) for part in parts)
    memory, lag = 1.0, 1
    limit = 2.0 / math.sqrt(sum(part.size for part in parts))
    while power > 0.0 and lag < max(part.size for part in parts) // 4:
        near = sum(float(part[lag:] @ part[:-lag]) for part in parts if part.size > lag) / power
        if near < limit:
            break
        memory += 2.0 * near
        lag += 1
    # Segments count as independent from this length on, in correlation times of the readings.
    long = max(1, math.ceil(8.0 * memory))
    sizes = [len(problem.runs[i]) for i in used]
    # Segments of a run, most and fewest.
    stretches = [max(2, min(64, size // long)) for size in sizes]
    if min(stretches) < FEWEST_STRETCHES:
        space = ResidualSpace.of(problem, weights, used)
        count = sum(part.size for part in parts)
        white = -(problem.unknowns + len(used)) / count
        white = white if space is None else space.neighbours().expected
        memory = max(memory, _of_neighbours(parts, power, white))
    return memory, stretches


def _of_neighbours(parts: list[Array], power: float, white: float) -> float:
    """Correlation time, in readings, of noise that decays by a fixed factor per reading.

    The correlation of neighbours in few residuals is off by what the fit took from them, as that
    of ``white`` noise is, and that of readings further apart is lost in it.
    """
    if power <= 0.0:
        return 1.0
    count = sum(part.size for part in parts)
    near = sum(float(part[1:] @ part[:-1]) for part in parts) / power
    near = max(near - (1.0 + near) * white, 0.0)
    return min((1.0 + near) / (1.0 - near), float(count)) if near < 1.0 else float(count)
