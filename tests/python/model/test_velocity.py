"""Velocity of samples in the order they were taken, against a loop over them."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from trueangle.model.corrector import _Velocity

SEED = 40_771
PERIOD = 360.0


def by_loop(angle: list[float], time: list[float], last: float) -> list[float]:
    """Backward differences; of samples before which no time has passed, the velocity before.

    Before any velocity that of the first later sample holds, and 0 where there is none.
    """
    found = [math.nan] * len(angle)
    known = [i for i in range(len(angle)) if math.isfinite(angle[i]) and math.isfinite(time[i])]
    for before, i in itertools.pairwise(known):
        if time[i] > time[before]:
            step = math.remainder(angle[i] - angle[before], PERIOD)
            last = step / (time[i] - time[before])
        found[i] = last
    if known:
        found[known[0]] = math.nan
        later = [found[i] for i in known if math.isfinite(found[i])]
        for i in known:
            if not math.isfinite(found[i]):
                found[i] = later[0] if later else 0.0
    return found


def samples(seed: int, count: int = 60) -> tuple[np.ndarray, np.ndarray]:
    """Samples through many turns, some at equal times, some not finite."""
    print("seed", seed)
    rng = np.random.default_rng(seed)
    angle = np.cumsum(rng.uniform(-170.0, 175.0, count)) % PERIOD
    time = np.cumsum(rng.integers(0, 3, count) * 0.25)
    angle[rng.integers(0, count, 4)] = np.nan
    time[rng.integers(0, count, 4)] = np.nan
    return angle, time


@pytest.mark.parametrize("seed", range(SEED, SEED + 8))
def test_velocity_is_that_of_the_loop(seed: int) -> None:
    angle, time = samples(seed)
    wanted = by_loop(angle.tolist(), time.tolist(), math.nan)
    np.testing.assert_allclose(_Velocity(PERIOD)(angle, time), wanted, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize("seed", range(SEED, SEED + 8))
def test_batches_of_any_size_give_what_all_give_at_once(seed: int) -> None:
    """From the first velocity on, also by a state that was kept."""
    angle, time = samples(seed)
    whole = _Velocity(PERIOD)(angle, time)
    rng = np.random.default_rng(seed)
    ends = [0, 12, *sorted(rng.integers(12, len(angle), 6).tolist()), len(angle)]
    parts, state = [], (math.nan, math.nan, math.nan)
    for start, stop in itertools.pairwise(ends):
        velocity = _Velocity(PERIOD)
        velocity.state = state
        parts.append(velocity(angle[start:stop], time[start:stop]))
        state = velocity.state
    np.testing.assert_allclose(np.concatenate(parts), whole, rtol=1e-12)
    known = np.flatnonzero(np.isfinite(angle + time))
    assert state == (angle[known[-1]], time[known[-1]], whole[known[-1]])


def test_samples_before_which_no_time_has_passed_stand_still_until_one_moves() -> None:
    velocity = _Velocity(PERIOD)
    assert velocity([1.0, 2.0], [3.0, 3.0]).tolist() == [0.0, 0.0]
    assert velocity(4.0, 3.5) == 4.0
    assert velocity([4.0, 9.0], [3.5, 3.5]).tolist() == [4.0, 4.0]
    velocity.reset()
    assert velocity([1.0, 2.0, 4.0], [3.0, 3.0, 4.0]).tolist() == [2.0, 2.0, 2.0]
