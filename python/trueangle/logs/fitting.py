"""Fitting a model to calibration logs of any size in one pass."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterable, Mapping, Sequence
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from .._core import __version__
from ..angles import wrap
from ..columns import wanted_columns
from ..errors import ArgumentError, NoModelError, UnlikeRunsWarning
from ..fitting.clusters import Cluster
from ..fitting.likeness import RunSums, far_runs, unlike_sentence
from ..fitting.travel import Span, covered_span
from ..fitting.uncertainty import (
    CovarianceKind,
    Uncertainty,
    check_covariance,
    uncertainty_of_sums,
)
from ..model import Argument
from ..moments import Moments, MomentsFit
from ..orders.search import FALSE_ALARM, EvidenceSearch
from ..orders.verdicts import because
from ..records import FitRecord, Provenance
from ..runs import Source
from ..shafts import resolve_orders, shaft_cycles
from .accumulation import Accumulated, LogFitSettings, accumulate_each, merged
from .logfit import LogFit, LogOrder
from .momentsums import sums_of
from .progress import Progress
from .sources import find_logs

__all__ = ["LogFit", "LogOrder", "fit_logs"]

#: Orders of the output that are looked at when none are asked for, and of other shafts.
_OUTPUT_ORDERS = tuple(range(1, 18))
_SHAFT_ORDERS = (1, 2, 4)


def fit_logs(
    logs: str | PathLike[str] | Iterable[str | PathLike[str]],
    orders: Iterable[int] | Mapping[str, Iterable[int]] | str | None = None,
    *,
    gear_ratio: float | None = None,
    fixed_member: str = "circular_spline",
    shafts: Mapping[str, float] | None = None,
    argument: Argument = "reference",
    covariance: CovarianceKind = "auto",
    counts_per_turn: float | None = None,
    counts_per_turn_reference: float | None = None,
    signals: Mapping[str, Any] | None = None,
    topic: str | None = None,
    scheduler: str | None = None,
    threads: int | None = None,
    checksums: bool = False,
    progress: str = "none",
) -> LogFit:
    r"""Fit a model to logs of any size: one pass, constant memory, any set of orders.

    .. math:: e_{rj} = z_r + \sum_s \sum_k A_{sk} \cos(k f_s x_{rj}) + B_{sk} \sin(k f_s x_{rj})

    by least squares from mergeable moments (`Moments`), with one zero per log and label of
    its ``run`` column.

    Parameters
    ----------
    logs : path or iterable of paths
        Files or folders with the columns ``reference_deg`` and ``indicated_deg`` (or
        ``_rad``, ``_turn``, ``indicated_count``), see `read_runs`; missing readings are left
        out and counted.
    orders : iterable of int, mapping of shaft to orders, "auto" or None
        None and ``"auto"``: those of 1 .. 17 on the output, and of 1, 2, 4 on the shafts
        that a gear ratio makes known, which are significant, lower the error of held-out
        runs and are not negligible.
    gear_ratio, fixed_member, shafts, argument
        As in `fit`.
    covariance : {"auto", "white", "cluster"}
        As in `fit`; by the scatter between the runs only, for one pass does not keep the order
        of the readings.
    counts_per_turn, counts_per_turn_reference : float, optional
    signals : mapping of role to column, optional
        Columns with other names, as in `read_runs`.
    topic : str, optional
        JointState topic of ROS bags.
    scheduler : str, optional
        Address of a Dask scheduler whose workers share the file system: a log on each, the
        moments merged in a tree; the numbers are the same, bit for bit.
    threads : int, optional
    checksums : bool
        Keep the sha256 of every log in the model's provenance: some 0.5 ns a byte more.
    progress : {"auto", "text", "json", "none"}

    Returns
    -------
    LogFit

    Raises
    ------
    FileError
        A log cannot be used; a fit does not leave logs out silently.
    NoModelError
        No order is supported by the readings.
    RankError, NotInvertibleError
        As in `fit`.

    Notes
    -----
    Wild readings are not set aside: that needs the readings twice. About 5 ns a reading
    beyond reading the file, stretches of Parquet and Arrow files side by side; some 100 kB
    per run for 17 orders. The numbers do not depend on ``threads``.

    Examples
    --------
    >>> import tempfile
    >>> folder = Path(tempfile.mkdtemp())
    >>> theta = np.arange(0.0, 360.0, 0.5)
    >>> rows = [f"{x},{x + 0.5 * math.sin(math.radians(x))}" for x in theta.tolist()]
    >>> _ = (folder / "a.csv").write_text("\n".join(["reference_deg,indicated_deg", *rows]))
    >>> round(float(fit_logs(folder, orders=[1, 2]).model.amplitudes[0]), 9)
    0.5
    """
    check_covariance(covariance, 2)
    given = [logs] if isinstance(logs, (str, PathLike)) else list(logs)
    paths = [path for path, _name in find_logs(given)]
    cycles = shaft_cycles(gear_ratio, fixed_member) | dict(shafts or {})
    automatic = orders is None or orders == "auto"
    if automatic:
        asked = {name: _OUTPUT_ORDERS if name == "output" else _SHAFT_ORDERS for name in cycles}
    elif isinstance(orders, str):
        raise ArgumentError(f"orders must be whole numbers, a mapping or 'auto', got {orders!r}")
    else:
        wanted = resolve_orders(orders or (), gear_ratio, fixed_member, shafts)
        asked = {shaft.name: shaft.orders for shaft in wanted}
    settings = LogFitSettings(
        asked,
        {name: cycles[name] for name in asked},
        argument,
        counts_per_turn,
        counts_per_turn_reference,
        wanted_columns(signals),
        topic,
        threads=threads,
        checksums=checksums,
    )
    found = _accumulated(paths, settings, scheduler, progress)
    table = _judged(found.moments, asked, cycles, covariance) if automatic else ()
    retained = asked
    if automatic:
        retained = {
            name: tuple(row.order for row in table if row.shaft == name and row.retained)
            for name in asked
        }
        retained = {name: kept for name, kept in retained.items() if kept}
        if not retained:
            raise NoModelError("no order is supported by the logs: none is significant")
    fit = found.moments.solve(retained)
    return _result(found, fit, argument, table, covariance)


def _accumulated(
    paths: Sequence[Path], settings: LogFitSettings, scheduler: str | None, progress: str
) -> Accumulated:
    if scheduler is not None:
        from .cluster import accumulated_on_cluster

        return accumulated_on_cluster(scheduler, paths, settings)
    shown = Progress(len(paths), sum(path.stat().st_size for path in paths), progress)
    parts = []
    try:
        for part in accumulate_each(paths, settings, shown.add):
            parts.append(part)
            shown.files += 1
    finally:
        shown.clear()
    return merged(parts)


def _judged(
    moments: Moments,
    asked: Mapping[str, Sequence[int]],
    cycles: Mapping[str, float],
    covariance: CovarianceKind,
) -> tuple[LogOrder, ...]:
    """Every order with its evidence, by the search that runs in memory take."""
    pairs = [(name, k) for name, orders in asked.items() for k in orders]
    sums = sums_of(moments, [k * cycles[name] for name, k in pairs])
    several = sums.units > 1
    search = EvidenceSearch(
        sums,
        np.full(len(pairs), math.log(FALSE_ALARM / len(pairs))),
        moments.period,
        int(sums.count.sum()) - sums.units,
        sums if several else None,
        covariance=covariance,
    )
    chosen, dropped = search.search()
    everything = list(range(len(pairs)))
    test = search.examined(chosen, everything)
    gains, _ = search.gains_and_model(chosen, everything)
    reasons = {i: because(verdict) for i, verdict in dropped.items() if verdict != "noise"}
    return tuple(
        LogOrder(
            name,
            k,
            i in chosen,
            float(np.hypot(test.cosine[i], test.sine[i])),
            math.sqrt(float(test.variance[i])) if test.variance[i] >= 0.0 else math.nan,
            math.degrees(math.atan2(test.cosine[i], test.sine[i])) % 360.0,
            float(gains[i]),
            "" if i in chosen else reasons.get(i, "not significant"),
        )
        for i, (name, k) in enumerate(pairs)
    )


def _result(
    found: Accumulated,
    fit: MomentsFit,
    argument: Argument,
    table: tuple[LogOrder, ...],
    covariance: CovarianceKind,
) -> LogFit:
    span = _span(found)
    offsets = np.array(list(fit.offsets.values()))
    around = wrap(offsets - fit.constant, fit.period)
    runs = _run_sums(found.moments, fit)
    how = _uncertainty(fit, runs, covariance)
    notes = (*_notes(found, span, table), *_unlike(found.moments, runs))
    if how.note:
        notes = (*notes, f"{how.note[:1].upper()}{how.note[1:]}.")
    record = FitRecord(
        samples=found.moments.count,
        runs=len(found.moments.runs),
        span=(span.start, span.stop),
        residual=math.sqrt(fit.residual_variance),
        method=fit.method,
        loss="linear",
        offset_spread=float(around.std(ddof=1)) if offsets.size > 1 else 0.0,
        note=" ".join(notes),
    )
    files = zip(found.files, found.sha256, strict=True)
    sources = tuple(Source(Path(file).name, sha256) for file, sha256 in files)
    model = fit.model(argument).replace(
        fit=record,
        covariance=how.covariance,
        provenance=Provenance(sources, f"trueangle {__version__}"),
    )
    return LogFit(model, fit, found.moments, table, found.rows, found.missing, notes, how)


def _run_sums(moments: Moments, fit: MomentsFit) -> list[RunSums]:
    """Normal equations of every run; none where they are not of whole orders."""
    orders = [k * s.cycles_per_turn for s in fit.shafts for k in s.orders]
    try:
        sums = sums_of(moments, orders)
    except ArgumentError:
        return []
    every = range(len(orders))
    # Cosines, then sines: as A, B of each order in turn.
    turn = np.arange(2 * len(orders)).reshape(2, -1).T.ravel()
    return [
        RunSums(
            sums.gram(unit, every)[np.ix_(turn, turn)],
            sums.rhs(unit, every)[turn],
            float(sums.squares[unit]),
            float(sums.count[unit]),
        )
        for unit in range(sums.units)
    ]


def _uncertainty(
    fit: MomentsFit, runs: Sequence[RunSums], covariance: CovarianceKind
) -> Uncertainty:
    coefficients = np.column_stack([fit.cosine, fit.sine]).ravel()
    clusters = [Cluster(run.gram, run.moment - run.gram @ coefficients) for run in runs]
    kind: CovarianceKind = covariance if clusters or covariance == "hac" else "white"
    return uncertainty_of_sums(
        fit.covariance, fit.degrees_of_freedom, clusters, fit.residual_variance, kind
    )


def _unlike(moments: Moments, runs: Sequence[RunSums]) -> Iterable[str]:
    """A warning, and its words, where runs do not show one pattern."""
    far = [place for place, _ in far_runs(runs)]
    if far:
        labels = [_label(moments.runs[place]) for place in far]
        said = unlike_sentence(labels, len(runs))
        warnings.warn(said, UnlikeRunsWarning, stacklevel=4)
        yield f"{said[:1].upper()}{said[1:]}."


def _label(run: object) -> str:
    """A run's name: of its file, and of its label where the file has several."""
    file, label = run if isinstance(run, tuple) else (run, None)
    return Path(str(file)).name if label is None else f"{Path(str(file)).name}:{label}"


def _span(found: Accumulated) -> Span:
    period = found.moments.period
    bins = found.travel.size
    centres = (np.arange(bins, dtype=np.float64) + 0.5) * (period / bins)
    return covered_span([centres[found.travel > 0]], period)


def _notes(found: Accumulated, span: Span, table: Sequence[LogOrder]) -> Iterable[str]:
    if not span.full:
        stretch = span.describe(found.moments.period)
        yield f"Fitted on {stretch} only: outside it is extrapolated."
    if found.missing:
        yield f"{found.missing} readings without a reference or indicated angle left out."
    if table and len(found.moments.runs) < 2:
        yield "One run only: no order was tried on readings left out of the fit."
