"""The fit of orders that were chosen by evidence: the mixture over models and noises.

Outliers are readings more than 8 robust standard deviations off its curve. They are rejected,
and orders and coefficients are estimated again, until the same readings are rejected twice.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from ..errors import NoModelError, NoOrderError
from ..estimation.evidence import EvidenceEstimate
from ..joint.shafts import ShaftOrders
from ..runs.outliers import WILD, WILD_SHARE, robust_scale
from ..runs.run import CalibrationRun
from ..support.angles import circular_mean, wrap
from ..support.arrays import Array, median
from .orders.result import OrderSelection
from .orders.zerogroups import some_angles
from .problem import PlainSolution, Problem, SolvedProblem
from .robust import FAR, RobustFit, given_weights, rejected
from .uncertainty import Uncertainty

#: Rounds of setting outliers aside.
_ROUNDS: Final = 6


class MixtureFit(NamedTuple):
    """Orders, coefficients and covariance of a problem."""

    selection: OrderSelection
    problem: Problem
    weighted: RobustFit
    uncertainty: Uncertainty


def fit_mixture(
    runs: Sequence[CalibrationRun],
    calm: Sequence[CalibrationRun],
    selection: OrderSelection,
    choose: Callable[[Sequence[CalibrationRun]], OrderSelection],
    resolve: Callable[[OrderSelection], list[ShaftOrders]],
    robust: bool,
    floor: float,
) -> MixtureFit:
    """Fit the orders of a selection, which ``choose`` made of ``calm``, the runs without spikes.

    Deviations below ``floor`` are rounding, never outliers.

    Raises
    ------
    NoModelError
        The runs differ by so much that a further one may be made worse.
    NoOrderError
        Without the outliers the readings support no order.
    """
    given = [given_weights(run.weights, len(run)) for run in runs]
    weights = [given_weights(run.weights, len(run)) for run in calm]
    rounds, far = _ROUNDS if robust else 0, 0.0
    while True:
        problem = Problem(runs, resolve(selection), selection.argument)
        travel = some_angles(problem.angles, problem.period)
        fitted, uncertainty = _fitted(problem, selection, weights, travel)
        after, far = _inliers(problem, fitted, given, floor) if robust else (weights, 0.0)
        same = all(((a > 0.0) == (w > 0.0)).all() for a, w in zip(after, weights, strict=True))
        if same or rounds == 0:
            break
        rounds -= 1
        weights = after
        selection = choose([replace(r, weights=w) for r, w in zip(runs, weights, strict=True)])
        if not selection.orders:
            raise NoOrderError(f"no model: {selection.reason}")
    # Not before: an outlier of one run is a difference between runs.
    if len(runs) > 1 and selection.estimate is not None:
        check_new_run(selection.estimate, travel)
    wild = rejected(weights, given)
    weighted = RobustFit(fitted, weights if wild else None, wild, far, 0 if same else _ROUNDS)
    return MixtureFit(selection, problem, weighted, uncertainty)


def check_new_run(estimate: EvidenceEstimate, travel: Array) -> None:
    """Raise where runs differ so much that a gain in a further one is uncertain."""
    gain, spread = estimate.gain_of_a_run(travel)
    # Standard deviations between runs by which the gain of a further one must exceed nothing.
    if gain <= 2.0 * spread:
        orders = ", ".join(f"{order:g}" for order in estimate.differing[:6])
        average = ", ".join(f"{order:g}" for order in estimate.present)
        raise NoModelError(
            f"no model: runs differ in order{'s' * (',' in orders)} {orders}: a new run may get "
            f"worse. Fit different joints separately; for the average anyway: `orders=[{average}]`"
        )


def _inliers(
    problem: Problem, fitted: SolvedProblem, given: Sequence[Array], floor: float
) -> tuple[list[Array], float]:
    """Weights without the outliers, unless they are too many to be some, and the share far off."""
    # About the middle of its run: an outlier of a short run moves the zero, and so all the others.
    each = zip(problem.residuals(fitted), given, strict=True)
    residuals = [r - median(r[g > 0.0]) for r, g in each]
    counted = np.abs(np.concatenate([r[g > 0.0] for r, g in zip(residuals, given, strict=True)]))
    scale = robust_scale(counted)
    limit = max(WILD * scale, floor)
    far = float(np.mean(counted > FAR * scale))
    if np.mean(counted > limit) > WILD_SHARE:
        return list(given), far
    each = zip(residuals, given, strict=True)
    return [np.where(np.abs(r) > limit, 0.0, g) for r, g in each], far


def _fitted(
    problem: Problem, selection: OrderSelection, weights: Sequence[Array], travel: Array
) -> tuple[SolvedProblem, Uncertainty]:
    """Coefficients and covariance of the orders; zeros are means of what they leave."""
    estimate = selection.estimate
    assert estimate is not None
    wanted = [k * shaft.cycles_per_turn for shaft in problem.shafts for k in shaft.orders]
    # Orders of shafts and of the estimate differ by rounding.
    named = [next((k for k in estimate.told if math.isclose(k, m)), m) for m in wanted]
    # What is omitted on purpose stays omitted: no other order takes its place.
    beside = selection.left_out
    mean, covariance = estimate.among(named, travel, beside)
    offsets, means, squares = [], [], 0.0
    for index, (run, weight) in enumerate(zip(problem.runs, weights, strict=True)):
        columns, shares = problem.columns(index), weight / weight.sum()
        error = run.indicated - run.reference
        zero = circular_mean(error, problem.period)
        left = wrap(error - zero - columns @ mean, problem.period)
        own = float(shares @ left)
        offsets.append(float(wrap(zero + own, problem.period)))
        means.append(shares @ columns)
        squares += float(weight @ (left - own) ** 2)
    used = sum(int(np.count_nonzero(weight)) for weight in weights)
    freedom = max(float(used - len(offsets) - mean.size), 1.0)
    zeros = float(np.mean(estimate.zeros))
    parts = np.array(means)
    common = parts.mean(axis=0)
    whole = np.empty((mean.size + 1, mean.size + 1))
    whole[1:, 1:] = covariance
    whole[0, 1:] = whole[1:, 0] = -covariance @ common
    whole[0, 0] = zeros / len(offsets) + common @ covariance @ common
    pairs = np.split(
        mean.reshape(-1, 2), np.cumsum([len(shaft.orders) for shaft in problem.shafts])[:-1]
    )
    scales = np.sqrt(np.diag(covariance))
    solution = PlainSolution(
        np.array(offsets),
        np.sqrt(zeros + np.einsum("ri,ij,rj->r", parts, covariance, parts)),
        float(circular_mean(np.array(offsets), problem.period)),
        [part[:, 0].tolist() for part in pairs],
        [part[:, 1].tolist() for part in pairs],
        whole,
        squares / freedom,
        freedom,
        mean.size + len(offsets),
        math.sqrt(float(np.linalg.cond(covariance / np.outer(scales, scales)))),
        "evidence",
    )
    found = SolvedProblem(solution, solution.offsets, problem.shafts, problem.period)
    told = estimate.freedom_of_runs(named, np.diag(covariance), freedom)
    return found, Uncertainty(
        "evidence", whole, np.concatenate([[told.min(initial=freedom)], told])
    )
