"""Numbers that stand beside the findings, against their definitions and against draws."""

from __future__ import annotations

from types import SimpleNamespace

import numpy as np
import pytest

import trueangle as ta
from trueangle.diagnosis.confirmation import _by_run, _size, is_line_of
from trueangle.diagnosis.delay import error_before_delay, find_delay
from trueangle.diagnosis.diagnose import _noise, _overall, _ratio_finding, _structure
from trueangle.diagnosis.formerrors import share_beside_form_errors
from trueangle.effects import EFFECTS
from trueangle.effects.time_periodic import FREQUENCY_DRIFT
from trueangle.estimation.regression import Regression
from trueangle.joint.pattern import ARCSEC_PER_RAD
from trueangle.joint.signals import Signals, join_runs
from trueangle.simulation import Harmonic, Joint, RunDesign, Simulation, simulate
from trueangle.support.blas import one_blas_thread

SIM = Simulation(
    Joint(),
    (Harmonic("output", 1, 9.0, 20.0), Harmonic("output", 2, 5.0, 70.0)),
    runs=tuple(
        RunDesign(samples=n, reversals=(0.5,), speed_deg_s=v, start_deg=31.0 * n)
        for n, v in ((30, 5.0), (45, 30.0), (25, 5.0))
    ),
)


@pytest.fixture(scope="module")
def signals() -> Signals:
    return join_runs(simulate(SIM, 3))


def fitted_to(signals: Signals, y: np.ndarray, rho: float | None = 0.0) -> Regression:
    return Regression.of(signals, y, SIM.surroundings, rho=rho)


def test_the_noise_has_the_degrees_of_freedom_of_the_fit(signals: Signals) -> None:
    """A hundred readings, six coefficients: the mean variance of 200 draws."""
    rest, found = SimpleNamespace(found=False, noise=SimpleNamespace(sigma=77.0)), []
    for seed in range(200):
        noise = np.random.default_rng([88, seed]).uniform(-1.0, 1.0, len(signals)) * np.sqrt(12.0)
        fitted = fitted_to(signals, noise)
        fitted = fitted.with_terms([EFFECTS["backlash"].propose(fitted)])
        found.append(_noise(fitted, rest))
    # Of a uniform number: kurtosis 1.8, so that a variance scatters by sqrt(0.8 / n).
    assert np.mean(np.square(found)) == pytest.approx(4.0, abs=5.0 * 4.0 * np.sqrt(0.8 / 94 / 200))
    assert _noise(fitted, replace_found(rest)) == 77.0


def replace_found(rest: SimpleNamespace) -> SimpleNamespace:
    return SimpleNamespace(found=True, noise=rest.noise)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_numbers_before_and_after_are_those_of_what_is_left(signals: Signals, sign: float) -> None:
    noise = np.random.default_rng(4).normal(size=len(signals)) - 0.2 * signals.direction
    before = fitted_to(signals, sign * (4.0 * signals.direction + noise))
    after = before.with_terms([EFFECTS["backlash"].propose(before)])
    found = _overall(before, after)
    columns = np.hstack([before.base, signals.direction[:, None]])
    for name, design in (("before", before.base), ("after", columns)):
        left = before.residual - design @ np.linalg.lstsq(design, before.residual, rcond=None)[0]
        wanted = (np.sqrt(np.mean(left**2)), left.max() - left.min(), max(abs(left)))
        told = [found[f"{n}_{name}_arcsec"] for n in ("rms", "peak_to_peak", "max_abs")]
        assert told == pytest.approx(list(wanted), rel=2e-3)
    # Parseval: the share alone and what is left make one.
    share = _structure(before)["backlash"]
    assert share == pytest.approx(
        1.0 - (found["rms_after_arcsec"] / found["rms_before_arcsec"]) ** 2, rel=1e-3
    )
    assert list(_structure(before).values()) == sorted(_structure(before).values(), reverse=True)
    explained = after.fitted()[0][0].columns @ after.fitted()[0][1]
    assert _size(after, [0]) == pytest.approx(float(np.std(explained)))
    # Of two terms that undo each other, together.
    both = after.with_terms([*after.terms, EFFECTS["missing_order"].propose(after)])
    parts = [term.columns @ c for term, c in both.fitted()]
    assert _size(both, [0, 1]) == pytest.approx(float(np.std(parts[0] + parts[1])))
    assert _size(both, [0, 1]) > 1.01 * _size(both, [1])


@pytest.mark.parametrize("rho", [0.0, 0.6])
def test_likelihoods_of_runs_add_up_to_that_of_all(signals: Signals, rho: float) -> None:
    noise = np.random.default_rng(5).normal(size=len(signals))
    without = fitted_to(signals, 2.0 * signals.direction + noise, rho)
    with_it = without.with_terms([EFFECTS["backlash"].propose(without)], rho)
    gained = _by_run(with_it) - _by_run(without)
    assert gained.size == 3
    # Each at its own variance, whose n - p stands for n.
    slow = [-r.n * np.log(r.variance) - float(r.r @ r.r) / r.variance for r in (with_it, without)]
    assert gained.sum() == pytest.approx(slow[0] - slow[1], rel=1e-9)
    assert gained.sum() == pytest.approx(without.deviance - with_it.deviance, rel=0.05)


