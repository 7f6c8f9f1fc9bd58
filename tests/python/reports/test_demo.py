"""The demonstration draws the readings that were asked for."""

import numpy as np
import pytest

from trueangle.reports import demo
from trueangle.simulation import Backlash, simulate


@pytest.mark.parametrize("seed", [0, 7])
def test_it_is_of_the_readings_of_its_seed_and_its_effect(seed, monkeypatch):
    asked = []
    monkeypatch.setattr(demo, "report", lambda runs, path, **more: asked.append((runs, more)))
    hidden = Backlash(5.0)
    demo.demo_report(hidden=hidden, seed=seed)
    ((runs, more),) = asked
    believed = demo.demo_simulation()
    assert more["simulation"] == believed
    wanted = simulate(believed.with_effects([hidden]), seed)
    for run, other in zip(runs, wanted, strict=True):
        np.testing.assert_array_equal(run.indicated, other.indicated)
