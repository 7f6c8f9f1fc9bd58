"""Interactive charts of the report: plain dots, lines, bands and bars on two axes.

A chart is a Bokeh document as JSON, which the page's script draws. Colours come from the
page (light, dark, print): what is drawn carries ``colour:NAME`` of a CSS variable, and
what belongs to one run ``run:NUMBER``, by which the page shows and hides it everywhere.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ..support.arrays import Array
from .bokehmodels import (
    Model,
    bokeh_columns,
    bokeh_field,
    bokeh_model,
    bokeh_reference,
    bokeh_value,
)
from .chartaxes import ChartAxis
from .stills import StillMark, still_picture

#: Part of a chart's width at either border from which texts are turned inwards.
_EDGE: Final = 0.3

#: Bits of a drawn number's mantissa: 6e-5 of it.
_KEPT_BITS: Final = 13

#: Part of the page's width that a chart takes where its neighbours do not decide.
_SHARES: Final = {"stacked": 1.0, "above": 1.0, "multiples": 1.0 / 3.0}

#: A figure of the report: its alternative text and the charts that it consists of.
Figure = dict[str, Any]

#: Colours of runs in the style sheet, and markers: every run of the first 36 has a pair of its own.
_COLOURS: Final = 6
_MARKERS: Final = ("circle", "square", "triangle", "diamond", "inverted_triangle", "cross")
_GLYPHS: Final = ("●", "■", "▲", "◆", "▼", "✚")


def css_run_colour(number: int) -> str:
    """CSS variable of a run's colour."""
    return f"run-{number % _COLOURS}"


def chart_run_marker(number: int) -> str:
    """Marker of a run; another one with the same colour every six runs."""
    return _MARKERS[_shape(number)]


def run_swatch(number: int) -> tuple[str, str]:
    """Colour and symbol of a run, for the table of runs."""
    return f"var(--{css_run_colour(number)})", _GLYPHS[_shape(number)]


