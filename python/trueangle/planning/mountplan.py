"""`CalibrationPlan`: a plan of positions and mounts, and its words."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any

from ..support.layout import counted, laid_out
from ..support.plainresult import PlainResult, finite_or_none
from .tables import factor_table, plain_plan


@dataclass(frozen=True)
class CalibrationPlan(PlainResult):
    """Where to read, and how well each order will be known.

    Attributes
    ----------
    kind : str
        ``"mounts"``, ``"encoder"`` or ``"tilts"``.
    positions : int
        Positions per mount (or in all, for a free reference encoder).
    mount_offsets_deg : tuple of float
        How far the joint stands from the first mount's positions, per mount or tilt.
    facet_shifts : tuple of int
        By how many facets to turn the artefact at each mount, so that its own errors
        separate from the joint's.
    facet_noise_factor : float
        Worst factor of an order of the joint when the artefact's errors are fitted too,
        relative to one mount with a perfect artefact; infinite where they stay mixed.
    noise_factors : dict of order to float
        Factor of each wanted order; infinite for an order that no zero-free reading at
        these positions shows.
    tolerance_deg : float
        Every offset may be off by this much with all factors below 2; it must be known
        to about 0.01 degree (2 degrees of phase at order 202).
    readings : int or None
        Readings that reach the wanted standard error, in whole rounds.
    notes : tuple of str
    """

    kind: str
    positions: int
    mount_offsets_deg: tuple[float, ...]
    facet_shifts: tuple[int, ...]
    facet_noise_factor: float
    noise_factors: dict[float, float]
    tolerance_deg: float
    readings: int | None = None
    notes: tuple[str, ...] = ()

    @property
    def worst_noise_factor(self) -> float:
        """The largest factor of the orders that can be seen at all."""
        return max((f for f in self.noise_factors.values() if math.isfinite(f)), default=math.inf)

    @property
    def invisible_orders(self) -> tuple[float, ...]:
        """Wanted orders that fold onto the constant: every zero absorbs them."""
        return tuple(m for m, f in self.noise_factors.items() if not math.isfinite(f))

    def to_dict(self) -> dict[str, Any]:
        """The object that ``trueangle plan`` prints as JSON."""
        return {
            "kind": self.kind,
            "positions": self.positions,
            "mount_offsets_deg": list(self.mount_offsets_deg),
            "facet_shifts": list(self.facet_shifts),
            "facet_noise_factor": finite_or_none(self.facet_noise_factor),
            "worst_noise_factor": finite_or_none(self.worst_noise_factor),
            "noise_factors": plain_plan(self.noise_factors),
            "invisible_orders": list(self.invisible_orders),
            "tolerance_deg": self.tolerance_deg,
            "readings": self.readings,
            "notes": list(self.notes),
        }

    def summary(self) -> str:
        """The plan as text."""
        offsets = ", ".join(f"{o:.4g}" for o in self.mount_offsets_deg)
        if self.kind == "encoder":
            lines = [
                f"{self.positions} jittered positions of a free reference encoder",
                f"  clamp it at            {offsets} deg",
            ]
        else:
            what = "mounts" if self.kind == "mounts" else "tilts"
            lines = [
                f"{len(self.mount_offsets_deg)} {what} of {self.positions} positions",
                f"  offsets                {offsets} deg",
                f"  tolerance              {self.tolerance_deg:.2g} deg, known to 0.01 deg",
            ]
        if self.kind == "mounts":
            shifts = ", ".join(str(s) for s in self.facet_shifts)
            facet = self.facet_noise_factor
            factor = f"{facet:.2f}" if math.isfinite(facet) else "impossible with one mount"
            lines += [
                f"  facet shifts           {shifts} facets",
                f"  artefact fitted too    factor {factor}",
            ]
        lines += [
            f"  worst noise factor     {self.worst_noise_factor:.2f}",
            "  noise factor per order",
            *factor_table(self.noise_factors),
        ]
        if self.readings is not None:
            lines.append(f"  readings needed        {self.readings}")
        lines += [f"  note: {note}" for note in self.notes]
        return laid_out(lines)

    def _brief(self) -> str:
        mounts = counted(self.mount_offsets_deg, "mount")
        return f"{self.positions} positions, {mounts}, worst factor {self.worst_noise_factor:.3g}"
