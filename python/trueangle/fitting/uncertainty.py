"""Which covariance holds: white noise, what differs between runs, or correlation within them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, Literal, NamedTuple, TypeAlias

import numpy as np

from ..errors import ArgumentError
from ..estimation.evidence import CorrelatedNoise
from ..estimation.linear import (
    FEWEST_RUNS,
    LEVELS,
    NormalEquations,
    cluster_covariance,
    least_squares,
    moderated_covariance,
    pseudo_inverse,
    total,
    without_columns,
)
from ..support.arrays import Array, median
from ..support.suggestions import check_choice
from .nuisance import Nuisance
from .problem import PlainSolution, Problem, SolvedProblem
from .robust import Sandwich, sandwich


class BesideProblem(Problem):
    """The problem of a pattern fitted jointly with nuisances that were removed from the readings.

    By Frisch and Waugh the coefficients of a pattern are those of its columns less what
    nuisances explain of them. Of a drift, which each run has for itself, that is done run by
    run; what runs share (ramp, direction, velocity, lines of the reference) is fitted jointly
    with the pattern. Noise, its degrees of freedom, and what runs scatter by are those of this
    joint fit:

    ::

        cov = σ² (X̃' W X̃)⁻¹,    σ² = Σ w r² / (n - R - p - q),    X̃ = X - N (N' W N)⁺ N' W X

    with p coefficients of the pattern, and q of the nuisances.

    ``shared`` and ``own`` are columns of each run: of all runs together, and of itself.
    """

    def __init__(self, problem: Problem, shared: list[Array], own: list[Array]) -> None:
        self.__dict__.update(problem.__dict__)
        self._shared, self._own = shared, own

    @classmethod
    def of(cls, problem: Problem, nuisance: Nuisance) -> BesideProblem | None:
        """With what was taken out; None where that is nothing, or came from a part of the readings.

        A part is looked at where there are too many.
        """
        from .nuisancecolumns import taken_columns

        columns = taken_columns(problem.runs, nuisance)
        return None if columns is None or problem.summed else cls(problem, *columns)

    @property
    def unknowns(self) -> int:
        """Those of the pattern and of nuisances; the zeros of the runs are not counted."""
        return super().unknowns + self.taken

    @property
    def taken(self) -> int:
        """Coefficients of nuisances."""
        return int(self._shared[0].shape[1] + sum(own.shape[1] for own in self._own))

    def columns(self, index: int) -> Array:
        """Cosine and sine of every order, and what runs share."""
        # Size of the columns that runs share, those of the pattern being 1: no penalty restrains
        # them.
        return np.hstack([super().columns(index), 100.0 * self._shared[index]])

    def private(self, index: int) -> Array:
        """The zero of a run, and a separate drift."""
        return np.hstack([super().private(index), self._own[index]])

    def products(self, weights: Sequence[Array | None], index: int) -> Array:
        """As of a problem, of columns and errors less what the run's own nuisances explain."""
        run, weight = self.runs[index], weights[index]
        target = np.column_stack([self.columns(index), run.centred_error])
        own = self.private(index)
        rest = target - own @ least_squares(own, target, weight)
        rows = np.column_stack([np.ones(len(run)), rest])
        given = rows if weight is None else weight[:, None] * rows
        return np.asarray(rows.T @ given)

    def jointly(
        self, fitted: SolvedProblem, weights: Sequence[Array | None], penalty: float = 0.0
    ) -> SolvedProblem:
        """The same fit with the noise and the covariance of the joint one."""
        solution = fitted.solution
        left = solution.degrees_of_freedom - self.taken
        squares = solution.residual_variance * solution.degrees_of_freedom
        variance = squares / left if left > 0.0 else np.inf
        used = [i for i in range(len(self.runs)) if not np.isnan(fitted.offsets[i])]
        parts = [self.products(weights, i) for i in used]
        gram = np.sum(parts, axis=0)[1:-1, 1:-1]
        means = []
        for i in used:
            weight = weights[i]
            means.append(np.average(self.columns(i), axis=0, weights=weight))
        sums = [part[0, 0] for part in parts]
        held = np.zeros(len(gram))
        held[: super().unknowns] = penalty * float(np.sum(sums))
        inverse = pseudo_inverse(gram + np.diag(held))
        covariance = np.zeros((1 + len(gram), 1 + len(gram)))
        covariance[1:, 1:] = inverse @ gram @ inverse
        mean = np.mean(means, axis=0)
        mean[super().unknowns :] = 0.0
        covariance[0, 1:] = covariance[1:, 0] = -covariance[1:, 1:] @ mean
        covariance[0, 0] = np.mean(1.0 / np.array(sums)) / len(used) - mean @ covariance[1:, 0]
        values = {name: getattr(solution, name) for name in PlainSolution._fields}
        values |= {
            "covariance": variance * covariance,
            "residual_variance": variance,
            "degrees_of_freedom": max(left, 1.0),
        }
        return SolvedProblem(PlainSolution(**values), fitted.offsets, self.shafts, self.period)


