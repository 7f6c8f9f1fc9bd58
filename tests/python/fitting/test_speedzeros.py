"""Zeros of runs that follow their speed, and zeros that do not."""

import numpy as np
import pytest

import trueangle as ta
from trueangle.fitting.unlikeruns import zeros_follow_speed
from trueangle.simulation import Simulation

SEED = 77_300


def runs(rng, speeds, delay=0.0, zeros=0.0, play=0.0, timed=True):
    found = []
    for label, speed in enumerate(speeds):
        time = np.linspace(0.0, 370.0 / abs(speed), 300)
        true = speed * time
        late = true - delay * speed
        error = 0.02 * np.sin(np.radians(late + 40.0)) + rng.normal(0.0, 0.001, time.size)
        error += zeros * rng.normal() + play * np.sign(speed)
        found.append(
            ta.CalibrationRun(true, late + error, 360.0, time if timed else None, label=str(label))
        )
    return found


def told(found, **how):
    return [note for note in ta.fit(found, orders=[1], **how).notes if "follow their speed" in note]


@pytest.mark.parametrize("delay", [0.0004, -0.002])
def test_a_delay_is_told_with_its_size_and_diagnose_names_it(delay):
    found = runs(np.random.default_rng(SEED), (20.0, -20.0, 80.0, -80.0), delay)
    (note,) = told(found)
    assert float(note.split("a delay of ")[1].split(" ms")[0]) == pytest.approx(
        1e3 * delay, rel=0.1
    )
    assert "Run diagnose, which separates a delay from a reversal error" in note
    with pytest.raises(ta.errors.ArgumentError, match="one at a single speed has it in its zero"):
        told(found, nuisance="velocity")  # a column of rounding: zeros of 100 deg
    diagnosis = ta.diagnose(found, Simulation(sigma_arcsec=3.6))
    (latency,) = [f for f in diagnosis.findings if f.cause == "latency"]
    assert latency.parameters["delay_s"].value == pytest.approx(delay, rel=0.05)


def test_nothing_is_told_of_two_runs_of_one_speed_and_of_no_time():
    rng = np.random.default_rng(SEED)
    for speeds, timed in (((20.0, -80.0), True), ((20.0,) * 5, True), ((20.0, -20.0, 80.0), False)):
        assert not told(runs(rng, speeds, 0.002, timed=timed))


def test_zeros_that_are_new_in_every_run_are_no_delay():
    """With p < 0.001 hardly one of 200."""
    print("seed", SEED)
    speeds = (10.0, -25.0, 60.0, -5.0, 40.0)
    wrong = []
    for seed in range(200):
        found = runs(np.random.default_rng([SEED, seed]), speeds, zeros=0.05 * (seed % 2))
        fit = ta.fit(found, orders=[1])
        if zeros_follow_speed(found, fit.offsets, fit.offset_std):
            wrong.append(seed)
    assert len(wrong) <= 1, wrong
