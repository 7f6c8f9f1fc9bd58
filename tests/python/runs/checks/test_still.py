"""Ordinary motion has no fault; readings that really stand still or wrap are told."""

import numpy as np
import pytest

import trueangle as ta

#: Faults that ordinary motion was taken for.
MOTION = {"saturated_travel", "wrapped_reference", "stale_samples"}

SEEDS = range(640, 652)


def followed(command, readings, share=0.08):
    """A joint that comes nearer to its command by a share per reading, after a few readings."""
    joint = np.empty_like(command)
    place = command[0]
    delayed = np.concatenate([np.full(readings, command[0]), command])[: command.size]
    for i, wanted in enumerate(delayed):
        place += share * (wanted - place)
        joint[i] = place
    return joint


def measured(joint, rng, noise=1e-3, size=0.4):
    error = size * np.sin(np.radians(joint) + rng.uniform(0, 6))
    return joint + error + rng.normal(0.0, noise, joint.size) + rng.uniform(-50, 50)


def trapezoid(rng):
    stops = np.repeat(rng.uniform(-140, 140, 6), 2)
    command = np.interp(np.linspace(0, 11, 1600), np.arange(12.0), stops)
    return command, measured(followed(command, 4), rng)


def integer_sweep(rng):
    up = np.arange(0.0, rng.integers(60, 200))
    rest = int(rng.integers(3, 9))
    command = np.concatenate([up, np.full(rest, up[-1]), up[::-1], np.full(rest, 0.0)])
    command = np.tile(command, 2)
    return command, measured(followed(command, 2, 0.5), rng)


def servo_steps(rng):
    size = rng.choice([43.95, 21.7, 90.0])
    level = np.arange(900) // 45
    command = size * (level % 2 if rng.integers(2) else np.abs(level % 8 - 4))
    return command, measured(followed(command, 1, 0.25), rng)


def at_rest(rng):
    wander = np.cumsum(rng.normal(0.0, 2e-3, 1500))
    command = np.full(1500, 77.0) + 20.0 * (np.arange(1500) > 1200)
    return command, measured(followed(command, 1) + wander, rng)


def counted(rng):
    joint = 60.0 * np.sin(np.linspace(0.0, 9.0, 3000)) + np.cumsum(rng.normal(0, 1e-3, 3000))
    count = 360.0 / 4096.0
    return joint, np.round(measured(joint, rng) / count) * count


def jogs(rng):
    moves = []
    place = 0.0
    for _ in range(14):
        goal = place + rng.uniform(-40, 40)
        moves += [np.linspace(place, goal, rng.integers(8, 60)), np.full(rng.integers(1, 70), goal)]
        place = goal
    command = np.concatenate(moves)
    return np.round(command, 2), measured(followed(command, 3, 0.2), rng)


@pytest.mark.parametrize("seed", SEEDS)
@pytest.mark.parametrize("motion", [trapezoid, integer_sweep, servo_steps, at_rest, counted, jogs])
@pytest.mark.parametrize("swapped", [False, True])
def test_ordinary_motion_has_no_fault(motion, seed, swapped):
    print("seed", seed)
    reference, indicated = motion(np.random.default_rng(seed))
    pair = (indicated, reference) if swapped else (reference, indicated)
    time = np.arange(reference.size) * 0.02 if seed % 2 else None
    found = ta.check(ta.CalibrationRun(*pair, period=360.0, time=time))
    assert not MOTION & {fault.fault for fault in found.data_faults}


def swept(rng, form):
    share = np.linspace(0.0, 1.0, int(rng.integers(300, 1500)))
    path = {
        "up": 700.0 * share,
        "there and back": 240.0 * (1.0 - np.abs(2.0 * share - 1.0)),
        "to and fro": 100.0 * np.sin(9.0 * share + rng.uniform(0, 6)),
    }[form]
    theta = path + rng.uniform(-90, 90)
    return theta, measured(theta, rng)


@pytest.mark.parametrize("form", ["up", "there and back", "to and fro"])
@pytest.mark.parametrize("column", [0, 1])
@pytest.mark.parametrize("fault", ["saturated_travel", "stale_samples", "frozen"])
def test_faults_are_told_wherever_they_are(fault, column, form):
    told = 0
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        pair = list(swept(rng, form))
        values = pair[column].copy()
        if fault == "saturated_travel":
            values = np.minimum(values, values.max() - rng.uniform(0.1, 0.3) * np.ptp(values))
        elif fault == "stale_samples":
            length = int(rng.integers(1, 6))
            for k in range(20 + int(rng.integers(9)), values.size - 20, values.size // 9):
                values[k : k + length] = values[k - 1]
        else:
            k = int(rng.uniform(0.2, 0.7) * values.size)
            values[k : k + values.size // 9] = values[k - 1]
        pair[column] = values
        found = ta.check(ta.CalibrationRun(*pair, period=360.0))
        named = "stale_samples" if fault == "frozen" else fault
        told += named in {f.fault for f in found.data_faults}
    # A fault whose beginning and end lie at turning points of the motion may pass for a rest.
    assert told >= len(SEEDS) - 2


@pytest.mark.parametrize("range_deg", [45.0, 100.0, 180.0, 250.0])
def test_a_reference_that_wraps_is_told_at_any_range(range_deg):
    for seed in SEEDS:
        rng = np.random.default_rng(seed)
        theta, indicated = swept(rng, "up")
        theta = (theta + rng.uniform(0, 90)) % range_deg
        found = ta.check(ta.CalibrationRun(theta, indicated, period=360.0))
        assert "wrapped_reference" in {f.fault for f in found.data_faults}, seed


@pytest.mark.parametrize("per_count", [4, 8, 15])
def test_counts_of_unlike_sizes_are_no_fault(per_count):
    """A disc whose lines stand up to 30 % off: each count is read as often as it is wide."""
    for seed in range(3):
        rng = np.random.default_rng(seed)
        theta = np.linspace(0.0, 340.0, 6000)
        lines = np.cumsum(1.0 + 0.3 * rng.uniform(-1.0, 1.0, theta.size // per_count))
        lines *= 345.0 / lines[-1]
        read = lines[np.maximum(np.searchsorted(lines, theta, side="right") - 1, 0)]
        found = ta.check(ta.CalibrationRun(theta, read, 360.0))
        assert [fault.fault for fault in found.data_faults] == [], seed
