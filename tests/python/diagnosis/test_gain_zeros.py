"""What a pattern gains where every run has a zero of its own, which no pattern takes off."""

import numpy as np
import pytest

import trueangle as ta
from trueangle.simulation import Simulation


@pytest.mark.parametrize(
    ("bits", "zeros"), [(12, (3.0, 4.5)), (10, (0.0, 6.45)), (11, (1.0, -2.0))]
)
def test_an_order_that_is_the_error_of_every_run_has_its_share(bits, zeros):
    """To and fro at two speeds: slip, play or delay, none of which can be told from another."""
    count, size = 360.0 / 2.0**bits, 400.0 / 2.0**bits
    runs = []
    for zero, speed in zip(zeros, (14.0, -4.0), strict=True):
        time = np.arange(200) * 1.8 / abs(speed)
        read = speed * time + size * np.sin(np.radians(speed * time + 50.0)) + zero
        read = np.round(read / count) * count
        runs.append(ta.CalibrationRun(speed * time, read, 360.0, time=time))
    result = ta.diagnose(runs, Simulation(sigma_arcsec=2.0))
    (finding,) = [f for f in result.findings if f.cause == "missing_order"]
    assert finding.confirmed
    assert finding.gain.reducible_share == pytest.approx(1.0, abs=0.05)
    assert finding.gain.holdout.endswith("each held-out run with its own zero")
    assert finding.gain.after[0] < 0.6 * finding.gain.before[0]
