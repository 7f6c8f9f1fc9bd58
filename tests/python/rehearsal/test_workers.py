"""Trials one after the other share the time that all of them have; side by side none is lost."""

from __future__ import annotations

import contextlib
import io
import os
import pickle
import sys
import threading
from pathlib import Path
from typing import ClassVar

import pytest

import trueangle
from trueangle.rehearsal import worker, workers
from trueangle.rehearsal.trial import ENDED, TrialOutcome
from trueangle.simulation import Simulation
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


# -- one after the other ---------------------------------------------------------------


def test_trials_in_this_process_are_asked_in_order_and_ended_ones_are_no_answers(monkeypatch):
    """With the simulation, the signals and the seed; an interruption of one is one of all."""
    asked, stops = [], iter([False, True, False])

    def trial(*given):
        asked.append(given)
        current_deadline().stopped = next(stops)
        return TrialOutcome(ENDED if given[2] == "a" else "named")

    monkeypatch.setattr(workers, "run_trial", trial)
    local = workers.LocalTrials("sim", "signals", 7)
    assert local.count == 1
    for name in "abc":
        local.add(name)
    with under_deadline(Deadline()) as at:
        assert list(local.answers()) == [("b", TrialOutcome("named"))]
        assert at.stopped
        assert list(local.answers()) == []
    assert asked == [("sim", "signals", name, 7) for name in "ab"]
    with under_deadline(Deadline(1.0, clock=lambda: 0.0)) as at:
        assert list(local.answers()) == [("c", TrialOutcome("named"))]
    assert [given[2] for given in asked] == ["a", "b", "c"]
    local.close()


def test_a_time_that_ran_out_meanwhile_is_a_short_one(monkeypatch):
    times = iter([0.0, 1.0, 9.0, 9.0])
    found = []
    monkeypatch.setattr(
        workers, "run_trial", lambda *_: found.append(current_deadline().within) or Named()
    )
    local = workers.LocalTrials(None, None, 7)
    local.add(0)
    local.add(1)
    with under_deadline(Deadline(2.0, clock=lambda: next(times))):
        assert [trial for trial, _ in local.answers()] == [0]
    assert found == [1e-3]


class Named:
    verdict = "named"


# -- side by side ----------------------------------------------------------------------


class Process:
    """Echoes what it is sent, in memory: the simulation first, then trials."""

    made: ClassVar[list[Process]] = []

    def __init__(self):
        self.killed, self.waited = False, 0
        from_us, self.stdin = os.pipe()
        to_read, to_us = os.pipe()
        self.stdin = os.fdopen(self.stdin, "wb")
        self.stdout = os.fdopen(to_read, "rb")
        self.source, self.target = os.fdopen(from_us, "rb"), os.fdopen(to_us, "wb")
        self.got = []
        self.dies = False
        Process.made.append(self)
        threading.Thread(target=self.serve, daemon=True).start()

    def serve(self):
        with contextlib.suppress(EOFError, OSError, ValueError):
            self.got.append(pickle.load(self.source))
            while True:
                trial = pickle.load(self.source)
                if self.dies:
                    break
                self.got.append(trial)
                pickle.dump(("answer", trial), self.target)
                self.target.flush()
        self.source.close()
        with contextlib.suppress(OSError):
            self.target.close()

    def kill(self):
        self.killed = True

    def wait(self):
        self.waited += 1
        return -9


@pytest.fixture
def echoing(monkeypatch):
    Process.made.clear()
    monkeypatch.setattr(workers, "_started", Process)
    return Process.made


def test_every_trial_is_answered_once_and_every_process_ended(echoing):
    sim = Simulation(sigma_arcsec=2.0)
    side = workers.Workers(sim, 41, 3)
    assert side.count == len(side.processes) == len(echoing) == 3
    for k in range(7):
        side.add(k)
    found = dict(side.answers())
    assert found == {k: ("answer", k) for k in range(7)}
    assert list(side.answers()) == []
    side.add(7)
    assert list(side.answers()) == [(7, ("answer", 7))]
    side.close()
    assert all(process.killed and process.waited for process in echoing)
    # One that is slow to begin may find that the others have done it all.
    assert all(process.got[:1] in ([], [(sim, 41)]) for process in echoing)
    assert sorted(k for process in echoing for k in process.got[1:]) == list(range(8))


