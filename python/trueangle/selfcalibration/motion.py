"""Patterns jointly with a smooth motion, and the motion's stiffness.

The motion of each segment is a cubic spline in time under a prior: smooth trends are free, and
the acceleration drifts about them with a correlation time. The stiffness (the ratio of noise to
that drift), the correlation time and the knot spacing maximise the evidence, that is the
likelihood with motion and patterns integrated out.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..estimation.factor import BandedFactor
from ..support.arrays import Array
from .projected import Projected, Unknown, combinations
from .splines import (
    DriftPenalty,
    Knots,
    MotionSums,
    banded_product,
    coarser_bands,
    coarser_rows,
    finer_coefficients,
    smooth_trends,
)

#: Stiffness looked at, as a power of ten relative to the readings per knot.
_STIFFEST, _SOFTEST = 7.0, -5.0

#: The search ends after a few grids in a row that raise the evidence by less (log likelihood).
_WORTH = 1.0

#: A combination of common columns of which motion leaves less is the motion's own.
_GONE = 1e-13


@dataclass(frozen=True)
class MotionFit:
    """Motion and common columns at one knot spacing and stiffness."""

    level: int
    """Halvings from the finest grid."""
    stiffness: float
    memory: float
    """Of the acceleration, in seconds."""
    coefficients: Array
    """On the finest grid."""
    unknowns: Array
    projected: Projected
    evidence: float
    """Restricted log likelihood, comparable between grids and stiffnesses."""
    knots: Knots
    readings: float

    @property
    def roughness(self) -> float:
        """Spectral density of the drift: variance of the third differences by spacing^5."""
        return self.projected.variance / (self.stiffness * self.knots.spacing**5)

    @property
    def fastest(self) -> float:
        """Frequency (Hz) from which on motion takes less than a tenth of the noise.

        Of a wave a smoothing spline takes ``1 / (1 + λ (ωh)^6 / n)``, with n readings to a knot,
        until knots are too far apart for it.
        """
        intervals = sum(self.knots.intervals)
        weight = self.readings / max(intervals, 1) / self.stiffness
        turned = math.pow(10.0 * weight, 1.0 / 6.0) / self.knots.spacing
        # Waves of a log that its smooth trends and lines take.
        slowest = 4.0 / (intervals * self.knots.spacing)
        return max(min(turned / (2.0 * math.pi), 0.5 / self.knots.spacing), slowest)


class _Grid:
    """The sums on one grid, with the motion so far in terms of it.

    Smooth trends of each segment, such as coasting down, are not penalised by the prior: columns
    whose third differences are Legendre polynomials join the common ones.
    """

    def __init__(
        self, sums: MotionSums, right: Array, chain: list[NDArray[np.int64]], trends: Sequence[int]
    ) -> None:
        self.sums = sums
        self.right = right  # S^T (e + S c)
        self.chain = chain  # parents from the finest grid down to this one
        self.drift = DriftPenalty(sums.knots)
        self.trend = smooth_trends(sums.knots, trends)
        moved = (
            np.stack([banded_product(sums.bands, z) for z in self.trend.T], axis=1)
            if (self.trend.shape[1])
            else np.zeros((sums.knots.size, 0))
        )
        self.cross = np.concatenate([sums.cross, moved], axis=1)
        low = self.trend.T @ sums.cross
        self.common = np.block([[sums.common, low.T], [low, self.trend.T @ moved]])

    def finest(self, grids: Sequence[_Grid], spline: Array) -> Array:
        """The spline on the finest grid."""
        for level in range(len(self.chain) - 1, -1, -1):
            spline = finer_coefficients(self.chain[level], grids[level].sums.knots.size, spline)
        return spline

    def coarsened(self, fine: Array) -> Array:
        """Sums with the finest splines as sums with these."""
        for parents in self.chain:
            fine = coarser_rows(parents, fine)
        return fine


class MotionSearch:
    """Fits of motion and common columns to the sums over readings, on any coarser grid.

    The ``sums`` (with ``e = reading - motion``) and the coefficients of the ``motion`` so far are
    on the finest grid, ``columns`` names the common columns, and ``trends`` are smooth trends that
    each segment is free to follow.

    Notes
    -----
    Coarser grids need no second look at the readings: twice the spacing is a linear
    combination of the finer splines.
    """

    def __init__(
        self, sums: MotionSums, motion: Array, columns: Sequence[Unknown], trends: Sequence[int]
    ) -> None:
        self.sums, self.motion, self.columns = sums, motion, tuple(columns)
        self.trends = tuple(trends)
        self.memory = max(sums.knots.intervals) * sums.knots.spacing
        right = sums.spline_right + banded_product(sums.bands, motion)
        self.grids = [_Grid(sums, right, [], trends)]

    def grid(self, level: int) -> _Grid | None:
        """The grid of ``2**level`` times the spacing, None where it would be too coarse."""
        while len(self.grids) <= level:
            last = self.grids[-1]
            knots = last.sums.knots
            if min(knots.intervals) < 8 or any(n % 2 for n in knots.intervals):
                return None
            parents, coarse = knots.parents(), knots.coarser
            sums = last.sums._replace(
                knots=coarse,
                bands=coarser_bands(parents, last.sums.bands, coarse),
                cross=coarser_rows(parents, last.sums.cross),
                spline_right=coarser_rows(parents, last.sums.spline_right),
            )
            right = coarser_rows(parents, last.right)
            self.grids.append(_Grid(sums, right, [*last.chain, parents], self.trends))
        return self.grids[level]

    def best(self, shortest: float = 0.0, near: MotionFit | None = None) -> MotionFit:
        """Stiffness and grid of the greatest evidence, from coarse to fine.

        After a fit ``near`` it, only the coarsest grid and its neighbours are looked at.
        Knots closer than ``shortest`` seconds are not looked at; where all are, the
        stiffest motion on the coarsest grid is taken.
        """
        level = 0
        while (coarser := self.grid(level + 1)) is not None:
            # Coarser than this, trends and splines would be the same thing.
            intervals = coarser.sums.knots.intervals
            if any(n < 2 * t + 4 for n, t in zip(intervals, self.trends, strict=True)):
                break
            level += 1
        coarsest = self.grids[level].sums.knots
        if coarsest.spacing < shortest:
            per_knot = self.sums.weighty / sum(coarsest.intervals)
            return self.fit(level, per_knot * 10.0**_STIFFEST, self.memory)
        best: MotionFit | None = None
        behind, roughest = 0, math.inf
        for here in range(level, -1, -1):
            spacing = self.grids[here].sums.knots.spacing
            if spacing < shortest:
                break
            if near is not None and near.level + 1 < here < level:
                continue
            found, possible = self._stiffness(here, roughest, self.memory)
            if here == level:
                # Close knots may show a rougher drift than distant ones by this factor at most
                # (drift with a correlation time): coloured noise would need more, and is not
                # motion.
                roughest = possible * 100.0
            worth = best is None or found.evidence > best.evidence + _WORTH
            behind = 0 if worth else behind + 1
            if best is None or found.evidence > best.evidence:
                best = found
            if behind == 2:
                break
        assert best is not None
        # Correlation times of the acceleration that are tried, as shares of the longest segment.
        for share in (0.1, 0.01):
            if share * self.memory < best.knots.spacing:
                break
            found, _ = self._stiffness(best.level, roughest, share * self.memory)
            if found.evidence > best.evidence + _WORTH:
                best = found
        return best

    def _stiffness(self, level: int, roughest: float, memory: float) -> tuple[MotionFit, float]:
        """Best stiffness by golden section, and the greatest roughness still possible."""
        grid = self.grid(level)
        assert grid is not None
        per_knot = self.sums.weighty / max(1, sum(grid.sums.knots.intervals))
        tried: dict[float, MotionFit] = {}

        def at(power: float) -> float:
            if power not in tried:
                tried[power] = self.fit(level, per_knot * 10.0**power, memory)
            found = tried[power]
            return found.evidence if found.roughness <= roughest else -math.inf

        powers = [float(p) for p in np.linspace(_SOFTEST, _STIFFEST, 7)]
        k = int(np.argmax([at(p) for p in powers]))
        low, high = powers[max(k - 1, 0)], powers[min(k + 1, 6)]
        ratio = 0.5 * (math.sqrt(5.0) - 1.0)
        a, b = high - ratio * (high - low), low + ratio * (high - low)
        # Stiffness is found to this power of ten: standard errors change by less than 1 %.
        while high - low > 0.2:
            if at(a) > at(b):
                high, b = b, a
                a = high - ratio * (high - low)
            else:
                low, a = a, b
                b = low + ratio * (high - low)
        best = tried[max(tried, key=at)]
        # Stiffnesses of evidence within this of the best are still possible (log likelihood).
        possible = [f.roughness for f in tried.values() if f.evidence > best.evidence - 4.0]
        return best, max(possible)

    def fit(self, level: int, stiffness: float, memory: float) -> MotionFit:
        """Motion and columns at one grid and stiffness."""
        grid, sums, motion = self.grid(level), self.sums, self.motion
        assert grid is not None
        m = len(self.columns)
        try:
            factor = BandedFactor(grid.sums.bands + grid.drift.bands(stiffness, memory))
        except np.linalg.LinAlgError:  # stiffer than the working precision can hold
            return MotionFit(
                level,
                stiffness,
                memory,
                motion,
                np.zeros(m),
                _nothing(self.columns),
                -math.inf,
                grid.sums.knots,
                sums.weighty,
            )
        eliminated = factor.solve(grid.cross)
        information = grid.common - grid.cross.T @ eliminated
        information = 0.5 * (information + information.T)
        scale, values, vectors, _ = combinations(information, np.diagonal(grid.common), _GONE)
        half = scale[:, None] * vectors / np.sqrt(values)

        def step(spline_right: Array, common_right: Array) -> tuple[Array, Array]:
            first = factor.solve(spline_right)
            found = half @ (half.T @ (common_right - grid.cross.T @ first))
            return first - eliminated @ found, found

        def common(left: Array, gap: Array) -> Array:
            # Right side of the common columns from e + S gap, the trends by their splines.
            fine = sums.spline_right + banded_product(sums.bands, gap)
            trend = grid.trend.T @ grid.coarsened(fine)
            return np.concatenate([left + sums.cross.T @ gap, trend])

        spline, unknowns = step(grid.right, common(sums.common_right, motion))
        # A second step works on what the first has left, free of the rounding of large angles.
        for again in (True, False):
            fine = grid.finest(self.grids, spline + grid.trend @ unknowns[m:])
            gap = motion - fine
            if again:
                left = (
                    sums.spline_right + banded_product(sums.bands, gap) - sums.cross @ unknowns[:m]
                )
                pull = stiffness * grid.drift.pull(spline, memory)
                rest = common(sums.common_right - sums.common @ unknowns[:m], gap)
                rest[m:] -= grid.trend.T @ grid.coarsened(sums.cross @ unknowns[:m])
                more, extra = step(grid.coarsened(left) - pull, rest)
                spline, unknowns = spline + more, unknowns + extra
        found = unknowns[:m]
        squares = (
            sums.squares
            + 2.0 * float(gap @ sums.spline_right)
            + float(gap @ banded_product(sums.bands, gap))
            - 2.0 * float(found @ (sums.common_right + sums.cross.T @ gap))
            + float(found @ sums.common @ found)
        )
        penalised = max(squares, 1e-300) + stiffness * grid.drift.energy(spline, memory)
        fixed = 2 * len(grid.sums.knots.intervals) + values.size
        freedom = max(sums.weighty - fixed, 1.0)
        twice = (
            freedom * math.log(penalised / freedom)
            + factor.log_determinant
            + float(np.log(values).sum())
            - 2.0 * float(np.log(scale).sum())
            - grid.drift.log_determinant(stiffness, memory)
        )
        projected = Projected(
            self.columns,
            _without(information, np.diagonal(grid.common), m),
            np.zeros(m),
            np.diagonal(sums.common).copy(),
            penalised / freedom,
            freedom,
        )
        evidence, knots = -0.5 * twice, grid.sums.knots
        return MotionFit(
            level, stiffness, memory, fine, found, projected, evidence, knots, sums.weighty
        )


def _without(information: Array, alone: Array, m: int) -> Array:
    """Information of the first ``m`` columns with the further ones eliminated."""
    if m == len(information):
        return information
    scale, values, vectors, _ = combinations(information[m:, m:], alone[m:], _GONE)
    moved = information[:m, m:] @ (scale[:, None] * vectors / np.sqrt(values))
    return np.asarray(information[:m, :m] - moved @ moved.T)


def _nothing(columns: Sequence[Unknown]) -> Projected:
    m = len(columns)
    zero = np.zeros((m, m))
    return Projected(tuple(columns), zero, np.zeros(m), np.ones(m), math.inf, 1.0)