CovarianceKind: TypeAlias = Literal["auto", "white", "cluster", "correlated"]
COVARIANCES: tuple[CovarianceKind, ...] = ("auto", "white", "cluster", "correlated")

#: Fewest runs that show by themselves how coefficients scatter.
_ENOUGH_RUNS: Final = 8

#: Readings of one or two runs from which a correlation of 0.2 would be found.
_TELLING: Final = 300


class Uncertainty(NamedTuple):
    """Covariance of ``[constant, A, B, ...]``, its kind, and freedom of each variance.

    ``noise_freedom``: the fewest degrees of freedom of any variance without the bias of a penalty;
    None for those of ``freedom``.
    """

    kind: Literal["white", "cluster", "correlated", "evidence"]
    covariance: Array
    freedom: Array
    note: str = ""
    noise_freedom: float | None = None

    @property
    def fewest(self) -> float:
        """Fewest degrees of freedom of a variance that is noise alone."""
        return float(self.freedom.min()) if self.noise_freedom is None else self.noise_freedom

    def among(self, count: int) -> Uncertainty:
        """Of the constant and the first coefficients alone."""
        return self._replace(
            covariance=self.covariance[:count, :count], freedom=self.freedom[:count]
        )

    def beside(self, bias: Array, known: float = math.inf) -> Uncertainty:
        """The same with the covariance of a bias added, which has ``known`` degrees of freedom.

        ::

            ν = (u + b)² / (u²/ν_u + b²/ν_b)

        (Welch and Satterthwaite) for the variances u of noise and b of the bias.
        """
        noise, more = np.diag(self.covariance), np.diag(bias)
        share = np.divide(more, noise, out=np.zeros(len(noise)), where=noise > 0.0)
        told = 1.0 / self.freedom + share**2 / known
        return self._replace(
            covariance=self.covariance + bias,
            freedom=(1.0 + share) ** 2 / told,
            noise_freedom=self.fewest,
        )


def check_covariance(kind: str, runs: int) -> None:
    """Refuse what there is not.

    Raises
    ------
    ArgumentError
        An unknown name; clusters of a single run.
    """
    check_choice("covariance", kind, COVARIANCES)
    if kind == "cluster" and runs < 2:
        raise ArgumentError(
            "`covariance='cluster'` takes whole runs as clusters and needs two at least: measure "
            "further runs, or take `covariance='correlated'`"
        )


