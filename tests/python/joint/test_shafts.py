"""How often the shafts of a gear turn, and the orders asked of them."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from trueangle.errors import ArgumentError
from trueangle.joint.shafts import (
    MOST_ORDERS,
    Shaft,
    limited_orders,
    resolve_orders,
    shaft_cycles,
)


@pytest.mark.parametrize("ratio", [0.25, 1.5, 50.0, 100.7])
def test_the_wave_generator_turns_against_the_output_member(ratio: float) -> None:
    plain = {"output": 1.0, "motor": ratio}
    assert shaft_cycles(ratio, "none") == plain
    assert shaft_cycles(ratio) == plain | {"wave_generator": ratio + 1.0}
    if ratio > 1.0:
        assert shaft_cycles(ratio, "flexspline") == plain | {"wave_generator": ratio - 1.0}
    assert shaft_cycles(None) == {"output": 1.0}


@pytest.mark.parametrize("ratio", [0.0, -math.inf, math.inf, math.nan])
def test_no_such_ratio(ratio: float) -> None:
    with pytest.raises(ArgumentError, match="motor turns per output turn, finite and not 0"):
        shaft_cycles(ratio)


def test_a_generator_that_stands_is_refused() -> None:
    with pytest.raises(ArgumentError, match="above 1 where the flexspline is fixed"):
        shaft_cycles(1.0, "flexspline")
    assert shaft_cycles(1.0 + 1e-9, "flexspline")["wave_generator"] > 0.0
    with pytest.raises(ArgumentError, match="fixed_member must be one of"):
        shaft_cycles(None, "flexpline")


def test_a_shaft_is_the_sines_that_it_says() -> None:
    shaft = Shaft("motor", 100, [1, 2, 3], [3, 0, -1], [4, 2, 0])  # type: ignore[arg-type]
    x = np.linspace(0.0, 7.0, 50)
    for k, a, b, c, phi in zip(
        shaft.orders, shaft.cosine, shaft.sine, shaft.amplitudes, shaft.phases, strict=True
    ):
        np.testing.assert_allclose(
            a * np.cos(k * x) + b * np.sin(k * x), c * np.sin(k * x + phi), atol=1e-12
        )
        assert c > 0.0
    assert [type(v) for v in (shaft.cycles_per_turn, shaft.orders[0], shaft.cosine[0])] == [
        float,
        int,
        float,
    ]


def test_so_many_orders_and_not_one_more() -> None:
    assert MOST_ORDERS == 4096
    assert limited_orders(range(MOST_ORDERS)) == list(range(MOST_ORDERS))
    with pytest.raises(ArgumentError, match="lines are too many: 4096 at a time"):
        limited_orders(range(MOST_ORDERS + 1), "lines")
    # What never ends is refused too.
    with pytest.raises(ArgumentError, match="too many"):
        limited_orders(itertools.count())


def test_orders_are_sorted_and_told_once() -> None:
    found = resolve_orders({"motor": [4, 2.0, np.int64(2), 1], "output": [3], "belt": []}, 50.0,
                           shafts={"belt": 0.37})  # fmt: skip
    assert found == [("motor", 50.0, (1, 2, 4)), ("output", 1.0, (3,))]
    assert all(type(k) is int for k in found[0].orders)
    assert resolve_orders(range(1, 4)) == [("output", 1.0, (1, 2, 3))]
    assert resolve_orders({"belt": [2]}, shafts={"belt": 0.37}) == [("belt", 0.37, (2,))]
    assert resolve_orders({"wave_generator": [1]}, 50.0, "flexspline")[0].cycles_per_turn == 49.0
    assert resolve_orders({}) == []


@pytest.mark.parametrize("kind", [int, float, np.int64])
def test_whole_numbers_from_one_to_the_largest(kind: type) -> None:
    for whole in (1, 2**31 - 1):
        assert resolve_orders([kind(whole)])[0].orders == (whole,)
    for wrong in (0, 2**31, -1):
        with pytest.raises(ArgumentError, match="orders of shaft 'output' must be whole numbers"):
            resolve_orders([kind(wrong)])


@pytest.mark.parametrize("wrong", [1.5, math.nan, math.inf, "two", None, True + 0.25])
def test_what_is_no_order(wrong: object) -> None:
    with pytest.raises(ArgumentError, match="must be whole numbers from 1, got"):
        resolve_orders({"output": [1, wrong]})  # type: ignore[list-item]


def test_what_is_no_list_and_what_turns_unknown() -> None:
    with pytest.raises(ArgumentError, match=r"shaft 'output' must be a list .* got 3"):
        resolve_orders(3)  # type: ignore[arg-type]
    with pytest.raises(ArgumentError, match="how fast shaft 'motor' turns is not known"):
        resolve_orders({"motor": [1]})
    with pytest.raises(ArgumentError, match="orders of shaft 'motor' are too many"):
        resolve_orders({"motor": range(1, MOST_ORDERS + 2)}, 50.0)
