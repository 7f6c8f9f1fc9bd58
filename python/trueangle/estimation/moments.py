"""Fitting in one pass and constant memory: sums that merge, added up by several threads."""

from __future__ import annotations

import math
import os
import threading
from collections.abc import Hashable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

import trueangle._core as _core

from ..errors import ArgumentError
from ..joint.shafts import ShaftOrders, resolve_orders
from ..model.model import Argument
from ..support.argumentkinds import told_kinds
from ..support.arrays import Array
from ..support.plainresult import ShownResult
from .forgetting import Forgetting
from .momentsfit import MomentsFit, Spectrum


class _Exclusive:
    """One thread at a time; the others wait, unless nobody can ever be done.

    A process that is forked while another of its threads is at it inherits sums that are
    half added: there an error is raised.
    """

    def __init__(self) -> None:
        self._lock = threading.Lock()
        self._process = os.getpid()

    def __enter__(self) -> None:
        # Seconds between two looks at whose turn it is.
        while not self._lock.acquire(timeout=0.05):
            if self._process != os.getpid():
                raise ArgumentError(
                    "this process was forked while another thread updated these moments: "
                    "make new ones here"
                )
        self._process = os.getpid()

    def __exit__(self, *_: object) -> None:
        self._lock.release()


class RunSums:
    """Sums of readings by run: every call has its turn, and none is half done.

    Parameters
    ----------
    period : float
    shafts : sequence of ShaftOrders
        All orders that may be fitted.

    Raises
    ------
    ArgumentError
        A period or shafts that have no sums.

    Examples
    --------
    >>> from trueangle.joint.shafts import resolve_orders
    >>> sums = RunSums(360.0, resolve_orders([1]))
    >>> sums.update("day", (np.arange(0.0, 360.0, 10.0), np.ones(36), None), None)
    >>> sums.labels, sums.count
    (('day',), 36)
    """

    def __init__(self, period: float, shafts: Sequence[ShaftOrders]) -> None:
        self.period = period
        self._shafts = shafts
        self._runs: dict[Hashable, _core.Moments] = {}
        self._turn = _Exclusive()
        self._new()  # a wrong period or shaft is named here, not at the first update

    def _new(self) -> _core.Moments:
        return _core.Moments(self.period, *_lists(self._shafts))

    def _of(self, run: Hashable) -> _core.Moments:
        sums = self._runs.get(run)
        return self._new() if sums is None else sums

    @property
    def labels(self) -> tuple[Hashable, ...]:
        """Labels of the runs, in the order of their first readings."""
        return tuple(self._runs)

    @property
    def cycles(self) -> float:
        """Turns of the base shaft per output turn."""
        return self._new().cycles

    @property
    def count(self) -> int:
        """Readings of positive weight."""
        with self._turn:
            return sum(run.count for run in self._runs.values())

    # -- readings ----------------------------------------------------------------

    def update(
        self, run: Hashable, readings: tuple[Array, Array, Array | None], threads: int | None
    ) -> None:
        """Add angles, errors and weights."""
        with self._turn:
            sums = self._of(run)
            sums.update(*readings, threads)
            if sums.count:
                self._runs[run] = sums

    def update_fading(
        self,
        run: Hashable,
        readings: tuple[Array, Array, Array | None],
        threads: int | None,
        forgetting: Forgetting,
    ) -> None:
        """Add readings; each makes those before it count less."""
        theta, error, weights = readings
        faded = forgetting.faded(theta.size, weights)
        with self._turn:
            sums, fresh = self._of(run), self._new()
            # Readings that are refused leave the sums alone.
            fresh.update(theta, error, faded, threads)
            sums.scale(forgetting.follow(run, faded))
            sums.merge(fresh)
            if sums.count:
                self._runs[run] = sums

    def update_known(
        self, run: Hashable, reference: Array, indicated: Array, by_indicated: bool
    ) -> int:
        """Add readings by both angles where both are known, and count them."""
        with self._turn:
            sums = self._of(run)
            known = sums.update_known(reference, indicated, by_indicated)
            if known:
                self._runs[run] = sums
        return known

    # -- other sums --------------------------------------------------------------

    def _copies(self) -> dict[Hashable, _core.Moments]:
        with self._turn:
            return {label: sums.copy() for label, sums in self._runs.items()}

    def copy(self) -> RunSums:
        """Separate sums of the same readings."""
        fresh = RunSums(self.period, self._shafts)
        fresh._runs = self._copies()
        return fresh

    def merge(self, other: RunSums) -> None:
        """Add the readings of others; runs go by label."""
        theirs = other._copies()  # not both turns at once: the other may be merging this
        with self._turn:
            for label, sums in theirs.items():
                mine = self._runs.get(label)
                if mine is None:
                    self._runs[label] = sums
                else:
                    mine.merge(sums)

    def subtract(self, other: RunSums) -> None:
        """Take away readings that were added; all of them, or none where a run has too few."""
        theirs = other._copies()
        with self._turn:
            for label, sums in theirs.items():
                mine = self._runs.get(label)
                if mine is None or mine.count < sums.count:
                    raise ArgumentError(f"other: run {label!r} was not added to these moments")
            for label, sums in theirs.items():
                self._runs[label].subtract(sums)
                if not self._runs[label].count:
                    del self._runs[label]

    # -- what is in them ---------------------------------------------------------

    def extremes(self, run: Hashable) -> Array:
        """See `Moments.extremes`."""
        with self._turn:
            return self._runs[run].extremes().reshape(-1, 4)

    def spectrum(self, run: Hashable, highest: int | None) -> Spectrum:
        """See `Moments.spectrum`."""
        with self._turn:
            if run not in self._runs:
                raise ArgumentError(f"there is no run {run!r}; the runs are {list(self._runs)!r}")
            sums = self._runs[run]
            return Spectrum(*sums.spectrum(highest), cycles=sums.cycles)

    def solution(self, wanted: Sequence[ShaftOrders]) -> _core.Solution:
        """Least squares of some orders over all runs."""
        with self._turn:
            return _core.fit_moments(list(self._runs.values()), self.period, *_lists(wanted))

    def stored(self) -> dict[Hashable, Array | None]:
        """All sums of every run as numbers."""
        with self._turn:
            return {label: sums.store() for label, sums in self._runs.items()}

    def restore(self, runs: Mapping[Hashable, Array | None]) -> None:
        """Take what was `stored`."""
        for label, numbers in runs.items():
            self._runs[label] = self._new()
            # Buffers that come over a network need not be aligned.
            self._runs[label].restore(np.require(numbers, requirements=["C", "A"]))


