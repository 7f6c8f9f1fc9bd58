"""Units and digits of what fits and selections say: from both sides of borders, in any unit."""

import re

import numpy as np
import pytest
from scipy import stats

import trueangle as ta
from trueangle.fitting.orders.select import select_orders
from trueangle.fitting.summary import fit_error_unit

ARCSEC = 1_296_000.0
UNITS = (360.0, 2.0 * np.pi, 1.0, 8192.0)


def run_of(unit, amplitude, noise, count, seed=4):
    """An order of so many arcsec, and noise of exactly this rms about it, zero and order apart."""
    turn = np.arange(count) / count
    x = 2.0 * np.pi * turn
    rest = np.random.default_rng(seed).normal(size=count)
    design = np.column_stack([np.ones(count), np.cos(x), np.sin(x)])
    rest -= design @ np.linalg.lstsq(design, rest, rcond=None)[0]
    rest *= noise / np.sqrt(rest @ rest / (count - 3.0))
    error = (amplitude * np.sin(x + 0.7) + rest) / ARCSEC
    return ta.CalibrationRun(unit * turn, unit * (turn + error), unit)


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("share", [0.0, 0.6])
def test_a_fit_is_in_degrees_from_an_rms_of_a_sine_of_one_on(share, unit):
    """Pattern and residual together: their squares add, as those of the readings do."""
    for whole, name in ((3580.0, "arcsec"), (3620.0, "deg")):
        amplitude = whole * np.sqrt(1.0 - share)
        noise = whole * np.sqrt(share / 2.0) + 1.0
        fit = ta.fit(run_of(unit, amplitude, noise, 200), orders=[1])
        assert fit_error_unit(fit).name == name
        assert f" {name} " in re.search(r"residual +(.*)", fit.summary())[1]


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize(
    ("count", "noise", "text"),
    # Over sqrt(2 n): 0.0913, 0.1118 and 0.0962 of one, so two digits of it.
    [(63, 1.0, "1.000"), (43, 1.0, "1.00"), (57, 1.0, "1.000"), (43, 8.5, "8.50")],
)
def test_a_residual_has_the_digits_that_its_degrees_of_freedom_leave(count, noise, text, unit):
    fit = ta.fit(run_of(unit, 50.0, noise, count), orders=[1], loss="linear", covariance="white")
    assert fit.degrees_of_freedom == count - 3.0
    assert re.search(r"residual +(\S+) arcsec", fit.summary())[1] == text


@pytest.mark.parametrize("unit", UNITS)
@pytest.mark.parametrize("count", [8, 13, 43, 400])
def test_the_factor_that_is_told_is_that_of_the_intervals(count, unit):
    """Two-sided, of the degrees of freedom: in words, in JSON and by scipy."""
    fit = ta.fit(run_of(unit, 50.0, 1.0, count), orders=[1], loss="linear", covariance="white")
    said = re.search(r"95 % are (\S+) times the", fit.summary())[1]
    (row,) = fit.to_dict()["orders"]
    low, high = row["interval_arcsec"]
    times = stats.t.ppf(0.975, count - 3.0)
    assert (high - low) / 2.0 / row["std_arcsec"] == pytest.approx(times, rel=1e-9)
    assert float(said) == pytest.approx(times, rel=5e-3)


@pytest.mark.parametrize("unit", UNITS)
def test_a_selection_tells_its_noise_to_the_digits_that_it_has(unit):
    """Whatever the degrees of freedom: one more digit would be less than its error has two of."""
    seen = set()
    for count in (24, 30, 60, 120, 240, 600):
        found = select_orders(run_of(unit, 50.0, 1.0, count), [1], covariance="white")
        noise = found.noise.standard_deviation * ARCSEC / unit
        std = noise / np.sqrt(2.0 * found.noise.degrees_of_freedom)
        decimals = 1 - int(np.floor(np.log10(float(f"{std:.1e}"))))
        text = re.search(r"noise of one reading +(\S+) arcsec", found.summary())[1]
        assert text == f"{noise:.{decimals}f}"
        # What is wider by 1.41 would have another number of digits somewhere.
        seen.add(decimals - (1 - int(np.floor(np.log10(float(f"{std * 2.0**0.5:.1e}"))))))
    assert seen == {0, 1}


@pytest.mark.parametrize("unit", UNITS)
def test_errors_beside_nuisances_are_wider_by_their_factors(unit):
    """And by the one reading that the slope of a ramp takes from the noise."""
    rng = np.random.default_rng(11)
    t = np.arange(0.0, 30.0, 0.05)
    x = 0.9 * np.sin(0.2 * t) + 0.02 * t
    runs = []
    for number in range(2):
        error = 1e-4 * np.sin(2.0 * np.pi * x) + 2e-5 * x + 1e-6 * rng.normal(size=t.size)
        runs.append(ta.CalibrationRun(unit * x, unit * (x + error + 0.01 * number), unit, time=t))
    fit = ta.fit(runs, orders=[1, 2], nuisance="ramp", covariance="white")
    factors = np.array([1.0, *fit.nuisance.inflation])
    assert factors.max() > 1.05
    np.testing.assert_allclose(fit.covariance, fit.covariance.T, rtol=1e-12, atol=0.0)
    plain = np.asarray(fit.fitted.solution.covariance)
    for matrix in (fit.covariance, plain):
        assert np.linalg.eigvalsh(matrix / np.abs(matrix).max())[0] > 0.0
    ratio = np.sqrt(np.diag(fit.covariance) / np.diag(plain))
    freedom = 2 * t.size - 2 - 4
    factors *= np.sqrt(freedom / (freedom - 1.0))
    np.testing.assert_allclose(ratio[1:], factors[1:], rtol=1e-9)
    # The zero is known beside coefficients that are known less.
    assert 1.0 < ratio[0] < factors.max()
    assert fit.freedom == pytest.approx(np.full(5, freedom - 1.0))
