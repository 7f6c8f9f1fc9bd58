"""What searches keep is of no consequence: without it the same figures, to the last bit."""

import json
from dataclasses import FrozenInstanceError

import numpy as np
import pytest

import trueangle as ta
from trueangle.estimation.cache import Cache
from trueangle.estimation.regression import Regression
from trueangle.joint.signals import join_runs
from trueangle.simulation import (
    Backlash,
    Harmonic,
    Joint,
    RunDesign,
    Simulation,
    ZeroSlip,
    simulate,
)

SEED = 41_903

JOINT = Joint(50.0, "circular_spline", "motor")
LINES = (Harmonic("output", 1, 60.0, 20.0), Harmonic("motor", 2, 25.0, 140.0))
RUNS = tuple(
    RunDesign(samples=180, reversals=(0.5,), speed_deg_s=v, temperature_C=t)
    for v, t in ((10.0, 20.0), (30.0, 24.0), (10.0, 31.0))
)
BELIEVED = Simulation(JOINT, LINES[:1], sigma_arcsec=2.0, runs=RUNS)
TRUE = Simulation(
    JOINT, LINES, sigma_arcsec=2.0, effects=(Backlash(9.0), ZeroSlip(14.0)), runs=RUNS
)


class NothingKept(Cache):
    """Every answer is worked out when it is asked for."""

    def of_motion(self, name, key, build):
        return build()

    def of_fit(self, key, build):
        return build()

    def fit(self, key, build):
        return build()[0]

    def proposed(self, key, least):
        return None

    def for_other_terms(self):
        return self

    def for_other_errors(self):
        return self


@pytest.fixture
def start():
    signals = join_runs(simulate(TRUE, SEED))
    residual = 3600.0 * np.concatenate([run.error for run in simulate(TRUE, SEED)])
    return Regression.of(signals, residual - BELIEVED.predict(signals), BELIEVED.surroundings)


def test_a_diagnosis_without_what_is_kept_is_the_same(monkeypatch):
    print(f"seed {SEED}")
    runs = simulate(TRUE, SEED)
    warm = json.loads(ta.diagnose(runs, BELIEVED, within=1e6).to_json())
    asked = []
    usual = Regression.of_readings.__func__

    def cold(cls, readings, rho=None, cache=None):
        asked.append(len(readings))
        return usual(cls, readings, rho, NothingKept())

    monkeypatch.setattr(Regression, "of_readings", classmethod(cold))
    assert json.loads(ta.diagnose(runs, BELIEVED, within=1e6).to_json()) == warm
    assert asked, "the readings were fitted by another way"
    assert len(warm["findings"]) > 1


def test_a_regression_is_a_value(start):
    before = start.coefficients.copy(), start.rss, start.terms
    line = start.propose("missing_order", {"order": 3.0}, start.base[:, :1] * 1.0)
    further = start.with_terms([line])
    further.jointly_with(np.ones((start.n, 1)))
    start.with_least(5.0)
    start.without_repeats()
    assert (start.rss, start.terms, start.least) == (before[1], before[2], 0.0)
    np.testing.assert_array_equal(start.coefficients, before[0])
    with pytest.raises(FrozenInstanceError):
        start.rss = 0.0


def test_what_is_kept_is_that_of_the_readings(start):
    """Other errors along the same motion share what follows from the motion, and nothing else."""
    kept = start.cache
    kept.of_motion("m", 1, lambda: "motion")
    kept.of_fit("f", lambda: "fit")
    terms, errors = start.with_terms([]).cache, start.without_repeats().cache
    for other in (terms, errors, start.jointly_with(np.ones((start.n, 1))).cache):
        assert other.of_motion("m", 1, lambda: "new") == "motion"
        assert other is kept or other.of_fit("f", lambda: "new") == "new"
    assert kept.of_motion("m", 2, lambda: "other key") == "other key"
    assert kept.of_fit("f", lambda: "new") == "fit"


def test_fits_asked_for_last_are_kept_and_large_ones_are_not(start, monkeypatch):
    made = []

    def ask(key, size):
        return start.cache.fit(key, lambda: (made.append(key) or key, size))

    monkeypatch.setattr("trueangle.estimation.cache.MOST_KEPT", 10)
    assert [ask(key, 4) for key in "abaca"] == [*"abaca"]
    assert made == [*"abc"]  # room is made by what was asked for longest ago
    assert [ask(key, 4) for key in "cb"] == [*"cb"]
    assert made == [*"abcb"]
    assert ask("d", 11) == ask("d", 11) == "d"
    assert made == [*"abcbdd"]
    # Terms fitted to the same readings again, after the same fit, are the fit that is there.
    line = start.propose("missing_order", {"order": 3.0}, start.base[:, :1] * 1.0)
    monkeypatch.undo()
    assert start.with_terms([line]).q is start.with_terms([line]).q
    assert start.with_terms([line], 0.5).q is not start.with_terms([line]).q


def test_a_proposal_that_was_searched_less_far_is_not_taken(start):
    from trueangle.estimation.cache import CachedProposal

    key = ("backlash", ())
    start.cache.propose(key, CachedProposal(None, 20.0))
    assert start.cache.proposed(key, 20.0) is not None
    assert start.cache.proposed(key, 19.0) is None
