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

from ..errors import MissingExtraError
from .dotcopies import hover_copy, renderer_copy

__all__ = ["Chart", "Figure", "figure", "run_colour", "run_marker", "swatch"]

Array = NDArray[np.float64]

#: Part of a chart's width at either border from which texts are turned inwards.
_EDGE: Final = 0.3

#: Decades of a logarithmic axis up to which it has ticks within them.
_FEW_DECADES: Final = 4

#: Bits of a drawn number's mantissa: 1.5e-5 of it.
_KEPT_BITS: Final = 15

#: A figure of the report: its alternative text and the charts that it consists of.
Figure = dict[str, Any]

#: Colours of runs in the style sheet, and markers: every run of the first 36 has a pair of its own.
_COLOURS: Final = 6
_MARKERS: Final = ("circle", "square", "triangle", "diamond", "inverted_triangle", "cross")
_GLYPHS: Final = ("●", "■", "▲", "◆", "▼", "✚")


def run_colour(number: int) -> str:
    """CSS variable of a run's colour."""
    return f"run-{number % _COLOURS}"


def run_marker(number: int) -> str:
    """Marker of a run; another one with the same colour every six runs."""
    return _MARKERS[_shape(number)]


def swatch(number: int) -> tuple[str, str]:
    """Colour and symbol of a run, for the table of runs."""
    return f"var(--{run_colour(number)})", _GLYPHS[_shape(number)]


