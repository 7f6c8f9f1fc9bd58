"""A measured function of one factor, where no named form fits it."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from itertools import pairwise
from typing import ClassVar, Final

import numpy as np

from ..errors import ArgumentError
from ..joint.pattern import JointPattern, line_sum
from ..joint.signals import Signals
from ..model.term import Term, line_values
from ..model.terms.curve import CurveTerm
from ..support.angles import from_arcsec
from ..support.arrays import Array
from ..support.suggestions import check_choice
from .effect import Effect

#: What each factor is at the readings, and what a term of it follows at run time.
VALUES: Final[Mapping[str, tuple[Callable[[Signals], Array | None], str]]] = {
    "place": (lambda signals: signals.degrees, "angle"),
    "direction": (lambda signals: signals.direction, "direction"),
    "speed": (lambda signals: signals.velocity, "velocity"),
    "load": (lambda signals: signals.torque, "torque"),
    "temperature": (lambda signals: signals.temperature, "temperature"),
    "current": (lambda signals: signals.current, "current"),
    "run_time": (lambda signals: signals.clock, ""),
}

#: Products with the place.
PRODUCTS: Final = tuple(f"{name}_place" for name in VALUES if name not in ("place", "run_time"))

#: Points of a period of the highest order that a pattern has.
POINTS: Final = 16

#: Part of the strongest line below which others are rounding.
_ROUNDING: Final = 1e-4


@dataclass(frozen=True)
class Curve(Effect):
    """An error that is a function of a factor, straight from point to point.

    ::

        ε = f(x)    or    ε = f(x) Σ_m sin(mθ + φ_m)

    Parameters
    ----------
    factor : str
        ``place``, ``direction``, ``speed``, ``load``, ``temperature``, ``current`` or
        ``run_time``; ``direction_place``, ``speed_place``, ``load_place``,
        ``temperature_place`` or ``current_place`` with orders.
    at : list of float
        Values of the factor, two or more, increasing: degrees, -1 and 1, deg/s, Nm, Celsius, A, s.
    value_arcsec : list of float
        f there; beyond the first and last one what it is there. A place that reaches from 0 to
        360 deg repeats.
    shaft : str
        Whose orders.
    orders, phase_deg : list of float
        m, in cycles of a turn of the shaft, and φ of a product with the place.
    """

    factor: str = field()  # type: ignore[misc]  # a curve's own, where a class of causes has one
    at: tuple[float, ...]
    value_arcsec: tuple[float, ...]
    shaft: str = "output"
    orders: tuple[float, ...] = ()
    phase_deg: tuple[float, ...] = ()

    kind: ClassVar[str] = CurveTerm.kind
    is_cause: ClassVar[bool] = False
    sentence: ClassVar[str] = (
        "The error follows a factor in a form without a name: the measured curve describes it"
    )

    def __post_init__(self) -> None:
        check_choice("effect 'curve': factor", self.factor, (*VALUES, *PRODUCTS))
        if len(self.at) != len(self.value_arcsec) or len(self.at) < 2:
            raise ArgumentError(
                "effect 'curve': at and value_arcsec must be equally long, of two points or more, "
                f"got {len(self.at)} and {len(self.value_arcsec)}"
            )
        if any(b <= a for a, b in pairwise(self.at)):
            raise ArgumentError(f"effect 'curve': at must increase, got {list(self.at)}")
        if len(self.orders) != len(self.phase_deg) or any(m <= 0.0 for m in self.orders):
            raise ArgumentError(
                "effect 'curve': orders must be positive, with as many phase_deg, got "
                f"{list(self.orders)} and {list(self.phase_deg)}"
            )
        if bool(self.orders) != (self.factor in PRODUCTS):
            raise ArgumentError(
                f"effect 'curve': a product with the place ({', '.join(PRODUCTS)}) has orders, and "
                f"nothing else has, got factor '{self.factor}' and orders {list(self.orders)}"
            )

    def signal(self, signals: Signals, around: JointPattern, rng: np.random.Generator) -> Array:
        x = self._values[0](signals)
        if x is None:
            return np.zeros(len(signals))
        if self._repeats:
            x = self.at[0] + (x - self.at[0]) % 360.0
        found = np.asarray(np.interp(x, self.at, self.value_arcsec))
        lines = self._lines(around.joint.shafts)
        return found * line_sum(signals.theta, lines) if lines else found

    @property
    def needs(self) -> tuple[str, ...]:  # type: ignore[override]
        return tuple({"temperature", "torque", "current"} & {self._values[1]})

    @property
    def not_at_run_time(self) -> str:  # type: ignore[override]
        return "" if self._values[1] else "a corrector does not know the time since its run began"

    def to_lines(self) -> Sequence[tuple[str, float]]:
        if not self._repeats:
            # The mean of both directions is a line of the pattern.
            is_line = self.factor == "direction_place" and sum(self.value_arcsec) != 0.0
            return tuple((self.shaft, m) for m in self.orders) if is_line else ()
        turn = np.linspace(0.0, 360.0, len(self.at) - 1, endpoint=False)
        lines = np.abs(np.fft.rfft(np.interp(turn, self.at, self.value_arcsec)))[1:]
        found = np.flatnonzero(lines > _ROUNDING * lines.max(initial=0.0))
        return tuple(("output", float(k + 1)) for k in found)

    def to_terms(self, period: float, shafts: Mapping[str, float]) -> tuple[Term, ...]:
        follows = self._values[1]
        if self.not_at_run_time or self._repeats:
            return ()
        lines = line_values(self._lines(shafts), period) if self.orders else {}
        unit = period / 360.0 if follows in ("velocity", "angle") else 1.0
        scale = 1.0 if self.orders else from_arcsec(1.0, period)
        at, values = unit * np.array(self.at), scale * np.array(self.value_arcsec)
        if follows in ("direction", "angle"):
            values -= 0.5 * (values[0] + values[-1])  # the pattern's
            values[-1] = -values[0]
        return (CurveTerm(follows, tuple(at.tolist()), tuple(values.tolist()), **lines),)

    @property
    def _values(self) -> tuple[Callable[[Signals], Array | None], str]:
        return VALUES[self.factor.removesuffix("_place")]

    @property
    def _repeats(self) -> bool:
        return self.factor == "place" and self.at[-1] - self.at[0] == 360.0

    def _lines(self, shafts: Mapping[str, float]) -> tuple[tuple[float, float, float], ...]:
        if self.shaft != "output" and self.shaft not in shafts:
            raise ArgumentError(f"effect 'curve': the joint has no shaft '{self.shaft}'")
        cycles = shafts.get(self.shaft, 1.0)
        pairs = zip(self.orders, self.phase_deg, strict=True)
        return tuple((m * cycles, 1.0, phase) for m, phase in pairs)
