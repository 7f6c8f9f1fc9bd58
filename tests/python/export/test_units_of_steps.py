"""Exported steps know no unit of angle but their own: a model in another unit is the same step."""

import re

import numpy as np
import pytest

import trueangle as ta
from trueangle.export.fmu import fmu_source, variables_of

#: Of powers of two, so that no number is rounded on the way.
PERIODS = (1.0, 64.0, 4096.0)


def model(period, argument):
    size = period / 1024.0
    shafts = [ta.Shaft("output", 1, [1, 3], [2.0 * size, 0.5 * size], [size, -0.25 * size])]
    return ta.HarmonicModel(
        shafts, constant=16.0 * size, period=period, argument=argument,
        terms=[
            ta.terms.Backlash(0.5 * size),
            # Lengths and places are angles too; times, torques and temperatures are none.
            ta.terms.PreslidingHysteresis(0.25 * size, 8.0 * size, 0.5),
            ta.terms.StiffeningCompliance(size, 0.5 * size, 2.0 * size, 4.0, gravity=32.0 * size),
            ta.terms.TorsionalCompliance(size),
            ta.terms.LocalDefect(64.0 * size, 16.0 * size, 2.0 * size),
            ta.terms.ScaleError(0.125, -256.0 * size, 256.0 * size),
            ta.terms.ThermalDrift(0.5 * size, 0.25),
            ta.terms.CurrentCoupling(0.5 * size),
            ta.terms.LoadDependentGearError((2.5,), (size,), (0.5 * size,)),
            ta.terms.Latency(0.25),
            ta.terms.FilterLag(8.0, 0.5),
        ],
    )  # fmt: skip


@pytest.mark.parametrize("argument", ["reference", "indicated"])
@pytest.mark.parametrize("sensor", [False, True])
def test_the_source_of_a_unit_is_the_same_in_every_unit_of_angle(argument, sensor):
    sources = []
    for period in PERIODS:
        one = model(period, argument)
        sources.append(fmu_source(one, variables_of(one, sensor), sensor, "").splitlines())
    np.testing.assert_array_equal(sources[1], sources[0])
    np.testing.assert_array_equal(sources[2], sources[0])
    # The zero in turns.
    assert any("0.015625" in line for line in sources[0])


@pytest.mark.parametrize(("target", "found"), [
    ("c", r"\(uint32_t\)x - (-?\w+?)u?\)"), ("rust", r"x as u32\)\.wrapping_sub\((-?\w+)\)"),
])  # fmt: skip
@pytest.mark.parametrize("angle", [-410.0, -30.0, -1e-12, 0.0, 30.0, 359.9999, 360.0, 725.0])
def test_the_way_down_is_a_place_within_the_turn(target, found, angle):
    """A word of 32 bits, whatever turn the angle of gravity is given in."""
    one = ta.HarmonicModel(
        [ta.Shaft("output", 1, [1], [0.1], [0.0])], period=360.0,
        terms=[ta.StiffeningCompliance(1e-3, gravity=angle)],
    )  # fmt: skip
    (place,) = re.findall(found, ta.export_model(one, target, bits=10).text)
    assert 0 <= int(place) < 2**32
    away = int(place) / 2**32 - angle / 360.0
    assert abs(away - round(away)) <= 0.5001 / 2**32


def test_functions_of_shafts_of_one_name_are_counted():
    names = ["a b", "a-b", "A b", "c", "a_b"]
    shafts = [ta.Shaft(name, k, [1], [0.1], [0.0]) for k, name in enumerate(names, 1)]
    made = ta.export_model(ta.HarmonicModel(shafts, period=360.0), "c", bits=10, name="f")
    told = re.findall(r"Table (\w+):", made.text)
    assert told == ["a_b", "a_b_2", "a_b_3", "c", "a_b_4"]
