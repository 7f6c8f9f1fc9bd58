"""Long work tells how far it is, and ends when its time is up or Ctrl-C is pressed."""

from __future__ import annotations

import itertools
import json
import math
import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import trueangle as ta
from trueangle import write_runs
from trueangle.cli import main
from trueangle.cli.values import seconds
from trueangle.errors import ArgumentError
from trueangle.simulation import Backlash, Harmonic, Latency, RunDesign, Simulation, simulate
from trueangle.support import deadline
from trueangle.support.deadline import (
    Deadline,
    clock_text,
    current_deadline,
    ending_early,
    under_deadline,
    with_deadline,
)

#: Seconds by which a diagnosis may take longer than it was given: what is in hand is ended (one
#: search), and what is left is tested. Generous, as the machine that runs this may be busy.
LATE = 5.0

BELIEVED = Simulation(
    harmonics=(Harmonic("output", 1, 14.0, 240.0),),
    sigma_arcsec=1.0,
    runs=tuple(
        RunDesign(label=f"{speed:g}", samples=200, speed_deg_s=speed, reversals=(0.5,))
        for speed in (5.0, 10.0, 20.0, 30.0)
    ),
)
TRUE = BELIEVED.with_effects([Backlash(6.0), Latency(3e-4)])


class Ticks:
    """A clock that goes on by one second whenever it is looked at."""

    def __init__(self):
        self.count = itertools.count()

    def __call__(self):
        return float(next(self.count))


def test_a_part_ends_before_the_whole():
    now = [0.0]
    work = Deadline(10.0, clock=lambda: now[0])
    now[0] = 6.0
    assert not work.over
    with work.part(0.5):
        work.at("sums", 1, 2)
        assert work.over
    assert not work.over
    assert work.cut == "sums"
    now[0] = 10.0
    assert work.over


def test_work_inside_other_work_has_its_pace():
    with with_deadline(5.0) as outer:
        with with_deadline() as inner:
            assert inner is outer is current_deadline()
        with with_deadline(1.0) as own:
            assert own is not outer
    assert current_deadline().within is None


@pytest.mark.parametrize("within", [0.0, -1.0, float("nan"), float("inf")])
def test_a_time_that_is_none_is_refused(within):
    with pytest.raises(ArgumentError, match="above zero"):
        ta.diagnose(simulate(BELIEVED), BELIEVED, within=within)


def test_an_unknown_way_of_showing_is_refused():
    with pytest.raises(ArgumentError, match="auto, text, json, none"):
        ta.diagnose(simulate(BELIEVED), BELIEVED, progress="loud")


@pytest.mark.parametrize(
    ("text", "value"),
    [("10", 10.0), ("10s", 10.0), ("0.5 min", 30.0), ("250ms", 0.25), ("1h", 3600)],
)
def test_times_of_the_command_line(text, value):
    assert seconds(text) == value


@pytest.mark.parametrize("text", ["", "0", "-3s", "10x", "s", "1.2.3s", "nan", "1e999"])
def test_times_that_are_none_end_with_usage(text, capsys):
    with pytest.raises(SystemExit) as ended:
        main(["diagnose", "r.csv", "--simulation", "s.toml", f"--within={text}"])
    assert ended.value.code == 2
    assert "a time above zero" in capsys.readouterr().err


def test_wherever_it_is_ended_the_account_says_so_and_confirms_nothing_unmeasured():
    """Ended at many moments: each account is whole as an object, and honest."""
    runs = simulate(TRUE, seed=5)
    clock = Ticks()
    with under_deadline(Deadline(1e9, clock=clock)):
        full = ta.diagnose(runs, BELIEVED)
    steps = next(clock.count)
    assert full.complete
    assert full.notes == []
    names = {finding.cause for finding in full.findings if finding.confirmed}
    assert names, "the full account must name something for the others to be held against"
    named = set()
    for within in np.unique(np.geomspace(3, 1.8 * steps, 16).astype(int)):
        with under_deadline(Deadline(float(within), clock=Ticks())):
            result = ta.diagnose(runs, BELIEVED)
        told = result.to_dict()
        assert told["complete"] == result.complete
        if result.complete:
            assert told["notes"] == []
            continue
        assert told["notes"][0].startswith("INCOMPLETE: ")
        over = f"the time given, {within} s, was over"
        assert result.summary().startswith(f"INCOMPLETE: {over} while ")
        assert not result.is_enough
        for finding in result.findings:
            named.add((finding.cause, finding.status))
            assert not finding.confirmed or finding.gain is not None
        assert {effect.kind for effect in result.extended.effects} <= names
    assert {status for _, status in named} == {"confirmed", "not_confirmed"}
    assert result.complete, "the last one had time enough"


