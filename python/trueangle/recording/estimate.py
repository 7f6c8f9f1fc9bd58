"""What is known of a joint while it is recorded: its travel, and the orders of its error."""

from __future__ import annotations

import math
from contextlib import suppress
from itertools import pairwise
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

import trueangle._core as _core

from ..errors import RankError
from ..support.angles import wrap
from ..support.arrays import Array
from ..support.distributions import chi_squared_quantile

#: Cells of a turn, orders that are looked at, and the chance that one of them is there by noise.
CELLS: Final = 72
_HIGHEST: Final = 32
_ORDERS: Final = [list(range(1, _HIGHEST + 1))]
_CHANCE: Final = 0.01
#: Variance of all orders by turns, in that of white noise, from which on noise is not white.
_COLOURED: Final = 1.5
#: Turns by which an angle moves before it has another direction, and seconds that make a speed.
_MOVED: Final = 1.0 / 288.0
_SPEED: Final = 0.5


class LiveOrder(NamedTuple):
    """One order: its cosine and sine, and their standard error, in the unit of the angles."""

    order: int
    value: complex
    std: float

    @property
    def phase_deg(self) -> float:
        """Phase of its sine, degrees."""
        return math.degrees(math.atan2(self.value.real, self.value.imag)) % 360.0


class Travel:
    """Which part of the turn was read in either direction, and how fast.

    Attributes
    ----------
    cells : ndarray, shape (2, CELLS)
        Readings by direction (forwards, backwards) and place in the turn.
    turns : float
        Turns travelled, both ways added up.
    speeds : list of float
        Least and greatest speed, turns per second; none before it has moved.
    """

    def __init__(self, period: float) -> None:
        self.cells = np.zeros((2, CELLS), dtype=np.int64)
        self.turns, self.speeds = 0.0, [math.inf, 0.0]
        self._period, self._sign = period, 0
        self._last = self._mark = math.nan
        self._from = 0.0, 0.0

    def add(self, angle: Array, time: Array) -> NDArray[np.intp]:
        """Take in angles in the order they were read.

        Returns
        -------
        ndarray of int, shape (3, n)
            Cell of each, direction (0 at first), and whole turns travelled by it.
        """
        turn = angle / self._period
        if math.isnan(self._last):
            self._last = self._mark = float(turn[0])
            self._from = self._last, float(time[0])
        path = self._last + np.cumsum(wrap(np.diff(turn, prepend=self._last), 1.0))
        steps, before = [], self._sign
        for place in path.tolist():
            if abs(place - self._mark) > _MOVED:
                self._sign = 1 if place > self._mark else -1
                self.turns += abs(place - self._mark)
                self._mark = place
            steps.append((self._sign, int(self.turns)))
        directions, turns = np.transpose(steps)
        directions[directions == 0] = self._sign  # it had moved that way already
        cells = np.floor(path % 1.0 * CELLS).astype(np.intp) % CELLS
        for row, sign in enumerate((1, -1)):
            self.cells[row] += np.bincount(cells[directions == sign], minlength=CELLS)
        self._last = float(path[-1])
        seconds, far = float(time[-1]) - self._from[1], abs(self._last - self._from[0])
        if seconds >= _SPEED or self._sign != before:
            if far > _MOVED and self._sign == before:
                slow, fast = self.speeds
                self.speeds = [min(slow, far / seconds), max(fast, far / seconds)]
            self._from = self._last, float(time[-1])
        return np.array([cells, directions, turns])

    @property
    def covered(self) -> Array:
        """Share of the turn that was read, forwards and backwards."""
        return np.asarray((self.cells > 0).mean(axis=1))

    @property
    def is_covered(self) -> bool:
        """Every part of the turn was read, in one direction or the other."""
        return bool(self.cells.any(axis=0).all())


