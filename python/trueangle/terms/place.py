"""A bump at one place of a shaft."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self

from .term import Term, from_arcsec

__all__ = ["LocalDefect"]


@dataclass(frozen=True)
class LocalDefect(Term):
    r"""A damaged tooth, pole or graduation line, the same in every pass.

    .. math:: \varepsilon = h\,e^{-(a - c)^2/2w^2},\qquad a = f\varphi

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

    @property
    def is_periodic(self) -> bool:
        return self.cycles_per_turn == int(self.cycles_per_turn)

    def check(self) -> None:
        if self.width <= 0.0:
            raise self._out_of_range("width", "positive")
        if self.cycles_per_turn <= 0.0:
            raise self._out_of_range("cycles_per_turn", "positive")

    @classmethod
    def from_effect(cls, table: Mapping[str, Any], period: float) -> Self:
        degree = period / 360.0
        return cls(
            table["place_deg"] * degree,
            table["width_deg"] * degree,
            from_arcsec(table["height_arcsec"], period),
            table.get("cycles_per_turn", 1.0),
        )
