"""A calibration plan: where to read, and which orders those positions separate."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from . import palette
from .canvas import described, grid, new_axes

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..planning.mountplan import CalibrationPlan


def plan_positions(plan: CalibrationPlan, ax: Axes | None = None) -> Axes:
    """Positions of every mount (or tilt) within the first pitch.

    All pitches of a mount are alike; what separates orders is where the mounts stand
    within one. A bar at each position is the tolerance of the plan.

    Parameters
    ----------
    plan : CalibrationPlan
    ax : matplotlib Axes, optional

    Returns
    -------
    matplotlib Axes
    """
    ax = new_axes(ax, height=1.2 + 0.45 * len(plan.mount_offsets_deg))
    pitch = 360.0 / plan.positions
    what = {"mounts": "mount", "tilts": "tilt"}.get(plan.kind, "clamping")
    for number, offset in enumerate(plan.mount_offsets_deg):
        place = np.arange(-1, 4) * pitch + offset
        ax.errorbar(
            place,
            np.full(place.size, -float(number)),
            xerr=plan.tolerance_deg if math.isfinite(plan.tolerance_deg) else None,
            linestyle="none",
            marker=palette.run_marker(number),
            color=palette.run_colour(number),
            capsize=3.0,
        )
    low = min(plan.mount_offsets_deg) - 0.15 * pitch
    ax.set_xlim(low, low + 3.1 * pitch)
    ax.set_ylim(0.4 - len(plan.mount_offsets_deg), 0.6)
    ax.set_yticks(
        [-float(i) for i in range(len(plan.mount_offsets_deg))],
        [f"{what} {i + 1}: {offset:+.4g}°" for i, offset in enumerate(plan.mount_offsets_deg)],
    )
    ax.set_xlabel(f"output angle / deg (first three of {plan.positions} positions)")
    grid(ax, "x")
    offsets = ", ".join(f"{offset:+.4g}" for offset in plan.mount_offsets_deg)
    return described(
        ax,
        f"{what.capitalize()}s of a plan of {plan.positions} positions: {offsets} deg.",
        f"Positions of every {what} within the first pitch",
    )


def plan_factors(plan: CalibrationPlan, ax: Axes | None = None) -> Axes:
    """Noise factor of every wanted order: 1 is as good as evenly spread readings.

    Orders that vanish in the zero of every mount are marked instead of drawn.

    Parameters
    ----------
    plan : CalibrationPlan
    ax : matplotlib Axes, optional

    Returns
    -------
    matplotlib Axes
    """
    ax = new_axes(ax)
    orders = list(plan.noise_factors)
    place = np.arange(len(orders))
    factors = np.array([plan.noise_factors[m] for m in orders])
    seen = np.isfinite(factors)
    ax.bar(place[seen], factors[seen], 0.75, color=palette.AFTER)
    for i in place[~seen]:
        ax.annotate(
            "not seen",
            (float(i), 0.02),
            rotation=90,
            ha="center",
            va="bottom",
            fontsize="small",
            color=palette.WARNING,
        )
    ax.axhline(1.0, color=palette.ink(ax), linewidth=1.0, linestyle="--")
    ax.set_xticks(place, [f"{m:g}" for m in orders], rotation=90 if len(orders) > 20 else 0)
    ax.set_xlabel("order / cycles per output turn")
    ax.set_ylabel("noise factor (1 = ideal)")
    grid(ax, "y")
    blind = [f"{orders[i]:g}" for i in place[~seen]]
    told = f"worst {float(factors[seen].max(initial=0.0)):.3g}" + (
        f"; not seen: {', '.join(blind)}" if blind else ""
    )
    text = f"Noise factor of {len(orders)} wanted orders: {told}."
    return described(ax, text, "Noise factor of every wanted order")
