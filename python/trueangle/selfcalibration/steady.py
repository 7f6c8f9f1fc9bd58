"""Patterns of an encoder from segments of roughly steady motion, iterated to the true angle."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ..support.arrays import Array
from .model import ENCODER, RIPPLE, pattern_model, pattern_series, pattern_steepness
from .motion import MotionFit, MotionSearch
from .projected import Projected, Unknown, harmonic_rows, harmonic_sum, harmonic_unknowns
from .segments import PER_KNOT, SegmentReadings
from .splines import Knots, ordered_motion_sums, spline_basis, spline_values

#: Intervals of the first grid; a finer one is used where the evidence needs it.
_INTERVALS: Final = 512

#: Steps of the pattern below this share of its standard error end the iteration.
_STILL: Final = 0.02
_ROUNDS: Final = 12


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
        0 or 1 for each reading: one pattern for each group, jointly with one motion.
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
    # Readings that the first iterations look at: enough to come close.
    stride = max(1, readings.size // 40_000)
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
    # at wrong ones, the residual repeats every turn and would be fitted as motion.
    # Turns between knots of a motion that leaves order 1 alone (to 1 %).
    stiff = 2.0 / readings.mean_speed
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
        for _ in range(3):
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
    # A residual beyond this many standard deviations (by the median) is an outlier.
    valid = np.abs(left) <= 7.0 * max(spread, 1e-12)
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
    step = math.hypot(*fit.unknowns[: 2 * len(orders)])
    std = np.sqrt(np.maximum(np.diagonal(fit.projected.covariance), 0.0))
    return bool(
        max(orders, default=0.0) * step**2 < _STILL * std[: 2 * len(orders)].min(initial=1.0)
    )


class GaussNewtonSteps:
    """Steps of Gauss and Newton towards pattern and motion, of all readings or every n-th."""

    def __init__(
        self,
        readings: SegmentReadings,
        orders: Sequence[float],
        ripple: Sequence[float],
        groups: NDArray[np.int64] | None,
        columns: Sequence[Unknown],
    ) -> None:
        self.readings, self.orders, self.ripple = readings, orders, ripple
        self.groups, self.columns = groups, columns
        self.per_set = 2 * len(orders)
        self.sets = 1 if groups is None else 2

    def true_angle(self, angle: Array, unknowns: Array, rows: slice) -> tuple[Array, Array]:
        """Corrected readings and the slope of the error there."""
        theta, slope = np.empty_like(angle), np.empty_like(angle)
        for i in range(self.sets):
            part = unknowns[i * self.per_set : (i + 1) * self.per_set]
            if self.groups is None:
                mask: slice | NDArray[np.bool_] = slice(None)
            else:
                mask = self.groups[rows] == i
            model = pattern_model(self.orders, part)
            theta[mask] = model.correct(angle[mask])
            k = np.asarray(self.orders, dtype=np.float64)
            derivative = np.empty_like(part)
            derivative[0::2], derivative[1::2] = k * part[1::2], -k * part[0::2]
            slope[mask] = pattern_series(self.orders, derivative, theta[mask])
        return theta, slope

    def state(
        self, knots: Knots, spline: Array, unknowns: Array, rows: slice
    ) -> tuple[NDArray[np.int64], Array, Array, Array, Array]:
        """Place on the knots, true angle, weight of motion and residual."""
        data = self.readings
        time, stretch = data.time[rows], data.stretch[rows]
        index, place = np.empty(time.size, dtype=np.int64), np.empty(time.size)
        edges = np.searchsorted(stretch, np.arange(len(data.stretches) + 1))
        for g in range(len(data.stretches)):
            part = slice(int(edges[g]), int(edges[g + 1]))
            index[part], place[part] = knots.place(g, time[part])
        theta, slope = self.true_angle(data.angle[rows], unknowns, rows)
        motion = spline_values(spline, index, spline_basis(place))
        at = self.sets * self.per_set
        if self.ripple:
            b = unknowns[at : at + 2 * len(self.ripple)]
            lead, factor = (np.ascontiguousarray(v[rows]) for v in (data.lead, data.ripple))
            motion = motion + harmonic_sum(theta, self.ripple, b, factor=factor, lead=lead)
        if data.extra is not None:
            motion = motion + unknowns[-len(data.extra) :] @ data.extra[:, rows]
        weight = 1.0 + slope
        return index, place, theta, weight, weight * (theta - motion)

    def step(
        self,
        knots: Knots,
        spline: Array,
        unknowns: Array,
        valid: NDArray[np.bool_],
        stride: int,
        like: MotionFit | None = None,
        shortest: float = 0.0,
        near: MotionFit | None = None,
    ) -> tuple[MotionFit, Array, Array, float]:
        """Fit the residual; how far the pattern moved, in standard errors."""
        rows = slice(None, None, stride)
        data = self.readings
        index, place, theta, weight, left = self.state(knots, spline, unknowns, rows)
        lead, factor = np.ascontiguousarray(data.lead[rows]), data.ripple[rows] * weight
        extra = None if data.extra is None else data.extra[:, rows]
        groups = None if self.groups is None else self.groups[rows]

        def write(part: slice, out: Array) -> None:
            m = self.per_set
            harmonic_rows(theta[part], self.orders, out[:m])
            if groups is not None:
                out[m : 2 * m] = out[:m] * (groups[part] == 1)
                out[:m] *= groups[part] == 0
            at = self.sets * m
            if self.ripple:
                end = at + 2 * len(self.ripple)
                rows_here = out[at:end]
                harmonic_rows(
                    theta[part], self.ripple, rows_here, factor=factor[part], lead=lead[part]
                )
                at = end
            if extra is not None:
                out[at:] = extra[:, part] * weight[part]

        good = valid[rows]
        sums = ordered_motion_sums(
            knots,
            index,
            place,
            left,
            weight,
            write,
            len(self.columns),
            None if good.all() else good,
        )
        search = MotionSearch(sums, spline, self.columns, data.trends)
        if like is None:
            # With the patterns settled a search takes a few columns, not a hundred; it is
            # made again after they have moved.
            like = MotionSearch(sums.bare, spline, (), data.trends).best(shortest, near)
        fit = search.fit(like.level, like.stiffness, like.memory)
        std = np.sqrt(np.maximum(np.diagonal(fit.projected.covariance), 1e-300))
        patterns = self.sets * self.per_set
        moved = float(np.max(np.abs(fit.unknowns / std)[:patterns], initial=0.0))
        return fit, fit.coefficients, self.damped(unknowns, fit.unknowns), moved

    def damped(self, unknowns: Array, step: Array) -> Array:
        """``unknowns + step``, or a part of the step where the error would grow too steep.

        The first steps see the pattern at wrong angles.
        """
        for _ in range(12):
            parts = (unknowns + step)[: self.sets * self.per_set].reshape(self.sets, -1)
            # Slope of the error that no step goes beyond: at 1 an angle would be read twice.
            if all(pattern_steepness(self.orders, part) < 0.97 for part in parts):
                break
            step = 0.5 * step
        return unknowns + step

    def residuals(self, knots: Knots, spline: Array, unknowns: Array) -> Array:
        """The residual of every reading."""
        return self.state(knots, spline, unknowns, slice(None))[-1]
