"""Steps or counts that were lost in the middle of a run, and sound runs of every kind."""

import numpy as np
import pytest

import trueangle as ta
from trueangle.runs.checks.record import records_of
from trueangle.runs.checks.rows import missed_counts

SEED = 61_300


def stepper(rng, turns=1.0, step=1.8, lost=7.2, over=1):
    """An encoder of 12 bit against the steps of a motor that loses some in the middle of a run."""
    x = np.arange(0.0, 360.0 * turns, step)
    at = int(x.size * rng.uniform(0.2, 0.8))
    gone = lost * np.clip((np.arange(x.size) - at + 1.0) / over, 0.0, 1.0)
    y = x + 0.4 * np.sin(np.radians(x + 20.0)) + 0.1 * np.sin(np.radians(50.0 * x)) - gone
    y = np.floor((y + rng.normal(0.0, 0.05, x.size)) * 4096.0 / 360.0) * 360.0 / 4096.0
    return at, ta.CalibrationRun(x % 360.0, y % 360.0, 360.0, label="motor")


def told(run):
    return [fault.rows[0] - 1 for fault in missed_counts(records_of([run]))]


@pytest.mark.parametrize(
    ("turns", "step", "lost"),
    [(1.0, 1.8, 7.2), (1.0, 1.8, -7.2), (3.0, 1.8, 7.2), (0.6, 0.9, 3.6), (10.0, 0.1, 14.4)],
)
def test_steps_that_were_lost_are_told_with_their_row(turns, step, lost):
    for seed in range(10):
        at, run = stepper(np.random.default_rng([SEED, seed]), turns, step, lost)
        (fault,) = missed_counts(records_of([run]))
        assert fault.rows == (at + 1,), seed
        (size,) = [float(fault.says.split(" jumps by ")[1].split(" deg")[0])]
        assert size == pytest.approx(-lost, abs=0.6), seed


def test_what_takes_several_readings_is_told_within_them():
    found = 0
    for seed in range(20):
        at, run = stepper(np.random.default_rng([SEED, 1, seed]), 2.0, 0.1125, over=40)
        rows = told(run)
        assert all(at <= row <= at + 40 for row in rows), seed
        found += len(rows)
    assert found >= 12


@pytest.mark.parametrize(("turns", "step", "lost"), [(2.0, 1.8, 7.2), (1.0, 0.9, -3.6)])
def test_a_check_tells_it_and_a_fit_gives_the_readings_from_there_a_zero(turns, step, lost):
    at, run = stepper(np.random.default_rng([SEED, 2]), turns, step, lost)
    says = f" deg at reading {at + 1} and stays there: steps or counts were lost"
    assert says in ta.check(run).data_faults[0].says
    (note,) = [note for note in ta.fit(run, orders=[1, 2]).notes if "jumps" in note]
    assert note.endswith(
        f"{says}; give the readings from there another run label, or measure again."[-90:]
    )
    fit = ta.fit(run)
    assert fit.notes[0].endswith(f"{says}; the readings from there have a separate zero.")
    assert fit.orders == ta.select_orders(run).orders == (1, 50)
    assert fit.amplitudes == pytest.approx([0.4, 0.1], abs=0.02)
    assert ta.report(run).content["gain"] is not None


