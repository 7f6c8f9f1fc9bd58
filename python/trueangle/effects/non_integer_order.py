"""A line of free order with a new phase in every run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar, Self

import numpy as np

from ..estimation.extension import Extension
from ..estimation.quantity import quantity
from ..estimation.regression import Regression
from ..joint.lattice import aliases_of
from ..joint.pattern import JointPattern, line_columns, lines_columns
from ..joint.signals import Signals
from ..support.deadline import current_deadline
from .ambiguity import Ambiguity
from .drawing import Drawing
from .drift_within_run import DriftWithinRun
from .effect import ALWAYS, Effect, Reported, Spots
from .missing_order import HIGHEST, MissingOrder
from .orderspectrum import OrderSpectrum
from .randomphase import RandomPhaseLine
from .search import Array, Fitted, grid_ambiguity, known_orders

#: Trial orders per resolution cell (one order over the turns of a run).
OVERSAMPLING = 3

#: Lowest order searched, and cycles that a run must show: fewer are a slow curve, not a line.
LOWEST, LEAST_CYCLES = 0.3, 2.0

#: Trial orders at most; beyond, the grid stops at a lower order.
MOST_TRIALS = 4096

#: Orders nearer than this to a known line belong to that line: it changes from run to run.
OWN_LINE = 0.1

#: Cycles over the travel within which orders are hardly separated: a line between two whole ones
#: is a mixture of both there.
UNRESOLVED = 1.0

#: Orders per turn of a shaft at which the cage of its bearing goes round: half of 1 less
#: the ratio of ball to pitch diameter. Expected there, they pay less for the search.
CAGE = (0.35, 0.48)

#: Golden sections of a search about the best of them.
SECTIONS = 10

#: Peaks of the quick search that are scored exactly.
PEAKS = 4


@dataclass(frozen=True)
class NonIntegerOrder(Effect):
    """A line whose phase is new in every run: ``C sin(fθ + φ_j)``.

    Parameters
    ----------
    order : float
        Cycles per output turn, not a whole number.
    amplitude_arcsec : float
    """

    order: float
    amplitude_arcsec: float

    kind: ClassVar[str] = "non_integer_order"
    title: ClassVar[str] = "line of no shaft"
    size_name: ClassVar[str] = "amplitude_arcsec"
    sentence: ClassVar[str] = (
        "A bearing's cage or balls roll with slip: a line at an order that is not whole, with "
        "another phase in every run."
    )
    factor: ClassVar[str] = "run"
    form_of: ClassVar[tuple[str, ...]] = ("run_place",)
    measure: ClassVar[str] = "several turns in one record, and several records, at free angles"
    transfers: ClassVar[bool] = False
    confused_with: ClassVar[Mapping[type[Effect], str]] = {
        MissingOrder: "several turns in each run, and several runs",
        DriftWithinRun: "several turns in each run",
    }
    located: ClassVar[bool] = True
    flexible_below: ClassVar[float] = ALWAYS
    not_at_run_time: ClassVar[str] = "its phase is new in every run; average over runs"

    def signal(self, signals: Signals, around: JointPattern, rng: np.random.Generator) -> Array:
        phase = rng.uniform(0.0, 2.0 * np.pi, signals.runs)[signals.run]
        return np.asarray(self.amplitude_arcsec * np.sin(self.order * signals.theta + phase))

    @classmethod
    def drawn(cls, size: float, of: Drawing) -> Self | None:
        return cls(float(of.whole(5, 40)) + of.between(0.3, 0.7), size)

    @classmethod
    def propose(cls, regression: Regression) -> Extension | None:
        if regression.has(cls.kind):
            return None
        orders, power = cls._search(regression)
        if orders.size == 0:
            return None
        best: Extension | None = None
        step = orders[1] - orders[0]
        penalty = cls._log_grid(regression, orders)
        net = power - 2.0 * penalty
        top = int(np.argmax(net))
        if regression.is_dominated(float(power[top]), 1, float(penalty[top])):
            return None
        peaks = np.flatnonzero((net[1:-1] >= net[:-2]) & (net[1:-1] >= net[2:])) + 1
        for k in peaks[np.argsort(net[peaks])[::-1][:PEAKS]]:
            if current_deadline().over:
                return best
            extension = cls._at(regression, float(orders[k]), float(penalty[k]))
            if best is None or extension.bic_gain > best.bic_gain:
                best = extension
        if best is None or best.bic_gain < 0.0:
            return best
        if regression.is_dominated(best.deviance, 1, best.log_grid):
            return best
        middle, log_grid = best.shape["order"], best.log_grid
        theta, low, high = regression.signals.theta, middle - step, middle + step
        order, _ = regression.drawn_line(theta, low, high, SECTIONS)
        best = max(best, cls._at(regression, order, log_grid), key=lambda p: p.deviance)
        near = np.abs(regression.around.pattern.orders - best.shape["order"])
        if near.min(initial=1.0) < OWN_LINE or cls._keeps_phase(regression, best):
            return None
        return best

    @staticmethod
    def _keeps_phase(regression: Regression, found: Extension) -> bool:
        """The searched orders about it, where the travel does not resolve them, explain as much.

        Phases that are new in each of R runs leave a share of 1/R to one phase for all; half way
        between that and 1 is the limit.
        """
        away = regression.lines.orders - found.shape["order"]
        sides = (away[away <= 0.0].max(initial=-np.inf), away[away > 0.0].min(initial=np.inf))
        turns = regression.signals.run_turns().max()
        alike = [found.shape["order"] + x for x in sides if abs(x) * turns < UNRESOLVED]
        if not alike:
            return False
        share = 0.5 + 0.5 / regression.signals.runs
        gain, _ = regression.gain(lines_columns(regression.signals.theta, np.array(alike)))
        return gain > share * found.deviance

    @staticmethod
    def _log_grid(regression: Regression, orders: Array) -> Array:
        """Logarithm of the independent orders searched: those of cages, or of all."""
        cages = np.zeros(orders.size, dtype=bool)
        for cycles in regression.around.joint.shafts.values():
            cages |= (orders > CAGE[0] * cycles) & (orders < CAGE[1] * cycles)
        # Half of the prior goes to either; the maximum over an order is like that of two
        # independent ones.
        counts = 4.0 * np.where(cages, cages.sum(), orders.size) / OVERSAMPLING
        return np.asarray(np.log(np.maximum(counts, 2.0)))

    @classmethod
    def _at(cls, regression: Regression, order: float, log_grid: float) -> Extension:
        return regression.propose_run_effect(
            cls.kind, {"order": order}, line_columns(regression.signals.theta, order), log_grid
        )

    @classmethod
    def _search(cls, regression: Regression) -> tuple[Array, Array]:
        """Trial orders and the deviance of a run effect there, without cross terms."""
        theta = regression.signals.theta
        starts = np.array([start for start, _ in regression.bounds])
        sizes = np.array([stop - start for start, stop in regression.bounds], dtype=np.float64)
        turns = regression.signals.run_turns()
        usual = float(np.median(turns))
        if sizes.min() < 8 or usual <= 0.0:  # most runs are at rest
            return np.zeros(0), np.zeros(0)
        top = float(regression.lines.orders.max()) * 0.75
        # At equal steps higher orders are the same numbers: the lowest is meant. But where the
        # gear's own lines look like low ones it may be one of those, in doubt (`grid_ambiguity`).
        rate, grid = regression.signals.even_rate, regression.signals.grid
        known = max(known_orders(regression.belief), default=0.0)
        hides = grid is not None and 2.0 * known > grid.positions
        top = min(top, 0.5 * rate) if rate and not hides else top
        low = max(LOWEST, LEAST_CYCLES / usual)
        # A run shows orders up to half its mean rate of readings.
        step = 1.0 / (OVERSAMPLING * usual)
        count = int(min((top - low) / step, MOST_TRIALS))
        if count < 3:
            return np.zeros(0), np.zeros(0)
        orders = low + step * np.arange(count, dtype=np.float64)
        e = regression.left_within_runs
        e = np.where(regression.outlying, 0.0, e)
        spectrum: OrderSpectrum = regression.cache.of_motion(
            cls.kind,
            (low, step, count),
            lambda: OrderSpectrum(theta, starts.tolist(), low, step, count),
        )
        sums = spectrum.sums(e)
        # P: sum of the two squared normalised coefficients per run, 2 on average.
        p = (sums.real**2 + sums.imag**2) * (2.0 / (sizes * regression.variance))
        ratios = np.outer(sizes, np.geomspace(1e-3, 1e3, 13))
        saved = p @ (ratios / (2.0 + ratios)) - 2.0 * np.log1p(ratios / 2.0).sum(axis=0)
        best = np.maximum(saved.max(axis=1), 0.0)
        return orders, best

    @classmethod
    def doubt(cls, extension: Extension, regression: Regression, spots: Spots) -> Ambiguity | None:
        return grid_ambiguity(regression, spots) if extension.cause == cls.kind else None

    @classmethod
    def report(cls, regression: Regression, terms: Sequence[Fitted]) -> Reported:
        extension = terms[0][0]
        theta = regression.signals.theta
        waves = line_columns(theta, extension.shape["order"])
        line = RandomPhaseLine(regression, cls.kind, waves)
        amplitude, amplitude_std = line.amplitude()
        order_std = line.place_std(theta)
        parameters = {
            "order": quantity(extension.shape["order"], order_std),
            "amplitude_arcsec": quantity(amplitude, amplitude_std),
        }
        rate = regression.signals.even_rate
        if rate:
            most = max(HIGHEST, float(regression.lines.orders.max()))
            alike = [m for m in aliases_of(extension.shape["order"], rate, 3) if m <= most]
            parameters |= {"aliases": quantity(alike)} if alike else {}
        known = regression.around.joint.bearing_lines(extension.shape["order"])
        if known:
            parameters["explanations"] = quantity(known)
        return parameters, [NonIntegerOrder(extension.shape["order"], amplitude)]

    @classmethod
    def blind_spots(cls, regression: Regression, found: Sequence[Ambiguity]) -> Iterator[Ambiguity]:
        if regression.signals.runs < 2:
            yield cls.blind("one run: a phase cannot change", MissingOrder)
