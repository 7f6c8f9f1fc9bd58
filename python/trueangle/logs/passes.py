"""Passes over logs whose readings are summed: one, or more if outliers require it."""

from __future__ import annotations

import math
import warnings
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..errors import NoModelError, TrueAngleError, UnlikeRunsWarning
from ..estimation.moments import Moments
from ..fitting.argument import AnyArgument, choose_argument
from ..fitting.fit import ROUNDING, fit
from ..fitting.orders.candidates import HIGHEST_FREE_ORDER, HIGHEST_SCANNED, SHAFT_HARMONICS
from ..fitting.problem import SolvedProblem
from ..fitting.result import FitResult
from ..fitting.robust import FAR, HIDDEN, MANY
from ..fitting.summed import SummedReadings
from ..joint.gear import gear_orders
from ..joint.shafts import Shaft, ShaftOrders, shaft_cycles
from ..model.model import Argument, HarmonicModel
from ..runs.files import Conversion
from ..runs.outliers import WILD, WILD_SHARE, robust_scale
from ..runs.run import CalibrationRun
from ..runs.source import checked_reading_options
from ..support.angles import wrap
from ..support.files import InputFile, partition_name
from ..support.roles import wanted_columns
from .accumulation import (
    Accumulated,
    LogFitSettings,
    OutlierLimits,
    accumulate_each,
    merged_moments,
)
from .keeping import SAMPLE
from .report import Progress

#: Places across a segment at which the model is looked at.
_ACROSS = np.linspace(0.0, 1.0, 5)


