"""Play that a reference at rest shows: where the direction goes over from one to the other."""

from __future__ import annotations

import numpy as np
import pytest

import trueangle as ta
from trueangle.effects.backlash import _crossing_at_rest, goes_both_ways
from trueangle.joint.signals import Signals, join_runs

#: A move of so many steps of 1 deg (signed), or a rest of so many readings.
Motion = list[tuple[str, int]]


def moved(motions: list[Motion], seconds: float) -> tuple[Signals, np.ndarray]:
    """Signals of runs that move and rest so, and the direction that goes over evenly by time."""
    runs, wanted = [], []
    for k, motion in enumerate(motions):
        ways = [float(np.sign(n)) if what == "move" else 0.0 for what, n in motion]
        sizes = [abs(n) for _, n in motion]
        corners = np.concatenate([[0], np.cumsum(sizes)])
        theta = 50.0 + np.concatenate([[0.0], np.cumsum(np.repeat(ways, sizes))])
        # Uneven in time: what goes by the number of readings is another line.
        time = 3.0 + seconds * np.arange(theta.size) ** 1.5
        crossing = np.zeros(theta.size)
        # Rests after moves: the readings where they meet belong to the move.
        for j in sorted(range(len(ways)), key=lambda j: ways[j] != 0.0):
            before, after = ways[max(j - 1, 0)], ways[min(j + 1, len(ways) - 1)]
            ends = before or after, after or before
            rows = np.arange(corners[j], corners[j + 1] + 1)
            at = time[corners[[j, j + 1]]]
            crossing[rows] = ways[j] or np.interp(time[rows], at, ends)
        runs.append(ta.CalibrationRun(theta, theta, 360.0, time=time, label=f"run {k}"))
        wanted.append(crossing)
    return join_runs(runs), np.concatenate(wanted)


TURNS: list[list[Motion]] = [
    [[("move", 12), ("rest", 7), ("move", -9), ("rest", 4), ("move", 10)]],
    # The direction of one run is none of the next one's, nor of the one before.
    [
        [("move", 12), ("rest", 7), ("move", 5)],
        [("move", -8), ("rest", 5), ("move", 11), ("rest", 3), ("move", -6)],
        [("move", 9), ("move", -9)],
        [("move", 6), ("rest", 2), ("move", -6)],
    ],
    [[("rest", 5), ("move", 10), ("rest", 6), ("move", -10), ("rest", 4)]],
]


@pytest.mark.parametrize("seconds", [0.01, 5.0])
@pytest.mark.parametrize("motions", TURNS)
def test_the_direction_goes_over_evenly_by_time_while_the_reference_rests(
    motions: list[Motion], seconds: float
) -> None:
    signals, wanted = moved(motions, seconds)
    found = _crossing_at_rest(signals)
    turning = np.flatnonzero(np.abs(np.diff(wanted)) > 1.5)  # at once, without a rest
    keep = np.setdiff1d(np.arange(wanted.size), [turning, turning + 1])
    np.testing.assert_allclose(found[keep], wanted[keep], atol=1e-9)
    assert goes_both_ways(signals)


def test_a_joint_that_rests_and_goes_on_crosses_nothing() -> None:
    signals, wanted = moved([[("move", 9), ("rest", 5), ("move", 9)], [("move", 4)]], 0.1)
    np.testing.assert_array_equal(_crossing_at_rest(signals), wanted)
    assert not goes_both_ways(signals)
    still = ta.CalibrationRun(np.full(6, 3.0), np.full(6, 3.0), 360.0)
    assert not _crossing_at_rest(join_runs([still])).any()
    assert not goes_both_ways(join_runs([still]))
