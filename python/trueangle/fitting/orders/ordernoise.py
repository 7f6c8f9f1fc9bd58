"""The noise that orders have to stand out of: common to all, near each, and each order's own."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from typing import Any, Final

import numpy as np

from ...support.arrays import Array
from ..uncertainty import CovarianceKind
from .evidence import fit_chosen_orders
from .harmonicsums import HarmonicSums
from .noise import ReadingVariance, remaining_scatter, run_scatter
from .noisespectrum import NoiseSpectrum, noise_spectrum
from .significance import examine_orders

#: Rounding of a sum.
_EPSILON = float(np.finfo(np.float64).eps)

#: Least degrees of freedom for which a noise estimate is used on its own.
_ENOUGH_DOF: Final = 20

#: Order below which noise that one pass tells is taken to be no more: it forgets within an
#: eighth of a turn (its memory in turns is 1 / (pi x this)). What is slower is not told from an
#: error of the joint by orders beside it ...
_SLOWEST: Final = 2.5
#: ... and is neither taken for noise where there is so many times more at this order than at
#: twice of it: half the steepness of noise whose corner is there.
_SLOWER: Final = 2.0

#: Belief in white noise below which noise is one with a memory.
LEAST_BELIEF: Final = 0.02

#: Chance of noise near an order from which that order is part of it.
_OFTEN: Final = 0.05


class OrderNoise:
    """Noise of the readings of some runs, as the search for orders asks for it.

    Parameters
    ----------
    sums : HarmonicSums
    free : int
        Readings less zeros.
    repeats : ReadingVariance or None
        Noise from readings at the same position.
    covariance : {"auto", "white", "cluster", "hac"}
    rounding : float
        Variance of one reading by what a coarse sensor repeats at each position, of which no
        scatter tells.
    independent : float
        Part of the orders that are independent of each other: less than 1 over part of a turn.
    passes : HarmonicSums or None
        Turns that a single run took one after the other: over a whole turn they tell the noise as
        runs do.
    closed : bool
        Whether the error is the same after a turn. Else its lines are seen at every order.
    """

    def __init__(
        self,
        sums: HarmonicSums,
        free: int,
        repeats: ReadingVariance | None = None,
        covariance: CovarianceKind = "auto",
        rounding: float = 0.0,
        independent: float = 1.0,
        passes: HarmonicSums | None = None,
        closed: bool = True,
    ) -> None:
        #: What tells the scatter of an order: runs, or the passes of one.
        self.repeated = sums if sums.units > 1 else passes
        self.sums, self.free, self.repeats = sums, free, repeats
        self.rounding, self.independent, self.closed = rounding, independent, closed
        #: What orders have to stand out of.
        self.kind = covariance
        #: Orders that are no noise, where the others tell it.
        self.lines: list[int] = []
        #: Orders that may be real and are not chosen: the residual of the chosen ones holds them.
        self.barred: list[int] = []
        #: What `near` was asked last, and told: the orders that a search ends with are asked twice.
        self._asked: Any = None
        self._told: tuple[NoiseSpectrum, Array | None]

    @property
    def by_orders(self) -> bool:
        """Whether orders are asked what noise there is.

        Where a line is seen at the orders beside it these tell no noise: over part of a turn, and
        where the error does not close.
        """
        if self.kind == "auto":
            return self.repeated is None and self.closed and self.independent >= 1.0
        return self.kind == "hac"

    def of_reading(self, chosen: Sequence[int]) -> ReadingVariance:
        """Repeats, or the residual of all candidates, or of the chosen orders.

        Real orders that may not be retained disturb the others as noise does: the residual
        of the chosen ones holds them.
        """
        if self.barred:
            dof = max(1, self.free - 2 * len(chosen))
            return ReadingVariance(fit_chosen_orders(self.sums, chosen)[2] / dof, dof, "model")
        repeats = self.repeats
        # Copies of the same readings repeat to the last digit, which says nothing of noise.
        known = repeats is not None and repeats.degrees_of_freedom >= _ENOUGH_DOF
        if repeats is not None and known and repeats.variance > 0.0:
            return repeats
        # Of readings without noise rounding is left, which sums of squares do not resolve.
        rounding = _EPSILON * self.sums.total()[2]
        everything = self.sums.orders.size
        if self.free - 2 * everything >= max(_ENOUGH_DOF, 2 * everything):
            _, _, squares = fit_chosen_orders(self.sums, range(everything))
            dof = self.free - 2 * everything
            return ReadingVariance(max(squares, rounding) / dof, dof, "residual")
        dof = max(1, self.free - 2 * len(chosen))
        squares = fit_chosen_orders(self.sums, chosen)[2]
        return ReadingVariance(max(squares, rounding) / dof, dof, "model")

    def white(self, noise: ReadingVariance) -> NoiseSpectrum:
        """That of a reading at every order."""
        variance, freedom = noise.variance + self.rounding, float(noise.degrees_of_freedom)
        return NoiseSpectrum.flat(variance, freedom, self.sums.orders.size)

    def near(self, chosen: Sequence[int]) -> tuple[NoiseSpectrum, Array | None]:
        """Noise near each order, and each order's own scatter between runs."""
        asked = (self.kind, *chosen), tuple(self.lines), tuple(self.barred)
        if asked != self._asked:
            self._asked, self._told = asked, self._near(chosen)
        return self._told

    def _near(self, chosen: Sequence[int]) -> tuple[NoiseSpectrum, Array | None]:
        if self.kind == "hac":
            return self.beside({*self.lines, *chosen}) or self.white(self.of_reading(chosen)), None
        if self.repeated is None or self.kind == "white":
            return self.white(self.of_reading(chosen)), None
        every = range(self.sums.orders.size)
        scatter = run_scatter(self.repeated, chosen, every) + self.rounding
        freedom = 2 * (self.repeated.units - 1)
        told = noise_spectrum(self.sums.orders, scatter, freedom, self.independent)
        return told or self.white(self.of_reading(chosen)), scatter

    @property
    def own_freedom(self) -> int:
        """Degrees of freedom of each order's own scatter."""
        return 1 if self.repeated is None else 2 * (self.repeated.units - 1)

    def beside(self, lines: Collection[int]) -> NoiseSpectrum | None:
        """What the orders that are no lines tell of noise that forgets within a turn."""
        told = remaining_scatter(self.sums, sorted(lines)) + self.rounding
        return noise_spectrum(self.sums.orders, told, 2, self.independent, _SLOWEST)

    def remembers(self, lines: Collection[int]) -> bool:
        """Whether orders that are no lines show that noise remembers, and forgets within a turn."""
        noise = self.beside(lines)
        if noise is None or noise.white > LEAST_BELIEF:
            return False
        low, high = np.interp([_SLOWEST, 2.0 * _SLOWEST], self.sums.orders, noise.variance)
        return bool(low < _SLOWER * high)

    def settle(self, lines: Sequence[int], forced: Collection[int]) -> None:
        """Ask the orders beside these; those of them that noise makes often are no lines after all.

        They tell the noise as others do. The ``forced`` ones are lines in any case.
        """
        while True:
            self.lines = list(lines)
            noise, _ = self.near(())
            test = examine_orders(self.sums, lines, lines, noise.among(lines), None)
            far = test.log_p < math.log(_OFTEN)
            lines = [i for i, out in zip(lines, far, strict=True) if out or i in forced]
            if len(lines) == len(self.lines):
                return
