"""Numbers of measured minus simulated against a slow reading of their definitions."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import norm

from trueangle import CalibrationRun
from trueangle.diagnosis import remainder
from trueangle.diagnosis.correctable import Correctable
from trueangle.diagnosis.discrepancy import discrepancy_of, unfolded_error
from trueangle.joint.signals import join_runs


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_numbers_are_those_of_the_residual(sign: float) -> None:
    """Zeros of each run, a closure of each turn; mirrored errors have mirrored closures."""
    rng = np.random.default_rng(12)
    angle = np.linspace(0.0, 400.0, 200)
    runs = [CalibrationRun(sign * angle + 3.0 * k, sign * angle + 3.0 * k, 360.0) for k in range(4)]
    signals = join_runs(runs)
    zero = np.array([10.0, 14.0, -3.0, 40.0])
    drift = 7.0 * np.abs(signals.theta - np.repeat(signals.theta[::200], 200)) / (2.0 * np.pi)
    residual = sign * (zero[signals.run] + drift + rng.normal(0.0, 0.1, signals.theta.size))
    found = discrepancy_of(signals, residual)
    mean = sum(residual) / len(residual)
    assert found.rms == pytest.approx(np.sqrt(sum((residual - mean) ** 2) / len(residual)))
    assert found.peak_to_peak == pytest.approx(max(residual) - min(residual))
    assert found.max_abs == pytest.approx(max(abs(r - mean) for r in residual))
    assert found.closure == pytest.approx(sign * 7.0, abs=0.4)
    means = [residual[200 * k : 200 * (k + 1)].mean() for k in range(4)]
    spread = np.sqrt(sum((m - np.mean(means)) ** 2 for m in means) / 3.0)
    assert found.zero_spread == pytest.approx(spread)
    one = join_runs([CalibrationRun(angle[:90], angle[:90], 360.0)])
    alone = discrepancy_of(one, residual[:90])
    assert (alone.closure, alone.zero_spread) == (None, 0.0)


def test_errors_are_unfolded_about_their_mean_in_every_unit() -> None:
    reference = np.linspace(0.0, 359.0, 50)
    error = 20.0 + 3.0 * np.cos(np.radians(reference))
    found = []
    for period in (360.0, 2.0 * np.pi, 1.0, 4096.0):
        unit = period / 360.0
        indicated = np.mod(reference + error + 170.0, 360.0) * unit
        found.append(unfolded_error([CalibrationRun(reference * unit, indicated, period)]))
        np.testing.assert_allclose(found[-1], 3600.0 * (error + 170.0 - 360.0), rtol=1e-9)


def test_the_noise_a_simulator_lacks_is_what_its_log_has_not() -> None:
    """Measured readings have the log's noise and more; measured minus simulated has both."""
    rng = np.random.default_rng(5)
    own, lacking = 3.0, 4.0
    log = rng.normal(0.0, own, 400_000)
    measured = rng.normal(0.0, own, log.size) + rng.normal(0.0, lacking, log.size)
    made = SimpleNamespace(
        noise=float(np.std(measured - log)), simulated=SimpleNamespace(noise_arcsec=own)
    )
    arcsec = np.radians(1.0 / 3600.0)
    assert Correctable.sensor_noise(made) == pytest.approx(lacking * arcsec, rel=0.02)
    made = SimpleNamespace(noise=4.0, simulated=None)
    assert Correctable.sensor_noise(made) == pytest.approx(4.0 * arcsec, rel=1e-12)
    made = SimpleNamespace(noise=4.0, simulated=SimpleNamespace(noise_arcsec=4.0))
    assert Correctable.sensor_noise(made) == 0.0


def test_a_path_whose_size_cannot_be_negative_has_half_the_chance(monkeypatch) -> None:
    """Of z = sqrt(deviance) one-sided: a variance is none or more (Chernoff 1954)."""
    monkeypatch.setattr(remainder, "free_paths", lambda regression: [0, 2])
    terms = [SimpleNamespace(run_effect=object(), deviance=d) for d in (5.0, 100.0, 4.0)]
    made = SimpleNamespace(
        terms=terms,
        left=np.zeros(4),
        whiten=SimpleNamespace(run_part=lambda left, chosen: np.array([1.0, -1.0, 3.0, -3.0])),
    )
    found = remainder.path_evidence(made)
    assert found.statistic == 9.0
    assert found.p == pytest.approx(norm.sf(3.0))
    assert found.rms == pytest.approx(np.sqrt(5.0))
    assert "2.2 arcsec rms" in found.says
