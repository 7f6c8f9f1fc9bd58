"""Figures of an account by what they are said to be."""

from __future__ import annotations

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from trueangle.diagnosis import judgedbeliefs
from trueangle.diagnosis.beliefs import Belief
from trueangle.diagnosis.candidates import candidates_above
from trueangle.diagnosis.correction import _ranges
from trueangle.diagnosis.diagnose import _noise, _overall, _structure
from trueangle.diagnosis.discrepancy import unfolded_error
from trueangle.diagnosis.finding import Finding
from trueangle.diagnosis.findings import findings_of
from trueangle.diagnosis.formerrors import SIZES, form_error_columns, with_form_errors
from trueangle.diagnosis.gain import _exchanged, _level
from trueangle.diagnosis.gearedlines import PLAIN, GearedLines
from trueangle.diagnosis.gearratio import find_ratio
from trueangle.diagnosis.holdout import reducible_share
from trueangle.diagnosis.judgedbeliefs import misplaced_beliefs
from trueangle.diagnosis.overlap import finding_overlaps
from trueangle.diagnosis.remainder import share_of_run
from trueangle.diagnosis.rivals import rivals_of
from trueangle.effects import EFFECTS, LocalDefect
from trueangle.effects.ambiguity import Ambiguity
from trueangle.estimation.quantity import quantity
from trueangle.estimation.regression import Regression
from trueangle.joint.signals import join_runs
from trueangle.simulation import Harmonic, Joint, RunDesign, Simulation, simulate

SIGMA = 1.3
RUNS = tuple(
    RunDesign(samples=n, reversals=(0.4,), speed_deg_s=v, start_deg=30.0 * n)
    for n, v in ((90, 5.0), (140, 30.0), (200, 5.0), (70, 30.0))
)
SIM = Simulation(harmonics=(Harmonic("output", 1, 20.0, 30.0),), sigma_arcsec=SIGMA, runs=RUNS)


@pytest.fixture(scope="module")
def signals():
    return join_runs(simulate(SIM, 2))


def regression(signals, error, seed=5):
    noise = SIGMA * np.random.default_rng(seed).standard_normal(len(signals))
    return Regression.of(signals, error + noise, SIM.surroundings, rho=0.0)


# -- figures ---------------------------------------------------------------------------


def test_the_noise_is_what_is_left_over_its_degrees_of_freedom(signals):
    """By lstsq, with columns enough to tell a root of n from that of n - p; outliers count not."""
    wide = np.random.default_rng(6).normal(size=(len(signals), 60))
    start = regression(signals, 0.0)
    full = start.with_terms([start.propose("backlash", {}, wide)])
    design = np.hstack([start.base, wide])
    rest, rank = np.linalg.lstsq(design, start.residual, rcond=None)[1:3]
    assert not full.outlying.any()
    found = SimpleNamespace(found=False, noise=SimpleNamespace(sigma=77.0))
    assert _noise(full, found) == pytest.approx(np.sqrt(rest[0] / (len(signals) - rank)))
    found.found = True
    assert _noise(full, found) == 77.0
    wild = np.zeros(len(signals))
    wild[[3, 300]] = 1e4
    found.found = False
    assert _noise(regression(signals, wild), found) == pytest.approx(SIGMA, rel=0.1)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_what_is_left_before_and_after_is_told_by_three_numbers(sign, signals):
    error = sign * 4.0 * signals.direction
    error[17] += sign * 3.0
    start = regression(signals, error)
    full = start.with_terms([EFFECTS["backlash"].propose(start)])
    told = _overall(start, full)
    for name, one in (("before", start), ("after", full)):
        left = one.residual - one.design @ one.coefficients
        wanted = np.sqrt(np.mean(left**2)), left.max() - left.min(), max(left.max(), -left.min())
        keys = (f"rms_{name}_arcsec", f"peak_to_peak_{name}_arcsec", f"max_abs_{name}_arcsec")
        assert [told[key] for key in keys] == pytest.approx(wanted)


def test_shares_of_structure_are_of_the_variance(signals):
    start = regression(signals, 3.0 * signals.direction)
    found = _structure(start)
    about = signals.direction - signals.direction.mean()
    power = 9.0 * np.mean(about**2)
    assert found["backlash"] == pytest.approx(power / (power + SIGMA**2), abs=0.03)
    assert list(found.values()) == sorted(found.values(), reverse=True)


def test_time_is_in_shares_of_its_own_run(signals):
    found = share_of_run(signals)
    for start, stop in signals.run_bounds():
        clock = signals.clock[start:stop]
        wanted = (clock - clock[0]) / (clock[-1] - clock[0])
        np.testing.assert_allclose(found[start:stop], wanted, atol=1e-12)


