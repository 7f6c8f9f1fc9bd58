"""Numerics of the diagnosis against slow references: dense covariances and least squares."""

from __future__ import annotations

import numpy as np
import pytest

from trueangle._core import Factor
from trueangle.effects.departures import LAG, _late
from trueangle.estimation.blocks import Blocks
from trueangle.estimation.projection import project
from trueangle.estimation.regression import Regression
from trueangle.estimation.whitening import LagCorrelation, RunEffect, Whitener
from trueangle.joint.lattice import UniformGrid, uniform_grid
from trueangle.simulation import Harmonic, Joint, RunDesign, Simulation, join_runs, simulate

#: Relative rounding of double precision sums over a few hundred readings.
ROUNDING = 1e-9

#: Relative rounding of single precision sums over a few hundred readings.
SINGLE = 1e-3

#: Standard errors within which a parabola over trial ratios 1.8 apart finds the best ratio of
#: three runs; the best trial alone is up to 0.16 away, of more runs further.
NEAR_THE_TOP = 0.06

JOINT = Joint(20.0, "circular_spline", "motor")
LINES = (Harmonic("output", 1, 10.0, 30.0), Harmonic("motor", 1, 5.0, 80.0))
RUNS = tuple(
    RunDesign(samples=n, reversals=(0.6,), speed_deg_s=v, start_deg=7.0 * n)
    for n, v in ((61, 5.0), (80, 30.0), (47, 5.0))
)


@pytest.fixture
def space():
    sim = Simulation(JOINT, LINES, sigma_arcsec=1.0, runs=RUNS)
    runs = simulate(sim, 11)
    residual = np.concatenate([run.error for run in runs]) * 3600.0
    signals = join_runs(runs)
    return Regression.of(signals, residual - sim.predict(signals), sim.surroundings)


def dense_covariance(space, rho, effects, weights):
    """Covariance of the readings' noise, block by run, from its definition."""
    v = np.zeros((space.n, space.n))
    for start, stop in space.bounds:
        n = stop - start
        lag = np.abs(np.subtract.outer(np.arange(n), np.arange(n)))
        block = rho**lag / (1.0 - rho**2)
        for effect in effects:
            z = effect.columns[start:stop]
            block = block + effect.ratio * z @ z.T
        scale = 1.0 / np.sqrt(weights[start:stop])
        v[start:stop, start:stop] = block * np.outer(scale, scale)
    return v


def test_whitening_inverts_the_covariance(space):
    rng = np.random.default_rng(1)
    weights = rng.uniform(0.5, 2.0, space.n)
    scale = np.sqrt(weights)[:, None]
    # Run effects are those of the weighted readings, so scale them for the definition.
    columns = rng.standard_normal((space.n, 3))
    effects = [RunEffect(columns, 0.7), RunEffect(np.ones((space.n, 1)), 2.0)]
    whiten = Whitener(space.bounds, 0.4, effects, weights)
    scaled = [RunEffect(scale * effect.columns, effect.ratio) for effect in effects]
    v = dense_covariance(space, 0.4, scaled, weights)
    w = whiten(np.eye(space.n))
    # The map's own run effects are in filtered units: identity of quadratic forms.
    x = rng.standard_normal(space.n)
    assert np.sum(whiten(x) ** 2) == pytest.approx(float(x @ np.linalg.solve(v, x)), rel=ROUNDING)
    assert whiten.log_determinant == pytest.approx(np.linalg.slogdet(v)[1], rel=ROUNDING)
    assert np.abs(w @ x - whiten(x)).max() < ROUNDING


