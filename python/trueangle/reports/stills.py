"""Still pictures of charts, for paper and for who runs no scripts: SVG in the colours of the page.

They need no library and no time: a page that is printed as soon as it is open holds every figure.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..support.arrays import Array
from .chartaxes import ChartAxis

#: Width of a picture, pixels of its height to a rem, and the margins: left, right, top, bottom.
_WIDTH: Final = 680.0
_REM: Final = 13.0
_LEFT, _RIGHT, _TOP, _BOTTOM = 64.0, 12.0, 6.0, 34.0
#: Room for names of categories, a letter.
_LETTER: Final = 6.2
#: Dots of one colour and size at most: more are one blot on paper.
_MOST: Final = 120
#: Ticks of an axis, about.
_TICKS: Final = 6


class StillMark(NamedTuple):
    """What is drawn: ``kind`` dots, line, band or segments, with its arrays."""

    kind: str
    arrays: tuple[Any, ...]
    colour: str
    size: float = 1.5


class StillPicture(NamedTuple):
    """A still picture with its caption and what it shows, in words."""

    title: str
    alt: str
    svg: str


def still_picture(
    marks: Sequence[StillMark],
    across: ChartAxis,
    up: ChartAxis,
    height_rem: float,
    share: float,
    uprights: Sequence[float] = (),
) -> str:
    """A chart as SVG: ``share`` is its part of the page's width, lines stand at ``uprights``."""
    width, height = max(_WIDTH * share, 90.0), _REM * height_rem
    names = (_LETTER * len(name) + 8.0 for name in up.categories or ())
    left = max([_LEFT, *names]) if up.visible else 8.0
    place = _Placement(marks, across, up, (left, width - _RIGHT), (height - _BOTTOM, _TOP))
    parts = [_axes(place, across, up, width, height)]
    parts += [_drawn(mark, place) for mark in _together(marks)]
    foot, head = place.ends[1]
    parts += [
        f'<path class="upright" d="M{float(place.of(x, 0)):.0f} {head:.0f}V{foot:.0f}"/>'
        for x in uprights
    ]
    return (
        f'<svg class="still" viewBox="0 0 {width:.0f} {height:.0f}" aria-hidden="true">'
        f"{''.join(parts)}</svg>"
    )


class _Placement:
    """Numbers to places of the picture, as its axes have them."""

    def __init__(
        self,
        marks: Sequence[StillMark],
        across: ChartAxis,
        up: ChartAxis,
        x: tuple[float, float],
        y: tuple[float, float],
    ) -> None:
        self.categories = list(up.categories or ())
        self.ends = (x, y)
        self.logs = (across.log, up.log)
        self.limits = (
            across.limits or _covered([m.arrays[0] for m in marks]),
            (len(self.categories) - 0.5, -0.5)
            if self.categories
            else up.limits or _covered([a for m in marks for a in m.arrays[1:]]),
        )

    def of(self, values: Any, dimension: int) -> Array:
        """Pixels along one dimension."""
        if dimension and self.categories:
            values = [self.categories.index(name) for name in values]
        low, high = self.limits[dimension]
        start, end = self.ends[dimension]
        numbers = np.asarray(values, dtype=np.float64)
        if self.logs[dimension]:
            numbers = np.log10(np.maximum(numbers, 1e-300))
            low, high = math.log10(low), math.log10(high)
        return start + (numbers - low) / ((high - low) or 1.0) * (end - start)

    def inside(self, x: Array, y: Array) -> NDArray[np.bool_]:
        """What lies within the frame; it is as wide as the axes."""
        (left, right), (low, high) = self.ends
        return (x >= left - 1) & (x <= right + 1) & (y <= low + 1) & (y >= high - 1)


def _covered(parts: list[Any]) -> tuple[float, float]:
    known = [np.asarray(p, dtype=np.float64).ravel() for p in parts if np.size(p)]
    values = np.concatenate(known) if known else np.zeros(1)
    low, high = float(np.nanmin(values)), float(np.nanmax(values))
    margin = 0.05 * (high - low) or 1.0
    return low - margin, high + margin


def _together(marks: Sequence[StillMark]) -> list[StillMark]:
    """Dots of one colour and size as one mark, where the first of them stands: runs are many."""
    found: dict[tuple[str, float], list[StillMark]] = {}
    for mark in marks:
        if mark.kind == "dots":
            found.setdefault((mark.colour, mark.size), []).append(mark)
    joined = []
    for mark in marks:
        if mark.kind != "dots":
            joined.append(mark)
        elif same := found.pop((mark.colour, mark.size), []):
            columns = tuple(
                np.concatenate(part) for part in zip(*(m.arrays for m in same), strict=True)
            )
            joined.append(mark._replace(arrays=columns))
    return joined


