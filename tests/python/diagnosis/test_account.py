"""Which readings an account is given of."""

from __future__ import annotations

import os

import numpy as np

import trueangle as ta
from trueangle.diagnosis.account import PreparedData
from trueangle.estimation.regression import Regression
from trueangle.joint.signals import join_runs

NIGHTLY = os.environ.get("TRUEANGLE_NIGHTLY") == "1"

#: Half of the play, arcsec, and its noise.
HALF, SIGMA = 3.0, 1.0


def turned_early(seed: int, runs: int = 8) -> list[ta.CalibrationRun]:
    """Sweeps whose recorded speed changes its sign one reading before the joint moves back."""
    rng = np.random.default_rng(seed)
    found = []
    for k in range(runs):
        steps = np.repeat([1.0, 0.0, -1.0, 0.0, 1.0], [80, 1, 70, 1, 60])
        angle = rng.uniform(0.0, 360.0) + np.cumsum(steps * rng.uniform(0.5, 1.5, steps.size))
        moving = np.repeat([1.0, -1.0, 1.0], [80, 71, 61])
        side = np.repeat([1.0, -1.0, 1.0], [81, 71, 60])
        error = HALF * side + rng.normal(0.0, SIGMA, steps.size)
        speed = moving * (10.0 if k % 2 else 40.0)
        found.append(
            ta.CalibrationRun(
                angle,
                angle + error / 3600.0,
                period=360.0,
                time=np.arange(steps.size) / 40.0,
                velocity=speed,
                label=f"run {k}",
            )
        )
    return found


def test_readings_that_turned_and_have_not_moved_take_no_part() -> None:
    every = join_runs(turned_early(6411))
    seen = PreparedData.of(every, np.zeros(len(every)), ta.Simulation())
    assert seen.rows is not None
    left_out = np.setdiff1d(np.arange(len(every)), seen.rows)
    np.testing.assert_array_equal(every.row[left_out], np.tile([80, 151], 8))


def test_a_joint_that_hardly_moves_has_no_turning_points() -> None:
    rng = np.random.default_rng(6412)
    still = np.full(40, 17.0)
    speed = np.where(np.arange(40) % 10 < 5, 1.0, -1.0)
    run = ta.CalibrationRun(still, still + rng.normal(0.0, 1e-3, 40), period=360.0, velocity=speed)
    every = join_runs([run])
    assert PreparedData.of(every, np.zeros(len(every)), ta.Simulation()).rows is None


def test_a_play_whose_turning_points_read_the_other_side_is_no_spring() -> None:
    """One reading a reversal on the other side is a short transition, and tells of none."""
    for seed in (6421, 6422, 6423):
        print(f"seed {seed}")
        result = ta.diagnose(turned_early(seed), ta.Simulation(), gain=False)
        assert [finding.cause for finding in result.findings] == ["backlash"], result.summary()
        width = result.findings[0].parameters["half_width_arcsec"]
        assert abs(width.value - HALF) < 4.0 * width.std
        assert result.readings_used == result.readings - 16
        assert "without turning points" in " ".join(result.summary().split())


def test_weights_do_not_change_what_causes_are_counted_from() -> None:
    """A pattern not yet explained is described by chance by one noise better than by another."""
    rng = np.random.default_rng(29)
    angle = np.linspace(0.0, 720.0, 900)
    error = 900.0 * np.sin(np.radians(3.0 * angle)) + rng.normal(0.0, SIGMA, angle.size)
    signals = join_runs([ta.CalibrationRun(angle, angle, period=360.0)])
    start = Regression.of(signals, error, ta.Simulation().surroundings)
    weights = np.where(np.sin(np.radians(angle)) > 0.0, 0.2, 1.8)
    weighted = start.weighted(weights)
    assert weighted.deviance > start.deviance + 300.0
    assert weighted.start == start.start


def test_noise_whose_neighbours_share_nearly_all_has_no_zeros_of_its_own() -> None:
    """A correlation that is taken too low makes means of runs scatter too much."""
    for seed in (4_100, 4_101) if NIGHTLY else (4_100,):  # half a minute each
        print(f"seed {seed}")
        rng = np.random.default_rng(seed)
        runs = []
        for k in range(9):
            noise = rng.normal(0.0, SIGMA, 400)
            for i in range(1, noise.size):
                noise[i] = 0.97 * noise[i - 1] + np.sqrt(1.0 - 0.97**2) * noise[i]
            angle = 30.0 * k + 175.0 - np.abs(np.linspace(-175.0, 175.0, noise.size))
            time = np.arange(noise.size) / (20.0, 40.0, 80.0)[k % 3]
            indicated = angle + noise / 3600.0
            runs.append(ta.CalibrationRun(angle, indicated, period=360.0, time=time))
        result = ta.diagnose(runs, ta.Simulation())
        assert [f.cause for f in result.findings if f.confirmed] == [], result.summary()


def test_an_effect_of_another_size_than_believed_is_that_size_and_no_further_cause() -> None:
    """Of those to be put right the one is taken that leaves the least to be explained."""
    play, delay = ta.simulation.Backlash, ta.simulation.Latency
    runs = tuple(
        ta.simulation.RunDesign(
            samples=150, reversals=(0.3, 0.6), start_deg=40.0 * k, speed_deg_s=(5.0, 30.0)[k % 2]
        )
        for k in range(4)
    )
    truth = ta.Simulation(sigma_arcsec=1.0, runs=runs, effects=(play(2.0), delay(5e-5)))
    print("seed 6413")
    measured = ta.simulate(truth, 6413)
    for half, seconds in ((6.0, 5e-5), (2.0, 2e-5)):
        believed = ta.Simulation(sigma_arcsec=1.0, effects=(play(half), delay(seconds)))
        found = ta.diagnose(measured, believed)
        assert [f.cause for f in found.findings] == []
        verdicts = {belief.what: belief.verdict for belief in found.beliefs}
        assert verdicts["backlash"] == ("overestimated" if half > 2.0 else "confirmed")
        assert verdicts["latency"] == ("underestimated" if seconds < 5e-5 else "confirmed")
        (width,) = [e.half_width_arcsec for e in found.extended.effects if isinstance(e, play)]
        (lag,) = [e.delay_s for e in found.extended.effects if isinstance(e, delay)]
        assert abs(width - 2.0) < 0.2
        assert abs(lag - 5e-5) < 4e-6
