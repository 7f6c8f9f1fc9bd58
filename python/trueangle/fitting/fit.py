"""Fitting a harmonic model to calibration runs by least squares."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, NamedTuple, Unpack

from ..errors import ArgumentError, NoOrderError, UnlikeRunsWarning
from ..joint.shafts import limited_orders, resolve_orders
from ..model.model import Argument
from ..model.validity import check_invertible
from ..runs.checks.angles import angle_ratio
from ..runs.checks.record import records_of
from ..runs.checks.rows import parted
from ..runs.files import runs_of
from ..runs.follows import check_usable
from ..runs.run import CalibrationRun
from ..runs.source import ReadingOptions
from ..runs.travel import CONDITION, travelled_span, without_drift
from ..support.argumentkinds import told_kinds
from ..support.suggestions import check_choice
from .argument import ARGUMENTS, AnyArgument, ArgumentChoice, choose_argument
from .decoded import decoded
from .problem import Problem
from .result import FitResult
from .robust import (
    Loss,
    fit_robustly,
    fit_without_outliers,
    robust_breakdown_sentence,
    unsettled_weights_sentence,
    without_spikes,
)
from .uncertainty import CovarianceKind, check_covariance
from .worth import of_worth

if TYPE_CHECKING:
    from .orders.result import OrderSelection
    from .summed import SummedReadings

#: Rounding of angles around a whole turn, in parts of a turn: smaller deviations are
#: never treated as outliers.
ROUNDING = 1e-12


@told_kinds
def fit(
    runs: Any,
    orders: Iterable[float] | Mapping[str, Iterable[float]] | str | None = None,
    *,
    gear_ratio: float | None = None,
    fixed_member: str = "circular_spline",
    shafts: Mapping[str, float] | None = None,
    argument: AnyArgument = "auto",
    loss: Loss = "auto",
    ridge: float | None = None,
    covariance: CovarianceKind = "auto",
    nuisance: str | Iterable[str] = "none",
    reference_orders: Iterable[float] = (),
    method: str | None = None,
    threads: int | None = None,
    prior: Any = None,
    **reading: Unpack[ReadingOptions],
) -> FitResult:
    """Fit a harmonic model to one run or several.

    ::

        e_rj = z_r + Σ_s Σ_k A_sk cos(k f_s x_rj) + B_sk sin(k f_s x_rj)

    with one zero ``z_r`` per run, by (weighted) linear least squares (paper Eq. 1).

    Parameters
    ----------
    runs : CalibrationRun, path, table, or iterable of them
        Readings in any unit, at any angles, with any zero and any number of turns: runs, or
        files, folders, patterns and tables in memory as `trueangle.read_runs` takes them.
    orders : iterable of int, mapping, "auto" or None
        Orders of the output shaft; or ``{"output": [1, 2], "motor": [1, 2, 4]}``. None and
        ``"auto"`` select them by evidence (`select_orders`).
    gear_ratio : float, optional
        Motor turns per output turn: makes the shafts ``motor`` and ``wave_generator``
        known, and gear orders candidates of the selection.
    fixed_member : {"circular_spline", "flexspline", "none"}
        Of the strain wave gear: decides how fast the wave generator turns against the output.
    shafts : mapping of str to float, optional
        Further shafts and their cycles per output turn; a selection looks at their harmonics.
    argument : {"auto", "reference", "indicated"}
        Which angle the error is a function of. The true angle is right physically and is
        what ``"auto"`` takes, unless the reference has an arbitrary zero in every run: then
        the pattern repeats in the indicated angle only, and the notes report it.
    loss : {"auto", "linear", "huber", "tukey"}
        ``"auto"``: least squares, after readings more than 8 robust standard deviations
        off are rejected (and reported); ``"linear"``: least squares on all readings.
    ridge : float, optional
        Tikhonov penalty relative to the sum of weights. By default 0 on a full turn, and
        chosen by held-out error on partial travel and where orders of several shafts nearly
        cancel over the travel (`trueangle.fitting.ridge.choose_ridge`).
    covariance : {"auto", "white", "cluster", "correlated"}
        ``"white"``: independent readings; ``"cluster"``: by the scatter between whole runs,
        right for any correlation within them; ``"correlated"``: by noise that is correlated in
        time, estimated by its evidence. ``"auto"``: by the scatter between three runs and more,
        that of each coefficient moderated by the others; of one or two runs white unless
        correlated noise has by far the greater evidence. Intervals: `FitResult.interval`.
    nuisance : {"none", "auto"} or iterable of str
        What is fitted jointly with the pattern and kept out of the model (`FitResult.nuisance`):
        ``"ramp"`` in the angle, ``"direction"``, ``"velocity"``, ``"drift"`` in time.
        ``"auto"``: those that lower the error of segments held out and can be distinguished from
        the pattern; the notes state which.
    reference_orders : iterable of float, optional
        Lines that the reference makes (50 and 100 of a stepper of 200 steps): fitted jointly with
        the pattern, and not in the model. With several runs each line has one amplitude, and a
        separate phase in every run where that lowers the held-out error: a reference that was
        remounted has a new zero.
    method : {"plain", "moments", "qr", "counts"}, optional
        Forces a way of solving: QR of all rows, one pass of piecewise moments with normal
        equations or with QR, or one mean error per count of an encoder that counts (whole
        numbers, at most 2^17 to a turn). By default the fastest that keeps QR's accuracy.
    threads : int, optional
    prior : Fleet, optional
        Units of the same design (`trueangle.fleet`): the coefficients are drawn to theirs as far
        as the readings leave them open, so that ten readings may do. Without ``orders`` those of
        the fleet are fitted. Standard errors and intervals include the bias of the prior, and a
        note states how much is the unit's own. Requires the default ``ridge``, ``nuisance`` and
        ``covariance``, and the loss ``"auto"`` or ``"linear"``.
    **reading
        ``signals``, ``period``, ``by`` ... of files and tables, as in `trueangle.read_runs`.

    Returns
    -------
    FitResult

    Raises
    ------
    RankError
        The readings cannot separate the orders; names those at fault.
    NoModelError
        Orders were to be selected and the data support none; states why.
    ArgumentError
        Runs in different units, an indicated angle that does not follow the reference
        (wrong unit or sign), unknown shafts, and the like.
    NotInvertibleError
        The fitted error is too steep to be corrected.

    Notes
    -----
    Coefficients agree with `numpy.linalg.lstsq` to 1e-12 relative on well-conditioned
    data. Cost O(N) for N readings beyond a few thousand, for any number of orders.

    Examples
    --------
    >>> theta = np.arange(0.0, 360.0, 10.0)
    >>> run = CalibrationRun(theta, theta + 0.5 * np.sin(np.radians(theta)), period=360.0)
    >>> result = fit(run, orders=[1, 2], loss="linear")
    >>> result.model.shafts[0].sine[0].__round__(9)
    0.5
    """
    found, lost = decoded(runs_of(runs, reading)), list[str]()
    check_usable(found)
    _check_sign(found, gear_ratio)
    if orders is None or isinstance(orders, str):
        # What stays from one reading on is of no order; of orders that are given it is noted.
        found, lost = parted(found)
    if prior is not None:
        from .prior import fitted_with_prior

        asked = {"nuisance": nuisance, "covariance": covariance, "ridge": ridge, "method": method}
        problem, weighted, posterior = fitted_with_prior(
            found,
            prior,
            None
            if orders is None or isinstance(orders, str)
            else resolve_orders(orders, gear_ratio, fixed_member, shafts),
            argument,
            loss,
            {**asked, "reference_orders": tuple(reference_orders) or ()},
        )
        return FitResult(
            problem,
            weighted.fitted,
            weighted,
            loss,
            0.0,
            travelled_span(problem.travel, problem.period, problem.is_periodic),
            None,
            (gear_ratio, fixed_member),
            (*lost, posterior.note()),
            posterior=posterior,
        )
    result = fitted_to(
        found,
        orders,
        gear_ratio=gear_ratio,
        fixed_member=fixed_member,
        shafts=shafts,
        argument=argument,
        loss=loss,
        ridge=ridge,
        covariance=covariance,
        nuisance=nuisance,
        reference_orders=reference_orders,
        method=method,
        threads=threads,
    )
    result = replace(result, remarks=(*lost, *result.remarks)) if lost else result
    return result if result.evidence is None else of_worth(result)


def _check_sign(runs: Sequence[CalibrationRun], gear_ratio: float | None) -> None:
    """Raise where the motor of the readings turns as often as stated, the other way."""
    for run in runs if gear_ratio else ():
        motor = run.signals.get("motor")
        turns = None if motor is None else angle_ratio(records_of([replace(run, indicated=motor)]))
        # As near as a ratio that is stated in three digits.
        if gear_ratio and turns and abs(turns / gear_ratio + 1.0) < 0.01:
            raise ArgumentError(
                f"gear_ratio is {gear_ratio:g}, and the motor of the readings turns {turns:.4g} "
                f"times per turn of the reference: give `gear_ratio={-gear_ratio:g}`"
            )


def fitted_to(
    found: Sequence[CalibrationRun],
    orders: Iterable[float] | Mapping[str, Iterable[float]] | str | None,
    *,
    gear_ratio: float | None,
    fixed_member: str,
    shafts: Mapping[str, float] | None,
    argument: AnyArgument,
    loss: Loss,
    ridge: float | None = None,
    covariance: CovarianceKind,
    nuisance: str | Iterable[str] = "none",
    reference_orders: Iterable[float] = (),
    method: str | None = None,
    threads: int | None = None,
    summed: SummedReadings | None = None,
    evidence: OrderSelection | None = None,
    candidates: Iterable[float] | None = None,
) -> FitResult:
    """As `fit`; with ``summed`` of all readings, of which the runs are a sample.

    ``evidence`` is a selection of orders among ``candidates`` that was made before.
    """
    check_choice("argument", argument, ARGUMENTS)
    check_covariance(covariance, len(found))
    selection = evidence
    sought: dict[str, Any] = {
        "candidates": candidates,
        "gear_ratio": gear_ratio,
        "fixed_member": fixed_member,
        "argument": argument,
        "shafts": shafts,
        "reference_orders": (),
    }
    beside = _beside(nuisance, reference_orders)
    given = calm = found
    if evidence is not None:
        calm = found if loss == "linear" else [without_spikes(run) for run in found]
        orders = evidence.by_shaft
    elif orders is None or isinstance(orders, str):
        if beside.wanted:
            from .nuisanceremoval import orders_beside_nuisance, take_out_nuisance

            likely = orders_beside_nuisance(found, gear_ratio, fixed_member, shafts)
            found, _ = take_out_nuisance(
                given, beside.kinds, likely, _angle(argument), beside.reference
            )
        sought["reference_orders"] = beside.reference
        calm = found if loss == "linear" else [without_spikes(run) for run in found]
        selection, orders = _selected(calm, orders, sought, summed)
        if not selection.orders:
            selection, orders = None, ()
    wanted = resolve_orders(orders, gear_ratio, fixed_member, shafts)
    taken = None
    if beside.wanted:
        from .nuisanceremoval import orders_beside_nuisance, take_out_nuisance_beside

        likely = orders_beside_nuisance(given, gear_ratio, fixed_member, shafts)
        found, taken = take_out_nuisance_beside(
            given, beside.kinds, wanted, likely, _angle(argument), beside.reference
        )
    if selection is not None:
        choice = ArgumentChoice(selection.argument)
        if any(row.verdict == "too long" for row in selection.table):
            cycles = [k * shaft.cycles_per_turn for shaft in wanted for k in shaft.orders]
            found = [without_drift(run, cycles) for run in found]
    else:
        choice = choose_argument(found, argument, wanted)
    known = None
    usual = covariance == "auto" and ridge is None and method is None and taken is None
    usual &= loss in ("auto", "linear") and summed is None
    if usual and selection is not None and selection.is_of_all_readings:
        from .mixture import fit_mixture

        selection, problem, weighted, known = fit_mixture(
            found,
            calm,
            selection,
            lambda runs: _choice(runs, sought),
            lambda own: resolve_orders(own.by_shaft, gear_ratio, fixed_member, shafts),
            loss == "auto",
            ROUNDING * found[0].period,
        )
        wanted, ridge = list(problem.shafts), 0.0
    elif summed is None:
        problem = Problem(found, wanted, choice.argument, method, threads)
        weighted = fit_robustly(problem, loss, ROUNDING * problem.period)
    else:
        from .problem import SummedProblem

        problem = SummedProblem(summed, wanted, threads)
        weighted = fit_without_outliers(problem, len(summed.outliers))
    span = travelled_span(problem.travel, problem.period, problem.is_periodic)
    if ridge is None:
        tame = (span.full and problem.is_periodic) or weighted.fitted.solution.is_conditioned_below(
            CONDITION
        )
        ridge = 0.0
        if not tame:
            from .ridge import choose_ridge

            ridge = choose_ridge(problem, weighted.weights or problem.base)
    fitted = weighted.fitted
    if ridge > 0.0:
        fitted = problem.penalised(fitted, weighted.weights or problem.base, ridge)
    if problem.argument == "reference":
        check_invertible(fitted.series.slope_bound)
    joint = (gear_ratio, fixed_member)
    remarks = [note for note in (choice.note, robust_breakdown_sentence(problem, weighted)) if note]
    if taken is not None:
        remarks += taken.sentences(problem.period)
    if len(found) > 1:
        from .unlikeruns import run_names, unlike_runs, unlike_runs_sentence, zeros_follow_speed

        if summed is None:
            remarks += zeros_follow_speed(found, fitted.offsets, fitted.solution.offset_std)
        unlike = unlike_runs(problem, fitted)
        if unlike:
            names = run_names(found)
            remarks.append(unlike_runs_sentence([names[i] for i in unlike], len(found)))
            warnings.warn(remarks[-1], UnlikeRunsWarning, stacklevel=4)
    if weighted.unsettled:
        remarks.append(unsettled_weights_sentence(weighted))
    if summed is not None:
        remarks.append(summed.note)
    return FitResult(
        problem,
        fitted,
        weighted,
        loss,
        ridge,
        span,
        selection,
        joint,
        tuple(remarks),
        covariance,
        taken,
        known=known,
    )


class _Beside(NamedTuple):
    """Nuisances requested (None: to be chosen), and lines of the reference."""

    kinds: tuple[str, ...] | None
    reference: tuple[float, ...]

    @property
    def wanted(self) -> bool:
        """Whether anything is fitted jointly with the pattern."""
        return self.kinds != () or bool(self.reference)


#: Where the pattern alone is requested.
_NOTHING = _Beside((), ())


def _beside(nuisance: str | Iterable[str], reference_orders: Iterable[float]) -> _Beside:
    if nuisance == "none" and reference_orders == ():
        return _NOTHING
    lines = tuple(map(float, limited_orders(reference_orders, "reference_orders")))
    if nuisance == "none":
        return _Beside((), lines) if lines else _NOTHING
    from .nuisance import asked_nuisance

    return _Beside(asked_nuisance(nuisance), lines)


def _angle(argument: AnyArgument) -> Argument:
    return "indicated" if argument == "indicated" else "reference"


def _selected(
    runs: Sequence[CalibrationRun],
    orders: str | None,
    sought: dict[str, Any],
    summed: SummedReadings | None,
) -> tuple[OrderSelection, Mapping[str, Iterable[float]]]:
    """Orders with evidence, from readings without spikes."""
    if orders not in (None, "auto"):
        raise ArgumentError(f"orders must be whole numbers, a mapping or 'auto', got {orders!r}")
    selection = _choice(runs, {**sought, "summed": summed})
    # Constants of channels are a model of themselves: nothing need be left of the angle.
    if not selection.orders and any(run.channels is None for run in runs):
        raise NoOrderError(f"no model: {selection.reason}")
    return selection, selection.by_shaft


def _choice(runs: Sequence[CalibrationRun], sought: dict[str, Any]) -> OrderSelection:
    from .orders.choice import selected_orders

    return selected_orders(runs, **sought)
