"""`SelfPlan`: a plan of a calibration without a reference, and its words."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import Any

from ..support.layout import counted, laid_out
from ..support.plainresult import PlainResult
from .result import factor_table, plain_plan


@dataclass(frozen=True)
class SelfPlan(PlainResult):
    """What to record, and how well each order will be known.

    Attributes
    ----------
    method : str
    orders : tuple of float
    noise_factors : dict of order to float
        Standard error over that of all readings with the true angle known; infinite where
        blind.
    angles_deg : tuple of float
        Best angles of heads or shifts; empty for the others.
    given : dict
        Angles that were given, their ``worst_noise_factor``, ``worse_by`` and
        ``blind_orders``.
    speed_ratio : float or None
        Start over end speed.
    speed_ratio_factors : dict of ratio to float
    turns, readings, seconds : float or int or None
    knots_per_turn : float or None
        At most so many, in the slowest part.
    notes : tuple of str
    """

    method: str
    orders: tuple[float, ...]
    noise_factors: dict[float, float]
    angles_deg: tuple[float, ...] = ()
    given: dict[str, object] = field(default_factory=dict)
    speed_ratio: float | None = None
    speed_ratio_factors: dict[float, float] = field(default_factory=dict)
    turns: float | None = None
    readings: int | None = None
    seconds: float | None = None
    knots_per_turn: float | None = None
    notes: tuple[str, ...] = ()

    @property
    def worst_noise_factor(self) -> float:
        """The largest factor of the orders that are seen."""
        seen = [f for f in self.noise_factors.values() if math.isfinite(f)]
        return max(seen, default=math.inf)

    @property
    def blind_orders(self) -> tuple[float, ...]:
        """Wanted orders that are not seen."""
        return tuple(k for k, f in self.noise_factors.items() if not math.isfinite(f))

    def to_dict(self) -> dict[str, Any]:
        """The object that ``trueangle plan`` prints as JSON."""
        return {
            "method": self.method,
            "orders": list(self.orders),
            "noise_factors": plain_plan(self.noise_factors),
            "worst_noise_factor": plain_plan(self.worst_noise_factor),
            "blind_orders": list(self.blind_orders),
            "angles_deg": list(self.angles_deg),
            "given": plain_plan(self.given),
            "speed_ratio": self.speed_ratio,
            "speed_ratio_factors": plain_plan(self.speed_ratio_factors),
            "turns": self.turns,
            "readings": self.readings,
            "seconds": self.seconds,
            "knots_per_turn": self.knots_per_turn,
            "notes": list(self.notes),
        }

    def summary(self) -> str:
        """The plan as text."""
        lines = [f"{self.method}, without a reference"]
        if self.angles_deg:
            lines.append(
                f"  angles                 {', '.join(f'{a:g}' for a in self.angles_deg)} deg"
            )
        if self.speed_ratio is not None:
            table = ", ".join(f"{r:g}: {f:.2g}" for r, f in self.speed_ratio_factors.items())
            lines += [
                f"  speed ratio            {self.speed_ratio:g}",
                f"  factor by ratio        {table}",
                f"  knots per turn         at most {self.knots_per_turn:g}, in the slowest part",
            ]
        lines.append(f"  worst noise factor     {self.worst_noise_factor:.2f}")
        if self.turns is not None:
            lines.append(f"  turns                  {self.turns:.3g}")
        if self.readings is not None:
            lines.append(f"  readings needed        {self.readings}")
        if self.seconds is not None:
            lines.append(f"  seconds                {self.seconds:.3g}")
        if self.given:
            given: Any = self.given
            names = ", ".join(f"{k:g}" for k in given["blind_orders"])
            factor = f"{given['worst_noise_factor']:.2f}"
            worse = f"{given['worse_by']:.2f} times the best"
            lines.append(
                f"  the given angles       cannot see {names}; factor {factor} of the others"
                if names
                else f"  the given angles       factor {factor}, {worse}"
            )
        lines += ["  noise factor per order", *factor_table(self.noise_factors)]
        lines += [f"  note: {note}" for note in self.notes]
        return laid_out(lines)

    def _brief(self) -> str:
        orders = counted(self.orders, "order")
        return f"{self.method}, {orders}, worst factor {self.worst_noise_factor:.3g}"