def test_answers_end_when_time_is_up(echoing):
    side = workers.Workers(Simulation(), 0, 1)
    side.add(0)
    with under_deadline(Deadline()) as at:
        at.stopped = True
        assert list(side.answers()) == []
    side.close()


def test_a_process_that_ends_is_told_with_its_status(echoing):
    side = workers.Workers(Simulation(), 0, 1)
    echoing[0].dies = True
    side.add(0)
    with pytest.raises(workers.WorkerError, match=r"has ended \(status -9\): is there memory"):
        list(side.answers())
    side.close()


def test_a_simulation_that_cannot_be_given_says_why():
    with pytest.raises(workers.WorkerError, match=r"process \(.*pickle.*\); use `workers=1`"):
        workers.Workers(lambda: 0, 0, 2)


def test_a_process_is_of_this_package_with_one_thread_in_a_group_of_its_own(monkeypatch):
    given = {}
    monkeypatch.setattr(workers.subprocess, "Popen", lambda *a, **k: given.update(k, words=a[0]))
    monkeypatch.setenv("OMP_NUM_THREADS", "7")
    monkeypatch.setenv("KEPT", "yes")
    monkeypatch.setattr(sys, "path", ["", "/somewhere", str(Path(workers.__file__).parents[2])])
    workers._started()
    assert given["words"] == [sys.executable, "-m", "trueangle.rehearsal.worker"]
    package = Path(trueangle.__file__).resolve().parents[1]
    assert given["env"]["PYTHONPATH"].split(os.pathsep) == [str(package), "/somewhere"]
    assert given["env"]["KEPT"] == "yes"
    threads = {"OMP", "OPENBLAS", "MKL", "VECLIB", "BLIS"}
    ones = {name for name, value in given["env"].items() if value == "1"}
    assert {
        f"{name}_{'MAXIMUM' if name == 'VECLIB' else 'NUM'}_THREADS" for name in threads
    } <= ones
    assert given["start_new_session"] if sys.platform != "win32" else given["creationflags"]
    assert given["stdin"] == given["stdout"] == workers.subprocess.PIPE


def test_cores_are_those_that_may_be_used(monkeypatch):
    monkeypatch.setattr(os, "sched_getaffinity", lambda pid: {3, 5, 8}, raising=False)
    monkeypatch.setattr(os, "cpu_count", lambda: 16)
    assert workers.usable_cores() == 3
    monkeypatch.delattr(os, "sched_getaffinity")
    assert workers.usable_cores() == 16
    monkeypatch.setattr(os, "cpu_count", lambda: None)
    assert workers.usable_cores() == 1


def test_a_worker_answers_every_trial_and_hands_failures_on(monkeypatch):
    """In order, with the seed and the signals; each is sent at once."""

    def trial(sim, signals, trial, seed):
        if trial == "bad":
            raise ZeroDivisionError("planted")
        return sim, signals, trial, seed

    monkeypatch.setattr(worker, "run_trial", trial)
    monkeypatch.setattr(worker, "measured_signals", lambda sim: f"signals of {sim}")
    source = io.BytesIO(b"".join(map(pickle.dumps, (("sim", 5), "one", "bad", "two"))))
    sent = []

    class Target(io.BytesIO):
        def flush(self):
            sent.append(self.tell())

    target = Target()
    worker.serve_trials(source, target)
    assert len(set(sent)) == 3
    target.seek(0)
    one, bad, two = (pickle.load(target) for _ in range(3))
    assert one == ("sim", "signals of sim", "one", 5)
    assert two == ("sim", "signals of sim", "two", 5)
    assert isinstance(bad, ZeroDivisionError)
    assert str(bad) == "planted"
