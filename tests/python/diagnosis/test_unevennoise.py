"""What the noise follows: laws that explain it alike are told together, and none is named."""

from __future__ import annotations

import numpy as np
import pytest

import trueangle as ta
from trueangle.diagnosis.account import _uneven
from trueangle.diagnosis.penalty import NEW_CAUSE
from trueangle.diagnosis.unevennoise import uneven_noise
from trueangle.effects.noiselaw import CLIPPED_MEAN, noise_law
from trueangle.estimation.regression import Regression
from trueangle.joint.signals import join_runs
from trueangle.simulation import Joint, RunDesign, Simulation

SEEDS = range(90_311, 90_331)

JITTER, UNEVEN = "timestamp_jitter", "heteroscedastic_noise"


def signals_of(speeds, samples=300):
    """Runs out and back; the speeds are no whole multiples of each other."""
    designs = [
        RunDesign(
            samples=samples,
            speed_deg_s=v,
            turns=1.3,
            start_deg=47.0 * k,
            reversals=(0.55,)[: v > 0],
        )
        for k, v in enumerate(speeds)
    ]
    return join_runs(ta.simulate(Simulation(Joint(), sigma_arcsec=1.0, runs=tuple(designs)), 5))


def deviations(law, signals, ratio):
    """Standard deviation of every reading; at the top speed ``ratio`` of the one at rest."""
    speed = np.abs(signals.velocity)
    share = speed / speed.max()
    if law == JITTER:
        return np.sqrt(1.0 + (ratio**2 - 1.0) * share**2)
    return ratio**share


def told(signals, deviation, seed):
    """Causes that are named, and sets of which one is told."""
    noise = np.random.default_rng(seed).normal(0.0, deviation)
    found = uneven_noise(Regression.of(signals, noise, Simulation().surroundings, rho=0.0))
    named, open_ = [], []
    for item in found:
        equal = [other for other, gap in item.rivals if gap < NEW_CAUSE]
        (open_ if equal else named).append({item.cause, *equal})
    return named, open_


@pytest.mark.parametrize("law", [JITTER, UNEVEN])
@pytest.mark.parametrize("speeds", [(6.3, 58.0) * 4, (4.1, 22.0, 71.0) * 3, (0.0, 23.0, 67.0) * 3])
@pytest.mark.parametrize("ratio", [1.6, 3.1])
def test_noise_of_one_law_is_never_named_after_another(ratio, speeds, law):
    """Strong evidence, odds of 20 to 1, for the wrong one is chance in less than 1 of 20."""
    print(f"seeds {SEEDS}")
    signals = signals_of(speeds)
    deviation = deviations(law, signals, ratio)
    wrong = {JITTER: UNEVEN, UNEVEN: JITTER}[law]
    answers = [told(signals, deviation, seed) for seed in SEEDS]
    assert sum({wrong} in named for named, _ in answers) <= 1
    # And something is seen each time.
    assert all({wrong, law} in open_ or {law} in named for named, open_ in answers)
    if len(set(speeds)) == 2:
        # Two speeds: either law is one number.
        assert all(named == [] for named, _ in answers)


@pytest.mark.parametrize("law", [JITTER, UNEVEN])
def test_many_speeds_tell_which_law_it_is(law):
    print(f"seeds {SEEDS}")
    signals = signals_of((1.0, 6.0, 13.0, 24.0, 41.0, 66.0, 90.0) * 2)
    deviation = deviations(law, signals, 9.0)
    answers = [told(signals, deviation, seed) for seed in SEEDS]
    assert sum(named == [{law}] and not open_ for named, open_ in answers) >= len(SEEDS) - 1


def test_noise_of_stamps_adds_to_what_follows_the_angle():
    """Of both each has its own size: exp(0.9 cos) for the sensor, and the stamps beside it."""
    print(f"seeds {SEEDS}")
    signals = signals_of((1.0, 6.0, 13.0, 24.0, 41.0, 66.0, 90.0) * 2)
    top = 3600.0 * float(np.abs(signals.velocity).max())
    own = np.exp(0.9 * np.cos(signals.theta))
    stamps = (4.0 * signals.velocity * 3600.0 / top) ** 2
    pulls = []
    for seed in SEEDS:
        noise = np.random.default_rng(seed).normal(0.0, np.sqrt(own + stamps))
        found = uneven_noise(Regression.of(signals, noise, Simulation().surroundings, rho=0.0))
        parts = {item.cause: item for item in found}
        assert {*parts} == {JITTER, UNEVEN}, seed
        for cause, name, true in ((JITTER, "sigma_s", 4.0 / top), (UNEVEN, "cosine", 0.9)):
            size = parts[cause].parameters[name]
            pulls.append((size.value - true) / size.std)
        assert parts[JITTER].rivals[0][1] > NEW_CAUSE
    # The deviation of 40 pulls is known to 11 %.
    assert 0.7 < np.std(pulls) < 1.3
    assert abs(np.mean(pulls)) < 0.6


