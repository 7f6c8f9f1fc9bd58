"""A described panel of readings, drawn by matplotlib."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

from . import palette
from .canvas import grid, marked, turn_axis
from .curves import CONFIDENCE, ModelCurve, curve_envelope, thinned_points
from .panel import Cloud, Panel

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Readings drawn in one picture: more do not show.
_MOST: Final = 24_000
#: Readings drawn of each run at least.
_FEWEST: Final = 6
#: Readings from which on dots are small and faint.
_DENSE: Final = 2_000


def draw_panel(ax: Axes, panel: Panel, most: int = _MOST) -> None:
    """Readings, at most ``most``, model and medians, with titles of the axes."""
    draw_clouds(ax, panel.clouds, most)
    if panel.zero:
        ax.axhline(0.0, color=palette.MUTED, linewidth=0.8, zorder=0)
    if panel.model is not None:
        draw_panel_curve(ax, panel.model, panel.dense)
    if panel.medians is not None:
        x, y = panel.medians
        ink = palette.ink(ax)
        ax.plot(x, y, color=ink, linewidth=1.4, marker=".", label="median")
    if panel.angles and panel.span is not None:
        turn_axis(ax, *panel.span)
    elif panel.span is not None:  # directions
        ax.set_xlim(*panel.span)
        ax.set_xticks([-1.0, 0.0, 1.0], ["backward", "at rest", "forward"])
    grid(ax)
    ax.set_xlabel(panel.x)
    ax.set_ylabel(panel.y)


def draw_clouds(ax: Axes, clouds: Sequence[Cloud], most: int = _MOST) -> None:
    """Dots of every cloud; each name once for the legend."""
    share = max(_FEWEST, most // len(clouds))
    dense = sum(min(cloud.points.y.size, share) for cloud in clouds) > _DENSE
    named: set[str] = set()
    for cloud in clouds:
        part = thinned_points(cloud.points, share, cloud.run)
        (line,) = ax.plot(
            part.x,
            part.y,
            linestyle="none",
            label=None if cloud.name in named else cloud.name,
            **_style(ax, cloud, dense),
        )
        marked(line, run=cloud.run, ring=cloud.role == "measured")
        named.add(cloud.name)


def _style(ax: Axes, cloud: Cloud, dense: bool) -> dict[str, Any]:
    size, alpha = (2.0, 0.4) if dense else (3.5, 0.75)
    if cloud.role == "measured":
        ring = {"markerfacecolor": "none", "markeredgewidth": 0.7}
        return {"marker": "o", "markersize": 4.0, "color": palette.BEFORE, **ring}
    colour, marker = {
        "run": (palette.run_colour(cloud.run), palette.run_marker(cloud.run)),
        "before": (palette.BEFORE, "s"),
        "after": (palette.AFTER, "o"),
        "simulated": (palette.ink(ax), "."),
    }[cloud.role]
    if cloud.role == "simulated":  # within the rings of what was measured
        size, alpha = 2.5, 1.0
    faint = {"alpha": alpha, "markeredgewidth": 0.0}
    return {"marker": marker, "markersize": size, "color": colour, **faint}


def draw_panel_curve(ax: Axes, curve: ModelCurve, dense: bool) -> None:
    """A model's curve with its band; its envelope where gear orders fill the picture."""
    if dense:
        ax.fill_between(
            *curve_envelope(curve),
            color=palette.MUTED,
            alpha=0.35,
            linewidth=0.0,
            zorder=0.5,
            label="envelope of the model",
        )
        return
    ax.plot(curve.angle, curve.error, color=palette.ink(ax), zorder=3.0, label="model")
    if curve.std is None:
        return
    half = CONFIDENCE * curve.std
    ax.fill_between(
        curve.angle,
        curve.error - half,
        curve.error + half,
        color=palette.ink(ax),
        alpha=0.2,
        linewidth=0.0,
        zorder=0.5,
        label="95 % band",
    )
