"""The search for orders on sums of readings: forward, backward, and what is too steep.

Runs in memory and logs that were read once come here alike: all it needs are the normal
equations of each run (`HarmonicSums`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final

import numpy as np

from ...model.validity import greatest_slope
from ...support.arrays import Array
from .evidence import choose_forward, fit_chosen_orders, held_out_gains
from .harmonicsums import HarmonicSums
from .noise import ReadingVariance
from .noisespectrum import NoiseSpectrum
from .ordernoise import LEAST_BELIEF, OrderNoise
from .significance import OrderTest, examine_orders

#: Chance, over the whole search, that noise alone makes any order significant. Half of
#: the 1 % promised: the rest covers what the noise estimate itself does not know.
FALSE_ALARM: Final = 0.005

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


class EvidenceSearch:
    """One search for orders.

    Parameters
    ----------
    noise_of_orders : OrderNoise
        What orders have to stand out of; its sums are searched.
    limits : ndarray
        Log of the false-alarm chance that each order may use up.
    period : float
    folds : HarmonicSums or None
        Units that are held out one by one; None where nothing can be.
    forced : sequence of int
        Orders that are in every model and never retained.
    """

    def __init__(
        self,
        noise_of_orders: OrderNoise,
        limits: Array,
        period: float,
        folds: HarmonicSums | None,
        forced: Sequence[int] = (),
    ) -> None:
        self.noise_of_orders, self.sums = noise_of_orders, noise_of_orders.sums
        # Whole orders as whole numbers: results show and compare them.
        self.orders: list[float] = [int(m) if m == int(m) else m for m in self.sums.orders.tolist()]
        self.limits, self.period, self.folds = limits, period, folds
        self.forced = list(forced)

    def search(self) -> tuple[list[int], dict[int, str]]:
        """Places of the orders that stand, and the verdict on each that was dropped."""
        noise = self.noise_of_orders
        if not noise.by_orders:
            return self._search()
        # What stands out of white noise may be a line: the others tell whether the noise is white.
        asked, noise.kind = noise.kind, "white"
        found = self._search()
        if asked == "auto" and not noise.remembers(found[0]):
            return found
        noise.kind, noise.barred = "hac", []
        noise.settle(found[0], self.forced)
        return self._search()

    def _search(self) -> tuple[list[int], dict[int, str]]:
        chosen, dropped = self._backward(self._forward())
        # What made the error too steep held others' places: choose again without it.
        for _ in range(_AGAIN):
            steep = [i for i, verdict in dropped.items() if verdict == "too steep"]
            if not steep:
                break
            # Orders too steep to be retained.
            self.noise_of_orders.barred = steep
            again, others = self._backward(self._forward())
            dropped |= others
            if not any(verdict == "too steep" for verdict in others.values()):
                chosen = again
                break
        return chosen, {i: verdict for i, verdict in dropped.items() if i not in chosen}

    def noise(self, chosen: Sequence[int]) -> ReadingVariance:
        """What one reading scatters beside the chosen orders."""
        return self.noise_of_orders.of_reading(chosen)

    def examined(self, chosen: Sequence[int], orders: Sequence[int]) -> OrderTest:
        """Significance of orders under the noise that each has."""
        noise, scatter = self.noise_of_orders.near(chosen)
        own = None if scatter is None else scatter[list(orders)]
        each = self.noise_of_orders.own_freedom
        return examine_orders(self.sums, chosen, orders, noise.among(orders), own, each)

    def _forward(self) -> list[int]:
        noise = self.noise_of_orders
        if noise.kind == "hac":
            return self._taken(noise.near(())[0])
        common = self.noise(())
        chosen = self._taken(None if common.source == "model" else noise.white(common))
        near, _ = noise.near(chosen)
        if near.white > LEAST_BELIEF:
            return chosen
        # Where there is less noise than on average weaker orders stand out.
        return [*chosen, *(i for i in self._taken(near) if i not in chosen)]

    def _taken(self, noise: NoiseSpectrum | None) -> list[int]:
        free, barred = self.noise_of_orders.free, self.noise_of_orders.barred
        return choose_forward(self.sums, self.limits, free, noise, self.forced, barred)

    def _backward(self, chosen: list[int]) -> tuple[list[int], dict[int, str]]:
        """Drop, worst first, what does not stand beside the others."""
        dropped: dict[int, str] = {}
        while True:
            mine = [i for i in chosen if i not in self.forced]
            if not mine:
                return chosen, dropped
            test = self.examined(chosen, mine)
            verdict, failing = "noise", test.log_p - self.limits[mine]
            if not (failing > 0.0).any():
                verdict, failing = "no held-out gain", -self._gains(chosen, mine)
            if not (failing >= 0.0).any():
                amplitude = np.hypot(test.cosine, test.sine)
                share = amplitude / math.sqrt(float((amplitude**2).sum()))
                scatter_of_one = self.noise(chosen).standard_deviation
                small = (share < NEGLIGIBLE_SHARE) & (amplitude < NEGLIGIBLE_NOISE * scatter_of_one)
                small |= amplitude < _ROUNDING * self.period
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
            cosine, sine = fit_chosen_orders(self.sums, kept)[0].reshape(2, -1)
            # What is fitted jointly and never retained makes no correction steep.
            mine = [n for n, i in enumerate(kept) if i not in self.forced]
            cosine, sine = cosine[mine], sine[mine]
            orders = self.orders_of([kept[n] for n in mine])
            if not mine or greatest_slope(orders, cosine, sine, self.period) < STEEPEST:
                return gone
            price = np.asarray(orders) / np.maximum(np.hypot(cosine, sine), 1e-300)
            worst = mine[int(np.argmax(price))]
            gone.append(kept.pop(worst))

    def orders_of(self, chosen: Sequence[int]) -> list[float]:
        """The orders at these places."""
        return [self.orders[i] for i in chosen]

    def _gains(self, chosen: Sequence[int], orders: Sequence[int]) -> Array:
        """Part by which each order lowers the held-out mean square."""
        return self.gains_and_model(chosen, orders)[0]

    def gains_and_model(self, chosen: Sequence[int], orders: Sequence[int]) -> tuple[Array, float]:
        """The gains, and the held-out sum of squares of the chosen orders."""
        if self.folds is None:
            return np.full(len(orders), math.nan), math.nan
        without, with_, model = held_out_gains(self.folds, chosen, orders)
        return np.asarray((without - with_) / np.maximum(np.abs(without), 1e-300)), model
