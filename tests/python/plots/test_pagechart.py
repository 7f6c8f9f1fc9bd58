"""Charts of a page: what matplotlib has on its axes, in a box without a size, and their texts."""

from __future__ import annotations

import re
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

from trueangle.plots import palette
from trueangle.plots.canvas import marked, plain_logarithms
from trueangle.plots.pagechart import SIDE, page_axes, page_chart, page_colour, run_swatch

from .strokes import strokes

pytest.importorskip("matplotlib")
SEED = 60_127
#: Half a unit of the box, a little more for what is rounded twice.
NEAR = 0.51 / SIDE


@pytest.fixture(params=range(12))
def some(request):
    """Axes of random limits and scales, and points within them."""
    rng = np.random.default_rng([SEED, request.param])
    print(f"seed {SEED}, {request.param}")
    ax = page_axes(*rng.uniform(1.0, 9.0, 2))
    points = []
    for k, which in enumerate("xy"):
        log = (request.param >> k) % 2 == 1
        low, high = np.sort(10.0 ** rng.uniform(-3, 5, 2) if log else rng.normal(0, 50, 2))
        high = low * 30.0 if log else high + 1.0
        part = np.sort(rng.uniform(0.0, 1.0, 40)) if k == 0 else rng.uniform(0.0, 1.0, 40)
        points.append(low * (high / low) ** part if log else low + (high - low) * part)
        getattr(ax, f"set_{which}scale")("log" if log else "linear")
        # The upright axis may grow downwards.
        ends = (high, low) if k and request.param % 3 == 0 else (low, high)
        getattr(ax, f"set_{which}lim")(*ends)
    return ax, np.array(points)


def apart(ax, found, wanted):
    """Largest distance of points as parts of the box."""
    places = [ax.transAxes.inverted().transform(ax.transData.transform(p)) for p in (found, wanted)]
    return np.abs(places[0] - places[1]).max()


@pytest.mark.parametrize("marker", ["o", "s", "D", "^"])
def test_dots_are_where_the_axes_have_them(some, marker):
    ax, (x, y) = some
    (line,) = ax.plot(x, y, linestyle="none", marker=marker, color=palette.AFTER)
    marked(line, run=3)
    (dots,) = strokes(chart := page_chart(ax))
    assert (dots.run, dots.style["stroke"]) == (3, "var(--after)")
    assert ("h0" in chart["svg"]) == (marker == "o")  # PDF paints no square end without a length
    assert len(dots.points) == 40
    for point in np.column_stack([x, y]):
        assert min(apart(ax, found, point) for found in dots.points) < NEAR
    assert dots.style.get("stroke-linecap") == (None if marker == "o" else "square")


def test_lines_areas_and_bars_are_where_the_axes_have_them(some):
    ax, (x, y) = some
    ax.plot(x, y, color="black", zorder=3)
    ax.fill_between(x, y, np.full(40, y.min()), color=palette.MUTED, alpha=0.35, linewidth=0.0)
    ax.vlines(x[:5], y[:5], y[5:10], color=palette.WARNING)
    area, bars, line = strokes(page_chart(ax))
    assert [one.kind for one in (area, line, bars)] == ["area", "line", "line"]
    assert area.style == {"stroke": "none", "fill": "var(--muted)", "opacity": "0.35"}
    assert line.style["stroke"] == "var(--model)"
    # matplotlib simplifies a line within a ninth of a pixel.
    ends = [0, -1]
    assert apart(ax, line.points[ends], np.column_stack([x, y])[ends]) < 2.0 * NEAR
    wanted = np.column_stack([np.repeat(x[:5], 2), np.column_stack([y[:5], y[5:10]]).ravel()])
    assert apart(ax, bars.points, wanted) < NEAR
    for point in np.column_stack([x, y]):
        assert min(apart(ax, other, point) for other in area.points) < NEAR


def test_ticks_are_where_their_numbers_are(some):
    ax, _ = some
    for which in "xy":
        if getattr(ax, f"get_{which}scale")() == "log":
            plain_logarithms(ax, which)
    chart = page_chart(ax)
    grid = re.search(r'class="grid" d="([^"]*)"', chart["svg"])[1]
    lines = [("x", int(a)) for a in re.findall(r"M(-?\d+) 0v10000", grid)]
    lines += [("y", round(SIDE) - int(a)) for a in re.findall(r"M0 (-?\d+)h10000", grid)]
    wanted = [(which, at) for which in "xy" for at, _ in chart[which]["ticks"]]
    assert [which for which, _ in lines] == [which for which, _ in wanted]
    assert [at for _, at in lines] == pytest.approx([SIDE * at for _, at in wanted], abs=1.0)
    for which in "xy":
        low, high = chart[which]["limits"]
        assert len(chart[which]["ticks"]) >= 1
        for at, text in chart[which]["ticks"]:
            log = chart[which]["scale"] == "log"
            value = low * (high / low) ** at if log else low + (high - low) * at
            written = float(text.replace("\N{MINUS SIGN}", "-"))
            assert value == pytest.approx(written, rel=2e-3, abs=1e-3 * abs(high - low))


