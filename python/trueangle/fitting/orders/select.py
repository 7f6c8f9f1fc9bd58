"""Which orders are real: selection with evidence, and a refusal where there is none."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Unpack

from ...errors import TrueAngleError, UnlikeRunsWarning
from ...joint.shafts import limited_orders
from ...runs.files import runs_of
from ...runs.run import CalibrationRun
from ...runs.source import ReadingOptions
from ...support.argumentkinds import told_kinds
from ..argument import AnyArgument
from ..fit import fitted_to
from ..uncertainty import CovarianceKind
from .choice import Method, selected_orders
from .result import OrderSelection

__all__ = ["OrderSelection", "select_orders"]


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
    **reading: Unpack[ReadingOptions],
) -> OrderSelection:
    """Orders of the angle error that the readings support.

    An order is retained when it is significant,

    ::

        P{2 F(2, ν) > T_k} ≤ α_k / K_k,
        T_k = (reduction of the sum of squares) / σ²,

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
        Of what an order must stand out: of independent noise (``"white"``), of what scatters
        between the runs at the orders near it, and at itself where that is more (``"cluster"``), or
        of what the orders near it take off the residual (``"hac"``). ``"auto"``: between runs, or
        between the whole turns of a single run; in a single turn of independent noise, unless the
        other orders show that it remembers the reading before.
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
    The noise comes from the scatter between runs or turns, smooth over the orders
    (`trueangle.fitting.orders.noisespectrum`). An order that varies by more than that is judged by
    its own scatter. In a single turn it comes from repeats of the same position where
    there are enough (pure error, no model enters), else from the residual. One pass over the
    readings, whatever the number of candidates.

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
    joint |= {"reference_orders": tuple(limited_orders(reference_orders, "reference_orders"))}
    selection = selected_orders(
        found, candidates, method=method, argument=argument, tolerance=tolerance, **joint
    )
    return selection if method == "paper" else _as_fitted(selection, found, joint)


def _as_fitted(
    selection: OrderSelection, runs: Sequence[CalibrationRun], joint: Mapping[str, Any]
) -> OrderSelection:
    """With the figures of the fit of its orders; as it is where they cannot be fitted."""
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
    return selection.as_fitted(fit.model, fit.standard_errors)