def _shape(number: int) -> int:
    return (number + number // _COLOURS) % len(_MARKERS)


def figure(alt: str, charts: Sequence[Chart], arrangement: str = "row") -> Figure:
    """One figure: alternative text, and its charts in a row, stacked or as small multiples."""
    drawn = [chart.drawn() for chart in charts]
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
        try:
            from bokeh import models, plotting
        except ImportError:
            raise MissingExtraError(
                "reports need bokeh and jinja2: pip install 'trueangle[report]'"
            ) from None
        self._models = models
        self.title, self.grow, self.height_rem = title, grow, height_rem
        #: What the x axis shows, where it was given.
        self.x_range = x_range or (0.0, 0.0)
        ranges: dict[str, Any] = {}
        if x_range is not None:
            ranges["x_range"] = x_range
        if y_range is not None:
            ranges["y_range"] = y_range
        if categories is not None:
            ranges["y_range"] = models.FactorRange(factors=list(reversed(list(categories))))
        self._figure = plotting.figure(
            sizing_mode="stretch_both",
            toolbar_location=None,
            # The page's paper shows through; a border once drawn would stay at the edges.
            border_fill_color=None,
            border_line_color=None,
            background_fill_color=None,
            # The last number of the axis reaches beyond it.
            min_border_right=14,
            tools=[],
            x_axis_type="log" if log_x else "auto",
            y_axis_type="log" if log_y else "auto",
            x_axis_label=x,
            y_axis_label=y,
            **ranges,
        )
        if log_x and x_range is not None:
            self._log_axis(self._figure.xaxis, self._figure.xgrid, *x_range)
        if log_y and y_range is not None:
            self._log_axis(self._figure.yaxis, self._figure.ygrid, *y_range)
        if joined:
            self._figure.yaxis.visible = False
        zoom = models.BoxZoomTool()
        self._figure.add_tools(zoom, models.PanTool(), models.ResetTool())
        self._figure.toolbar.active_drag = zoom
        #: Legend, set as text of the page: label -> colour and sign.
        self._legend: dict[str, tuple[str, str]] = {}
        self._hover: list[Any] = []
        #: Dots, each with the number of renderers below it and its line of text.
        self._dots: list[tuple[int, dict[str, Any], str]] = []

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
        columns: Mapping[str, Sequence[Any]] | None = None,
        hollow: bool = False,
    ) -> None:
        """Dots; ``hover`` is a line of text with ``@{column}`` in it."""
        data = {"x": _short(x), "y": _short(y)} | {k: list(v) for k, v in (columns or {}).items()}
        drawn = renderer_copy(marker, size, hollow, data, _tags(colour, run))
        self._dots.append((len(self._figure.renderers), drawn, hover))
        if label:
            sign = "○" if hollow else _GLYPHS[_MARKERS.index(marker)]
            self._legend.setdefault(label, (colour, sign))

    def line(
        self, x: Array, y: Array, *, colour: str, label: str = "", width: float = 1.5,
        dash: str = "solid", run: int | None = None, hover: str = "",
    ) -> None:  # fmt: skip
        """A line through the points."""
        drawn = self._figure.line(
            "x", "y", source=self._source(x, y), line_width=width, line_dash=dash
        )
        self._add(drawn, colour, label, run, hover, "━" if dash == "solid" else "╍")

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
        source = self._models.ColumnDataSource(
            {"x": _short(x), "low": _short(low), "y": _short(high)}
        )
        drawn = self._figure.varea("x", "low", "y", source=source, fill_alpha=0.25)
        self._add(drawn, colour, label, None, "", "▒")

    def stems(
        self, x: Array, low: float | Array, high: Array, *, colour: str, label: str = "",
        width: float = 3.0,
    ) -> None:  # fmt: skip
        """Upright lines from ``low`` to ``high``."""
        source = self._source(x, high)
        source.data["low"] = _short(np.broadcast_to(np.asarray(low, dtype=np.float64), high.shape))
        drawn = self._figure.segment(
            x0="x", y0="low", x1="x", y1="y", source=source, line_width=width, line_cap="butt"
        )
        self._add(drawn, colour, label, None, "", "┃")

    def ticks(self, x: Array, y: Array, half: float, *, colour: str, label: str = "") -> None:
        """Short level lines of half width ``half`` at every point."""
        source = self._models.ColumnDataSource(
            {"x0": _short(x - half), "x1": _short(x + half), "y": _short(y)}
        )
        drawn = self._figure.segment(
            x0="x0", y0="y", x1="x1", y1="y", source=source, line_width=2.0
        )
        self._add(drawn, colour, label, None, "", "━")

    def bars(
        self, names: Sequence[str], values: Array, *, colour: str, hover: str = "",
        low: Array | None = None, high: Array | None = None,
    ) -> None:  # fmt: skip
        """Level bars of the categories, with intervals where given."""
        source = self._models.ColumnDataSource({"y": list(names), "x": _short(values)})
        drawn = self._figure.hbar(y="y", right="x", height=0.6, source=source, line_alpha=0.0)
        self._add(drawn, colour, "", None, hover)
        if low is not None and high is not None:
            ends = self._models.ColumnDataSource(
                {"y": list(names), "x0": _short(low), "x1": _short(high)}
            )
            error = self._figure.segment(
                x0="x0", x1="x1", y0="y", y1="y", source=ends, line_width=2.0
            )
            self._add(error, "fore", "", None, "")

    def level_stems(
        self, names: Sequence[str], low: float, values: Array, *, colour: str, hover: str = ""
    ) -> None:
        """Level lines of the categories from ``low`` to a dot at their value."""
        data = {"y": list(names), "x": _short(values), "low": _short(np.full(len(names), low))}
        source = self._models.ColumnDataSource(data)
        line = self._figure.segment(
            x0="low", x1="x", y0="y", y1="y", source=source, line_width=3.0, line_cap="butt"
        )
        self._add(line, colour, "", None, "")
        dot = self._figure.scatter("x", "y", source=source, size=11.0, line_alpha=0.0)
        self._add(dot, colour, "", None, hover)

    def upright(self, x: float, *, label: str) -> None:
        """A dashed line over the whole height."""
        span = _span(x)
        span.tags = ["colour:fore"]
        self._figure.add_layout(span)
        self._legend[label] = ("fore", "╍")

    def labels(self, x: Array, y: Array, texts: Sequence[str], inside: tuple[float, float]) -> None:
        """Texts above points, turned inwards from the borders ``inside`` of the chart."""
        low, high = inside
        place = (np.asarray(x, dtype=np.float64) - low) / (high - low)
        sides = ["left" if p < _EDGE else "right" if p > 1.0 - _EDGE else "center" for p in place]
        source = self._models.ColumnDataSource(
            {"x": _short(x), "y": _short(y), "text": list(texts), "side": sides}
        )
        drawn = self._figure.text(
            "x", "y", "text", source=source, text_align="side", text_baseline="bottom",
            y_offset=-7, text_font_size="11px",
        )  # fmt: skip
        self._add(drawn, "fore", "", None, "")

    def angle_axis(self, low: float, high: float, most: float = 9.0) -> None:
        """Ticks at whole parts of a turn, about ``most`` of them."""
        for step in (0.1, 0.2, 0.5, 1.0, 2.0, 5.0, 10.0, 15.0, 30.0, 45.0, 90.0, 360.0, 1800.0):
            if (high - low) / step <= most:
                first = np.ceil(low / step)
                ticks = step * np.arange(first, np.floor(high / step) + 1.0)
                self._figure.xaxis.ticker = self._models.FixedTicker(ticks=ticks.tolist())
                return

    def whole_axis(self, low: float, high: float, most: int) -> None:
        """Ticks at whole numbers, at most so many."""
        step = next(
            s for s in (1, 2, 5, 10, 20, 50, 100, 200, 500, 10**9) if (high - low) / s < most
        )
        ticks = np.arange(step * np.ceil(low / step), high + 1e-9, step)
        self._figure.xaxis.ticker = self._models.FixedTicker(ticks=ticks.tolist())

    def _log_axis(self, axis: Any, grid: Any, low: float, high: float) -> None:
        """Ticks at 1, 2 and 5 of every decade while these are few, else at decades alone."""
        decades = np.arange(np.floor(np.log10(low)), np.ceil(np.log10(high)) + 1.0)
        marks = (1.0, 2.0, 5.0) if decades.size <= _FEW_DECADES else (1.0,)
        ticks = [m * 10.0**d for d in decades for m in marks if low <= m * 10.0**d <= high]
        ticker = self._models.FixedTicker(ticks=ticks)
        axis.ticker = grid.ticker = ticker
        axis.formatter = self._models.BasicTickFormatter(use_scientific=False)

    def drawn(self) -> dict[str, Any]:
        """The chart as plain values, ready for JSON."""
        from bokeh import __version__
        from bokeh.document import Document

        for text, renderers in _grouped(self._hover):
            self._figure.add_tools(
                self._models.HoverTool(renderers=renderers, tooltips=text, mode="mouse")
            )
        document = Document(title="")
        document.add_root(self._figure)
        written = document.to_json(deferred=False)
        root: dict[str, Any] = written["roots"][0]  # type: ignore[assignment]
        # What is referred to, as renderers are by tools, must stand before that.
        root["attributes"] = {"renderers": [], **root["attributes"]}
        self._add_dots(root["attributes"])
        return {
            "title": self.title,
            "grow": self.grow,
            "height_rem": self.height_rem,
            "legend": [
                {"label": label, "colour": colour, "sign": sign}
                for label, (colour, sign) in self._legend.items()
            ],
            # What `bokeh.embed.json_item` gives, without going over all models four times.
            "document": {
                "target_id": None,
                "root_id": self._figure.id,
                "doc": written,
                "version": __version__,
            },
        }

    def _add_dots(self, written: dict[str, Any]) -> None:
        """Put the dots among the renderers of the written figure, each above what it was above."""
        renderers = written["renderers"]
        for place, drawn, _ in reversed(self._dots):
            renderers.insert(place, drawn)
        for text, shown in _grouped([(text, drawn) for _, drawn, text in self._dots if text]):
            written["toolbar"]["attributes"]["tools"].append(hover_copy(text, shown))

    def _source(self, x: Array, y: Array) -> Any:
        return self._models.ColumnDataSource({"x": _short(x), "y": _short(y)})

    def _add(
        self, drawn: Any, colour: str, label: str, run: int | None, hover: str, sign: str = ""
    ) -> None:
        drawn.tags = _tags(colour, run)
        # Selections and hovering change nothing: one glyph is enough.
        drawn.nonselection_glyph = drawn.muted_glyph = None
        if label:
            self._legend.setdefault(label, (colour, sign))
        if hover:
            self._hover.append((hover, drawn))


