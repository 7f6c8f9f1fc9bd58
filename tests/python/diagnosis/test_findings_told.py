"""What a finding tells is what was fitted: its effects give the fitted columns back."""

from dataclasses import replace

import numpy as np
import pytest

import trueangle as ta
from trueangle.diagnosis import selection
from trueangle.effects import EFFECTS, Quantisation, Sidebands
from trueangle.effects.search import line_parameters
from trueangle.estimation.regression import Regression
from trueangle.estimation.whitening import LagCorrelation
from trueangle.joint.signals import join_runs
from trueangle.simulation import Harmonic, Joint, RunDesign, Simulation

JOINT = Joint(50.0, "circular_spline", "motor")
LINES = (
    Harmonic("output", 1, 14.0, 243.0),
    Harmonic("motor", 2, 10.0, 248.0),
    Harmonic("wave_generator", 2, 33.0, 115.0),
)
LEVELS = [(v, load, t) for v in (5.0, 30.0) for load in (-5.0, 5.0) for t in (20.0, 35.0)]
SIM = Simulation(
    JOINT,
    LINES,
    sigma_arcsec=1.0,
    runs=tuple(
        RunDesign(
            direction=1 if k % 2 else -1,
            speed_deg_s=v,
            samples=160,
            start_deg=37.0 * k,
            turns=1.4,
            reversals=(0.3, 0.6),
            gravity_Nm=load,
            temperature_C=t,
            mount_deg=(0.0, 130.0, 250.0)[k % 3],
        )
        for k, (v, load, t) in enumerate(LEVELS)
    ),
)

#: Of sums of a few columns, relative to the largest value.
ROUNDING = 1e-9


@pytest.fixture(scope="module")
def signals():
    return join_runs(ta.simulate(SIM, 3))


def fitted(signals, error=0.0, seed=4, sigma=1.0):
    noise = sigma * np.random.default_rng(seed).standard_normal(len(signals))
    return Regression.of(signals, noise + error, SIM.surroundings, rho=0.0)


def reported(effect, regression, extension, coefficients):
    """The error of the effects that a finding of these coefficients reports."""
    size = len(coefficients)
    covariance = np.diag(np.arange(1.0, size + 1.0)) + 0.1
    parameters, effects = effect.report(regression, [(extension, coefficients, covariance)])
    rng = np.random.default_rng(0)
    parts = [one.signal(regression.signals, regression.around, rng) for one in effects]
    return parameters, np.sum(parts, axis=0)


#: Causes whose columns are exact, and a shape of each; None: the one proposed.
SHAPES = {
    "missing_order": [{"output_order": 7.0, "alike": []}],
    "sidebands": [
        {"carrier": 100.0, "offset": k, "form": form}
        for k in (1, 2)
        for form in ("AM", "PM", "free")
    ],
    "backlash": [{}],
    "thermal_drift": [{"what": "zero"}, {"what": "pattern"}, {"what": "line", "order": 102.0}],
    "torsional_compliance": [{"what": "zero"}, {"what": "line", "order": 1.0}],
    "load_dependent_gear_error": [
        {"what": "line", "order": 102.0, "kind": kind} for kind in ("signed", "absolute")
    ],
    "stiffening_compliance": [
        {"power": 3, "gravity_deg": None},
        {"knee_Nm": 2.0, "gravity_deg": None},
        {"power": 3, "gravity_deg": 40.0},
    ],
    "reference_error": [{"order": 3.0, "mount_sign": sign} for sign in (1.0, -1.0)],
}


@pytest.mark.parametrize("cause", SHAPES)
def test_effects_give_the_fitted_error_back(cause, signals):
    effect, regression = EFFECTS[cause], fitted(signals)
    rng = np.random.default_rng(9)
    for shape in SHAPES[cause]:
        columns = effect.columns(signals, regression.around, shape)
        coefficients = rng.normal(0.0, 2.0, columns.shape[1])
        extension = regression.propose(cause, shape, columns)
        _, found = reported(effect, regression, extension, coefficients)
        wanted = columns @ coefficients
        np.testing.assert_allclose(found, wanted, atol=ROUNDING * np.abs(wanted).max())