def coefficient_uncertainty(
    problem: Problem,
    fitted: SolvedProblem,
    weights: Sequence[Array | None],
    penalty: float,
    kind: CovarianceKind,
    nuisance: Nuisance | None = None,
    loss: str = "linear",
) -> Uncertainty:
    """Covariance of this kind; ``"auto"``: by the scatter of three runs and more.

    A ``nuisance`` that was taken out of the runs is fitted jointly with the pattern
    (`BesideProblem`). A robust ``loss`` gives readings less weight,
    which does not make them less precise (`trueangle.fitting.robust.Sandwich`).

    The scatter of few runs is moderated by white noise and by what the coefficients have in common
    (`trueangle.estimation.linear.moderated_covariance`). One or two runs are white noise unless
    the evidence for correlated noise is by far greater: then that noise holds, of which a slow
    drift is no part that one run could prove, so that a note states it. The bias of a penalty is
    added to either (`trueangle.fitting.ridge`).
    """
    bent = sandwich(problem, fitted, weights, loss)
    beside = None if nuisance is None else BesideProblem.of(problem, nuisance)
    if beside is None:
        noise = _noise(problem, fitted, weights, penalty, kind, bent)
    else:
        jointly = beside.jointly(fitted, weights, penalty)
        noise = _noise(beside, jointly, weights, penalty, kind, bent).among(1 + problem.unknowns)
    if penalty > 0.0 and np.isfinite(noise.covariance).all():
        noise = noise.beside(_bias(problem, fitted, weights, penalty))
    if beside is not None or nuisance is None or not nuisance.inflation:
        return noise
    wider = np.array([1.0, *nuisance.inflation])
    return noise._replace(covariance=noise.covariance * np.outer(wider, wider))


def _noise(
    problem: Problem,
    fitted: SolvedProblem,
    weights: Sequence[Array | None],
    penalty: float,
    kind: CovarianceKind,
    bent: Sandwich,
) -> Uncertainty:
    """What noise makes of the estimate."""
    solution = fitted.solution
    white = bent.white * np.asarray(solution.covariance)
    freedom = np.full(len(white), solution.degrees_of_freedom)
    plain = Uncertainty("white", white, freedom)
    if kind == "white" or not np.isfinite(white).all() or len(white) == 1:
        return plain
    if not (solution.residual_variance > 0.0 and solution.degrees_of_freedom > 0.0):
        return plain
    used = [i for i in range(len(problem.runs)) if not np.isnan(fitted.offsets[i])]
    try:
        noise = plain
        few = len(used) < FEWEST_RUNS
        # Blocks of readings at random, which sums keep, do not show the noise of whole runs.
        if kind == "correlated" or (kind == "auto" and (few or not problem.summed)):
            noise = _correlated(problem, fitted, weights, used, penalty, kind, plain)
        if kind == "correlated" or (kind == "auto" and few):
            return noise
        runs = [clusters_of(problem, fitted, weights, i) for i in used]
        # At most this many clusters: further runs are added to the first ones in turn.
        clusters = [total(runs[i::128]) for i in range(min(len(runs), 128))]
        weight = sum(weight_sum(weights[i], len(problem.runs[i])) for i in used)
        scatter = cluster_covariance(clusters, penalty * weight)
        scatter = scatter._replace(covariance=bent.bread * scatter.covariance)
        if kind == "auto":
            # Runs that scatter by nothing are copies, or what they leave is a pattern.
            if not (np.diag(scatter.covariance) > LEVELS[0] * np.diag(white)[1:]).any():
                return plain
            scatter = moderated_covariance(scatter, noise.covariance[1:, 1:], noise.fewest)
    except np.linalg.LinAlgError:
        return plain._replace(note=_CANCEL)
    return Uncertainty("cluster", *_with_constant(white, *scatter))


#: Logarithm of the odds from which noise is correlated: 95 % of the probability.
_CORRELATED: Final = math.log(19.0)


