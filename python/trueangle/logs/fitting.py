"""Fitting a model to calibration logs of any size."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any, TypeAlias

from ..errors import ArgumentError, FileError, NoModelError
from ..fitting.argument import AnyArgument
from ..fitting.fit import fit, fitted_to
from ..fitting.orders.choice import selected_orders
from ..fitting.orders.select import OrderSelection, select_orders
from ..fitting.result import FitResult
from ..fitting.robust import without_spikes
from ..fitting.summed import SummedReadings
from ..fitting.uncertainty import CovarianceKind, check_covariance
from ..fitting.worth import of_worth
from ..joint.shafts import resolve_orders
from ..runs.files import read_runs
from ..runs.follows import check_usable
from ..runs.paths import find_logs
from ..runs.run import CalibrationRun
from ..support.argumentkinds import told_kinds
from .keeping import KEPT
from .passes import Passes
from .sources import logs_hold_at_most

_Logs: TypeAlias = str | PathLike[str] | Iterable[str | PathLike[str]]


@told_kinds
def fit_logs(
    logs: _Logs,
    orders: Iterable[float] | Mapping[str, Iterable[float]] | str | None = None,
    *,
    gear_ratio: float | None = None,
    fixed_member: str = "circular_spline",
    shafts: Mapping[str, float] | None = None,
    argument: AnyArgument = "auto",
    loss: str = "auto",
    covariance: CovarianceKind = "auto",
    counts_per_turn: float | None = None,
    counts_per_turn_reference: float | None = None,
    signals: Mapping[str, Any] | None = None,
    topic: str | None = None,
    unit_from: str | None = None,
    facets: Any = None,
    scheduler: str | None = None,
    threads: int | None = None,
    checksums: bool = False,
    progress: str = "none",
) -> FitResult:
    r"""Fit a model to logs of any size, in memory or in one pass over them.

    ::

        e_rj = z_r + Σ_s Σ_k A_sk cos(k f_s x_rj) + B_sk sin(k f_s x_rj)

    by least squares with one zero per run: what `fit` gives for the runs of these files. Up to
    2^20 readings are read into runs and fitted so. Of more, all are summed (`Moments`) and some
    65 000 are kept, in blocks at random: these give what needs readings in their order, the sums
    all else, and a note reports it.

    Parameters
    ----------
    logs : path or iterable of paths
        Files or folders with the columns ``reference_deg`` and ``indicated_deg`` (or
        ``_rad``, ``_turn``, ``indicated_count``), see `read_runs`; missing readings are
        omitted and counted.
    orders : iterable of int, mapping of shaft to orders, "auto" or None
    gear_ratio, fixed_member, shafts, argument, covariance
        As in `fit`; how noise correlates is seen in the readings that are kept.
    loss : {"auto", "linear"}
        As in `fit`: ``"auto"`` rejects outliers, which takes a second pass where there are
        some.
    counts_per_turn, counts_per_turn_reference : float, optional
    signals : mapping of role to column, optional
        Columns with other names, as in `read_runs`.
    topic : str, optional
        JointState topic of ROS bags.
    unit_from, facets : str, path, optional
        As in `read_runs`.
    scheduler : str, optional
        Address of a Dask scheduler whose workers share the file system: a log on each, the
        sums merged in a tree; the numbers are the same, bit for bit.
    threads : int, optional
    checksums : bool
        Keep the sha256 of every log in the model's provenance also in one pass: some 0.5 ns a
        byte more.
    progress : {"auto", "text", "json", "none"}

    Returns
    -------
    FitResult
        In one pass without `FitResult.runs`, `residuals`, `weights` and plots.

    Raises
    ------
    FileError
        A log cannot be used; a fit does not leave logs out silently.
    NoModelError
        No order is supported by the readings.
    ArgumentError
        In one pass, angles within one turn of a shaft that does not turn a whole number of times
        in it.
    RankError, NotInvertibleError
        As in `fit`.

    Notes
    -----
    About 5 ns a reading beyond reading the file, segments of Parquet and Arrow files side by
    side; 100 kB per run for 17 orders, 1 MB where orders up to 450 are judged (so for up to 64
    logs; with more, up to 100 and those of the gear). One pass reads angles and labels only: a
    row that lacks another signal counts. The numbers do not depend on ``threads``.

    Examples
    --------
    >>> import math, tempfile
    >>> import numpy as np
    >>> folder = Path(tempfile.mkdtemp())
    >>> theta = np.arange(0.0, 360.0, 0.5)
    >>> rows = [f"{x},{x + 0.5 * math.sin(math.radians(x))}" for x in theta.tolist()]
    >>> _ = (folder / "a.csv").write_text("\n".join(["reference_deg,indicated_deg", *rows]))
    >>> round(float(fit_logs(folder, orders=[1, 2]).model.amplitudes[0]), 9)
    0.5
    """
    check_covariance(covariance, 2)
    if loss not in ("auto", "linear"):
        raise ArgumentError(f"loss must be 'auto' or 'linear' for logs, got {loss!r}")
    joint = {"gear_ratio": gear_ratio, "fixed_member": fixed_member, "shafts": shafts}
    options = {**joint, "argument": argument, "covariance": covariance, "loss": loss}
    files = {
        "counts_per_turn": counts_per_turn,
        "counts_per_turn_reference": counts_per_turn_reference,
        "signals": signals,
        "topic": topic,
        "unit_from": unit_from,
        "facets": facets,
    }
    paths = [path for path, _name in find_logs(_listed(logs))]
    if logs_hold_at_most(paths, KEPT, topic):
        runs = _runs_of(paths, files, scheduler)
        return fit(runs, orders, threads=threads, **options)  # type: ignore[arg-type]
    asked = (
        None
        if orders is None or isinstance(orders, str)
        else list(resolve_orders(orders, gear_ratio, fixed_member, shafts))
    )
    passes = Passes(paths, asked, joint, files, threads, checksums, scheduler, progress, KEPT)

    def fitted(summed: SummedReadings) -> FitResult:
        return fitted_to(summed.runs, orders, summed=summed, threads=threads, **options)  # type: ignore[arg-type]

    found = fitted(passes.first(argument)) if loss == "linear" else passes.settled(argument, fitted)
    return found if found.evidence is None else of_worth(found)


def select_log_orders(
    logs: _Logs,
    *,
    gear_ratio: float | None = None,
    fixed_member: str = "circular_spline",
    shafts: Mapping[str, float] | None = None,
    argument: AnyArgument = "auto",
    covariance: CovarianceKind = "auto",
    scheduler: str | None = None,
    threads: int | None = None,
    progress: str = "none",
    **files: Any,
) -> OrderSelection:
    """Orders that logs of any size support: `select_orders` for what `fit_logs` reads."""
    joint = {"gear_ratio": gear_ratio, "fixed_member": fixed_member, "shafts": shafts}
    options = {**joint, "argument": argument, "covariance": covariance}
    paths = [path for path, _name in find_logs(_listed(logs))]
    if logs_hold_at_most(paths, KEPT, files.get("topic")):
        runs = [without_spikes(run) for run in _runs_of(paths, files, scheduler)]
        return select_orders(runs, **options)  # type: ignore[arg-type]
    passes = Passes(paths, None, joint, files, threads, False, scheduler, progress, KEPT)

    def fitted(summed: SummedReadings) -> FitResult:
        return fitted_to(summed.runs, None, loss="auto", summed=summed, **options)  # type: ignore[arg-type]

    try:
        found = passes.settled(argument, fitted).selection
        assert found is not None
    except NoModelError:
        summed = passes.last
        runs = [without_spikes(run) for run in summed.runs]
        found = selected_orders(runs, **joint, argument=argument, summed=summed)  # type: ignore[arg-type]
    return found.with_notes((*found.notes, passes.last.note))


def _listed(logs: _Logs) -> list[str | PathLike[str]]:
    return [logs] if isinstance(logs, (str, PathLike)) else list(logs)


def _runs_of(
    paths: Sequence[Path], files: Mapping[str, Any], scheduler: str | None
) -> list[CalibrationRun]:
    if scheduler is None:
        runs = read_runs(paths, **files)
    else:
        from .cluster import read_on_cluster

        runs = read_on_cluster(scheduler, paths, files)
    for run in runs:
        try:
            check_usable([run])
        except ValueError as cause:
            raise FileError("" if run.source is None else run.source.file, str(cause)) from None
    return runs
