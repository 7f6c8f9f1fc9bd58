"""Fits of readings with terms: against generalised least squares, and each property by itself."""

from __future__ import annotations

import math

import numpy as np
import pytest

from trueangle import CalibrationRun
from trueangle.estimation.extension import Extension, penalty_of_parameter
from trueangle.estimation.lines import LineBasis, plausible_orders
from trueangle.estimation.quantity import Quantity, quantity
from trueangle.estimation.readings import Readings
from trueangle.estimation.regression import Regression
from trueangle.estimation.whitening import RunEffect
from trueangle.joint.joint import Joint
from trueangle.joint.pattern import Harmonic, JointPattern, Pattern
from trueangle.joint.signals import Signals, join_runs

JOINT = Joint(20.0, "flexspline", "motor", 2)
BELIEF = JointPattern(JOINT, Pattern.of([Harmonic("motor", 1, 9.0)], JOINT))


def sweeps(runs: int, size: int = 60) -> Signals:
    angles = [np.linspace(0.0, 300.0, size) + 7.0 * k for k in range(runs)]
    return join_runs([CalibrationRun(a, a, 360.0) for a in angles])


def term(cause: str, columns: np.ndarray, line: float | None = None, **more) -> Extension:
    return Extension(cause, {}, columns, columns.shape[1], line=line, **more)


def waves(signals: Signals, order: float) -> np.ndarray:
    return np.column_stack([np.cos(order * signals.theta), np.sin(order * signals.theta)])


def start(runs: int = 3, weights: np.ndarray | None = None, seed: int = 1, **more) -> Regression:
    signals = sweeps(runs)
    noise = np.random.default_rng(seed).normal(size=len(signals))
    residual = waves(signals, 2.0) @ [5.0, -3.0] + noise
    return Regression.of(signals, residual, BELIEF, weights, **more)


@pytest.mark.parametrize("rho", [0.0, 0.5])
@pytest.mark.parametrize("weighted", [False, True])
def test_terms_are_fitted_by_generalised_least_squares(rho: float, weighted: bool) -> None:
    weights = np.random.default_rng(2).uniform(0.5, 2.0, 180) if weighted else None
    begun = start(weights=weights, rho=rho)
    signals = begun.signals
    two, three = waves(signals, 2.0), waves(signals, 3.0)
    found = begun.with_terms([term("two", two, 2.0), term("three", three, 3.0)])
    x = np.column_stack([np.ones(180), waves(signals, 20.0), two, three])
    m = found.whiten(np.eye(180))
    beta = np.linalg.lstsq(m @ x, m @ begun.residual, rcond=None)[0]
    np.testing.assert_allclose(found.coefficients, beta, atol=1e-9)
    np.testing.assert_allclose(found.design, x, atol=1e-9)
    np.testing.assert_allclose(found.left, begun.residual - x @ beta, atol=1e-9)
    assert found.whiten.rho == rho == found.fixed_rho
    assert [found.place(k).tolist() for k in (0, 1)] == [[3, 4], [5, 6]]
    variance = np.sum((m @ found.left) ** 2) / (180 - 7)
    whole = variance * np.linalg.inv((m @ x).T @ (m @ x))
    np.testing.assert_allclose(found.covariance(1), whole[5:, 5:], rtol=1e-6, atol=1e-12)
    (first, a), (second, b) = found.fitted()
    assert (first.cause, second.cause) == ("two", "three")
    np.testing.assert_array_equal(np.concatenate([a, b]), found.coefficients[3:])
    assert found.has("two")
    assert not found.has("four")
    assert found.start == begun.deviance
    # What others would be with one more or one less.
    further = waves(signals, 5.0)
    gain, c = found.gain(further)
    more = found.with_terms([*found.terms, term("five", further)])
    joined = found.coefficients_with(term("five", further, coefficients=c))
    np.testing.assert_allclose(joined, more.coefficients[:7], atol=1e-9)
    np.testing.assert_allclose(found.deviance - more.deviance, gain, atol=1e-7)
    less = found.with_terms(found.terms[1:])
    without = found.coefficients_without([0])
    np.testing.assert_allclose(without[3:5], 0.0, atol=1e-9)
    np.testing.assert_allclose(without[[0, 1, 2, 5, 6]], less.coefficients, atol=1e-6)
    np.testing.assert_allclose(
        found.root_weights, np.sqrt(np.ones(180) if weights is None else weights)
    )


