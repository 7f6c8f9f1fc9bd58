"""Selection of orders by evidence, step by step."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..aliasing import Positions
from ..fitting.uncertainty import CovarianceKind
from ..runs import CalibrationRun
from .candidates import Candidates
from .evidence import (
    NEIGHBOURS,
    OrderTest,
    choose_forward,
    examine_orders,
    fit_subset,
    held_out_gains,
    neighbour_scatter,
    pooled_scatter,
    run_scatter,
)
from .harmonicsums import HarmonicSums, harmonic_sums
from .lookalikes import find_lookalikes
from .phases import circular_range_deg, unit_phases
from .repeats import Noise, pure_error
from .steepness import greatest_slope
from .table import OrderRow, OrderSelection
from .verdicts import because, explained, selection_notes
from .zerogroups import angle_blocks, units_of

__all__ = ["FALSE_ALARM", "EvidenceSelection"]

Array = NDArray[np.float64]

#: Chance, over the whole search, that noise alone makes any order significant. Half of
#: the 1 % promised: the rest covers what the noise estimate itself does not know.
FALSE_ALARM: Final = 0.005

#: Least degrees of freedom for which a noise estimate is used on its own.
_ENOUGH_DOF: Final = 20

#: An order is left out as negligible when its amplitude is below this share of the whole
#: error (root sum of squares of the amplitudes) ...
NEGLIGIBLE_SHARE: Final = 0.01
#: ... and at the same time below this share of one reading's scatter: correcting it would
#: change the error of no reading by anything to speak of.
NEGLIGIBLE_NOISE: Final = 0.1

#: Bound of the error's slope that the retained orders must keep: from 1 on an indicated
#: angle stands for several true ones, as ill-determined orders on a short arc make it.
STEEPEST: Final = 0.95

#: Amplitudes below this part of a turn are rounding of angles.
_ROUNDING: Final = 1e-12

#: Searches at most after orders were left out as too steep.
_AGAIN: Final = 3


class _Level(NamedTuple):
    """Variance of a reading and its freedom; each order's own, and the freedom of that."""

    noise: tuple[float, float]
    scatter: Array | None
    freedom: int | None


