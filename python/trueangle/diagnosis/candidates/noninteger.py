"""A line of free order with a new phase in every run."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from ...joint.pattern import Surroundings, line_columns
from ...joint.signals import Signals
from ...regression.regression import Extension, Regression
from ...simulation.effects import Effect
from ...simulation.effects.lines import NonIntegerOrder
from .candidate import Array, Candidate, Parameters, golden_maximum, quantity

__all__ = ["NonIntegerCandidate"]

#: Trial orders per resolution cell (one order over the turns of a run).
OVERSAMPLING = 3

#: Lowest order searched, and cycles that a run must show: fewer are a bend, not a line.
LOWEST, LEAST_CYCLES = 0.3, 2.0

#: Trial orders at most; beyond, the grid stops at a lower order.
MOST_TRIALS = 4096

#: Orders nearer than this to a known line belong to that line: it changes from run to run.
OWN_LINE = 0.1

#: Share of a resolution cell (one order over the turns of a run) within which orders are
#: hardly told apart.
UNRESOLVED = 0.5

#: Orders per turn of a shaft at which the cage of its bearing goes round: half of 1 less
#: the ratio of ball to pitch diameter. Expected there, they pay less for the search.
CAGE = (0.35, 0.48)

#: Peaks of the quick search that are scored exactly.
PEAKS = 4


class NonIntegerCandidate(Candidate):
    """Run effect: cosine and sine of an order that is searched.

    The quick search adds up the periodograms of the runs; the best peaks are then
    scored by the likelihood.
    """

    cause: ClassVar[str] = "non_integer_order"
    located: ClassVar[bool] = True

    def propose(self, regression: Regression) -> Extension | None:
        if regression.has(self.cause):
            return None
        orders, power = self._search(regression)
        if orders.size == 0:
            return None
        best: Extension | None = None
        step = orders[1] - orders[0]
        price = self._log_grid(regression, orders)
        worth = power - 2.0 * price
        peaks = np.flatnonzero((worth[1:-1] >= worth[:-2]) & (worth[1:-1] >= worth[2:])) + 1
        for k in peaks[np.argsort(worth[peaks])[::-1][:PEAKS]]:
            extension = self._at(regression, float(orders[k]), float(price[k]))
            if best is None or extension.bic_gain > best.bic_gain:
                best = extension
        if best is None or best.bic_gain < 0.0:
            return best
        middle, log_grid = best.shape["order"], best.log_grid
        order, _ = golden_maximum(
            lambda f: self._at(regression, f, log_grid).deviance, middle - step, middle + step, 10
        )
        best = max(best, self._at(regression, float(order), log_grid), key=lambda p: p.deviance)
        near = np.abs(regression.around.pattern.orders - best.shape["order"])
        if near.min(initial=1.0) < OWN_LINE or self._keeps_phase(regression, best):
            return None
        return best

    @staticmethod
    def _keeps_phase(regression: Regression, found: Extension) -> bool:
        """A searched order that the travel does not resolve from it explains as much.

        Phases that are new in each of R runs leave a share of 1/R to one phase for all.
        """
        orders = regression.lines.orders
        away = np.abs(orders - found.shape["order"])
        alike = orders[away * regression.signals.run_turns().max() < UNRESOLVED]
        share = 0.5 + 1.0 / regression.signals.runs
        return any(
            regression.gain(line_columns(regression.signals.theta, float(m)))[0]
            > share * found.deviance
            for m in alike
        )

    @staticmethod
    def _log_grid(regression: Regression, orders: Array) -> Array:
        """Logarithm of the independent orders searched: those of cages, or of all."""
        cages = np.zeros(orders.size, dtype=bool)
        for cycles in regression.around.joint.shafts.values():
            cages |= (orders > CAGE[0] * cycles) & (orders < CAGE[1] * cycles)
        # Half of the belief goes to either; the maximum over an order is like that of two
        # independent ones.
        counts = 4.0 * np.where(cages, cages.sum(), orders.size) / OVERSAMPLING
        return np.asarray(np.log(np.maximum(counts, 2.0)))

    def _at(self, regression: Regression, order: float, log_grid: float) -> Extension:
        return regression.propose_run_effect(
            self.cause, {"order": order}, line_columns(regression.signals.theta, order), log_grid
        )

    @staticmethod
    def _search(regression: Regression) -> tuple[Array, Array]:
        """Trial orders and the deviance of a run effect there, without cross terms."""
        theta = regression.signals.theta
        starts = np.array([start for start, _ in regression.bounds])
        sizes = np.array([stop - start for start, stop in regression.bounds], dtype=np.float64)
        turns = regression.signals.run_turns()
        if sizes.min() < 8 or turns.max() <= 0.0:
            return np.zeros(0), np.zeros(0)
        top = float(regression.lines.orders.max()) * 0.75
        low = max(LOWEST, LEAST_CYCLES / float(np.median(turns)))
        # Half the mean rate of readings is as far as a run can tell.
        step = 1.0 / (OVERSAMPLING * float(np.median(turns)))
        count = int(min((top - low) / step, MOST_TRIALS))
        if count < 3:
            return np.zeros(0), np.zeros(0)
        orders = low + step * np.arange(count, dtype=np.float64)
        e = regression.left - regression.whiten.run_part(regression.left)
        e = np.where(regression.wild, 0.0, e)
        turn = np.exp(-1j * step * theta).astype(np.complex64)
        wave = (e * np.exp(-1j * orders[0] * theta)).astype(np.complex64)
        power = np.empty((count, starts.size))
        for k in range(count):
            sums = np.add.reduceat(wave, starts)
            power[k] = sums.real**2 + sums.imag**2
            wave *= turn
        # P: sum of the two squared normalised coefficients per run, 2 on average.
        p = 2.0 * power / (sizes * regression.variance)
        best = np.zeros(count)
        for ratio in np.geomspace(1e-3, 1e3, 13):
            x = ratio * sizes
            deviance = (p * (x / (2.0 + x))).sum(axis=1) - 2.0 * np.log1p(x / 2.0).sum()
            best = np.maximum(best, deviance)
        return orders, best

    def columns(self, signals: Signals, around: Surroundings, shape: dict[str, Any]) -> Array:
        return np.zeros((len(signals), 0))

    def report(
        self, regression: Regression, terms: Sequence[tuple[Extension, Array, Array]]
    ) -> tuple[Parameters, list[Effect]]:
        extension = terms[0][0]
        assert extension.run_effect is not None
        runs = regression.signals.runs
        # Cosine and sine each of variance s^2: a mean square amplitude of 2 s^2.
        amplitude = float(np.sqrt(2.0 * extension.run_effect.ratio * regression.variance))
        noise = float(np.sqrt(2.0 * regression.variance / regression.n))
        turns = float(np.median(regression.signals.run_turns()))
        order_std = 0.780 * noise / np.sqrt(2.0) / max(amplitude, 1e-12) / turns
        parameters = {
            "order": quantity(extension.shape["order"], order_std),
            "amplitude_arcsec": quantity(
                amplitude, float(np.hypot(noise, amplitude / np.sqrt(4.0 * runs)))
            ),
        }
        return parameters, [NonIntegerOrder(extension.shape["order"], amplitude)]
