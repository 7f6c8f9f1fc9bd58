"""Trials one after the other share the time that all of them have."""

import pytest

from trueangle.rehearsal import workers
from trueangle.support.deadline import Deadline, current_deadline, under_deadline


@pytest.mark.parametrize("within", [None, 10.0])
def test_each_trial_has_the_time_that_is_left(within, monkeypatch):
    left = []

    class Outcome:
        verdict = "named"

    def trial(sim, signals, trial, seed):
        left.append(current_deadline().within)
        clock[0] += 3.0
        return Outcome()

    clock = [0.0]
    monkeypatch.setattr(workers, "run_trial", trial)
    asked = workers.LocalTrials(None, None, 7)
    for k in range(5):
        asked.add(k)
    with under_deadline(Deadline(within, clock=lambda: clock[0])):
        found = list(asked.answers())
    assert left == ([None] * 5 if within is None else [10.0, 7.0, 4.0, 1.0])
    assert [k for k, _ in found] == list(range(len(left)))
