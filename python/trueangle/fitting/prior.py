"""A prior for the coefficients of a unit, and the posterior: what others of its design are like.

With ``b ~ N(μ, T)`` and readings of noise s the coefficients are normal about

::

    b̂ = (X'X/s² + T⁻¹)⁻¹ (X'y/s² + T⁻¹ μ)

with the covariance ``V = (X'X/s² + T⁻¹)⁻¹``: few readings suffice for what the units
differ in little. Where runs of one unit differ by more than such noise makes them, by variances Q
of their coefficients, a run determines its unit no better than that, and the covariance is

::

    V + Σ_r V A_r Q A_r V,    A_r = X_r'X_r/s²
"""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, Final, NamedTuple

import numpy as np

from ..errors import ArgumentError, KindError
from ..estimation.linear import NormalEquations, total
from ..joint.shafts import ShaftOrders
from ..model.model import Argument
from ..model.validity import check_invertible
from ..runs.outliers import WILD
from ..runs.run import CalibrationRun
from ..support.angles import circular_mean, unit_name, wrap
from ..support.arrays import Array
from ..support.suggestions import check_choice
from .argument import ARGUMENTS, AnyArgument
from .problem import PlainSolution, Problem, SolvedProblem
from .robust import Loss, RobustFit

#: Rounds in which the outliers and the noise settle: each round removes part of the difference.
_ROUNDS: Final = 20

#: Options that cannot be combined with a prior, and their defaults.
_USUAL: dict[str, Any] = {
    "nuisance": "none",
    "covariance": "auto",
    "ridge": None,
    "method": None,
    "reference_orders": (),
}


@dataclass(frozen=True, eq=False)
class Prior:
    """The coefficients of a further unit, before it is measured.

    Attributes
    ----------
    period : float
    shafts : tuple of ShaftOrders
    mean, variance : ndarray, shape (2 K,)
        Of cosine and sine of each order of each shaft in turn; the variance holds that of the mean.
    freedom : float
        Degrees of freedom of the variances.
    noise_variance, noise_freedom : float
        Of one reading, and its degrees of freedom.
    units : int
        From which it was estimated.
    run_variance : ndarray, shape (2 K,), or None
        Of the coefficients of single runs about their unit's, beyond what the noise of readings
        makes of it; None where they do not differ.
    """

    period: float
    shafts: tuple[ShaftOrders, ...]
    mean: Array
    variance: Array
    freedom: float
    noise_variance: float
    noise_freedom: float
    units: int
    run_variance: Array | None = None

    def among(self, shafts: Sequence[ShaftOrders]) -> Prior:
        """For these orders, those that it does not know left free."""
        known = {
            (shaft.cycles_per_turn, order): i
            for i, (shaft, order) in enumerate(
                (shaft, order) for shaft in self.shafts for order in shaft.orders
            )
        }
        mean: list[float] = []
        variance: list[float] = []
        between: list[float] = []
        run_variance = np.zeros(self.mean.size) if self.run_variance is None else self.run_variance
        for shaft in shafts:
            for order in shaft.orders:
                i = known.get((shaft.cycles_per_turn, order))
                place = slice(0, 0) if i is None else slice(2 * i, 2 * i + 2)
                mean += [0.0, 0.0] if i is None else self.mean[place].tolist()
                variance += [math.inf] * 2 if i is None else self.variance[place].tolist()
                between += [0.0, 0.0] if i is None else run_variance[place].tolist()
        return replace(
            self,
            shafts=tuple(shafts),
            mean=np.array(mean),
            variance=np.array(variance),
            run_variance=np.array(between) if any(between) else None,
        )


class Posterior(NamedTuple):
    """What a prior and readings gave.

    ``own`` is the share of each order's prior variance that the readings took away, ``freedom``
    the degrees of freedom of the standard errors, ``units`` those that the prior is known from.
    """

    own: tuple[float, ...]
    freedom: float
    units: int
    noise: float

    @property
    def share(self) -> float:
        """Of all orders together, with equal weights."""
        return float(np.mean(self.own)) if self.own else 1.0

    def note(self) -> str:
        """The share in words."""
        return (
            f"fitted with a prior from {self.units} units of its design. {100.0 * self.share:.0f} "
            "% of the coefficients is the unit's own readings, on average over the orders. "
            "Standard errors and intervals include the bias of the prior, for units of this design"
        )


def fleet_prior(given: Any, period: float) -> Prior:
    """A prior, or that of a fleet, for readings of this period.

    Raises
    ------
    KindError
        Neither.
    ArgumentError
        Of another period.
    """
    found = given if isinstance(given, Prior) else getattr(given, "prior", None)
    if not isinstance(found, Prior):
        raise KindError(f"prior must be a trueangle.Fleet, got {given!r:.60}")
    if found.period != period:
        raise ArgumentError(
            f"prior is in {unit_name(found.period)} and the runs are in {unit_name(period)}: "
            "convert one of them"
        )
    return found


