"""Charts of a page, as lines to be compared: titles, axes, legends, names, what is drawn."""

from __future__ import annotations

import re
from collections.abc import Iterator
from html import unescape

from .views import few_numbers

#: Digits of a place in a box.
DRAWN = 4


def chart_lines(page: str) -> Iterator[str]:
    """Every chart of a page, with the figure that it is of."""
    for part in re.split(r'(?=<div class="plot |<figure role="img")', page)[1:]:
        alt = re.search(r'aria-label="([^"]*)"', part)
        name = re.search(r'id="figure-([^"]*)"', part)
        yield f"figure {name[1] if name else ''}: {unescape(alt[1]) if alt else ''}"
        for chart in re.split(r'(?=<div class="chart")', part.split("</figure>")[0])[1:]:
            yield from _chart_lines(chart)


def _chart_lines(chart: str) -> Iterator[str]:
    title = re.search(r'class="chart-title">(.*?)</p>', chart)
    style = re.search(r'class="chart" style="([^"]*)"', chart)
    yield f"  chart {_text(title[1]) if title else ''!r}, {style[1] if style else ''}"
    for entry in re.findall(r'<span><span style="color:([^"]*)".*?>(.)</span> (.*?)</span>', chart):
        yield f"    legend: {entry[1]} {_text(entry[2])} {entry[0]}"
    for which, name in (("x", "along"), ("y", "up")):
        told = re.search(rf'<span class="{name}">(.*?)</span>', chart)
        ends = re.search(rf'data-{which}="([^"]*)"', chart)
        block = re.search(rf'<div class="{which}">(.*?)</div>', chart)
        ticks = re.findall(r"<span[^>]*>(.*?)</span>", block[1]) if block else []
        line = f"    {which}: {_text(told[1]) if told else ''} {_ends(ends[1]) if ends else ''}"
        yield f"{line}, ticks {', '.join(map(_text, ticks))}"
    for place, text in re.findall(r'<span class="name ([^>]*)>(.*?)</span>', chart):
        side, *at = re.findall(r"[a-z]+(?=\")|[0-9.]+%", place)
        yield f"    name: {_text(text)} {side} {' '.join(at)}"
    path = r'<path((?: data-run="\d+")?) style="([^"]*)" d="([^"]*)"(?:/>|><title>(.*?)</title>)'
    for run, looks, d, over in re.findall(path, chart):
        numbers = [float(n) for n in re.findall(r"-?\d+", d)]
        yield f"   {run} {looks}: {few_numbers(numbers, DRAWN)}"
        if over:
            yield f"      over it: {_text(over)}"


def _ends(text: str) -> str:
    return " to ".join(f"{float(end):.6g}" for end in text.split())


def _text(html: str) -> str:
    return unescape(re.sub(r"<[^>]+>", "", html))
