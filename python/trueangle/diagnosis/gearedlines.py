"""The lines of geared shafts in readings, at any ratio.

With orders ``m_k(r)`` and the sums of each run
``Z_jk(r) = Σ_t y_t exp(-i m_k(r) θ_t)``,

::

    S(r) = [Σ_k Σ_j min(4 |Z_jk(r)|² / n_j, n_j |a_k|²)] / [Σ_k Σ_j n_j |a_k|²]

is about 1 at the right ratio and 0 elsewhere. Phases are free, as a ratio that is no whole
number gives each run its own.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from ..effects.search import golden_maximum
from ..estimation.linear import least_squares, linear_residual
from ..joint.pattern import Harmonic, Pattern, line_columns
from ..joint.signals import Signals
from ..simulation.simulation import Simulation
from ..support.arrays import Array

#: Trials of a ratio per resolution cell.
OVERSAMPLING = 4.0

#: Standard errors to either side of a ratio by runs alone within which their phases agree.
NEAR = 4.0

#: Trials of that search at most, to either side.
MOST_TRIALS = 100

#: Golden sections of the last search: a thousandth of a thousandth of a resolution cell.
REFINEMENTS = 30

#: Variances of the noise that a plain ratio may explain less: three standard errors.
PLAIN = 9.0

#: Standard deviations of a chi-square from which on runs have phases of their own.
STEADY = 4.0

#: Readings used at most for the search, of the first runs.
MOST_READINGS = 6_000


@dataclass(frozen=True)
class GearedLinesRatio:
    """A gear ratio that the readings show in place of the assumed one.

    Attributes
    ----------
    gear_ratio, std : float
    believed : float
    found, left : float
        Share of the assumed power of the geared lines at this ratio, and at the assumed.
    simulation : Simulation
        The simulation with this ratio.
    alike : tuple of float
        Other ratios that explain as much, as at even steps.
    """

    gear_ratio: float
    std: float
    believed: float
    found: float
    left: float
    simulation: Simulation
    alike: tuple[float, ...] = ()


@dataclass(frozen=True)
class GearedLines:
    """Lines that a simulation claims of geared shafts, and readings of the first runs.

    Attributes
    ----------
    sim : Simulation
    lines : tuple of Harmonic
    y, theta : ndarray
        Error without the lines of the output and the runs' zeros, arcsec; angle, rad.
    bounds : tuple of (int, int)
        First reading of each run, and the one beyond its last.
    """

    sim: Simulation
    lines: tuple[Harmonic, ...]
    y: Array
    theta: Array
    bounds: tuple[tuple[int, int], ...]

    @classmethod
    def of(cls, sim: Simulation, signals: Signals, error: Array) -> GearedLines | None:
        """None where nothing is claimed that turns with a ratio."""
        claimed = [x for x in sim.harmonics if x.shaft != "output" and x.amplitude_arcsec]
        if not claimed or sim.joint.gear_ratio == 1.0:
            return None
        bounds = []
        for start, stop in signals.run_bounds():
            if start >= MOST_READINGS:
                break
            bounds.append((start, min(stop, start + MOST_READINGS)))
        size = bounds[-1][1]
        theta = signals.theta[:size]
        output = [line for line in sim.harmonics if line.shaft == "output"]
        y = error[:size] - Pattern.of(output, sim.joint).value(theta)
        for start, stop in bounds:
            y[start:stop] -= np.median(y[start:stop])
        return cls(sim, tuple(claimed), y, theta, tuple(bounds))

    @property
    def turns(self) -> float:
        """Median of the turns of the runs."""
        travels = [np.ptp(self.theta[start:stop]) for start, stop in self.bounds]
        return max(float(np.median(travels)) / (2.0 * np.pi), 0.05)

    @property
    def step(self) -> float:
        """Step of ratios that the travel of a run separates several times over."""
        top = max(float(line.order) for line in self.lines)
        return 1.0 / (OVERSAMPLING * self.turns * top)

    def orders(self, ratio: float) -> list[float]:
        """Cycles of the lines per output turn at a ratio."""
        joint = replace(self.sim.joint, gear_ratio=ratio)
        return [joint.output_order(line.shaft, line.order) for line in self.lines]

    def share(self, ratio: float) -> float:
        """Share of the assumed power that the lines have at a ratio."""
        starts = np.array([start for start, _ in self.bounds])
        sizes = np.array([stop - start for start, stop in self.bounds], dtype=np.float64)
        total = wanted = 0.0
        for line, order in zip(self.lines, self.orders(ratio), strict=True):
            z = np.add.reduceat(self.y * np.exp(-1j * order * self.theta), starts)
            believed = line.amplitude_arcsec**2
            power = 4.0 * np.abs(z) ** 2 / sizes
            # More than is assumed counts as much as is assumed.
            total += float(np.minimum(power, sizes * believed).sum())
            wanted += float(sizes.sum()) * believed
        return total / wanted

    def shares(self, ratio: float) -> Array:
        """`share` of each line, fitted jointly to each run: over few turns a sum holds others."""
        lines = [line_columns(self.theta, order) for order in self.orders(ratio)]
        columns = self._centred(np.hstack(lines))
        found = np.zeros(len(lines))
        for start, stop in self.bounds:
            fit = least_squares(columns[start:stop], self._error[start:stop])
            power = fit[0::2] ** 2 + fit[1::2] ** 2
            found += (stop - start) * np.minimum(power / self._believed, 1.0)
        return found / self.y.size

    def together(self, ratio: float) -> float:
        """`share` of all lines fitted jointly."""
        return float(self.shares(ratio) @ self._believed / self._believed.sum())

    def out_of_step(self, common: bool) -> float:
        """How far the lines fall out of step, in standard errors, at the assumed ratio."""
        departure, std = self._departure(self.sim.joint.gear_ratio, common)
        return departure / std if std else 0.0

    def _departure(self, ratio: float, common: bool) -> tuple[float, float]:
        """By how much a ratio seems to be wrong, from its column, and the standard error.

        With ``a_k cos + b_k sin`` fitted to each run, or to all of them, a ratio that is
        wrong by ``δr`` leaves

        ::

            δr θ Σ_k k (b_k cos m_kθ - a_k sin m_kθ)
        """
        cycles = np.array([float(line.order) for line in self.lines])
        lines = np.hstack([line_columns(self.theta, order) for order in self.orders(ratio)])
        beside, error = self._centred(lines), self._error
        angle = self.theta if common else self._centred(self.theta)
        rest, moved = np.empty_like(error), np.empty_like(error)
        freedom = self.y.size - len(self.bounds)
        parts = [slice(*bounds) for bounds in self._parts(common)]
        for part in parts:
            fit, _, rank, _ = np.linalg.lstsq(beside[part], error[part], rcond=None)
            freedom -= int(rank)
            rest[part] = error[part] - beside[part] @ fit
            a, b = cycles * fit[0::2], cycles * fit[1::2]
            moved[part] = lines[part, 0::2] @ b - lines[part, 1::2] @ a
        column = self._centred(angle * moved)
        for part in parts:
            column[part] = linear_residual(beside[part], column[part])
        power = float(column @ column)
        if power == 0.0 or freedom <= 0:
            return 0.0, 0.0
        return float(column @ rest) / power, float(np.sqrt(rest @ rest / freedom / power))

    def refined(self, ratio: float, common: bool, width: float | None = None) -> float:
        """The ratio within a width of a trial that explains most.

        By all lines together: over few turns the sum of one line holds a part of its neighbours.
        """
        width = 2.0 * self.step if width is None else width
        best, left = golden_maximum(
            lambda trial: -self.left(trial, common), ratio - width, ratio + width, REFINEMENTS
        )
        # Ratios are made of teeth: a whole or half number that explains as much is meant.
        limit = -left * (1.0 + PLAIN / max(self.y.size, 1))
        for denominator in gear_denominators():
            plain = round(best * denominator) / denominator
            if abs(plain - best) < width and self.left(plain, common) < limit:
                return plain
        return float(best)

    def in_phase(self, ratio: float, std: float) -> float:
        """The ratio near one known to ``std`` with which all runs have one phase, if they do."""
        top = max(float(line.order) for line in self.lines)
        step = 2.0 * np.pi / (OVERSAMPLING * float(np.ptp(self.theta)) * top)
        count = int(np.clip(NEAR * std / step, 1, MOST_TRIALS))
        trials = ratio + step * np.arange(-count, count + 1)
        best = min(trials.tolist(), key=lambda trial: self.left(trial, common=True))
        return self.refined(best, common=True, width=step)

    def left(self, ratio: float, common: bool) -> float:
        """Residual sum of squares of the lines with one phase for all runs, or one for each."""
        columns = np.hstack([line_columns(self.theta, m) for m in sorted(set(self.orders(ratio)))])
        known, error = self._centred(columns), self._error
        left = 0.0
        for start, stop in self._parts(common):
            rest = linear_residual(known[start:stop], error[start:stop])
            left += float(rest @ rest)
        return left

    def keeps_phase(self, ratio: float) -> bool:
        """Whether separate phases of each run explain only noise, beyond one for all."""
        apart = self.left(ratio, common=False)
        more = self.left(ratio, common=True) / max(apart, 1e-300) - 1.0
        extra = 2.0 * len(self.lines) * (len(self.bounds) - 1)
        return bool(self.y.size * more < extra + STEADY * np.sqrt(2.0 * extra))

    def at(self, ratio: float, common: bool) -> GearedLinesRatio:
        """What is known about a ratio, by phases common to all runs or not."""
        believed = self.sim.joint.gear_ratio
        sim = replace(self.sim, joint=replace(self.sim.joint, gear_ratio=ratio))
        _, std = self._departure(ratio, common)
        return GearedLinesRatio(
            ratio, std, believed, self.together(ratio), self.together(believed), sim
        )

    def _parts(self, common: bool) -> tuple[tuple[int, int], ...]:
        return ((0, self.y.size),) if common else self.bounds

    @property
    def _believed(self) -> Array:
        return np.array([line.amplitude_arcsec**2 for line in self.lines])

    @cached_property
    def _error(self) -> Array:
        return self._centred(self.y)

    def _centred(self, values: Array) -> Array:
        """Values less their mean in each run."""
        starts = [start for start, _ in self.bounds]
        sizes = np.array([stop - start for start, stop in self.bounds])
        means = np.add.reduceat(values, starts, axis=0).T / sizes
        return np.asarray(values - np.repeat(means, sizes, axis=-1).T)


def gear_denominators() -> Iterator[int]:
    """Of ratios as gears have them."""
    yield from (1, 2, 3, 4, 5, 10)