def posterior(problem: Problem, prior: Prior, loss: str) -> tuple[RobustFit, Posterior]:
    """The fit under a prior; readings more than 8 deviations off are rejected unless ``"linear"``.

    Raises
    ------
    ArgumentError
        Another loss than these two.
    """
    if loss not in ("auto", "linear"):
        raise ArgumentError(f"loss must be 'auto' or 'linear' with `prior=`, got {loss!r}")
    prior = prior.among(problem.shafts)
    weights = list(problem.base)
    found, taken = _solved(problem, prior, weights)
    for _ in range(_ROUNDS if loss == "auto" else 0):
        limit = max(WILD * taken.noise, 1e-12 * problem.period)
        after = [
            np.where(np.abs(left) > limit, 0.0, np.ones(left.size) if base is None else base)
            for left, base in zip(problem.residuals(found), problem.base, strict=True)
        ]
        now = [np.ones(a.size) if w is None else w for w, a in zip(weights, after, strict=True)]
        if all((a == w).all() for a, w in zip(after, now, strict=True)):
            break
        if any(not a.any() for a in after):  # a run that is all outliers is none
            break
        weights = list(after)
        found, taken = _solved(problem, prior, weights)
    given = [
        np.ones(len(run)) if base is None else base
        for run, base in zip(problem.runs, problem.base, strict=True)
    ]
    wild = sum(
        int(np.count_nonzero((w == 0.0) & (b > 0.0)))
        for w, b in zip(weights, given, strict=True)
        if w is not None
    )
    every = [b if w is None else w for w, b in zip(weights, given, strict=True)]
    return RobustFit(found, every if wild else None, wild), taken


def _solved(
    problem: Problem, prior: Prior, weights: Sequence[Array | None]
) -> tuple[SolvedProblem, Posterior]:
    products = [problem.products(weights, i) for i in range(len(problem.runs))]
    means = np.array([part[0] / part[0, 0] for part in products])
    of_runs = [NormalEquations.of_products(part) for part in products]
    sums = total(of_runs)
    size, runs = sums.moment.size, len(problem.runs)
    fixed = ~(prior.variance > 0.0)  # an order that no unit has of its own: its mean, exactly
    precision = np.divide(1.0, prior.variance, out=np.zeros(size), where=~fixed)
    apart = sums.moment - sums.gram @ np.where(fixed, prior.mean, 0.0)
    noise, freedom = prior.noise_variance, 1.0
    free = ~fixed
    for _ in range(200):
        hessian = (sums.gram / noise + np.diag(precision))[np.ix_(free, free)]
        target = (apart / noise + precision * prior.mean)[free]
        model = NormalEquations(hessian, target).solved()
        inverse = np.zeros((size, size))
        inverse[np.ix_(free, free)] = model.inverse
        found = prior.mean.copy()
        found[free] = model.coefficients[:, 0]
        left = max(sums.about(found).squares, 0.0)
        spent = float(np.einsum("ij,ji->", sums.gram / noise, inverse))
        freedom = max(sums.readings - runs - spent, 0.0)
        if math.isinf(prior.noise_freedom):
            break
        before = noise
        noise = (prior.noise_freedom * prior.noise_variance + left) / (
            prior.noise_freedom + freedom
        )
        if abs(noise - before) <= 1e-12 * before:
            break
    zeros = np.array(
        [circular_mean(r.indicated - r.reference, problem.period) for r in problem.runs]
    )
    offsets = wrap(zeros + means[:, -1] - means[:, 1:-1] @ found, problem.period)
    across = means[:, 1:-1].mean(axis=0)
    own = noise * sum(1.0 / float(part[0, 0]) for part in products) / runs**2
    covariance = np.empty((size + 1, size + 1))
    covariance[1:, 1:] = inverse
    covariance[0, 1:] = covariance[1:, 0] = -inverse @ across
    covariance[0, 0] = own + across @ inverse @ across
    if prior.run_variance is not None:
        for run, mean in zip(of_runs, means[:, 1:-1], strict=True):
            # What a run's own coefficients make of the zero, and of the unit's.
            moved = inverse @ run.gram / noise
            both = np.vstack([mean / runs - across @ moved, moved])
            covariance += (both * prior.run_variance) @ both.T
    pairs = found.reshape(-1, 2)
    edges = np.cumsum([len(shaft.orders) for shaft in problem.shafts])[:-1]
    parts = np.split(pairs, edges)
    solution = PlainSolution(
        offsets,
        np.sqrt(
            [
                noise / float(p[0, 0]) + m @ inverse @ m
                for p, m in zip(products, means[:, 1:-1], strict=True)
            ]
        ),
        circular_mean(offsets, problem.period),
        [part[:, 0].tolist() for part in parts],
        [part[:, 1].tolist() for part in parts],
        covariance,
        left / freedom if freedom > 0.5 else noise,
        freedom,
        size + runs,
        math.sqrt(float(np.linalg.cond(hessian))) if free.any() else 1.0,
        "plain",
    )
    taken = np.divide(np.diag(inverse), prior.variance, out=np.ones(size), where=free)
    shares = 1.0 - np.clip(taken, 0.0, 1.0).reshape(-1, 2).mean(axis=1)
    worth = min(prior.freedom, prior.noise_freedom + freedom)
    known = Posterior(tuple(shares.tolist()), max(worth, 1.0), prior.units, math.sqrt(noise))
    return SolvedProblem(solution, offsets, problem.shafts, problem.period), known


def fitted_with_prior(
    runs: Sequence[CalibrationRun],
    prior: Any,
    shafts: list[ShaftOrders] | None,
    argument: AnyArgument,
    loss: Loss,
    asked: Mapping[str, Any],
) -> tuple[Problem, RobustFit, Posterior]:
    """See `trueangle.fit` with ``prior``."""
    for name, value in asked.items():
        if not (value is None or value == _USUAL[name]):
            raise ArgumentError(f"{name} does not go with `prior=`; leave one of them out")
    check_choice("argument", argument, ARGUMENTS)
    known = fleet_prior(prior, runs[0].period)
    angle: Argument = "reference" if argument == "auto" else argument
    problem = Problem(runs, list(known.shafts) if shafts is None else shafts, angle)
    weighted, taken = posterior(problem, known, loss)
    check_invertible(weighted.fitted.series.slope_bound)
    return problem, weighted, taken