def test_a_step_that_was_not_finished_names_nothing():
    """The causes tried first must not win for having been tried."""
    with under_deadline(Deadline(40.0, clock=Ticks())):
        result = ta.diagnose(simulate(TRUE, seed=5), BELIEVED)
    assert "trying causes" in result.notes[0]
    assert result.findings == []


def test_work_without_a_time_given_is_bounded_by_its_readings():
    """By what is done: no clock is looked at."""
    for items, allowed in ((0, 200_000_000), (10_000, 200_000_000), (40_000, 480_000_000)):
        work = Deadline(clock=Ticks())
        with work.bounded(items):
            work.at("rounds", 0, 9)
            work.spend(allowed - 1)
            assert not work.over
            with work.part(0.5):
                assert work.over
            work.spend(1)
            assert work.over
            assert work.cut == "rounds"
            assert "the usual limit of work was reached" in work.why
        assert not work.over
        assert work.cut == "", "what follows is no part of it"


def test_readings_that_are_not_used_bring_no_time(monkeypatch):
    from trueangle.diagnosis import account

    bound = []
    usual = Deadline.bounded
    monkeypatch.setattr(Deadline, "bounded", lambda self, n: bound.append(n) or usual(self, n))
    for many in (account.MOST_READINGS, sum(map(len, simulate(TRUE, seed=5))) - 1):
        monkeypatch.setattr(sys.modules["trueangle.diagnosis.diagnose"], "MOST_READINGS", many)
        ta.diagnose(simulate(TRUE, seed=5), BELIEVED, gain=False)
    assert bound == [sum(map(len, simulate(TRUE, seed=5))), many]


def test_a_time_that_is_given_is_the_only_one():
    work = Deadline(1e3, clock=lambda: 0.0)
    with work.bounded(10):
        work.spend(10**12)
        assert not work.over


@pytest.mark.parametrize("command", [False, True])
def test_a_diagnosis_comes_to_an_end_by_itself_and_says_so(command, files, capsys, monkeypatch):
    """Work that is up after the first causes: what is there is told."""
    monkeypatch.chdir(files)
    monkeypatch.setattr(deadline, "LEAST", 1e5)
    monkeypatch.setattr(deadline, "PER_ITEM", 0.0)
    if command:
        assert main(["diagnose", "r.csv", "--simulation", "believed.toml"]) == 0
        told = capsys.readouterr().out
    else:
        result = ta.diagnose(ta.read_runs("r.csv"), BELIEVED)
        assert not result.complete
        assert not result.is_enough
        told = result.summary()
    assert told.startswith("INCOMPLETE: the ")
    assert "What to do: allow more time (" in told
    assert "Measured minus simulated" in told


def test_a_search_that_was_cut_short_is_not_remembered():
    """What it found so far would stand for its cause when rivals are told."""
    from trueangle.diagnosis.candidates import candidate_extensions
    from trueangle.estimation.regression import Regression
    from trueangle.joint.signals import join_runs

    runs = simulate(TRUE, seed=5)
    signals = join_runs(runs)
    error = 3600.0 * np.concatenate([run.error for run in runs])
    start = Regression.of(signals, error, BELIEVED.surroundings)
    for within in range(4, 40, 3):
        with under_deadline(Deadline(float(within), clock=Ticks())) as at:
            found = candidate_extensions(start, ["local_defect", "backlash"])
            cut = at.over
        if cut:
            assert len(found) < 2
        alone = Regression.of(signals, error, BELIEVED.surroundings)
        for extension, _, gain in candidate_extensions(start, ["local_defect", "backlash"]):
            fresh = [g for e, _, g in candidate_extensions(alone, [extension.cause])]
            assert fresh == [gain]
        start = Regression.of(signals, error, BELIEVED.surroundings)


def test_it_ends_in_the_time_given():
    runs = simulate(TRUE, seed=3)
    before = time.monotonic()
    result = ta.diagnose(runs, BELIEVED, within=0.05)
    assert time.monotonic() - before < 0.05 + LATE
    assert not result.complete


