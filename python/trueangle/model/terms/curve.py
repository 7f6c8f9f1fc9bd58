"""A function of one signal by points: what an error follows that no named form fits."""

from __future__ import annotations

from dataclasses import dataclass, replace
from itertools import pairwise
from typing import ClassVar, Self

from ...errors import ArgumentError
from ...support.suggestions import check_choice
from .. import forms
from ..forms import Form, Lines, Scaled
from ..term import Term

#: What a curve may follow at run time.
FOLLOWED = ("velocity", "torque", "temperature", "current", "direction", "angle")

#: What is one function with the pattern: a constant in it is the pattern's.
_BESIDE_PATTERN = ("direction", "angle")


@dataclass(frozen=True, repr=False)
class CurveTerm(Term):
    """Straight lines between points, times lines of the angle where there are any.

    ::

        ε = f(x)    or    ε = f(x) Σ_m A_m cos mφ + B_m sin mφ

    with f straight from point to point, and beyond the first and last one what it is there.

    Parameters
    ----------
    follows : {"velocity", "torque", "temperature", "current", "direction", "angle"}
        x: the velocity in the model's unit per second, the torque in Nm, the temperature in
        degrees Celsius, the current in A, the direction of travel, -1 or 1, or the angle over the
        turns.
    at : sequence of float
        Values of x, two or more, increasing.
    values : sequence of float
        f there: an angle, or with lines a factor of them. Of the direction and of the angle the
        first and the last one are opposite: a constant is the pattern's.
    orders, cosine, sine : sequence of float
        Output orders (positive) and coefficients.

    Notes
    -----
    The compiled core adds one absolute value a point, and a ramp a piece of the angle::

        f(x) = c + ½ Σ_j (s_j - s_(j-1)) |x - x_j|,    s: slopes, 0 beyond the ends

    which rounds to about 1e-16 of the largest slope times the range.
    """

    follows: str
    at: tuple[float, ...]
    values: tuple[float, ...]
    orders: tuple[float, ...] = ()
    cosine: tuple[float, ...] = ()
    sine: tuple[float, ...] = ()

    kind: ClassVar[str] = "curve"
    optional: ClassVar[tuple[str, ...]] = ("orders", "cosine", "sine")

    def check(self) -> None:
        self._check_lines()
        check_choice(f"{self.kind}: follows", self.follows, FOLLOWED)
        if len(self.at) != len(self.values) or len(self.at) < 2:
            raise ArgumentError(
                f"{self.kind}: at and values must be equally long, of two points or more, got "
                f"{len(self.at)} and {len(self.values)}"
            )
        if any(b <= a for a, b in pairwise(self.at)):
            raise self._out_of_range("at", "increasing")
        if self.follows == "direction" and self.at != (-1.0, 1.0):
            raise self._out_of_range("at", "[-1, 1] of the direction")
        if self.follows == "angle" and self.orders:
            raise self._out_of_range("orders", "none of a function of the angle")
        if self.follows in _BESIDE_PATTERN and self.values[0] != -self.values[-1]:
            raise self._out_of_range("values", "opposite at the first and the last point")

    @property
    def follows_travel(self) -> bool:  # type: ignore[override]
        """The direction is kept from sample to sample."""
        return self.follows == "direction"

    @property
    def is_periodic(self) -> bool:
        return self.follows != "angle" and super().is_periodic

    @property
    def travel(self) -> tuple[float, float] | None:
        return (self.at[0], self.at[-1]) if self.follows == "angle" else None

    @property
    def needs(self) -> tuple[str, ...]:
        return () if self.follows == "angle" else (self.follows,)

    def mirrored(self) -> Self:
        at, values = self.at, self.values
        if self.follows in ("velocity", *_BESIDE_PATTERN):
            at, values = tuple(-x for x in reversed(at)), tuple(reversed(values))
        if self.orders:
            return replace(self, at=at, values=values, cosine=tuple(-a for a in self.cosine))
        return replace(self, at=at, values=tuple(-y for y in values))

    def forms(self) -> tuple[Form, ...]:
        if self.follows == "direction":
            half = self.values[1]
            return (forms.Play(0.0 if self.orders else half, self._times(half)),)
        pieces = list(zip(pairwise(self.at), pairwise(self.values), strict=True))
        slopes = [(y - x) / (b - a) for (a, b), (x, y) in pieces]
        if self.follows == "angle":
            both = zip(slopes, pairwise(self.at), strict=True)
            return tuple(forms.Ramp(slope, *ends) for slope, ends in both if slope)
        bends = [0.5 * (after - before) for before, after in pairwise((0.0, *slopes, 0.0))]
        first, last = self.at[0], self.at[-1]
        constant = self.values[0] - sum(
            bend * (at - first) for bend, at in zip(bends, self.at, strict=True)
        )
        level = constant / (last - first)
        return (
            *(self._bent(at, bend) for at, bend in zip(self.at, bends, strict=True) if bend),
            # Two straight lines of one slope differ by a constant.
            *((self._straight(first, level), self._straight(last, -level)) if level else ()),
        )

    def _bent(self, at: float, level: float) -> Form:
        return self._straight(at, level)._replace(absolute=True)

    def _straight(self, at: float, level: float) -> Scaled:
        own = 0.0 if self.orders else level
        return Scaled(self.follows, own, self._times(level), origin=at)

    def _times(self, factor: float) -> Lines:
        return tuple((m, factor * a, factor * b) for m, a, b in self.lines)
