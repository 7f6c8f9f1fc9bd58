"""Dots that are copied from what Bokeh wrote of others are what it would have written of them."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

pytest.importorskip("bokeh")
from bokeh import models
from bokeh.document import Document
from bokeh.models.renderers import GlyphRenderer

from trueangle.reports.charts import Chart
from trueangle.reports.dotcopies import hover_copy, renderer_copy


def _unnamed(value: Any, names: dict[str, int]) -> Any:
    """``value`` with the identities of models counted from 0."""
    if isinstance(value, dict):
        return {
            key: names.setdefault(inside, len(names)) if key == "id" else _unnamed(inside, names)
            for key, inside in value.items()
        }
    return [_unnamed(inside, names) for inside in value] if isinstance(value, list) else value


def _written(model: Any) -> Any:
    document = Document()
    document.add_root(model)
    written = document.to_json(deferred=False)["roots"][0]
    document.remove_root(model)
    return written


@pytest.mark.parametrize("marker", ["circle", "cross"])
@pytest.mark.parametrize("hollow", [False, True])
@pytest.mark.parametrize("size", [4.0, 8.0])
def test_a_copy_is_what_bokeh_writes(marker: str, hollow: bool, size: float):
    data = {"x": np.arange(3, dtype=np.float32), "y": np.ones(3, np.float32), "name": ["a"] * 3}
    tags = ["colour:run-1", "run:7"]
    glyph = models.Scatter(
        x="x",
        y="y",
        size=size,
        marker=marker,
        fill_alpha=0.0 if hollow else 1.0,
        line_alpha=1.0 if hollow or marker == "cross" else 0.0,
    )
    renderer = GlyphRenderer(data_source=models.ColumnDataSource(data), glyph=glyph, tags=tags)
    renderer.nonselection_glyph = renderer.muted_glyph = None
    expected = json.loads(json.dumps(_unnamed(_written(renderer), {})))
    copies = [renderer_copy(marker, size, hollow, data, tags) for _ in range(2)]
    for copy in copies:
        assert _unnamed(copy, {}) == expected
    names: list[dict[str, int]] = [{}, {}]
    for copy, found in zip(copies, names, strict=True):
        _unnamed(copy, found)
    assert not names[0].keys() & names[1].keys()
    tool = models.HoverTool(renderers=[renderer], tooltips="@name", mode="mouse")
    written = _written(tool)
    written["attributes"]["renderers"] = [{"id": written["attributes"]["renderers"][0]["id"]}]
    made = hover_copy("@name", copies[:1])
    assert _unnamed(made, {}) == _unnamed(written, {})
    assert made["attributes"]["renderers"][0]["id"] == copies[0]["id"]


def _forward(value: Any, known: set[str]) -> list[str]:
    """References to what is not yet made, which BokehJS cannot follow."""
    if isinstance(value, dict):
        if value.keys() == {"id"}:
            return [] if value["id"] in known else [value["id"]]
        known.update([value["id"]] if "id" in value else [])
        return [bad for inside in value.values() for bad in _forward(inside, known)]
    if isinstance(value, list):
        return [bad for inside in value for bad in _forward(inside, known)]
    return []


@pytest.mark.parametrize("lines", [False, True])
def test_nothing_is_referred_to_before_it_is_made(lines: bool):
    chart = Chart("x", "y")
    two = np.arange(2.0)
    if lines:
        chart.line(two, two, colour="model", hover="line")
    chart.dots(two, two, colour="first", run=1, hover="run 1")
    (root,) = chart.drawn()["document"]["doc"]["roots"]
    assert not _forward(json.loads(json.dumps(root)), set())
    assert len(root["attributes"]["renderers"]) == 1 + lines


def test_dots_stand_above_what_was_drawn_before_them_alone():
    chart = Chart("x", "y")
    two = np.arange(2.0)
    chart.line(two, two, colour="model")
    chart.dots(two, two, colour="first", run=1, hover="run 1", label="dots")
    chart.dots(two, two, colour="second", run=2, hover="run 2")
    chart.line(two, two, colour="last", hover="line")
    written = chart.drawn()
    (root,) = written["document"]["doc"]["roots"]
    drawn = root["attributes"]["renderers"]
    assert [r["attributes"]["tags"][0] for r in drawn] == [
        f"colour:{name}" for name in ("model", "first", "second", "last")
    ]
    tools = list(root["attributes"]["toolbar"]["attributes"]["tools"])
    hover = {
        t["attributes"]["tooltips"]: [r["id"] for r in t["attributes"]["renderers"]]
        for t in tools
        if t["name"] == "HoverTool"
    }
    assert hover == {
        "run 1": [drawn[1]["id"]],
        "run 2": [drawn[2]["id"]],
        "line": [drawn[3]["id"]],
    }
    assert written["legend"] == [{"label": "dots", "colour": "first", "sign": "●"}]
