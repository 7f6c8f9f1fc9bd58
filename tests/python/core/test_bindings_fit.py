"""Functions of the core that fit and look at residuals, by themselves, against loops of numpy."""

import numpy as np
import pytest

from trueangle import _core
from trueangle.errors import ArgumentError

TURN = 360.0
SEED = 5
N = 3000
ORDERS = [[1, 3], [2]]
CYCLES = [1.0, 2.5]
#: Cosine and sine of every order, in degrees.
COSINE, SINE = [[0.3, -0.1], [0.05]], [[0.2, 0.04], [-0.07]]
ZERO = 0.7

#: Of sums of some thousand numbers around 1.
ROUNDING = 1e-10


def series(argument="reference", constant=0.0):
    return _core.Series(TURN, constant, CYCLES, ORDERS, COSINE, SINE, argument)


def rows(theta):
    """Rows of the harmonics, as they are defined."""
    columns = []
    for cycles, orders in zip(CYCLES, ORDERS, strict=True):
        for order in orders:
            phase = np.radians(theta) * order * cycles
            columns += [np.cos(phase), np.sin(phase)]
    return np.column_stack(columns)


def made():
    """A run over two and a half turns with noise and weights, some of them none."""
    print(f"seed {SEED}")
    rng = np.random.default_rng(SEED)
    reference = np.sort(rng.uniform(-200.0, 700.0, N))
    values = np.ravel([[c, s] for cs, ss in zip(COSINE, SINE, strict=True)
                       for c, s in zip(cs, ss, strict=True)])  # fmt: skip
    indicated = reference + ZERO + rows(reference) @ values + 0.01 * rng.normal(size=N)
    weights = rng.integers(0, 4, N).astype(float)
    return reference, indicated + TURN * rng.integers(-1, 2, N), weights


RUN = made()


def wrapped(x):
    return (np.asarray(x) + 0.5 * TURN) % TURN - 0.5 * TURN


def left(offset=ZERO):
    """Residuals of the run around the series itself."""
    reference, indicated, _ = RUN
    return wrapped(indicated - reference - offset - series().error(reference))


def squared(triangle):
    """Products of the rows that a triangle stands for."""
    return np.asarray(triangle).T @ np.asarray(triangle)


def products(weights, keep=slice(None)):
    reference, indicated, _ = RUN
    error = wrapped(indicated - reference - ZERO)
    whole = np.column_stack([np.ones(N), rows(reference), error])[keep]
    return whole.T @ (weights[keep, None] * whole)


@pytest.mark.parametrize("threads", [None, 1, 2])
def test_a_triangle_has_the_products_of_all_rows(threads):
    for weights in (None, RUN[2]):
        run = (*RUN[:2], weights)
        found = _core.triangle(run, TURN, CYCLES, ORDERS, "reference", ZERO, threads)
        expected = products(np.ones(N) if weights is None else weights)
        np.testing.assert_allclose(squared(found), expected, rtol=0, atol=ROUNDING * N)


@pytest.mark.parametrize("orders", [ORDERS, [[1, 3], [3]]])
def test_folds_are_the_triangles_of_their_stretches(orders):
    ends = [-10.0, 150.0, 600.0]
    place = np.searchsorted(ends, RUN[0], side="left")
    found = _core.folds(RUN, TURN, CYCLES, orders, "reference", ends, ZERO)
    assert len(found) == 4
    for k, (triangle, weight) in enumerate(found):
        assert weight == RUN[2][place == k].sum()
        if orders is ORDERS:
            expected = products(RUN[2], place == k)
            np.testing.assert_allclose(squared(triangle), expected, rtol=0, atol=ROUNDING * N)


@pytest.mark.parametrize("argument", ["reference", "indicated"])
@pytest.mark.parametrize("method", [None, "plain", "qr", "moments"])
def test_a_fit_is_that_of_numpy(argument, method):
    reference, indicated, weights = RUN
    theta = reference if argument == "reference" else indicated
    whole_orders = [[1, 3], [1]]
    harmonics = rows(theta)[:, :4]
    phase = np.radians(theta) * 2.0
    whole = np.column_stack([np.ones(N), harmonics, np.cos(phase), np.sin(phase)])
    error = wrapped(indicated - reference - ZERO)
    roots = np.sqrt(weights)
    solution, *_ = np.linalg.lstsq(roots[:, None] * whole, roots * error, rcond=None)
    found = _core.fit([RUN], TURN, [1.0, 2.0], whole_orders, argument, method)
    assert found.offsets[0] == pytest.approx(solution[0] + ZERO, abs=ROUNDING)
    assert found.constant == pytest.approx(solution[0] + ZERO, abs=ROUNDING)
    np.testing.assert_allclose(np.concatenate(found.cosine), solution[[1, 3, 5]], atol=ROUNDING)
    np.testing.assert_allclose(np.concatenate(found.sine), solution[[2, 4, 6]], atol=ROUNDING)
    rest = roots * (error - whole @ solution)
    freedom = np.count_nonzero(weights) - 7
    assert (found.rank, found.degrees_of_freedom) == (7, freedom)
    variance = rest @ rest / freedom
    assert found.residual_variance == pytest.approx(variance, rel=1e-8)
    spread = variance * np.linalg.inv((weights[:, None] * whole).T @ whole)
    np.testing.assert_allclose(found.covariance, spread, rtol=1e-7, atol=1e-7 * spread.max())
    assert found.offset_std[0] == pytest.approx(np.sqrt(spread[0, 0]), rel=1e-7)
    condition = np.linalg.cond(whole * roots[:, None])
    assert found.condition_number == pytest.approx(condition, rel=1e-6)
    assert found.is_conditioned_below(1.01 * condition)
    assert not found.is_conditioned_below(0.99 * condition)
    constant = found.series().error(0.0) - sum(map(sum, found.cosine))
    assert constant == pytest.approx(solution[0] + ZERO, abs=ROUNDING)


