"""The fit of one unit of a fleet, with what the others are like as its prior."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

from ..errors import ArgumentError
from ..joint.shafts import ShaftOrders
from ..model.model import Argument
from ..model.validity import check_invertible
from ..runs.follows import check_follows
from ..runs.run import CalibrationRun
from ..runs.travel import travelled_span
from ..support.suggestions import check_choice
from .argument import ARGUMENTS, AnyArgument
from .prior import fleet_prior, posterior
from .problem import Problem
from .result import FitResult
from .robust import Loss

__all__ = ["fitted_with_prior"]

#: What does not go with a prior, and what each is where nothing was asked.
_USUAL: dict[str, Any] = {
    "nuisance": "none",
    "covariance": "auto",
    "ridge": None,
    "method": None,
    "reference_orders": (),
}


def fitted_with_prior(
    runs: Sequence[CalibrationRun],
    prior: Any,
    shafts: list[ShaftOrders] | None,
    argument: AnyArgument,
    loss: Loss,
    joint: tuple[float | None, str],
    asked: Mapping[str, Any],
) -> FitResult:
    """See `trueangle.fit` with ``prior``."""
    for name, value in asked.items():
        if not (value is None or value == _USUAL[name]):
            raise ArgumentError(f"{name} does not go with prior=; leave one of them out")
    check_choice("argument", argument, ARGUMENTS)
    for run in runs:
        check_follows(run)
    known = fleet_prior(prior, runs[0].period)
    angle: Argument = "reference" if argument == "auto" else argument
    problem = Problem(runs, list(known.shafts) if shafts is None else shafts, angle)
    weighted, taken = posterior(problem, known, loss)
    check_invertible(weighted.fitted.series.slope_bound)
    return FitResult(
        problem,
        weighted.fitted,
        weighted,
        loss,
        0.0,
        travelled_span(problem.travel, problem.period, problem.is_periodic),
        None,
        joint,
        (taken.note(),),
        "auto",
        posterior=taken,
    )
