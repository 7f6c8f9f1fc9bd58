"""Still pictures read back: every mark, tick and name stands where its numbers are on the axes."""

import itertools
import re
import xml.etree.ElementTree as ElementTree

import numpy as np
import pytest

from trueangle.reports.chartaxes import ChartAxis
from trueangle.reports.stills import StillMark, still_picture

SEED = 60_127
#: Of the whole page: the frame of a picture of 22 rem.
LEFT, RIGHT, HEAD, FOOT = 64.0, 668.0, 6.0, 22 * 13.0 - 34.0


class Read:
    """A picture's frame, ticks and marks, as they are drawn."""

    def __init__(self, svg):
        root = ElementTree.fromstring(svg)
        self.size = tuple(map(float, root.get("viewBox").split()[2:]))
        axes = next(g for g in root.iter("g") if g.get("class") == "axes")
        frame, *grid = re.findall(r"M[^M]+", axes.find("path").get("d"))
        self.left, self.head, self.right, self.foot, _ = map(float, re.findall(r"[\d.]+", frame))
        self.uprights = [p.get("d") for p in root.iter("path") if p.get("class") == "upright"]
        self.paths = [p for p in root.findall("path") if p.get("class") != "upright"]
        up = axes.find("g")
        self.up = [(float(t.get("y")) - 3.5, t.text) for t in up.findall("text")]
        self.across = [(float(t.get("x")), t.text) for t in axes.findall("text")]
        self.grid = [list(map(float, re.findall(r"[\d.]+", line))) for line in grid]

    def points(self, which=0):
        """Places of dots, of lines and of borders of a band, one after the other."""
        path = self.paths[which].get("d")
        if path.startswith("m"):
            moves = re.findall(r"m(-?\d+)([+-]\d+)h0", path)
            return np.cumsum(np.array(moves, float), axis=0)
        numbers = re.findall(r"-?[\d.]+", path)
        return np.array(numbers, float).reshape(-1, 2)


def picture(*marks, x=(0.0, 10.0), y=(-1.0, 3.0), log=(False, False), uprights=(), **more):
    across = ChartAxis("x / deg", x, log[0])
    up = ChartAxis("y & z", y, log[1], more.pop("categories", None), **more)
    return Read(still_picture(marks, across, up, 22.0, 1.0, uprights))


def places(x, y, x_range=(0.0, 10.0), y_range=(-1.0, 3.0)):
    """Pixels by the ends of the axes: from the left, and from the foot upwards."""
    (a, b), (c, d) = x_range, y_range
    right = LEFT + (np.asarray(x) - a) / (b - a) * (RIGHT - LEFT)
    return np.column_stack([right, FOOT - (np.asarray(y) - c) / (d - c) * (FOOT - HEAD)])


def test_a_picture_is_as_wide_as_its_share_of_the_page_and_as_high_as_asked():
    for share, width in ((1.0, 680.0), (0.5, 340.0), (0.01, 90.0)):
        axis = ChartAxis("x", (0.0, 1.0))
        read = Read(still_picture([], axis, axis, 7.0, share))
        assert read.size == (width, 91.0)
        assert (read.left, read.right, read.head, read.foot) == (64.0, width - 12.0, 6.0, 57.0)


def test_dots_stand_where_their_numbers_are_and_none_outside_of_the_frame():
    print(f"seed {SEED}")
    rng = np.random.default_rng(SEED)
    x, y = rng.uniform(-2.0, 12.0, 60), rng.uniform(-2.0, 4.0, 60)
    read = picture(StillMark("dots", (x, y), "fore", 4.0))
    inside = (x >= 0.0) & (x <= 10.0) & (y >= -1.0) & (y <= 3.0)
    wanted = sorted(map(tuple, places(x, y)[inside].round()))
    np.testing.assert_allclose(read.points(), wanted)
    assert 10 < inside.sum() < 50
    # On the border is within it.
    edge = picture(StillMark("dots", ([0.0, 10.0], [3.0, -1.0]), "fore"))
    np.testing.assert_allclose(edge.points(), [[LEFT, HEAD], [RIGHT, FOOT]])


