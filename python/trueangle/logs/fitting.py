"""Fitting a model to calibration logs of any size in one pass."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass
from os import PathLike
from pathlib import Path
from typing import Any

import numpy as np

from .._core import __version__
from ..angles import arcsec, wrap
from ..columns import wanted_columns
from ..errors import ArgumentError, NoModelError
from ..fitting.travel import Span, covered_span
from ..model import Argument, HarmonicModel
from ..moments import Moments, MomentsFit
from ..orders.evidence import choose_forward, examine_orders, fit_subset, held_out_gains
from ..orders.selection import FALSE_ALARM, NEGLIGIBLE_NOISE, NEGLIGIBLE_SHARE
from ..records import FitRecord, Provenance
from ..runs import Source
from ..shafts import resolve_orders, shaft_cycles
from .accumulation import Accumulated, LogFitSettings, accumulate_each, merged
from .momentsums import sums_of
from .progress import Progress
from .sources import find_logs

__all__ = ["LogFit", "LogOrder", "fit_logs"]

#: Orders of the output that are looked at when none are asked for, and of other shafts.
_OUTPUT_ORDERS = tuple(range(1, 18))
_SHAFT_ORDERS = (1, 2, 4)


@dataclass(frozen=True)
class LogOrder:
    """Evidence for one order: a row of `LogFit.table`.

    Attributes
    ----------
    shaft : str
    order : int
        Of the shaft.
    retained : bool
    amplitude, std : float
        And its standard error, in the unit of the model.
    phase_deg : float
    held_out_gain : float
        Part of the held-out mean square error that the order takes away; NaN with one run.
    reason : str
        Why it was left out; empty for a retained one.
    """

    shaft: str
    order: int
    retained: bool
    amplitude: float
    std: float
    phase_deg: float
    held_out_gain: float
    reason: str


@dataclass(frozen=True)
class LogFit:
    """A model fitted to logs in one pass.

    Attributes
    ----------
    model : HarmonicModel
    fit : MomentsFit
        Coefficients with their covariance, zeros of the runs.
    moments : Moments
        From which any other set of the accumulated orders can be solved at once.
    table : tuple of LogOrder
        Evidence for every order; empty where the orders were given.
    rows, missing : int
    notes : tuple of str
    """

    model: HarmonicModel
    fit: MomentsFit
    moments: Moments
    table: tuple[LogOrder, ...]
    rows: int
    missing: int
    notes: tuple[str, ...]

    def summary(self) -> str:
        """The result as text."""
        period = self.model.period
        residual = arcsec(math.sqrt(self.fit.residual_variance), period)
        lines = [
            "Harmonic model of the angle error (error = indicated - reference), one pass",
            "",
            f"  readings   {self.rows} in {len(self.moments.runs)} runs, {self.missing} missing",
            f"  residual   {residual:.2f} arcsec standard deviation",
            f"  solved by  {self.fit.method}, condition number {self.fit.condition_number:.3g}",
            "",
            "  shaft           order   amplitude     +-     phase",
            "                             arcsec  arcsec       deg",
        ]
        std = self.fit.std[1:].reshape(-1, 2)
        rows = [(shaft, i) for shaft in self.model.shafts for i in range(len(shaft.orders))]
        for n, (shaft, i) in enumerate(rows):
            spread = arcsec(float(np.hypot(*std[n]) / math.sqrt(2.0)), period)
            lines.append(
                f"  {shaft.name:<15} {shaft.orders[i]:5d}  "
                f"{arcsec(float(shaft.amplitudes[i]), period):10.3f} {spread:7.3f}  "
                f"{math.degrees(float(shaft.phases[i])) % 360.0:8.2f}"
            )
        lines += ["", *(f"  [{i}] {note}" for i, note in enumerate(self.notes, 1))]
        return "\n".join(lines).rstrip()


def fit_logs(
    logs: str | PathLike[str] | Iterable[str | PathLike[str]],
    orders: Iterable[int] | Mapping[str, Iterable[int]] | str | None = None,
    *,
    gear_ratio: float | None = None,
    fixed_member: str = "circular_spline",
    shafts: Mapping[str, float] | None = None,
    argument: Argument = "reference",
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
    table = _judged(found.moments, asked, cycles) if automatic else ()
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
    return _result(found, fit, argument, table)


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
    moments: Moments, asked: Mapping[str, Sequence[int]], cycles: Mapping[str, float]
) -> tuple[LogOrder, ...]:
    """Every order with its evidence: significance, held-out runs, size."""
    pairs = [(name, k) for name, orders in asked.items() for k in orders]
    sums = sums_of(moments, [k * cycles[name] for name, k in pairs])
    limits = np.full(len(pairs), math.log(FALSE_ALARM / len(pairs)))
    readings = int(sums.count.sum()) - sums.units
    chosen = choose_forward(sums, limits, readings, None)
    reasons = {i: "not significant" for i in range(len(pairs)) if i not in chosen}
    several = sums.units > 1
    while several and chosen:
        without, with_, _ = held_out_gains(sums, chosen, chosen)
        worst = int(np.argmin(without - with_))
        if without[worst] > with_[worst]:
            break
        reasons[chosen[worst]] = "does not lower the error of runs left out of the fit"
        del chosen[worst]
    everything = list(range(len(pairs)))
    _, _, rest = fit_subset(sums, chosen)
    noise = rest / max(readings - 2 * len(chosen), 1)
    test = examine_orders(sums, chosen, everything, (noise, math.inf), None)
    sizes = np.hypot(test.cosine, test.sine)
    whole = math.sqrt(float(sum(sizes[i] ** 2 for i in chosen))) or 1.0
    for i in list(chosen):
        if sizes[i] < NEGLIGIBLE_SHARE * whole and sizes[i] < NEGLIGIBLE_NOISE * math.sqrt(noise):
            reasons[i] = "negligible: correcting it would change no reading noticeably"
            chosen.remove(i)
    gains = np.full(len(pairs), math.nan)
    if several:
        without, with_, _ = held_out_gains(sums, chosen, everything)
        gains = (without - with_) / without
    return tuple(
        LogOrder(
            name,
            k,
            i in chosen,
            float(sizes[i]),
            math.sqrt(float(test.variance[i])) if test.variance[i] >= 0.0 else math.nan,
            math.degrees(math.atan2(test.cosine[i], test.sine[i])) % 360.0,
            float(gains[i]),
            reasons.get(i, ""),
        )
        for i, (name, k) in enumerate(pairs)
    )


def _result(
    found: Accumulated, fit: MomentsFit, argument: Argument, table: tuple[LogOrder, ...]
) -> LogFit:
    span = _span(found)
    offsets = np.array(list(fit.offsets.values()))
    around = wrap(offsets - fit.constant, fit.period)
    notes = tuple(_notes(found, span, table))
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
        fit=record, provenance=Provenance(sources, f"trueangle {__version__}")
    )
    return LogFit(model, fit, found.moments, table, found.rows, found.missing, notes)


def _span(found: Accumulated) -> Span:
    period = found.moments.period
    bins = found.travel.size
    centres = (np.arange(bins, dtype=np.float64) + 0.5) * (period / bins)
    return covered_span([centres[found.travel > 0]], period)


def _notes(found: Accumulated, span: Span, table: Sequence[LogOrder]) -> Iterable[str]:
    if not span.full:
        yield f"Fitted on {span.start:.6g} to {span.stop:.6g} only: outside it is extrapolated."
    if found.missing:
        yield f"{found.missing} readings without a reference or indicated angle left out."
    if table and len(found.moments.runs) < 2:
        yield "One run only: no order was tried on readings left out of the fit."
