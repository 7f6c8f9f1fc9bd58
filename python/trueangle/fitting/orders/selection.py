"""Selection of orders by evidence, step by step."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from ...estimation.evidence import Alone, EvidenceEstimate, estimate_by_evidence
from ...joint.gear import HIGHEST_LOW_ORDER
from ...model.validity import greatest_slope
from ...runs.aliasing import Positions
from ...runs.run import CalibrationRun
from ...support.arrays import Array
from ...support.display_units import brief_number
from ...support.layout import counted
from ..rounding import rounding_step
from .candidates import LIKELY, Candidates
from .chosen import held_out_gains
from .harmonicsums import HarmonicSums, harmonic_sums
from .lookalikes import find_lookalikes
from .noise import ReadingVariance
from .phases import circular_range_deg, unit_phases
from .result import OrderSelection
from .table import IN_MODEL, OrderRow
from .timelines import lines_in_time
from .verdicts import drift_of_a_sweep, row_with_verdict, selection_notes, verdict_reason
from .zerogroups import folds_of_run, some_angles, some_readings, zero_groups

if TYPE_CHECKING:
    from ..summed import SummedReadings

#: Readings from which a choice among orders is sound: fewer are refused with a plan.
FEW: Final = 20

#: Probability, over the whole search, of an order made by a coarse sensor's rounding alone.
FALSE_ALARM: Final = 0.005

#: An order is omitted as negligible when its amplitude is below this share of the whole
#: error (root sum of squares of the amplitudes) ...
NEGLIGIBLE_SHARE: Final = 0.01
#: ... and at the same time below this share of one reading's scatter: correcting it would
#: change the error of no reading by anything to speak of.
NEGLIGIBLE_NOISE: Final = 0.1

#: Bound of the error's slope that the retained orders must keep: from 1 on several
#: true angles give one reading, which ill-determined orders on a short arc can cause.
STEEPEST: Final = 0.95

#: Amplitudes below this part of a turn are rounding of angles.
_ROUNDING: Final = 1e-12

#: Sizes that an order may have, equally probable.
_SIZES: Final = 7


class EvidenceSelection:
    """One selection by evidence from the readings of runs."""

    def __init__(
        self,
        runs: Sequence[CalibrationRun],
        positions: Positions,
        candidates: Candidates,
        summed: SummedReadings | None = None,
    ) -> None:
        self.runs, self.candidates, self.period = runs, candidates, runs[0].period
        units, places = zero_groups(runs, candidates.whole)
        self.positions = positions.of_rows(places)
        self.samples = (
            sum(unit.turns.size for unit in units) if summed is None else summed.moments.count
        )
        self.step = rounding_step(runs, self.positions)
        #: Angles of the readings in radians, enough to represent the travel.
        self.travel = some_angles([unit.turns for unit in units], 1.0)
        self.units = some_readings(units)
        self.orders = list(candidates.orders)
        reference = set(candidates.reference)
        self.forced = [i for i, k in enumerate(self.orders) if k in reference]
        self.sums = harmonic_sums(self.units, self.orders)
        self.folds: HarmonicSums | None = self.sums
        if len(self.units) > 1:
            what = "mount" if len(self.units) > len(runs) else "run"
            if self.sums.units < len(self.units):
                what = f"of {self.sums.units} groups of runs"
        else:
            what = "block of neighbouring positions"
            parts = folds_of_run(units[0], self.positions) if len(units) == 1 else []
            self.folds = harmonic_sums(parts, self.orders) if parts else None
        self.holdout = f"each {what} predicted by a fit to the others"

    def result(self) -> OrderSelection:
        """The selection with its table."""
        readings = [unit.given() for unit in self.units]
        estimate = estimate_by_evidence(readings, self.orders, self.candidates.probabilities())
        chosen, dropped = self._carriers(estimate)
        chosen, dropped = self._at_places(chosen, dropped, estimate)
        unknowns = len(self.units) + 2 * len(chosen)
        freedom = max(sum(unit.turns.size for unit in self.units) - unknowns, 1)
        noise = ReadingVariance(float(estimate.noise.sum()), freedom, "evidence")
        chosen, dropped = self._beyond_rounding(chosen, dropped, estimate)
        return self._report(estimate, noise, chosen, dropped)

    def _carriers(self, estimate: EvidenceEstimate) -> tuple[list[int], dict[int, str]]:
        """Orders that hold the curve of an estimate, and those too small to change any reading."""
        reference = self.candidates.reference
        carriers = estimate.carriers(self.travel, reference)
        mean, _ = estimate.among(carriers, self.travel, reference)
        amplitude = np.hypot(*mean.reshape(-1, 2).T)
        share = amplitude / max(math.sqrt(float((amplitude**2).sum())), 1e-300)
        scatter = math.sqrt(float(estimate.noise.sum()))
        small = (share < NEGLIGIBLE_SHARE) & (amplitude < NEGLIGIBLE_NOISE * scatter)
        small |= amplitude < _ROUNDING * self.period
        places = [self.orders.index(k) for k in carriers]
        dropped = {i: "negligible" for i, s in zip(places, small, strict=True) if s}
        kept = [i for i in places if i not in dropped]
        steep = self._too_steep(estimate, kept)
        dropped |= dict.fromkeys(steep, "too steep")
        return self.forced + [i for i in kept if i not in steep], dropped

    def _too_steep(self, estimate: EvidenceEstimate, places: Sequence[int]) -> list[int]:
        """Orders to omit so that the error can be corrected: the steepest weak ones.

        One by one that order goes which adds most slope for the energy that it explains,
        its order over its amplitude, until the greatest slope of the others is below `STEEPEST`.
        """
        gone = list[int]()
        orders = np.array([self.orders[i] for i in places], dtype=float)
        mean, _ = estimate.among(orders.tolist(), self.travel, self.candidates.reference)
        pairs = mean.reshape(-1, 2)
        price = orders / np.maximum(np.hypot(*pairs.T), 1e-300)
        left = np.argsort(price, kind="stable")
        while left.size:
            cosine, sine = pairs[left].T
            if greatest_slope(orders[left].tolist(), cosine, sine, self.period) < STEEPEST:
                break
            left, last = left[:-1], int(left[-1])
            gone.append(places[last])
        return gone

    def _at_places(
        self, chosen: list[int], dropped: dict[int, str], estimate: EvidenceEstimate
    ) -> tuple[list[int], dict[int, str]]:
        """Without the high orders of no known cause that lines in time hold better."""
        mine = {self.orders[i]: i for i in [*chosen, *dropped]}
        chances = zip(self.orders, self.candidates.probabilities(), strict=True)
        unknown = {k: p for k, p in chances if k > HIGHEST_LOW_ORDER and p < LIKELY}
        tested = [k for k in mine if k in unknown]
        # As likely as one of these orders, and two to a cycle.
        chance = 0.5 * sum(unknown.values()) / max(len(unknown), 1)
        lines = lines_in_time(estimate, list(mine), tested, chance)
        dropped |= {mine[k]: "in time" for k in lines}
        return [i for i in chosen if self.orders[i] not in lines], dropped

    def _beyond_rounding(
        self, chosen: list[int], dropped: dict[int, str], estimate: EvidenceEstimate
    ) -> tuple[list[int], dict[int, str]]:
        """Without the orders that the rounding of a coarse sensor may have made."""
        mine = [i for i in chosen if i not in self.forced]
        if not (self.step and mine):
            return chosen, dropped
        from .rounding import orders_beyond_rounding  # most readings are fine enough

        beside = [*self.candidates.reference, *(self.orders[i] for i in dropped)]
        mean, _ = estimate.among([self.orders[i] for i in mine], self.travel, beside)
        strongest = np.argsort(-np.hypot(*mean.reshape(-1, 2).T), kind="stable")
        places = [*self.forced, *(mine[k] for k in strongest)]
        told = orders_beyond_rounding(
            self.units,
            self.step,
            [self.orders[i] for i in places],
            math.log(FALSE_ALARM / len(self.orders)),
            len(self.forced),
        )
        kept = {*self.forced, *(places[k] for k in told)}
        dropped |= {i: "rounding" for i in chosen if i not in kept}
        return [i for i in chosen if i in kept], dropped

    def _report(
        self,
        estimate: EvidenceEstimate,
        noise: ReadingVariance,
        chosen: list[int],
        dropped: Mapping[int, str],
    ) -> OrderSelection:
        shown = sorted({*chosen, *dropped, *self.candidates.main_indices})
        gains, model = self._gains(chosen, shown)
        spread = circular_range_deg(unit_phases(self.sums, chosen, shown))
        lookalikes = find_lookalikes(
            self.units,
            self.positions,
            [self.orders[i] for i in chosen],
            noise.variance,
            self.candidates.highest_alias,
        )
        aliases = dict(zip(chosen, lookalikes, strict=True))
        chance = estimate.probability
        verdicts = {i: "retained" if chance[i] >= 0.5 else "shared" for i in chosen}
        verdicts |= dict.fromkeys(self.forced, "reference") | dict(dropped)
        needed = self._needed()
        rows = []
        for n, i in enumerate(shown):
            alone = estimate.alone[i]
            own = alone or Alone(0.0, 0.0, math.inf, math.inf)
            verdict = verdicts.get(i) or ("alias" if alone is None else "noise")
            std = math.sqrt(0.5 * (own.cosine_variance + own.sine_variance))
            rows.append(
                OrderRow(
                    order=self.orders[i],
                    retained=verdict == "retained",
                    verdict=verdict,
                    cosine=own.cosine,
                    sine=own.sine,
                    standard_error=std,
                    statistic=own.statistic,
                    log10_false_alarm=self._false_alarm(own.statistic),
                    holdout_gain=float(gains[n]),
                    phase_spread_deg=float(spread[n]),
                    aliases=tuple(aliases.get(i, ())),
                    needed=std * needed[i] if math.isfinite(std) else math.nan,
                    probability=float(chance[i]),
                )
            )
        retained = {row.order: row.amplitude for row in rows if row.verdict in IN_MODEL}
        if not retained and self.samples <= len(self.units) + 2:  # no reading for the noise
            rows = []
        rows = [row_with_verdict(row, self.candidates, self.positions, retained) for row in rows]
        orders = tuple(retained)
        selection = OrderSelection(
            orders=orders,
            table=tuple(rows),
            reason="" if orders else self._refusal(rows, estimate),
            method="evidence",
            period=self.period,
            positions=self.positions,
            samples=self.samples,
            runs=len(self.runs),
            noise=noise,
            holdout=self.holdout,
            holdout_rms=self._held_out_rms(model),
            gear_ratio=self.candidates.gear_ratio,
            estimate=estimate,
        )
        return selection.with_notes(selection_notes(selection, self.candidates, self.runs))

    def _refusal(self, rows: Sequence[OrderRow], estimate: EvidenceEstimate) -> str:
        """Why nothing was retained."""
        plan = f"run: `ta.plan_arc(0, 360, readings={FEW})`"
        if not rows:
            read = f"{counted(self.samples, 'reading')} at {counted(self.positions, 'position')}"
            zeros = counted(self.units, "zero")
            what = "readings" if self.samples <= len(self.units) + 2 else "positions"
            return (
                f"too few {what}: {read}; {zeros} and one order need {len(self.units) + 3}, "
                f"a choice among orders {FEW}; {plan}"
            )
        best = max(rows, key=lambda row: row.probability)
        beside = f"order {best.order:g}, the strongest of {len(self.orders)},"
        if best.verdict == "reference":
            return "the only significant orders are the reference's own"
        if best.verdict not in ("noise", "alias"):
            return f"{beside} {verdict_reason(best.verdict)}"
        chance = f"(probability {brief_number(100.0 * best.probability)} %)"
        steps = [f"take {FEW} readings or more; {plan}"] if self.samples < FEW else []
        why = [f"{beside} is not significant {chance}"]
        return "; ".join([*why, *drift_of_a_sweep(self.runs, estimate.noise), *steps])

    def _gains(self, chosen: Sequence[int], orders: Sequence[int]) -> tuple[Array, float]:
        """Reduction of the held-out mean square by each order; that of the chosen orders."""
        if self.folds is None:
            return np.full(len(orders), math.nan), math.nan
        without, with_, model = held_out_gains(self.folds, chosen, orders)
        return np.asarray((without - with_) / np.maximum(np.abs(without), 1e-300)), model

    def _held_out_rms(self, model: float) -> tuple[float, float]:
        """Held-out rms with no order at all and with the chosen ones."""
        if self.folds is None:
            return math.nan, math.nan
        weight = float(self.folds.weight.sum())
        none = float(self.folds.squares.sum())
        return math.sqrt(none / weight), math.sqrt(max(0.0, model) / weight)

    def _needed(self) -> NDArray[np.float64]:
        """Amplitudes, in standard errors, from which orders are more likely there than not.

        A size ``τ`` that fits the statistic T of two coefficients changes the odds by
        ``exp(T/2) / (1 + T/2)``.
        """
        chance = np.array(self.candidates.probabilities())
        odds = np.log(_SIZES * (1.0 - chance) / chance)
        half = np.maximum(odds, 0.0)
        for _ in range(30):
            half = np.maximum(odds + np.log1p(half), 0.0)
        return np.asarray(np.sqrt(2.0 * half))

    def _false_alarm(self, statistic: float) -> float:
        """Log10 of the probability that noise alone gives any order this statistic."""
        return min(0.0, math.log10(len(self.orders)) - 0.5 * statistic / math.log(10.0))
