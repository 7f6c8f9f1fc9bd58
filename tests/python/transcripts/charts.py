"""Interactive charts and still pictures of a page, as lines to be compared."""

from __future__ import annotations

import base64
import gzip
import json
import re
from collections.abc import Iterator
from typing import Any

import numpy as np

from .views import few_numbers, shown

#: The page's signs of HTML back to those of base 85.
_SIGNS = str.maketrans("[]:", "<>&")

#: Digits of a number that is drawn: charts hold some four.
DRAWN = 4

#: What a model says of how it looks.
_LOOKS = (
    "marker", "size", "fill_alpha", "line_alpha", "line_width", "line_dash", "text_align",
    "text_baseline", "y_offset",
)  # fmt: skip


def chart_lines(page: str) -> Iterator[str]:
    """Every chart of a page, or where it has none every still picture."""
    packed = re.search(r'<script[^>]*id="figures">([^<]*)</script>', page)
    if packed is None:
        yield from still_lines(page)
        return
    whole = base64.b85decode(packed[1].translate(_SIGNS))
    length = int.from_bytes(whole[:4], "big")
    figures = json.loads(gzip.decompress(whole[4 : 4 + length]))
    for name, figure in figures.items():
        yield f"figure {name}, {figure['arrangement']}: {figure['alt']}"
        for chart in figure["charts"]:
            size = f"{shown(chart['grow'])} wide, {chart['height_rem']} high"
            yield f"  chart {chart['title']!r}, {size}"
            for entry in chart["legend"]:
                yield f"    legend: {entry['sign']} {entry['label']} {entry['colour']}"
            yield from _figure_lines(chart["document"]["doc"]["roots"][0]["attributes"])


def _figure_lines(figure: dict[str, Any]) -> Iterator[str]:
    for name, place in (("x", "below"), ("y", "left")):
        (axis,) = figure[place]
        told, span = axis["attributes"], figure[f"{name}_range"]["attributes"]
        ends = [shown(span[key]) for key in ("start", "end") if key in span]
        ticks = told.get("ticker", {}).get("attributes", {}).get("ticks", [])
        line = f"    {name}: {told['axis_label']} {axis['name']} {' to '.join(ends)}"
        line += f" {', '.join(span['factors'])}" if "factors" in span else ""
        line += f", ticks {', '.join(map(shown, ticks))}" if ticks else ""
        yield line + ("" if told["visible"] else ", not shown")
    hovers = {
        entry["id"]: tool["attributes"]["tooltips"]
        for tool in figure["toolbar"]["attributes"]["tools"]
        for entry in tool["attributes"].get("renderers", [])
    }
    for drawn in figure["renderers"]:
        held = drawn["attributes"]
        glyph = held["glyph"]["attributes"]
        looks = [f"{key} {_value(glyph[key])}" for key in _LOOKS if key in glyph]
        yield f"    {held['glyph']['name']} {' '.join([*held['tags'], *looks])}"
        for column, values in held["data_source"]["attributes"]["data"]["entries"]:
            yield f"      {column}: {_column(values)}"
        if drawn["id"] in hovers:
            yield f"      over it: {hovers[drawn['id']]}"
    for span in figure["center"]:
        if span["name"] == "Span":
            told = span["attributes"]
            yield f"    upright at {shown(told['location'])} {told['line_dash']} {told['tags'][0]}"


def _value(held: Any) -> str:
    return str(held.get("value", held.get("field")) if isinstance(held, dict) else held)


def _column(values: Any) -> str:
    if isinstance(values, list):
        return "; ".join(map(str, values))
    packed = base64.b64decode(values["array"]["data"])
    return few_numbers(np.frombuffer(gzip.decompress(packed), dtype=values["dtype"]), DRAWN)


def still_lines(page: str) -> Iterator[str]:
    """Every still picture of a page."""
    for picture in re.findall(r"<svg.*?</svg>", page, re.S):
        yield "still picture " + re.search(r'viewBox="([^"]*)"', picture)[1]  # type: ignore[index]
        for path in re.findall(r"<path ([^>]*)/>", picture):
            places = re.search(r'\bd="([^"]*)"', path)
            assert places is not None
            numbers = [float(text) for text in re.findall(r"-?\d+\.?\d*", places[1])]
            look = " ".join(path.replace(places[0], "").split())
            yield f"  {look or 'frame and grid'}: {few_numbers(numbers, DRAWN)}"
