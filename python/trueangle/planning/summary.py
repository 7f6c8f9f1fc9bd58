"""Plans as text."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .arc import ArcPlan
    from .plan import CalibrationPlan
    from .selfplan import SelfPlan

__all__ = ["arc_summary", "plan_summary", "self_plan_summary"]


def plan_summary(plan: CalibrationPlan) -> str:
    """A plan of positions and mounts."""
    offsets = ", ".join(f"{o:.4g}" for o in plan.mount_offsets_deg)
    if plan.kind == "encoder":
        lines = [
            f"{plan.positions} jittered positions of a free reference encoder",
            f"  clamp it at            {offsets} deg",
        ]
    else:
        what = "mounts" if plan.kind == "mounts" else "tilts"
        lines = [
            f"{len(plan.mount_offsets_deg)} {what} of {plan.positions} positions",
            f"  offsets                {offsets} deg",
            f"  tolerance              {plan.tolerance_deg:.2g} deg, known to 0.01 deg",
        ]
    if plan.kind == "mounts":
        shifts = ", ".join(str(s) for s in plan.facet_shifts)
        facet = plan.facet_noise_factor
        factor = f"{facet:.2f}" if math.isfinite(facet) else "impossible with one mount"
        lines += [
            f"  facet shifts           {shifts} facets",
            f"  artefact fitted too    factor {factor}",
        ]
    lines += [
        f"  worst noise factor     {plan.worst_noise_factor:.2f}",
        "  noise factor per order",
        *_table(plan.noise_factors),
    ]
    if plan.readings is not None:
        lines.append(f"  readings needed        {plan.readings}")
    lines += [f"  note: {note}" for note in plan.notes]
    return "\n".join(lines)


def self_plan_summary(plan: SelfPlan) -> str:
    """A plan of a calibration without a reference."""
    lines = [f"{plan.method}, without a reference"]
    if plan.angles_deg:
        lines.append(f"  angles                 {', '.join(f'{a:g}' for a in plan.angles_deg)} deg")
    if plan.speed_ratio is not None:
        table = ", ".join(f"{r:g}: {f:.2g}" for r, f in plan.speed_ratio_factors.items())
        lines += [
            f"  speed ratio            {plan.speed_ratio:g}",
            f"  factor by ratio        {table}",
            f"  knots per turn         at most {plan.knots_per_turn:g}, in the slowest part",
        ]
    lines.append(f"  worst noise factor     {plan.worst_noise_factor:.2f}")
    if plan.turns is not None:
        lines.append(f"  turns                  {plan.turns:.3g}")
    if plan.readings is not None:
        lines.append(f"  readings needed        {plan.readings}")
    if plan.seconds is not None:
        lines.append(f"  seconds                {plan.seconds:.3g}")
    if plan.given:
        given: Any = plan.given
        lines.append(
            f"  the given angles       factor {given['worst_noise_factor']:.2f}, "
            f"{given['worse_by']:.2f} times the best"
        )
        if given["blind_orders"]:
            names = ", ".join(f"{k:g}" for k in given["blind_orders"])
            lines.append(f"                         blind to {names}")
    lines += ["  noise factor per order", *_table(plan.noise_factors)]
    lines += [f"  note: {note}" for note in plan.notes]
    return "\n".join(lines)


def arc_summary(plan: ArcPlan) -> str:
    """A plan of places on an arc."""
    runs = "" if plan.runs == 1 else f" in each of {plan.runs} runs"
    way = ", half from either side" if plan.both_directions else ""
    lines = [
        f"{plan.readings} readings over {plan.start_deg:g} to {plan.stop_deg:g} deg: "
        f"{sum(plan.counts)}{runs}{way}",
        "  place/deg  readings",
        *(
            f"  {place:9.3f}  {count:8d}"
            for place, count in zip(plan.places_deg, plan.counts, strict=True)
        ),
        f"  D-efficiency           {plan.d_efficiency:.3f} of the best possible",
        f"  of even spacing        {plan.efficiency_of_even_spacing:.3f}",
        "  order  noise factor  with even spacing",
    ]
    for order, factor in plan.noise_factors.items():
        even = plan.even_noise_factors[order]
        lines.append(f"  {order:5g}  {factor:12.3g}  {even:17.3g}")
    if plan.uncertainty_arcsec is not None:
        lines.append(
            f"  uncertainty (k = 2)    {plan.uncertainty_arcsec:.3g} arcsec at the worst place"
        )
    lines += [f"  note: {note}" for note in plan.notes]
    return "\n".join(lines)


def _table(factors: dict[float, float]) -> list[str]:
    entries = [f"{m:>5g} {f:5.2f}" for m, f in factors.items()]
    return ["  " + "  ".join(entries[i : i + 6]) for i in range(0, len(entries), 6)]
