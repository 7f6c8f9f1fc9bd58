"""Axes of matplotlib as a chart of a page: vectors that fill a box of any size, texts in HTML.

The vectors have no size and their lines no scale: one chart fits a phone, a screen and paper.
Colours are variables of the page's style, so that it turns dark without being plotted again.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from html import escape
from typing import TYPE_CHECKING, Any, Final

import numpy as np

from ..errors import MissingExtraError
from . import palette
from .canvas import ON_PAGE, page_marks

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Side of the box that vectors are plotted in; pages zoom into it.
SIDE: Final = 10_000.0
#: Height of the smaller charts of a page.
LOW: Final = "height:11rem"
#: Strokes that are dots, squares and diamonds, where each ends, and their signs in legends. PDF
#: paints a stroke of no length only if its ends are round.
_DOTS: Final = {"o": ("h0", (0, 0)), "s": ("h1", (1, 0)), "D": ("l2 2", (2, 2))}
_SIGNS: Final = {"o": "●", "s": "■", "D": "◆", "ring": "○"}
#: Part of the width at either border from which names are turned inwards.
_EDGE: Final = 0.2
#: Letters of a point's name as part of the box's width, and its height.
_WIDE, _HIGH = 0.011, 0.065


def page_axes(width: float = 7.5, height: float = 3.5) -> Axes:
    """Axes to draw a chart of a page on; ``width`` and ``height`` in inches choose its ticks.

    Raises
    ------
    MissingExtraError
        matplotlib is not installed.
    """
    try:
        from matplotlib.figure import Figure
    except ModuleNotFoundError:
        raise MissingExtraError(
            "reports need matplotlib and jinja2: pip install 'trueangle[report]'"
        ) from None
    return Figure(figsize=(width, height), dpi=ON_PAGE).add_axes((0.0, 0.0, 1.0, 1.0))


def page_chart(
    ax: Axes, *, title: str = "", grow: float = 1.0, height: str = "height:20rem"
) -> dict[str, Any]:
    """The chart of some axes: plain values that a template sets into a page.

    Parameters
    ----------
    ax : matplotlib Axes
        Of `page_axes`, with the picture in it.
    title : str
        Above the chart.
    grow : float
        Part of the width next to other charts of a figure.
    height : str
        Of the box, as a style of CSS.

    Returns
    -------
    dict
        ``title, grow, height, legend, svg, x, y, names``.
    """
    x, y = (_axis(ax, which) for which in ("x", "y"))
    lines = "".join(
        [f"M{_unit(at)} 0v{SIDE:.0f}" for at, _ in x["ticks"]]
        + [f"M0 {_unit(1.0 - at)}h{SIDE:.0f}" for at, _ in y["ticks"]]
    )
    # Room at the axis for a letter of its numbers, em.
    pad = 0.62 * max([1, *(len(text) for _, text in y["ticks"])]) + 0.7
    return {
        "title": title,
        "grow": grow,
        "height": height,
        "pad": f"{pad:.1f}em",
        "legend": list(_legend(ax)),
        "svg": f'<path class="grid" d="{lines}"/>{_strokes(ax)}',
        "x": x,
        "y": y,
        "names": _names(ax),
    }


def page_colour(colour: Any) -> str:
    """A colour as the page's style has it: a variable where it is one of the palette."""
    from matplotlib.colors import to_hex

    found = to_hex(colour).upper()
    name = palette.ON_PAGE.get(found)
    return found if name is None else f"var(--{name})"


def run_swatch(number: int) -> tuple[str, str]:
    """Colour and sign of a run, for the table of runs."""
    return page_colour(palette.run_colour(number)), _SIGNS[_kind(palette.run_marker(number))]


def _axis(ax: Axes, which: str) -> dict[str, Any]:
    """Title, limits, scale (``named`` for words) and ticks: their place on the axis, and text."""
    axis = getattr(ax, f"{which}axis")
    limits = tuple(float(v) for v in getattr(ax, f"get_{which}lim")())
    low, high = min(limits), max(limits)
    reach = 1e-9 * (high - low)
    places = np.asarray(axis.get_majorticklocs(), dtype=np.float64)
    places = places[(places >= low - reach) & (places <= high + reach)]
    texts = axis.get_major_formatter().format_ticks(places)
    # What matplotlib would typeset is a number again.
    texts = [
        f"{place:g}".replace("-", "\N{MINUS SIGN}") if "$" in text else text
        for place, text in zip(places, texts, strict=True)
    ]
    scale = axis.get_transform()
    ends = scale.transform(np.array(limits))
    at = (scale.transform(places) - ends[0]) / (ends[1] - ends[0]) if places.size else places
    return {
        "title": axis.label.get_text(),
        "limits": limits,
        "scale": axis.get_scale() if all(map(_is_number, texts)) else "named",
        "ticks": list(zip(at.tolist(), texts, strict=True)),
    }


