"""Selection of orders by evidence, without those of rounding and of lines in time."""

from __future__ import annotations

import math
from collections.abc import Collection, Mapping, Sequence
from typing import TYPE_CHECKING, Final

import numpy as np
from numpy.typing import NDArray

from ..._core import Groups, line_columns
from ...estimation.evidence import Alone, EvidenceEstimate, estimate_by_evidence
from ...estimation.factor import orthonormal_basis
from ...estimation.rounded import fit_rounded, is_rounding_visible
from ...joint.gear import HIGHEST_LOW_ORDER
from ...model.validity import greatest_slope
from ...runs.aliasing import Positions
from ...runs.checks.record import FEW
from ...runs.run import CalibrationRun
from ...support.angles import arcsec
from ...support.arrays import Array
from ...support.display_units import brief_number, error_unit, sine_of_rms
from ...support.layout import counted
from ..rounding import rounding_step
from .candidates import LIKELY, Candidates
from .chosen import held_out_gains
from .lookalikes import find_lookalikes
from .noise import ReadingVariance
from .phases import circular_range_deg, unit_phases
from .result import OrderSelection
from .table import IN_MODEL, OrderRow
from .verdicts import is_one_sweep, not_noise, row_with_verdict, selection_notes, verdict_reason
from .zerogroups import (
    GROUPS,
    MOST_UNITS,
    ZeroGroupReadings,
    folds_of_run,
    some_angles,
    some_readings,
    unit_columns,
    zero_groups,
)

if TYPE_CHECKING:
    from ..summed import SummedReadings


def orders_beyond_rounding(
    units: Sequence[ZeroGroupReadings],
    step: float,
    orders: Sequence[float],
    limit: float,
    forced: int = 0,
) -> list[int]:
    """Places of the orders that rounding alone does not explain, the strongest first.

    Parameters
    ----------
    units : sequence of ZeroGroupReadings
    step : float
        Of the sensor, in the unit of the errors.
    orders : sequence of float
        Strongest first; the first ``forced`` of them are always in the model and not returned.
    limit : float
        Log of the p-value below which an order is accepted: by the likelihood ratio for both of its
        coefficients, which without it is χ² with two degrees of freedom.
    """
    from ...joint.pattern import lines_columns  # few fits need it

    error = np.concatenate([unit.error for unit in units])
    theta = 2.0 * np.pi * np.concatenate([unit.turns for unit in units])
    zeros = np.repeat(np.eye(len(units)), [unit.turns.size for unit in units], axis=0)
    lines = lines_columns(theta, np.asarray(orders, dtype=np.float64))

    def columns(places: Sequence[int]) -> Array:
        return np.hstack([zeros, *(lines[:, 2 * k : 2 * k + 2] for k in places)])

    left = error - _fitted(columns(range(len(orders))), error)
    about = error - _fitted(zeros, error)
    if not is_rounding_visible(step**2 / 12.0, float(np.var(left)), float(np.var(about))):
        return list(range(forced, len(orders)))
    told = list(range(forced))
    fit = fit_rounded(orthonormal_basis(columns(told)), error, step)
    for k in range(forced, len(orders)):
        if fit.within:
            break
        other = fit_rounded(orthonormal_basis(columns([*told, k])), error, step)
        if fit.log_likelihood - other.log_likelihood < limit:
            told.append(k)
            fit = other
    return told[forced:]


def _fitted(columns: Array, error: Array) -> Array:
    basis = orthonormal_basis(columns)
    return np.asarray(basis @ (basis.T @ error))


