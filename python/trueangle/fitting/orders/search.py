"""The search for orders on sums of readings: forward, backward, and what is too steep.

Runs in memory and logs that were read once come here alike: all it needs are the normal
equations of each run (`HarmonicSums`).
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from ...model.validity import greatest_slope
from ...support.arrays import Array
from ..uncertainty import CovarianceKind
from .evidence import OrderTest, choose_forward, examine_orders, fit_chosen_orders, held_out_gains
from .harmonicsums import HarmonicSums
from .noise import NEIGHBOURS, ReadingVariance, neighbour_scatter, pooled_scatter, run_scatter

#: Chance, over the whole search, that noise alone makes any order significant. Half of
#: the 1 % promised: the rest covers what the noise estimate itself does not know.
FALSE_ALARM: Final = 0.005

#: Rounding of a sum.
_EPSILON = float(np.finfo(np.float64).eps)

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


class EvidenceSearch:
    """One search for orders.

    Parameters
    ----------
    sums : HarmonicSums
    limits : ndarray
        Log of the false-alarm chance that each order may use up.
    period : float
    free : int
        Readings less zeros.
    folds : HarmonicSums or None
        Units that are held out one by one; None where nothing can be.
    repeats : Noise or None
        Noise from readings at the same position.
    forced : sequence of int
        Orders that are in every model and never retained.
    covariance : {"auto", "white", "cluster", "hac"}
    rounding : float
        Variance of one reading by what a coarse sensor repeats at each position, of which no
        scatter tells.
    """

    def __init__(
        self,
        sums: HarmonicSums,
        limits: Array,
        period: float,
        free: int,
        folds: HarmonicSums | None,
        repeats: ReadingVariance | None = None,
        forced: Sequence[int] = (),
        covariance: CovarianceKind = "auto",
        rounding: float = 0.0,
    ) -> None:
        self.rounding = rounding
        self.sums, self.folds, self.repeats = sums, folds, repeats
        # Whole orders as whole numbers: results show and compare them.
        self.orders: list[float] = [int(m) if m == int(m) else m for m in sums.orders.tolist()]
        self.limits, self.period, self.free = limits, period, free
        self.forced, self.covariance = list(forced), covariance
        #: Orders too steep to be retained.
        self.barred: list[int] = []

    def search(self) -> tuple[list[int], dict[int, str]]:
        """Places of the orders that stand, and the verdict on each that was dropped."""
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
        return chosen, {i: verdict for i, verdict in dropped.items() if i not in chosen}

    def noise(self, chosen: Sequence[int]) -> ReadingVariance:
        """Repeats, or the residual of all candidates, or of the chosen orders.

        Real orders that may not be retained disturb the others as noise does: the residual
        of the chosen ones holds them.
        """
        if self.barred:
            dof = max(1, self.free - 2 * len(chosen))
            return ReadingVariance(fit_chosen_orders(self.sums, chosen)[2] / dof, dof, "model")
        repeats = self.repeats
        # Copies of the same readings repeat to the last digit, which says nothing of noise.
        known = repeats is not None and repeats.degrees_of_freedom >= _ENOUGH_DOF
        if repeats is not None and known and repeats.variance > 0.0:
            return repeats
        # Of readings without noise rounding is left, which sums of squares do not resolve.
        rounding = _EPSILON * self.sums.total()[2]
        everything = len(self.orders)
        if self.free - 2 * everything >= max(_ENOUGH_DOF, 2 * everything):
            _, _, squares = fit_chosen_orders(self.sums, range(everything))
            dof = self.free - 2 * everything
            return ReadingVariance(max(squares, rounding) / dof, dof, "residual")
        dof = max(1, self.free - 2 * len(chosen))
        squares = fit_chosen_orders(self.sums, chosen)[2]
        return ReadingVariance(max(squares, rounding) / dof, dof, "model")

    def _level(self, chosen: Sequence[int]) -> _Level:
        """Noise of the coefficients: common to all orders, and each order's own."""
        noise = self.noise(chosen)
        level = (noise.variance + self.rounding, float(noise.degrees_of_freedom))
        if self.covariance == "hac":
            near = neighbour_scatter(self.sums, chosen)
            return _Level(level, None if near is None else near + self.rounding, NEIGHBOURS)
        if self.sums.units < 2 or self.covariance == "white":
            return _Level(level, None, None)
        scatter = run_scatter(self.sums, chosen, range(len(self.orders))) + self.rounding
        return _Level(pooled_scatter(scatter, self.sums.units) or level, scatter, None)

    def examined(self, chosen: Sequence[int], orders: Sequence[int]) -> OrderTest:
        """Significance of orders under the noise that each has."""
        level = self._level(chosen)
        own = None if level.scatter is None else level.scatter[list(orders)]
        return examine_orders(self.sums, chosen, orders, level.noise, own, level.freedom)

    def _forward(self) -> list[int]:
        noise = self.noise(())
        known = None
        if noise.source != "model":
            known = (noise.variance + self.rounding, float(noise.degrees_of_freedom))
        return choose_forward(self.sums, self.limits, self.free, known, self.forced, self.barred)

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