@pytest.mark.parametrize(
    ("runs", "correlation", "apart"), [(1, 0.0, 0.0), (2, 0.8, 0.0), (3, 0.5, 0.0), (4, 0.0, 1.0)]
)
def test_standard_errors_are_those_of_the_scatter(
    runs: int, correlation: float, apart: float
) -> None:
    """Under noise that the map leaves correlated, and where runs differ."""
    signals, size = sweeps(runs, 150), 150
    columns = waves(signals, 2.0)
    pulls = []
    for seed in range(80):
        rng = np.random.default_rng(seed)
        noise = rng.normal(size=(size, runs))
        for k in range(1, size):
            noise[k] = correlation * noise[k - 1] + math.sqrt(1.0 - correlation**2) * noise[k]
        own = (columns * rng.normal(0.0, apart, (runs, 2))[signals.run]).sum(axis=1)
        begun = Regression.of(signals, noise.T.ravel() + own, BELIEF, rho=0.0)
        found = begun.with_terms([term("two", columns, 2.0)])
        std = np.sqrt(np.diag(found.robust_covariance(0)))
        assert (std >= 0.99 * np.sqrt(np.diag(found.covariance(0)))).all() or not apart
        pulls.append(found.fitted()[0][1] / std)
    # Few runs that differ tell their scatter poorly: 83 % of four are held.
    assert 0.8 < np.mean(np.abs(pulls) < 1.96) < 0.995
    assert 0.7 < np.median(np.abs(pulls)) / 0.6745 < 1.6
    assert found.robust(np.zeros(0, dtype=np.int64)).shape == (0, 0)


def test_outliers_are_clipped_at_four_deviations() -> None:
    signals = sweeps(2, 100)
    noise = np.random.default_rng(4).normal(size=200)
    for size, outlying in ((3.0, False), (30.0, True)):
        residual = np.clip(noise, -2.5, 2.5)
        residual[50] = size * 1.0
        found = Regression.of(signals, residual, BELIEF, rho=0.0)
        assert found.outlying[50] == outlying
        assert np.count_nonzero(found.outlying) == outlying
    spread = 1.4826 * np.median(np.abs(found.left - np.median(found.left)))
    fit = found.residual[50] - found.left[50]
    # Clipped to four robust deviations of the first fit, of which the second differs little.
    assert found.target[50] - fit == pytest.approx(4.0 * spread, rel=0.05)
    np.testing.assert_array_equal(np.delete(found.target, 50), np.delete(residual, 50))
    # Where most read alike, away from the mean, none is outlying.
    assert not Regression.of(signals, np.r_[np.zeros(101), np.ones(99)], BELIEF).outlying.any()


def test_correlation_is_that_of_what_is_left_and_glitches_are_no_correlation() -> None:
    rng = np.random.default_rng(5)
    signals = sweeps(2, 400)
    e = rng.normal(size=800)
    for k in range(1, 800):
        e[k] += 0.5 * e[k - 1]
    assert Regression.of(signals, e, BELIEF).whiten.rho == pytest.approx(0.5, abs=0.08)
    white = rng.normal(size=800)
    assert Regression.of(signals, white, BELIEF).whiten.rho == 0.0
    for at in range(20, 780, 40):
        white[at : at + 3] += 60.0
    assert Regression.of(signals, white, BELIEF).whiten.rho == 0.0


def test_two_run_effects_settle_among_each_other() -> None:
    rng = np.random.default_rng(6)
    signals = sweeps(30, 20)
    ones, ramp = np.ones((600, 1)), np.tile(np.linspace(-1.7, 1.7, 20), 30)[:, None]
    shift = 2.0 * rng.normal(size=30)[signals.run] + ramp[:, 0] * rng.normal(size=30)[signals.run]
    begun = Regression.of(signals, shift + rng.normal(size=600), BELIEF, rho=0.0)
    found = begun.with_terms(
        [
            term(name, np.zeros((600, 0)), run_effect=RunEffect(columns, 0.01))
            for name, columns in (("ones", ones), ("ramp", ramp))
        ]
    )
    ratios = [t.run_effect.ratio for t in found.terms if t.run_effect is not None]
    assert found.variance == pytest.approx(1.0, rel=0.15)
    assert 2.0 < ratios[0] < 8.0
    assert 0.5 < ratios[1] < 2.0
    proposed = begun.propose_run_effect("ones", {}, ones, 1.5)
    assert (proposed.parameters, proposed.log_grid) == (1, 1.5)
    assert proposed.log_n == pytest.approx(math.log(30.0))
    assert proposed.columns.shape == (600, 0)
    assert 2.0 < proposed.run_effect.ratio < 8.0
    assert proposed.deviance > 300.0


def test_the_surroundings_hold_the_lines_of_terms() -> None:
    begun = start(rho=0.0)
    signals = begun.signals
    found = begun.with_terms(
        [term("slope", signals.theta[:, None]), term("two", waves(signals, 2.0), 2.0)]
    )
    pattern = found.around.pattern
    assert pattern.orders.tolist() == [20.0, 2.0]
    np.testing.assert_allclose(pattern.cosine, [BELIEF.pattern.cosine[0], found.coefficients[4]])
    np.testing.assert_allclose(pattern.sine, [BELIEF.pattern.sine[0], found.coefficients[5]])
    assert found.around.joint is JOINT


