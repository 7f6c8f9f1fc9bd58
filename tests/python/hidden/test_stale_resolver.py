"""A resolver whose reading is old: the delay moves the pattern that it is found beside."""

from __future__ import annotations

import os

import numpy as np
import pytest

import trueangle as ta
from trueangle.simulation import Simulation

from .sweeps import measured, with_rests

#: Seeds that nothing was chosen on, and one that shows a play of five standard errors where its
#: delay is taken as known; `make exam` asks more.
LARGE = os.environ.get("TRUEANGLE_EXAM_SEEDS")
SEEDS = range(8200, 8200 + int(LARGE)) if LARGE else (8200, 8201, 71001)

#: Noise of one reading, degrees.
SIGMA = 0.03

#: Share by which a delay may be off; rms left, in rms of the noise.
OFF, LEFT = 0.03, 1.2

#: Share by which a standard error may differ from that of a fit whose form is known.
SAME_ERROR = 0.35  # wider by the slow noise that one run of white noise does not exclude


def way(theta):
    """The direction of travel at angles one after the other; at rest the one before."""
    steps = np.sign(np.diff(theta).round(9))
    last = np.maximum.accumulate(np.where(steps != 0.0, np.arange(steps.size), 0))
    steps[0] = steps[np.flatnonzero(steps)[0]]
    return np.concatenate([steps[:1], steps[last]])


def stale(rng, play=0.0):
    """One sweep of a resolver that answers late; the delay (s) and the amplitude (deg)."""
    delay, amplitude = rng.uniform(0.012, 0.034), float(np.exp(rng.uniform(np.log(0.3), np.log(7))))
    time, angle = with_rests(rng, rng.uniform(20.0, 70.0), int(rng.integers(1500, 4000)))
    then = angle(time - delay)
    own = amplitude * np.sin(np.radians(4.0 * then + rng.uniform(0.0, 360.0)))
    error = then + own - angle(time) + rng.normal(0.0, SIGMA, time.size)
    error = error + play * way(angle(time))
    return measured(angle(time), time, 3600.0 * error), delay, amplitude


@pytest.mark.parametrize("seed", SEEDS)
def test_a_delay_and_the_pattern_that_it_moves_are_told_jointly(seed, patient):
    print(f"seed {seed}")
    run, delay, amplitude = stale(np.random.default_rng(seed))
    result = ta.diagnose(run, Simulation())
    sure = [finding for finding in result.findings if finding.confirmed]
    assert sorted(f.cause for f in sure) == ["latency", "missing_order"], result.summary()
    found = {finding.cause: finding.parameters for finding in sure}
    assert abs(found["latency"]["delay_s"].value / delay - 1.0) < OFF
    line = found["missing_order"]
    assert line["output_order"].value == 4.0
    assert abs(line["amplitude_arcsec"].value / (3600.0 * amplitude) - 1.0) < OFF
    left = result.gain["rms_after_arcsec"] / 3600.0
    assert left < LEFT * SIGMA
    # The extended simulation says the same of these readings.
    beyond = 3600.0 * np.degrees(run.error) - result.extended.predict(run)
    assert float(np.std(beyond)) / 3600.0 < LEFT * SIGMA


def test_play_beside_a_delay_has_the_standard_error_of_a_joint_fit(patient):
    """At one speed a play is nearly a delay: taken as known, it leaves half of the error."""
    run, delay, _ = stale(np.random.default_rng(71204), SIGMA)
    result = ta.diagnose(run, Simulation())
    found = {f.cause: f.parameters for f in result.findings if f.confirmed}
    assert sorted(found) == ["backlash", "latency", "missing_order"], result.summary()
    theta = np.degrees(run.reference)
    then = np.interp(run.time - delay, run.time, theta)
    sine, cosine, ones = np.sin(np.radians(4 * then)), np.cos(np.radians(4 * then)), 1 + 0 * then
    own = np.degrees(run.error) - (then - theta) - SIGMA * way(theta)
    _, a, b = np.linalg.lstsq(np.column_stack([ones, sine, cosine]), own, rcond=None)[0]
    moved = np.gradient(then, run.time) * (1 + np.radians(4 * (a * cosine - b * sine)))
    x = np.column_stack([ones, sine, cosine, moved, way(theta)])
    expected = 3600 * SIGMA * np.sqrt(np.linalg.inv(x.T @ x)[-1, -1])
    play = found["backlash"]["half_width_arcsec"]
    assert abs(play.std / expected - 1.0) < SAME_ERROR
    assert abs(play.value - 3600 * SIGMA) < 3.0 * play.std


@pytest.mark.parametrize("delay", [0.0, 0.002])
def test_a_small_delay_is_one_cause_among_others(delay):
    """It is told, where it is there; and no pattern is moved for one that is not."""
    rng = np.random.default_rng(8300)
    time, angle = with_rests(rng, 40.0, 1500)
    then = angle(time - delay)
    error = then + 0.3 * np.sin(np.radians(4.0 * then)) - angle(time)
    error = error + rng.normal(0.0, SIGMA, time.size)
    result = ta.diagnose(measured(angle(time), time, 3600.0 * error), Simulation())
    wanted = ["latency", "missing_order"] if delay else ["missing_order"]
    assert sorted(f.cause for f in result.findings) == wanted, result.summary()


def test_standard_errors_of_delays_beside_moved_patterns():
    count = 200 if LARGE else 8
    pulls = []
    for seed in range(8400, 8400 + count):
        run, delay, _ = stale(np.random.default_rng(seed))
        result = ta.diagnose(run, Simulation(), gain=False)
        found = [f.parameters["delay_s"] for f in result.findings if f.cause == "latency"]
        pulls += [(q.value - delay) / q.std for q in found]
    assert len(pulls) == count
    # Pulls have a standard deviation of 1 within four of their own standard errors.
    spread = float(np.sqrt(np.mean(np.square(pulls))))
    assert abs(spread - 1.0) < 4.0 / np.sqrt(2.0 * count), (spread, pulls)
