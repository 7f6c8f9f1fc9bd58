"""Selection of orders by evidence, step by step."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING

import numpy as np

from ...runs.aliasing import Positions
from ...runs.run import CalibrationRun
from ...support.display_units import brief_number
from ..rounding import rounding_over_repeats, rounding_step
from ..uncertainty import CovarianceKind
from .candidates import Candidates
from .harmonicsums import HarmonicSums, harmonic_sums
from .lookalikes import find_lookalikes
from .noise import pure_error
from .ordernoise import OrderNoise
from .phases import circular_range_deg, unit_phases
from .result import OrderSelection
from .search import FALSE_ALARM, EvidenceSearch
from .table import OrderRow
from .verdicts import row_with_verdict, selection_notes, verdict_reason
from .zerogroups import folds_of_run, passes_of_run, zero_groups

if TYPE_CHECKING:
    from ..summed import SummedReadings

__all__ = ["FALSE_ALARM", "EvidenceSelection"]


class EvidenceSelection(EvidenceSearch):
    """One selection by evidence from the readings of runs."""

    def __init__(
        self,
        runs: Sequence[CalibrationRun],
        positions: Positions,
        candidates: Candidates,
        covariance: CovarianceKind = "auto",
        summed: SummedReadings | None = None,
    ) -> None:
        self.runs = runs
        self.candidates = candidates
        self.units, places = zero_groups(runs, candidates.whole)
        self.positions = positions.of_rows(places)
        orders = candidates.orders
        sums = harmonic_sums(self.units, orders) if summed is None else summed.sums(orders)
        units = len(self.units) if summed is None else len(runs)
        reference = set(candidates.reference)
        passes = None
        if units > 1:
            self.holdout = "one run at a time"
            if units > len(runs):
                self.holdout = "one mount at a time"
            if sums.units < units:
                self.holdout = f"one of {sums.units} groups of runs at a time"
            folds: HarmonicSums | None = sums
        else:
            parts = folds_of_run(self.units[0], self.positions)
            self.holdout = "whole blocks of neighbouring positions (single run)"
            folds = harmonic_sums(parts, candidates.orders) if parts else None
            path = runs[0].unwrapped_reference / runs[0].period
            turns = passes_of_run(self.units[0], path) if positions.span >= 1.0 else []
            passes = harmonic_sums(turns, candidates.orders) if turns else None
        repeats = pure_error(self.units, self.positions)
        self.samples = int(sums.count.sum())
        self.step = rounding_step(runs, self.positions)
        noise = OrderNoise(
            sums,
            self.samples - units,
            repeats,
            covariance,
            rounding_over_repeats(self.step, repeats, self.samples / len(self.positions)),
            min(1.0, self.positions.span),
            passes,
            candidates.closed,
        )
        forced = [i for i, k in enumerate(candidates.orders) if k in reference]
        limits = candidates.log_limits(FALSE_ALARM)
        super().__init__(noise, limits, runs[0].period, folds, forced)

    def result(self) -> OrderSelection:
        """The selection with its table."""
        chosen, dropped = self._beyond_rounding(*self.search())
        lookalikes = self._lookalikes(chosen)
        lowest = self._lowest(chosen, lookalikes)
        if lowest != chosen:
            lookalikes = self._lookalikes(lowest)
        return self._report(lowest, dropped, lookalikes)

    def _beyond_rounding(
        self, chosen: list[int], dropped: dict[int, str]
    ) -> tuple[list[int], dict[int, str]]:
        """Without the orders that the rounding of a coarse sensor may have made."""
        mine = [i for i in chosen if i not in self.forced]
        if not (self.step and mine):
            return chosen, dropped
        from .rounding import orders_beyond_rounding  # most readings are fine enough

        test = self.examined(chosen, mine)
        strongest = np.argsort(-np.hypot(test.cosine, test.sine), kind="stable")
        places = [*self.forced, *(mine[k] for k in strongest)]
        told = orders_beyond_rounding(
            self.units,
            self.step,
            self.orders_of(places),
            self.limits[places].tolist(),
            len(self.forced),
        )
        kept = {*self.forced, *(places[k] for k in told)}
        dropped |= {i: "rounding" for i in chosen if i not in kept}
        return [i for i in chosen if i in kept], dropped

    def _lookalikes(self, chosen: Sequence[int]) -> dict[int, dict[int, float]]:
        """Aliases of every chosen order that these readings cannot exclude."""
        found = find_lookalikes(
            self.units,
            self.positions,
            [self.orders[i] for i in chosen],
            self.noise(chosen).variance,
            self.candidates.highest_alias,
        )
        return dict(zip(chosen, found, strict=True))

    def _lowest(
        self, chosen: list[int], lookalikes: Mapping[int, Mapping[int, float]]
    ) -> list[int]:
        """Where the readings say nothing, the lowest candidate stands for its aliases."""
        result = list(chosen)
        enough = self.noise(chosen).variance
        for i, losses in lookalikes.items():
            lower = [m for m, loss in losses.items() if m < self.orders[i] and loss < enough]
            known = [j for j in self.candidates.main_indices if self.orders[j] in lower]
            free = [j for j in known if j not in result]
            if free and i not in self.forced:
                result[result.index(i)] = free[0]
        return result

    def _report(
        self,
        chosen: list[int],
        dropped: Mapping[int, str],
        lookalikes: Mapping[int, Mapping[int, float]],
    ) -> OrderSelection:
        shown = sorted({*chosen, *dropped, *self.candidates.main_indices})
        test = self.examined(chosen, shown)
        log_p, needed = test.log_p, test.needed(self.limits[shown])
        gains, model = self.gains_and_model(chosen, shown)
        phases = unit_phases(self.sums, chosen, shown)
        verdicts = {**dict.fromkeys(chosen, "retained"), **dict.fromkeys(self.forced, "reference")}
        rows = []
        for n, i in enumerate(shown):
            usable = math.isfinite(test.cosine[n])
            verdict = verdicts.get(i) or dropped.get(i) or ("noise" if usable else "alias")
            if verdict == "noise" and log_p[n] <= self.limits[i]:
                verdict = "no held-out gain" if not gains[n] > 0.0 else "weak"
            rows.append(
                OrderRow(
                    order=self.orders[i],
                    retained=verdict == "retained",
                    verdict=verdict,
                    cosine=float(test.cosine[n]) if usable else 0.0,
                    sine=float(test.sine[n]) if usable else 0.0,
                    standard_error=math.sqrt(test.variance[n]) if usable else math.inf,
                    statistic=float(test.statistic[n]),
                    log10_false_alarm=self._false_alarm(float(log_p[n]), i),
                    holdout_gain=float(gains[n]),
                    phase_spread_deg=circular_range_deg(phases[:, n]),
                    aliases=tuple(lookalikes.get(i, ())),
                    needed=float(needed[n]) if usable else math.nan,
                )
            )
        retained = {row.order: row.amplitude for row in rows if row.retained}
        rows = [row_with_verdict(row, self.candidates, self.positions, retained) for row in rows]
        orders = tuple(retained)
        without, with_ = self._held_out_rms(model)
        selection = OrderSelection(
            orders=orders,
            table=tuple(rows),
            reason="" if orders else self._refusal(rows),
            method="evidence",
            period=self.period,
            positions=self.positions,
            samples=self.samples,
            runs=len(self.runs),
            noise=self.noise(chosen),
            holdout=self.holdout,
            holdout_rms=(without, with_),
            gear_ratio=self.candidates.gear_ratio,
        )
        return selection.with_notes(selection_notes(selection, self.candidates, self.runs))

    def _refusal(self, rows: Sequence[OrderRow]) -> str:
        """Why nothing was retained."""
        if not rows:
            return (
                f"{len(self.positions)} distinct positions can tell no order from the zero: "
                "read at three positions or more"
            )
        best = min(rows, key=lambda row: row.log10_false_alarm)
        beside = f"the strongest of {len(self.orders)} orders searched, {best.order:g},"
        if best.verdict == "reference":
            return "the only orders that stand out are the reference's own"
        if best.verdict != "noise":
            return f"{beside} {verdict_reason(best.verdict)}"
        chance = 100.0 * 10.0**best.log10_false_alarm
        return (
            f"{beside} does not stand out of the noise "
            f"(noise alone does as well in {brief_number(chance)} % of such searches)"
        )

    def _held_out_rms(self, model: float) -> tuple[float, float]:
        """Held-out rms with no order at all and with the chosen ones."""
        if self.folds is None:
            return math.nan, math.nan
        weight = float(self.folds.weight.sum())
        none = float(self.folds.squares.sum())
        return math.sqrt(none / weight), math.sqrt(max(0.0, model) / weight)

    def _false_alarm(self, log_p: float, i: int) -> float:
        """Log10 of the chance in the whole search: the limit stands for `FALSE_ALARM`."""
        return min(0.0, (log_p - float(self.limits[i]) + math.log(FALSE_ALARM)) / math.log(10.0))
