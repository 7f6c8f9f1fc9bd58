"""What a joint declares in addition to its gear: further shafts, bearings, reading heads."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from ..errors import ArgumentError

#: Names that belong to the output and its gear.
_TAKEN = ("output", "motor", "wave_generator")


@dataclass(frozen=True)
class DeclaredShaft:
    """A further shaft, by its speed or by the teeth that it passes in one output turn.

    Parameters
    ----------
    name : str
    cycles_per_turn : float, optional
        Turns of the shaft per turn of the output; any positive real.
    teeth : int, optional
        Teeth of the output's wheel: a worm of one thread turns once for each, and the
        meeting of any gear repeats once for each. One of the two is given.

    Examples
    --------
    >>> DeclaredShaft("worm", teeth=144).cycles
    144.0
    """

    name: str
    cycles_per_turn: float | None = None
    teeth: int | None = None

    def __post_init__(self) -> None:
        if not self.name or self.name in _TAKEN:
            raise ArgumentError(
                f"name must be a shaft's own, other than {', '.join(_TAKEN)}; got {self.name!r}"
            )
        if (self.cycles_per_turn is None) == (self.teeth is None):
            raise ArgumentError(f"shaft {self.name!r} needs either cycles_per_turn or teeth")
        if not (0.0 < self.cycles < math.inf):
            raise ArgumentError(
                f"shaft {self.name!r}: cycles_per_turn or teeth must be positive, "
                f"got {self.cycles:g}"
            )

    @property
    def cycles(self) -> float:
        """Turns (or teeth met) per output turn."""
        return float(self.teeth if self.cycles_per_turn is None else self.cycles_per_turn)  # type: ignore[arg-type]

    def explanation(self, order: int) -> str:
        """What a line of this order of the shaft is."""
        times = {1: "once", 2: "twice"}.get(order, f"{order} times")
        what = f"{self.name}, {times} per turn"
        return what if self.teeth is None else f"{what} (wheel of {self.teeth} teeth)"


@dataclass(frozen=True)
class Bearing:
    """A rolling bearing, whose lines have orders that are not whole.

    With n balls and x the ratio of ball to pitch diameter (times the cosine of the contact
    angle), per turn of the shaft: cage ``(1-x)/2``, outer race ``n(1-x)/2``, inner
    race ``n(1+x)/2``, ball ``(1-x²)/(2x)``. Slip moves them by a percent or two.

    Parameters
    ----------
    shaft : str
    balls : int
    diameter_ratio : float

    Examples
    --------
    >>> {name: round(rate, 3) for name, rate in Bearing("motor", 9, 0.2).lines()}
    {'cage': 0.4, 'outer race': 3.6, 'inner race': 5.4, 'ball': 2.4}
    """

    shaft: str
    balls: int
    diameter_ratio: float

    def __post_init__(self) -> None:
        if self.balls < 3:
            raise ArgumentError(f"balls must be at least 3, got {self.balls!r}")
        if not 0.0 < self.diameter_ratio < 1.0:
            raise ArgumentError(
                f"diameter_ratio must lie between 0 and 1, got {self.diameter_ratio!r}"
            )

    def lines(self) -> Iterator[tuple[str, float]]:
        """What rolls, and its cycles per turn of the shaft."""
        x, n = self.diameter_ratio, self.balls
        yield "cage", 0.5 * (1.0 - x)
        yield "outer race", 0.5 * n * (1.0 - x)
        yield "inner race", 0.5 * n * (1.0 + x)
        yield "ball", 0.5 * (1.0 - x * x) / x


@dataclass(frozen=True)
class Head:
    """One of several reading heads on the joint's disc.

    Parameters
    ----------
    angle_deg : float
        Where it is. It reads ``theta + angle`` with the disc's error there; a head at 0
        is the joint's own.

    Examples
    --------
    >>> Head(119.2).angle_deg
    119.2
    """

    angle_deg: float

    def __post_init__(self) -> None:
        if not abs(self.angle_deg) <= 360.0:
            raise ArgumentError(f"angle_deg must be within one turn, got {self.angle_deg!r}")