def test_what_has_one_look_is_one_path_and_titles_part_it():
    ax = page_axes()
    for k in range(4):
        (line,) = ax.plot([k, k + 0.5], [0.0, 1.0], "o", color=palette.AFTER)
        marked(line, run=k // 2, titles=["a <b>", "c & d"] if k == 3 else None)
    chart = page_chart(ax)
    ElementTree.fromstring(f"<svg>{chart['svg']}</svg>")
    found = strokes(chart)
    assert [(one.run, len(one.points), one.title) for one in found] == [
        (0, 4, ""), (1, 2, ""), (1, 1, "a <b>"), (1, 1, "c & d"),
    ]  # fmt: skip


def test_a_ring_is_filled_with_paper():
    ax = page_axes()
    (line,) = ax.plot([0.5], [0.5], "o", color=palette.BEFORE, label="measured")
    marked(line, ring=True)
    chart = page_chart(ax)
    assert "var(--back)" in chart["svg"]
    assert chart["legend"] == [{"label": "measured", "colour": "var(--before)", "sign": "○"}]


def test_what_is_outside_of_the_box_is_not_drawn():
    ax = page_axes()
    ax.plot([0.0, 0.5, 2.0], [0.5, 0.5, 0.5], "o")
    ax.plot([0.5], [np.nan], "o")
    ax.set_xlim(0.2, 1.0)
    assert [len(one.points) for one in strokes(page_chart(ax))] == [1]


def test_a_legend_names_kinds_once_and_leaves_many_runs_to_their_table():
    for runs, named in ((6, 6), (7, 0)):
        ax = page_axes()
        for k in range(runs):
            colour, marker = palette.run_colour(k), palette.run_marker(k)
            ax.plot([k], [k], linestyle="none", marker=marker, color=colour, label=f"run {k}")
        ax.plot([0, 1], [0, 1], color="black", label="model")
        ax.axvline(1.0, color="black", linestyle="--", label="noise")
        ax.axhspan(0.0, 1.0, color=palette.MUTED, alpha=0.2, label="band")
        legend = page_chart(ax)["legend"]
        assert sum(entry["label"].startswith("run ") for entry in legend) == named
        signs = {entry["label"]: entry["sign"] for entry in legend}
        assert [signs[name] for name in ("model", "noise", "band")] == ["━", "╍", "▒"]
        for k in range(named):
            assert (legend[k]["colour"], legend[k]["sign"]) == run_swatch(k)


@pytest.mark.parametrize("case", range(8))
def test_names_are_inside_and_do_not_meet(case):
    """As boxes of eleven thousandths of a chart of 7.5 inches to a letter."""
    rng = np.random.default_rng([SEED, 8, case])
    ax = page_axes()
    ax.set_xlim(0.0, 1.0)
    ax.set_ylim(0.0, 1.0)
    texts = ["m" * n for n in rng.integers(1, 15, 12)]
    for text, point in zip(texts, rng.uniform(0.0, 0.9, (12, 2)), strict=True):
        ax.annotate(text, point)
    names = page_chart(ax)["names"]
    assert names[0]["text"] == texts[0]
    boxes = []
    for name in names:
        wide = 0.011 * len(name["text"])
        left = name["x"] - {"start": 0.0, "middle": 0.5, "end": 1.0}[name["side"]] * wide
        assert -1e-9 <= left <= 1.0 - wide + 1e-9
        boxes.append((left, left + wide, name["y"]))
    for i, (a, b, y) in enumerate(boxes):
        for c, d, other in boxes[i + 1 :]:
            assert b <= c + 1e-9 or d <= a + 1e-9 or abs(y - other) >= 0.065


def test_runs_differ_in_colour_or_shape_and_colours_are_of_the_page():
    assert len({run_swatch(k) for k in range(6)}) == 6
    assert len({run_swatch(k) for k in range(36)}) == 18
    for colour in (*palette.RUNS, palette.AFTER, palette.BEFORE, palette.MUTED, "black"):
        assert re.fullmatch(r"var\(--[a-z0-9-]+\)", page_colour(colour))
    assert page_colour("#123456") == "#123456"


@pytest.mark.parametrize(("low", "high"), [(0.002, 0.9), (3.0, 4.0), (0.1, 1e6), (40.0, 60.0)])
def test_a_scale_of_logarithms_has_few_plain_numbers(low, high):
    ax = page_axes()
    ax.set_yscale("log")
    ax.set_ylim(low, high)
    plain_logarithms(ax, "y")
    texts = [text for _, text in page_chart(ax)["y"]["ticks"]]
    assert 1 <= len(texts) <= 7
    assert not any("e" in text or "$" in text for text in texts)
