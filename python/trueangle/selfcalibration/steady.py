"""Patterns of an encoder from stretches of roughly steady motion, iterated to the true angle."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Final

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..model import HarmonicModel
from ..shafts import Shaft
from .motion import MotionFit, MotionSearch, accumulate
from .projected import Column, Projected, harmonic_rows, pairs
from .splines import Knots, basis, evaluate
from .stretches import Stretch, ripple_lead

__all__ = ["ENCODER", "RIPPLE", "Readings", "SteadyFit", "fit_steady"]

Array = NDArray[np.float64]

ENCODER: Final = "the encoder"
RIPPLE: Final = "the speed ripple"

#: Readings that the first iterations look at: enough to come close.
_FIRST_LOOK: Final = 40_000

#: Readings per knot of the finest grid, at least.
_PER_KNOT: Final = 6

#: Intervals of the first grid; a finer one is laid where the evidence asks for it.
_INTERVALS: Final = 512

#: Smooth trends of a stretch at most: of polynomials of degree 2 to 8 a coasting shaft needs
#: no more; and the turns that each needs, so that none comes near an order.
_TRENDS: Final = 7
_TURNS_PER_TREND: Final = 5.0

#: Steps of the pattern below this share of its standard error end the iteration.
_STILL: Final = 0.02
_ROUNDS: Final = 12
_SEARCHES: Final = 3

#: Slope of the error that no step goes beyond: at 1 an angle would be read twice.
_STEEPEST: Final = 0.97

#: Turns between knots of a motion that leaves order 1 alone (to 1 %).
_TURNS_PER_KNOT: Final = 2.0

#: A residual beyond so many standard deviations (by the median) is a wild reading.
_WILD: Final = 7.0


class Readings:
    """Readings of all stretches in one list, with what does not change from fit to fit."""

    def __init__(self, stretches: Sequence[Stretch]) -> None:
        self.stretches = list(stretches)
        self.size = sum(s.time.size for s in stretches)
        self.stretch = np.repeat(np.arange(len(stretches)), [s.time.size for s in stretches])
        self.time = np.concatenate([s.time for s in stretches])
        self.angle = np.concatenate([s.angle for s in stretches])
        speeds = [s.turn_speed() for s in stretches]
        self.speed = np.concatenate(speeds)
        self.mean_speed = float(np.exp(np.mean(np.log(self.speed))))
        #: How ripple of constant torque grows where the shaft is slow.
        self.ripple = (self.mean_speed / self.speed) ** 2
        self.lead = np.concatenate(
            [ripple_lead(s, v) for s, v in zip(self.stretches, speeds, strict=True)]
        )
        #: Smooth trends that a stretch may follow at no cost: one for every few turns.
        self.trends = tuple(min(_TRENDS, int(s.turns / _TURNS_PER_TREND)) for s in self.stretches)
        self.extra: Array | None = None  # further columns of motion, (r, n)
        self.extra_names: tuple[str, ...] = ()

    def knots(self, intervals: int) -> Knots:
        """A grid of about so many intervals in all, each stretch a power of two times some."""
        spans = [float(s.time[-1] - s.time[0]) for s in self.stretches]
        fewest = min(self.size // _PER_KNOT, intervals)
        levels = max(0, math.floor(math.log2(max(fewest / (4 * len(spans)), 1.0))))
        unit = 2**levels
        spacing = max(max(spans) / unit, sum(spans) / max(fewest, 4)) if unit == 1 else 0.0
        if unit > 1:
            spacing = max(sum(spans) / fewest, max(spans) / (unit * 64))
        count = tuple(max(unit, unit * math.ceil(span / (spacing * unit))) for span in spans)
        spacing = max(span / n for span, n in zip(spans, count, strict=True))
        starts = tuple(
            # Shorter stretches stand in the middle of their knots.
            0.5 * (float(s.time[0]) + float(s.time[-1]) - n * spacing)
            for s, n in zip(self.stretches, count, strict=True)
        )
        return Knots(starts, count, spacing * (1.0 + 1e-9))


@dataclass(frozen=True)
class SteadyFit:
    """Pattern, ripple and motion that explain the readings together."""

    orders: tuple[float, ...]
    ripple_orders: tuple[float, ...]
    unknowns: Array
    """In radians, in the order of ``motion.projected.columns``."""
    motion: MotionFit
    readings: Readings
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


def pattern_model(orders: Sequence[float], coefficients: Array) -> HarmonicModel:
    """The pattern as a model in radians; its constant is zero, since nothing shows it."""
    whole = tuple(int(k) for k in orders)
    return HarmonicModel(
        (Shaft("output", 1.0, whole, tuple(coefficients[0::2]), tuple(coefficients[1::2])),)
        if whole
        else (),
        period=2.0 * math.pi,
    )


def fit_steady(
    readings: Readings,
    orders: Sequence[float],
    ripple: Sequence[float] = (),
    *,
    start: SteadyFit | None = None,
    groups: NDArray[np.int64] | None = None,
    thorough: bool = True,
    smooth: bool = False,
) -> SteadyFit:
    r"""Gauss-Newton on :math:`r = \theta + \varepsilon(\theta)`, :math:`\theta = S c + \rho H b`.

    Parameters
    ----------
    readings : Readings
    orders, ripple : sequence of int
        Orders of the encoder, and those at which the speed may ripple:
        :math:`\rho = (\omega_m / \omega)^2`.
    start : SteadyFit, optional
        Where to begin.
    groups : ndarray of int, optional
        0 or 1 for each reading: one pattern for each group, beside one motion.
    thorough : bool
        Look at all readings in the last iteration; else at some 40 000.
    smooth : bool
        Allow motion no knots that are closer than two turns.
    """
    orders, ripple = tuple(orders), tuple(ripple)
    sets = 1 if groups is None else 2
    names = tuple(f"{ENCODER}, part {i + 1}" for i in range(2)) if sets == 2 else (ENCODER,)
    columns: list[Column] = [c for name in names for c in pairs(name, orders)]
    columns += pairs(RIPPLE, ripple)
    columns += [Column(name, 0.0, "") for name in readings.extra_names]
    unknowns = np.zeros(len(columns))
    if start is not None:
        for source in (*names, RIPPLE):
            origin = RIPPLE if source == RIPPLE else ENCODER
            for column in pairs(source, ripple if source == RIPPLE else orders):
                twin = column._replace(source=origin)
                if twin in start.motion.projected.columns:
                    unknowns[columns.index(column)] = start.unknowns[
                        start.motion.projected.columns.index(twin)
                    ]
        tail = len(readings.extra_names)
        if tail:
            unknowns[-tail:] = start.unknowns[-tail:]
    intervals = _INTERVALS if start is None else max(_INTERVALS, sum(_finest(start.motion)))
    work = _Work(readings, orders, ripple, groups, columns)
    stride = max(1, readings.size // _FIRST_LOOK)
    fit, valid = None, np.ones(readings.size, dtype=bool)
    if start is not None:
        valid = start.valid
    # Knots so far apart that no order fits between them, until the true angles are known:
    # at wrong ones, what is left repeats every turn and would pass for motion.
    stiff = _TURNS_PER_KNOT / readings.mean_speed
    while True:
        knots = readings.knots(intervals)
        spline = _first_spline(readings, knots)
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
        if fit.level > 0 or 2 * sum(knots.intervals) * _PER_KNOT > readings.size // stride:
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
        if moved < _STILL or (stride > 1 and moved < 0.5):
            break
    left = work.residuals(knots, spline, unknowns)
    return SteadyFit(orders, ripple, unknowns, fit, readings, left, valid)


def _finest(motion: MotionFit) -> tuple[int, ...]:
    return motion.knots.intervals


def _first_spline(readings: Readings, knots: Knots) -> Array:
    """Coefficients near the readings themselves: their values at the knots."""
    at = knots.greville()
    parts = []
    for g, stretch in enumerate(readings.stretches):
        here = at[knots.first[g] : knots.first[g + 1]]
        value = np.interp(here, stretch.time, stretch.angle)
        for outside, edge in ((here < stretch.time[0], 0), (here > stretch.time[-1], -1)):
            rate = 2.0 * math.pi * stretch.speed * stretch.direction
            value[outside] = stretch.angle[edge] + rate * (here[outside] - stretch.time[edge])
        parts.append(value)
    return np.concatenate(parts)


class _Work:
    """One Gauss-Newton step, of all readings or of every n-th."""

    def __init__(
        self,
        readings: Readings,
        orders: Sequence[float],
        ripple: Sequence[float],
        groups: NDArray[np.int64] | None,
        columns: Sequence[Column],
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
        motion = evaluate(spline, index, basis(place))
        at = self.sets * self.per_set
        if self.ripple:
            b = unknowns[at : at + 2 * len(self.ripple)]
            motion = motion + data.ripple[rows] * (
                b @ ripple_rows(theta, data.lead[rows], self.ripple)
            )
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
        ripple, lead = data.ripple[rows], data.lead[rows]
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
                ripple_rows(theta[part], lead[part], self.ripple, out[at:end])
                out[at:end] *= ripple[part] * weight[part]
                at = end
            if extra is not None:
                out[at:] = extra[:, part] * weight[part]

        good = valid[rows]
        sums = accumulate(
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
            if all(steepness(self.orders, part) < _STEEPEST for part in parts):
                break
            step = 0.5 * step
        return unknowns + step

    def residuals(self, knots: Knots, spline: Array, unknowns: Array) -> Array:
        """What is left of every reading."""
        return self.state(knots, spline, unknowns, slice(None))[-1]


def ripple_rows(
    theta: Array, lead: Array, orders: Sequence[float], out: Array | None = None
) -> Array:
    """Harmonics of each order ``k`` at ``theta`` with the phase ``lead / k`` added."""
    rows = harmonic_rows(theta, orders, out)
    for i, k in enumerate(orders):
        turn = np.exp(1j * (lead / k)) * (rows[2 * i] + 1j * rows[2 * i + 1])
        rows[2 * i], rows[2 * i + 1] = turn.real, turn.imag
    return rows


def steepness(orders: Sequence[float], coefficients: Array) -> float:
    """The greatest ``|d error / d angle|``."""
    whole = [int(k) for k in orders]
    parts = [list(coefficients[0::2])], [list(coefficients[1::2])]
    return _core.Series(2.0 * math.pi, 0.0, [1.0], [whole], *parts, "indicated").slope_bound


def pattern_series(orders: Sequence[float], coefficients: Array, theta: Array) -> Array:
    """Sum of the harmonics at ``theta``, by the compiled core where orders are whole."""
    if not len(orders):
        return np.zeros_like(theta)
    whole = tuple(int(k) for k in orders)
    shaft = Shaft("output", 1.0, whole, tuple(coefficients[0::2]), tuple(coefficients[1::2]))
    model = HarmonicModel((shaft,), period=2.0 * math.pi, argument="indicated")
    return np.asarray(model.error(theta))