def test_columns_that_oppose_each_other_overlap_as_much_as_those_that_do_not(signals):
    rng = np.random.default_rng(9)
    one = rng.normal(size=len(signals))
    for sign in (1.0, -1.0):
        other = sign * one + 0.5 * rng.normal(size=len(signals))
        start = regression(signals, 3.0 * one + 3.0 * other)
        terms = [
            start.propose(c, {}, x[:, None]) for c, x in (("backlash", one), ("latency", other))
        ]
        ((i, j, found),) = finding_overlaps(start.with_terms(terms), [[0], [1]])
        assert (i, j) == (0, 1)
        assert found == pytest.approx(1.0 / np.sqrt(1.25), abs=0.03)


def test_the_interval_of_a_share_is_that_of_95_of_100():
    """Four standard deviations wide, nearly: by leaving out each of 400 runs in turn."""
    rng = np.random.default_rng(61)
    unit = np.repeat(np.arange(400), 20)
    taken = 3.0 * (1.0 + 0.5 * rng.standard_normal(400))[unit]
    before = taken + rng.standard_normal(unit.size)
    after = before - taken * (0.8 + 0.2 * rng.standard_normal(400))[unit]
    share, (low, high) = reducible_share(before, after, unit, 1.0, rng)
    p0, p1 = (np.mean(e.reshape(400, 20) ** 2, axis=1) for e in (before, after))
    rest = [
        (p0.sum() - a - p1.sum() + b) / (p0.sum() - a - 399.0) for a, b in zip(p0, p1, strict=True)
    ]
    std = np.std(rest) * 399.0 / np.sqrt(400.0) * np.sqrt(400.0 / 399.0)
    # Quantiles of a thousand draws: each known to some 5 % of its distance.
    assert (high - low) / (2.0 * 1.96 * std) == pytest.approx(1.0, abs=0.1)
    assert low < share < high


def test_the_share_is_of_what_can_be_taken_off():
    rng = np.random.default_rng(3)
    before = np.array([3.0, -3.0] * 50)
    after = np.array([1.0, -1.0] * 50)
    unit = np.repeat(np.arange(10), 10)
    found, _ = reducible_share(before, after, unit, 1.0, rng)
    assert found == pytest.approx((9.0 - 1.0) / (9.0 - 1.0))
    found, _ = reducible_share(before, after, unit, 5.0, rng)
    assert found == 1.0  # more than the variance, an estimate, calls reducible


def test_exchanged_levels_are_those_of_other_runs(signals):
    values = np.random.default_rng(4).normal(20.0, 5.0, len(signals))
    other = np.array([2, 0, 3, 1])
    found = _exchanged(values, signals.run, other)
    levels = _level(values, signals.run)
    assert _level(found, signals.run) == pytest.approx(levels[other])


def test_ranges_of_signals_are_those_of_all_runs():
    runs = simulate(SIM, 2)
    runs = [replace(run, torque=run.torque + 4.0 - 3.0 * k) for k, run in enumerate(runs)]
    found = {name: (low, high) for name, low, high in _ranges(runs)}
    assert found["torque"] == pytest.approx((-5.0, 4.0))
    assert found["velocity"] == pytest.approx((-30.0, 30.0))
    assert found["temperature"] == pytest.approx((20.0, 20.0))


def test_a_finding_of_several_terms_has_the_evidence_of_all():
    """And what stands in its place explains so much less: by the BIC of either account."""
    runs = tuple(
        replace(run, temperature_C=t) for run, t in zip(RUNS, (20, 35, 28, 42), strict=True)
    )
    signals = join_runs(simulate(replace(SIM, runs=runs), 2))
    effect, around = EFFECTS["thermal_drift"], SIM.surroundings
    shapes = [{"what": "zero"}, {"what": "line", "order": 3.0}]
    columns = [effect.columns(signals, around, shape) for shape in shapes]
    start = regression(signals, columns[0][:, 0] * 0.6 + columns[1][:, 0] * 0.4)
    terms = [
        start.propose(effect.kind, shape, x, 3 + k, 0.5 + k)
        for k, (shape, x) in enumerate(zip(shapes, columns, strict=True))
    ]
    full = start.with_terms(terms)
    rest = SimpleNamespace(found=False, beside_path=0.0)
    (found,), spots, doubtful = findings_of(full, [], False, rest)
    assert (found.cause, spots, doubtful) == ("thermal_drift", [], [])
    assert found.evidence == pytest.approx(
        {
            "bic_gain": sum(t.bic_gain for t in full.terms),
            "deviance": sum(t.deviance for t in full.terms),
            "parameters": 7.0,
            "log_grid": 2.0,
        }
    )
    assert len(found.rivals) == 3
    gaps = [gap for _, gap in found.rivals]
    assert gaps == sorted(gaps)
    for cause, gap in found.rivals:
        instead = start.with_terms([candidates_above(start, cause)])
        assert gap == pytest.approx(instead.bic - full.bic, abs=1e-6)


