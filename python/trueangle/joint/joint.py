"""The joint: which shafts turn how often, and which orders they can leave at the output."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass

from ..errors import ArgumentError
from ..joint import FIXED_MEMBERS
from ..support.argumentkinds import all_of_type, told_kinds
from ..support.suggestions import check_choice
from .shafts import shaft_cycles

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


ENCODER_SIDES = ("motor", "output")

#: Multiples of a declared shaft that are expected of it.
DECLARED_ORDERS = (1, 2, 3, 4)

#: Heads on one disc, at most: columns ``head1`` to ``head99``.
MOST_HEADS = 99

#: Share of its order by which slip moves a bearing's line.
SLIP = 0.02


@told_kinds
@dataclass(frozen=True)
class Joint:
    """Geometry of one joint.

    Parameters
    ----------
    gear_ratio : float
        Motor turns per output turn; need not be an integer; negative where the motor turns the
        other way.
    fixed_member : {"circular_spline", "flexspline", "none"}
        The member of the strain wave gear held by the housing; "none" is a direct drive.
    encoder_side : {"motor", "output"}
        The shaft that carries the joint's own encoder.
    pole_pairs : int
        Electrical periods of the encoder in one turn of its shaft.
    declared : tuple of DeclaredShaft
        Further shafts: a worm, a belt, the wheels of a gear train.
    bearings : tuple of Bearing
    heads : tuple of Head
        Reading heads on the disc, each with a separate column; none for the usual single head.

    Examples
    --------
    >>> Joint(100.0, "circular_spline", "motor").shafts["wave_generator"]
    101.0
    """

    gear_ratio: float = 1.0
    fixed_member: str = "none"
    encoder_side: str = "output"
    pole_pairs: int = 1
    declared: tuple[DeclaredShaft, ...] = ()
    bearings: tuple[Bearing, ...] = ()
    heads: tuple[Head, ...] = ()

    def __post_init__(self) -> None:
        for name, kind in (("declared", DeclaredShaft), ("bearings", Bearing), ("heads", Head)):
            wanted = f"a {kind.__name__} of trueangle.joint.joint"
            found: tuple[object, ...] = all_of_type(name, getattr(self, name), kind, wanted)
            object.__setattr__(self, name, found)
        check_choice("fixed_member", self.fixed_member, FIXED_MEMBERS)
        shaft_cycles(self.gear_ratio, self.fixed_member)  # rejects 0 and a generator at rest
        check_choice("encoder_side", self.encoder_side, ENCODER_SIDES)
        if self.pole_pairs < 1:
            raise ArgumentError(f"pole_pairs must be at least 1, got {self.pole_pairs!r}")
        names = [shaft.name for shaft in self.declared]
        if len(set(names)) < len(names):
            raise ArgumentError(f"shafts are declared twice: {', '.join(names)}")
        if len(self.heads) > MOST_HEADS:
            raise ArgumentError(f"at most {MOST_HEADS} heads, got {len(self.heads)}")
        for bearing in self.bearings:
            self.output_order(bearing.shaft, 1.0)

    @property
    def shafts(self) -> dict[str, float]:
        """Turns of each shaft in one turn of the output, by name.

        The wave generator is counted against the output member: ``gear_ratio + 1``
        with the circular spline fixed, ``gear_ratio - 1`` with the flexspline fixed.
        """
        further = {shaft.name: shaft.cycles for shaft in self.declared}
        if self.fixed_member == "none" and self.gear_ratio == 1.0:
            return {"output": 1.0} | further
        return shaft_cycles(self.gear_ratio, self.fixed_member) | further

    def output_order(self, shaft: str, order: float) -> float:
        """Cycles per output turn of ``order`` of ``shaft``."""
        turns = self.shafts
        return order * turns[check_choice("shaft", shaft, turns)]

    def gear_orders(self) -> list[tuple[str, int]]:
        """Orders a gear and its motor-side encoder are known to leave: (shaft, order).

        Motor orders 1 to 4 and those of the encoder's pole pairs, wave generator
        orders 1, 2 and 4.
        """
        found = []
        if "motor" in self.shafts:
            poles = {k * self.pole_pairs for k in (1, 2, 3, 4)} if self.pole_pairs <= 8 else set()
            found += [("motor", k) for k in sorted({1, 2, 3, 4} | poles)]
        if "wave_generator" in self.shafts:
            found += [("wave_generator", k) for k in (1, 2, 4)]
        found += [(shaft.name, k) for shaft in self.declared for k in DECLARED_ORDERS]
        return found

    def bearing_lines(self, order: float) -> list[str]:
        """Lines of bearings that lie, allowing for slip, at an output order."""
        return [
            f"bearing on {bearing.shaft.replace('_', ' ')}: {what}"
            for bearing in self.bearings
            for what, rate in bearing.lines()
            if abs(order - (line := rate * self.shafts[bearing.shaft])) <= SLIP * line
        ]

    def name_order(self, order: float, tolerance: float = 1e-6) -> tuple[str, int] | None:
        """The shaft that an output order belongs to, the slowest name last: (shaft, order).

        None where ``order`` is no whole multiple of any shaft.
        """
        for shaft in ("motor", "wave_generator", *self._slow_last, "output"):
            cycles = self.shafts.get(shaft)
            if cycles is None:
                continue
            multiple = order / cycles
            if not math.isfinite(multiple):
                continue
            k = round(multiple)
            low_multiple = shaft == "output" or k <= 8 * self.pole_pairs
            if k >= 1 and low_multiple and abs(order - k * cycles) <= tolerance * max(order, 1.0):
                return shaft, k
        return None

    @property
    def _slow_last(self) -> list[str]:
        """Declared shafts, the fastest first."""
        return [shaft.name for shaft in sorted(self.declared, key=lambda s: -s.cycles)]

    def explanations(self, order: float, tolerance: float = 1e-6) -> list[str]:
        """Every physical explanation on record for a line at an output order."""
        found: list[str] = []
        near = tolerance * max(order, 1.0)
        motor = self.shafts.get("motor")
        generator = self.shafts.get("wave_generator")
        encoder = motor if (self.encoder_side == "motor" and motor) else 1.0
        if abs(order - encoder) <= near:
            found.append("eccentricity of the encoder's magnet or scale")
        if abs(order - 2.0 * encoder) <= near:
            found.append("encoder displaced or tilted from the axis, or ellipticity of its scale")
        for k, what in (
            (1, "offset of the sine and cosine signals"),
            (2, "gain mismatch or quadrature error of the sine and cosine signals"),
            (3, "second harmonic in the sine and cosine signals"),
            (4, "third or fifth harmonic in the sine and cosine signals"),
        ):
            if abs(order - k * self.pole_pairs * encoder) <= near:
                found.append(f"interpolation error: {what}")
        fourth = 4.0 * self.pole_pairs * encoder
        times = round(order / fourth)
        if 2 <= times <= 8 and abs(order - times * fourth) <= near:
            found.append(f"harmonic {times} of the interpolation error of order 4")
        if generator is not None and motor is not None:
            if min(abs(order - motor), abs(order - generator)) <= near:
                found.append("wave generator, once per turn: eccentricity, bearing")
            if min(abs(order - 2.0 * motor), abs(order - 2.0 * generator)) <= near:
                found.append("wave generator, twice per turn: meeting the teeth of a spline")
            if min(abs(order - 4.0 * motor), abs(order - 4.0 * generator)) <= near:
                found.append("wave generator, four times per turn: its shape")
        found += [
            shaft.explanation(k)
            for shaft in self.declared
            for k in DECLARED_ORDERS
            if abs(order - k * shaft.cycles) <= near
        ]
        found += self.bearing_lines(order)
        if motor is not None and not found:
            multiple = order / motor
            if multiple > 0.5 and abs(multiple - round(multiple)) * motor <= near:
                found.append(f"motor-side order {round(multiple)}: graduation of the scale")
        if abs(order - 1.0) <= near and encoder != 1.0:
            found.append("eccentricity at the output: spline, bearing, or the reference's coupling")
        if abs(order - 2.0) <= near and encoder != 1.0:
            found.append("misaligned coupling or ellipticity at the output")
        if not found:
            found.append("an error of this order with no standard cause for this joint")
        return found