def _drawn(mark: StillMark, place: _Placement) -> str:
    style = f'style="color:var(--{mark.colour})"'
    if mark.kind == "segments":
        x0, y0, x1, y1 = mark.arrays
        ends = [place.of(v, d) for v, d in ((x0, 0), (y0, 1), (x1, 0), (y1, 1))]
        ends = [np.broadcast_to(e, ends[0].shape) for e in ends]
        path = "".join(
            f"M{a:.0f} {b:.1f}L{c:.0f} {d:.1f}" for a, b, c, d in zip(*ends, strict=True)
        )
        return f'<path class="flat" {style} d="{path}" stroke-width="{mark.size:g}"/>'
    x, y = place.of(mark.arrays[0], 0), place.of(mark.arrays[1], 1)
    if mark.kind == "dots":
        keep = place.inside(x, y)
        x, y = x[keep], y[keep]
        step = max(1, math.ceil(x.size / _MOST))
        spots = sorted({(round(a), round(b)) for a, b in zip(x[::step], y[::step], strict=True)})
        # From each to the next: a third of the letters.
        moves = zip([(0, 0), *spots], spots, strict=False)
        path = "".join(f"m{c - a}{d - b:+d}h0" for (a, b), (c, d) in moves)
        return f'<path {style} d="{path}" stroke-width="{0.7 * mark.size:g}"/>'
    step = max(1, x.size // (int(_WIDTH) // 2))
    if mark.kind == "band":
        line = _line(x[::step], y[::step], 0)
        back = _line(x[::-step], place.of(mark.arrays[2], 1)[::-step], 0)
        return f'<path class="band" {style} d="M{line}L{back}Z"/>'
    line = _line(x[::step], y[::step], 1)
    return f'<path {style} d="M{line}" stroke-width="{mark.size:g}"/>'


def _line(x: Array, y: Array, decimals: int) -> str:
    return "L".join(f"{a:.0f} {b:.{decimals}f}" for a, b in zip(x, y, strict=True))


def _axes(place: _Placement, across: ChartAxis, up: ChartAxis, width: float, height: float) -> str:
    (left, right), (foot, head) = place.ends
    # Frame and grid are one path; its style and that of the texts are the page's.
    lines = [f"M{left:.0f} {head:.0f}H{right:.0f}V{foot:.0f}H{left:.0f}Z"]
    across_texts, up_texts = [], []
    for tick in _ticks(across, place.limits[0]):
        at = float(place.of(tick, 0))
        lines.append(f"M{at:.0f} {head:.0f}V{foot:.0f}")
        across_texts.append(_text(at, foot + 13.0, _number(tick)))
    across_texts.append(_text(0.5 * (left + right), height - 6.0, across.title))
    if place.categories:
        up_texts += [
            _text(left - 6.0, float(place.of([n], 1)[0]) + 3.5, n) for n in place.categories
        ]
    elif up.visible:
        for tick in _ticks(up, place.limits[1]):
            at = float(place.of(tick, 1))
            lines.append(f"M{left:.0f} {at:.0f}H{right:.0f}")
            up_texts.append(_text(left - 6.0, at + 3.5, _number(tick)))
        middle = 0.5 * (foot + head)
        across_texts.append(
            _text(11.0, middle, up.title, f' transform="rotate(-90 11 {middle:.0f})"')
        )
    return (
        f'<g class="axes"><path d="{"".join(lines)}"/>{"".join(across_texts)}'
        f'<g class="up">{"".join(up_texts)}</g></g>'
    )


def _text(x: float, y: float, text: str, more: str = "") -> str:
    from html import escape

    return f'<text x="{x:.0f}" y="{y:.0f}"{more}>{escape(text)}</text>'


def _ticks(axis: ChartAxis, limits: tuple[float, float]) -> list[float]:
    low, high = min(limits), max(limits)
    if axis.ticks is not None:
        return [t for t in axis.ticks if low <= t <= high]
    if axis.log:
        first, last = math.floor(math.log10(low)), math.ceil(math.log10(high))
        few = last - first <= 3
        found = [m * 10.0**e for e in range(first, last + 1) for m in ((1, 2, 5) if few else (1,))]
        return [t for t in found if low <= t <= high]
    size = 10.0 ** math.floor(math.log10((high - low) / _TICKS))
    step = next(m * size for m in (1.0, 2.0, 5.0, 10.0) if (high - low) / (m * size) <= _TICKS)
    return [step * k for k in range(math.ceil(low / step), math.floor(high / step) + 1)]


def _number(value: float) -> str:
    text = f"{value:.6g}"
    return text.replace("-", "\N{MINUS SIGN}") if float(text) else "0"
