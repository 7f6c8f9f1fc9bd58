"""What follows a place, a temperature or another joint."""

from __future__ import annotations

from dataclasses import dataclass, replace
from typing import ClassVar, Self

from ...errors import ArgumentError
from ...support.signals import COUPLED
from .. import forms
from ..forms import Form
from ..term import Term


@dataclass(frozen=True, repr=False)
class ScaleErrorTerm(Term):
    """A wrong ratio, over the travel on which it was measured.

    ::

        ε = s [min(max(φ, a), b) - (a + b)/2]

    with ``φ`` over the turns, not modulo one. Beyond the travel it keeps the value of
    its end: where the ratio is wrong there too, put it right where counts are turned into angles.

    Parameters
    ----------
    relative_error : float
        s, below 1 in size.
    start, stop : float
        a < b.
    """

    relative_error: float
    start: float
    stop: float

    kind: ClassVar[str] = "scale_error"

    @property
    def is_periodic(self) -> bool:
        return False

    @property
    def travel(self) -> tuple[float, float]:
        return self.start, self.stop

    def check(self) -> None:
        if not -1.0 < self.relative_error < 1.0:
            raise self._out_of_range("relative_error", "between -1 and 1")
        if self.stop <= self.start:
            raise self._out_of_range("stop", f"beyond start ({self.start!r})")

    def mirrored(self) -> Self:
        return replace(self, start=-self.stop, stop=-self.start)

    def forms(self) -> tuple[Form, ...]:
        return (forms.Ramp(self.relative_error, self.start, self.stop),)


@dataclass(frozen=True, repr=False)
class LocalDefectTerm(Term):
    """A damaged tooth, pole or graduation line, the same in every pass.

    ::

        ε = h e^(-(a - c)²/2w²),    a = fφ

    with a the angle of a shaft that turns f times per output turn, wrapped around the
    place.

    Parameters
    ----------
    place, width : float
        c and w (one standard deviation, positive) as angles of that shaft.
    height : float
        h.
    cycles_per_turn : float
        f > 0.
    """

    place: float
    width: float
    height: float
    cycles_per_turn: float = 1.0

    kind: ClassVar[str] = "local_defect"
    odd: ClassVar[tuple[str, ...]] = ("place", "height")

    @property
    def is_periodic(self) -> bool:
        return self.cycles_per_turn == int(self.cycles_per_turn)

    def check(self) -> None:
        if self.width <= 0.0:
            raise self._out_of_range("width", "positive")
        if self.cycles_per_turn <= 0.0:
            raise self._out_of_range("cycles_per_turn", "positive")

    def forms(self) -> tuple[Form, ...]:
        return (forms.Bump(self.place, self.width, self.height, self.cycles_per_turn),)


@dataclass(frozen=True, repr=False)
class ThermalDriftTerm(Term):
    """Error in proportion to ``ΔT = T - T₀``.

    ::

        ε = ΔT [k₀ + k_p p(φ) + Σ_m A_m cos mφ + B_m sin mφ]

    with p the harmonics of the model without their constant.

    Parameters
    ----------
    zero_per_K : float
        ``k₀``, angle per kelvin.
    pattern_per_K : float
        ``k_p``, relative growth of the harmonics per kelvin.
    orders : sequence of float
        Output orders m of the lines, positive.
    cosine, sine : sequence of float
        ``A_m, B_m``, angle per kelvin.
    reference_C : float
        ``T₀``, where the harmonics hold, degrees Celsius.
    """

    zero_per_K: float = 0.0
    pattern_per_K: float = 0.0
    orders: tuple[float, ...] = ()
    cosine: tuple[float, ...] = ()
    sine: tuple[float, ...] = ()
    reference_C: float = 20.0

    kind: ClassVar[str] = "thermal_drift"
    odd: ClassVar[tuple[str, ...]] = ("zero_per_K", "cosine")
    signals: ClassVar[tuple[str, ...]] = ("temperature",)

    def check(self) -> None:
        self._check_lines()

    @property
    def is_built_on_harmonics(self) -> bool:  # type: ignore[override]
        return self.pattern_per_K != 0.0

    def forms(self) -> tuple[Form, ...]:
        return (
            forms.Scaled(
                "temperature", self.zero_per_K, self.lines, self.pattern_per_K, self.reference_C
            ),
        )


@dataclass(frozen=True, repr=False)
class JointCouplingTerm(Term):
    """A share of another joint's indicated angle.

    ::

        ε = c θ_j

    with ``θ_j`` as that joint counts its turns, in the unit of the model: the signal
    ``coupled_JOINT``, which `trueangle.Robot` takes from its own angles.

    Parameters
    ----------
    joint : str
        The other joint, j.
    factor : float
        c, degrees per degree.
    """

    joint: str
    factor: float

    kind: ClassVar[str] = "joint_coupling"
    odd: ClassVar[tuple[str, ...]] = ("factor",)

    @property
    def needs(self) -> tuple[str, ...]:
        return (COUPLED + self.joint,)

    def check(self) -> None:
        if not isinstance(self.joint, str) or not self.joint:
            raise ArgumentError(
                f"{self.kind}: joint must be the name of the other joint, got {self.joint!r}"
            )

    def forms(self) -> tuple[Form, ...]:
        return (forms.Scaled(COUPLED + self.joint, self.factor),)