def _lists(shafts: Sequence[ShaftOrders]) -> tuple[list[float], list[list[int]]]:
    return [s.cycles_per_turn for s in shafts], [list(s.orders) for s in shafts]


__all__ = ["Moments", "MomentsFit", "Spectrum"]

_Orders = Iterable[float] | Mapping[str, Iterable[float]]


@told_kinds
class Moments(ShownResult):
    """Sums over readings, taken in one pass, from which any of the orders can be fitted.

    The normal equations of

    ::

        e_rj = z_r + Σ_k A_k cos k x_rj + B_k sin k x_rj

    need only ``Σ w e^(ikx)`` and ``Σ w e e^(ikx)``. They are assembled from
    Chebyshev moments of some 6.5 segments of the circle per order, which also hold what
    ill-conditioned problems need to be solved without squaring their condition number.

    Parameters
    ----------
    orders : iterable of int, or mapping of shaft name to such
        All orders that may ever be fitted.
    period : float
        One turn of ``theta`` and ``error``.
    forgetting : float, optional
        By which every reading counts less than the one after it in its run, above 0 and at most
        1: the sums hold some ``1 / (1 - forgetting)`` readings. Uncertainties are those of the
        effective number of readings, ``(Σ w)² / Σ w²`` less the unknowns.
    gear_ratio, fixed_member, shafts
        As in `fit`. Shafts that never come back to their start together have no moments.

    Notes
    -----
    About 4 ns per reading and core, for any number of orders; 900 bytes per segment
    and run, for any number of readings. Sums are compensated: a billion readings lose
    no digits. Results do not depend on ``threads``. Threads may share an accumulator: they
    take turns, and nothing is lost; an accumulator for each, merged in the end, lets them
    work at the same time. Orders go up to 65 536 cycles of the shafts' common turn.

    Examples
    --------
    >>> theta = np.linspace(0.0, 360.0, 1000, endpoint=False)
    >>> day, night = Moments([1, 2, 3], period=360.0), Moments([1, 2, 3], period=360.0)
    >>> _ = day.update(theta, 0.5 + 0.1 * np.cos(np.radians(theta)))
    >>> _ = night.update(theta, 0.5 + 0.3 * np.cos(np.radians(theta)))
    >>> (day + night).solve(orders=[1]).cosine.round(9)
    array([0.2])
    """

    def __init__(
        self,
        orders: _Orders,
        *,
        period: float = 2.0 * math.pi,
        gear_ratio: float | None = None,
        fixed_member: str = "circular_spline",
        shafts: Mapping[str, float] | None = None,
        forgetting: float | None = None,
    ) -> None:
        self._forgetting = None if forgetting is None else Forgetting(forgetting)
        self._shafts = resolve_orders(orders, gear_ratio, fixed_member, shafts)
        self._sums = RunSums(float(period), self._shafts)

    @property
    def period(self) -> float:
        """One turn of angles and errors."""
        return self._sums.period

    @property
    def runs(self) -> tuple[Hashable, ...]:
        """Labels of the runs, in the order of their first update."""
        return self._sums.labels

    @property
    def cycles(self) -> float:
        """Turns per output turn of the base shaft: all orders are whole multiples."""
        return self._sums.cycles

    @property
    def count(self) -> int:
        """Readings of positive weight."""
        return self._sums.count

    @told_kinds
    def update(
        self,
        theta: ArrayLike,
        error: ArrayLike,
        weights: ArrayLike | None = None,
        *,
        run: Hashable = None,
        threads: int | None = None,
    ) -> Moments:
        """Add readings: angles and errors (indicated - reference), of any shape.

        Parameters
        ----------
        theta : array_like
            Angles that the error is a function of, any number of turns.
        error : array_like
            Of the same shape. Errors are taken modulo a turn around the circular mean of
            the first readings of their run, so any zero will do.
        weights : array_like, optional
            Reciprocal variances up to a factor; 0 for readings that do not count.
        run : hashable, optional
            Label of the run; each run has its own zero.
        threads : int, optional

        Returns
        -------
        Moments
            Itself.

        Raises
        ------
        ArgumentError
            Different lengths, numbers that are not finite, negative weights.
        """
        shape = np.shape(theta)
        for what, values in (("error", error), ("weights", weights)):
            if values is not None and np.shape(values) != shape:
                raise ArgumentError(
                    f"{what} has shape {np.shape(values)}, theta has {shape}: they must agree"
                )
        readings = _flat(theta), _flat(error), None if weights is None else _flat(weights)
        if self._forgetting is None:
            self._sums.update(run, readings, threads)
        else:
            self._sums.update_fading(run, readings, threads, self._forgetting)
        return self

    def update_known(
        self,
        reference: NDArray[np.float64],
        indicated: NDArray[np.float64],
        *,
        argument: Argument = "reference",
        run: Hashable = None,
    ) -> int:
        """Add readings given by both angles, in one pass that omits missing ones.

        Parameters
        ----------
        reference, indicated : ndarray
            Contiguous vectors of one length; a reading is missing where either is not finite.
        argument : {"reference", "indicated"}
            The angle that the error is a function of.
        run : hashable, optional
            Label of the run.

        Returns
        -------
        int
            Readings that are known.
        """
        return self._sums.update_known(run, reference, indicated, argument == "indicated")

    @told_kinds
    def merge(self, other: Moments) -> Moments:
        """Add the readings of another accumulator over the same orders; runs go by label."""
        self._of_a_kind(other, "merge", "other: moments with forgetting cannot be merged")
        self._sums.merge(other._sums)
        return self

    @told_kinds
    def subtract(self, other: Moments) -> Moments:
        """Take away the readings of another accumulator that were added to this one before.

        The sums of the other readings remain, to within rounding: a window that moves along
        a log is the sum of its parts less the oldest.

        Parameters
        ----------
        other : Moments
            Over the same orders; its runs are among these by label.

        Returns
        -------
        Moments
            Itself.

        Raises
        ------
        ArgumentError
            Other orders, a run that is not here or has fewer readings, sums with forgetting.

        Examples
        --------
        >>> theta = np.linspace(0.0, 360.0, 500, endpoint=False)
        >>> first, both = Moments([1], period=360.0), Moments([1], period=360.0)
        >>> _ = first.update(theta, 0.1 * np.cos(np.radians(theta)))
        >>> _ = both.update(theta, 0.3 * np.cos(np.radians(theta))).merge(first)
        >>> both.subtract(first).solve().cosine.round(9)
        array([0.3])
        """
        forgets = "other: sums with forgetting cannot be subtracted"
        self._of_a_kind(other, "subtract", forgets)
        self._sums.subtract(other._sums)
        return self

    def _of_a_kind(self, other: Moments, verb: str, forgets: str) -> None:
        """Refuse sums that do not go with these."""
        if not isinstance(other, Moments):
            raise ArgumentError(f"other must be Moments, got {type(other).__name__}")
        if (self._shafts, self.period) != (other._shafts, other.period):
            raise ArgumentError(f"moments {verb} only if their orders, shafts and period agree")
        if self._forgetting is not None or other._forgetting is not None:
            raise ArgumentError(forgets)

    def __add__(self, other: Moments) -> Moments:
        if not isinstance(other, Moments):
            return NotImplemented
        return self.copy().merge(other)

    def __iadd__(self, other: Moments) -> Moments:
        return self.merge(other)

    def copy(self) -> Moments:
        """A separate accumulator with the same readings."""
        fresh = Moments.__new__(Moments)
        fresh._shafts, fresh._sums = self._shafts, self._sums.copy()
        fresh._forgetting = None if self._forgetting is None else self._forgetting.copy()
        return fresh

    def extremes(self, run: Hashable = None) -> NDArray[np.float64]:
        """Greatest and least angle and error in each segment of the turn with known readings.

        Returns
        -------
        ndarray, shape (segments, 4)
            Exact, of the readings that `update_known` added; angles within one turn of the
            base shaft, errors modulo a turn.
        """
        return self._sums.extremes(run)

    def spectrum(self, run: Hashable = None, highest: int | None = None) -> Spectrum:
        """All sums of one run: the input of order selection and of transforms.

        Of orders up to ``highest`` of the base shaft; those that were not accumulated are known
        to a part in 1e10 of the errors up to 2.8 times the highest that was.
        """
        return self._sums.spectrum(run, highest)

    @told_kinds
    def solve(self, orders: _Orders | None = None) -> MomentsFit:
        """Least-squares fit of some of the orders, or of all.

        Raises
        ------
        RankError
            The readings cannot separate the orders.
        ArgumentError
            Orders that were not accumulated.
        """
        wanted = self._shafts if orders is None else self._subset(orders)
        found = MomentsFit.of(self.solution(wanted), wanted, self.runs, self.period)
        if self._forgetting is None:
            return found
        return self._forgetting.widened(found, self.count)

    def solution(self, wanted: Sequence[ShaftOrders]) -> _core.Solution:
        """As `solve`, as the core gives it, and also of higher orders (see `spectrum`)."""
        return self._sums.solution(wanted)

    def _subset(self, orders: _Orders) -> list[ShaftOrders]:
        known = {shaft.name: shaft.cycles_per_turn for shaft in self._shafts}
        wanted = resolve_orders(orders, shafts=known)
        have = {(s.name, s.cycles_per_turn, k) for s in self._shafts for k in s.orders}
        for shaft in wanted:
            missing = [k for k in shaft.orders if (*shaft[:2], k) not in have]
            if missing:
                raise ArgumentError(
                    f"orders {missing} of shaft {shaft.name!r} were not accumulated"
                )
        return wanted

    def __getstate__(self) -> dict[str, Any]:
        return {
            "shafts": self._shafts,
            "period": self.period,
            "runs": self._sums.stored(),
            "forgetting": None if self._forgetting is None else self._forgetting.factor,
            "weights": {} if self._forgetting is None else self._forgetting.weights,
        }

    def __setstate__(self, state: dict[str, Any]) -> None:
        factor, self._shafts = state.get("forgetting"), state["shafts"]
        self._forgetting = None if factor is None else Forgetting(factor, state.get("weights"))
        self._sums = RunSums(state["period"], self._shafts)
        self._sums.restore(state["runs"])

    def __repr__(self) -> str:
        orders = sum(len(shaft.orders) for shaft in self._shafts)
        return f"<Moments of {orders} orders, {len(self.runs)} runs, {self.count} readings>"


def _flat(values: ArrayLike) -> NDArray[np.float64]:
    return np.ascontiguousarray(values, dtype=np.float64).reshape(-1)
