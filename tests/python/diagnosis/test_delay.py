"""A delay that moves the pattern is confirmed as any other cause is."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import trueangle as ta
from trueangle.diagnosis import delay
from trueangle.diagnosis.delay import Delay, delay_finding, error_before_delay
from trueangle.diagnosis.finding import Finding
from trueangle.effects import EFFECTS
from trueangle.estimation.regression import Regression
from trueangle.joint.signals import join_runs
from trueangle.simulation import Harmonic, Simulation


def stale() -> ta.CalibrationRun:
    """A sweep there and back with order 4 of 3 deg, read 25 ms late."""
    rng = np.random.default_rng(6431)
    time = np.arange(2000) / 100.0

    def angle(at):
        return 200.0 - 200.0 * np.cos(2.0 * np.pi * at / 20.0)

    then = angle(time - 0.025)
    indicated = then + 3.0 * np.sin(np.radians(4.0 * then)) + rng.normal(0.0, 0.03, time.size)
    return ta.CalibrationRun(angle(time), indicated, period=360.0, time=time)


@pytest.mark.parametrize("low", [-0.1, 0.1])
def test_a_delay_is_confirmed_where_its_gain_excludes_zero(
    monkeypatch: pytest.MonkeyPatch, low: float
) -> None:
    measured = delay.measure_delay_gain
    monkeypatch.setattr(
        delay, "measure_delay_gain", lambda *a: replace(measured(*a), interval=(low, 1.0))
    )
    result = ta.diagnose(stale(), ta.Simulation())
    (found,) = [finding for finding in result.findings if finding.cause == "latency"]
    assert found.confirmed == (low > 0.0)
    assert ("includes zero" in found.reason) == (low < 0.0)
    told = [effect.kind for effect in result.extended.effects]
    assert ("latency" in told) == (low > 0.0)
    speed = next(one for one in result.factors if one.factor == "speed")
    assert speed.named_by == ("latency",) * (low > 0.0)
    # 200 deg each way in 20 s: the speed is a sine of 20 pi deg/s.
    assert speed.low < 3600.0 * 0.025 * 20.0 * np.pi / np.sqrt(2.0) * 1.002 < 1.01 * speed.high
    np.testing.assert_allclose(speed.curve.value, -90.0 * speed.curve.at, rtol=0.01, atol=1.0)


# -- how large it is told ---------------------------------------------------------------

TRUE = 0.025


def delayed(seed: int) -> tuple:
    """Sweeps there and back whose pattern is that of an angle 25 ms before; and an offset of it."""
    rng = np.random.default_rng(seed)
    time = np.arange(600) / 50.0
    runs = []
    for swing in (90.0, 140.0):

        def angle(at, swing=swing):
            return 200.0 - swing * np.cos(2.0 * np.pi * at / 12.0)  # fmt: skip

        then = angle(time - TRUE)
        indicated = then + 2.0 * np.sin(np.radians(4.0 * then)) + rng.normal(0.0, 0.02, time.size)
        runs.append(ta.CalibrationRun(angle(time), indicated, period=360.0, time=time))
    signals = join_runs(runs)
    error = np.concatenate([3600.0 * (run.indicated - run.reference) for run in runs])
    pattern = Harmonic("output", 4, 7200.0, 0.0)
    sim = Simulation(harmonics=(pattern,))
    return signals, error, sim


def told_delay(seed: int, offset: float) -> Finding:
    signals, error, sim = delayed(seed)
    then, moved_error = error_before_delay(signals, error, TRUE + offset)
    around = sim.surroundings
    chosen = Regression.of(then, moved_error - sim.predict(then), around, rho=0.0)
    # Beside another cause, whose error is its own.
    play = chosen.propose("backlash", {}, EFFECTS["backlash"].columns(then, around, {}))
    chosen = chosen.with_terms([play])
    plain = Regression.of(signals, error - sim.predict(signals), around, rho=0.0)
    given = Delay(TRUE + offset, 1e-5, sim.pattern)
    rest = SimpleNamespace(found=False, beside_path=0.0)
    return delay_finding(given, chosen, plain, False, rest), chosen, plain


@pytest.mark.parametrize("offset", [-1e-4, 1e-4])
def test_a_delay_is_told_from_where_the_account_stands(offset):
    """The rest of it is added with its sign, and its error is by how much seeds scatter."""
    pulls = []
    for seed in range(40):
        found, chosen, plain = told_delay(7_300 + seed, offset)
        told = found.parameters["delay_s"]
        pulls.append((told.value - TRUE) / told.std)
        assert found.effects[0].delay_s == told.value
    assert abs(np.mean(pulls)) < 5.0 / np.sqrt(40)
    # A deviation of 40 is known to 11 %.
    assert 0.6 < np.std(pulls) < 1.5
    plain = plain.with_terms(
        [replace(term, columns=plain.signals.direction[:, None]) for term in chosen.terms]
    )
    saved = plain.deviance - chosen.deviance
    assert found.evidence == pytest.approx(
        {"deviance": saved, "bic_gain": saved - chosen.log_n, "parameters": 1.0, "log_grid": 0.0}
    )
