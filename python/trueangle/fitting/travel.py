"""Partial travel: where readings are missing on the circle.

A joint with hard stops shows its harmonics on an arc only. There they nearly cancel
each other, and plain least squares buys a last hundredth of a degree with amplitudes of
a hundred degrees that run wild outside the arc.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..angles import unit_name
from ..runs import CalibrationRun

__all__ = ["Span", "covered_span", "over_turns", "travelled_span"]

Array = NDArray[np.float64]

#: Readings whose positions are looked at: one lies in every degree of the travel.
_LOOKED_AT = 65_536

#: Below this condition number of the design plain least squares is harmless on an arc.
#: Orders 0..8 reach 31 on 300 deg of travel, 274 on 270 deg.
CONDITION = 30.0


#: Angles are a sweep when they jump over a turn's border in fewer than this share of steps.
_JUMPS = 0.1


class Span(NamedTuple):
    """Stretch of the turn that was travelled, in the unit of the angles."""

    start: float
    stop: float
    full: bool

    def describe(self, period: float) -> str:
        """The stretch with its unit, a turn off where it ends beyond the first.

        Examples
        --------
        >>> Span(200.0, 500.0, False).describe(360.0)
        '-160 to 140 deg'
        """
        within_a_turn = self.stop - self.start < period
        turn = period if within_a_turn and self.stop > period else 0.0
        return f"{self.start - turn:.4g} to {self.stop - turn:.4g} {unit_name(period)}"


def covered_span(angles: Sequence[Array], period: float) -> Span:
    """The turn without its widest gap, or the whole turn where no gap is missing travel.

    A gap is missing travel when it is wider than 20 deg and than chance leaves between as
    many random positions (2 %). Of more than 65 536 readings every n-th is looked at.

    Parameters
    ----------
    angles : sequence of ndarray
        Positions of every run, any number of turns.
    period : float

    Returns
    -------
    Span
        ``start`` in ``[0, period)``; ``stop - start`` is below ``period`` for partial
        travel; ``(0, period, True)`` for a full turn.

    Examples
    --------
    >>> covered_span([np.linspace(-40.0, 150.0, 96)], 360.0)
    Span(start=320.0, stop=510.0, full=False)
    """
    return Span(*_core.covered_span(angles, period, _LOOKED_AT))


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
    if np.ptp(run.reference) > run.period or not 0 < jumps <= max(1.0, _JUMPS * len(run)):
        return run
    reference = run.unwrapped_reference
    return replace(run, reference=reference, indicated=reference + run.centred_error)
