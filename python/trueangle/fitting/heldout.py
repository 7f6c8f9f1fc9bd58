"""What a fit gains on readings that took no part in it: runs or folds of them held out in turn."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, cast

import numpy as np

from ..errors import (
    ArgumentError,
    NoModelError,
    NoOrderError,
    OutsideSpanWarning,
    TrueAngleError,
    UnlikeRunsWarning,
)
from ..joint.shafts import Shaft
from ..model.model import HarmonicModel
from ..runs.run import CalibrationRun
from ..support.angles import ARCSEC_PER_TURN, circular_mean, wrap
from ..support.arrays import Array
from ..support.plainresult import ShownResult
from .mixture import check_new_run
from .orders.zerogroups import some_angles
from .robust import Loss

if TYPE_CHECKING:
    from .result import FitResult

__all__ = ["HeldOut", "HeldOutRun", "correct_held_out", "folds", "hold_out", "in_order"]

#: Most refits, and most of them with a selection of orders, which costs more: with more
#: runs several are held out together.
_MOST_FOLDS, _MOST_SELECTIONS = 12, 5
#: Resamples of the runs for the interval of the reduction, and the fewest runs for one.
_RESAMPLES, _FEWEST_RUNS = 2000, 3


@dataclass(frozen=True, eq=False)
class HeldOutRun:
    """Error of one run before and after correction by a model of the other runs.

    Attributes
    ----------
    label : str
    model : HarmonicModel or None
        None where the other runs supported no order: nothing is corrected.
    before, after : ndarray
        Arcsec per reading, each less its own circular mean: every run has its own zero.
    """

    label: str
    run: CalibrationRun
    model: HarmonicModel | None
    before: Array
    after: Array


@dataclass(frozen=True, eq=False)
class HeldOut(ShownResult):
    """Gain on held-out runs.

    Attributes
    ----------
    runs : tuple of HeldOutRun
    left_in : tuple of (str, str)
        Runs that could not be held out, and why: without them the orders are not
        separable, for example.
    """

    runs: tuple[HeldOutRun, ...]
    left_in: tuple[tuple[str, str], ...]

    @property
    def rms_before(self) -> float:
        """Root mean square over all held-out readings before correction, arcsec."""
        return _rms([run.before for run in self.runs])

    @property
    def rms_after(self) -> float:
        """The same after correction."""
        return _rms([run.after for run in self.runs])

    @property
    def reduction(self) -> float:
        """``1 - rms_after / rms_before``; negative when correction makes new runs worse."""
        return 1.0 - self.rms_after / self.rms_before if self.rms_before > 0.0 else 0.0

    @property
    def reduction_interval(self) -> tuple[float, float] | None:
        """95 % interval of `reduction` by resampling whole runs; None below three runs."""
        if len(self.runs) < _FEWEST_RUNS:
            return None
        squares = np.array([[r.before @ r.before, r.after @ r.after] for r in self.runs])
        pick = np.random.default_rng(0).integers(len(squares), size=(_RESAMPLES, len(squares)))
        before, after = squares[pick].sum(axis=1).T
        ratio = np.sqrt(after / np.where(before > 0.0, before, np.inf))
        low, high = np.quantile(1.0 - ratio, [0.025, 0.975])
        return float(low), float(high)


def hold_out(fit: FitResult) -> HeldOut:
    """Hold out each run of a fit, fit the others the same way, correct the one held out.

    With many runs several are held out together (five or twelve parts, with and without
    a selection of orders).

    Where the orders were selected by evidence they are selected again without the run, from the
    sums of the others (`EvidenceEstimate.without`); the noise is that of all runs.

    Raises
    ------
    ArgumentError
        One run only, or none that can be held out.

    Examples
    --------
    >>> import trueangle as ta
    >>> theta = np.arange(0.0, 360.0, 5.0)
    >>> noise = np.random.default_rng(0).normal(0.0, 1e-3, (3, theta.size))
    >>> error = 0.1 * np.sin(np.radians(theta))
    >>> runs = [ta.CalibrationRun(theta, theta + error + n, period=360.0) for n in noise]
    >>> gain = hold_out(ta.fit(runs, orders=[1]))
    >>> 0.98 < gain.reduction < 0.99
    True
    """
    runs = fit.runs
    if len(runs) < 2:
        raise ArgumentError("one run only: nothing can be held out; measure another run")
    found, left_in = [], []
    most = _MOST_FOLDS if fit.evidence is None else _MOST_SELECTIONS
    for fold in folds(len(runs), most):
        labels = [runs[i].label or str(i + 1) for i in fold]
        try:
            with warnings.catch_warnings():
                # Reported for all runs already.
                warnings.simplefilter("ignore", UnlikeRunsWarning)
                model: HarmonicModel | None = _others(fit, fold)
        except NoModelError:
            model = None
        except TrueAngleError as reason:
            left_in += [(label, str(reason)) for label in labels]
            continue
        found += [
            correct_held_out(model, runs[i], label) for i, label in zip(fold, labels, strict=True)
        ]
    if not found:
        raise ArgumentError(f"no run can be held out: {left_in[0][1]}")
    return HeldOut(in_order(found, runs), tuple(left_in))


def in_order(found: Sequence[HeldOutRun], runs: Sequence[CalibrationRun]) -> tuple[HeldOutRun, ...]:
    """Held-out runs in the order of the fit."""
    place = {id(run): i for i, run in enumerate(runs)}
    return tuple(sorted(found, key=lambda held: place[id(held.run)]))


def folds(count: int, most: int) -> list[list[int]]:
    """Places of the runs that are held out together, at most ``most`` parts."""
    folds = min(count, most)
    return [list(range(start, count, folds)) for start in range(folds)]


def _others(fit: FitResult, fold: Sequence[int]) -> HarmonicModel:
    """The model of the other runs, made as the fit was.

    Raises
    ------
    NoModelError
        The other runs support no order.
    """
    train = [run for i, run in enumerate(fit.runs) if i not in fold]
    if fit.evidence is None:
        shafts = {shaft.name: shaft.cycles_per_turn for shaft in fit.problem.shafts}
        orders = {shaft.name: shaft.orders for shaft in fit.problem.shafts}
        return _refit(fit, train, orders, shafts)
    estimate = fit.evidence.estimate
    if estimate is None or len(estimate.runs) != len(fit.runs):
        # Readings of one run have several zeros: which are held out with it is not known.
        return _refit(fit, train, None, fit.evidence.shafts)
    others = estimate.without(fold)
    problem = fit.problem
    kept = [angles for i, angles in enumerate(problem.angles) if i not in fold]
    travel = some_angles(kept, problem.period)
    beside = fit.evidence.left_out
    chosen = others.carriers(travel, beside)
    if not chosen:
        raise NoOrderError(
            "no model: the other runs show no order above the noise; record more runs"
        )
    # An order need not be a whole number: each is order 1 of its own shaft.
    lines = {f"order {k:g}": k for k in chosen}
    if fit.known is None:
        return _refit(fit, train, dict.fromkeys(lines, (1,)), lines)
    if len(train) > 1:
        check_new_run(others, travel)
    mean, _ = others.among(chosen, travel, beside)
    pairs = zip(lines.items(), mean.reshape(-1, 2).tolist(), strict=True)
    found = tuple(Shaft(name, k, (1,), (a,), (b,)) for (name, k), (a, b) in pairs)
    return HarmonicModel(found, fit.bare_model.constant, problem.period, problem.argument)


def _refit(
    fit: FitResult,
    train: Sequence[CalibrationRun],
    orders: Mapping[str, Iterable[float]] | None,
    shafts: Mapping[str, float],
) -> HarmonicModel:
    from .fit import fitted_to

    ratio, member = fit.joint
    return fitted_to(
        train,
        orders,
        gear_ratio=ratio if orders is None else None,
        fixed_member=member,
        shafts=shafts,
        argument=fit.problem.argument,
        loss=cast(Loss, fit.loss),
        covariance="auto",
    ).bare_model


def correct_held_out(model: HarmonicModel | None, run: CalibrationRun, label: str) -> HeldOutRun:
    """Error of a run before and after correction, each less its own circular mean.

    Raises
    ------
    ArgumentError
        The run is in another unit than the model.
    """
    if model is not None and run.period != model.period:
        raise ArgumentError(
            f"run {label} has period {run.period:g}, the model {model.period:g}: "
            "convert one of them"
        )
    factor = ARCSEC_PER_TURN / run.period
    with warnings.catch_warnings():
        # Readings outside the model's span are part of the verdict, not news.
        warnings.simplefilter("ignore", OutsideSpanWarning)
        # A table takes longer to build than one run does without it.
        corrected = run.indicated if model is None else model.correct(run.indicated, path="exact")
    before, after = (
        factor * wrap(error - circular_mean(error, run.period), run.period)
        for error in (run.indicated - run.reference, corrected - run.reference)
    )
    return HeldOutRun(label, run, model, before, after)


def _rms(parts: Sequence[Array]) -> float:
    return math.sqrt(sum(float(p @ p) for p in parts) / sum(p.size for p in parts))