def _tags(colour: str, run: int | None) -> list[str]:
    return [f"colour:{colour}"] + ([f"run:{run}"] if run is not None else [])


def _span(x: float) -> Any:
    from bokeh.models.annotations import Span

    return Span(location=x, dimension="height", line_dash="dashed", line_width=1.5)


def _grouped(hover: Sequence[tuple[str, Any]]) -> list[tuple[str, list[Any]]]:
    """Renderers of the same text together: one tool for all of them."""
    found: dict[str, list[Any]] = {}
    for text, drawn in hover:
        found.setdefault(text, []).append(drawn)
    return list(found.items())


def _short(values: Array) -> NDArray[np.float32]:
    """For drawing only, half the bytes: numbers on the page come from the content.

    Rounded to `_KEPT_BITS` of the mantissa, 0.005 of 360 deg: what no screen shows would be
    a fifth of the figures' bytes, for noise cannot be packed.
    """
    dropped = 23 - _KEPT_BITS
    bits = np.asarray(values, dtype=np.float32).view(np.uint32)
    # A carry into the exponent is the next power of two, as it has to be; infinity stays.
    finite = (bits & 0x7F800000) != 0x7F800000
    rounded = np.where(finite, bits + np.uint32(1 << (dropped - 1)), bits)
    return np.asarray(rounded & np.uint32(0xFFFFFFFF << dropped & 0xFFFFFFFF)).view(np.float32)