class Estimate:
    """The error by place, and its orders with their standard errors, in constant memory.

    Orders are those of all readings by least squares, with one zero for each direction. Their
    variance is that of white noise or, where turns differ by more than it makes of them,

    ::

        s_k² = Σ_w |c_kw - c_k,w-1|² / (4 n (n - 1))

    with the coefficients c of each of n turns: by their steps, in which a drift does not hide.
    The orders are settled when the last turn has changed none by more than its standard error.

    Parameters
    ----------
    period : float

    Attributes
    ----------
    travel : Travel
    orders : list of LiveOrder
        Those above what noise makes of the largest of all looked at, with 99 %; the strongest
        first.
    turns : int
        Turns of travel that were read everywhere.
    is_settled : bool
    """

    def __init__(self, period: float) -> None:
        self.travel = Travel(period)
        self.orders: list[LiveOrder] = []
        self.turns, self.is_settled = 0, False
        self._all: dict[int, _core.Moments] = {}  # by direction
        self._turn: dict[int, _core.Moments] = {}
        self._seen = np.zeros(CELLS, dtype=bool)
        self._period, self._zero = period, math.nan
        self._sums = np.zeros((2, CELLS))
        self._values = self._last = np.zeros(_HIGHEST, dtype=complex)
        self._steps = np.zeros(_HIGHEST)

    def add(self, reference: Array, indicated: Array, time: Array) -> None:
        """Take in readings in the order they were taken."""
        error = indicated - reference
        if math.isnan(self._zero):
            self._zero = float(error[0])
        error = self._zero + wrap(error - self._zero, self._period)
        before = int(self.travel.turns)
        cells, signs, turns = self.travel.add(reference, time)
        self._sums[0] += np.bincount(cells, minlength=CELLS)
        self._sums[1] += np.bincount(cells, error, CELLS)
        ends = (np.flatnonzero(np.diff(turns, prepend=before)) + 1).tolist()
        for start, stop in pairwise(sorted({0, *ends, error.size})):
            for sign in {*signs[start:stop].tolist()} - {0}:
                rows = start + np.flatnonzero(signs[start:stop] == sign)
                for sums in (self._all, self._turn):
                    if sign not in sums:
                        sums[sign] = _core.Moments(self._period, [1.0], _ORDERS)
                    sums[sign].update(reference[rows], error[rows])
            self._seen[cells[start:stop]] = True
            if stop in ends and self._seen.all():
                with suppress(RankError):  # it goes on until its places tell the orders apart
                    self._end_turn(*map(self._solved, (self._turn, self._all)))

    def _solved(self, sums: dict[int, _core.Moments]) -> tuple[Any, Array]:
        """Cosine and sine of all orders, and variance of either."""
        found = _core.fit_moments([*sums.values()], self._period, [1.0], _ORDERS)
        variance = np.diag(found.covariance)[1:].reshape(-1, 2).mean(axis=1)
        return np.array(found.cosine[0]) + 1j * np.array(found.sine[0]), variance

    def _end_turn(self, turn: tuple[Any, Array], found: tuple[Any, Array]) -> None:
        """Find the orders by all readings, and judge whether the last turn has changed them."""
        self._turn, self._seen = {}, np.zeros(CELLS, dtype=bool)
        self.turns += 1
        more = max(self.turns - 1.0, 1.0)
        last, (self._last, _) = self._last, turn
        self._steps += np.abs(self._last - last) ** 2 * (self.turns > 1)
        before, known = self._values, {order.order for order in self.orders}
        self._values, white = found[0], np.maximum(found[1], 1e-300)
        own = self._steps / (4.0 * self.turns * more)
        # All orders together first: noise of any colour is in each.
        common = float(np.median(own / white))
        white = white * (common if common > _COLOURED else 1.0)
        limit = chi_squared_quantile(1.0 - _CHANCE / _HIGHEST, 2.0 * more) / (2.0 * more)
        std = np.sqrt(np.where(own > limit * white, own, white))
        least = math.sqrt(-2.0 * math.log(_CHANCE / _HIGHEST)) * std
        self.orders = [
            LiveOrder(int(i) + 1, complex(self._values[i]), float(std[i]))
            for i in np.argsort(-np.abs(self._values))
            if abs(self._values[i]) > least[i]
        ]
        known |= {order.order for order in self.orders}
        changes = np.abs(self._values - before)
        self.is_settled = self.turns > 1 and all(changes[k - 1] <= std[k - 1] for k in known)

    @property
    def curve(self) -> tuple[Array, Array]:
        """Places of the turn (0 to 1) that were read, and the mean error there less its mean."""
        known = self._sums[0] > 0
        places = (np.flatnonzero(known) + 0.5) / CELLS
        error = self._sums[1][known] / self._sums[0][known]
        return places, error - (error.mean() if error.size else 0.0)

    def to_dict(self, scale: float) -> dict[str, Any]:
        """The orders as plain values; sizes times ``scale`` are arcsec."""
        _, error = self.curve
        return {
            "turns": self.turns,
            "peak_to_peak_arcsec": scale * float(np.ptp(error)) if error.size else None,
            "orders": [
                {
                    "order": order.order,
                    "amplitude_arcsec": scale * abs(order.value),
                    "phase_deg": order.phase_deg,
                    "std_arcsec": scale * order.std,
                }
                for order in self.orders
            ],
        }