class Passes:
    """Passes over logs: one, or more if outliers or the angle of the errors require it."""

    def __init__(
        self,
        paths: Sequence[Path],
        asked: Sequence[ShaftOrders] | None,
        joint: Mapping[str, Any],
        files: Mapping[str, Any],
        threads: int | None,
        checksums: bool,
        scheduler: str | None,
        progress: str,
        most: int,
    ) -> None:
        self.paths, self.asked, self.joint = paths, asked, joint
        self.scheduler, self.progress = scheduler, progress
        cycles = shaft_cycles(joint["gear_ratio"], joint["fixed_member"])
        cycles |= dict(joint["shafts"] or {})
        if asked is None:
            orders = _table(cycles, joint, len(paths))
        else:
            orders = {shaft.name: shaft.orders for shaft in asked}
            cycles = {shaft.name: shaft.cycles_per_turn for shaft in asked}
            # The ends of the travel are those within a turn of the output.
            orders.setdefault("output", (1,))
            cycles.setdefault("output", 1.0)
        self.settings = LogFitSettings(
            orders,
            cycles,
            counts_per_turn=files.get("counts_per_turn"),
            counts_per_turn_reference=files.get("counts_per_turn_reference"),
            signals=wanted_columns(files.get("signals")),
            topic=files.get("topic"),
            unit_from=files.get("unit_from"),
            facets=Conversion.of(checked_reading_options(files)).facets,
            threads=threads,
            checksums=checksums,
            kept=max(min(most, SAMPLE) // len(paths), 1),
            part=min(1.0, SAMPLE / most),
        )

    def first(self, argument: AnyArgument) -> SummedReadings:
        """All readings, at the angle that the error is a function of."""
        given: Argument = "indicated" if argument == "indicated" else "reference"
        found = self._pass(given)
        chosen = choose_argument(found.runs, argument, self.asked).argument
        return found if chosen == given else self._pass(chosen)

    def settled(
        self, argument: AnyArgument, fitted: Callable[[SummedReadings], FitResult]
    ) -> FitResult:
        """The fit of all readings but the outliers, which `weigh` would reject as well."""
        plain = _Judged(self.first(argument), fitted)
        start = plain.start()
        if start is None:
            return plain.answer()
        judged, outliers = plain, start
        # Passes, at most, in which outliers are rejected and looked for again.
        for _ in range(4):
            before = judged.summed.outliers
            found = self._pass(plain.summed.argument, outliers)
            if not 0.0 < len(found.outliers) / found.readings <= WILD_SHARE:
                return plain.answer()
            judged = _Judged(found, fitted)
            if found.outliers == before or judged.result is None:
                break
            outliers = judged.outliers(judged.result.fitted)
        if plain.is_hidden and HIDDEN * judged.scale > plain.scale:
            return plain.answer()  # what the model lacks does not go away with some readings
        return judged.answer()

    def _pass(self, argument: Argument, outliers: OutlierLimits | None = None) -> SummedReadings:
        settings = replace(self.settings, argument=argument, outliers=outliers)
        found = _accumulated(self.paths, settings, self.scheduler, self.progress)
        self.last = _summed(found, argument)
        return self.last


class _Judged:
    """The fit of what a pass found, and how far its readings are off."""

    def __init__(
        self, summed: SummedReadings, fitted: Callable[[SummedReadings], FitResult]
    ) -> None:
        self.summed, self._fitted = summed, fitted
        self.result: FitResult | None = None
        self.scale, self.is_hidden = 0.0, True
        with warnings.catch_warnings(record=True) as told:
            warnings.simplefilter("always", UnlikeRunsWarning)
            try:
                self.result = fitted(summed)
            except NoModelError:
                return
        self._told = told
        problem = self.result.problem
        self._floor = ROUNDING * problem.period
        self.sample = np.concatenate(problem.residuals(self.result.fitted))
        self.scale = robust_scale(self.sample)

    def answer(self) -> FitResult:
        """The fit; raises where there is none."""
        if self.result is None:
            return self._fitted(self.summed)
        for one in self._told:
            warnings.warn(one.message, one.category, stacklevel=4)
        return self.result

    def start(self) -> OutlierLimits | None:
        """What is an outlier, by a robust fit of the readings kept; None where none can be."""
        orders = None
        if self.result is not None:
            self.is_hidden = not _is_beyond(self.summed.moments, self.outliers(self.result.fitted))
            many = (
                np.count_nonzero(np.abs(self.sample) > FAR * self.scale) > MANY * self.sample.size
            )
            if self.is_hidden and not (many and self.scale > self._floor):
                return None
            orders = self.result.problem.shafts
        try:
            with warnings.catch_warnings():
                warnings.simplefilter("ignore", UnlikeRunsWarning)
                rough = fit(
                    self.summed.runs,
                    None if orders is None else {s.name: s.orders for s in orders},
                    shafts={s.name: s.cycles_per_turn for s in orders or ()},
                    argument=self.summed.argument,
                )
        except TrueAngleError:
            return None
        self.scale = self.scale or math.inf
        return self.outliers(rough.fitted, robust_scale(rough.residuals))

    def outliers(self, fitted: SolvedProblem, scale: float | None = None) -> OutlierLimits:
        """Readings that are outliers to a fit of these runs."""
        limit = max(WILD * (self.scale if scale is None else scale), ROUNDING * fitted.period)
        zeros = dict(zip(self.summed.moments.runs, fitted.offsets.tolist(), strict=True))
        return OutlierLimits(_model(fitted), zeros, limit)


def _model(fitted: SolvedProblem) -> HarmonicModel:
    """The series of a fit without its zero."""
    solution = fitted.solution
    pairs = zip(fitted.shafts, solution.cosine, solution.sine, strict=True)
    return HarmonicModel(
        tuple(Shaft(s.name, s.cycles_per_turn, s.orders, tuple(a), tuple(b)) for s, a, b in pairs),
        period=fitted.period,
    )


def _is_beyond(moments: Moments, outliers: OutlierLimits) -> bool:
    """Whether in any segment an error is beyond the limit from all that the model has there."""
    for run in moments.runs:
        high, low, most, least = moments.extremes(run).T
        expected = np.asarray(outliers.model.error(low + (high - low) * _ACROSS[:, None]))
        most, least = (wrap(y - outliers.zeros[run], moments.period) for y in (most, least))
        far = np.maximum(most - expected.max(axis=0), expected.min(axis=0) - least)
        if float(far.max()) > outliers.limit:
            return True
    return False


def _table(cycles: Mapping[str, float], joint: Mapping[str, Any], logs: int) -> dict[str, Any]:
    """Orders of sums that serve every candidate of a selection."""
    ratio, declared = joint["gear_ratio"], (joint["shafts"] or {}).values()
    # With more logs, each with its sums, the scan beyond the low orders is omitted.
    highest = HIGHEST_SCANNED if logs <= 64 else HIGHEST_FREE_ORDER
    gear = [] if ratio is None else gear_orders(ratio, joint["fixed_member"])
    most = max(highest, *map(float, gear), *(SHAFT_HARMONICS[-1] * float(f) for f in declared), 0.0)
    # Orders per order of the table that sums of segments hold to a part in 1e10.
    return dict.fromkeys(cycles, (1,)) | {"output": (1, math.ceil(most / 2.89))}


def _summed(found: Accumulated, argument: Argument) -> SummedReadings:
    """What a pass found, its runs named as they are in memory."""
    moments, tallies = found.moments, found.tallies
    sources = {
        file: InputFile(partition_name(file), sha256)
        for file, sha256 in zip(found.files, found.sha256, strict=True)
    }
    runs, outliers, ends = [], [], []
    for number, run in enumerate(moments.runs, 1):
        assert isinstance(run, tuple)
        file, unit, label, *days = run
        kept = found.kept.columns(run)
        unit, label = (None if name is None else str(name) for name in (unit, label))
        day = next(iter(days), None)
        runs.append(
            CalibrationRun(
                *kept,
                moments.period,
                label=label,
                unit=unit,
                when=day,
                source=sources[file],
                indicated_sign=found.indicated_sign,
            )
        )
        outliers += [(label or str(number), row) for row in tallies[run].outliers]
        ends.append(moments.extremes(run)[:, :2].ravel())
    return SummedReadings(
        moments,
        tuple(runs),
        np.concatenate(ends),
        np.array([v for tally in tallies.values() for v in (tally.low, tally.high)]),
        argument,
        sum(tally.rows for tally in tallies.values()),
        found.missing,
        tuple(outliers),
    )


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
    return merged_moments(parts)
