"""What a joint knows of its orders: one table of all that a joint with everything may show."""

from __future__ import annotations

import math

import pytest

from trueangle.errors import ArgumentError
from trueangle.joint.joint import Bearing, DeclaredShaft, Head, Joint

WORM = DeclaredShaft("worm", teeth=37)
BELT = DeclaredShaft("belt", cycles_per_turn=0.37)
ECCENTRIC = "eccentricity of the encoder's magnet or scale"
TILTED = "encoder displaced or tilted from the axis, or ellipticity of its scale"
OFFSET = "interpolation error: offset of the sine and cosine signals"
GAIN = "interpolation error: gain mismatch or quadrature error of the sine and cosine signals"
SECOND = "interpolation error: second harmonic in the sine and cosine signals"
THIRD = "interpolation error: third or fifth harmonic in the sine and cosine signals"
ONCE = "wave generator, once per turn: eccentricity, bearing"
TWICE = "wave generator, twice per turn: meeting the teeth of a spline"
FOUR = "wave generator, four times per turn: its shape"
MOUNT = "eccentricity at the output: spline, bearing, or the reference's coupling"
COUPLING = "misaligned coupling or ellipticity at the output"
NOTHING = "an error of this order with no standard cause for this joint"


def test_every_explanation_of_a_joint_with_its_encoder_at_the_motor() -> None:
    joint = Joint(101.0, "circular_spline", "motor", 16, (WORM, BELT))
    known = {
        1.0: [MOUNT],
        2.0: [COUPLING],
        3.0: [NOTHING],
        101.0: [ECCENTRIC, ONCE],
        102.0: [ONCE],
        202.0: [TILTED, TWICE],
        204.0: [TWICE],
        303.0: ["motor-side order 3: graduation of the scale"],
        306.0: [NOTHING],
        404.0: [FOUR],
        408.0: [FOUR],
        505.0: ["motor-side order 5: graduation of the scale"],
        16 * 101.0: [OFFSET],
        32 * 101.0: [GAIN],
        48 * 101.0: [SECOND],
        64 * 101.0: [THIRD],
        80 * 101.0: ["motor-side order 80: graduation of the scale"],
        37.0: ["worm, once per turn (wheel of 37 teeth)"],
        74.0: ["worm, twice per turn (wheel of 37 teeth)"],
        111.0: ["worm, 3 times per turn (wheel of 37 teeth)"],
        148.0: ["worm, 4 times per turn (wheel of 37 teeth)"],
        185.0: [NOTHING],
        0.37: ["belt, once per turn"],
        4 * 0.37: ["belt, 4 times per turn"],
        50.5: [NOTHING],
    }
    for k in range(2, 9):
        known[k * 64 * 101.0] = [f"harmonic {k} of the interpolation error of order 4"]
    known[9 * 64 * 101.0] = ["motor-side order 576: graduation of the scale"]
    for order, expected in known.items():
        assert joint.explanations(order) == expected, order
        for aside in (0.9e-6, -0.9e-6):
            assert joint.explanations(order + aside * max(order, 1.0)) == expected, order
        # At its very place it needs no tolerance.
        if order.is_integer():
            assert joint.explanations(order, tolerance=0.0) == expected
        # Beside its place no line has any of these.
        for aside in (1.1e-6, -1.1e-6):
            assert not set(joint.explanations(order + aside * max(order, 1.0))) & {*expected} - {
                NOTHING
            }, order


def test_every_explanation_of_an_encoder_at_the_output() -> None:
    joint = Joint(pole_pairs=3)
    known = {
        1.0: [ECCENTRIC],
        2.0: [TILTED],
        3.0: [OFFSET],
        6.0: [GAIN],
        9.0: [SECOND],
        12.0: [THIRD],
        7.0: [NOTHING],
        24.0: ["harmonic 2 of the interpolation error of order 4"],
        108.0: [NOTHING],
    }
    for order, expected in known.items():
        assert joint.explanations(order) == expected, order
    geared = Joint(50.0, pole_pairs=16)
    assert geared.explanations(50.0) == ["motor-side order 1: graduation of the scale"]
    assert geared.explanations(25.0) == [NOTHING]
    # One period a turn: each low order has two.
    both = Joint(50.0, "flexspline", "output")
    assert both.explanations(1.0) == [ECCENTRIC, OFFSET]
    assert both.explanations(2.0) == [TILTED, GAIN]
    assert both.explanations(49.0) == [ONCE]
    assert both.explanations(98.0) == [TWICE]
    assert both.explanations(196.0) == [FOUR]
    assert both.explanations(25.0) == [NOTHING]
    assert both.explanations(150.0) == ["motor-side order 3: graduation of the scale"]


def test_orders_that_a_gear_is_known_to_leave() -> None:
    generator = [("wave_generator", k) for k in (1, 2, 4)]
    motor = [("motor", k) for k in (1, 2, 3, 4)]
    assert Joint().gear_orders() == []
    assert Joint(50.0).gear_orders() == motor
    assert Joint(50.0, "flexspline").gear_orders() == motor + generator
    assert Joint(50.0, pole_pairs=3).gear_orders() == [("motor", k) for k in (1, 2, 3, 4, 6, 9, 12)]
    assert Joint(50.0, pole_pairs=8).gear_orders() == [
        ("motor", k) for k in (1, 2, 3, 4, 8, 16, 24, 32)
    ]
    assert Joint(50.0, pole_pairs=9).gear_orders() == motor
    assert Joint(declared=(WORM,)).gear_orders() == [("worm", k) for k in (1, 2, 3, 4)]


