"""The core's sums over the readings of every run, which threads share by turns, and those turns."""

from __future__ import annotations

import os
import threading
from collections.abc import Hashable, Mapping, Sequence

import numpy as np

import trueangle._core as _core

from ..errors import ArgumentError
from ..joint.shafts import ShaftOrders
from ..support.arrays import Array
from .forgetting import Forgetting
from .momentsfit import Spectrum


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
