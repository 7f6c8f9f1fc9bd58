"""A plan of next runs is rehearsed: as many readings as name the true cause."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

import trueangle as ta
from trueangle.joint.signals import join_runs
from trueangle.planning import Limits
from trueangle.planning.evidence import ReadingNoise
from trueangle.planning.scales import DesignScales
from trueangle.planning.worth import WANTED
from trueangle.rehearsal import after
from trueangle.simulation import Harmonic, Latency, RunDesign, Simulation, simulate

SIM = Simulation(
    harmonics=(Harmonic("output", 1, 14.0, 240.0),),
    sigma_arcsec=1.0,
    runs=(RunDesign("a", samples=150, reversals=(0.5,)), RunDesign("b", reversals=(0.5,))),
)
RUNS = simulate(SIM.with_effects([Latency(1e-4)]), 8)


@pytest.fixture(scope="module")
def plan():
    return ta.plan_after(RUNS, SIM, seeds=3, within=None, limits=Limits.of_runs(RUNS))


def test_what_was_rehearsed_is_said(plan):
    first = plan.between[0]
    assert first.causes == ("backlash", "latency")
    assert first.trials == 6
    assert first.chance_named == 1.0
    assert "100 % of the cases (6 simulated)" in " ".join(plan.summary().split())


def test_equal_seeds_give_equal_plans(plan):
    again = ta.plan_after(RUNS, SIM, seeds=3, within=None, limits=Limits.of_runs(RUNS))
    assert again.to_dict() == plan.to_dict()


def test_without_trials_the_chance_is_that_of_the_evidence():
    plain = ta.plan_after(RUNS, SIM, seeds=0)
    assert plain.between[0].trials == 0
    assert plain.between[0].chance_named >= 0.95


def test_the_time_given_is_kept(plan):
    short = ta.plan_after(RUNS, SIM, within=0.05)
    assert short.readings <= 360 * 4
    if any(entry.told and entry.seen for entry in short.between):
        assert any("--within 60s" in note for note in short.notes)


def test_correlated_noise_leaves_less_evidence():
    """Of readings correlated by 0.9 neighbours tell less than as many of white noise."""
    found = ta.diagnose(RUNS, SIM)
    spots = [spot for spot in found.not_identifiable if spot.supported]
    signals, limits = join_runs(RUNS), Limits.of_runs(RUNS)
    out_and_back = RunDesign("next", speed_deg_s=60.0, samples=120, reversals=(0.5,))
    white, red = (
        DesignScales(signals, found.extended, spots, ReadingNoise(1.0, rho), limits)
        for rho in (0.0, 0.9)
    )
    (more,), (less,) = (one.answers([out_and_back], signals) for one in (white, red))
    assert less.bic < more.bic


@pytest.mark.parametrize("rho", [0.0, 0.8])
def test_simulated_readings_have_the_noise_that_was_found(plan, monkeypatch, rho):
    """Deviation and correlation from one to the next, in runs made again and in planned ones."""
    seen = []

    def caught(runs, sim):
        seen.append(list(runs))
        return SimpleNamespace(complete=False)

    monkeypatch.setattr(after, "diagnose", caught)
    trials = after._FurtherTrials(RUNS, SIM, ReadingNoise(3.0, rho), 20, 0)
    for seed in range(20):
        trials.names(plan, plan.hypotheses[0][0], np.random.default_rng([16, seed]))
    assert [len(runs) for runs in seen] == 20 * [len(RUNS) + len(plan.runs)]
    left = []
    for run in (run for runs in seen for run in runs):
        x = 2.0 * np.pi * run.reference / run.period
        known = np.column_stack([np.ones(x.size), np.cos(x), np.sin(x), run.direction])
        error = run.error * (1_296_000.0 / run.period)
        left.append(error - known @ np.linalg.lstsq(known, error, rcond=None)[0])
    power = sum(float(e @ e) for e in left)
    count = sum(e.size for e in left)
    # Of 10 000 readings; four columns a run take a part of them.
    assert np.sqrt(power / count) == pytest.approx(3.0, rel=0.1)
    assert sum(float(e[1:] @ e[:-1]) for e in left) / power == pytest.approx(rho, abs=0.05)


@pytest.mark.parametrize("missed", [0, 1])
@pytest.mark.parametrize("to_the_end", [False, True])
def test_trials_of_every_cause_are_counted(plan, monkeypatch, missed, to_the_end):
    """The cause named least often is told; a failure ends them before all are made."""
    wrong = plan.hypotheses[0][missed].cause
    monkeypatch.setattr(
        after._FurtherTrials, "names", lambda self, plan, one, rng: one.cause != wrong
    )
    trials = after._FurtherTrials(RUNS, SIM, ReadingNoise(1.0), 20, 0)
    found = trials.counted(plan, 0, plan.between[0], to_the_end)
    enough = int((1.0 - WANTED) * 20 + 1e-9) + 1
    assert found.trials == (40 if to_the_end else 20 * missed + enough)
    assert found.chance_named == 0.0


@pytest.mark.parametrize(
    ("trials", "noted"), [((6, 6), False), ((6, 0), True), ((0, 6), True), ((0, 0), True)]
)
def test_a_plan_says_where_something_that_is_seen_was_not_tried(plan, monkeypatch, trials, noted):
    entries = tuple(replace(plan.between[0], seen=True, told=True) for _ in trials)
    monkeypatch.setattr(
        after._FurtherTrials,
        "counted",
        lambda self, plan, k, entry, to_the_end: replace(
            entry, trials=trials[k], chance_named=1.0 if trials[k] else None
        ),
    )
    asked = replace(plan, between=entries, notes=())
    found = SimpleNamespace(runs=RUNS, noise=1.0, correlation=0.0)
    notes = after._rehearsed(asked, found, SIM, 10_000, 3, 0).notes
    assert notes == ((after.UNTRIED,) if noted else ())