@pytest.fixture(params=["white", "correlated", "weighted", "run effects", "everything"])
def noise(request, space):
    """A noise of each kind: correlation, run effects, weights."""
    rng = np.random.default_rng(7)
    rho = 0.6 if request.param in ("correlated", "everything") else 0.0
    weights = rng.uniform(0.5, 2.0, space.n)
    # Many columns in a run, of which some are alike, and one by itself.
    wide = np.cumsum(rng.standard_normal((space.n, 5)), axis=0)
    effects = [RunEffect(wide @ rng.standard_normal((5, 8)), 30.0), RunEffect(wide[:, :1], 0.4)]
    return {
        "rho": rho,
        "effects": effects if request.param in ("run effects", "everything") else [],
        "weights": weights if request.param in ("weighted", "everything") else None,
    }


def test_products_under_a_noise_need_no_mapped_columns(space, noise):
    rng = np.random.default_rng(3)
    whiten = Whitener(space.bounds, noise["rho"], noise["effects"], noise["weights"])
    x, y = rng.standard_normal((space.n, 6)), rng.standard_normal((space.n, 2))
    seen = whiten.beside(y, y[:, 1].copy(), 1.0, 0.0).seen
    slow = y[:, [0, 1, 1]].T @ whiten(x)
    assert seen @ x == pytest.approx(slow, rel=ROUNDING, abs=ROUNDING)
    blocks = Blocks([x[:, :2], x[:, 2:3], x[:, 3:5], x[:, 5:]])
    for where, products in blocks.groups:
        for k, gram in zip(where, products.under(whiten), strict=True):
            start = (0, 2, 3, 5)[k]
            mapped = whiten(x[:, start : start + products.width])
            assert gram == pytest.approx(mapped.T @ mapped, rel=ROUNDING, abs=ROUNDING)


def test_gains_of_blocks_are_those_of_each(space, noise):
    rng = np.random.default_rng(4)
    columns = [rng.standard_normal((space.n, 1 + k % 2)) for k in range(7)]
    known = project(Factor(Whitener(space.bounds, **noise), space.base), space.target)
    singly = [known.gain(block)[0] for block in columns]
    assert known.block_gains(Blocks(columns)) == pytest.approx(singly, rel=1e-7)


def test_a_factor_is_that_of_the_singular_values(space, noise):
    rng = np.random.default_rng(5)
    sizes = [1e-6, 1.0, 1e6, 1.0, 1.0]
    base = np.column_stack([np.ones(space.n), rng.standard_normal((space.n, 5)) * sizes])
    blocks = [base, base[:, 1:3] + 1e4 * rng.standard_normal((space.n, 2)), base[:, :0]]
    near = base[:, 3:4] + 1e-3 * rng.standard_normal((space.n, 1))  # beyond doubt alike
    y = rng.standard_normal(space.n)
    whiten = Whitener(space.bounds, **noise)
    for many in (1, 2, 3, 4):
        design = np.hstack([*blocks, near][:many])
        factor = Factor(whiten, design)
        whole = whiten(design)
        lengths = np.linalg.norm(whole, axis=0)
        u, s, vt = np.linalg.svd(whole / lengths, full_matrices=False)
        kept = s > 1e-7 * s[0]
        slow = vt[kept].T @ ((u[:, kept].T @ whiten(y)) / s[kept]) / lengths
        assert factor.rank == factor.q.shape[1] == kept.sum() == whole.shape[1] - (many == 4)
        assert factor.q.T @ factor.q == pytest.approx(np.eye(kept.sum()), abs=ROUNDING)
        assert factor.back @ (factor.q.T @ whiten(y)) == pytest.approx(slow, rel=1e-7)
        assert factor.coefficients(y) == pytest.approx(slow, rel=1e-7)
        assert factor.whiten is whiten


