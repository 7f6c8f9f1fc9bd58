"""Figures to draw on: matplotlib at first use, axes, grid, legend, and what they show in text."""

from __future__ import annotations

import base64
import io
import math
from collections.abc import Iterator
from contextlib import contextmanager
from contextvars import ContextVar
from html import escape
from typing import TYPE_CHECKING, Any, Literal

from ..errors import MissingExtraError
from .palette import ink

if TYPE_CHECKING:
    from matplotlib.axes import Axes
    from matplotlib.figure import Figure
    from matplotlib.legend import Legend
    from matplotlib.lines import Line2D

#: A small picture as part of the usual one, its dots per inch, and those that a page shows.
_SMALL: float = 0.8
#: Dots per inch of a page that draws vectors: those of CSS.
ON_PAGE: float = 96.0
_SCALE: ContextVar[float | None] = ContextVar("scale", default=None)

#: Entries of a legend beyond which it is next to the picture, not inside.
_MANY: int = 5

#: Entries side by side of a legend that has to stay inside, and the height of a row of them
#: as part of the axes'.
_COLUMNS: int = 4
#: Letters of an entry, of which longer ones lose the middle.
_LONGEST: int = 48


def new_axes(ax: Axes | None, *, polar: bool = False, height: float = 4.0) -> Axes:
    """``ax`` itself, or the axes of a new figure.

    Raises
    ------
    MissingExtraError
        matplotlib is not installed.
    """
    if ax is not None:
        return ax
    kind: dict[str, Any] = {"projection": "polar"} if polar else {}
    width, height = (5.0, 5.0) if polar else (7.5, height)
    _, made = _subplots(1, 1, width, height, subplot_kw=kind)
    only: Axes = made[0, 0]
    return only


def grid(ax: Axes, axis: Literal["both", "x", "y"] = "both") -> None:
    """Faint lines behind what is plotted."""
    ax.grid(True, axis=axis, color=ink(ax) + "18", linewidth=0.8)
    ax.set_axisbelow(True)


def new_figure(
    rows: int, columns: int, width: float, height: float, *, sharey: bool = True
) -> tuple[Figure, list[Axes]]:
    """A new figure with axes in rows and columns, listed row by row.

    Raises
    ------
    MissingExtraError
        matplotlib is not installed.
    """
    figure, made = _subplots(rows, columns, width, height, sharey=sharey)
    return figure, list(made.ravel())


@contextmanager
def page_pictures(scale: float = _SMALL) -> Iterator[None]:
    """Within it new figures have another size, and no window or notebook shows them."""
    before = _SCALE.set(scale)
    try:
        yield
    finally:
        _SCALE.reset(before)


def as_image(drawn: Axes | Figure) -> str:
    """A figure as an element of a page, with its text alternative."""
    figure: Any = drawn if hasattr(drawn, "savefig") else drawn.get_figure(root=True)
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", dpi=120.0)
    data = base64.b64encode(buffer.getvalue()).decode("ascii")
    told = " ".join(text_alternative(ax) for ax in figure.axes)
    return (
        f'<img alt="{escape(told)}" style="max-width:100%" '
        f'width="{figure.get_figwidth() * 80.0:.0f}" src="data:image/png;base64,{data}">'
    )


def _subplots(rows: int, columns: int, width: float, height: float, **how: Any) -> Any:
    """A figure of this size in inches and an array of its axes."""
    scale = _SCALE.get()
    try:
        if scale is None:
            from matplotlib import pyplot
        from matplotlib import figure as figures
    except ModuleNotFoundError:
        raise MissingExtraError("pictures need matplotlib: pip install 'trueangle[plot]'") from None
    new = pyplot.figure if scale is None else figures.Figure
    size = (scale or 1.0) * width, (scale or 1.0) * height
    figure = new(figsize=size, layout="constrained")
    return figure, figure.subplots(rows, columns, squeeze=False, **how)


def marked(line: Line2D, **marks: Any) -> Line2D:
    """A line with what a page knows about it: ``run``, ``titles`` of its points, ``ring``."""
    line.on_page = marks  # type: ignore[attr-defined]
    return line


def page_marks(artist: object) -> dict[str, Any]:
    """The marks that `marked` gave it."""
    found: dict[str, Any] = getattr(artist, "on_page", {})
    return found