@pytest.mark.parametrize("form", ["AM", "PM", "free"])
def test_sidebands_report_the_lines_that_a_fit_of_them_finds(form, signals):
    """Amplitude and phase of each line, by least squares on the error itself."""
    regression = fitted(signals)
    shape = {"carrier": 100.0, "offset": 2, "form": form}
    columns = Sidebands.columns(signals, regression.around, shape)
    coefficients = np.arange(1.0, columns.shape[1] + 1.0)
    extension = regression.propose("sidebands", shape, columns)
    parameters, _ = reported(Sidebands, regression, extension, coefficients)
    x = signals.theta[:, None] * np.array([98.0, 102.0])
    design = np.hstack([np.cos(x), np.sin(x)])
    found = np.linalg.lstsq(design, columns @ coefficients, rcond=None)[0]
    amplitude = np.hypot(found[:2], found[2:])
    phase = np.degrees(np.arctan2(found[:2], found[2:])) % 360.0
    assert parameters["orders"].value == [98.0, 102.0]
    np.testing.assert_allclose(parameters["amplitudes"].value, amplitude, rtol=ROUNDING)
    np.testing.assert_allclose(parameters["phases_deg"].value, phase, rtol=ROUNDING)


def test_errors_of_a_line_follow_from_the_covariance_of_its_coefficients():
    """By draws: amplitude and phase scatter as told, whatever cosine and sine share."""
    mean, spread = np.array([3.0, -2.0]), np.array([[0.02, 0.012], [0.012, 0.03]])
    draws = np.random.default_rng(3).multivariate_normal(mean, spread, 200_000)
    amplitude, phase, std, turn = line_parameters(mean, spread)
    assert amplitude == pytest.approx(np.hypot(3.0, 2.0))
    assert phase == pytest.approx(np.degrees(np.arctan2(3.0, -2.0)))
    sizes = np.hypot(*draws.T)
    turns = np.degrees(np.arctan2(*draws.T)) - phase
    # First order: right to the square of 4 %, and draws to 0.2 %.
    assert std == pytest.approx(sizes.std(), rel=0.01)
    assert turn == pytest.approx(((turns + 180.0) % 360.0 - 180.0).std(), rel=0.01)


def test_a_spring_under_gravity_has_no_moment_where_the_load_hangs(signals):
    """By its formula: the moment of a load is its torque times the sine of the angle."""
    effect = EFFECTS["stiffening_compliance"](2.0, 0.5, gravity_deg=40.0)
    rng = np.random.default_rng(0)
    moment = signals.torque * np.sin(signals.theta - np.radians(40.0))
    found = effect.signal(signals, SIM.surroundings, rng)
    np.testing.assert_allclose(found, 2.0 * moment + 0.5 * moment**3, atol=1e-9)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_references_error_turns_with_its_mount(sign, signals):
    effect = EFFECTS["reference_error"]((3.0,), (2.0,), (50.0,), sign)
    found = effect.signal(signals, SIM.surroundings, np.random.default_rng(0))
    angle = 3.0 * (signals.theta + sign * signals.mount) + np.radians(50.0)
    np.testing.assert_allclose(found, 2.0 * np.sin(angle), atol=1e-9)
    assert np.unique(signals.mount).size == 3


# -- how much evidence a cause must bring ----------------------------------------------


def gained(signals, size):
    """BIC gain of a backlash of this size, and what is selected."""
    regression = fitted(signals, size * signals.direction, seed=11)
    extension = EFFECTS["backlash"].propose(regression)
    return extension.bic_gain, [term.cause for term in selection.select_causes(regression).terms]


def test_a_new_cause_must_bring_odds_of_twenty_to_one(signals):
    assert pytest.approx(2.0 * np.log(20.0), abs=0.01) == selection.NEW_CAUSE
    low, high = 0.0, 1.0
    for _ in range(30):  # the size whose gain is 3: evidence, but not enough of it
        middle = 0.5 * (low + high)
        regression = fitted(signals, middle * signals.direction, seed=11)
        gain = EFFECTS["backlash"].propose(regression).bic_gain
        low, high = (low, middle) if gain > 3.0 else (middle, high)
    gain, found = gained(signals, low)
    assert gain == pytest.approx(3.0, abs=0.1)
    assert found == []
    gain, found = gained(signals, 3.0 * low)
    assert gain > 9.0
    assert len(found) == 1


def test_the_price_of_an_account_is_that_of_its_parameters_and_causes(signals):
    regression = fitted(signals, 2.0 * signals.direction)
    extension = EFFECTS["backlash"].propose(regression)
    one = regression.with_terms([extension])
    assert one.bic == pytest.approx(one.deviance + extension.log_n, rel=1e-12)
    assert selection.total_penalty(one) == pytest.approx(one.bic + 6.0, rel=1e-12)
    assert selection.total_penalty(regression) == pytest.approx(regression.deviance, rel=1e-12)


