"""Zero, pattern and lines that follow the temperature."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self

from .term import Term, from_arcsec, line_values

__all__ = ["ThermalDrift"]


@dataclass(frozen=True)
class ThermalDrift(Term):
    r"""Error in proportion to :math:`\Delta T = T - T_0`.

    .. math:: \varepsilon = \Delta T\,\bigl[k_0 + k_p\,p(\varphi)
              + \sum_m A_m \cos m\varphi + B_m \sin m\varphi\bigr]

    with p the harmonics of the model without their constant.

    Parameters
    ----------
    zero_per_K : float
        :math:`k_0`, angle per kelvin.
    pattern_per_K : float
        :math:`k_p`, relative growth of the harmonics per kelvin.
    orders : sequence of float
        Output orders m of the lines, positive.
    cosine, sine : sequence of float
        :math:`A_m, B_m`, angle per kelvin.
    reference_C : float
        :math:`T_0`, where the harmonics hold, degrees Celsius.
    """

    zero_per_K: float = 0.0
    pattern_per_K: float = 0.0
    orders: tuple[float, ...] = ()
    cosine: tuple[float, ...] = ()
    sine: tuple[float, ...] = ()
    reference_C: float = 20.0

    kind: ClassVar[str] = "thermal_drift"
    signals: ClassVar[tuple[str, ...]] = ("temperature",)

    def check(self) -> None:
        self._check_lines()

    @classmethod
    def from_effect(cls, table: Mapping[str, Any], period: float) -> Self:
        return cls(
            zero_per_K=from_arcsec(table.get("zero_arcsec_per_K", 0.0), period),
            pattern_per_K=table.get("pattern_per_K", 0.0),
            **line_values(table.get("lines_per_K", ()), period),
            reference_C=table.get("reference_C", 20.0),
        )