def test_evidence_is_deviance_less_what_it_costs() -> None:
    one = Extension("a", {}, np.zeros((5, 0)), 3, 2.0, 50.0, 4.0)
    assert one.bic_gain == 50.0 - 3 * 4.0 - 2 * 2.0
    begun = start(rho=0.0)
    found = begun.with_evidence([one, one])
    assert found.bic == pytest.approx(begun.deviance + 2 * (3 * 4.0 + 2 * 2.0))
    # ln of the readings, of 900 to 10 000 as 900; of more 0.09 of them.
    for n, informing in ((1, 2), (2, 2), (500, 500), (900, 900), (5000, 900), (100_000, 9000)):
        assert penalty_of_parameter(n) == pytest.approx(math.log(informing))
    assert begun.log_n == pytest.approx(math.log(180.0))
    for runs in (7, 8):
        readings = start(runs).readings
        expected = 8.0 if runs == 8 else 60.0 * runs
        assert readings.log_runs == pytest.approx(math.log(expected))


def test_readings_taken_and_lessened() -> None:
    weights = np.arange(1.0, 181.0)
    readings = start(weights=weights).readings
    rows = np.arange(180) % 3 == 1
    part = readings.take(rows)
    assert len(part) == 60
    np.testing.assert_array_equal(part.weights, weights[rows])
    np.testing.assert_array_equal(part.residual, readings.residual[rows])
    np.testing.assert_array_equal(part.signals.theta, readings.signals.theta[rows])
    np.testing.assert_array_equal(part.lines.values, readings.lines.values[rows])
    np.testing.assert_allclose(readings.root_weights**2, weights)
    np.testing.assert_allclose(readings.less(np.ones(180)).residual, readings.residual - 1.0)
    assert isinstance(start().readings.take(rows), Readings)
    assert start().readings.take(rows).weights is None
    np.testing.assert_array_equal(readings.base[:, 0], 1.0)
    np.testing.assert_allclose(readings.base[:, 1:], waves(readings.signals, 20.0), atol=1e-9)
    begun = start(rho=0.3)
    assert begun.of_rows(rows).whiten.rho == 0.3
    assert len(begun.of_rows(rows).readings) == 60
    assert begun.weighted(weights).readings.weights is weights


def test_a_line_saves_what_a_fit_with_it_saves() -> None:
    begun = start(rho=0.0)
    gains = begun.line_gains()
    assert int(begun.lines.orders[np.argmax(gains)]) == 2
    for order in (1.0, 2.0, 7.0):
        place = int(np.flatnonzero(begun.lines.orders == order)[0])
        assert gains[place] == pytest.approx(
            begun.gain(waves(begun.signals, order))[0], rel=1e-3, abs=1e-2
        )
    assert gains[np.flatnonzero(begun.lines.orders == 20.0)] == 0.0


def test_a_proposal_is_no_larger_than_the_readings_show() -> None:
    begun = start(rho=0.0)
    columns = waves(begun.signals, 2.0)
    found = begun.propose("two", {"order": 2}, columns, log_grid=3.0, line=2.0)
    gain, coefficients = begun.gain(columns)
    assert (found.deviance, found.parameters, found.log_grid, found.line) == (gain, 2, 3.0, 2.0)
    assert found.log_n == begun.log_n
    np.testing.assert_array_equal(found.coefficients, coefficients)
    assert begun.propose("two", {}, columns, 5, deviance=7.0).deviance == 7.0
    assert begun.propose("two", {}, columns, 5).parameters == 5
    # All but fitted already: only huge opposite sizes show it.
    nearly = waves(begun.signals, 20.0)[:, :1] + 0.02 * columns[:, :1]
    begun = begun.of_target(begun.residual)
    huge = begun.propose("huge", {}, nearly, deviance=7.0)
    large = np.std(nearly @ begun.gain(nearly)[1]) > 3.0 * np.std(begun.residual)
    assert large
    assert huge.deviance == 0.0


def test_a_fit_asked_for_more_evidence_is_the_same_fit() -> None:
    begun = start(rho=0.3)
    other = begun.with_least(5.0)
    assert (other.least, begun.least) == (5.0, 0.0)
    assert other.with_least(5.0) is other
    assert other.beside is begun.beside
    assert other.left is begun.left
    assert other.cache is begun.cache


