"""The chart of all orders: what is drawn of each line is its size, its interval and its limit."""

from types import SimpleNamespace

import numpy as np
import pytest

from trueangle.plots.orderlines import OrderLine, seen_sizes
from trueangle.reports import spectrum

LINES = [
    OrderLine(1.0, 40.0, half=3.0),
    OrderLine(2.0, 2.0, half=5.0),  # whose interval reaches below the axis
    OrderLine(3.0, 1e-6, kept=False),  # far below everything else
    OrderLine(9.0, 35.0, kept=False),
    *(OrderLine(4.0 + k, 30.0 / 3.0**k) for k in range(4)),
    *(OrderLine(200.0 + 10.0 * k, 25.0 - k) for k in range(4)),
]
#: Just above the lowest size shown: half a dot, which is left out, and a whole one.
LINES += [OrderLine(240.0 + rise, rise * seen_sizes(LINES)[0], kept=False) for rise in (1.05, 1.2)]


def name(order):
    return f"output {order:g}"


@pytest.fixture(params=[1.0, 0.25])
def drawn(request, monkeypatch):
    """What each chart was asked to draw, in a unit of so many of arcsec."""
    calls = []

    class Chart(spectrum.Chart):
        def __init__(self, *titles, **more):
            super().__init__(*titles, **more)
            self.calls = {"titles": titles, **more}
            calls.append(self.calls)

        def dots(self, x, y, **more):
            self.calls["dots", more["hollow"]] = (x, y)
            super().dots(x, y, **more)

        def stems(self, x, low, high, **more):
            self.calls["stems"] = (x, low, high)
            super().stems(x, low, high, **more)

        def labels(self, x, y, texts, *more):
            self.calls["labels"] = texts
            super().labels(x, y, texts, *more)

    monkeypatch.setattr(spectrum, "Chart", Chart)
    monkeypatch.setattr(spectrum, "order_lines", lambda result: LINES)
    scale = SimpleNamespace(factor=request.param, name="mrad", read="@y mrad")
    figure = spectrum.spectrum_figure(SimpleNamespace(), None, name, scale)
    return request.param, calls, figure


def both(calls, key):
    """Of all charts together."""
    parts = [call[key] for call in calls if key in call]
    return [np.concatenate(part) for part in zip(*parts, strict=True)]


def test_dots_are_the_sizes_in_the_unit_of_the_page(drawn):
    factor, calls, _ = drawn
    low, high = (factor * size for size in seen_sizes(LINES))
    for kept in (True, False):
        some = [line for line in LINES if line.kept is kept]
        whole = [line for line in some if factor * line.amplitude >= 1.12 * low]
        assert len(whole) == len(some) - (0 if kept else 2)
        order, size = both(calls, ("dots", not kept))
        np.testing.assert_allclose(order, [line.order for line in whole])
        np.testing.assert_allclose(size, [factor * line.amplitude for line in whole])
    # All charts have one axis of sizes, with room for names above the highest dot.
    for call in calls:
        assert call["y_range"] == (pytest.approx(low), pytest.approx(3.0 * high))
        assert call["log_y"]
    assert [call["joined"] for call in calls] == [False, True]


def test_intervals_reach_as_far_to_either_side_but_not_below_the_axis(drawn):
    factor, calls, _ = drawn
    order, low, high = both(calls, "stems")
    ranged = [line for line in LINES if line.half > 0.0]
    floor = factor * seen_sizes(LINES)[0]
    assert order.tolist() == [line.order for line in ranged]
    np.testing.assert_allclose(high, [factor * (line.amplitude + line.half) for line in ranged])
    wanted = [max(factor * (line.amplitude - line.half), floor) for line in ranged]
    np.testing.assert_allclose(low, wanted)
    assert low[1] == pytest.approx(floor)


def test_the_eight_largest_are_named_and_all_are_listed_in_words(drawn):
    _, calls, figure = drawn
    named = {text for call in calls for text in call["labels"]}
    kept = [line for line in LINES if line.kept]
    largest = sorted(kept, key=lambda line: -line.amplitude)
    assert named == {f"{line.order:g}" for line in largest[:8]}
    every = ", ".join(f"{line.order:g}" for line in kept)
    assert figure["alt"] == (
        f"Amplitude in mrad of {len(LINES)} fitted orders with 95 % intervals. Retained: {every}."
    )