def _shape(number: int) -> int:
    return (number + number // _COLOURS) % len(_MARKERS)


def chart_figure(alt: str, charts: Sequence[Chart], arrangement: str = "row") -> Figure:
    """One figure: alternative text, and its charts in a row, stacked or as small multiples."""
    grown = sum(chart.grow for chart in charts)
    drawn = [
        chart.drawn() | {"still": chart.still(_SHARES.get(arrangement, chart.grow / grown))}
        for chart in charts
    ]
    return {"alt": alt, "charts": drawn, "arrangement": arrangement}


class Chart:
    """One pair of axes.

    Parameters
    ----------
    x, y : str
        Titles of the axes, with units.
    x_range, y_range : (float, float), optional
        By default what the data cover.
    log_x, log_y : bool
    categories : list of str, optional
        The y axis lists these, from the top down, instead of numbers.
    title : str
        Stands above the chart, as text of the page.
    grow : float
        Share of the width beside other charts of the figure.
    height_rem : float
        Height in units of the page's text.
    joined : bool
        It goes on with the y axis of the chart before it and shows none of its own.
    """

    def __init__(
        self,
        x: str,
        y: str,
        *,
        x_range: tuple[float, float] | None = None,
        y_range: tuple[float, float] | None = None,
        log_x: bool = False,
        log_y: bool = False,
        categories: Sequence[str] | None = None,
        title: str = "",
        grow: float = 1.0,
        height_rem: float = 22.0,
        joined: bool = False,
    ) -> None:
        self.title, self.grow, self.height_rem = title, grow, height_rem
        #: What the x axis shows, where it was given.
        self.x_range = x_range or (0.0, 0.0)
        self._across = ChartAxis(x, x_range, log_x)
        self._up = ChartAxis(y, y_range, log_y, categories, visible=not joined)
        self._renderers: list[Model] = []
        self._spans: list[Model] = []
        self._marks: list[StillMark] = []
        self._uprights: list[float] = []
        #: Legend, set as text of the page: label -> colour and sign.
        self._legend: dict[str, tuple[str, str]] = {}
        #: Renderers by the line of text that is shown over them.
        self._hover: dict[str, list[Model]] = {}

    def dots(
        self,
        x: Array,
        y: Array,
        *,
        colour: str,
        label: str = "",
        run: int | None = None,
        marker: str = "circle",
        size: float = 4.0,
        hover: str = "",
        more: Mapping[str, Sequence[Any]] | None = None,
        hollow: bool = False,
    ) -> None:
        """Dots; ``hover`` is a line of text with ``@{column}`` of ``more`` columns in it."""
        self._marks.append(StillMark("dots", (x, y), colour, size))
        data = {"x": _short(x), "y": _short(y), **(more or {})}
        sign = "○" if hollow else _GLYPHS[_MARKERS.index(marker)]
        self._add(
            _marks(marker, size, hollow), bokeh_columns(data), colour, label, run, hover, sign
        )

    def line(
        self, x: Array, y: Array, *, colour: str, label: str = "", width: float = 1.5,
        dash: str = "solid", run: int | None = None, hover: str = "",
    ) -> None:  # fmt: skip
        """A line through the points."""
        self._marks.append(StillMark("line", (x, y), colour, width))
        glyph = bokeh_model(
            "Line", x=bokeh_field("x"), y=bokeh_field("y"), line_width=width, line_dash=dash
        )
        sign = "━" if dash == "solid" else "╍"
        self._add(glyph, _points(x, y), colour, label, run, hover, sign)

    def band(
        self,
        x: Array,
        low: Array,
        high: Array,
        *,
        colour: str,
        label: str = "",
        alpha: float = 0.25,
    ) -> None:
        """The area between two curves."""
        self._marks.append(StillMark("band", (x, low, high), colour))
        glyph = bokeh_model(
            "VArea",
            x=bokeh_field("x"),
            y1=bokeh_field("low"),
            y2=bokeh_field("y"),
            fill_alpha=alpha,
        )
        source = bokeh_columns({"x": _short(x), "low": _short(low), "y": _short(high)})
        self._add(glyph, source, colour, label, sign="▒")

    def stems(
        self, x: Array, low: float | Array, high: Array, *, colour: str, label: str = "",
        width: float = 3.0,
    ) -> None:  # fmt: skip
        """Upright lines from ``low`` to ``high``."""
        feet = np.broadcast_to(np.asarray(low, dtype=np.float64), high.shape)
        self._marks.append(StillMark("segments", (x, feet, x, high), colour, width))
        source = bokeh_columns({"x": _short(x), "y": _short(high), "low": _short(feet)})
        self._add(_segment("x", "low", "x", "y", width), source, colour, label, sign="┃")

    def ticks(self, x: Array, y: Array, half: float, *, colour: str, label: str = "") -> None:
        """Short level lines of half width ``half`` at every point."""
        self._marks.append(StillMark("segments", (x - half, y, x + half, y), colour, 2.0))
        source = bokeh_columns({"x0": _short(x - half), "x1": _short(x + half), "y": _short(y)})
        self._add(_segment("x0", "y", "x1", "y", 2.0), source, colour, label, sign="━")

    def level_dots(self, names: Sequence[str], values: Array, *, colour: str, hover: str) -> None:
        """A dot of each category at its value."""
        self._marks.append(StillMark("dots", (values, list(names)), colour, 11.0))
        source = bokeh_columns({"y": names, "x": _short(values)})
        self._add(_marks("circle", 11.0), source, colour, hover=hover)

    def upright(self, x: float, *, label: str) -> None:
        """A dashed line over the whole height."""
        self._uprights.append(x)
        self._spans.append(
            bokeh_model(
                "Span",
                location=x,
                dimension="height",
                line_dash="dashed",
                line_width=1.5,
                tags=_tags("fore"),
            )
        )
        self._legend[label] = ("fore", "╍")

    def labels(
        self,
        x: Array,
        y: Array,
        texts: Sequence[str],
        inside: tuple[float, float],
        below: Sequence[bool] = (),
    ) -> None:
        """Texts above points, or below, turned inwards from the borders ``inside`` of the chart."""
        low, high = inside
        place = (np.asarray(x, dtype=np.float64) - low) / (high - low)
        sides = ["left" if p < _EDGE else "right" if p > 1.0 - _EDGE else "center" for p in place]
        glyph = bokeh_model(
            "Text",
            x=bokeh_field("x"),
            y=bokeh_field("y"),
            text=bokeh_field("text"),
            text_align=bokeh_field("side"),
            text_baseline=bokeh_field("line"),
            text_font_size=bokeh_value("11px"),
            y_offset=bokeh_field("off"),
        )
        under = list(below) or [False] * len(texts)
        source = bokeh_columns(
            {
                "x": _short(x),
                "y": _short(y),
                "text": texts,
                "side": sides,
                "line": ["top" if low else "bottom" for low in under],
                "off": [7 if low else -7 for low in under],
            }
        )
        self._add(glyph, source, "fore")

    def angle_axis(self, low: float, high: float, most: float = 9.0) -> None:
        """Ticks at whole parts of a turn, about ``most`` of them."""
        self._across.at_angles(low, high, most)

    def whole_axis(self, low: float, high: float, most: int) -> None:
        """Ticks at whole numbers, at most so many."""
        self._across.at_whole(low, high, most)

    def drawn(self) -> dict[str, Any]:
        """The chart as plain values, ready for JSON."""
        root = self._root()
        return {
            "title": self.title,
            "grow": self.grow,
            "height_rem": self.height_rem,
            "legend": [
                {"label": label, "colour": colour, "sign": sign}
                for label, (colour, sign) in self._legend.items()
            ],
            # The page's script adds the version of the library that it has.
            "document": {"root_id": root["id"], "doc": {"title": "", "roots": [root]}},
        }

    def still(self, share: float) -> str:
        """The chart as SVG that takes this part of the page's width."""
        return still_picture(
            self._marks, self._across, self._up, self.height_rem, share, self._uprights
        )

    def _root(self) -> Model:
        below, across = self._across.drawn(0)
        left, up = self._up.drawn(1)
        zoom = bokeh_model("BoxZoomTool")
        hover = [
            bokeh_model(
                "HoverTool",
                renderers=[bokeh_reference(r) for r in shown],
                tooltips=text,
                mode="mouse",
            )
            for text, shown in self._hover.items()
        ]
        tools = [zoom, bokeh_model("PanTool"), bokeh_model("ResetTool"), *hover]
        return bokeh_model(
            "Figure",
            # What is referred to, as renderers are by tools and axes by grids, stands before that.
            renderers=self._renderers,
            x_range=self._across.range(),
            y_range=self._up.range(),
            x_scale=self._across.scale(),
            y_scale=self._up.scale(),
            toolbar=bokeh_model("Toolbar", tools=tools, active_drag=bokeh_reference(zoom)),
            toolbar_location=None,
            left=[left],
            below=[below],
            center=[across, up, *self._spans],
            sizing_mode="stretch_both",
            # The page's paper shows through; a border once drawn would stay at the edges.
            border_fill_color=None,
            border_line_color=None,
            background_fill_color=None,
            # The last number of the axis reaches beyond it.
            min_border_right=14,
        )

    def _add(
        self, glyph: Model, source: Model, colour: str, label: str = "", run: int | None = None,
        hover: str = "", sign: str = "",
    ) -> None:  # fmt: skip
        drawn = bokeh_model(
            "GlyphRenderer",
            tags=_tags(colour, run),
            data_source=source,
            glyph=glyph,
            # Selections and hovering change nothing: one glyph is enough.
            nonselection_glyph=None,
            muted_glyph=None,
        )
        self._renderers.append(drawn)
        if label:
            self._legend.setdefault(label, (colour, sign))
        if hover:
            self._hover.setdefault(hover, []).append(drawn)


def _tags(colour: str, run: int | None = None) -> list[str]:
    return [f"colour:{colour}"] + ([f"run:{run}"] if run is not None else [])


def _points(x: Array, y: Array) -> Model:
    return bokeh_columns({"x": _short(x), "y": _short(y)})


def _marks(marker: str, size: float, hollow: bool = False) -> Model:
    return bokeh_model(
        "Scatter",
        x=bokeh_field("x"),
        y=bokeh_field("y"),
        size=bokeh_value(size),
        marker=bokeh_value(marker),
        fill_alpha=bokeh_value(0.0 if hollow else 1.0),
        line_alpha=bokeh_value(1.0 if hollow or marker == "cross" else 0.0),
    )


def _segment(x0: str, y0: str, x1: str, y1: str, width: float) -> Model:
    """Lines between two points each, which end with these."""
    return bokeh_model(
        "Segment",
        x0=bokeh_field(x0),
        y0=bokeh_field(y0),
        x1=bokeh_field(x1),
        y1=bokeh_field(y1),
        line_width=bokeh_value(width),
        line_cap=bokeh_value("butt"),
    )


def _short(values: Array) -> NDArray[np.float32]:
    """For drawing only, half the bytes: numbers on the page come from the content.

    Rounded to `_KEPT_BITS` of the mantissa, 0.02 of 360 deg: what no screen shows would be
    a fifth of the figures' bytes, for noise cannot be packed.
    """
    dropped = 23 - _KEPT_BITS
    bits = np.asarray(values, dtype=np.float32).view(np.uint32)
    # A carry into the exponent is the next power of two, as it has to be; infinity stays.
    finite = (bits & 0x7F800000) != 0x7F800000
    rounded = np.where(finite, bits + np.uint32(1 << (dropped - 1)), bits)
    return np.asarray(rounded & np.uint32(0xFFFFFFFF << dropped & 0xFFFFFFFF)).view(np.float32)