def test_a_law_is_the_most_likely_one():
    """No other growth and no other level is likelier; the square of a normal number has mean 1."""
    rng = np.random.default_rng(90_341)
    speed = rng.uniform(0.0, 1.0, 4000)
    square = rng.normal(0.0, np.sqrt(2.0 + 9.0 * speed**2)) ** 2
    law = noise_law(square, np.ones((4000, 1)), speed)
    assert np.exp(law.coefficients[0]) == pytest.approx(2.0, rel=0.2)
    assert np.exp(law.log_growth) == pytest.approx(9.0, rel=0.2)
    x = square / np.exp(law.log_variance)
    assert np.minimum(x, 9.0).mean() / CLIPPED_MEAN == pytest.approx(1.0, abs=1e-6)
    assert law.log_likelihood > noise_law(square, np.ones((4000, 1))).log_likelihood


@pytest.mark.parametrize("seed", [90_351, 90_353])
def test_the_account_says_by_how_much_they_differ_and_what_each_would_be(seed):
    print(f"seed {seed}")
    runs = tuple(
        RunDesign(samples=250, speed_deg_s=v, turns=1.2, start_deg=61.0 * k, reversals=(0.45,))
        for k, v in enumerate((7.0, 55.0) * 3)
    )
    believed = Simulation(sigma_arcsec=1.0, runs=runs)
    rng = np.random.default_rng(seed)
    measured = [
        ta.CalibrationRun(
            run.reference,
            run.indicated + rng.normal(0.0, 2.4e-5 * v, len(run)),
            period=run.period,
            time=run.time,
            label=run.label,
        )
        for run, v in zip(ta.simulate(believed, seed), (7.0, 55.0) * 3, strict=True)
    ]
    result = ta.diagnose(measured, Simulation())
    assert result.findings == []
    (spot,) = [spot for spot in result.not_identifiable if spot.supported]
    assert {*spot.causes} == {JITTER, UNEVEN}
    assert "BIC" in spot.because
    assert spot.measure == "three speeds, from rest to the fastest"
    sigma = spot.estimates[JITTER]["sigma_s"]
    # Degrees of scatter for each degree per second.
    assert abs(sigma.value - 2.4e-5) < 4.0 * sigma.std
    assert "per_deg_s" in spot.estimates[UNEVEN]
    assert "timestamp jitter" in result.summary().split("Measured minus")[0]
    assert not result.extended.effects


@pytest.mark.parametrize("scale", [1.0, 1e-3])
def test_outliers_are_put_aside_before_it_is_asked_what_the_noise_follows(scale):
    """As though each had been read where the fit is, in any unit; and the noise tells the same."""
    print(f"seed {SEEDS[0]}")
    signals = signals_of((1.0, 6.0, 13.0, 24.0, 41.0, 66.0, 90.0) * 2)
    deviation = deviations(UNEVEN, signals, 3.0)
    clean = scale * np.random.default_rng(SEEDS[0]).normal(0.0, deviation)
    spikes = np.arange(11, len(signals), 17)
    error = clean.copy()
    error[spikes] += 300.0 * scale * (-1.0) ** np.arange(spikes.size)

    def fitted(y):
        return Regression.of(signals, y, Simulation().surroundings, rho=0.0)

    start = fitted(error)
    found = _uneven(start, start)
    # Beside them it is hardly seen.
    assert uneven_noise(start)[0].bic_gain < 0.6 * found[0].bic_gain
    error[spikes] -= start.left[spikes]
    for other in (uneven_noise(fitted(error)), uneven_noise(fitted(clean))):
        assert [item.cause for item in found] == [item.cause for item in other]
        gains = [[item.bic_gain for item in items] for items in (found, other)]
        np.testing.assert_allclose(*gains, rtol=0.1)
