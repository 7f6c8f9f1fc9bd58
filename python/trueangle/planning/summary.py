"""Plans as text and as plain values."""

from __future__ import annotations

import math
from collections.abc import Sequence
from itertools import groupby
from typing import TYPE_CHECKING, Any

from ..support.layout import laid_out
from ..support.plainresult import counted, finite
from .further import run_steps

if TYPE_CHECKING:
    from .arc import ArcPlan
    from .nextruns import NextRuns
    from .plan import CalibrationPlan
    from .selfplan import SelfPlan


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
    return laid_out(lines)


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
        names = ", ".join(f"{k:g}" for k in given["blind_orders"])
        factor = f"{given['worst_noise_factor']:.2f}"
        worse = f"{given['worse_by']:.2f} times the best"
        lines.append(
            f"  the given angles       cannot see {names}; factor {factor} of the others"
            if names
            else f"  the given angles       factor {factor}, {worse}"
        )
    lines += ["  noise factor per order", *_table(plan.noise_factors)]
    lines += [f"  note: {note}" for note in plan.notes]
    return laid_out(lines)


def arc_summary(plan: ArcPlan) -> str:
    """A plan of places on an arc."""
    each = f": {sum(plan.counts)} in each of {plan.runs} runs" if plan.runs > 1 else ""
    way = ", half from either side" if plan.both_directions else ""
    lines = [
        f"{plan.readings} readings over {plan.start_deg:g} to {plan.stop_deg:g} deg{each}{way}",
        *place_table(plan.places_deg, plan.counts),
        f"  D-efficiency           {plan.d_efficiency:.3f} of the best possible",
        f"  of even spacing        {plan.efficiency_of_even_spacing:.3f}",
        "  order  noise factor  with even spacing",
    ]
    for order, factor in plan.noise_factors.items():
        even = plan.even_noise_factors[order]
        lines.append(f"  {order:5g}  {_factor(factor):>12}  {_factor(even):>17}")
    if plan.uncertainty_arcsec is not None:
        lines.append(
            f"  uncertainty (k = 2)    {plan.uncertainty_arcsec:.3g} arcsec at the worst place"
        )
    lines += [f"  note: {note}" for note in plan.notes]
    return laid_out(lines)


def _factor(factor: float) -> str:
    """A noise factor, or that the places do not show the order."""
    return f"{factor:.3g}" if math.isfinite(factor) else "not seen"


def place_table(places_deg: Sequence[float], counts: Sequence[int]) -> list[str]:
    """Readings at each place, a line a place under their heads."""
    rows = zip(places_deg, counts, strict=True)
    return ["  place/deg  readings", *(f"  {place:9.3f}  {count:8d}" for place, count in rows)]


def next_summary(plan: NextRuns) -> str:
    """The next runs: a table to follow at the rig, and what they would tell."""
    lines = []
    if plan.runs:
        lines.append(
            f"Next: {counted(plan.runs, 'run')} of {plan.readings} readings in all, "
            f"{spoken_time(plan.seconds)} of motion"
            + ("; diagnose by themselves" if plan.alone else "; diagnose with those there are")
        )
        for steps, same in groupby(plan.runs, lambda design: [*run_steps(design)]):
            labels = [str(design.label) for design in same]
            times = f" to {labels[-1]}, {len(labels)} times the same" if len(labels) > 1 else ""
            lines.append(f"  {labels[0]}{times}")
            lines += [f"    - {step}" for step in steps]
    shown = {
        entry.causes[0]: None
        for entry in plan.between
        if entry.told and len(entry.causes) == 1 and not entry.seen
    }
    for entry in plan.between:
        if entry.told and entry.causes[0] in shown and len(entry.causes) == 1:
            continue
        names = " or ".join(entry.causes)
        if not entry.told:
            text = f"  not distinguished: {names}"
        elif len(entry.causes) > 1:
            text = f"  distinguishes {names}"
        else:
            text = f"  shows {names}"
        if entry.seen and entry.expected_bic is not None and entry.chance_named is not None:
            text += f": BIC better by {entry.expected_bic:.0f} expected for the true one"
            by = f" ({entry.trials} simulated)" if entry.trials else ""
            text += f", named in {100.0 * entry.chance_named:.0f} %{by}"
        if text not in lines:  # of two lines of the pattern the same may be asked
            lines.append(text)
    if shown:
        lines.append(f"  shows {', '.join(shown)}")
    if plan.beyond:
        lines.append(f"  beyond what was seen so far: {', '.join(plan.beyond)}")
    lines += [f"  note: {note}" for note in plan.notes]
    return laid_out(lines)


def spoken_time(seconds: float) -> str:
    """Seconds or minutes."""
    return f"{seconds:.0f} s" if seconds < 120.0 else f"{seconds / 60.0:.0f} min"


def _table(factors: dict[float, float]) -> list[str]:
    entries = [f"{m:>5g} {f:5.2f}" for m, f in factors.items()]
    return ["  " + "  ".join(entries[i : i + 6]) for i in range(0, len(entries), 6)]


def plain_plan(plan: CalibrationPlan) -> dict[str, Any]:
    """A plan of positions and mounts."""
    return {
        "kind": plan.kind,
        "positions": plan.positions,
        "mount_offsets_deg": list(plan.mount_offsets_deg),
        "facet_shifts": list(plan.facet_shifts),
        "facet_noise_factor": finite(plan.facet_noise_factor),
        "worst_noise_factor": finite(plan.worst_noise_factor),
        "noise_factors": _plain(plan.noise_factors),
        "invisible_orders": list(plan.invisible_orders),
        "tolerance_deg": plan.tolerance_deg,
        "readings": plan.readings,
        "notes": list(plan.notes),
    }


def plain_self_plan(plan: SelfPlan) -> dict[str, Any]:
    """A plan of a calibration without a reference."""
    return {
        "method": plan.method,
        "orders": list(plan.orders),
        "noise_factors": _plain(plan.noise_factors),
        "worst_noise_factor": _plain(plan.worst_noise_factor),
        "blind_orders": list(plan.blind_orders),
        "angles_deg": list(plan.angles_deg),
        "given": _plain(plan.given),
        "speed_ratio": plan.speed_ratio,
        "speed_ratio_factors": _plain(plan.speed_ratio_factors),
        "turns": plan.turns,
        "readings": plan.readings,
        "seconds": plan.seconds,
        "knots_per_turn": plan.knots_per_turn,
        "notes": list(plan.notes),
    }


def _plain(value: Any) -> Any:
    if isinstance(value, dict):
        return {
            (f"{k:g}" if isinstance(k, (int, float)) else k): _plain(v) for k, v in value.items()
        }
    if isinstance(value, list):
        return [_plain(entry) for entry in value]
    return value if not isinstance(value, float) or math.isfinite(value) else None