def _is_number(text: str) -> bool:
    try:
        float(text.replace("\N{MINUS SIGN}", "-") or "0")
    except ValueError:
        return False
    return True


def _names(ax: Axes) -> list[dict[str, Any]]:
    """Texts at points, turned inwards at the borders; of those that would meet, the first."""
    found: list[dict[str, Any]] = []
    taken: list[tuple[float, float, float]] = []
    figure = ax.get_figure(root=True)
    assert figure is not None
    for text in ax.texts:
        across, up = _place(ax, text.xy) if hasattr(text, "xy") else (0.0, 0.0)
        half = 0.5 * _WIDE * len(text.get_text()) * 7.5 / figure.get_figwidth()
        side = "start" if across < _EDGE else "end" if across > 1.0 - _EDGE else "middle"
        middle = across + {"start": half, "end": -half, "middle": 0.0}[side]
        if not text.get_text() or any(
            abs(middle - a) < half + h and abs(up - b) < _HIGH for a, b, h in taken
        ):
            continue
        taken.append((middle, up, half))
        found.append({"x": across, "y": up, "side": side, "text": text.get_text()})
    return found


def _place(ax: Axes, point: Any) -> tuple[float, float]:
    across, up = ax.transAxes.inverted().transform(ax.transData.transform(point))
    return float(across), float(up)


def _legend(ax: Axes) -> Iterator[dict[str, str]]:
    """Entries of the legend as texts of the page."""
    pairs = list(zip(*ax.get_legend_handles_labels(), strict=True))
    runs = sum(label.startswith("run ") for _, label in pairs)
    for handle, label in pairs:
        # Rows of a legend beyond which the table of runs names them.
        if label.startswith("run ") and runs > 6:
            continue
        part: Any = handle[0] if isinstance(handle, tuple) else handle
        if hasattr(part, "get_marker"):
            kind = part.get_marker()
            ring = page_marks(part).get("ring", False)
            dashed = part.get_linestyle() not in ("-", "None")
            line = part.get_linestyle() == "-"
            sign = "╍" if dashed else "━" if line else _SIGNS["ring" if ring else _kind(kind)]
            colour = part.get_color()
        elif hasattr(part, "get_segments"):
            sign, colour = "━", part.get_color()[0]
        else:
            sign, colour = "▒", np.atleast_2d(part.get_facecolor())[0]
        yield {"label": label, "colour": page_colour(colour), "sign": sign}


def _kind(marker: Any) -> str:
    """Which of the shapes that a short stroke can have."""
    return marker if marker in _DOTS else "o" if marker == "." else "D"


def _strokes(ax: Axes) -> str:
    """Everything plotted on the axes but texts, from the back to the front."""
    renderer = _renderer(ax)
    drawn = [*ax.collections, *ax.patches, *ax.lines]
    for artist in sorted(drawn, key=lambda one: one.get_zorder()):
        renderer.artist = artist
        # Marks of an axis outside of its box.
        if str(artist.get_label()) != "_break":
            artist.draw(renderer)
    return "".join(renderer.parts())


