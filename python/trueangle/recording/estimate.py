"""What is known of a joint while it is recorded: its travel, and the orders of its error."""

from __future__ import annotations

import math
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ..errors import RankError
from ..estimation.moments import Moments
from ..estimation.momentsfit import MomentsFit
from ..support.angles import wrap
from ..support.arrays import Array
from ..support.distributions import chi_squared_quantile

#: Cells of a turn, orders that are looked at, and the chance that one of them is there by noise.
CELLS: Final = 72
_HIGHEST: Final = 32
_CHANCE: Final = 0.01
#: Part of a turn by which an angle moves back before it has turned round.
_BACK: Final = 1.0 / 288.0
#: Turns of travel after which a joint that swings has made one, if it was read everywhere.
_SWUNG: Final = 2.0
#: Seconds over which a speed is taken.
_SPEED: Final = 0.5


def places_in_turn(angle: Array, period: float) -> NDArray[np.intp]:
    """Cells of the turn that angles lie in."""
    return np.asarray(np.floor(np.mod(angle / period, 1.0) * CELLS).astype(np.intp) % CELLS)


def _coefficients(found: MomentsFit) -> NDArray[np.complex128]:
    """Cosine and sine of every order that is looked at; 0 of those that were not told apart."""
    values = np.zeros(_HIGHEST, dtype=complex)
    values[: found.cosine.size] = found.cosine + 1j * found.sine
    return values