class EvidenceSelection:
    """One selection by evidence, step by step."""

    def __init__(
        self,
        runs: Sequence[CalibrationRun],
        positions: Positions,
        candidates: Candidates,
        covariance: CovarianceKind = "auto",
    ) -> None:
        self.runs = runs
        self.covariance = covariance
        self.candidates = candidates
        self.orders = candidates.orders
        self.units, places = units_of(runs, candidates.whole)
        self.positions = positions.of_rows(places)
        self.sums = harmonic_sums(self.units, self.orders)
        self.samples = int(self.sums.count.sum())
        self.free = self.samples - len(self.units)
        self.repeats = pure_error(self.units, self.positions)
        self.limits = candidates.log_limits(FALSE_ALARM)
        #: Orders too steep to be retained.
        self.barred: list[int] = []
        reference = set(candidates.reference)
        self.forced = [i for i, k in enumerate(self.orders) if k in reference]
        if len(self.units) > 1:
            self.holdout = "one run at a time"
            if len(self.units) > len(runs):
                self.holdout = "one mount at a time"
            if self.sums.units < len(self.units):
                self.holdout = f"one of {self.sums.units} groups of runs at a time"
            self.folds: HarmonicSums | None = self.sums
        else:
            parts = angle_blocks(self.units[0], self.positions)
            self.holdout = "whole blocks of neighbouring positions (single run)"
            self.folds = harmonic_sums(parts, self.orders) if parts else None

    def result(self) -> OrderSelection:
        """The selection with its table."""
        chosen, dropped = self._backward(self._forward())
        # What made the error too steep held others' places: choose again without it.
        for _ in range(_AGAIN):
            steep = [i for i, verdict in dropped.items() if verdict == "too steep"]
            if not steep:
                break
            self.barred = steep
            again, others = self._backward(self._forward())
            dropped |= others
            if not any(verdict == "too steep" for verdict in others.values()):
                chosen = again
                break
        dropped = {i: verdict for i, verdict in dropped.items() if i not in chosen}
        return self._report(self._lowest(chosen), dropped)

    def _noise(self, chosen: Sequence[int]) -> Noise:
        """Repeats, or the residual of all candidates, or of the chosen orders.

        Real orders that may not be retained disturb the others as noise does: the residual
        of the chosen ones holds them.
        """
        if self.barred:
            dof = max(1, self.free - 2 * len(chosen))
            return Noise(fit_subset(self.sums, chosen)[2] / dof, dof, "model")
        if self.repeats is not None and self.repeats.degrees_of_freedom >= _ENOUGH_DOF:
            return self.repeats
        everything = len(self.orders)
        if self.free - 2 * everything >= max(_ENOUGH_DOF, 2 * everything):
            _, _, squares = fit_subset(self.sums, range(everything))
            dof = self.free - 2 * everything
            return Noise(squares / dof, dof, "residual")
        dof = max(1, self.free - 2 * len(chosen))
        return Noise(fit_subset(self.sums, chosen)[2] / dof, dof, "model")

    def _level(self, chosen: Sequence[int]) -> _Level:
        """Noise of the coefficients: common to all orders, and each order's own."""
        noise = self._noise(chosen)
        level = (noise.variance, float(noise.degrees_of_freedom))
        if self.covariance == "hac":
            return _Level(level, neighbour_scatter(self.sums, chosen), NEIGHBOURS)
        if len(self.units) < 2 or self.covariance == "white":
            return _Level(level, None, None)
        scatter = run_scatter(self.sums, chosen, range(len(self.orders)))
        return _Level(pooled_scatter(scatter, self.sums.units) or level, scatter, None)

    def _examined(self, chosen: Sequence[int], orders: Sequence[int]) -> OrderTest:
        """Significance of orders under the noise that each has."""
        level = self._level(chosen)
        own = None if level.scatter is None else level.scatter[list(orders)]
        return examine_orders(self.sums, chosen, orders, level.noise, own, level.freedom)

    def _forward(self) -> list[int]:
        noise = self._noise(())
        known = None
        if noise.source != "model":
            known = (noise.variance, float(noise.degrees_of_freedom))
        return choose_forward(self.sums, self.limits, self.free, known, self.forced, self.barred)

    def _backward(self, chosen: list[int]) -> tuple[list[int], dict[int, str]]:
        """Drop, worst first, what does not stand beside the others."""
        dropped: dict[int, str] = {}
        while True:
            mine = [i for i in chosen if i not in self.forced]
            if not mine:
                return chosen, dropped
            test = self._examined(chosen, mine)
            verdict, failing = "noise", test.log_p - self.limits[mine]
            if not (failing > 0.0).any():
                verdict, failing = "no held-out gain", -self._gains(chosen, mine)
            if not (failing >= 0.0).any():
                amplitude = np.hypot(test.cosine, test.sine)
                share = amplitude / math.sqrt(float((amplitude**2).sum()))
                scatter_of_one = self._noise(chosen).standard_deviation
                small = (share < NEGLIGIBLE_SHARE) & (amplitude < NEGLIGIBLE_NOISE * scatter_of_one)
                small |= amplitude < _ROUNDING * self.runs[0].period
                verdict, failing = "negligible", np.where(small, 1.0, -1.0)
                if not small.any():
                    steep = self._too_steep(chosen)
                    if steep:
                        dropped |= dict.fromkeys(steep, "too steep")
                        chosen = [i for i in chosen if i not in steep]
                        continue
                    failing = np.full(len(mine), -1.0)
                if not (failing >= 0.0).any():
                    return chosen, dropped
            # The weaker half at once: the stronger may recover once these are gone.
            weakest = np.argsort(test.statistic, kind="stable")
            weakest = weakest[failing[weakest] >= 0.0]
            worst = weakest[: (weakest.size + 1) // 2]
            dropped |= {mine[w]: verdict for w in worst}
            gone = {mine[w] for w in worst}
            chosen = [i for i in chosen if i not in gone]

    def _too_steep(self, chosen: Sequence[int]) -> list[int]:
        """Orders to leave out so that the error can be corrected: the steepest weak ones.

        One by one that order goes which adds most slope for the energy that it explains,
        its order over its amplitude, until the greatest slope of the rest is below `STEEPEST`.
        """
        kept = sorted(chosen)
        gone: list[int] = []
        while True:
            cosine, sine = fit_subset(self.sums, kept)[0].reshape(2, -1)
            orders = self.orders_of(kept)
            if greatest_slope(orders, cosine, sine, self.runs[0].period) < STEEPEST:
                return gone
            price = np.asarray(orders) / np.maximum(np.hypot(cosine, sine), 1e-300)
            price[[kept.index(i) for i in self.forced if i in kept]] = -math.inf
            worst = int(np.argmax(price))
            if price[worst] < 0.0:
                return gone
            gone.append(kept.pop(worst))

    def orders_of(self, chosen: Sequence[int]) -> list[float]:
        """The orders at these places."""
        return [self.orders[i] for i in chosen]

    def _gains(self, chosen: Sequence[int], orders: Sequence[int]) -> Array:
        """Part by which each order lowers the held-out mean square."""
        return self._gains_and_model(chosen, orders)[0]

    def _gains_and_model(self, chosen: Sequence[int], orders: Sequence[int]) -> tuple[Array, float]:
        """The gains, and the held-out sum of squares of the chosen orders."""
        if self.folds is None:
            return np.full(len(orders), math.nan), math.nan
        without, with_, model = held_out_gains(self.folds, chosen, orders)
        return np.asarray((without - with_) / np.maximum(np.abs(without), 1e-300)), model

    def _lookalikes(self, chosen: Sequence[int]) -> dict[int, dict[int, float]]:
        """Aliases of every chosen order that these readings cannot exclude."""
        found = find_lookalikes(
            self.units,
            self.positions,
            [self.orders[i] for i in chosen],
            self._noise(chosen).variance,
            self.candidates.highest_alias,
        )
        return dict(zip(chosen, found, strict=True))

    def _lowest(self, chosen: list[int]) -> list[int]:
        """Where the readings say nothing, the lowest candidate stands for its aliases."""
        result = list(chosen)
        enough = self._noise(chosen).variance
        for i, losses in self._lookalikes(chosen).items():
            lower = [m for m, loss in losses.items() if m < self.orders[i] and loss < enough]
            known = [j for j in self.candidates.main_indices if self.orders[j] in lower]
            free = [j for j in known if j not in result]
            if free and i not in self.forced:
                result[result.index(i)] = free[0]
        return result

    def _report(self, chosen: list[int], dropped: Mapping[int, str]) -> OrderSelection:
        shown = sorted({*chosen, *dropped, *self.candidates.main_indices})
        test = self._examined(chosen, shown)
        gains, model = self._gains_and_model(chosen, shown)
        phases = unit_phases(self.sums, chosen, shown)
        lookalikes = self._lookalikes(chosen)
        verdicts = {**dict.fromkeys(chosen, "retained"), **dict.fromkeys(self.forced, "reference")}
        rows = []
        for n, i in enumerate(shown):
            usable = math.isfinite(test.cosine[n])
            verdict = verdicts.get(i) or dropped.get(i) or ("noise" if usable else "alias")
            if verdict == "noise" and test.log_p[n] <= self.limits[i]:
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
                    log10_false_alarm=self._false_alarm(float(test.log_p[n]), i),
                    holdout_gain=float(gains[n]),
                    phase_spread_deg=circular_range_deg(phases[:, n]),
                    aliases=tuple(lookalikes.get(i, ())),
                )
            )
        rows = [explained(row, self.candidates, self.positions) for row in rows]
        orders = tuple(row.order for row in rows if row.retained)
        without, with_ = self._held_out_rms(model)
        selection = OrderSelection(
            orders=orders,
            table=tuple(rows),
            reason="" if orders else self._refusal(rows),
            method="evidence",
            period=self.runs[0].period,
            positions=self.positions,
            samples=self.samples,
            runs=len(self.runs),
            noise=self._noise(chosen),
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
            return f"{beside} {because(best.verdict)}"
        chance = 100.0 * 10.0**best.log10_false_alarm
        return (
            f"{beside} does not stand out of the noise "
            f"(noise alone does as well in {chance:.2g} % of such searches)"
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