def lines_in_time(
    estimate: EvidenceEstimate, orders: Collection[float], tested: Collection[float], chance: float
) -> set[float]:
    """Those of the orders ``tested`` that lines in time hold better than places do.

    Where the speed varies, a line of a fixed frequency is no order, and several orders next to one
    another are needed for it. Both compete under the noise of the estimate: the ``orders`` that
    are in, with the probability that they had, and lines at every half cycle of the run near
    those tested, each with the probability ``chance``. Of several runs that is not asked: there
    the phase of such a line differs from run to run.
    """
    theta, error, time, _ = estimate.runs[0]
    if len(estimate.runs) > 1 or time is None or not tested:
        return set()
    # Time in turns of the mean speed: a line near order k has k cycles in one of them.
    travel = np.ptp(theta)
    clock = (time - time[0]) / np.ptp(time) * travel
    near = {k + 2.0 * np.pi / travel * s for k in tested for s in np.arange(-1.5, 2.0, 0.5)}
    given = (theta, [*orders]), (clock, sorted(near))
    columns = np.hstack([line_columns(at, np.array(lines, float)) for at, lines in given])
    columns -= columns.mean(axis=0)
    known = dict(zip(estimate.orders, estimate.prior.tolist(), strict=True))
    chances = [min(known[k], 0.99) for k in orders] + [chance] * len(near)
    total = float(np.var(error))
    readings = [(columns, error - error.mean(), time)]
    sums = Groups(readings, [2] * len(chances)).sums(estimate.noise, total)
    none = [0.0] * len(chances)
    found = max(
        sums.search(none, chances, [total] * len(orders) + [0.0] * len(near)),
        sums.search(none, chances, none),
    )
    return set(tested) - {k for k, size in zip(orders, found[1], strict=False) if size > 0.0}


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
        self.folds = self.units
        if len(self.units) > 1:
            what = "mount" if len(self.units) > len(runs) else "run"
            if len(self.units) > MOST_UNITS:
                what = f"of {GROUPS} groups of runs"
        else:
            what = "block of neighbouring positions"
            parts = folds_of_run(units[0], self.positions) if len(units) == 1 else []
            self.folds = some_readings(parts)
        self.holdout = f"each {what} predicted by a fit to the others"

    def result(self) -> OrderSelection:
        """The selection with its table."""
        readings = [unit.given() for unit in self.units]
        estimate = estimate_by_evidence(readings, self.orders, self.candidates.probabilities())
        chosen, dropped = self._carriers(estimate)
        chosen, dropped = self._at_places(chosen, dropped, estimate)
        unknowns = len(self.units) + 2 * len(chosen)
        freedom = max(sum(unit.turns.size for unit in self.units) - unknowns, 1)
        noise = ReadingVariance(float(estimate.within.sum()), freedom, "evidence")
        chosen, dropped = self._beyond_rounding(chosen, dropped, estimate)
        return self._report(estimate, noise, chosen, dropped)

    def _carriers(self, estimate: EvidenceEstimate) -> tuple[list[int], dict[int, str]]:
        """Orders that hold the curve of an estimate, and those too small to change any reading."""
        reference = self.candidates.reference
        carriers = estimate.carriers(self.travel, reference)
        mean, _ = estimate.among(carriers, self.travel, reference)
        amplitude = np.hypot(*mean.reshape(-1, 2).T)
        share = amplitude / max(math.sqrt(float((amplitude**2).sum())), 1e-300)
        scatter = math.sqrt(float(estimate.within.sum()))
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
        orders = [self.orders[i] for i in shown]
        mine = [shown.index(i) for i in chosen]
        units = unit_columns(self.units, orders)
        spread = circular_range_deg(unit_phases(units, mine))
        if self.folds is not self.units:
            units = unit_columns(self.folds, orders)
        gains, rms = self._held_out(units, mine)
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
                    holdout_gain=float(gains[n]) if gains.size else math.nan,
                    phase_spread_deg=float(spread[n]),
                    aliases=tuple(aliases.get(i, ())),
                    needed=std * needed[i] if math.isfinite(std) else math.nan,
                    probability=float(chance[i]),
                )
            )
        if self.samples <= len(self.units) + 2:  # no reading for the noise
            rows = []
        retained = {row.order: row.amplitude for row in rows if row.verdict in IN_MODEL}
        rows = [row_with_verdict(row, self.candidates, self.positions, retained) for row in rows]
        selection = OrderSelection(
            orders=tuple(retained),
            table=tuple(rows),
            reason="" if retained else self._refusal(rows, estimate),
            method="evidence",
            period=self.period,
            positions=self.positions,
            samples=self.samples,
            runs=len(self.runs),
            noise=noise,
            holdout=self.holdout,
            holdout_rms=rms,
            gear_ratio=self.candidates.gear_ratio,
            estimate=estimate,
        )
        return selection.with_notes(selection_notes(selection, self.candidates, self.runs))

    def _refusal(self, rows: Sequence[OrderRow], estimate: EvidenceEstimate) -> str:
        """Why nothing was retained."""
        plan = f"run: `ta.plan_arc(0, 360, readings={FEW})`"
        if not rows:
            read = f"{counted(self.samples, 'reading')} at {counted(self.positions, 'position')}"
            return (
                f"{read} are too few: 1 order and {counted(self.units, 'zero')} need "
                f"{len(self.units) + 3} readings; to search for orders take {FEW} or more; {plan}"
            )
        best = max(rows, key=lambda row: row.probability)
        likeliest = f"likeliest of {len(self.orders)}" if len(self.orders) > 1 else "only one"
        beside = f"order {best.order:g}, the {likeliest},"
        if best.verdict == "reference":
            return "the only significant orders are the reference's own"
        if best.verdict not in ("noise", "alias"):
            return f"{beside} {verdict_reason(best.verdict)}"
        chance = f"has a probability of only {brief_number(100.0 * best.probability)} %"
        drift = not_noise(self.runs, estimate) if is_one_sweep(self.runs) else []
        why = [f"{beside} {chance}", *drift]
        if self.samples < FEW:
            why[0] = f"{counted(self.samples, 'reading')} are too few: {why[0]}"
            why.append(f"take {FEW} readings or more; {plan}")
        elif len(why) == 1 and (known := [r.needed for r in rows if math.isfinite(r.needed)]):
            least = arcsec(max(known), self.period)
            unit = error_unit("auto", sine_of_rms(least), self.period)
            size = f"{brief_number(least * unit.per_arcsec)} {unit.name}"
            why[0] = f"no order is above the noise: {why[0]}"
            why.append(f"an order above about {size} would be found; nothing to correct")
        return "; ".join(why)

    def _held_out(
        self, parts: Sequence[Array], chosen: Sequence[int]
    ) -> tuple[Array, tuple[float, float]]:
        """Reduction of the held-out mean square by each order; rms without and with the chosen."""
        if not parts:
            return np.empty(0), (math.nan, math.nan)
        without, with_, model = held_out_gains(parts, chosen)
        gains = (without - with_) / np.maximum(np.abs(without), 1e-300)
        weight = sum(float(unit.weights.sum()) for unit in self.folds)
        none = sum(float(part[:, -1] @ part[:, -1]) for part in parts)
        return gains, (math.sqrt(none / weight), math.sqrt(model / weight))

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
