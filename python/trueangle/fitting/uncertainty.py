"""Which covariance holds: white noise, or noise that is correlated within the runs."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..angles import circular_mean, wrap
from ..distributions import chi_squared_tail
from ..errors import ArgumentError
from ..quantiles import median
from .clusters import Cluster, robust_covariance, scatter_statistic
from .problem import Fitted, Problem

__all__ = [
    "COVARIANCES",
    "CovarianceKind",
    "Uncertainty",
    "check_covariance",
    "uncertainty",
    "uncertainty_of_sums",
]

Array = NDArray[np.float64]
CovarianceKind: TypeAlias = Literal["auto", "white", "cluster", "hac"]
COVARIANCES: tuple[CovarianceKind, ...] = ("auto", "white", "cluster", "hac")

#: Readings in a row whose correlation is looked at.
_LOOKED_AT: Final = 65_536

#: Correlation counts from so many of its standard errors; white noise shows it once in 1000.
_FOUND: Final = 3.1
#: Chance of the scatter between runs from which it is not that of white noise.
_SCATTER: Final = 1e-3

#: Readings of one or two runs from which a correlation of 0.2 would be found.
_TELLING: Final = 300

#: Readings in a row that are averaged when slow correlation is looked for.
_STRETCHES: Final = (8, 64)

#: Runs from which whole runs are the clusters; runs from which nothing need be said of it.
_FEWEST_RUNS: Final = 3
_ENOUGH_RUNS: Final = 8
#: Most clusters: of more runs several are taken together.
_MOST_CLUSTERS: Final = 128

#: A stretch of readings stands for itself when it is so many times as long as their memory.
_LONG: Final = 8.0
#: Stretches of a run, most and fewest.
_MOST_STRETCHES: Final = 64
_FEWEST_STRETCHES: Final = 8


class Uncertainty(NamedTuple):
    """Covariance of ``[constant, A, B, ...]``, its kind, and freedom of each variance."""

    kind: Literal["white", "cluster", "hac"]
    covariance: Array
    freedom: Array
    note: str = ""


def check_covariance(kind: str, runs: int) -> None:
    """Refuse what there is not.

    Raises
    ------
    ArgumentError
        An unknown name; clusters of a single run.
    """
    if kind not in COVARIANCES:
        known = ", ".join(repr(name) for name in COVARIANCES)
        raise ArgumentError(f"covariance must be one of {known}, got {kind!r}")
    if kind == "cluster" and runs < 2:
        raise ArgumentError(
            "covariance='cluster' takes whole runs as clusters and needs two at least: measure "
            "further runs, or take 'hac'"
        )


def uncertainty(
    problem: Problem,
    fitted: Fitted,
    weights: Sequence[Array | None],
    penalty: float,
    kind: CovarianceKind,
) -> Uncertainty:
    """Covariance of this kind; ``"auto"``: white unless correlation is found.

    Whole runs are the clusters where there are three or more. With fewer, stretches are,
    eight times as long as the memory of the residuals: right where the correlation dies out
    within a run, which one run cannot prove, so that a note says it.
    """
    solution = fitted.solution
    white = np.asarray(solution.covariance)
    if penalty > 0.0:
        white = white + _bias(problem, fitted, weights, penalty)
    freedom = np.full(len(white), solution.degrees_of_freedom)
    if kind == "white" or not np.isfinite(white).all() or len(white) == 1:
        return Uncertainty("white", white, freedom)
    used = [i for i in range(len(problem.runs)) if not np.isnan(fitted.offsets[i])]
    if kind == "auto":
        found = _found(problem, fitted, weights, used)
        if not found:
            return Uncertainty("white", white, freedom, _untold(problem, used))
        kind = "cluster" if len(used) >= _FEWEST_RUNS else "hac"
        said = _said(found)
    else:
        said = ""
    if kind == "cluster":
        clusters = _runs_together([_clusters(problem, fitted, weights, i, 1)[0] for i in used])
        note = said + _between(len(clusters), len(used))
    else:
        memory, stretches = _memory(problem, fitted, weights, used)
        clusters = [
            cluster
            for i, count in zip(used, stretches, strict=True)
            for cluster in _clusters(problem, fitted, weights, i, count)
        ]
        note = (
            f"{said}standard errors by the scatter of {len(clusters)} stretches of the readings, "
            f"which remember about {memory:.0f} readings. A slower wander cannot be known from "
            f"{'one run' if len(used) == 1 else f'{len(used)} runs'}: measure "
            f"{_ENOUGH_RUNS} runs and more"
        )
        if min(stretches) < _FEWEST_STRETCHES:
            note += "; the runs are too short for their memory, and the covariance is not known"
    try:
        total = sum(_weight(w, len(problem.runs[i])) for i, w in enumerate(weights) if i in used)
        robust = robust_covariance(clusters, penalty * total)
    except np.linalg.LinAlgError:
        return Uncertainty("white", white, freedom, _CANCEL)
    covariance = robust.covariance
    if penalty > 0.0:
        covariance = covariance + _bias(problem, fitted, weights, penalty)[1:, 1:]
    return Uncertainty(kind, *_with_constant(white, covariance, robust.freedom), note)


def _bias(
    problem: Problem, fitted: Fitted, weights: Sequence[Array | None], penalty: float
) -> Array:
    r"""What a penalty may have taken from the coefficients, as a covariance.

    :math:`\lambda^2 P \, \tau^2 P` with :math:`P = (G + \lambda)^{-1}` and coefficients of the
    size of those found: :math:`\tau^2` is their mean square.
    """
    used = [i for i in range(len(problem.runs)) if not np.isnan(fitted.offsets[i])]
    gram = np.sum([_clusters(problem, fitted, weights, i, 1)[0].gram for i in used], axis=0)
    full = penalty * sum(_weight(weights[i], len(problem.runs[i])) for i in used)
    size = len(gram)
    taken = full * np.linalg.inv(gram + full * np.eye(size))
    found = np.zeros((size + 1, size + 1))
    found[1:, 1:] = float(np.mean(_coefficients(fitted) ** 2)) * (taken @ taken)
    return found


def _coefficients(fitted: Fitted) -> Array:
    """``A, B`` of every order of every shaft in turn."""
    solution = fitted.solution
    a, b = (np.concatenate([np.zeros(0), *part]) for part in (solution.cosine, solution.sine))
    return np.column_stack([a, b]).ravel()


def _untold(problem: Problem, used: Sequence[int]) -> str:
    """Where correlation would not have been found; empty where it would."""
    count = sum(len(problem.runs[i]) for i in used)
    if len(used) >= _FEWEST_RUNS or count >= _TELLING:
        return ""
    return (
        f"{count} readings in {len(used)} run{'s' if len(used) > 1 else ''} do not tell whether "
        "neighbours correlate: the standard errors hold if they do not, else the covariance is not "
        f"known; measure {_ENOUGH_RUNS} runs and more"
    )


def uncertainty_of_sums(
    white: Array, freedom: float, clusters: Sequence[Cluster], variance: float, kind: CovarianceKind
) -> Uncertainty:
    """Covariance from the sums of each run: of logs that were read once.

    The order of the readings is gone: correlation shows in the scatter between runs alone.

    Raises
    ------
    ArgumentError
        ``"hac"``, which needs the readings in their order.
    """
    if kind == "hac":
        raise ArgumentError(
            "covariance='hac' needs the readings in their order, which one pass does not keep: "
            "take 'cluster', or fit the runs in memory"
        )
    plain = Uncertainty("white", white, np.full(len(white), freedom))
    if kind == "white" or len(white) == 1 or not np.isfinite(white).all():
        return plain
    said = ""
    if kind == "auto":
        if len(clusters) < _FEWEST_RUNS:
            return plain._replace(
                note="one pass over so few runs does not tell whether neighbours correlate: the "
                "standard errors hold if they do not, else the covariance is not known; measure "
                f"{_ENOUGH_RUNS} runs and more"
            )
        statistic, dof = scatter_statistic(_runs_together(list(clusters)), variance)
        if not variance > 0.0 or chi_squared_tail(statistic, dof) >= _SCATTER:
            return plain
        said = _said(
            f"coefficients scatter {math.sqrt(statistic / dof):.2g} times as much between runs"
        )
    together = _runs_together(list(clusters))
    try:
        robust = robust_covariance(together)
    except np.linalg.LinAlgError:
        return plain._replace(note=_CANCEL)
    note = said + _between(len(together), len(clusters))
    return Uncertainty("cluster", *_with_constant(white, *robust), note)


def _said(found: str) -> str:
    return f"the residuals are no white noise ({found}): "


def _between(clusters: int, runs: int) -> str:
    """Standard errors by whole runs, in words."""
    note = f"standard errors by the scatter between {clusters} "
    note += "runs" if clusters == runs else f"groups of the {runs} runs"
    if clusters < _ENOUGH_RUNS:
        note += f"; so few tell them roughly: {_ENOUGH_RUNS} runs and more tell them well"
    return note


_CANCEL: Final = "the covariance is that of white noise: orders nearly cancel"


def _with_constant(white: Array, covariance: Array, freedom: Array) -> tuple[Array, Array]:
    """The constant beside the coefficients: wider by as much as they are in the middle.

    How the zeros of the runs scatter tells nothing of it, for each may be another.
    """
    ratio = np.sqrt(np.diag(covariance) / np.diag(white)[1:])
    scale = np.concatenate([[max(1.0, float(median(ratio)))], ratio])
    full = white * np.outer(scale, scale)
    full[1:, 1:] = covariance
    return full, np.concatenate([[float(median(freedom))], freedom])


def _weight(weights: Array | None, size: int) -> float:
    return float(size) if weights is None else float(weights.sum())


def _runs_together(clusters: list[Cluster]) -> list[Cluster]:
    """At most so many clusters: further runs are dealt to the first ones."""
    if len(clusters) <= _MOST_CLUSTERS:
        return clusters
    return [
        Cluster(*(np.sum(part, axis=0) for part in zip(*clusters[i::_MOST_CLUSTERS], strict=True)))
        for i in range(_MOST_CLUSTERS)
    ]


def _clusters(
    problem: Problem, fitted: Fitted, weights: Sequence[Array | None], index: int, count: int
) -> list[Cluster]:
    """Sums of a run in so many stretches of readings in a row, about the run's mean."""
    run, weight = problem.runs[index], weights[index]
    zero = circular_mean(run.indicated - run.reference, problem.period)
    sums = []
    for part in np.array_split(np.arange(len(run)), count) if count > 1 else [slice(None)]:
        rows = _core.triangle(
            (run.reference[part], run.indicated[part], None if weight is None else weight[part]),
            problem.period,
            [shaft.cycles_per_turn for shaft in problem.shafts],
            [list(shaft.orders) for shaft in problem.shafts],
            problem.argument,
            zero,
            problem.threads,
        )
        sums.append(rows.T @ rows)
    whole = np.sum(sums, axis=0)
    mean = whole[0] / whole[0, 0]
    coefficients = _coefficients(fitted)
    found = []
    for one in sums:
        about = one - np.outer(mean, one[0]) - np.outer(one[0], mean)
        about += one[0, 0] * np.outer(mean, mean)
        gram = about[1:-1, 1:-1]
        found.append(Cluster(gram, about[1:-1, -1] - gram @ coefficients))
    return found


