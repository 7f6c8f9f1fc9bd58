"""Outliers: robust losses, spikes and readings rejected, weights, variances, where both break down.

A bit flip or a slipped tooth leaves one reading degrees off, and least squares spreads
it over every coefficient.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Final, Literal, NamedTuple, TypeAlias

import numpy as np
from numpy.typing import NDArray

from ..runs.outliers import WILD, WILD_SHARE, outlying, robust_scale
from ..runs.run import CalibrationRun
from ..support.arrays import Array
from ..support.display_units import brief_number
from ..support.suggestions import check_choice
from .problem import Problem, SolvedProblem

Loss: TypeAlias = Literal["auto", "linear", "huber", "tukey"]
LOSSES: tuple[Loss, ...] = ("auto", "linear", "huber", "tukey")

#: Tuning constants for 95 % efficiency at the normal distribution (Huber 1981, Beaton
#: and Tukey 1974).
HUBER = 1.345
TUKEY = 4.685


#: Readings further off than this (robust standard deviations) are rare: 0.7 % of normal ones.
FAR = 2.7

#: With fewer readings a share means nothing.
FEW = 50

#: With more than this share of them the scale itself is in doubt.
MANY = 0.06

#: Readings that had inflated the scale are outliers if without them it falls by this factor.
HIDDEN = 5.0

#: Rounds of re-weighting end when no weight moves by more than this, or after `STEPS`; of many
#: orders, which each round solves again, earlier: after `_WORK` multiplications, but not before
#: `FEWEST_STEPS`.
SETTLED = 1e-4
STEPS = 50
FEWEST_STEPS = 6
_WORK = 4e9

#: With this share of them a robust fit of several orders fails wherever they are.
_MOST: Final = 0.15


class RobustFit(NamedTuple):
    """A robust fit: its weights (None where all are as given) and what it ended with.

    ``far`` is the share of readings beyond `FAR` robust standard deviations; ``unsettled`` the
    rounds after which weights or outliers still changed, 0 where they settled.
    """

    fitted: SolvedProblem
    weights: list[Array] | None
    wild: int
    far: float = 0.0
    unsettled: int = 0


def fit_robustly(problem: Problem, loss: Loss, floor: float) -> RobustFit:
    """Fit under a robust loss.

    ``"linear"`` keeps the weights given. ``"huber"`` and ``"tukey"`` re-weight until the
    weights settle. ``"auto"`` fits by least squares, and only where a reading lies more
    than 8 robust standard deviations off rejects such readings (weight 0), starting
    from the Huber fit so that they cannot hide each other; the others are fitted by plain least
    squares, so clean data give the least-squares coefficients exactly.

    Deviations below ``floor`` are rounding, never outliers; ``wild`` of the result counts readings
    whose weight became 0.
    """
    check_choice("loss", loss, LOSSES)
    if loss == "linear":
        return RobustFit(problem.solve(problem.base), None, 0)
    if loss == "auto":
        return _set_aside(problem, floor)
    weights, unsettled = _iterate(problem, _huber, problem.base, floor)
    if loss == "tukey":
        weights, unsettled = _iterate(problem, _tukey, weights, floor)
    wild = rejected(weights, problem.base)
    fitted = problem.solve(weights)
    counted = _counted(problem, problem.residuals(fitted))
    far = _share(counted, robust_scale(counted))
    return RobustFit(fitted, weights, wild, far, unsettled)


def fit_without_outliers(problem: Problem, outliers: int) -> RobustFit:
    """The plain fit of a problem from which ``outliers`` readings were rejected before."""
    fitted = problem.solve(problem.base)
    if outliers:
        return RobustFit(fitted, None, outliers, outliers / problem.readings)
    sample, _ = problem.scan(fitted)
    return RobustFit(fitted, None, 0, _share(sample, robust_scale(sample)))


def unsettled_weights_sentence(weighted: RobustFit) -> str:
    """A sentence on re-weighting that did not settle."""
    return (
        f"outliers still changed after {weighted.unsettled} rounds of rejecting them, the "
        "limit for this number of orders: fit fewer, or use loss='linear'"
    )


def rejected(weights: Sequence[Array], given: Sequence[Array | None]) -> int:
    """Readings that counted as they were given, and do not now."""
    each = zip(weights, given, strict=True)
    return sum(int(((w == 0.0) & (given_weights(g, w.size) > 0.0)).sum()) for w, g in each)


def _rounds(problem: Problem) -> int:
    """Rounds of re-weighting that a problem may take."""
    unknowns = problem.unknowns + len(problem.runs)
    # Readings for each unknown beyond which a solution takes them in one pass.
    work = unknowns**2 * min(problem.readings, 32 * unknowns)
    return max(FEWEST_STEPS, min(STEPS, int(_WORK / max(work, 1))))


def _share(residuals: Array, scale: float) -> float:
    """Share of readings beyond `FAR` robust standard deviations; 0 of a few, which show nothing."""
    if residuals.size < FEW:
        return 0.0
    return np.count_nonzero(np.abs(residuals) > FAR * scale) / residuals.size


def _set_aside(problem: Problem, floor: float) -> RobustFit:
    fitted = problem.solve(problem.base, watch=True)
    sample, bound = problem.scan(fitted)
    scale = robust_scale(sample)
    plain = RobustFit(fitted, None, 0, _share(sample, scale))
    limit = max(WILD * scale, floor)
    hidden = bound <= limit or problem.largest(fitted) <= limit
    # Many readings far off together widen the scale behind which they hide.
    if hidden and not (plain.far > MANY and scale > floor):
        return plain
    found = plain
    start, _ = _iterate(problem, _huber, problem.base, floor)
    wild = _wild(problem, problem.solve(start), floor)
    rounds = _rounds(problem)
    absent = sum(np.count_nonzero(b == 0.0) for b in problem.base if b is not None)
    readings = wild.size - absent
    for _ in range(rounds):
        share = np.count_nonzero(wild) / readings
        if share == 0.0 or share > WILD_SHARE:
            return plain
        edges = np.cumsum([len(run) for run in problem.runs])[:-1]
        weights = [
            np.where(far, 0.0, given_weights(b, far.size))
            for far, b in zip(np.split(wild, edges), problem.base, strict=True)
        ]
        found = RobustFit(problem.solve(weights), weights, int(np.count_nonzero(wild)), share)
        again = _wild(problem, found.fitted, floor)
        if (again == wild).all():
            break
        wild = again
    else:
        found = found._replace(unsettled=rounds)
    if hidden and HIDDEN * robust_scale(problem.scan(found.fitted)[0]) > scale:
        return plain  # what the model lacks does not go away with some readings
    return found


def without_spikes(run: CalibrationRun) -> CalibrationRun:
    """The run with outliers given weight 0, found without any model.

    For choosing orders (`trueangle.runs.outliers`); `fit_robustly` looks again with the model.
    """
    rows, _ = outlying(run)
    if not rows.size:
        return run
    weights = given_weights(run.weights, len(run)).copy()
    weights[rows] = 0.0
    return replace(run, weights=weights)


def _wild(problem: Problem, fitted: SolvedProblem, floor: float) -> NDArray[np.bool_]:
    """Which of all readings, run after run, are outliers; those of weight 0 never are."""
    residuals = problem.residuals(fitted)
    given = [given_weights(b, r.size) for b, r in zip(problem.base, residuals, strict=True)]
    limit = max(WILD * robust_scale(_counted(problem, residuals)), floor)
    return np.asarray((np.abs(np.concatenate(residuals)) > limit) & (np.concatenate(given) > 0.0))


def _counted(problem: Problem, residuals: Sequence[Array]) -> Array:
    """Those of the readings of weight above 0, run after run."""
    return np.concatenate(
        [r if b is None else r[b > 0.0] for r, b in zip(residuals, problem.base, strict=True)]
    )


def _iterate(
    problem: Problem,
    weight: Callable[[Array], Array],
    start: Sequence[Array | None],
    floor: float,
) -> tuple[list[Array], int]:
    """Re-weight from ``start`` until no weight moves; rounds after which they still did, or 0."""
    current: Sequence[Array | None] = start
    weights: list[Array] = []
    rounds = _rounds(problem)
    for _ in range(rounds):
        residuals = problem.residuals(problem.solve(current))
        scale = max(robust_scale(_counted(problem, residuals)), floor)
        weights = [
            given_weights(b, r.size) * weight(np.abs(r) / scale)
            for b, r in zip(problem.base, residuals, strict=True)
        ]
        moved = max(
            float(np.abs(w - given_weights(c, w.size)).max())
            for w, c in zip(weights, current, strict=True)
        )
        current = weights
        if moved <= SETTLED:
            return weights, 0
    return weights, rounds


def given_weights(weights: Array | None, size: int) -> Array:
    """Weights as numbers: ones where none were given."""
    return np.ones(size) if weights is None else weights


def _huber(distance: Array) -> Array:
    return HUBER / np.maximum(distance, HUBER)


def _tukey(distance: Array) -> Array:
    return np.square(np.maximum(0.0, 1.0 - np.square(distance / TUKEY)))


class Sandwich(NamedTuple):
    """Factors for variances that were computed with the loss's weights as those of the readings.

    Treated so, a reading far off counts in the noise by its distance, though it moves the
    coefficients by a bounded step.

    ``white``: of covariances of white noise; ``bread``: of those by how scores scatter.
    """

    white: float = 1.0
    bread: float = 1.0


def sandwich(
    problem: Problem, fitted: SolvedProblem, weights: Sequence[Array | None], loss: str
) -> Sandwich:
    """The factors of an M-estimate; 1 for least squares, whether readings were rejected or not.

    With ``ψ = w r`` and the weights b as given, its covariance is

    ::

        K² [Σ b ψ² / (n - p)] / m² (X' B X)⁻¹,    m = Σ b ψ' / Σ b,
        K = 1 + (p / n) var(ψ') / m²

    and ``X' W X ≈ w̄ X' B X``. Source: Huber, Robust Statistics (1981), section 7.6.
    """
    if loss not in ("huber", "tukey"):
        return Sandwich()
    parts = problem.residuals(fitted)
    rest = np.concatenate(parts)
    base, both = (
        np.concatenate(
            [np.ones(r.size) if w is None else w for w, r in zip(of, parts, strict=True)]
        )
        for of in (problem.base, weights)
    )
    used = base > 0.0
    rest, base, both = rest[used], base[used], both[used]
    weight, squares = both / base, float(both @ rest**2)
    slope = _slope(weight, loss)
    mean, bend = float(np.average(weight, weights=base)), float(np.average(slope, weights=base))
    if not (squares > 0.0 and bend > 0.0):
        return Sandwich()
    spread = float(np.average((slope - bend) ** 2, weights=base)) / bend**2
    few = 1.0 + (problem.unknowns + len(problem.runs)) / rest.size * spread
    scores = float((both * weight) @ rest**2) / squares / mean
    bread = (few * mean / bend) ** 2
    return Sandwich(scores * bread, bread)


def _slope(weight: Array, loss: str) -> Array:
    """``ψ'`` of readings of these weights."""
    if loss == "huber":
        return np.where(weight >= 1.0 - SETTLED, 1.0, 0.0)
    root = np.sqrt(weight)
    return np.asarray(root * (5.0 * root - 4.0))


def robust_breakdown_sentence(problem: Problem, weighted: RobustFit) -> str:
    """A sentence on a robust fit that may have failed; empty otherwise."""
    share, robust = weighted.far, weighted.weights is not None or weighted.wild > 0
    if share <= MANY and not robust:
        return ""
    rest = problem.residuals(weighted.fitted)
    scale, near = robust_scale(_counted(problem, rest)), _between_neighbours(problem, rest)
    # `MANY` where neighbours in angle agree three times better than the fit: the wrong readings
    # are adjacent, and the model has bent towards them.
    bent = scale > 3.0 * near
    if robust and share > (MANY if bent else _MOST):
        return (
            f"{100.0 * share:.0f} % of the readings are far from the curve (beyond {FAR:g} robust "
            "standard deviations; normal noise: 0.7 %). If they are adjacent, the coefficients are "
            "wrong by far more than their standard errors: look at the residuals, and fit without "
            "these readings, or without the run that has them"
        )
    # Most neighbours are equal where a joint rests or a grid is coarse: they give no scale.
    if not bent or near == 0.0:
        return ""
    # A block of readings that the few orders cannot follow widens the scale it is judged by.
    many = ", which a robust fit does not withstand" if robust else ""
    return (
        f"neighbours in angle agree {brief_number(scale / near)} times better than the model fits "
        f"them: it lacks an effect, or wrong readings are adjacent{many}; look at the residuals"
    )


def _between_neighbours(problem: Problem, residuals: list[Array]) -> float:
    """Standard deviation of a reading by how neighbours in angle differ, run by run."""
    steps = []
    for rest, x, base in zip(residuals, problem.angles, problem.base, strict=True):
        order = np.argsort(np.mod(x, problem.period), kind="stable")
        steps.append(np.diff(rest[order if base is None else order[base[order] > 0.0]]))
    return robust_scale(np.concatenate(steps)) / math.sqrt(2.0)