def _renderer(ax: Axes) -> Any:
    """A renderer of matplotlib that writes paths of SVG into the box of the axes."""
    from matplotlib.backend_bases import RendererBase

    class Strokes(RendererBase):
        def __init__(self) -> None:
            super().__init__()
            self.artist: Any = None
            self._made: list[tuple[str, str, str]] = []

        def parts(self) -> Iterator[str]:
            """Paths, those of one style that follow each other as one."""
            for n, (tag, d, title) in enumerate(self._made):
                follows = n > 0 and self._made[n - 1][0] == tag and not title
                ends = n + 1 == len(self._made) or self._made[n + 1][0] != tag
                yield ("" if follows else f'<path{tag} d="') + d
                if title:
                    yield f'"><title>{escape(title)}</title></path>'
                elif ends or self._made[n + 1][2]:
                    yield '"/>'

        def points_to_pixels(self, points: Any) -> Any:
            return points * ON_PAGE / 72.0

        def get_canvas_width_height(self) -> tuple[float, float]:
            return ax.bbox.width, ax.bbox.height

        def _placed(self, vertices: Any) -> Any:
            at = (vertices - ax.bbox.p0) / (ax.bbox.width, ax.bbox.height)
            with np.errstate(invalid="ignore"):
                return np.rint(SIDE * (at * (1.0, -1.0) + (0.0, 1.0)))

        def _add(self, style: str, d: str, title: str = "") -> None:
            run = page_marks(self.artist).get("run")
            more = "" if run is None else f' data-run="{run}"'
            if d:
                self._made.append((f'{more} style="{style}"', d, title))

        def draw_path(self, gc: Any, path: Any, transform: Any, rgbFace: Any = None) -> None:
            width = self.points_to_pixels(gc.get_linewidth())
            whole = path.cleaned(transform, remove_nans=True, simplify=path.should_simplify)
            d = _written(self._placed(whole.vertices), whole.codes)
            styles = []
            if rgbFace is not None:
                styles.append(f"stroke:none;fill:{page_colour(rgbFace[:3])}")
                alpha = gc.get_alpha() if gc.get_forced_alpha() or len(rgbFace) == 3 else rgbFace[3]
            elif width > 0.0:
                colour = gc.get_rgb()
                styles.append(f"stroke:{page_colour(colour[:3])};stroke-width:{width:.3g}")
                alpha = gc.get_alpha() if gc.get_forced_alpha() else colour[3]
                if gc.get_dashes()[1] is not None:
                    dashes = " ".join(f"{self.points_to_pixels(v):.3g}" for v in gc.get_dashes()[1])
                    styles.append(f"stroke-dasharray:{dashes}")
            else:
                return
            styles += [f"opacity:{alpha:.3g}"] if alpha < 1.0 else []
            self._add(";".join(styles), d)

        def draw_markers(
            self, gc: Any, marker_path: Any, marker_trans: Any, path: Any, trans: Any,
            rgbFace: Any = None,
        ) -> None:  # fmt: skip
            if not hasattr(self.artist, "get_marker"):  # an area: one path of a collection
                for x, y in trans.transform(path.vertices):
                    moved = marker_trans.frozen().translate(x, y)
                    self.draw_path(gc, marker_path, moved, rgbFace)
                return
            extents = marker_path.get_extents(marker_trans)
            kind = _kind(self.artist.get_marker())
            hollow = rgbFace is None or (len(rgbFace) > 3 and rgbFace[3] == 0.0)
            if min(extents.width, extents.height) < 0.5:  # an end of an error bar
                return
            marks = page_marks(self.artist)
            at = self._placed(trans.transform(path.vertices))
            inside = np.isfinite(at).all(axis=1)
            inside &= (at >= 0.0).all(axis=1) & (at <= SIDE).all(axis=1)
            size = self.points_to_pixels(self.artist.get_markersize())
            size *= {"o": 1.0, "s": 0.9, "D": 0.8}[kind] if self.artist.get_marker() != "." else 0.6
            colour = gc.get_rgb() if hollow else rgbFace
            style = f"stroke:{page_colour(colour[:3])};stroke-width:{size:.3g}"
            style += "" if kind == "o" else ";stroke-linecap:square"
            style += f";opacity:{gc.get_alpha():.3g}" if gc.get_alpha() < 1.0 else ""
            dot, end_at = _DOTS[kind]
            inner = f"stroke:var(--back);stroke-width:{max(size - 2.6, 1.0):.3g}"
            if titles := marks.get("titles"):
                for (x, y), keep, title in zip(at.astype(int), inside, titles, strict=True):
                    if keep:
                        self._add(style, f"M{x} {y}{dot}", title)
                        if marks.get("ring"):
                            self._add(inner, f"M{x} {y}{dot}", title)
                return
            d = _dots(at[inside].astype(int), dot, end_at)
            self._add(style, d)
            if marks.get("ring"):
                self._add(inner, d)

    return Strokes()


def _dots(places: Any, dot: str, end_at: tuple[int, int]) -> str:
    """Short strokes, each from the end of the one before: a third of the letters."""
    spots = np.unique(places, axis=0)
    if not spots.size:
        return ""
    moved = np.diff(spots, axis=0) - end_at
    first = f"M{spots[0, 0]} {spots[0, 1]}{dot}"
    return first + "".join(f"m{a}{b:+d}{dot}" for a, b in moved.tolist())


def _written(places: Any, codes: Sequence[int] | None) -> str:
    """A path of straight lines."""
    parts = []
    for (x, y), code in zip(places, codes if codes is not None else (), strict=True):
        if code == 79:
            parts.append("Z")
        elif code in (1, 2) and math.isfinite(x) and math.isfinite(y):
            parts.append(f"{'M' if code == 1 else 'L'}{x:.0f} {y:.0f}")
    return "".join(parts)


def _unit(at: float) -> str:
    return f"{SIDE * at:.0f}"