def _correlated(
    problem: Problem,
    fitted: SolvedProblem,
    weights: Sequence[Array | None],
    used: Sequence[int],
    penalty: float,
    kind: CovarianceKind,
    plain: Uncertainty,
) -> Uncertainty:
    """Under the noise of most evidence; ``plain`` where that is white, unless asked for."""
    columns, left = [], []
    rests = problem.residuals(fitted)
    for i in used:
        x, own, weight = problem.columns(i), problem.private(i), weights[i]
        root = np.ones(len(x)) if weight is None else np.sqrt(weight)
        counted = root > 0.0
        columns.append((root[:, None] * without_columns(own, x, weight))[counted])
        left.append((root * rests[i])[counted])
    noise = CorrelatedNoise.of(columns, left, fitted.solution.residual_variance)
    if kind == "auto" and noise.odds < _CORRELATED:
        return plain._replace(note=_untold(problem, used))
    held = penalty * sum(weight_sum(weights[i], len(problem.runs[i])) for i in used)
    # Of sums the covariance is that of all readings, and the noise that of some.
    wider = noise.widening(columns, held)
    covariance = plain.covariance[1:, 1:] * np.outer(wider, wider)
    count = max(map(len, columns))
    freedom = np.maximum(plain.freedom[1:] * noise.share(count), 1.0)
    near = noise.correlation(count)[1]
    note = f"neighbours in time correlate by {near:.2f}: standard errors allow for it"
    if len(used) < _ENOUGH_RUNS:
        runs = "one run" if len(used) == 1 else f"{len(used)} runs"
        note += f". Drift slower than a run does not show in {runs}: measure {_ENOUGH_RUNS} or more"
    return Uncertainty("correlated", *_with_constant(plain.covariance, covariance, freedom), note)


def weight_sum(weights: Array | None, size: int) -> float:
    """Sum of the weights of ``size`` readings."""
    return float(size) if weights is None else float(weights.sum())


def clusters_of(
    problem: Problem, fitted: SolvedProblem, weights: Sequence[Array | None], index: int
) -> NormalEquations:
    """Sums of a run about its mean and the fit."""
    solution = fitted.solution
    a, b = (np.concatenate([np.zeros(0), *part]) for part in (solution.cosine, solution.sine))
    found = np.column_stack([a, b]).ravel()
    sums = NormalEquations.of_products(problem.products(weights, index))
    # Of nuisances nothing is left in the readings.
    return sums.about(np.concatenate([found, np.zeros(len(sums.moment) - found.size)]))


def _bias(
    problem: Problem, fitted: SolvedProblem, weights: Sequence[Array | None], penalty: float
) -> Array:
    """What a penalty may have taken from the coefficients, as a covariance (see `penalty`)."""
    from .ridge import REACH, bias_covariance, error_range, pattern_variances

    used = [i for i in range(len(problem.runs)) if not np.isnan(fitted.offsets[i])]
    parts = [problem.products(weights, i) for i in used]
    means = [part[0] / part[0, 0] for part in parts]
    sums = total([NormalEquations.of_products(part) for part in parts])
    lowest = [min(shaft.orders, default=1.0) for shaft in problem.shafts]
    steps = [
        order / low
        for shaft, low in zip(problem.shafts, lowest, strict=True)
        for order in shaft.orders
    ]
    variances = pattern_variances(
        sums.gram,
        sums.moment,
        fitted.solution.residual_variance,
        np.repeat(steps, 2),
        REACH * error_range(problem, weights),
    )
    full = penalty * sums.readings
    return bias_covariance(sums.gram, np.mean(means, axis=0)[1:-1], full, variances)


def _untold(problem: Problem, used: Sequence[int]) -> str:
    """Where correlation would not have been found; empty where it would."""
    counted = ((problem.base[i], len(problem.runs[i])) for i in used)
    count = sum(size if base is None else np.count_nonzero(base) for base, size in counted)
    if len(used) >= FEWEST_RUNS or count >= _TELLING:
        return ""
    return (
        f"{count} readings in {len(used)} run{'s' if len(used) > 1 else ''} cannot show whether "
        "neighbours correlate: the standard errors hold only if they do not; "
        f"measure {_ENOUGH_RUNS} runs and more"
    )


_CANCEL: Final = "the covariance is that of white noise: orders nearly cancel"


def _with_constant(white: Array, covariance: Array, freedom: Array) -> tuple[Array, Array]:
    """The covariance with the constant: widened by the coefficients' median factor.

    The scatter of the runs' zeros does not show its error, because each run may have its own.
    """
    ratio = np.sqrt(np.diag(covariance) / np.diag(white)[1:])
    scale = np.concatenate([[max(1.0, float(median(ratio)))], ratio])
    full = white * np.outer(scale, scale)
    full[1:, 1:] = covariance
    return full, np.concatenate([[float(median(freedom))], freedom])