def test_the_deviance_is_that_of_the_normal_likelihood(signals):
    """-2 ln of it up to a constant of the readings, by lstsq: n ln(RSS / n)."""
    few = signals.take(np.arange(200))
    noise = np.random.default_rng(12).normal(size=200)
    regression = Regression.of(few, noise, SIM.surroundings, rho=0.0)
    left = float(np.linalg.lstsq(regression.base, noise, rcond=None)[1][0])
    assert not regression.outlying.any()
    assert regression.deviance == pytest.approx(200 * np.log(left / 200), rel=1e-9)
    # What a column saves is the difference of the two fits.
    column = few.direction[:, None]
    saved = regression.gain(column)[0]
    both = np.hstack([regression.base, column])
    less = float(np.linalg.lstsq(both, noise, rcond=None)[1][0])
    assert saved == pytest.approx(200 * np.log(left / less), rel=1e-6)


def test_white_noise_is_called_white_and_correlated_noise_is_not():
    clock, bounds = np.tile(np.arange(300.0), 4), [(300 * k, 300 * (k + 1)) for k in range(4)]
    correlation, rng = LagCorrelation(clock, bounds), np.random.default_rng(13)
    white = [correlation(rng.normal(size=1200)) for _ in range(40)]
    assert white == [0.0] * 40
    noise = rng.normal(size=1200)
    for i in range(1, 1200):
        noise[i] = 0.5 * noise[i - 1] + np.sqrt(0.75) * noise[i]
    assert correlation(noise) == pytest.approx(0.5, abs=0.12)


# -- degrees of freedom ----------------------------------------------------------------


def test_the_variance_is_that_of_the_residual_degrees_of_freedom(signals):
    """Few readings, many columns: by lstsq on the same design."""
    few = signals.take(np.arange(40))
    regression = Regression.of(few, np.random.default_rng(5).normal(size=40), SIM.surroundings)
    columns = np.random.default_rng(6).normal(size=(40, 12))
    one = regression.with_terms([regression.propose("backlash", {}, columns)])
    design = np.hstack([one.base, columns])
    left, rank = np.linalg.lstsq(design, regression.residual, rcond=None)[1:3]
    assert not one.outlying.any()
    assert one.variance == pytest.approx(float(left[0]) / (40 - rank), rel=1e-9)
    inverse = np.linalg.pinv(design.T @ design)[-12:, -12:]
    np.testing.assert_allclose(one.covariance(0), one.variance * inverse, rtol=1e-7)


def test_noise_beyond_the_stated_is_never_nothing():
    runs = [replace(run, reversals=()) for run in SIM.runs]
    truth = replace(SIM, sigma_arcsec=1.5, runs=tuple(runs))
    said = ta.diagnose(ta.simulate(truth, 21), replace(truth, sigma_arcsec=1.0)).summary()
    assert "Nothing beyond" not in said
    assert said.startswith("No pattern beyond the simulation, but the noise differs.")
    assert "(1.000 in the simulation" in said
    same = ta.diagnose(ta.simulate(truth, 22), truth).summary()
    assert same.startswith("Nothing beyond the simulation")


def test_a_lattice_is_found_whatever_the_noise():
    truth = SIM.with_effects([Quantisation(6.0)])
    result = ta.diagnose(ta.simulate(truth, 23), SIM)
    (finding,) = result.findings
    assert (finding.cause, finding.status) == ("quantisation", "confirmed")
    assert finding.parameters["step_arcsec"].value == pytest.approx(6.0)
    # Before the rounding it is the noise that the simulation states; one reading has both.
    assert "where the simulation states" not in result.summary()
    assert result.noise == pytest.approx(np.hypot(1.0, 6.0 / np.sqrt(12.0)), rel=0.05)


@pytest.mark.parametrize("seed", [31, 32, 33])
def test_a_reading_that_no_tail_reaches_is_wild(seed: int) -> None:
    """Student's t of 3 degrees of freedom, whose tails hide a few outliers otherwise."""
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    runs = []
    for k in range(4):
        theta = np.sort(rng.uniform(0.0, 360.0, 300))
        error = rng.standard_t(3.0, theta.size) / 3600.0
        runs.append(ta.CalibrationRun(theta, theta + error, 360.0, label=str(k)))
    heavy = ta.diagnose(runs, Simulation())
    assert "outliers" not in [finding.cause for finding in heavy.findings]
    indicated = runs[2].indicated.copy()
    indicated[117] += 0.1
    runs[2] = replace(runs[2], indicated=indicated)
    (wild,) = [f for f in ta.diagnose(runs, Simulation()).findings if f.cause == "outliers"]
    assert wild.parameters["rows"].value == [["2", 117]]
