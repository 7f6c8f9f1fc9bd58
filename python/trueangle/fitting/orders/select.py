"""Which orders are real: selection with evidence, and a refusal where there is none."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Any, Final, Literal, Unpack

import numpy as np
from numpy.typing import NDArray

from ...errors import ArgumentError, TrueAngleError, UnlikeRunsWarning
from ...joint.shafts import counted_orders
from ...runs.aliasing import distinct_positions
from ...runs.files import runs_of
from ...runs.run import CalibrationRun
from ...runs.source import Reading
from ...runs.travel import held_orders, over_turns
from ...support.blas import one_blas_thread
from ...support.kinds import told_kinds
from ...support.suggestions import check_choice
from ..argument import AnyArgument, at_indicated, choose_argument
from ..uncertainty import CovarianceKind, check_covariance
from .candidates import choose_candidates
from .selection import FALSE_ALARM, EvidenceSelection
from .table import OrderRow, OrderSelection

if TYPE_CHECKING:
    from ..summed import Summed

__all__ = ["FALSE_ALARM", "OrderRow", "OrderSelection", "select_orders", "selected_of"]

Array = NDArray[np.float64]
Method = Literal["evidence", "paper"]


@told_kinds
def select_orders(
    runs: Any,
    candidates: Iterable[float] | None = None,
    gear_ratio: float | None = None,
    fixed_member: str = "circular_spline",
    method: Method = "evidence",
    *,
    argument: AnyArgument = "auto",
    covariance: CovarianceKind = "auto",
    shafts: Mapping[str, float] | None = None,
    nuisance: str | Iterable[str] = "none",
    reference_orders: Iterable[float] = (),
    tolerance: float | None = None,
    **reading: Unpack[Reading],
) -> OrderSelection:
    r"""Orders of the angle error that the readings support.

    An order is retained when it is significant,

    .. math:: P\{2 F(2, \nu) > T_k\} \le \alpha_k / K_k, \qquad
              T_k = \frac{\text{reduction of the sum of squares}}{\sigma^2},

    with a bound for all the orders searched (0.5 % chance of any false order), **and**
    when it lowers the error of readings that took no part in the fit. Held out are whole
    runs, with several mounts whole parts of them; with a single run whole blocks of
    neighbouring positions. Rows of the same positions are never split at random: a wrong
    order that repeats at all of them would pass.

    Parameters
    ----------
    runs : CalibrationRun, path, table, or iterable of them
        Each run with its own zero; readings of weight 0 take no part. Files, folders, patterns
        and tables in memory as `trueangle.read_runs` takes them.
    candidates : iterable of float, optional
        Orders to look at. By default 1 .. 17 and the gear's own orders when
        ``gear_ratio`` is given, else 1 .. 100, as far as the positions can tell them; and
        a scan up to order 450 where the angles are free.
    gear_ratio : float, optional
        Motor turns per output turn.
    fixed_member : {"circular_spline", "flexspline", "none"}
    method : {"evidence", "paper"}
        ``"paper"``: amplitude and phase range over the runs
        (`trueangle.fitting.orders.paper.select_by_paper`).
    argument : {"auto", "reference", "indicated"}
        Which angle the orders are sought in. ``"auto"``: the true angle, unless every run has
        an arbitrary zero of the reference (`trueangle.fitting.argument.choose_argument`).
    covariance : {"auto", "white", "cluster", "hac"}
        Of what an order must stand out: of independent noise (``"white"``), of its own scatter
        between the runs (``"cluster"``), or of what its neighbours among the orders scatter
        (``"hac"``), where that is more. ``"auto"``: between runs where there are several, of
        independent noise in a single run, where the held-out gain alone guards against its memory.
    shafts : mapping of str to float, optional
        Further shafts and their cycles per output turn (a worm: 144): once, twice, three and
        four times per turn of theirs are candidates, and are named.
    nuisance : {"none", "auto"} or iterable of str
        What is taken out of the readings first, as in `trueangle.fit`.
    reference_orders : iterable of float, optional
        Orders that the reference itself is known to make (50 and 100 for a stepper motor
        of 200 steps). They and their side bands are fitted, named and not retained. Where their
        phases are new in every run (the reference was mounted anew) they are taken out first.
    tolerance : float, optional
        Positions closer than this are one, default 0.01 degree; unit of the runs.
    **reading
        ``signals``, ``period``, ``by`` ... of files and tables, as in `trueangle.read_runs`.

    Returns
    -------
    OrderSelection
        With no orders and a reason when the data support none.

    Raises
    ------
    ArgumentError
        Runs in different units, candidates that are not positive.

    Notes
    -----
    The noise comes from repeats of the same position where there are enough (pure error,
    no model enters), else from the residual. An order that varies from run to run by more
    than that is judged by its own scatter between the runs. One pass over the readings,
    whatever the number of candidates.

    Examples
    --------
    >>> import numpy as np
    >>> theta = np.tile(np.arange(0.0, 360.0, 10.0), 6)
    >>> noise = np.random.default_rng(1).normal(0.0, 0.001, theta.size)
    >>> run = CalibrationRun(theta, theta + 0.02 * np.sin(np.radians(3 * theta)) + noise, 360.0)
    >>> select_orders(run).orders
    (3,)
    """
    found = runs_of(runs, reading)
    joint: dict[str, Any] = {"gear_ratio": gear_ratio, "fixed_member": fixed_member}
    joint |= {"shafts": shafts, "covariance": covariance, "nuisance": nuisance}
    joint |= {"reference_orders": tuple(counted_orders(reference_orders, "reference_orders"))}
    selection = selected_of(
        found, candidates, method=method, argument=argument, tolerance=tolerance, **joint
    )
    return selection if method == "paper" else _as_fitted(selection, found, joint)


def _as_fitted(
    selection: OrderSelection, runs: Sequence[CalibrationRun], joint: Mapping[str, Any]
) -> OrderSelection:
    """With the figures of the fit of its orders; as it is where they cannot be fitted."""
    from ..fit import fitted_to

    if not selection.orders:
        return selection
    try:
        with warnings.catch_warnings():
            # What the fit would warn of is said by `trueangle.fit`.
            warnings.simplefilter("ignore", UnlikeRunsWarning)
            fit = fitted_to(
                runs, None, argument=selection.argument, loss="auto", evidence=selection, **joint
            )
    except TrueAngleError:
        return selection
    return selection.as_fitted(fit)


@one_blas_thread()
def selected_of(
    found: Sequence[CalibrationRun],
    candidates: Iterable[float] | None = None,
    gear_ratio: float | None = None,
    fixed_member: str = "circular_spline",
    method: Method = "evidence",
    *,
    argument: AnyArgument = "auto",
    covariance: CovarianceKind = "auto",
    shafts: Mapping[str, float] | None = None,
    nuisance: str | Iterable[str] = "none",
    reference_orders: Iterable[float] = (),
    tolerance: float | None = None,
    summed: Summed | None = None,
) -> OrderSelection:
    """As `select_orders`; with ``summed`` of all readings of which the runs are some."""
    check_choice("method", method, ("evidence", "paper"))
    check_covariance(covariance, len(found))
    kept = [run for run in map(_without_zero_weights, found) if run is not None]
    if not kept:
        raise ArgumentError("all readings have weight 0: nothing is left to select orders from")
    said: tuple[str, ...] = ()
    lines = tuple(map(float, counted_orders(reference_orders, "reference_orders")))
    kinds: tuple[str, ...] | None = ()
    if nuisance != "none":
        from ..nuisance import asked_nuisance

        kinds = asked_nuisance(nuisance)
    if kinds != () or (lines and len(kept) > 1):
        from ..nuisance import likely_orders, take_out

        likely = likely_orders(kept, gear_ratio, fixed_member, shafts)
        angle = "indicated" if argument == "indicated" else "reference"
        cleaned, taken = take_out(kept, kinds, likely, angle, lines if len(kept) > 1 else ())
        if lines and not taken.turned:
            # Lines that are the same in every run stay, to be fitted and named.
            cleaned, taken = take_out(kept, kinds, likely, angle)
        kept, said = cleaned, tuple(taken.sentences(kept[0].period))
    choice = choose_argument(kept, argument)
    if choice.argument == "indicated":
        kept = [at_indicated(run) for run in kept]
    # The ends of the travel are known of all readings.
    ends = [] if summed is None else [CalibrationRun(summed.ends, summed.ends, kept[0].period)]
    positions = distinct_positions([*kept, *ends], tolerance)
    held_from, agree = held_orders(kept, declared_cycles(gear_ratio, shafts))
    if agree and covariance == "auto":
        covariance = "hac"
    chosen = choose_candidates(
        positions,
        candidates,
        gear_ratio,
        fixed_member,
        lines,
        _travelled(kept, gear_ratio, shafts),
        shafts,
        held_from,
    )
    if method == "paper":
        from .paper import select_by_paper

        selection = select_by_paper(kept, positions, chosen)
    else:
        selection = EvidenceSelection(kept, positions, chosen, covariance, summed).result()
    notes = (*filter(None, (choice.note,)), *said, *selection.notes)
    return replace(selection, argument=choice.argument, notes=notes, shafts=dict(shafts or {}))


def _without_zero_weights(run: CalibrationRun) -> CalibrationRun | None:
    if run.weights is None or (run.weights > 0.0).all():
        return run
    keep = run.weights > 0.0
    if not keep.any():
        return None
    mount = None if run.mount is None else run.mount[keep]
    return CalibrationRun(
        run.reference[keep],
        run.indicated[keep],
        period=run.period,
        mount=mount,
        label=run.label,
        weights=run.weights[keep],
    )


#: Angles looked at to tell whether a gear's orders are resolved over the travel.
_LOOKED_AT: Final = 4096


def declared_cycles(gear_ratio: float | None, shafts: Mapping[str, float] | None) -> list[float]:
    """Cycles per output turn of all shafts that were declared."""
    return [*(shafts or {}).values(), *(() if gear_ratio is None else (gear_ratio,))]


def _travelled(
    runs: Sequence[CalibrationRun],
    gear_ratio: float | None,
    shafts: Mapping[str, float] | None,
) -> Array | None:
    """Angles of the readings in turns, whole turns kept; None where every order is whole."""
    cycles = declared_cycles(gear_ratio, shafts)
    if all(float(f).is_integer() for f in cycles):
        return None
    turns = np.concatenate([over_turns(run).reference for run in runs]) / runs[0].period
    return np.asarray(turns[:: max(1, turns.size // _LOOKED_AT)])
