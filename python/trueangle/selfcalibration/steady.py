"""Patterns of an encoder from stretches of roughly steady motion, iterated to the true angle."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ..support.arrays import Array
from .motion import MotionFit
from .pattern import ENCODER, RIPPLE
from .projected import Projected, Unknown, harmonic_unknowns
from .readings import PER_KNOT, SegmentReadings
from .steps import GaussNewtonSteps

#: Readings that the first iterations look at: enough to come close.
_FIRST_LOOK: Final = 40_000

#: Intervals of the first grid; a finer one is laid where the evidence asks for it.
_INTERVALS: Final = 512

#: Steps of the pattern below this share of its standard error end the iteration.
_STILL: Final = 0.02
_ROUNDS: Final = 12
_SEARCHES: Final = 3

#: Turns between knots of a motion that leaves order 1 alone (to 1 %).
_TURNS_PER_KNOT: Final = 2.0

#: A residual beyond so many standard deviations (by the median) is an outlier.
_WILD: Final = 7.0


@dataclass(frozen=True)
class SteadyFit:
    """Pattern, ripple and motion that explain the readings together."""

    orders: tuple[float, ...]
    ripple_orders: tuple[float, ...]
    unknowns: Array
    """In radians, in the order of ``motion.projected.columns``."""
    motion: MotionFit
    readings: SegmentReadings
    residuals: Array
    """Of every reading in radians."""
    valid: NDArray[np.bool_]

    @property
    def projected(self) -> Projected:
        """The estimator's account of the columns, with the unknowns found."""
        base = self.motion.projected
        return replace(base, right=base.information @ self.unknowns)

    @property
    def pattern(self) -> Array:
        """Cosine and sine of each order in turn."""
        return self.unknowns[: 2 * len(self.orders)]


def fit_steady(
    readings: SegmentReadings,
    orders: Sequence[float],
    ripple: Sequence[float] = (),
    *,
    start: SteadyFit | None = None,
    groups: NDArray[np.int64] | None = None,
    thorough: bool = True,
    smooth: bool = False,
    like: MotionFit | None = None,
) -> SteadyFit:
    """Gauss-Newton on ``r = θ + ε(θ)``, ``θ = S c + ρ H b``.

    Parameters
    ----------
    readings : Readings
    orders, ripple : sequence of int
        Orders of the encoder, and those at which the speed may ripple:
        ``ρ = (ω_m / ω)²``.
    start : SteadyFit, optional
        Where to begin.
    groups : ndarray of int, optional
        0 or 1 for each reading: one pattern for each group, beside one motion.
    thorough : bool
        Look at all readings in the last iteration; else at some 40 000.
    smooth : bool
        Allow motion no knots that are closer than two turns.
    like : MotionFit, optional
        Motion of the knots and the stiffness of this one: no search, and outliers
        are those of ``start``.
    """
    orders, ripple = tuple(orders), tuple(ripple)
    sets = 1 if groups is None else 2
    names = tuple(f"{ENCODER}, part {i + 1}" for i in range(2)) if sets == 2 else (ENCODER,)
    columns: list[Unknown] = [c for name in names for c in harmonic_unknowns(name, orders)]
    columns += harmonic_unknowns(RIPPLE, ripple)
    columns += [Unknown(name, 0.0, "") for name in readings.extra_names]
    unknowns = np.zeros(len(columns))
    if start is not None:
        for source in (*names, RIPPLE):
            origin = RIPPLE if source == RIPPLE else ENCODER
            for column in harmonic_unknowns(source, ripple if source == RIPPLE else orders):
                twin = column._replace(source=origin)
                if twin in start.motion.projected.columns:
                    unknowns[columns.index(column)] = start.unknowns[
                        start.motion.projected.columns.index(twin)
                    ]
        tail = len(readings.extra_names)
        if tail:
            unknowns[-tail:] = start.unknowns[-tail:]
    near_to = start.motion if like is None and start is not None else like
    intervals = _INTERVALS if near_to is None else max(_INTERVALS, sum(near_to.knots.intervals))
    work = GaussNewtonSteps(readings, orders, ripple, groups, columns)
    stride = max(1, readings.size // _FIRST_LOOK)
    fit, valid = None, np.ones(readings.size, dtype=bool)
    if start is not None:
        valid = start.valid
    if like is not None:
        knots = readings.knots(intervals)
        level = round(math.log2(like.knots.spacing / knots.spacing))
        same, spline = replace(like, level=max(level, 0)), readings.first_spline(knots)
        for _ in range(_ROUNDS):
            fit, spline, unknowns, moved = work.step(knots, spline, unknowns, valid, stride, same)
            if moved < _STILL:
                break
        assert fit is not None
        left = work.residuals(knots, spline, unknowns)
        return SteadyFit(orders, ripple, unknowns, fit, readings, left, valid)
    # Knots so far apart that no order fits between them, until the true angles are known:
    # at wrong ones, what is left repeats every turn and would pass for motion.
    stiff = _TURNS_PER_KNOT / readings.mean_speed
    while True:
        knots = readings.knots(intervals)
        spline = readings.first_spline(knots)
        fit = None
        for _ in range(_ROUNDS):
            fit, spline, unknowns, moved = work.step(
                knots, spline, unknowns, valid, stride, fit, stiff
            )
            if moved < _STILL:
                break
        if smooth:
            break
        near = None
        for _ in range(_SEARCHES):
            fit, spline, unknowns, moved = work.step(
                knots, spline, unknowns, valid, stride, near=near
            )
            near = fit
            if moved < 1.0:
                break
        assert fit is not None
        if fit.level > 0 or 2 * sum(knots.intervals) * PER_KNOT > readings.size // stride:
            break
        intervals = 4 * sum(knots.intervals)
    assert fit is not None
    left = work.residuals(knots, spline, unknowns)
    spread = 1.4826 * float(np.median(np.abs(left)))
    valid = np.abs(left) <= _WILD * max(spread, 1e-12)
    last = 1 if thorough else stride
    like = fit if smooth or stride == 1 or last > 1 else None
    for _ in range(3):
        fit, spline, unknowns, moved = work.step(
            knots, spline, unknowns, valid, last, like, near=fit
        )
        like = fit
        if moved < _STILL or (stride > 1 and _settled(fit, orders)):
            break
    left = work.residuals(knots, spline, unknowns)
    return SteadyFit(orders, ripple, unknowns, fit, readings, left, valid)


def _settled(fit: MotionFit, orders: Sequence[float]) -> bool:
    """Whether a further step would be small: it is of second order, ``k δ²``."""
    step = float(np.linalg.norm(fit.unknowns[: 2 * len(orders)]))
    std = np.sqrt(np.maximum(np.diagonal(fit.projected.covariance), 0.0))
    return bool(
        max(orders, default=0.0) * step**2 < _STILL * std[: 2 * len(orders)].min(initial=1.0)
    )
