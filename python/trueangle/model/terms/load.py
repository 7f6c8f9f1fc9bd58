"""What follows the load: springs, gear lines that grow with the torque, the motor's current."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

from ...support.suggestions import check_choice
from .. import forms
from ..forms import Form
from ..term import Term


@dataclass(frozen=True, repr=False)
class TorsionalComplianceTerm(Term):
    """Wind-up in proportion to the torque.

    ::

        ε = τ [c + Σ_m A_m cos mφ + B_m sin mφ]

    Parameters
    ----------
    per_Nm : float
        c = 1/K, angle per newton metre.
    orders, cosine, sine : sequence of float
        Lines per newton metre: order 1 where the torque states the load of an arm and
        not its moment.
    """

    per_Nm: float = 0.0
    orders: tuple[float, ...] = ()
    cosine: tuple[float, ...] = ()
    sine: tuple[float, ...] = ()

    kind: ClassVar[str] = "torsional_compliance"
    odd: ClassVar[tuple[str, ...]] = ("per_Nm", "cosine")
    signals: ClassVar[tuple[str, ...]] = ("torque",)

    def check(self) -> None:
        self._check_lines()

    def forms(self) -> tuple[Form, ...]:
        return (forms.Scaled("torque", self.per_Nm, self.lines),)


@dataclass(frozen=True, repr=False)
class StiffeningComplianceTerm(Term):
    """A spring that stiffens under the moment m.

    ::

        ε = c₁ m + c₃ m³ + c_k sign(m) max(|m| - m_k, 0)

    where m is the torque or, with ``gravity``, ``τ sin(φ - φ_g)``.

    Parameters
    ----------
    per_Nm, per_Nm3 : float
        ``c₁`` and ``c₃``.
    beyond_knee_per_Nm, knee_Nm : float
        ``c_k`` and the knee ``m_k ≥ 0``.
    gravity : float, optional
        ``φ_g``, the angle at which the load has no moment.
    """

    per_Nm: float = 0.0
    per_Nm3: float = 0.0
    beyond_knee_per_Nm: float = 0.0
    knee_Nm: float = 0.0
    gravity: float | None = None

    kind: ClassVar[str] = "stiffening_compliance"
    signals: ClassVar[tuple[str, ...]] = ("torque",)

    @property
    def odd(self) -> tuple[str, ...]:  # type: ignore[override]
        # The moment of a weight changes sign with the angle, and the wind-up with it.
        linear = ("per_Nm", "per_Nm3", "beyond_knee_per_Nm")
        return linear if self.gravity is None else ("gravity",)

    def check(self) -> None:
        if self.knee_Nm < 0.0:
            raise self._out_of_range("knee_Nm", "0 or more")

    def forms(self) -> tuple[Form, ...]:
        return (
            forms.Spring(
                "torque",
                self.per_Nm,
                self.per_Nm3,
                self.beyond_knee_per_Nm,
                self.knee_Nm,
                self.gravity,
            ),
        )


@dataclass(frozen=True, repr=False)
class LoadDependentGearErrorTerm(Term):
    """Gear lines that grow with the torque.

    ::

        ε = l Σ_m A_m cos mφ + B_m sin mφ,    l = τ or |τ|

    Parameters
    ----------
    orders, cosine, sine : sequence of float
        Output orders (positive) and coefficients per newton metre.
    torque : {"signed", "absolute"}
    """

    orders: tuple[float, ...]
    cosine: tuple[float, ...]
    sine: tuple[float, ...]
    torque: str = "signed"

    kind: ClassVar[str] = "load_dependent_gear_error"
    odd: ClassVar[tuple[str, ...]] = ("cosine",)
    signals: ClassVar[tuple[str, ...]] = ("torque",)

    def check(self) -> None:
        self._check_lines()
        check_choice(f"{self.kind}: torque", self.torque, ("signed", "absolute"))

    def forms(self) -> tuple[Form, ...]:
        absolute = self.torque == "absolute"
        return (forms.Scaled("torque", lines=self.lines, absolute=absolute),)


@dataclass(frozen=True, repr=False)
class CurrentCouplingTerm(Term):
    """An error in proportion to the motor's current.

    ::

        ε = i (a₀ + Σ_m A_m cos mφ + B_m sin mφ)

    Parameters
    ----------
    per_A : float
        ``a₀``, angle per ampere.
    orders, cosine, sine : sequence of float
        Output orders (positive) and coefficients per ampere.
    """

    per_A: float = 0.0
    orders: tuple[float, ...] = ()
    cosine: tuple[float, ...] = ()
    sine: tuple[float, ...] = ()

    kind: ClassVar[str] = "current_coupling"
    odd: ClassVar[tuple[str, ...]] = ("per_A", "cosine")
    signals: ClassVar[tuple[str, ...]] = ("current",)

    def check(self) -> None:
        self._check_lines()

    def forms(self) -> tuple[Form, ...]:
        return (forms.Scaled("current", self.per_A, self.lines),)
