"""Dots of a chart as Bokeh writes them: one of a kind made by Bokeh, the others copies of it.

A page of many runs has hundreds of renderers that differ in their data and tags alone. Each made
and written by Bokeh takes six milliseconds; a copy of what it wrote takes one.
"""

from __future__ import annotations

import json
from collections.abc import Mapping, Sequence
from functools import cache
from typing import Any

__all__ = ["hover_copy", "renderer_copy"]

#: What Bokeh writes of one model.
Written = dict[str, Any]


def renderer_copy(
    marker: str, size: float, hollow: bool, data: Mapping[str, Any], tags: Sequence[str]
) -> Written:
    """A renderer of dots with these columns, as a part of the document of its chart."""
    from bokeh.core.serialization import Serializer

    made: Written = _renewed(_dots(marker, size, hollow))
    serializer = Serializer(deferred=False)
    entries = [[name, serializer.encode(values)] for name, values in data.items()]
    source = made["attributes"]["data_source"]["attributes"]
    source["data"] = {"type": "map", "entries": entries}
    made["attributes"]["tags"] = list(tags)
    return made


def hover_copy(text: str, renderers: Sequence[Written]) -> Written:
    """The tool that shows ``text`` over the dots of these renderers."""
    made: Written = _renewed(_hover())
    made["attributes"]["renderers"] = [{"id": renderer["id"]} for renderer in renderers]
    made["attributes"]["tooltips"] = text
    return made


@cache
def _dots(marker: str, size: float, hollow: bool) -> Written:
    from bokeh.models import ColumnDataSource, Scatter
    from bokeh.models.renderers import GlyphRenderer

    glyph = Scatter(
        x="x",
        y="y",
        size=size,
        marker=marker,
        fill_alpha=0.0 if hollow else 1.0,
        line_alpha=1.0 if hollow or marker == "cross" else 0.0,
    )
    source = ColumnDataSource({"x": [0.0], "y": [0.0]})
    renderer = GlyphRenderer(data_source=source, glyph=glyph, tags=[""])
    # Selections and hovering change nothing: one glyph is enough.
    renderer.nonselection_glyph = renderer.muted_glyph = None
    return _written(renderer)


@cache
def _hover() -> Written:
    from bokeh.models import HoverTool

    return _written(HoverTool(renderers=[], tooltips=" ", mode="mouse"))


def _written(model: Any) -> Written:
    from bokeh.document import Document

    document = Document(title="")
    document.add_root(model)
    written: Written = json.loads(json.dumps(document.to_json(deferred=False)["roots"][0]))
    return written


def _renewed(value: Any) -> Any:
    """A copy in which every model has an identity of its own."""
    from bokeh.util.serialization import make_id

    if isinstance(value, dict):
        made = {key: _renewed(inside) for key, inside in value.items()}
        if "id" in made:
            made["id"] = make_id()
        return made
    return [_renewed(inside) for inside in value] if isinstance(value, list) else value