def test_form_errors_are_the_mean_square_of_bends_given_what_is_left(signals):
    """By the normal equations of bends with a prior of one of the sizes that are tried."""
    soft = 60.0 * signals.presliding(4.0, 1.0)
    start = regression(signals, soft)
    full = start.with_terms([start.propose("backlash", {}, signals.direction[:, None])])
    found = with_form_errors(full).form_errors
    assert found is not None
    columns = full.whiten(form_error_columns(full))
    known = full.q.T @ columns
    rest, moved_by = columns - full.q @ known, full.back @ known
    away = []
    for size in SIZES:
        spread = np.linalg.inv(rest.T @ rest / full.variance + np.eye(rest.shape[1]) / size**2)
        mean = spread @ rest.T @ full.r / full.variance
        wanted = moved_by @ (np.outer(mean, mean) + spread) @ moved_by.T
        away.append(np.abs(found - wanted).max() / np.abs(wanted).max())
    assert min(away) < 1e-5
    # What bends shift is more than noise leaves.
    assert found[-1, -1] > full.covariance(0)[0, 0]


def test_a_rival_that_explains_more_has_a_gap_below_zero(signals):
    start = regression(signals, 3.0 * signals.direction)
    full = start.with_terms([candidates_above(start, "latency")])
    found = dict(rivals_of(full, [0]))
    assert found["backlash"] < -6.0
    instead = candidates_above(start, "backlash")
    assert found["backlash"] == pytest.approx(start.bic - instead.bic_gain - full.bic, abs=1e-6)


def test_a_ratio_is_told_with_what_is_found_there_and_left_at_the_believed_one():
    lines = (Harmonic("motor", 1, 12.0, 10.0), Harmonic("motor", 2, 8.0, 100.0))
    judgedbeliefs = Simulation(Joint(50.0), lines, (), 1.0, RUNS)
    runs = simulate(replace(judgedbeliefs, joint=Joint(53.0)), 7)
    found = find_ratio(GearedLines.of(judgedbeliefs, join_runs(runs), unfolded_error(runs)))
    assert (found.gear_ratio, found.believed) == (53.0, 50.0)
    assert found.found > 0.95
    assert found.left < 0.2
    assert found.simulation.joint.gear_ratio == 53.0


# -- beliefs at another place ----------------------------------------------------------


def test_what_is_at_another_place_is_told_with_its_errors():
    claimed = LocalDefect(110.0, 8.0, 4.0)
    absent = Belief("local_defect", "absent", {"factor": 1.0}, {"factor": 0.0}, {"factor": 0.1})
    finding = Finding(
        "local_defect",
        {"place_deg": quantity(200.0, 0.5), "width_deg": quantity(7.5, 0.25),
         "height_arcsec": quantity(4.25, 0.125), "shaft": quantity("output")},
        {"bic_gain": 90.0}, None, [], [LocalDefect(200.0, 7.5, 4.25)],
    )  # fmt: skip
    (found,), left = misplaced_beliefs([absent], [finding], replace(SIM, effects=(claimed,)))
    assert left == []
    assert found.verdict == "wrong_place"
    assert found.believed == {"place_deg": 110.0, "width_deg": 8.0, "height_arcsec": 4.0}
    assert found.measured == {"place_deg": 200.0, "width_deg": 7.5, "height_arcsec": 4.25}
    assert found.std == {"place_deg": 0.5, "width_deg": 0.25, "height_arcsec": 0.125}


def test_a_line_in_doubt_has_the_evidence_that_is_left_of_its_search(monkeypatch, signals):
    """Deviance less two coefficients and the choice among the believed lines."""
    spot = Ambiguity(("missing_order", "reference_error"), "why", "what")
    monkeypatch.setattr(judgedbeliefs, "ambiguity_of_cause", lambda *_: spot)
    lines = (*SIM.harmonics, Harmonic("output", 2, 5.0, 0.0), Harmonic("output", 3, 5.0, 0.0))
    around = replace(SIM, harmonics=lines).surroundings
    found = Regression.of(signals, np.zeros(len(signals)), around, rho=0.0)
    change, spread, spots = np.array([3.0, -2.0]), np.array([[0.2, 0.1], [0.1, 0.4]]), []
    assert judgedbeliefs._doubt(found, 2.0, change, spread, spots)
    deviance = change @ np.linalg.inv(spread) @ change
    (told,) = spots
    assert told.evidence == pytest.approx(deviance - 2.0 * found.log_n - 2.0 * np.log(3.0))
    assert told.supported


@pytest.mark.parametrize(("beyond", "plain"), [(0.6, True), (0.9, True), (1.1, False)])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_a_plain_ratio_is_meant_where_it_leaves_no_more_than_noise_allows(beyond, plain, sign):
    """A parabola about a ratio a little off 50: at 50 it is higher by a share of what may be."""
    count, off = 400, sign * 2e-4
    bend = beyond * PLAIN / count / off**2
    lines = SimpleNamespace(
        y=np.zeros(count), left=lambda ratio, common: 1.0 + bend * (ratio - 50.0 - off) ** 2
    )
    found = GearedLines.refined(lines, 50.0 + 3e-4 * sign, True, width=1e-2)
    assert found == (50.0 if plain else pytest.approx(50.0 + off, abs=1e-6))