def test_likelihoods_of_runs_count_how_noise_is_correlated(signals: Signals) -> None:
    """Of dense covariances of each run, white and correlated: what the one has over the other."""
    y = 2.0 * signals.direction + np.random.default_rng(5).normal(size=len(signals))
    fits = [fitted_to(signals, y, rho) for rho in (0.0, 0.6)]
    found = _by_run(fits[1]) - _by_run(fits[0])
    slow = []
    for fitted, rho in zip(fits, (0.0, 0.6), strict=True):
        left = fitted.residual - fitted.base @ fitted.coefficients
        told = []
        for start, stop in signals.run_bounds():
            lag = np.abs(np.subtract.outer(np.arange(stop - start), np.arange(stop - start)))
            spread = fitted.variance * rho**lag / (1.0 - rho**2)
            part = left[start:stop]
            told.append(-part @ np.linalg.solve(spread, part) - np.linalg.slogdet(spread)[1])
        slow.append(told)
    np.testing.assert_allclose(found, np.subtract(slow[1], slow[0]), atol=1e-6)


def test_a_ratio_is_told_with_its_distance_in_standard_errors() -> None:
    ratio = SimpleNamespace(gear_ratio=100.5, std=0.1, believed=100.0, found=0.97, alike=())
    found = _ratio_finding(ratio)
    assert {n: (q.value, q.std) for n, q in found.parameters.items()} == {
        "gear_ratio": (100.5, 0.1),
        "believed_gear_ratio": (100.0, None),
        "share_found": (0.97, None),
    }
    assert found.evidence["bic_gain"] == pytest.approx(25.0)
    ratio.alike = (90.0, 110.5)
    assert _ratio_finding(ratio).parameters["aliases"].value == [90.0, 110.5]


def stale(seed: int, tau: float, sign: float, noise: float = 60.0) -> Signals:
    rng = np.random.default_rng([91, seed])
    time = np.arange(500) / 50.0

    def angle(at):
        return sign * (200.0 - 200.0 * np.cos(2.0 * np.pi * at / 10.0))

    then = angle(time - tau)
    error = 2.0 * np.sin(np.radians(4.0 * then)) + rng.normal(0.0, noise / 3600.0, time.size)
    return ta.CalibrationRun(angle(time), then + error, period=360.0, time=time)


@pytest.mark.parametrize("sign", [-1.0, 1.0])
def test_delays_scatter_as_they_say_about_the_one_that_is_hidden(sign: float) -> None:
    """Pulls of 24 seeds, a joint and its mirror image, late and early.

    One of them (seed 37) has a reading at its turning point that a step puts on the other side.
    """
    pulls = []
    for seed in range(18, 42):
        tau = 0.02 if seed % 2 else -0.02
        run = stale(seed, tau, sign)
        signals = join_runs([run])
        error = (run.indicated - run.reference) * 3600.0
        with one_blas_thread():
            found = find_delay(signals, error, Simulation())
        assert found is not None
        pulls.append((found.seconds - tau) / found.std)
    # Five standard errors of the mean and of the deviation.
    assert abs(np.mean(pulls)) < 5.0 / np.sqrt(24)
    assert np.std(pulls) == pytest.approx(1.0, abs=4.0 / np.sqrt(48))


def test_an_error_at_the_angle_of_before_says_the_same_indication() -> None:
    """Conservation: angle and error together are what the joint said."""
    signals = join_runs([stale(0, 0.02, 1.0)])
    error = np.cos(signals.theta)
    for tau in (0.013, -0.04, 0.0):
        then, moved = error_before_delay(signals, error, tau)
        np.testing.assert_allclose(
            then.theta * ARCSEC_PER_RAD + moved, signals.theta * ARCSEC_PER_RAD + error, atol=1e-6
        )
        inside = (signals.time > 0.1) & (signals.time < 9.8)
        wanted = np.interp(signals.time - tau, signals.time, signals.theta)
        np.testing.assert_allclose(then.theta[inside], wanted[inside], atol=1e-3)


def test_a_line_is_another_s_within_what_that_wanders() -> None:
    term = SimpleNamespace(cause="time_periodic", shape={"frequency_hz": [3.0, 3.1]})
    for frequency, same in ((3.0, True), (3.0 * (1.0 - 0.99 * FREQUENCY_DRIFT), True), (3.1, True),
                            (3.0 * (1.0 - 1.01 * FREQUENCY_DRIFT), False),
                            (3.1 * (1.0 + 0.99 * FREQUENCY_DRIFT), True),
                            (3.1 * (1.0 + 1.01 * FREQUENCY_DRIFT), False)):  # fmt: skip
        assert is_line_of(term, frequency) == same


def test_the_share_beside_bends_is_that_of_what_they_leave(signals: Signals) -> None:
    """A bend that is half of a cause's column takes a known share of its evidence."""
    noise = np.random.default_rng(6).normal(size=len(signals))
    fitted = fitted_to(signals, 1.5 * signals.direction + noise)
    extension = EFFECTS["backlash"].propose(fitted)
    other = np.random.default_rng(7).normal(size=len(signals)) + signals.direction
    beside = fitted.jointly_with(100.0 * other[:, None], 1.0)
    share = share_beside_form_errors(fitted, beside, [extension])
    gains = [one.gain(extension.columns)[0] for one in (fitted, beside)]
    assert share == pytest.approx(gains[1] / gains[0])
    assert 0.0 < share < 0.9
    assert share_beside_form_errors(fitted, fitted, [extension]) == 1.0
    # Never more than it had.
    assert share_beside_form_errors(beside, fitted, [extension]) == 1.0