def test_an_order_has_the_name_of_its_fastest_shaft() -> None:
    joint = Joint(101.0, "circular_spline", "motor", 1, (BELT, WORM))
    assert joint.name_order(101.0) == ("motor", 1)
    assert joint.name_order(808.0) == ("motor", 8)
    assert joint.name_order(909.0) == ("output", 909)
    assert Joint(101.0, pole_pairs=2).name_order(1616.0) == ("motor", 16)
    assert joint.name_order(102.0) == ("wave_generator", 1)
    # 37 turns of the worm or 100 of the belt: the worm is the faster one.
    assert joint.name_order(37.0) == ("worm", 1)
    assert joint.name_order(0.37) == ("belt", 1)
    assert joint.name_order(5.0) == ("output", 5)
    assert joint.name_order(5.5) is None
    assert joint.name_order(0.0) is None
    assert joint.name_order(math.inf) is None
    assert Joint(5e-324).name_order(1.0) == ("output", 1)
    # 20 is once the worm and twice the belt, whichever is declared first.
    both = (DeclaredShaft("worm", 20.0), DeclaredShaft("belt", 10.0))
    for declared in (both, both[::-1]):
        assert Joint(declared=declared).name_order(20.0, tolerance=0.0) == ("worm", 1)
    for order, tolerance in ((101.0, 1e-6), (5.0, 1e-3), (0.37, 1e-6)):
        inside, outside = 0.9 * max(order, 1.0) * tolerance, 1.1 * max(order, 1.0) * tolerance
        name = joint.name_order(order)
        for sign in (1.0, -1.0):
            assert joint.name_order(order + sign * inside, tolerance) == name
            assert joint.name_order(order + sign * outside, tolerance) != name


def test_shafts_of_a_direct_drive() -> None:
    assert Joint().shafts == {"output": 1.0}
    assert Joint(2.0).shafts == {"output": 1.0, "motor": 2.0}
    assert Joint(1.0, "circular_spline").shafts["wave_generator"] == 2.0
    assert Joint(50.0, "flexspline", declared=(BELT,)).output_order("belt", 2.0) == 0.74
    assert Joint(50.0, "flexspline").output_order("wave_generator", 2) == 98.0
    with pytest.raises(ArgumentError, match="shaft must be one of output"):
        Joint().output_order("motor", 1)


def test_lines_of_bearings_allow_for_slip() -> None:
    joint = Joint(
        100.0,
        "circular_spline",
        bearings=(Bearing("wave_generator", 10, 0.25), Bearing("output", 5, 0.5)),
    )
    lines = {
        101.0 * 0.375: "bearing on wave generator: cage",
        101.0 * 3.75: "bearing on wave generator: outer race",
        101.0 * 6.25: "bearing on wave generator: inner race",
        101.0 * 1.875: "bearing on wave generator: ball",
        0.25: "bearing on output: cage",
        1.25: "bearing on output: outer race",
        3.75: "bearing on output: inner race",
        0.75: "bearing on output: ball",
    }
    for order, name in lines.items():
        for share in (0.9801, 1.0, 1.0199):
            assert joint.bearing_lines(share * order) == [name]
        for share in (0.9799, 1.0201):
            assert joint.bearing_lines(share * order) == []
        assert name in joint.explanations(order)


def test_what_no_joint_is() -> None:
    for wrong, says in (
        ({"gear_ratio": 0.0}, "gear_ratio must be motor turns .*, finite and not 0"),
        ({"gear_ratio": float("inf")}, "gear_ratio must be motor turns .*, finite and not 0"),
        ({"gear_ratio": 1.0, "fixed_member": "flexspline"}, "above 1"),
        ({"fixed_member": "spline"}, "fixed_member"),
        ({"encoder_side": "gear"}, "encoder_side must be one of"),
        ({"pole_pairs": 0}, "pole_pairs must be at least 1, got 0"),
        ({"declared": (WORM, BELT, WORM)}, "declared twice: worm, belt, worm"),
        ({"heads": (Head(0.0),) * 100}, "at most 99 heads, got 100"),
        ({"bearings": (Bearing("motor", 9, 0.2),)}, "shaft must be one of output"),
    ):
        with pytest.raises(ArgumentError, match=says):
            Joint(**wrong)
    assert len(Joint(heads=(Head(0.0),) * 99).heads) == 99


def test_boundaries_of_what_is_declared() -> None:
    assert Bearing("motor", 3, 0.5).balls == 3
    for ratio in (0.0, 1.0, -0.1, 1.1):
        with pytest.raises(ArgumentError, match="diameter_ratio must lie between 0 and 1"):
            Bearing("motor", 9, ratio)
    with pytest.raises(ArgumentError, match="balls must be at least 3, got 2"):
        Bearing("motor", 2, 0.5)
    for angle in (360.0, -360.0):
        assert Head(angle).angle_deg == angle
    for angle in (360.001, -360.001, float("nan")):
        with pytest.raises(ArgumentError, match="angle_deg must be within one turn"):
            Head(angle)
    for cycles in (0.0, -1.0, float("inf"), float("nan")):
        with pytest.raises(ArgumentError, match="must be positive"):
            DeclaredShaft("worm", cycles)
    for name in ("", "output", "motor", "wave_generator"):
        with pytest.raises(ArgumentError, match="a shaft's own, other than output, motor"):
            DeclaredShaft(name, 2.0)
    assert [BELT.explanation(k) for k in (1, 2, 3)] == [
        "belt, once per turn", "belt, twice per turn", "belt, 3 times per turn",
    ]  # fmt: skip