def test_the_same_work_without_a_limit_is_not_changed():
    runs = simulate(TRUE, seed=4)
    assert ta.diagnose(runs, BELIEVED).to_dict() == (
        ta.diagnose(runs, BELIEVED, within=1e6, progress="auto").to_dict()
    )


def test_ctrl_c_asks_first_and_ends_then():
    before = signal.getsignal(signal.SIGINT)
    with ending_early() as interruption:
        with with_deadline(100.0) as work:
            os.kill(os.getpid(), signal.SIGINT)
            assert work.over
            assert interruption.happened
            assert signal.getsignal(signal.SIGINT) is before  # for a second one
        with pytest.raises(KeyboardInterrupt):
            os.kill(os.getpid(), signal.SIGINT)
    with ending_early() as interruption, pytest.raises(KeyboardInterrupt):
        os.kill(os.getpid(), signal.SIGINT)
    assert not interruption.happened
    assert signal.getsignal(signal.SIGINT) is before


def test_who_takes_ctrl_c_meanwhile_keeps_it():
    """As a command does that SIGTERM is ending: the next signal must end it at once."""
    before = signal.getsignal(signal.SIGINT)
    try:
        with ending_early():
            signal.signal(signal.SIGINT, signal.SIG_DFL)
        assert signal.getsignal(signal.SIGINT) is signal.SIG_DFL
    finally:
        signal.signal(signal.SIGINT, before)


def made(folder, samples):
    """Readings of four runs, and what is believed of them."""
    many = BELIEVED.with_effects([])
    dense = Simulation(
        sigma_arcsec=1.0,
        runs=tuple(
            RunDesign(label=str(k), samples=samples, speed_deg_s=5.0 * k, reversals=(0.5,))
            for k in range(1, 5)
        ),
    )
    many.save(folder / "believed.toml")
    write_runs(
        simulate(dense.with_effects([Backlash(6.0), Latency(3e-4)]), seed=1), folder / "r.csv"
    )
    return folder


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    return made(tmp_path_factory.mktemp("pace"), 3000)


def test_ctrl_c_gives_the_account_so_far(tmp_path):
    # As many readings as a diagnosis uses: it must last well beyond the first word at one second.
    files = made(tmp_path, 10_000)
    arguments = ["diagnose", "r.csv", "--simulation", "believed.toml", "--extend", "out.toml"]
    process = subprocess.Popen(
        [sys.executable, "-m", "trueangle", *arguments, "--progress", "json", "--json"],
        cwd=files,
        stdout=subprocess.PIPE,
        stderr=subprocess.PIPE,
        text=True,
    )
    first = json.loads(process.stderr.readline())
    process.send_signal(signal.SIGINT)
    out, err = process.communicate(timeout=60)
    assert first["seconds"] >= 1.0
    assert process.returncode == 130
    told = json.loads(out)
    assert told["complete"] is False
    assert told["notes"][0].startswith("INCOMPLETE: it was interrupted")
    last = err.splitlines()[-1]
    assert last.startswith("trueangle: interrupted: the account so far is incomplete")
    assert "out.toml not written" in last
    assert not (files / "out.toml").exists()


def test_within_of_the_command_line(files, capsys, monkeypatch):
    monkeypatch.chdir(files)
    assert main(["diagnose", "r.csv", "--simulation", "believed.toml", "--within", "200ms"]) == 0
    shown = capsys.readouterr()
    assert shown.out.startswith("INCOMPLETE: the time given, 0.2 s, was over")
    assert shown.err == ""


@pytest.mark.parametrize(
    ("seconds", "said"),
    [(0.2, "1 s"), (59.0, "59 s"), (59.1, "1:00 min"), (60.0, "1:00 min"), (61.0, "1:01 min"),
     (119.0, "1:59 min"), (119.5, "2:00 min"), (3725.0, "62:05 min")],
)  # fmt: skip
def test_what_is_left_is_told_in_minutes_and_seconds(seconds: float, said: str) -> None:
    assert clock_text(seconds) == said
    minutes, _, rest = said.removesuffix(" min").removesuffix(" s").rpartition(":")
    assert 60 * int(minutes or 0) + int(rest) == math.ceil(seconds)
