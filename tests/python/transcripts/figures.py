"""What figures of matplotlib show, as lines to be compared: words, axes, marks, colours."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import numpy as np

from .views import few_numbers, shown


def figure_lines(figure: Any) -> Iterator[str]:
    """Titles, the sentence for who does not see it, axes, legends, and the numbers of all marks."""
    around = [figure.get_suptitle(), figure.get_supxlabel(), figure.get_supylabel()]
    if any(around):
        yield "around: " + " | ".join(around)
    for axes in figure.axes:
        if not axes.get_visible():
            continue
        yield " | ".join([axes.get_title(), axes.get_xlabel(), axes.get_ylabel()])
        if not axes.get_label().startswith("<"):
            yield f"  told: {axes.get_label()}"
        yield from _axis_lines(axes)
        legend = axes.get_legend()
        if legend is not None:
            yield "  legend: " + "; ".join(text.get_text() for text in legend.get_texts())
        for text in axes.texts:
            place = few_numbers(getattr(text, "xy", text.get_position()))
            yield f"  text: {text.get_text()!r} at {place} {_colour(text.get_color())}"
        for kind, artist, points in figure_marks(axes):
            label = artist.get_label()
            yield f"  {kind} {'' if label.startswith('_') else label!r} {_style(artist)}"
            for name, values in zip("xy", points.T, strict=True):
                yield f"    {name}: {few_numbers(values)}"


def _axis_lines(axes: Any) -> Iterator[str]:
    """What an axis covers, its scale, and its ticks where they were set."""
    from matplotlib.ticker import FixedLocator, MultipleLocator

    for name, axis in (("x", axes.xaxis), ("y", axes.yaxis)):
        limits = getattr(axes, f"get_{name}lim")()
        line = f"  {name} axis: {shown(float(limits[0]))} to {shown(float(limits[1]))}"
        line += "" if axis.get_scale() == "linear" else f", {axis.get_scale()}"
        locator = axis.get_major_locator()
        if isinstance(locator, FixedLocator) and axes.name != "polar":
            places = axis.get_ticklocs()
            words = [label.get_text() for label in axis.get_ticklabels()]
            marks = [f"{w} at {shown(float(p))}" for w, p in zip(words, places, strict=True)]
            line += ", ticks " + "; ".join(marks)
        elif isinstance(locator, MultipleLocator):
            line += f", a tick every {np.diff(axis.get_ticklocs())[0]:g}"
        yield line


def figure_marks(axes: Any) -> Iterator[tuple[str, Any, np.ndarray[Any, Any]]]:
    """Kind, artist and points of everything that is drawn."""
    for line in axes.lines:
        if line.get_marker() in ("|", "_"):
            continue  # caps of error bars, which are segments beside
        # Dates as days, as they are drawn.
        yield "line", line, np.array([*map(np.asarray, line.get_data(orig=False))], dtype=float).T
    for drawn in axes.collections:
        paths = drawn.get_paths()
        scattered = hasattr(drawn, "get_sizes") and len(drawn.get_offsets()) > 1
        points = drawn.get_offsets() if scattered else [path.vertices for path in paths]
        kind = "points" if scattered else "segments" if len(paths) > 1 else "area"
        if len(points):
            yield kind, drawn, np.asarray(points if scattered else np.vstack(points), dtype=float)
    for patch in axes.patches:
        corners = patch.get_path().transformed(patch.get_patch_transform()).get_extents()
        yield "bar", patch, np.asarray(corners.get_points())


def _style(artist: Any) -> str:
    """Colour, and marker and dashes of a line."""
    if not hasattr(artist, "get_marker"):
        colours = artist.get_facecolor(), artist.get_edgecolor()
        return " ".join(_colour(c[0] if np.ndim(c) == 2 else c) for c in colours if len(c))
    dashes = artist.get_linestyle()
    face = artist.get_markerfacecolor()
    return " ".join(
        [
            _colour(artist.get_color()),
            *([] if artist.get_marker() in ("None", "", None) else [str(artist.get_marker())]),
            *(["hollow"] if isinstance(face, str) and face == "none" else []),
            *([] if dashes == "None" else [dashes]),
        ]
    )


def _colour(colour: Any) -> str:
    from matplotlib.colors import to_hex

    return to_hex(colour)
