"""Which angle the error is a function of: the true one, or the joint's own reading."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final, Literal, NamedTuple, TypeAlias

import numpy as np

from ..errors import TrueAngleError
from ..joint.shafts import ShaftOrders
from ..model.model import Argument
from ..runs.run import CalibrationRun
from ..support.angles import circular_mean, wrap
from ..support.suggestions import check_choice
from .problem import Problem

AnyArgument: TypeAlias = Literal["auto", "reference", "indicated"]
ARGUMENTS: tuple[AnyArgument, ...] = ("auto", "reference", "indicated")


#: Readings and runs looked at, and orders where none are named.
_LOW_ORDERS: Final = tuple(range(1, 9))

#: The indicated angle is taken where a common pattern explains `_MORE` times the energy
#: there, and `_DECISIVE` noise variances more: far beyond what noise does with 8 orders.
_MORE: Final = 1.05
_DECISIVE: Final = 60.0


class ArgumentChoice(NamedTuple):
    """The angle, and why where it is not what a user expects."""

    argument: Argument
    note: str = ""


_REFERENCE: Final = ArgumentChoice("reference")


def choose_argument(
    runs: Sequence[CalibrationRun],
    argument: AnyArgument,
    shafts: Sequence[ShaftOrders] | None = None,
) -> ArgumentChoice:
    """The angle requested; for ``"auto"`` the true one, unless its zero is new in every run.

    Where a rig homes its reference again for every run, the same place of the joint has
    another reference angle each time, and no order repeats in it. The joint's own reading
    keeps its zero. It is taken where the zeros of the runs differ by more than 0.2 deg and
    one pattern over it explains clearly more than one over the reference.

    Raises
    ------
    ArgumentError
        An unknown name.
    """
    if argument == "auto" and len(runs) < 2:
        return _REFERENCE
    check_choice("argument", argument, ARGUMENTS)
    if argument != "auto":
        return ArgumentChoice(argument)
    period = runs[0].period
    runs = runs[:: max(1, len(runs) // 256)]
    # Readings and runs looked at.
    looked_at = [_some(run, max(64, 32_768 // len(runs))) for run in runs]
    zeros = np.array([circular_mean(r.indicated - r.reference, period) for r in looked_at])
    moved = float(np.abs(wrap(zeros - zeros[0], period)).max())
    # Zeros of the runs closer than this part of a turn (0.2 deg) shift no order enough to matter.
    if moved < period / 1800.0:
        return ArgumentChoice("reference")
    asked = shafts or [ShaftOrders("output", 1.0, _LOW_ORDERS)]
    left: list[float] = []
    for angle in ("reference", "indicated"):
        try:
            problem = Problem(looked_at, asked, angle)
            solution = problem.solve(problem.base).solution
        except TrueAngleError:
            return ArgumentChoice("reference")
        left.append(solution.residual_variance * solution.degrees_of_freedom)
    energy = sum(_energy(run) for run in looked_at)
    noise = left[1] / solution.degrees_of_freedom
    true, own = (energy - rest for rest in left)
    if not (own > _MORE * true and own - true > _DECISIVE * noise):
        return ArgumentChoice("reference")
    return ArgumentChoice(
        "indicated",
        "the zero of the reference changes from run to run (by up to "
        f"{moved * 360.0 / period:.3g} deg) and the pattern follows the joint's own reading: "
        "fitted over the indicated angle",
    )


def run_at_indicated(run: CalibrationRun) -> CalibrationRun:
    """The run with its own reading as the angle, and the same errors."""
    return replace(run, reference=run.indicated, indicated=run.indicated + run.centred_error)


def _some(run: CalibrationRun, most: int) -> CalibrationRun:
    """Readings of the run at random: every n-th would meet the same places of a grid."""
    if len(run) <= most:
        return CalibrationRun(run.reference, run.indicated, run.period, weights=run.weights)
    rows = np.sort(np.random.default_rng(0).choice(len(run), most, replace=False))
    weights = None if run.weights is None else run.weights[rows]
    return CalibrationRun(run.reference[rows], run.indicated[rows], run.period, weights=weights)


def _energy(run: CalibrationRun) -> float:
    """Weighted sum of squares of the errors about their mean."""
    weights = np.ones(len(run)) if run.weights is None else run.weights
    error = run.centred_error
    total = float(weights.sum())
    if total == 0.0:
        return 0.0
    about = error - float(weights @ error) / total
    return float(weights @ (about * about))
