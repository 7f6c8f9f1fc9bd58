"""Which covariance holds: white noise, what differs between runs, or correlation within them."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final, Literal, NamedTuple, TypeAlias

import numpy as np

from ..errors import ArgumentError
from ..estimation.linear import (
    FEWEST_RUNS,
    LEVELS,
    NormalEquations,
    cluster_covariance,
    moderated_covariance,
    total,
)
from ..support.arrays import Array, median
from ..support.suggestions import check_choice
from .beside import BesideProblem
from .correlation import (
    ENOUGH_RUNS,
    FEWEST_STRETCHES,
    clusters_of,
    correlation_found,
    residual_memory,
    runs_together,
    weight_sum,
)
from .problem import Problem, SolvedProblem
from .robust import Sandwich, sandwich

if TYPE_CHECKING:
    from .nuisance import Nuisance

CovarianceKind: TypeAlias = Literal["auto", "white", "cluster", "hac"]
COVARIANCES: tuple[CovarianceKind, ...] = ("auto", "white", "cluster", "hac")

#: Readings of one or two runs from which a correlation of 0.2 would be found.
_TELLING: Final = 300


class Uncertainty(NamedTuple):
    """Covariance of ``[constant, A, B, ...]``, its kind, and freedom of each variance.

    ``noise_freedom``: the fewest degrees of freedom of any variance without the bias of a penalty;
    None for those of ``freedom``.
    """

    kind: Literal["white", "cluster", "hac", "evidence"]
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
            "further runs, or take `covariance='hac'`"
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
    (`trueangle.fitting.beside`). A robust ``loss`` gives readings less weight,
    which does not make them less precise (`trueangle.fitting.robust.Sandwich`).

    The scatter of few runs is moderated by white noise and by what the coefficients have in common
    (`trueangle.estimation.linear.moderated_covariance`). One or two runs are white noise unless
    correlation is found: then the clusters are segments eight correlation times of the residuals
    long: right where the correlation decays within a run, which one run cannot prove, so that a
    note states it. The bias of a penalty is added to either
    (`trueangle.fitting.ridge`).
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
    if kind == "white" or not np.isfinite(white).all() or len(white) == 1:
        return Uncertainty("white", white, freedom)
    used = [i for i in range(len(problem.runs)) if not np.isnan(fitted.offsets[i])]
    said = note = ""
    if kind == "auto" and len(used) < FEWEST_RUNS:
        said = correlation_found(problem, fitted, weights, used)
        if not said:
            return Uncertainty("white", white, freedom, _untold(problem, used))
        kind, said = "hac", f"the residuals are not white noise ({said}): "
    if kind == "hac":
        memory, stretches = residual_memory(problem, fitted, weights, used)
        if problem.summed or min(stretches) < FEWEST_STRETCHES:
            why = _SUMMED if problem.summed else _SHORT
            unknowns = problem.unknowns + len(used)
            return _thinned(white, problem.readings / memory, unknowns, memory, said, why)
        parts = zip(used, stretches, strict=True)
        clusters = [one for i, n in parts for one in clusters_of(problem, fitted, weights, i, n)]
        note = (
            f"{said}standard errors by the scatter of {len(clusters)} segments of the readings, "
            f"correlated over about {memory:.0f} readings. A slower drift cannot be estimated from "
            f"{'one run' if len(used) == 1 else f'{len(used)} runs'}: measure "
            f"{ENOUGH_RUNS} runs and more"
        )
    else:
        clusters = runs_together([clusters_of(problem, fitted, weights, i, 1)[0] for i in used])
    try:
        weight = sum(weight_sum(weights[i], len(problem.runs[i])) for i in used)
        scatter = cluster_covariance(clusters, penalty * weight)
        scatter = scatter._replace(covariance=bent.bread * scatter.covariance)
        if kind == "auto":
            kind = "cluster"
            # Runs that scatter by nothing are copies, or what they leave is a pattern.
            if not (np.diag(scatter.covariance) > LEVELS[0] * np.diag(white)[1:]).any():
                return Uncertainty("white", white, freedom)
            scatter = moderated_covariance(scatter, white[1:, 1:], solution.degrees_of_freedom)
    except np.linalg.LinAlgError:
        return Uncertainty("white", white, freedom, _CANCEL)
    return Uncertainty(kind, *_with_constant(white, *scatter), note)


_SHORT: Final = "The runs are too short for their correlation time"
_SUMMED: Final = "One pass keeps no segments"


def _thinned(
    white: Array, independent: float, unknowns: int, memory: float, said: str, why: str
) -> Uncertainty:
    """As if every ``memory`` correlated readings were one independent reading.

    The scatter of a few segments has fewer directions than there are coefficients: its
    standard errors may come out arbitrarily small.
    """
    told = "standard errors as for independent readings"
    if round(memory) > 1:
        told = f"{memory:.0f} readings carry the information of one"
    note = (
        f"{said}{told}. {why}, and the covariance is not known: measure {ENOUGH_RUNS} runs and more"
    )
    # The fit takes its unknowns from the independent readings, which makes the residuals smaller.
    left = max(independent - unknowns, 1.0)
    wider = memory * max(independent / left, 1.0)
    return Uncertainty("hac", white * wider, np.full(len(white), left), note)


def _bias(
    problem: Problem, fitted: SolvedProblem, weights: Sequence[Array | None], penalty: float
) -> Array:
    """What a penalty may have taken from the coefficients, as a covariance (see `penalty`)."""
    from .ridge import REACH, bias_covariance, error_range, pattern_variances

    used = [i for i in range(len(problem.runs)) if not np.isnan(fitted.offsets[i])]
    parts = [problem.products(weights, i, 1)[0] for i in used]
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
        f"measure {ENOUGH_RUNS} runs and more"
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
