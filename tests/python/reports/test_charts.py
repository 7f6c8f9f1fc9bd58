"""What a chart hands to the page: columns of numbers, marks of runs, sides of names, widths."""

import base64
import gzip

import numpy as np
import pytest

from trueangle.reports import charts
from trueangle.reports.charts import Chart

SEED = 60_128
RNG = np.random.default_rng(SEED)
X, LOW, HIGH = np.sort(RNG.uniform(0.0, 10.0, 40)), *RNG.normal(0.0, 30.0, (2, 40))
#: A mantissa of 13 bits: half a step of it.
NEAR = 2.0**-14


def columns(chart):
    """Of the last thing drawn."""
    root = chart.drawn()["document"]["doc"]["roots"][0]["attributes"]
    data = root["renderers"][-1]["attributes"]["data_source"]["attributes"]["data"]["entries"]
    found = {}
    for name, value in data:
        if isinstance(value, dict):
            packed = gzip.decompress(base64.b64decode(value["array"]["data"]))
            value = np.frombuffer(packed, np.dtype(value["dtype"]).newbyteorder("<"))
        found[name] = value
    return found


def made():
    return Chart("x", "y", x_range=(0.0, 10.0), y_range=(-100.0, 100.0))


@pytest.mark.parametrize(
    ("draw", "wanted"),
    [
        (lambda c: c.dots(X, LOW, colour="fore"), {"x": X, "y": LOW}),
        (lambda c: c.line(X, LOW, colour="fore"), {"x": X, "y": LOW}),
        (lambda c: c.band(X, LOW, HIGH, colour="fore"), {"x": X, "low": LOW, "y": HIGH}),
        (lambda c: c.stems(X, LOW, HIGH, colour="fore"), {"x": X, "low": LOW, "y": HIGH}),
        (lambda c: c.stems(X, 2.0, HIGH, colour="fore"), {"x": X, "low": 0 * X + 2.0, "y": HIGH}),
        (
            lambda c: c.ticks(X, HIGH, 0.25, colour="fore"),
            {"x0": X - 0.25, "x1": X + 0.25, "y": HIGH},
        ),
    ],
)
def test_columns_are_the_numbers_to_thirteen_bits(draw, wanted):
    print(f"seed {SEED}")
    chart = made()
    draw(chart)
    found = columns(chart)
    assert set(found) == set(wanted)
    for name, values in wanted.items():
        np.testing.assert_allclose(found[name], values, rtol=1.0001 * NEAR)


def test_drawn_numbers_are_rounded_to_the_nearest_of_thirteen_bits():
    print(f"seed {SEED}")
    values = RNG.normal(0.0, 1.0, 5000) * 10.0 ** RNG.integers(-20, 20, 5000)
    exact = values.astype(np.float32).astype(float)
    part, power = np.frexp(exact)
    near = np.ldexp(np.floor(np.abs(part) * 2.0**14 + 0.5) * np.sign(part) / 2.0**14, power)
    np.testing.assert_array_equal(charts._short(values), near)
    ends = np.array([np.inf, -np.inf, 0.0, 2.0 - 1e-7])
    assert charts._short(ends).tolist() == [np.inf, -np.inf, 0.0, 2.0]


def test_the_first_36_runs_have_each_a_colour_and_a_marker_of_their_own():
    pairs = [(charts.css_run_colour(k), charts.chart_run_marker(k)) for k in range(36)]
    assert len(set(pairs)) == 36
    assert len({colour for colour, _ in pairs}) == len({marker for _, marker in pairs}) == 6
    assert len(set(pairs[:6])) == len({marker for _, marker in pairs[:6]}) == 6
    assert len({charts.run_swatch(k) for k in range(36)}) == 36


@pytest.mark.parametrize("below", [(), (True, False, True, False, True)])
def test_names_are_turned_inwards_near_the_borders_and_stand_on_their_side(below):
    chart = made()
    places = np.array([0.0, 2.9, 3.1, 6.9, 7.1])
    chart.labels(places, 0.0 * places, list("abcde"), (0.0, 10.0), below)
    found = columns(chart)
    assert found["side"] == ["left", "left", "center", "center", "right"]
    under = below or (False,) * 5
    assert found["line"] == ["top" if one else "bottom" for one in under]
    assert [off > 0 for off in found["off"]] == list(under)


@pytest.mark.parametrize(
    ("arrangement", "widths"),
    [
        ("row", (170, 510)),
        ("joined", (170, 510)),
        ("stacked", (680, 680)),
        ("above", (680, 680)),
        ("multiples", (227, 227)),
    ],
)
def test_charts_of_a_row_share_the_page_by_what_they_grow(arrangement, widths):
    pair = [Chart("x", "y", x_range=(0, 1), y_range=(0, 1), grow=grow) for grow in (1.0, 3.0)]
    figure = charts.chart_figure("alt", pair, arrangement)
    for chart, width in zip(figure["charts"], widths, strict=True):
        assert f'viewBox="0 0 {width} ' in chart["still"]