def test_gains_are_those_of_least_squares(space):
    rng = np.random.default_rng(2)
    columns = rng.standard_normal((space.n, 4))
    target = space.target
    before = np.sum((target - space.base @ np.linalg.lstsq(space.base, target)[0]) ** 2)

    def after(extra):
        design = np.hstack([space.base, extra])
        return np.sum((target - design @ np.linalg.lstsq(design, target)[0]) ** 2)

    gain, coefficients = space.gain(columns)
    assert gain == pytest.approx(space.n * np.log(before / after(columns)), rel=ROUNDING)
    whole = np.linalg.lstsq(np.hstack([space.base, columns]), target)[0]
    assert coefficients == pytest.approx(whole[-4:], rel=1e-7)
    singles = [space.n * np.log(before / after(columns[:, [k]])) for k in range(4)]
    assert space.gains(columns) == pytest.approx(singles, rel=1e-7)
    lines = space.line_gains()
    for order in (2, 7, 33):
        x = order * space.signals.theta
        pair = np.column_stack([np.cos(x), np.sin(x)])
        slow = space.n * np.log(before / after(pair))
        assert lines[order - 1] == pytest.approx(slow, rel=SINGLE, abs=SINGLE)
    # Known lines cannot gain: they are free already.
    assert lines[0] == lines[19] == 0.0


@pytest.mark.parametrize("seconds", [5.0, 10.0, 14.0, 20.0])
def test_run_effects_have_the_likelihood_of_the_dense_covariance(space, seconds):
    z = np.column_stack([np.ones(space.n), space.signals.clock / seconds])
    ratio, deviance = space.ratio_of(z)

    def minus_two_log_likelihood(ratio):
        v = dense_covariance(space, 0.0, [RunEffect(z, ratio)], np.ones(space.n))
        inverse = np.linalg.inv(v)
        x, y = space.base, space.target
        beta = np.linalg.solve(x.T @ inverse @ x, x.T @ inverse @ y)
        e = y - x @ beta
        return space.n * np.log(e @ inverse @ e / space.n) + np.linalg.slogdet(v)[1]

    none = minus_two_log_likelihood(0.0)
    assert deviance == pytest.approx(none - minus_two_log_likelihood(ratio), abs=1e-6)
    # The ratio is that of the maximum, up to a small part of its standard error.
    away = np.linspace(-0.3, 0.3, 11)
    values = np.array([none - minus_two_log_likelihood(ratio * np.exp(x)) for x in away])
    bend, slope, _ = np.polyfit(away, values, 2)
    assert bend < 0.0
    standard_error = 1.0 / np.sqrt(-bend)
    assert abs(slope / (2.0 * bend)) < NEAR_THE_TOP * standard_error
    assert deviance > values.max() - 0.01


def test_scores_beside_further_columns_are_those_with_them_fitted(space):
    rng = np.random.default_rng(8)
    known, others = rng.standard_normal((space.n, 2)), rng.standard_normal((space.n, 4))
    space.line_gains()  # what it keeps for itself must not be kept for the other
    beside = space.jointly_with(known)
    pair = np.hstack([known, others[:, :1]])
    whole = space.gain(pair)[0] - space.gain(known)[0]
    assert beside.gain(others[:, :1])[0] == pytest.approx(whole, rel=1e-7)
    singly = [beside.gain(others[:, [k]])[0] for k in range(4)]
    blocks = Blocks([others[:, [k]] for k in range(4)])
    assert beside.block_gains(blocks) == pytest.approx(singly, rel=1e-7)
    # A run effect of the columns themselves finds nothing left of them.
    space = space.of_target(space.target + 100.0 * known[:, 0])
    effect = space.jointly_with(known).propose_run_effect("drift_within_run", {}, known[:, :1])
    assert space.propose_run_effect("drift_within_run", {}, known[:, :1]).deviance > 0.0
    assert effect.deviance < 10.0


