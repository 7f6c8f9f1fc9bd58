"""The joint: which shafts turn how often, and which orders they can leave at the output."""

from __future__ import annotations

import math
from dataclasses import dataclass

from ..errors import ArgumentError
from ..support.argumentkinds import all_of_type, told_kinds
from ..support.suggestions import check_choice
from .declared import Bearing, DeclaredShaft, Head
from .members import FIXED_MEMBERS
from .shafts import shaft_cycles

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
            wanted = f"a {kind.__name__} of trueangle.joint.declared"
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
