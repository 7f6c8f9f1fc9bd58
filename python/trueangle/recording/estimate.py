"""What is known about a joint while it is recorded: its travel, and the orders of its error."""

from __future__ import annotations

import math
from contextlib import suppress
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

import trueangle._core as _core

from ..errors import RankError
from ..support.angles import arcsec, wrap
from ..support.arrays import Array
from ..support.distributions import chi_squared_quantile

#: Cells of a turn, orders that are tested, and the probability that noise alone makes one of them.
CELLS: Final = 72
_HIGHEST: Final = 32
_ORDERS: Final = [list(range(1, _HIGHEST + 1))]
_CHANCE: Final = 0.01
#: Variance of all orders by turns, in that of white noise, from which on noise is not white, and
#: orders on either side that have as much of it.
_NEAR: Final = 4
#: Turns by which an angle moves before it has another direction, and seconds that make a speed.
_MOVED: Final = 1.0 / 288.0


class LiveOrder(NamedTuple):
    """One order: its amplitude, the phase of its sine, and their standard error."""

    order: int
    amplitude_arcsec: float
    phase_deg: float
    std_arcsec: float


class Estimate:
    """Travel, and the error by place and its orders with standard errors, in constant memory.

    Orders are those of all readings by least squares, with one zero for each direction. Their
    variance is that of white noise or, where turns differ by more than it makes of them,

    ::

        s_k² = Σ_w |c_kw - c_k,w-1|² / (4 n (n - 1))

    with the coefficients c of each of n turns: by their steps, in which a drift does not hide.
    Noise that is not white is the median of these, and of the sizes, over neighbouring orders.
    The orders are settled when the last turn has changed none by more than its standard error.

    Parameters
    ----------
    period : float

    Attributes
    ----------
    cells : ndarray, shape (2, CELLS)
        Readings by direction (forwards, backwards) and place in the turn.
    travelled : float
        Turns, both ways added up.
    speeds : list of float
        Least and greatest speed, turns per second; none before it has moved.
    orders : list of LiveOrder
        Those above what noise makes of the largest of all looked at, with 99 %; the strongest
        first.
    turns : int
        Turns of travel that were read everywhere.
    is_settled : bool
    """

    def __init__(self, period: float) -> None:
        self.period = period
        self.cells = np.zeros((2, CELLS), dtype=np.int64)
        self.travelled, self.speeds = 0.0, [math.inf, 0.0]
        self.orders: list[LiveOrder] = []
        self.turns, self.is_settled = 0, False
        self._zero = self._last = self._mark = math.nan
        self._sign, self._ended, self._from = 0, 0, (0.0, 0.0, 0)  # seconds, travel, direction
        self._all, self._turn = self._moments(), self._moments()
        self._seen = np.zeros(CELLS, dtype=bool)
        self._sums = np.zeros((2, CELLS))
        self._values = self._before = np.zeros(_HIGHEST, dtype=complex)
        self._steps = np.zeros(_HIGHEST)

    def _moments(self) -> dict[int, _core.Moments]:
        """Sums of readings by direction."""
        return {sign: _core.Moments(self.period, [1.0], _ORDERS) for sign in (1, -1)}

    def add(self, reference: Array, indicated: Array, time: Array) -> None:
        """Take in readings in the order they were taken."""
        error, place = indicated - reference, reference / self.period
        if math.isnan(self._zero):
            self._zero, self._last = float(error[0]), float(place[0])
            self._mark, self._from = self._last, (float(time[0]), 0.0, 0)
        error = self._zero + wrap(error - self._zero, self.period)
        path = self._last + np.cumsum(wrap(np.diff(place, prepend=self._last), 1.0))
        self._last = float(path[-1])
        before = int(self.travelled)
        signs, turns = self._travel(path, time)
        cells = np.floor(path % 1.0 * CELLS).astype(np.intp) % CELLS
        for row, sign in enumerate(self._turn):
            self.cells[row] += np.bincount(cells[signs == sign], minlength=CELLS)
        self._sums += np.bincount(cells, minlength=CELLS), np.bincount(cells, error, CELLS)
        ends = np.flatnonzero(np.diff(turns, prepend=before)) + 1
        for rows in filter(len, np.split(np.arange(error.size), ends)):
            for sign, sums in self._turn.items():
                own = rows[signs[rows] == sign]
                sums.update(reference[own], error[own])
            self._seen[cells[rows]] = True
            if turns[rows[-1]] > self._ended and self._seen.all():
                with suppress(RankError):  # it goes on until its places separate the orders
                    self._end_turn(self._solved(self._turn)[0], int(turns[rows[-1]]))

    def _travel(self, path: Array, time: Array) -> NDArray[np.intp]:
        """Direction at each place, 0 before it has moved, and whole turns travelled."""
        steps = []
        for place in path.tolist():
            if abs(place - self._mark) > _MOVED:
                self._sign = 1 if place > self._mark else -1
                self.travelled += abs(place - self._mark)
                self._mark = place
            steps.append((self._sign, int(self.travelled)))
        start, before, sign = self._from
        seconds, far = float(time[-1]) - start, self.travelled - before
        # Seconds that make a speed.
        if seconds >= 0.5 or sign != self._sign:
            if far > _MOVED and sign == self._sign:
                slow, fast = self.speeds
                self.speeds = [min(slow, far / seconds), max(fast, far / seconds)]
            self._from = float(time[-1]), self.travelled, self._sign
        found = np.transpose(steps)
        found[0, found[0] == 0] = self._sign  # it had moved that way already
        return found

    def _solved(self, sums: dict[int, _core.Moments]) -> tuple[Any, Array]:
        """Cosine and sine of all orders, and variance of either."""
        read = [each for each in sums.values() if each.count]
        found = _core.fit_moments(read, self.period, [1.0], _ORDERS)
        variance = np.diag(found.covariance)[1:].reshape(-1, 2).mean(axis=1)
        return np.array(found.cosine[0]) + 1j * np.array(found.sine[0]), variance

    def _end_turn(self, turn: Any, ended: int) -> None:
        """Find the orders by all readings, and judge whether the last turn has changed them."""
        for sign, sums in self._turn.items():
            self._all[sign].merge(sums)
        self._turn, self._seen = self._moments(), np.zeros(CELLS, dtype=bool)
        before, (self._values, white) = self._values, self._solved(self._all)
        self.turns, self._ended = self.turns + 1, ended
        self._steps += np.abs(turn - self._before) ** 2 * (self.turns > 1)
        # Of the period, below which a standard error is that of rounding.
        self._before, white = turn, np.maximum(white, (1e-12 * self.period) ** 2)
        more = max(self.turns - 1.0, 1.0)
        own = self._steps / (4.0 * self.turns * more)
        # Of n turns noise has one mean, in which true orders are few, and n - 1 steps.
        middle = chi_squared_quantile(0.5, 2.0 * more) / (2.0 * more)
        mean = np.abs(self._values) ** 2 / (2.0 * math.log(2.0))
        noise = np.array([mean, *[own / middle] * min(self.turns - 1, _NEAR)])
        # Where all orders by turns vary so much more than white noise, noise is not white.
        if np.median(noise / white) > 1.5:
            near = (noise[:, max(i - _NEAR, 0) : i + _NEAR + 1] for i in range(_HIGHEST))
            white = np.maximum(white, [np.median(part) for part in near])
        limit = chi_squared_quantile(1.0 - _CHANCE / _HIGHEST, 2.0 * more) / (2.0 * more)
        std = np.sqrt(np.where((own > limit * white) & (self.turns > 1), own, white))
        least = math.sqrt(-2.0 * math.log(_CHANCE / _HIGHEST)) * std
        known, scale = {order.order for order in self.orders}, arcsec(1.0, self.period)
        sizes = np.abs(self._values)
        phases = np.degrees(np.arctan2(self._values.real, self._values.imag)) % 360.0
        self.orders = [
            LiveOrder(i + 1, scale * sizes[i], phases[i], scale * std[i])
            for i in np.argsort(-sizes).tolist()
            if sizes[i] > least[i]
        ]
        watched = [k - 1 for k in known | {order.order for order in self.orders}]
        is_steady = np.abs(self._values - before) <= std
        self.is_settled = self.turns > 1 and bool(is_steady[watched].all())

    @property
    def covered(self) -> Array:
        """Share of the turn that was read, forwards and backwards."""
        return np.asarray((self.cells > 0).mean(axis=1))

    @property
    def share(self) -> float:
        """Part of the turn that was read, in one direction or the other."""
        return float(self.cells.any(axis=0).mean())

    @property
    def curve(self) -> tuple[Array, Array]:
        """Places of the turn (0 to 1) that were read, and the mean error there less its mean."""
        known = self._sums[0] > 0
        places = (np.flatnonzero(known) + 0.5) / CELLS
        error = self._sums[1][known] / self._sums[0][known]
        return places, error - (error.mean() if error.size else 0.0)

    def to_dict(self) -> dict[str, Any]:
        """Travel, and the orders, as plain values."""
        scale, (_, error) = arcsec(1.0, self.period), self.curve
        forwards, backwards = (360.0 * self.covered).round(1).tolist()
        return {
            "coverage_deg": {"forwards": forwards, "backwards": backwards},
            "speeds_deg_s": [360.0 * s for s in self.speeds] if self.speeds[1] else [],
            "turns_travelled": round(self.travelled, 3),
            "turns": self.turns,
            "peak_to_peak_arcsec": scale * float(np.ptp(error)) if error.any() else None,
            "orders": [order._asdict() for order in self.orders],
        }
