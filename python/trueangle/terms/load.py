"""Effects of torque: wind-up, stiffening springs, gear lines that grow with load."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self

from .term import Term, from_arcsec, line_values

__all__ = ["LoadDependentGearError", "StiffeningCompliance", "TorsionalCompliance"]


@dataclass(frozen=True)
class TorsionalCompliance(Term):
    r"""Wind-up in proportion to the torque.

    .. math:: \varepsilon = \tau\,\bigl[c + \sum_m A_m \cos m\varphi + B_m \sin m\varphi\bigr]

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
    signals: ClassVar[tuple[str, ...]] = ("torque",)

    def check(self) -> None:
        self._check_lines()

    @classmethod
    def from_effect(cls, table: Mapping[str, Any], period: float) -> Self:
        return cls(
            from_arcsec(table.get("arcsec_per_Nm", 0.0), period),
            **line_values(table.get("lines_per_Nm", ()), period),
        )


@dataclass(frozen=True)
class StiffeningCompliance(Term):
    r"""A spring that stiffens under the moment m.

    .. math:: \varepsilon = c_1 m + c_3 m^3 + c_k\,\mathrm{sign}(m)\max(|m| - m_k, 0)

    where m is the torque or, with ``gravity``, :math:`\tau\sin(\varphi - \varphi_g)`.

    Parameters
    ----------
    per_Nm, per_Nm3 : float
        :math:`c_1` and :math:`c_3`.
    beyond_knee_per_Nm, knee_Nm : float
        :math:`c_k` and the knee :math:`m_k \ge 0`.
    gravity : float, optional
        :math:`\varphi_g`, the angle at which the load has no moment.
    """

    per_Nm: float = 0.0
    per_Nm3: float = 0.0
    beyond_knee_per_Nm: float = 0.0
    knee_Nm: float = 0.0
    gravity: float | None = None

    kind: ClassVar[str] = "stiffening_compliance"
    signals: ClassVar[tuple[str, ...]] = ("torque",)

    def check(self) -> None:
        if self.knee_Nm < 0.0:
            raise self._out_of_range("knee_Nm", "0 or more")

    @classmethod
    def from_effect(cls, table: Mapping[str, Any], period: float) -> Self:
        gravity = table.get("gravity_deg")
        return cls(
            from_arcsec(table.get("arcsec_per_Nm", 0.0), period),
            from_arcsec(table.get("arcsec_per_Nm3", 0.0), period),
            from_arcsec(table.get("beyond_knee_arcsec_per_Nm", 0.0), period),
            table.get("knee_Nm", 0.0),
            None if gravity is None else gravity * (period / 360.0),
        )


@dataclass(frozen=True)
class LoadDependentGearError(Term):
    r"""Gear lines that grow with the torque.

    .. math:: \varepsilon = \ell\,\sum_m A_m \cos m\varphi + B_m \sin m\varphi,
              \qquad \ell = \tau \text{ or } |\tau|

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
    signals: ClassVar[tuple[str, ...]] = ("torque",)

    def check(self) -> None:
        self._check_lines()
        if self.torque not in ("signed", "absolute"):
            raise self._out_of_range("torque", "'signed' or 'absolute'")

    @classmethod
    def from_effect(cls, table: Mapping[str, Any], period: float) -> Self:
        return cls(
            **line_values(table["lines_per_Nm"], period),
            torque=table.get("torque", "signed"),
        )
