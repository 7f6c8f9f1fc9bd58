"""Orders that a gear is known to make, against what its teeth and turns say by themselves."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from trueangle.errors import ArgumentError
from trueangle.joint.gear import (
    COMMON_RATIOS,
    explain_as_harmonic,
    explain_by_shafts,
    explain_order,
    gear_orders,
    wanted_orders,
)
from trueangle.joint.shafts import MOST_ORDERS, Shaft, limited_orders, resolve_orders, shaft_cycles


@pytest.mark.parametrize("ratio", [0.5, 30.0, 50.5, 100.0, 161.0])
@pytest.mark.parametrize(("member", "sign"), [("circular_spline", 1), ("flexspline", -1)])
def test_a_strain_wave_gear_has_its_seven_orders(ratio: float, member: str, sign: int) -> None:
    found = gear_orders(ratio, member)
    generator = ratio + sign
    own, other = ("flexspline", "circular spline")[::sign]
    expected = {
        ratio: ("once per motor turn",),
        generator: (f"against the {own}", "once per turn"),
        2 * ratio: ("twice per motor turn", f"mesh with the {own}"),
        ratio + generator: ("side band",),
        2 * generator: (f"tooth mesh with the {other}",),
        3 * ratio: ("three times per motor turn",),
        4 * ratio: ("four times per motor turn", "interpolation"),
    }
    assert list(found) == list(expected)
    for order, phrases in expected.items():
        assert all(phrase in found[order] for phrase in phrases)
        assert isinstance(next(k for k in found if k == order), int) == float(order).is_integer()


def test_any_other_gear_has_four_multiples_and_no_gear_none() -> None:
    assert gear_orders(7.0, "none") == {
        7: "once per motor turn",
        14: "twice per motor turn",
        21: "three times per motor turn",
        28: "four times per motor turn",
    }
    assert gear_orders(1.0, "none") == {}
    assert list(gear_orders(0.5, "none")) == [0.5, 1, 1.5, 2]
    # A whole order that rounding has moved a little is whole.
    assert list(gear_orders(50.0 + 1e-12)) == [50, 51, 100, 101, 102, 150, 200]


@pytest.mark.parametrize("ratio", [0.0, -math.inf, math.inf, math.nan])
def test_a_ratio_must_be_finite_and_not_0(ratio: float) -> None:
    with pytest.raises(ArgumentError, match=r"gear_ratio must be motor turns .*, finite and not 0"):
        gear_orders(ratio)


def test_what_is_wanted_by_default() -> None:
    low = tuple(range(1, 18))
    assert wanted_orders(None) == low
    assert wanted_orders(100) == (*low, 100, 101, 200, 201, 202, 300, 400)
    assert wanted_orders(100, "flexspline", 2) == (1, 2, 99, 100, 198, 199, 200, 300, 400)
    assert wanted_orders(2.5, "none", 3) == (1, 2, 2.5, 3, 5, 7.5, 10)


def test_lines_of_the_output_side() -> None:
    begins = {1: "eccentricity", 2: "sensor displaced", 3: "second harmonic", 4: "interpolation"}
    for order in range(8):
        found = explain_order(order, gear_ratio=100.0)
        assert [e.order for e in found] == ([order] if order in begins else [])
        for one in found:
            assert one.name.startswith(begins[order])
            assert (one.gear_ratio, one.assumed) == (None, False)
    # An alias is no reason to think of the output side.
    assert explain_order(35, [1], gear_ratio=100.0) == ()


def test_without_a_ratio_the_common_ones_are_tried() -> None:
    assert COMMON_RATIOS == (30, 50, 80, 100, 120, 160)
    found = explain_order(7, [100.0])
    assert [(e.order, e.gear_ratio, e.assumed) for e in found] == [
        (100, 50, True),
        (100, 100, True),
    ]
    assert str(found[1]).endswith("wave generator, if the gear ratio is 100)")
    known = explain_order(100.0, gear_ratio=50, fixed_member="none")
    assert [str(e) for e in known] == ["100 (twice per motor turn)"]
    assert not known[0].assumed


def test_a_harmonic_belongs_to_a_line_three_times_as_large() -> None:
    def bases(order: float, amplitudes: dict[float, float]) -> list[str]:
        return [e.name.split(",")[0] for e in explain_as_harmonic(order, amplitudes)]

    assert bases(12, {4: 6.0, 12: 2.0}) == ["harmonic 3 of order 4"]
    assert bases(12, {4: 5.99, 12: 2.0}) == []
    # The largest of those it is a multiple of.
    assert bases(12, {4: 6.0, 6: 8.0, 3: 7.0, 12: 2.0}) == ["harmonic 2 of order 6"]
    assert bases(12, {1: 99.0, 12: 2.0}) == []
    assert bases(12, {5: 99.0, 12: 2.0}) == []
    assert bases(16, {2: 99.0, 16: 2.0}) == ["harmonic 8 of order 2"]
    assert bases(18, {2: 99.0, 18: 2.0}) == []
    assert bases(7.5, {2.5: 99.0, 7.5: 2.0}) == ["harmonic 3 of order 2.5"]
    assert bases(12, {12: 99.0}) == []
    assert bases(12, {4: 80.0}) == []
    assert explain_as_harmonic(12, {4: 6.0, 12: 2.0})[0].order == 12


def test_a_declared_shaft_has_four_multiples() -> None:
    times = {1: "once", 2: "twice", 3: "three times", 4: "four times"}
    for k in range(7):
        found = explain_by_shafts(14.4 * k, {"belt": 0.37, "worm": 14.4})
        expected = [f"{times[k]} per turn of the worm"] if k in times else []
        assert [e.name for e in found] == expected
    assert explain_by_shafts(14.4 * 1.001, {"worm": 14.4}) == ()


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
