"""Setting outliers aside comes to an end, and says where it was ended."""

import numpy as np
import pytest

import trueangle as ta
from trueangle.fitting import robust
from trueangle.fitting.problem import Problem


def heavy(seed, rows):
    """Errors with tails so heavy that there is always one more outlier."""
    rng = np.random.default_rng(seed)
    angle = np.sort(rng.uniform(0.0, 360.0, rows))
    error = 0.5 * ((angle / 360.0) % 1.0 - 0.5) + 5e-4 * rng.standard_t(1.5, rows)
    return ta.CalibrationRun(angle, angle + error, 360.0)


@pytest.fixture
def solved(monkeypatch):
    """Solutions of least squares so far."""
    count = []
    original = Problem.solve

    def solve(self, *arguments, **options):
        count.append(self.unknowns)
        return original(self, *arguments, **options)

    monkeypatch.setattr(Problem, "solve", solve)
    return count


def test_many_orders_are_solved_a_few_times_only(solved):
    found = ta.fit(heavy(1, 2960), orders=range(1, 181))
    assert found.weighted.wild > 0
    # Huber's rounds, those of setting aside, and what comes before and between.
    assert len(solved) <= 2 * max(robust.FEWEST_STEPS, robust._rounds(found.problem)) + 3
    assert len(solved) < 40


def test_rounds_that_do_not_suffice_are_told(monkeypatch):
    monkeypatch.setattr(robust, "_rounds", lambda problem: 1)
    found = ta.fit(heavy(3, 1500), orders=range(1, 8))
    assert any("after 1 rounds of rejecting them" in note for note in found.notes)


def test_few_orders_settle_as_ever(solved):
    found = ta.fit(heavy(2, 1200), orders=range(1, 8))
    assert robust._rounds(found.problem) == robust.STEPS
    assert not any("rounds of rejecting them" in note for note in found.notes)