@pytest.mark.parametrize("count", [119, 120, 121, 240, 241, 5000])
def test_of_many_dots_every_so_many_is_drawn(count):
    x = np.linspace(0.0, 10.0, count)
    read = picture(StillMark("dots", (x, 0.0 * x), "fore"))
    drawn = len(read.points())
    assert drawn == -(-count // -(-count // 120))
    assert drawn <= 120
    assert read.points()[0, 0] == LEFT


def test_dots_of_one_colour_and_size_are_one_mark_where_the_first_stands():
    one, other = ([1.0, 2.0], [0.0, 1.0]), ([3.0], [2.0])
    read = picture(
        StillMark("dots", one, "fore", 4.0),
        StillMark("line", one, "after"),
        StillMark("dots", other, "fore", 4.0),
        StillMark("dots", other, "fore", 5.0),
        StillMark("dots", other, "muted", 4.0),
    )
    assert len(read.paths) == 4
    np.testing.assert_allclose(read.points(0), places([1.0, 2.0, 3.0], [0.0, 1.0, 2.0]).round())
    np.testing.assert_allclose(read.points(1), places(*one), atol=0.5)
    styles = ["var(--fore)", "var(--after)", "var(--fore)", "var(--muted)"]
    assert [re.search(r"var\(.*\)", p.get("style"))[0] for p in read.paths] == styles


def test_lines_bands_and_segments_go_through_their_numbers():
    print(f"seed {SEED}")
    rng = np.random.default_rng(SEED)
    x, (low, high) = np.linspace(0.0, 10.0, 50), rng.uniform(-1.0, 3.0, (2, 50))
    read = picture(
        StillMark("line", (x, low), "fore", 2.5),
        StillMark("band", (x, low, high), "fore"),
        StillMark("segments", (x, low, x + 0.5, high), "fore", 1.25),
        StillMark("segments", (x, low, x, -1.0), "fore"),
        uprights=(0.0, 7.5),
    )
    line, band, segments, feet = (read.points(i) for i in range(4))
    np.testing.assert_allclose(line, places(x, low), atol=0.51)
    assert np.abs(line - places(x, low))[:, 1].max() <= 0.051
    there_and_back = np.concatenate([places(x, low), places(x, high)[::-1]])
    np.testing.assert_allclose(band, there_and_back, atol=0.51)
    ends = np.stack([places(x, low), places(x + 0.5, high)], axis=1).reshape(-1, 2)
    np.testing.assert_allclose(segments, ends, atol=0.51)
    np.testing.assert_allclose(feet[1::2], places(x, -1.0 + 0.0 * x), atol=0.51)
    assert [read.paths[i].get("stroke-width") for i in (0, 2)] == ["2.5", "1.25"]
    assert read.uprights == [f"M{x:.0f} {HEAD:.0f}V{FOOT:.0f}" for x in (LEFT, 517.0)]
    # Of a line of many readings one stands for a pixel or two.
    many = np.linspace(0.0, 10.0, 3400)
    assert len(picture(StillMark("line", (many, 0.0 * many), "fore")).points()) == 340


@pytest.mark.parametrize("log", [False, True])
@pytest.mark.parametrize(
    "limits",
    [(0.2, 1.9), (1.0, 3.0), (1e-4, 3.0), (9.0, 11.0), (1e-3, 1.0), (0.5, 200.0), (30.0, 36000.0)],
)
def test_every_round_number_within_an_axis_is_a_tick_with_its_line_and_text(limits, log):
    """A step of 1, 2 or 5 times a power of ten, three to seven of them; of a logarithmic axis the
    powers, and 2 and 5 times these where there are few."""
    read = picture(x=limits, y=limits, log=(log, log))
    low, high = limits
    ticks = [float(text) for _, text in read.up]
    assert ticks == sorted(ticks)
    assert all(low <= tick <= high for tick in ticks)
    if log:
        few = np.ceil(np.log10(high)) - np.floor(np.log10(low)) <= 3
        every = (m * 10.0**e for e in range(-6, 7) for m in ((1, 2, 5) if few else (1,)))
        wanted = [tick for tick in every if low <= tick <= high]
    else:
        (step,) = {float(f"{b - a:.6g}") for a, b in itertools.pairwise(ticks)}
        assert float(f"{step:e}".split("e")[0]) in (1.0, 2.0, 5.0)
        first, last = int(np.ceil(low / step)), int(np.floor(high / step))
        wanted = [k * step for k in range(first, last + 1)]
        assert 3 <= len(ticks) <= 7
    np.testing.assert_allclose(ticks, wanted, rtol=1e-9)

    def along(values, start, end):
        a, b, values = (np.log10(v) if log else v for v in (low, high, np.array(values)))
        return start + (values - a) / (b - a) * (end - start)

    np.testing.assert_allclose([y for y, _ in read.up], along(wanted, FOOT, HEAD), atol=1.01)
    *marked, (_, title), (_, turned) = read.across
    assert [float(text) for _, text in marked] == ticks
    np.testing.assert_allclose([x for x, _ in marked], along(wanted, LEFT, RIGHT), atol=0.51)
    assert (title, turned) == ("x / deg", "y & z")
    upright = [line[0] for line in read.grid if line[1] == HEAD and line[2] == FOOT]
    np.testing.assert_allclose(upright[: len(ticks)], along(wanted, LEFT, RIGHT), atol=0.51)
    assert len(read.grid) == 2 * len(ticks)


def test_numbers_below_nothing_have_a_minus_and_nothing_has_none():
    told = [text for _, text in picture(y=(-2.0, 2.0)).up]
    assert [text.replace("\N{MINUS SIGN}", "-") for text in told] == ["-2", "-1", "0", "1", "2"]
    assert told[0] == "\N{MINUS SIGN}2"


def test_names_of_categories_have_room_beside_the_frame():
    short, long = ["a", "b"], ["a", "b" * 40]
    assert picture(y=None, categories=short).left == LEFT
    assert picture(y=None, categories=long).left == 40 * 6.2 + 8.0
    read = picture(y=None, categories=short)
    assert [text for _, text in read.up] == short
    # A chart that goes on with the axis of the one before it has no room and no texts.
    joined = picture(visible=False)
    assert joined.left == 8.0
    assert joined.up == []


def test_an_axis_without_limits_holds_all_and_a_twentieth_more():
    x, low, high = np.array([2.0, 4.0]), np.array([-1.0, 0.0]), np.array([0.0, 3.0])
    read = picture(StillMark("band", (x, low, high), "fore"), x=None, y=None)
    wanted = np.concatenate([np.column_stack([x, low]), np.column_stack([x, high])[::-1]])
    wanted = places(*wanted.T, (1.9, 4.1), (-1.2, 3.2))
    np.testing.assert_allclose(read.points(), wanted, atol=0.51)
    # One point alone stands in the middle.
    read = picture(StillMark("dots", ([5.0], [2.0]), "fore"), x=None, y=None)
    np.testing.assert_allclose(read.points(), [[(LEFT + RIGHT) / 2, (HEAD + FOOT) / 2]])
