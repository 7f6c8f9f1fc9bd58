"""Steps towards pattern and motion that explain the readings together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ..support.arrays import Array
from .motion import MotionFit, MotionSearch
from .pattern import pattern_model, pattern_series, pattern_steepness
from .projected import Unknown, harmonic_rows, harmonic_sum
from .readings import SegmentReadings
from .splines import Knots, spline_basis, spline_values
from .sums import ordered_motion_sums

#: Slope of the error that no step goes beyond: at 1 an angle would be read twice.
_STEEPEST: Final = 0.97


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
        """Place on the knots, true angle, weight of motion and what is left."""
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
        """Fit what is left; how far the pattern moved, in standard errors."""
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
            if all(pattern_steepness(self.orders, part) < _STEEPEST for part in parts):
                break
            step = 0.5 * step
        return unknowns + step

    def residuals(self, knots: Knots, spline: Array, unknowns: Array) -> Array:
        """What is left of every reading."""
        return self.state(knots, spline, unknowns, slice(None))[-1]