@pytest.mark.parametrize("lost", [0.1, -0.5, 2.0])
def test_a_loss_below_the_step_of_the_angle_is_told_by_what_a_whole_turn_comes_back_to(lost):
    """26 of 60 fits had the orders: smaller losses than the step were a pattern or drift."""
    for seed in range(6):
        rng = np.random.default_rng([SEED, 4, seed])
        x, amplitude = np.linspace(0.0, 360.0, (120, 400)[seed % 2], endpoint=False), 0.04
        runs = []
        count = 1 + seed % 3
        at = int(rng.integers(x.size // 5, 4 * x.size // 5))
        for which in range(count):
            error = amplitude * np.cos(np.radians(x[:, None] * [1.0, 2.0]) + np.r_[1.0, 2.0]).sum(
                axis=1
            )
            error += rng.normal(0.0, 0.001, x.size)
            error[at:] += lost * (which == count - 1)
            runs.append(ta.CalibrationRun(x, x + error, 360.0))
        fit = ta.fit(runs)
        assert f"at reading {at + 1} and stays there" in fit.notes[0], seed
        assert fit.orders == (1, 2), seed
        assert fit.amplitudes == pytest.approx([amplitude, amplitude], abs=0.003), seed


def sound(rng):
    """A run without any fault: patterns, motions, gaps, counts and play drawn at random."""
    n, turns = int(rng.choice([36, 200, 1000, 4000])), rng.choice([0.2, 0.9, 1.0, 2.0, 5.3])
    u = np.linspace(0.0, 1.0, n, endpoint=bool(rng.integers(2)))
    motion = rng.integers(6)
    if motion == 0:
        u = np.sort(rng.uniform(0.0, 1.0, n))
    elif motion == 1:
        u = 1.0 - np.abs(2.0 * u - 1.0)
    elif motion == 2:
        u = 0.5 - 0.5 * np.cos(2.0 * np.pi * u * rng.integers(1, 6))
    elif motion == 3:  # gaps
        u = u[~np.isin(np.arange(n) // (1 + n // 20), rng.integers(0, 20, 3))]
    elif motion == 4:  # rests
        u = np.repeat(u, rng.integers(1, 6, n))
    x = rng.uniform(0.0, 360.0) + 360.0 * u * turns * rng.choice([-1.0, 1.0])
    error = rng.uniform(0.0, 1.0) * u + 10.0 ** rng.uniform(-3.0, 0.0) * np.sign(np.gradient(x))
    for _ in range(rng.integers(1, 5)):  # below the steepness that can be corrected
        order = rng.choice([*range(1, 13), 50, 100, 202])
        size = np.degrees(rng.uniform(0.0, 0.22) / order)
        error += size * np.sin(np.radians(order * x) + rng.uniform(0.0, 7.0))
    noise = 10.0 ** rng.uniform(-4.0, -1.0)
    error += noise * (rng.standard_t(3.0, x.size) if rng.integers(2) else rng.normal(size=x.size))
    y = x + error
    if rng.integers(2):  # a sensor that begins anew below its top
        y = 360.0 * np.floor(y / 360.0) + 1.5 + 358.5 * (y % 360.0) / 360.0
    if rng.integers(2):
        count = 360.0 / 2.0 ** rng.integers(9, 18)
        y = np.floor(y / count) * count
    if rng.integers(3) == 0:
        x = np.round(x, 1)
    x, y = (x % 360.0, y % 360.0) if rng.integers(2) else (x, y)
    return ta.CalibrationRun(x, y, 360.0, label="sound")


def test_no_sound_run_jumps():
    print("seed", SEED)
    for seed in range(200):
        assert told(sound(np.random.default_rng([SEED, 3, seed]))) == [], seed


def test_tables_and_logs_that_were_measured_do_not_jump(data_dir):
    for name in (
        "stepper_encoder_units",
        "rm44_repeat",
        "resolver_stepper",
        "servo_loop_simulated",
    ):
        found = ta.check(data_dir / f"{name}.csv").data_faults
        assert "missed_counts" not in [fault.fault for fault in found], name


def test_an_edge_of_the_pattern_that_comes_each_turn_is_no_loss():
    x = np.arange(0.0, 360.0 * 4.0, 0.7)
    edge = 3.0 * (((x - 100.0) % 360.0) / 360.0 - 0.5)
    run = ta.CalibrationRun(
        x, x + edge + np.random.default_rng(SEED).normal(0.0, 0.01, x.size), 360.0
    )
    assert told(run) == []
