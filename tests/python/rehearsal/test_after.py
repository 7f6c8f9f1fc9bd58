"""A plan of next runs is rehearsed: as many readings as name the true cause."""

import pytest

import trueangle as ta
from trueangle.joint.signals import join_runs
from trueangle.planning import Limits
from trueangle.planning.evidence import ReadingNoise
from trueangle.planning.scales import Scales
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
    assert "named in 100 % (6 simulated)" in " ".join(plan.summary().split())


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
        Scales(signals, found.extended, spots, ReadingNoise(1.0, rho), limits) for rho in (0.0, 0.9)
    )
    (more,), (less,) = (one.answers([out_and_back], signals) for one in (white, red))
    assert less.bic < more.bic
