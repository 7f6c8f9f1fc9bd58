"""What is written for Bokeh's script in the page is what Bokeh itself reads as the same charts."""

from __future__ import annotations

import json
from typing import Any

import numpy as np
import pytest

pytest.importorskip("bokeh")
from bokeh import __version__, models
from bokeh.document import Document

from trueangle.reports.charts import Chart

#: Numbers drawn keep 13 bits of their mantissa.
ROUNDED = 2.0**-13

#: Patterns of lines as Bokeh reads their names.
DASHES = {"solid": [], "dashed": [6]}

X, Y = np.array([1.0, 2.0, 3.0]), np.array([0.5, np.inf, 2.0])
NAMES = ["one", "two", "three"]


def _full_chart() -> Chart:
    """A chart with marks of every kind."""
    chart = Chart("x / deg", "y", x_range=(0.5, 200.0), log_x=True, title="Marks")
    chart.band(X, Y - 1.0, Y, colour="model", label="band")
    chart.line(X, Y, colour="model", dash="dashed", label="line")
    chart.dots(X, Y, colour="run-1", marker="cross", run=7, size=6.0, hover="@name",
               more={"name": NAMES}, hollow=True)  # fmt: skip
    chart.stems(X, 0.1, Y, colour="after")
    chart.ticks(X, Y, 0.25, colour="warning")
    chart.upright(2.0, label="here")
    chart.labels(X, Y, NAMES, (0.5, 200.0))
    return chart


def _bars() -> Chart:
    chart = Chart("x", "", x_range=(0.0, 9.0), categories=NAMES)
    chart.level_dots(NAMES, X, colour="before", hover="@y")
    return chart


def _angles() -> Chart:
    chart = Chart("", "y", x_range=(0.0, 360.0), y_range=(1e-3, 10.0), log_y=True, joined=True)
    chart.angle_axis(0.0, 360.0)
    return chart


def _whole() -> Chart:
    chart = Chart("order", "y")
    chart.whole_axis(1.0, 12.0, 7)
    return chart


def _read(chart: dict[str, Any]) -> Document:
    """The chart as Bokeh reads it, which checks every kind, property and value."""
    written = json.loads(json.dumps(chart["document"]["doc"]))
    return Document.from_json(written | {"version": __version__, "config": None})


def _same(written: Any, read: Any, document: Document) -> None:
    """Bokeh has what was written: models attribute by attribute, columns number by number."""
    if isinstance(written, dict) and "id" in written:
        assert read is document.get_model_by_id(written["id"])
        if "type" in written:
            assert type(read).__name__ in (written["name"], written["name"].lower())
        for name, value in written.get("attributes", {}).items():
            _same(DASHES[value] if name == "line_dash" else value, getattr(read, name), document)
    elif isinstance(written, dict) and written.get("type") in ("value", "field"):
        kind = written["type"]
        assert (read if isinstance(read, str) else getattr(read, kind)) == written[kind]
    elif isinstance(written, dict) and written.get("type") == "map":
        for name, column in written["entries"]:
            if isinstance(column, dict):
                assert read[name].dtype == column["dtype"]
                assert list(read[name].shape) == column["shape"]
            else:
                assert list(read[name]) == column
    elif isinstance(written, list):
        assert len(written) == len(read)
        for one, other in zip(written, read, strict=True):
            _same(one, other, document)
    else:
        assert read == written


@pytest.mark.parametrize("chart", [_full_chart, _bars, _angles, _whole])
def test_bokeh_reads_what_was_written(chart):
    written = chart().drawn()
    document = _read(written)
    assert document.validate() is None
    (root,) = written["document"]["doc"]["roots"]
    _same(root, document.roots[0], document)


def test_columns_keep_their_numbers():
    document = _read(_full_chart().drawn())
    sources = [r.data_source.data for r in document.roots[0].renderers]
    for source, name, expected in (
        (0, "low", Y - 1.0),
        (1, "y", Y),
        (2, "x", X),
        (4, "x1", X + 0.25),
    ):
        found = sources[source][name]
        assert found.dtype == np.float32
        np.testing.assert_allclose(found, expected, rtol=ROUNDED)
    assert sources[2]["name"] == NAMES


@pytest.mark.parametrize("page", ["made", "large"])
def test_bokeh_reads_every_chart_of_a_page(page: str, request):
    figures = request.getfixturevalue(page).figures
    count = 0
    for figure in figures.values():
        for chart in figure["charts"]:
            (root,) = chart["document"]["doc"]["roots"]
            document = _read(chart)
            _same(root, document.roots[0], document)
            assert isinstance(document.roots[0], models.Plot)
            count += 1
    assert count >= len(figures) >= 5


def test_every_model_of_a_page_has_its_own_identity(made):
    found = [
        identity
        for figure in made.figures.values()
        for chart in figure["charts"]
        for identity in _identities(chart["document"]["doc"]["roots"])
    ]
    assert len(set(found)) == len(found) > 100


def _identities(value: Any) -> list[str]:
    if isinstance(value, dict):
        own = [value["id"]] if "type" in value and "id" in value else []
        return own + [found for inside in value.values() for found in _identities(inside)]
    return (
        [found for inside in value for found in _identities(inside)]
        if isinstance(value, list)
        else []
    )


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