@pytest.mark.parametrize("outliers", [0, 9])
@pytest.mark.parametrize("effect", [False, True])
def test_coefficients_without_some_terms_are_those_of_a_fit_of_the_others(space, effect, outliers):
    rng = np.random.default_rng(12)
    wild = np.zeros(space.n)
    wild[rng.integers(space.n, size=outliers)] -= 40.0
    space = Regression.of_readings(space.readings.less(wild), 0.3)
    terms = [
        space.propose("missing_order", {"order": m}, np.cos(m * space.signals.theta)[:, None])
        for m in (3.0, 3.1, 7.0)
    ]
    if effect:
        terms.append(space.propose_run_effect("zero_slip", {}, np.ones((space.n, 1))))
    full = space.with_terms(terms)
    for group in ([0], [2], [0, 2], [0, 1, 2]):
        rest = full.with_terms(t for k, t in enumerate(full.terms) if k not in group)
        found = full.coefficients_without(group)
        held = np.concatenate([full.place(k) for k in group])
        size = np.abs(full.coefficients).max()
        assert np.delete(found, held) == pytest.approx(rest.coefficients, abs=ROUNDING * size)
        assert found[held] == pytest.approx(0.0, abs=ROUNDING * size)
    assert full.outlying.any() == (outliers > 0)


@pytest.mark.parametrize("width", [2, 20])
def test_squares_saved_at_every_ratio_are_those_of_a_ridge(space, width):
    """Few columns go by their eigensystem, many by systems of the size of what is fitted."""
    rng = np.random.default_rng(6)
    z = np.cumsum(rng.standard_normal((space.n, width)), axis=0)
    # Residual and columns of one run are ridged alike: saved is r'Z (I/t + Z'MZ)^-1 Z'r.
    own = np.zeros((space.n, width * len(space.bounds)))
    for k, (start, stop) in enumerate(space.bounds):
        own[start:stop, k * width : (k + 1) * width] = z[start:stop]
    left = own @ rng.standard_normal(own.shape[1])
    beside, left = (x - space.q @ (space.q.T @ x) for x in (own, left))
    squares = 2.0 * float(left @ left)
    ratio, deviance = Whitener(space.bounds).beside(space.q, left, squares, 0.0).ratio(z)
    assert ratio > 0.0
    moment = own.T @ left
    saved = moment @ np.linalg.solve(np.eye(own.shape[1]) / ratio + beside.T @ own, moment)
    paid = np.linalg.slogdet(np.eye(own.shape[1]) + ratio * own.T @ own)[1]
    expected = -space.n * np.log1p(-saved / squares) - paid
    assert deviance == pytest.approx(expected, rel=1e-7)


@pytest.mark.parametrize("seed", [1, 2, 3])
def test_correlation_is_estimated_and_white_noise_is_white(seed):
    rng = np.random.default_rng(seed)
    bounds = [(400 * k, 400 * k + 400) for k in range(20)]
    clock = np.tile(np.arange(400.0), 20)
    white = rng.standard_normal(8000)
    correlation = LagCorrelation(clock, bounds)
    assert correlation(white) == 0.0
    noise = np.zeros(8000)
    for k in range(1, 8000):
        noise[k] = 0.5 * noise[k - 1] + white[k]
    # Standard error sqrt((1 - rho^2)/n) = 0.01, and the bias of the wander's removal.
    assert correlation(noise) == pytest.approx(0.5, abs=0.06)


def test_grids_are_seen_and_orders_fold_as_the_paper_counts():
    theta = np.radians(np.tile(np.arange(0.0, 361.0, 10.0), 3) + 2.5)
    grid = uniform_grid(theta)
    assert grid == UniformGrid(36)
    folds = {100: 8, 101: 7, 200: 16, 201: 15, 202: 14, 300: 12, 400: 4}
    assert {m: grid.folded(m) for m in folds} == folds
    assert grid.aliases(14, 3) == [22, 50, 58]
    assert uniform_grid(theta + np.radians(np.random.default_rng(0).random(theta.size))) is None


def test_what_lags_is_the_recursion_reading_by_reading(space):
    values = np.cumsum(np.random.default_rng(11).standard_normal(space.n))
    late = _late(space.signals, values)
    for start, stop in space.bounds:
        keep = np.exp(-1.0 / (LAG * (stop - start)))
        state = values[start]
        for k in range(start, stop):
            state = values[k] + (state - values[k]) * keep
            assert late[k] == pytest.approx(state, rel=ROUNDING, abs=ROUNDING)
