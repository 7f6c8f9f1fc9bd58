"""P values of every test of what is unexplained under noise alone: even, or careful where said."""

from __future__ import annotations

import os
from collections import defaultdict

import numpy as np
import pytest

from trueangle.diagnosis.goodness import goodness_of_fit
from trueangle.diagnosis.goodness.evidence import drawn_signs, made_even
from trueangle.diagnosis.goodness.leftover import Leftover

#: Seeds; five hundred at night. Kolmogorov and Smirnov: more than this over the root of them has a
#: chance of 1e-3, to both sides or to one.
SEEDS = 500 if os.environ.get("TRUEANGLE_NIGHTLY") else 60
BOTH, ONE = 1.95, 1.86

#: Tests whose p values are bounds: they fire less often than they say, never more often. Lines in a
#: spectrum whose level is not known, increments of medians, zeros by the larger of two tests.
CAREFUL = {"time periodogram", "place within runs", "steps in time", "zeros of the runs"}

RUNS, READINGS = 12, 200


def noise(seed: int) -> Leftover:
    """Half of the runs there and back twice, half in one direction; two speeds and loads."""
    rng = np.random.default_rng([seed, 8_087])
    columns: dict[str, list[np.ndarray]] = defaultdict(list)
    for j in range(RUNS):
        way = np.sort(rng.uniform(0.0, 800.0, READINGS))
        there = np.interp(way, [0.0, 200.0, 400.0, 600.0, 800.0], [0.0, 200.0, 0.0, 200.0, 0.0])
        turns = j % 2 == 0
        angle = (there if turns else 0.5 * way) + rng.uniform(0.0, 360.0)
        load = 3.0 * (1 + j % 3) * np.sin(np.radians(angle))
        speed = (5.0, 30.0)[j % 4 // 2]
        columns["theta"].append(np.radians(angle))
        columns["direction"].append(np.where(turns & (way // 200.0 % 2 == 1), -1.0, 1.0))
        columns["clock"].append(way / speed)
        columns["speed"].append(np.full(READINGS, speed))
        columns["torque"].append(load)
        columns["sign of the torque"].append(np.sign(load))
        columns["temperature"].append(np.full(READINGS, 20.0 + 15.0 * (j // 3 % 2)))
        columns["time in the run"].append(way / way[-1])
    joined = {name: np.concatenate(parts) for name, parts in columns.items()}
    theta, direction, clock = (joined.pop(name) for name in ("theta", "direction", "clock"))
    run = np.repeat(np.arange(RUNS), READINGS)
    values = rng.normal(size=RUNS * READINGS)
    return Leftover(values, theta, direction, run, clock, True, joined)


@pytest.mark.slow
def test_p_values_of_noise_are_even_in_every_test() -> None:
    p: dict[str, list[float]] = defaultdict(list)
    for seed in range(SEEDS):
        for item in goodness_of_fit(noise(seed), 64.0, 1.0).evidence:
            p[item.test].append(item.p)
    assert set(p) > CAREFUL
    assert len(p) == 20, sorted(p)
    rank = (np.arange(SEEDS) + 1.0) / SEEDS
    wrong = {}
    for test, values in p.items():
        found = np.sort(values)
        assert found.size == SEEDS
        above = float(np.max(rank - found))
        below = float(np.max(found - rank + 1.0 / SEEDS))
        one_sided = test in CAREFUL
        if above > (ONE if one_sided else BOTH) / np.sqrt(SEEDS):
            wrong[test] = above
        elif not one_sided and below > BOTH / np.sqrt(SEEDS):
            wrong[test] = -below
    assert not wrong, wrong


@pytest.mark.parametrize("draws", [1, 4, 32])
def test_the_number_of_trials_is_told_by_signs_drawn(draws: int) -> None:
    """The smallest of m independent p values: even, whatever m is, however few the draws."""
    rng = np.random.default_rng(41)
    for m in (1, 7, 60):
        smallest = rng.uniform(size=(400, 1 + draws, m)).min(axis=2)
        p = np.sort([made_even(row[0], row[1:]) for row in smallest])
        away = float(np.max(np.abs(p - (np.arange(400) + 0.5) / 400)))
        assert away < BOTH / 20.0, (m, away)


def test_few_units_have_no_draws() -> None:
    assert drawn_signs(5).shape == (0, 5)
    signs = drawn_signs(9)
    assert set(np.unique(signs)) == {-1.0, 1.0}
    assert (drawn_signs(9) == signs).all()
