"""What depends on which of several causes is there, where these are not told apart."""

from __future__ import annotations

import numpy as np
import pytest

import trueangle as ta
from trueangle.simulation import Simulation

SIGMA = 1.2

#: Lines of the joint, of the reference and of the direction: amplitude and phase (deg).
LINE, REFERENCE, WAY = (8.0, 30.0), (5.1, 3.0), (4.4, 201.0)


def line(size, order, angle):
    amplitude, phase = size
    return amplitude * np.sin(np.radians(order * angle + phase))


def measured(order, parts, play, mount, repeats, rng):
    """Forward on one mount and backward on another: both factors in one."""
    runs = []
    for k in range(2 * repeats):
        way, turned = (1.0, 0.0) if k % 2 else (-1.0, mount)
        theta = rng.uniform(0.0, 360.0) + way * np.sort(rng.uniform(0.0, 380.0, 240))
        error = play * way + SIGMA * rng.normal(size=theta.size)
        error += line(LINE, order, theta) * ("line" in parts)
        error += line(REFERENCE, order, theta + turned) * ("reference" in parts)
        error += way * line(WAY, order, theta) * ("way" in parts)
        time = np.abs(theta - theta[0]) / 14.0
        runs.append(
            ta.CalibrationRun(
                theta,
                theta + error / 3600.0,
                period=360.0,
                time=time,
                mount=np.full(theta.size, turned),
                label=f"run {k}",
            )
        )
    return runs


@pytest.mark.parametrize("seed", [52_301, 52_303, 52_307])
@pytest.mark.parametrize("parts", [("line", "reference"), ("line", "way"), ("reference", "way")])
@pytest.mark.parametrize("play", [0.0, 6.0])
def test_mount_and_direction_that_change_together(play, parts, seed):
    """A line, one of the reference, one of the direction: any two of them make the same."""
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    order, repeats = int(rng.integers(1, 4)), int(rng.integers(1, 4))
    runs = measured(order, parts, play, float(rng.uniform(40.0, 80.0)) / order, repeats, rng)
    result = ta.diagnose(runs, Simulation())
    assert [f.cause for f in result.findings if f.confirmed] == []
    seen = {cause for spot in result.not_identifiable if spot.supported for cause in spot.causes}
    either = [{f.factor, *f.not_distinguished_from} for f in result.factors if not f.named_by]
    assert len(seen & {"reference_error", "direction_dependent_pattern", "missing_order"}) >= 2 or (
        any({"place", "mount_place"} <= factors for factors in either)
    )
    assert not result.unexplained.found


@pytest.mark.parametrize("part", ["line", "reference", "way"])
def test_one_of_them_alone_is_told(part):
    """Two of another kind would have to cancel each other."""
    rng = np.random.default_rng(52_321)
    runs = measured(2, (part,), 0.0, 37.0, 3, rng)
    found = [f.cause for f in ta.diagnose(runs, Simulation()).findings if f.confirmed]
    names = {"line": "missing_order", "reference": "reference_error"}
    assert found == [names.get(part, "direction_dependent_pattern")]
