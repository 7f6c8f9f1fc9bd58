"""Rendering of the paper's study: its table beside the paper's figures, and ten lines."""

from __future__ import annotations

from .study import PUBLISHED, PUBLISHED_MEAN, Reduction, Study

__all__ = ["short_report", "study_table"]


def study_table(study: Study) -> str:
    """The paper's figures beside those of the simulated groups."""
    lines = [
        "joint   peak-to-peak, arcsec             paper                       orders retained",
    ]
    shares = []
    for name, found in study.published.items():
        before, after = found.positions
        first, last, share = PUBLISHED[name]
        shares.append(-found.at_positions)
        orders = ", ".join(f"{k:g}" for k in found.orders)
        lines.append(
            f"  {name}   {before:7.2f} -> {after:5.2f}  {-found.at_positions:6.2f} %"
            f"   {first:7.2f} -> {last:5.2f}  {share:6.2f} %   {orders}"
        )
    mean = sum(shares) / len(shares)
    lines.append(f"  mean                    {mean:6.2f} %                      {PUBLISHED_MEAN} %")
    return "\n".join(lines)


def _change(found: Reduction, where: str) -> str:
    before, after = found.positions if where == "positions" else found.dense
    change = found.at_positions if where == "positions" else found.in_between
    return f"{before:4.0f} -> {after:3.0f} ({change:+.0f} %)"


def short_report(study: Study) -> str:
    """The whole study in ten lines: what 36 positions say, and what lies between."""
    plan = study.plan
    lines = [
        "The paper's study repeated (6 groups at 36 positions, peak-to-peak in arcsec)",
        "  joint, true orders       at 36 positions     everywhere",
    ]
    for name, found in study.published.items():
        lines.append(
            f"  {name} as published           {_change(found, 'positions'):18}  "
            f"{_change(found, 'dense')}"
        )
    for name, found in study.gear.items():
        lines.append(
            f"  {name} gear orders instead    {_change(found, 'positions'):18}  "
            f"{_change(found, 'dense')}"
        )
    lines.append("  The 36 readings of both are the same: only others can tell.")
    offset = plan.mount_offsets_deg[-1]
    for name, found in study.planned.items():
        lines.append(
            f"  {name} read {offset:g} deg apart too  {_change(found, 'positions'):18}  "
            f"{_change(found, 'dense')}"
        )
    lines.append(
        f"  `ta.plan_mounts(gear_ratio=100)`: mounts at 0 and {offset:g} deg, "
        f"noise factor {plan.worst_noise_factor:.2f}"
    )
    return "\n".join(lines)