def test_a_fit_under_a_ridge_is_that_of_numpy():
    reference, indicated, weights = RUN
    whole = np.column_stack([np.ones(N), rows(reference)])
    error = wrapped(indicated - reference - ZERO)
    ridge = np.array([3.0, 3.0, 500.0, 500.0, 0.0, 0.0])
    gram = whole.T @ (weights[:, None] * whole) + np.diag([0.0, *ridge])
    solution = np.linalg.solve(gram, whole.T @ (weights * error))
    plain = _core.fit([RUN], TURN, CYCLES, ORDERS)
    for found in (
        _core.fit([RUN], TURN, CYCLES, ORDERS, ridge=list(ridge)),
        plain.penalised(list(ridge)),
    ):
        np.testing.assert_allclose(np.concatenate(found.cosine), solution[1::2], atol=ROUNDING)
        np.testing.assert_allclose(np.concatenate(found.sine), solution[2::2], atol=ROUNDING)
        assert found.offsets[0] == pytest.approx(solution[0] + ZERO, abs=ROUNDING)


@pytest.mark.parametrize("weights", [None, RUN[2]])
@pytest.mark.parametrize("stride", [1, 7])
@pytest.mark.parametrize("threads", [None, 2])
def test_residuals_looked_at_are_those_of_every_so_many(weights, stride, threads):
    run = (*RUN[:2], weights)
    counting = left() if weights is None else left()[weights > 0.0]
    asked = (series(), run, "reference", ZERO, stride, threads)
    sample, largest = _core.scan_residuals(*asked)
    np.testing.assert_allclose(sample, counting[::stride], rtol=0, atol=1e-12 * TURN)
    assert largest == pytest.approx(np.abs(counting).max(), abs=1e-12 * TURN)
    np.testing.assert_allclose(_core.sample_residuals(*asked), sample, rtol=0, atol=1e-12 * TURN)
    for most in (10, counting.size, 10 * counting.size):
        some = np.sort(np.abs(counting[:: max(counting.size // most, 1)]))
        found = _core.median_magnitude(counting, most)
        assert found == some[some.size // 2]


def test_residuals_are_wrapped_to_half_a_turn():
    fitted = series().error(RUN[0])
    _core.residuals(RUN[1], RUN[0], ZERO, TURN, fitted)
    np.testing.assert_allclose(fitted, left(), rtol=0, atol=1e-12 * TURN)
    assert np.abs(fitted).max() < 0.1


def test_a_resultant_is_the_mean_vector():
    expected = abs(np.exp(1j * np.radians(RUN[1] - RUN[0])).mean())
    assert _core.resultant(RUN[1], RUN[0], TURN) == pytest.approx(expected, rel=1e-12)
    far = np.arange(8.0) * 45.0
    assert _core.resultant(far, np.zeros(8), TURN) == pytest.approx(0.0, abs=1e-12)


def test_a_band_is_the_root_of_its_quadratic_form():
    rng = np.random.default_rng(SEED)
    half = rng.normal(size=(7, 7))
    theta = np.append(rng.uniform(-500.0, 500.0, 2100), np.nan)
    found = _core.band(theta, TURN, CYCLES, ORDERS, (half @ half.T).ravel())
    whole = np.column_stack([np.ones(theta.size), rows(theta)])
    expected = np.linalg.norm(whole @ half, axis=1)
    np.testing.assert_allclose(found, expected, rtol=1e-12)


def test_the_stretch_travelled_is_that_outside_the_widest_gap():
    rng = np.random.default_rng(SEED)
    part = rng.uniform(200.0, 420.0, 4000)
    ends = np.array([200.5, 419.5])
    start, stop, full = _core.covered_span([part[:1500], part[1500:], ends], TURN, 100_000)
    assert not full
    assert start == pytest.approx(part.min(), abs=1e-9)
    assert stop - start == pytest.approx(part.max() - part.min(), abs=1e-9)
    assert _core.covered_span([rng.uniform(0.0, 360.0, 4000)], TURN, 100_000) == (0.0, TURN, True)


def groups(count=5, n=3, seed=SEED):
    """Rows and readings of some groups, and their sums of products."""
    rng = np.random.default_rng(seed)
    x, y = rng.normal(size=(count, 20, n)), rng.normal(size=(count, 20))
    y += x @ np.arange(1.0, n + 1.0)
    grams = np.einsum("gki,gkj->gij", x, x)
    return x, y, grams, np.einsum("gki,gk->gi", x, y), (y**2).sum(axis=1)


@pytest.mark.parametrize("ridge", [0.0, 4.0])
def test_groups_left_out_are_fitted_by_the_others(ridge):
    x, y, grams, moments, squares = groups()
    coefficients, left_of_it = _core.left_out(grams, moments, list(squares), ridge)
    for g in range(len(x)):
        others = [k for k in range(len(x)) if k != g]
        gram = grams[others].sum(axis=0)
        gram += ridge * np.trace(gram) / 3 * np.eye(3)
        expected = np.linalg.solve(gram, moments[others].sum(axis=0))
        np.testing.assert_allclose(coefficients[g], expected, rtol=1e-10)
        rest = y[g] - x[g] @ expected
        assert left_of_it[g] == pytest.approx(rest @ rest, rel=1e-10)


@pytest.mark.parametrize("own_zeros", [False, True])
def test_a_ridge_path_is_fitted_fold_by_fold(own_zeros):
    x, y, *_ = groups(count=4)
    y += np.array([0.0, 0.3, -0.2, 0.5])[:, None]
    whole = [np.column_stack([np.ones(20), *pair[0].T, pair[1]]) for pair in zip(x, y, strict=True)]
    folds = [(np.linalg.qr(rows, mode="r"), 20.0) for rows in whole]
    penalties = [0.0, 0.03, 1.0]
    found, scores = _core.ridge_path(folds, own_zeros, penalties)

    def centred(which):
        """Columns and readings less their means: of every fold where zeros are its own."""
        axes = (1,) if own_zeros else (0, 1)
        means = [v[which].mean(axis=axes, keepdims=True) for v in (x, y)]
        return x[which] - means[0], y[which] - means[1], means

    def fitted(which, penalty):
        dx, dy, means = centred(which)
        dx, dy = dx.reshape(-1, 3), dy.ravel()
        own = np.linalg.solve(dx.T @ dx + dy.size * penalty * np.eye(3), dx.T @ dy)
        return own, means

    for k, penalty in enumerate(penalties):
        np.testing.assert_allclose(found[:, k], fitted([0, 1, 2, 3], penalty)[0], rtol=1e-9)
        expected = 0.0
        for g in range(4):
            own, means = fitted([j for j in range(4) if j != g], penalty)
            rest = y[g] - x[g] @ own
            zero = rest.mean() if own_zeros else means[1].item() - means[0].ravel() @ own
            expected += np.mean((rest - zero) ** 2)
        assert scores[k] == pytest.approx(expected, rel=1e-9)


def test_a_covariance_of_clusters_is_that_of_their_scores():
    """A sandwich, the scores of each cluster blown up by what its readings took for themselves."""
    _, _, grams, moments, _ = groups(count=12)
    gram = grams.sum(axis=0)
    fit = np.linalg.solve(gram, moments.sum(axis=0))
    scores = moments - grams @ fit
    found, freedom = _core.cluster_covariance(grams, scores)
    bread = np.linalg.inv(gram)
    meat = np.zeros((3, 3))
    for g in range(12):
        lower = np.linalg.cholesky(gram)
        share = np.linalg.solve(lower, np.linalg.solve(lower, grams[g]).T)
        values, vectors = np.linalg.eigh(share)
        root = vectors @ np.diag((1.0 - values) ** -0.5) @ vectors.T
        blown = lower @ root @ np.linalg.solve(lower, scores[g])
        meat += np.outer(blown, blown)
    np.testing.assert_allclose(found, bread @ meat @ bread, rtol=1e-9)
    assert freedom.shape == (3,)
    assert (freedom < 11.0).all()
    assert (freedom > 4.0).all()


def test_the_highest_order_of_sums_is_that_which_is_named():
    few = np.array([1.0, 2.0, 3.0])
    most = _core.Moments(TURN, [1.0], [[65_536]])
    most.update(few, few)
    assert most.count == 3
    with pytest.raises(ArgumentError, match="at most 65536, got 65537"):
        _core.Moments(TURN, [1.0], [[65_537]]).update(few, few)


@pytest.mark.parametrize("n", [1, 255, 256, 257, 1100])
@pytest.mark.parametrize("order", ["C", "F"])
def test_columns_beside_a_fit_of_any_length_are_those_of_numpy(n, order):
    """What the readings of a fit see, however its table lies in memory and ends."""
    rng = np.random.default_rng(SEED)
    table, residual = rng.normal(size=(n, 3)), rng.normal(size=n)
    whiten = _core.Whitener([(0, n)])
    found = whiten.beside(np.array(table, order=order), residual, 1.0, 0.0).seen
    expected = np.column_stack([table, residual]).T
    np.testing.assert_allclose(found, expected, rtol=0, atol=1e-12)
