"""Pictures of plans and rehearsals: where to read, which orders and causes this separates."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

import numpy as np

from ..errors import ArgumentError
from . import palette
from .canvas import described, grid, new_axes, new_figure, plain_logarithms

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure

    from ..planning.result import CalibrationPlan
    from ..rehearsal import Rehearsal, RehearsedCause


def plan_positions(plan: CalibrationPlan, ax: Axes | None = None) -> Axes:
    """Positions of every mount (or tilt), the first three.

    All pitches of a mount are equivalent; what separates orders is where the mounts are
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
        f"Positions of every {what}, the first three",
    )


def plan_factors(plan: CalibrationPlan, ax: Axes | None = None) -> Axes:
    """Noise factor of every wanted order: 1 is as good as evenly spread readings.

    Orders that vanish in the zero of every mount are marked instead of plotted.

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
            "not detected",
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
    ax.set_ylabel("standard error (1 = ideal)")
    grid(ax, "y")
    blind = [f"{orders[i]:g}" for i in place[~seen]]
    told = f"worst {float(factors[seen].max(initial=0.0)):.3g}" + (
        f"; undetermined: {', '.join(blind)}" if blind else ""
    )
    text = f"Standard error of {len(orders)} wanted orders, 1 is ideal: {told}."
    return described(ax, text, "Standard error of every wanted order")


def detection(rehearsal: Rehearsal) -> Figure:
    """Share of the trials in which each cause was named, against its size.

    Points are the sizes tried with 95 % binomial intervals, the line the probability fitted to
    them, dashed verticals the sizes named in 50 and 95 %. Causes never hidden are omitted.

    Parameters
    ----------
    rehearsal : Rehearsal

    Returns
    -------
    matplotlib Figure
        It has a small picture for every cause, and so takes no axes.

    Raises
    ------
    ArgumentError
        No cause was hidden: there is nothing to draw.
    """
    causes = [cause for cause in rehearsal.causes if cause.trials]
    if not causes:
        raise ArgumentError("nothing was hidden in this rehearsal: there is nothing to draw")
    # Small pictures side by side.
    columns = min(4, len(causes))
    rows = -(-len(causes) // columns)
    figure, axes = new_figure(rows, columns, width=2.6 * columns + 0.6, height=2.1 * rows + 0.4)
    for ax, cause in zip(axes, causes, strict=False):
        _draw(ax, cause)
    for ax in axes[::columns]:
        ax.set_ylabel("share named", fontsize="small")
    for ax in axes[len(causes) :]:
        ax.remove()
    return figure


def _draw(ax: Axes, cause: RehearsedCause) -> None:
    size = np.array([*cause.tried])
    entries = cause.to_dict()["tried"]
    share = np.array([entry["named"] / entry["trials"] for entry in entries])
    ends = np.array([entry["interval"] for entry in entries]).T
    spread = np.abs(ends - share)
    ax.errorbar(
        size, share, yerr=spread, fmt="o", color=palette.AFTER, markersize=4.0, linewidth=1.0
    )
    if cause.curve:
        x, y = np.array(cause.curve).T
        ax.plot(x, y, color=palette.ink(ax), linewidth=1.2)
    for value in (cause.named_50, cause.named_95):
        if value is not None:
            ax.axvline(value, color=palette.WARNING, linestyle="--", linewidth=1.0)
    ax.set_xscale("log")
    if size.size == 1:
        ax.set_xlim(size[0] / 2.0, size[0] * 2.0)
    if not cause.grows:
        ax.invert_xaxis()
    # Numbers at a size axis.
    plain_logarithms(ax, "x", 4)
    ax.set_ylim(-0.05, 1.05)
    ax.set_title(cause.cause, fontsize="small")
    ax.set_xlabel(cause.size_name, fontsize="small")
    ax.tick_params(labelsize="x-small")
    grid(ax)
    named = ", ".join(
        f"{share} at {'no size tried' if value is None else f'{value:.3g}'}"
        for share, value in (("50 %", cause.named_50), ("95 %", cause.named_95))
    )
    described(
        ax, f"Share of trials in which {cause.cause} was named by {cause.size_name}: {named}."
    )
