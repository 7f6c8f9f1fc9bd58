"""Partial travel: the span that is covered on the circle, the orders it holds, drift in a pass.

A joint with hard stops shows its harmonics on an arc only. There they nearly cancel
each other: plain least squares removes a last hundredth of a degree by amplitudes of a
hundred degrees, with errors as large outside the arc.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np

import trueangle._core as _core

from ..support.angles import unit_name
from ..support.arrays import Array
from .run import CalibrationRun

#: Below this condition number of the design plain least squares is harmless on an arc.
#: Orders 0..8 reach 31 on 300 deg of travel, 274 on 270 deg.
CONDITION = 30.0


#: A short travel (turns), a single pass over it (travel there over its width), readings of a
#: log, periods that a line needs to come back, and correlation that is not noise of readings.
_PERIODS = 2.0

#: Degree of what is slow over a short travel.
_SLOW = 5


class Span(NamedTuple):
    """Part of the turn that was travelled, in the unit of the angles."""

    start: float
    stop: float
    full: bool

    def describe(self, period: float) -> str:
        """The span with its unit, less a turn where it ends beyond the first turn.

        Examples
        --------
        >>> Span(200.0, 500.0, False).describe(360.0)
        '-160 to 140 deg'
        """
        within_a_turn = self.stop - self.start < period
        turn = period if within_a_turn and self.stop > period else 0.0
        # An end of a span nearer to zero than this share of the span is reported as zero.
        finest = 1e-4 * (self.stop - self.start)
        low, high = (x if abs(x) > finest else 0.0 for x in (self.start - turn, self.stop - turn))
        return f"{low:.4g} to {high:.4g} {unit_name(period)}"


def covered_span(angles: Sequence[Array], period: float) -> Span:
    """The turn without its widest gap, or the whole turn where no gap is missing travel.

    A gap is missing travel when it is wider than 20 deg and wider than as many random positions
    leave with a probability of 2 %. Of more than 65 536 readings every n-th is used.

    ``start`` lies in ``[0, period)``; partial travel is narrower than ``period``, a full turn ``(0,
    period, True)``.

    Examples
    --------
    >>> covered_span([np.linspace(-40.0, 150.0, 96)], 360.0)
    Span(start=320.0, stop=510.0, full=False)
    """
    # Readings whose positions are looked at: one lies in every degree of the travel.
    return Span(*_core.covered_span(angles, period, 65_536))


def travelled_span(angles: Sequence[Array], period: float, periodic: bool) -> Span:
    """`covered_span`, or first to last angle, over the turns, of an error that has no period.

    Where a shaft does not turn a whole number of times per output turn, each turn is another
    place: what was not travelled is not known, though the same angle modulo a turn was.

    Examples
    --------
    >>> travelled_span([np.linspace(0.0, 420.0, 96)], 360.0, periodic=False)
    Span(start=0.0, stop=420.0, full=False)
    """
    if periodic:
        return covered_span(angles, period)
    low, high = min(float(x.min()) for x in angles), max(float(x.max()) for x in angles)
    return Span(low, high, False)


def is_swept_once(run: CalibrationRun) -> bool:
    """Whether a run passed every place once: drift in time is a function of its angle.

    Examples
    --------
    >>> theta = np.linspace(0.0, 200.0, 500)
    >>> both = np.concatenate([theta, theta[::-1]])
    >>> [is_swept_once(CalibrationRun(x, x, period=360.0)) for x in (theta, both)]
    [True, False]
    """
    turns = run.unwrapped_reference / run.period
    travel = float(np.ptp(turns))
    return 0.0 < travel <= 1.0 and float(np.abs(np.diff(turns)).sum()) <= 1.5 * travel


def held_orders(runs: Sequence[CalibrationRun], declared: Sequence[float]) -> float:
    """Order from which on a line is distinguished from drift, over a short single pass.

    On an arc that one run passed once, drift in time is a function of the angle as well, and a
    low order that is fitted to it makes the next run worse. So over less than a quarter of a
    turn, where neighbouring readings agree or lines were declared that the travel holds, only
    orders count that come back within the travel. 0 where every order counts.

    Examples
    --------
    >>> theta = np.linspace(0.0, 24.0, 500)
    >>> run = CalibrationRun(theta, theta + 0.001 * theta, period=360.0)
    >>> held_orders([run], [360.0])
    30.0
    """
    if len(runs) != 1 or len(runs[0]) < 100:
        return 0.0
    (run,) = runs
    reference = run.unwrapped_reference
    travel = float(np.ptp(reference)) / run.period
    # Travel of so many turns is not short.
    if travel >= 0.25 or not is_swept_once(run):
        return 0.0
    held = [k for k in declared if k * travel >= _PERIODS]
    # Readings whose neighbours are compared.
    part = slice(0, 20_000)
    x = (reference[part] - reference[0]) / (travel * run.period)
    columns = [x**power for power in range(4)]
    for k in held:
        for harmonic in (1, 2, 3, 4):
            angle = 2.0 * np.pi * k * harmonic * travel * x
            columns += [np.cos(angle), np.sin(angle)]
    design, error = np.column_stack(columns), run.centred_error[part]
    left = error - design @ np.linalg.lstsq(design, error, rcond=None)[0]
    size = float(left @ left)
    agree = size > 0.0 and float(left[:-1] @ left[1:]) > 0.3 * size
    return _PERIODS / travel if held or agree else 0.0


def without_drift(run: CalibrationRun, orders: Sequence[float]) -> CalibrationRun:
    """A short single pass without what is slow in it, a polynomial fitted jointly with the orders.

    Examples
    --------
    >>> theta = np.linspace(0.0, 20.0, 300)
    >>> error = 0.01 * np.sin(np.radians(360.0 * theta)) + 0.1 * (theta / 20.0) ** 2
    >>> left = without_drift(CalibrationRun(theta, theta + error, 360.0), [360.0]).centred_error
    >>> bool(abs(left.std() - 0.01 / 2**0.5) < 1e-4)
    True
    """
    reference = run.unwrapped_reference
    x = 2.0 * (reference - reference.mean()) / max(float(np.ptp(reference)), 1e-300)
    slow = np.polynomial.legendre.legvander(x, _SLOW)
    angle = 2.0 * np.pi / run.period * np.outer(reference, orders)
    design = np.hstack([slow, np.cos(angle), np.sin(angle)])
    found = np.linalg.lstsq(design, run.centred_error, rcond=None)[0]
    return replace(run, indicated=run.indicated - slow[:, 1:] @ found[1 : _SLOW + 1])


def over_turns(run: CalibrationRun) -> CalibrationRun:
    """The run with its angles over as many turns as it took, where they were given within one.

    Angles beyond one turn are taken as they are, and so are readings in no order: how many
    turns lie between them is not known.

    Examples
    --------
    >>> run = CalibrationRun([200.0, 300.0, 40.0, 140.0], [200.0, 300.0, 40.0, 140.0], 360.0)
    >>> over_turns(run).reference
    array([200., 300., 400., 500.])
    """
    jumps = np.count_nonzero(np.abs(np.diff(run.reference)) > 0.5 * run.period)
    # Angles are a sweep when they jump over a turn's border in fewer than this share of steps.
    if np.ptp(run.reference) > run.period or not 0 < jumps <= max(1.0, 0.1 * len(run)):
        return run
    reference = run.unwrapped_reference
    return replace(run, reference=reference, indicated=reference + run.centred_error)