class LiveOrder:
    """One order: amplitude and standard error in the unit of the angles, phase in degrees."""

    def __init__(self, order: int, value: complex, std: float) -> None:
        self.order, self.value, self.std = order, value, std
        self.amplitude = abs(value)
        self.phase_deg = math.degrees(math.atan2(value.real, value.imag)) % 360.0


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
        self._period, self._direction = period, 0
        self._last = self._extreme = self._anchor = math.nan
        self._from: tuple[float, float] | None = None

    def path(self, angle: Array) -> Array:
        """Angles in turns, without jumps from those before on."""
        turn = np.asarray(angle) / self._period
        last = float(turn[0]) if math.isnan(self._last) else self._last
        return last + np.cumsum(wrap(np.diff(turn, prepend=last), 1.0))

    def add(self, angle: Array, time: Array) -> Array:
        """Take in angles; the direction of travel at each, 0 before it is known."""
        path = self.path(angle)
        if math.isnan(self._last):
            self._extreme = self._anchor = float(path[0])
        directions = self._directions(path)
        self._last = float(path[-1])
        if abs(self._last - self._anchor) > _BACK:
            self.turns += abs(self._last - self._anchor)
            self._anchor = self._last
        places = places_in_turn(path, 1.0)
        for row, sign in enumerate((1, -1)):
            self.cells[row] += np.bincount(places[directions == sign], minlength=CELLS)
        self._take_speed(self._last, float(time[-1]))
        return directions

    def _directions(self, path: Array) -> Array:
        """Direction at each place of a path: it turns where it comes back by more than noise."""
        found, start = np.empty(path.size), 0
        while start < path.size:
            part, sign = path[start:], self._direction
            if sign == 0:
                moved = np.flatnonzero(np.abs(part - self._extreme) > _BACK)
                stop = int(moved[0]) if moved.size else part.size
                new = 0 if not moved.size else int(np.sign(part[stop] - self._extreme))
            else:
                tops = np.maximum.accumulate(np.maximum(sign * part, sign * self._extreme))
                back = np.flatnonzero(tops - sign * part > _BACK)
                stop, new = (int(back[0]), -sign) if back.size else (part.size, sign)
                self._extreme = sign * float(tops[min(stop, part.size - 1)])
            found[start : start + stop] = sign
            if stop < part.size:
                self._direction, self._extreme = new, float(part[stop])
            start += stop
        return found

    def _take_speed(self, place: float, time: float) -> None:
        if self._from is None:
            self._from = place, time
        elif time - self._from[1] >= _SPEED:
            speed = abs(place - self._from[0]) / (time - self._from[1])
            if abs(place - self._from[0]) > _BACK:
                self.speeds = [min(self.speeds[0], speed), max(self.speeds[1], speed)]
            self._from = place, time

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
    standard error is that of white noise or, where turns differ by more than it makes of them,

    ::

        s_k² = Σ_w |c_kw - mean|² / (2 n (n - 1))

    with the coefficients c of each of n turns. The orders are settled when the last turn has
    changed none by more than its standard error; there turns differ by their steps,
    Σ_w |c_kw - c_k,w-1|² / (4 n (n - 1)), in which a drift does not hide.

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
        Turns of which each told all orders.
    is_settled : bool
    """

    def __init__(self, period: float) -> None:
        self.period, self.travel = period, Travel(period)
        self.orders: list[LiveOrder] = []
        self._values = self._before = np.zeros(_HIGHEST, dtype=complex)
        self.turns, self.is_settled = 0, False
        self._highest = _HIGHEST
        self._sums = np.zeros((2, CELLS))
        self._zero = math.nan
        self._moments, self._window = self._empty(), self._empty()
        self._seen = np.zeros(CELLS, dtype=bool)
        self._closed_at, self._from = 0.0, math.nan
        self._mean = np.zeros(_HIGHEST, dtype=complex)
        self._last = self._mean.copy()
        self._scatter, self._steps = np.zeros(_HIGHEST), np.zeros(_HIGHEST)

    def add(self, reference: Array, indicated: Array, time: Array) -> None:
        """Take in readings in the order they were taken."""
        error = indicated - reference
        if math.isnan(self._zero):
            self._zero = float(error[0])
        error = self._zero + wrap(error - self._zero, self.period)
        path = self.travel.path(reference)
        start = 0
        while start < path.size:
            if math.isnan(self._from):
                self._from = float(path[0])
            off = path[start:] - self._from
            ends = np.flatnonzero(np.abs(off) >= 1.0)
            stop = start + int(ends[0]) + 1 if ends.size else path.size
            rows = slice(start, stop)
            self._take(reference[rows], error[rows], time[rows])
            swung = self.travel.turns - self._closed_at > _SWUNG
            if ends.size or swung:
                self._from += float(np.trunc(off[stop - start - 1]))
                self._end_turn()
            start = stop

    def _take(self, reference: Array, error: Array, time: Array) -> None:
        """Take in readings over part of a turn; judge the orders where they end one."""
        directions = self.travel.add(reference, time)
        places = places_in_turn(reference, self.period)
        self._sums[0] += np.bincount(places, minlength=CELLS)
        self._sums[1] += np.bincount(places, error, CELLS)
        for sign in (-1, 1):
            rows = directions == sign
            if rows.any():
                for sums in (self._moments, self._window):
                    sums.update(reference[rows], error[rows], run=sign)
        self._seen[places] = True

    def _end_turn(self) -> None:
        """Take in the turn that has ended, if it was read everywhere; else it goes on."""
        if not self._seen.all():
            return
        found = self._solved(self._window)
        if found is not None:
            self._close(_coefficients(found))
            self._judge()
        self._window, self._seen = self._empty(), np.zeros(CELLS, dtype=bool)
        self._closed_at = self.travel.turns

    def _close(self, values: NDArray[np.complex128]) -> None:
        """Take in the coefficients of one turn."""
        self.turns += 1
        if self.turns > 1:
            self._steps += np.abs(values - self._last) ** 2
        off = values - self._mean
        self._mean, self._last = self._mean + off / self.turns, values
        self._scatter += np.abs(off) ** 2 * (1.0 - 1.0 / self.turns)

    def _empty(self) -> Moments:
        return Moments(range(1, _HIGHEST + 1), period=self.period)

    def _solved(self, sums: Moments) -> MomentsFit | None:
        """Orders of some readings: as many as these tell apart."""
        while self._highest:
            try:
                return sums.solve(range(1, self._highest + 1))
            except RankError:
                self._highest //= 2
        return None

    def _judge(self) -> None:
        """Find the orders at the end of a turn, and whether it has changed them."""
        before, known = self._before, {order.order for order in self.orders}
        self.update()
        known |= {order.order for order in self.orders}
        self._before = self._values
        changes = np.abs(self._values - before)
        self.is_settled = self.turns > 1 and all(
            changes[k - 1] <= self._stds[k - 1] for k in known if k <= self._stds.size
        )

    def update(self) -> None:
        """Find the orders by all readings so far, after the first whole turn."""
        if not self.turns:
            return
        found = self._solved(self._moments)
        if found is None:
            return
        white = np.diag(found.covariance)[1:].reshape(-1, 2).mean(axis=1)
        each = 4.0 * self.turns * max(self.turns - 1.0, 1.0)
        steps, scatter = (x[: white.size] / each for x in (self._steps, 2.0 * self._scatter))
        # All orders together first: noise of any colour is in each.
        white = white * self._larger(
            np.mean(steps / np.maximum(white, 1e-300), keepdims=True), np.ones(1), white.size
        )
        self._stds = np.sqrt(self._larger(steps, white))
        variance = self._larger(scatter, white)
        least = math.sqrt(-2.0 * math.log(_CHANCE / _HIGHEST))
        self._values = _coefficients(found)
        values = self._values[: white.size].tolist()
        self.orders = [
            LiveOrder(k, value, std)
            for k, (value, std) in enumerate(
                zip(values, np.sqrt(variance).tolist(), strict=True), 1
            )
            if abs(value) > least * self._stds[k - 1]
        ]
        self.orders.sort(key=lambda order: -order.amplitude)

    def _larger(self, by_turns: Array, white: Array, orders: int = 1) -> Array:
        """Variances by what turns differ by, where that is more than noise makes of it.

        Each is the mean of those of so many ``orders``.
        """
        if self.turns < 2:
            return white
        degrees = 2.0 * orders * (self.turns - 1.0)
        chance = _CHANCE * orders / _HIGHEST
        limit = chi_squared_quantile(1.0 - chance, degrees) / degrees
        return np.where(by_turns > limit * white, by_turns, white)

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
                    "amplitude_arcsec": scale * order.amplitude,
                    "phase_deg": order.phase_deg,
                    "std_arcsec": scale * order.std,
                }
                for order in self.orders
            ],
        }
