"""Bends of causes, the evidence beside them and the errors widened by them: by definition."""

from __future__ import annotations

import numpy as np
import pytest

from trueangle.diagnosis import formerrors
from trueangle.diagnosis.formerrors import (
    FORM,
    SHOWN,
    SIZES,
    SLIGHT,
    beside_form_errors,
    form_error_columns,
    share_beside_form_errors,
    told_from_form_errors,
    with_form_errors,
)
from trueangle.effects import EFFECTS
from trueangle.estimation.regression import Regression
from trueangle.joint.signals import Signals, join_runs
from trueangle.simulation import Simulation

from .test_formerrors import loaded_runs

Array = np.ndarray

SIGMA = 3.0

LOAD, PLAY = EFFECTS["torsional_compliance"], EFFECTS["backlash"]


@pytest.fixture(scope="module")
def signals() -> Signals:
    return join_runs(loaded_runs(np.random.default_rng(51), readings=60))


def fitted_to(signals: Signals, error: Array, *effects: type) -> Regression:
    start = Regression.of(signals, error, Simulation(sigma_arcsec=1.0).surroundings, rho=0.0)
    return start.with_terms([effect.propose(start) for effect in effects], 0.0)


def noise(signals: Signals, seed: int) -> Array:
    return SIGMA * np.random.default_rng(seed).standard_normal(len(signals))


def loaded(signals: Signals, play: float = 9.0, seed: int = 52) -> Array:
    return -8.0 * signals.torque + play * signals.direction + noise(signals, seed)


def test_bends_have_a_share_of_the_energy_of_their_cause(signals: Signals) -> None:
    both = fitted_to(signals, loaded(signals), LOAD, PLAY)
    columns = form_error_columns(both)
    parts = []
    for effect, (term, coefficients) in zip((LOAD, PLAY), both.fitted(), strict=True):
        size = np.std(term.columns @ coefficients)
        found = effect.bends(signals, [(term, coefficients)])
        found = found[:, np.std(found, axis=0) > 1e-9 * size]
        parts.append(np.sqrt(FORM) * size * found / np.std(found, axis=0))
        alone = form_error_columns(both, {LOAD.kind, PLAY.kind} - {effect.kind})
        np.testing.assert_allclose(alone, parts[-1], atol=1e-12)
    np.testing.assert_allclose(columns, np.hstack(parts), atol=1e-12)
    assert form_error_columns(both, {LOAD.kind, PLAY.kind}).shape == (len(signals), 0)


@pytest.mark.parametrize(("share", "shown"), [(0.99, False), (1.01, True)])
def test_bends_of_a_cause_count_where_the_noise_does_not_hide_them(
    signals: Signals, share: float, shown: bool
) -> None:
    """Their size against a hundredth of the noise, from both sides."""
    start = fitted_to(signals, noise(signals, 53))
    term = LOAD.propose(fitted_to(signals, loaded(signals)))
    empty = start.with_terms([term], 0.0)
    own = float(empty.coefficients[-1])
    wanted = share * SLIGHT / np.sqrt(FORM) * np.sqrt(empty.variance) / signals.torque.std()
    error = noise(signals, 53) + (wanted - own) * term.columns[:, 0]
    fitted = fitted_to(signals, error).with_terms([term], 0.0)
    assert fitted.coefficients[-1] == pytest.approx(wanted)
    assert (form_error_columns(fitted).shape[1] > 0) == shown