@pytest.mark.parametrize("drawn", [True, False])
def test_columns_beside_an_extension_are_those_of_the_fit_with_it(drawn: bool) -> None:
    begun = start(rho=0.3)
    signals = begun.signals
    begun = begun.with_terms([term("two", waves(signals, 2.0))])
    effect = RunEffect(np.ones((180, 1)), 2.5) if drawn else None
    columns = waves(signals, 3.0)[:, : 0 if drawn else 2]
    further = term("further", columns, run_effect=effect)
    asked = np.random.default_rng(11).normal(size=(180, 2))
    wanted, _ = begun.with_terms([*begun.terms, further]).projected(asked)
    factor = begun.factor_with(further)
    found = np.column_stack([factor.project(column)[1] for column in asked.T])
    np.testing.assert_allclose(found, wanted, atol=1e-12)


def test_errors_along_a_motion_keep_what_follows_from_it() -> None:
    readings = start().readings
    assert readings.base.shape == (180, 3)
    assert readings.scatter > 0.0
    other = readings.less(np.ones(180))
    assert other.base is readings.base
    np.testing.assert_array_equal(other.residual, readings.residual - 1.0)
    # What follows from the errors does not stay.
    doubled = readings.less(-readings.residual)
    assert doubled.scatter == pytest.approx(2.0 * readings.scatter)


@pytest.mark.parametrize("pruned", [True, False])
def test_coarse_searches_end_where_they_gain_nothing(pruned: bool) -> None:
    begun = start(rho=0.0).with_least(30.0)
    needed = 2 * begun.log_n + 2 * 1.5
    least = (needed - 10.0) / 1.5
    dominated = (needed + 30.0 - 10.0) / 4.0
    away = -1e-6 if pruned else 1e-6
    assert begun.is_pruned(least + away, 2, 1.5) == pruned
    assert begun.is_dominated(dominated + away, 2, 1.5) == pruned
    assert not begun.with_least(0.0).is_dominated(-1e9, 2, 1.5)
    assert begun.is_pruned((2 * begun.log_n - 10.0) / 1.5 + away, 2) == pruned


def test_what_repeats_is_taken_off() -> None:
    one = np.linspace(0.0, 300.0, 300)
    signals = join_runs([CalibrationRun(one, one, 360.0) for _ in range(4)])
    rng = np.random.default_rng(8)
    wave = 3.0 * np.sin(7.0 * signals.theta)
    begun = Regression.of(signals, wave + rng.normal(size=1200), BELIEF, rho=0.0)
    found = begun.without_repeats()
    assert np.std(found.left) < 1.1
    assert np.std(begun.left) > 2.0
    assert found.deviance - begun.deviance == pytest.approx(found.start - begun.start)
    white = Regression.of(signals, rng.normal(size=1200), BELIEF, rho=0.0)
    assert white.without_repeats() is white


@pytest.mark.parametrize(
    ("joint", "whole", "further"),
    [
        (Joint(), 128, []),
        (Joint(30.5, "none", "motor"), 130, [30.5 * k for k in (1, 3, *range(5, 13))]),
        (Joint(300.0, "none", "motor", 9), 1024, [300.0 * k for k in range(4, 49)]),
    ],
)
def test_orders_that_are_searched(joint: Joint, whole: int, further: list[float]) -> None:
    theta = np.linspace(0.0, 3.0, 11)
    basis = LineBasis.of(theta, joint)
    assert basis.orders.tolist() == [*map(float, range(1, whole + 1)), *further]
    np.testing.assert_allclose(
        basis.values[:, 0::2], np.cos(np.outer(theta, basis.orders)), atol=2e-6
    )
    np.testing.assert_allclose(
        basis.values[:, 1::2], np.sin(np.outer(theta, basis.orders)), atol=2e-6
    )
    expected = set(plausible_orders(joint))
    assert basis.plausible.tolist() == [m in expected for m in basis.orders]
    assert basis.products.width == 2


def test_orders_that_physics_expects() -> None:
    low = [float(k) for k in range(1, 25)]
    assert plausible_orders(Joint()) == low
    assert plausible_orders(Joint(100.0, "circular_spline")) == [
        *low, 100.0, 101.0, 200.0, 201.0, 202.0, 300.0, 400.0, 404.0,
    ]  # fmt: skip
    assert plausible_orders(Joint(30.5, "none")) == [*low, 30.5, 61.0, 91.5, 122.0]


def test_a_quantity_is_of_plain_numbers() -> None:
    found = quantity(np.float64(2.5), np.array([1.0, 2.0]))
    assert found == Quantity(2.5, [1.0, 2.0])
    assert type(found.value) is float
    assert quantity(["a", 3, (np.float32(0.5),)]).value == ["a", 3, [0.5]]
    assert found.to_dict() == {"value": 2.5, "std": [1.0, 2.0]}
    assert quantity(True).std is None
