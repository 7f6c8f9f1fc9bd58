"""Exported steps know no unit of angle but their own: a model in another unit is the same step."""

import numpy as np
import pytest

import trueangle as ta
from trueangle.export.fmufiles import fmu_source, variables_of

#: Of powers of two, so that no number is rounded on the way.
PERIODS = (1.0, 64.0, 4096.0)


def model(period, argument):
    size = period / 1024.0
    shafts = [ta.Shaft("output", 1, [1, 3], [2.0 * size, 0.5 * size], [size, -0.25 * size])]
    return ta.HarmonicModel(
        shafts, constant=16.0 * size, period=period, argument=argument,
        terms=[ta.terms.Backlash(0.5 * size)],
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