def test_evidence_is_told_beside_the_bends_of_the_other_causes(signals: Signals) -> None:
    curved = signals.torque * np.abs(signals.torque)
    found = fitted_to(signals, loaded(signals, play=0.0) + 0.1 * curved, LOAD)
    extension = found.propose(PLAY.kind, {}, curved[:, None])
    beside = beside_form_errors(found)
    columns = form_error_columns(found)
    np.testing.assert_allclose(beside.r, found.jointly_with(columns, 1.0).r, atol=1e-12)
    share = share_beside_form_errors(found, beside, [extension])
    assert 0.0 < share < 1.0
    assert told_from_form_errors(found, extension).deviance == pytest.approx(
        share * extension.deviance
    )
    # A further element of a cause is no bend of it.
    again = LOAD.propose(fitted_to(signals, loaded(signals)))
    assert told_from_form_errors(found, again) is again
    assert beside_form_errors(found, {LOAD.kind}) is found
    assert beside_form_errors(found, {PLAY.kind}) is not found


def test_nothing_is_left_of_what_is_a_bend_itself(signals: Signals) -> None:
    found = fitted_to(signals, loaded(signals), LOAD)
    extension = PLAY.propose(found)
    whole = found.jointly_with(extension.columns)
    assert share_beside_form_errors(found, whole, [extension]) == 0.0
    assert share_beside_form_errors(whole, found, [extension]) == 1.0


def test_an_effect_of_runs_is_told_by_its_own_evidence(signals: Signals) -> None:
    column = np.sin(np.radians(3.0) + 3.0 * signals.theta)[:, None]
    sizes = np.random.default_rng(54).normal(0.0, 9.0, signals.runs)
    found = fitted_to(signals, loaded(signals) + sizes[signals.run] * column[:, 0], LOAD)
    extension = found.propose_run_effect("varying_line", {}, column)
    beside = found.jointly_with(10.0 * column, 1.0)
    share = share_beside_form_errors(found, beside, [extension])
    after = beside.propose_run_effect("varying_line", {}, column).deviance
    assert share == pytest.approx(min(after / extension.deviance, 1.0))
    assert 0.0 < share < 1.0


@pytest.mark.parametrize("size", [0.3, 0.5, 3.0])
def test_errors_hold_the_bends_given_what_is_left(
    signals: Signals, size: float, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Slow: mean and covariance of the bends by the covariance of all readings.

    One of the bends is what is fitted, up to a share, and nothing of it is ever told.
    """
    rng = np.random.default_rng(55)
    design = fitted_to(signals, noise(signals, 56), LOAD).design
    bends = rng.standard_normal((len(signals), 3)) * [1.0, 0.3, 0.3] + design[:, -1:]
    bends = np.column_stack([bends, 4.0 * design[:, -1] - design[:, 0]])
    error = loaded(signals, play=0.0, seed=57) + bends @ (size * np.array([1.0, -1.4, 0.8, 0.0]))
    found = fitted_to(signals, error, LOAD)
    monkeypatch.setattr(formerrors, "form_error_columns", lambda regression: bends)
    apart = np.linalg.pinv(found.design)
    rest = bends - found.design @ (apart @ bends)
    left = error - found.design @ (apart @ error)
    variance = found.variance

    def twice_log_likelihood(kappa: float) -> float:
        covariance = variance * np.eye(left.size) + kappa**2 * rest @ rest.T
        return float(-np.linalg.slogdet(covariance)[1] - left @ np.linalg.solve(covariance, left))

    gains = [twice_log_likelihood(kappa) - twice_log_likelihood(0.0) for kappa in SIZES]
    widened = with_form_errors(found)
    if size == 0.3:
        assert 1.0 < max(gains) < SHOWN
        assert widened is found
        return
    assert max(gains) > SHOWN
    kappa = SIZES[int(np.argmax(gains))]
    covariance = variance * np.eye(left.size) + kappa**2 * rest @ rest.T
    gain = kappa**2 * rest.T @ np.linalg.inv(covariance)
    mean = gain @ left
    second = np.outer(mean, mean) + kappa**2 * (np.eye(4) - gain @ rest)
    wanted = apart @ bends @ second @ (apart @ bends).T
    assert widened.form_errors is not None
    np.testing.assert_allclose(
        widened.form_errors, wanted, atol=1e-6 * np.abs(wanted).max(), rtol=1e-6
    )