# -- is there correlation? -------------------------------------------------------------


def _in_time(
    problem: Problem, fitted: Fitted, weights: Sequence[Array | None], used: Sequence[int]
) -> list[Array]:
    """Weighted residuals of the first readings of every run, in the order they were taken."""
    most = max(64, _LOOKED_AT // len(used))
    found = []
    for i in used:
        run, weight = problem.runs[i], weights[i]
        offset = fitted.offsets[i] - fitted.solution.constant
        rest = run.indicated[:most] - run.reference[:most] - offset
        rest = wrap(rest - fitted.predict(problem.angles[i][:most]), problem.period)
        found.append(rest if weight is None else rest * np.sqrt(weight[:most]))
    return found


def _found(
    problem: Problem, fitted: Fitted, weights: Sequence[Array | None], used: Sequence[int]
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
    # Low orders that were taken out leave white noise a little anticorrelated.
    if near + (problem.unknowns + 1.0) / count > _FOUND / math.sqrt(pairs):
        return f"neighbours in time correlate by {near:.2f}"
    for length in _STRETCHES:
        blocks = [part[: part.size // length * length].reshape(-1, length) for part in parts]
        means = np.concatenate([block.mean(axis=1) for block in blocks])
        if means.size < 20:
            break
        ratio = length * float((means**2).mean()) * count / power
        if ratio - 1.0 > _FOUND * math.sqrt(2.0 / means.size):
            return (
                f"means of {length} neighbours in time scatter {math.sqrt(ratio):.2g} times as much"
            )
    if len(used) >= _FEWEST_RUNS:
        clusters = _runs_together([_clusters(problem, fitted, weights, i, 1)[0] for i in used])
        statistic, freedom = scatter_statistic(clusters, solution.residual_variance)
        if chi_squared_tail(statistic, freedom) < _SCATTER:
            times = math.sqrt(statistic / freedom)
            return f"coefficients scatter {times:.2g} times as much between runs"
    return ""


def _memory(
    problem: Problem, fitted: Fitted, weights: Sequence[Array | None], used: Sequence[int]
) -> tuple[float, list[int]]:
    """Readings that the residuals remember, and stretches to cut each run into."""
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
    long = max(1, math.ceil(_LONG * memory))
    sizes = [len(problem.runs[i]) for i in used]
    return memory, [max(2, min(_MOST_STRETCHES, size // long)) for size in sizes]
