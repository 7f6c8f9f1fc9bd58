"""Which orders are real: selection with evidence, and a refusal where there is none."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Mapping, Sequence
from typing import Any, Unpack

from ...errors import NoModelError, TrueAngleError, UnlikeRunsWarning
from ...joint.shafts import limited_orders
from ...runs.checks.rows import parted
from ...runs.files import runs_of
from ...runs.follows import check_usable
from ...runs.run import CalibrationRun
from ...runs.source import ReadingOptions
from ...support.argumentkinds import told_kinds
from ..argument import AnyArgument
from ..decoded import decoded
from ..fit import fitted_to
from ..robust import without_spikes
from ..uncertainty import CovarianceKind, check_covariance
from ..worth import of_worth
from .choice import Method, selected_orders
from .result import OrderSelection as OrderSelection
from .table import FIRST, UNDETERMINED


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

    The readings of every run are taken as one linear model of its zero, the orders, what of them
    differs from run to run, and a noise that is white and drifts on any time scale
    (`trueangle.estimation.evidence.estimate_by_evidence`). An order is retained when it is there
    with a probability of one half and more, given the readings and all that the noise and the other
    orders may be. Before the readings, orders 1, 2 and 4 of a shaft are likely, and one of all
    others is expected.

    Orders that are collinear over the travel share their probability: those that hold the curve
    together are among ``orders`` with the verdict "shared".

    Parameters
    ----------
    runs : CalibrationRun, path, table, or iterable of them
        Each run with its own zero; readings of weight 0 take no part. Files, folders, patterns
        and tables in memory as `trueangle.read_runs` takes them.
    candidates : iterable of float, optional
        Orders to look at. By default 1 to 17 and the gear's own orders when
        ``gear_ratio`` is given, else 1 to 100, as far as the positions resolve them; and
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
    covariance : {"auto", "white", "cluster", "correlated"}
        Of the coefficients of retained orders, as in `trueangle.fit`.
    shafts : mapping of str to float, optional
        Further shafts and their cycles per output turn (a worm: 144): once, twice, three and
        four times per turn of theirs are candidates, and are named.
    nuisance : {"none", "auto"} or iterable of str
        What is taken out of the readings first, as in `trueangle.fit`.
    reference_orders : iterable of float, optional
        Orders that the reference itself is known to make (50 and 100 for a stepper motor
        of 200 steps). They and their side bands are fitted, named and not retained. Where their
        phases are new in every run (the reference was remounted) they are taken out first.
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
    Of more than 8000 readings as many are looked at, in blocks from all of them; their fit takes
    all. Cost O(N) for N of those and a pass for any number of candidates. Nothing is random.

    Examples
    --------
    >>> import numpy as np
    >>> theta = np.tile(np.arange(0.0, 360.0, 10.0), 6)
    >>> noise = np.random.default_rng(1).normal(0.0, 0.001, theta.size)
    >>> run = CalibrationRun(theta, theta + 0.02 * np.sin(np.radians(3 * theta)) + noise, 360.0)
    >>> select_orders(run).orders
    (3,)
    """
    found = decoded(runs_of(runs, reading))
    check_usable(found)
    found, _ = parted(found)
    check_covariance(covariance, len(found))
    joint: dict[str, Any] = {"gear_ratio": gear_ratio, "fixed_member": fixed_member}
    joint |= {"shafts": shafts, "nuisance": nuisance}
    joint |= {"reference_orders": tuple(limited_orders(reference_orders, "reference_orders"))}
    given = found if method == "paper" else [without_spikes(run) for run in found]
    selection = selected_orders(
        given, candidates, method=method, argument=argument, tolerance=tolerance, **joint
    )
    if method == "paper":
        return selection
    return _as_fitted(selection, found, candidates, {**joint, "covariance": covariance})


def _as_fitted(
    selection: OrderSelection,
    runs: Sequence[CalibrationRun],
    candidates: Iterable[float] | None,
    joint: Mapping[str, Any],
) -> OrderSelection:
    """With the figures of the fit of its orders; as it is where they cannot be fitted."""
    if not selection.orders:
        return selection
    try:
        with warnings.catch_warnings():
            # `trueangle.fit` reports what the fit would warn about.
            warnings.simplefilter("ignore", UnlikeRunsWarning)
            fit = of_worth(
                fitted_to(
                    runs,
                    None,
                    argument=selection.argument,
                    loss="auto",
                    evidence=selection,
                    candidates=candidates,
                    **joint,
                )
            )
    except NoModelError as error:
        return selection.with_notes((f"{UNDETERMINED}{error}", *selection.notes))
    except TrueAngleError:
        return selection
    found = selection if fit.selection is None else fit.selection
    doubts = (note.rstrip(".") for note in fit.notes if note.startswith(FIRST))
    return found.with_notes(tuple(dict.fromkeys((*doubts, *found.notes))))