def plain_logarithms(ax: Axes, which: Literal["x", "y"], most: int = 7) -> None:
    """Ticks at 1, 2 and 5 of every decade, or at fewer, with plain numbers."""
    low, high = sorted(getattr(ax, f"get_{which}lim")())
    decades = range(math.floor(math.log10(low)), math.ceil(math.log10(high)) + 1)
    for marks in ((1.0, 2.0, 5.0), (1.0, 3.0), (1.0,)):
        ticks = [m * 10.0**d for d in decades for m in marks if low <= m * 10.0**d <= high]
        if len(ticks) <= most:
            break
    ticks = ticks[:: -(-len(ticks) // most)] if ticks else [math.sqrt(low * high)]
    axis = getattr(ax, f"{which}axis")
    axis.set_ticks(ticks, [f"{tick:.3g}" if tick < 1e3 else f"{tick:.0f}" for tick in ticks])
    axis.set_ticks([], minor=True)


def turn_axis(ax: Axes, low: float, high: float) -> None:
    """Angle axis in degrees, with whole parts of a turn as ticks."""
    from matplotlib.ticker import MultipleLocator

    if low == high:  # a joint at rest
        low, high = low - 0.5, high + 0.5
    ax.set_xlim(low, high)
    span, most = high - low, 1.2 * ax.get_figure(root=True).get_figwidth()  # type: ignore[union-attr]
    # Steps of ticks on an axis of angles in degrees, and about how many there are to an inch.
    for step in (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 15.0, 30.0, 45.0, 90.0, 180.0, 360.0, 1800.0):
        if span / step <= most:
            ax.xaxis.set_major_locator(MultipleLocator(step))
            break
    grid(ax)


def described(ax: Axes, text: str, title: str = "") -> Axes:
    """The axes with a text for who does not see them: see `text_alternative`.

    Axes that are alone in their figure get the title; others have separate captions.
    """
    ax.set_label(text)
    figure = ax.get_figure(root=True)
    if title and figure is not None and len(figure.axes) == 1:
        ax.set_title(title, fontsize="medium")
    return ax


def text_alternative(ax: Axes) -> str:
    """What a picture of this package shows, in a sentence, for an ``alt`` attribute.

    Parameters
    ----------
    ax : matplotlib Axes
        As a function of `trueangle.plots` returned it.

    Examples
    --------
    >>> import trueangle as ta
    >>> plan = ta.plan_mounts(100, positions=36, mounts=2)
    >>> text_alternative(ta.plots.plan_positions(plan))
    'Mounts of a plan of 36 positions: +0, +2.14 deg.'
    """
    return str(ax.get_label())


def legend(ax: Axes, title: str | None = None) -> None:
    """The legend: inside while short, else next to the axes; inside where these have neighbours."""
    handles, labels = ax.get_legend_handles_labels()
    if not handles:
        return
    names = [_shortened(name) for name in labels]
    figure = ax.get_figure(root=True)
    assert figure is not None
    shared = len(figure.axes) > 1
    if len(handles) > _MANY and not shared:
        made = ax.legend(
            handles,
            names,
            title=title,
            loc="center left",
            bbox_to_anchor=(1.01, 0.5),
            frameon=False,
            ncols=1 + (len(handles) - 1) // 18,
            fontsize="small",
            markerscale=2.0,
        )
        _opaque(made)
        return
    # Share of the width for axes that are alone in a figure.
    room = ax.bbox.width if shared else 0.9 * figure.bbox.width
    for columns in range(min(len(handles), _COLUMNS if shared else _MANY), 0, -1):
        rows = -(-len(handles) // columns)
        made = ax.legend(
            handles,
            names,
            title=title,
            loc="upper center",
            ncols=columns,
            frameon=False,
            fontsize="small" if rows == 1 else "x-small",
            markerscale=2.0,
            columnspacing=1.0,
            handletextpad=0.4,
            borderaxespad=0.2,
        )
        if made.get_window_extent().width <= room:
            break
    # Room above the data, so that no entry covers a reading.
    if ax.name != "polar":
        _room_above(ax, 0.11 + 0.09 * rows)
    _opaque(made)


def _shortened(name: str) -> str:
    """A name that leaves room for the picture."""
    half = _LONGEST // 2
    return name if len(name) <= _LONGEST else f"{name[:half]}…{name[-half:]}"


def _opaque(made: Legend) -> None:
    """A single mark of a cloud of faint points must be visible; areas stay faint."""
    from matplotlib.patches import Patch

    for handle in made.legend_handles:
        if handle is not None and not isinstance(handle, Patch):
            handle.set_alpha(1.0)


def _room_above(ax: Axes, share: float) -> None:
    low, high = ax.get_ylim()
    if ax.get_yscale() == "log":
        ax.set_ylim(low, high * (high / low) ** share)
    else:
        ax.set_ylim(low, high + share * (high - low))
