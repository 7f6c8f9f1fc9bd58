"""The one solver of linear models: its definition, slow forms and certified values."""

import numpy as np
import pytest

from trueangle import _core
from trueangle.estimation.linear import (
    NormalEquations,
    cluster_covariance,
    least_squares,
    left_out,
    linear_residual,
    pseudo_inverse,
    total,
    without_columns,
)

#: Relative, of well-conditioned systems of some dozen unknowns.
ROUNDING = 1e-12

#: NIST StRD Longley: employment, and six predictors.
LONGLEY = np.array(
    [
        [60323, 83.0, 234289, 2356, 1590, 107608, 1947],
        [61122, 88.5, 259426, 2325, 1456, 108632, 1948],
        [60171, 88.2, 258054, 3682, 1616, 109773, 1949],
        [61187, 89.5, 284599, 3351, 1650, 110929, 1950],
        [63221, 96.2, 328975, 2099, 3099, 112075, 1951],
        [63639, 98.1, 346999, 1932, 3594, 113270, 1952],
        [64989, 99.0, 365385, 1870, 3547, 115094, 1953],
        [63761, 100.0, 363112, 3578, 3350, 116219, 1954],
        [66019, 101.2, 397469, 2904, 3048, 117388, 1955],
        [67857, 104.6, 419180, 2822, 2857, 118734, 1956],
        [68169, 108.4, 442769, 2936, 2798, 120445, 1957],
        [66513, 110.8, 444546, 4681, 2637, 121950, 1958],
        [68655, 112.6, 482704, 3813, 2552, 123366, 1959],
        [69564, 114.2, 502601, 3931, 2514, 125368, 1960],
        [69331, 115.7, 518173, 4806, 2572, 127852, 1961],
        [70551, 116.9, 554894, 4007, 2827, 130081, 1962],
    ]
)
CERTIFIED = [
    *(-3482258.63459582, 15.0618722713733, -0.0358191792925910, -2.02022980381683),
    *(-1.03322686717359, -0.0511041056535807, 1829.15146461355),
]
CERTIFIED_STD = [
    *(890420.383607373, 84.9149257747669, 0.0334910077722432, 0.488399681651699),
    *(0.214274163161675, 0.226073200069370, 455.478499142212),
]
#: The problem loses nine of sixteen digits.
KEPT = 1e-7


def drawn(seed, n, m, k=1):
    print("seed", seed)
    rng = np.random.default_rng(seed)
    return rng.normal(size=(n, m)), rng.normal(size=(n, k)), rng.uniform(0.1, 3.0, n)


@pytest.mark.parametrize(("n", "m", "k"), [(30, 4, 1), (1500, 12, 3), (7, 7, 2), (600, 60, 1)])
def test_rows_agree_with_numpy_and_leave_nothing_along_the_columns(n, m, k):
    design, target, weights = drawn(n + m, n, m, k)
    root = np.sqrt(weights)[:, None]
    expected = np.linalg.lstsq(design * root, target * root, rcond=None)[0]
    found = least_squares(design, target, weights)
    size = np.linalg.cond(design * root) ** 2
    np.testing.assert_allclose(found, expected, rtol=0, atol=ROUNDING * size)
    left = linear_residual(design, target, weights)
    assert np.abs(design.T @ (weights[:, None] * left)).max() < ROUNDING * n * size
    apart = without_columns(design * 10.0 ** np.arange(m), target, weights)
    np.testing.assert_allclose(apart, left, rtol=0, atol=ROUNDING * n * size)
    model = _core.LinearModel.of_rows(design, target, weights)
    np.testing.assert_allclose(
        model.squares, (weights[:, None] * left**2).sum(axis=0), rtol=0, atol=ROUNDING * n * size
    )


def test_one_vector_of_any_layout_is_what_a_column_is():
    design, target, _ = drawn(3, 50, 5, 2)
    for column in range(2):
        np.testing.assert_array_equal(
            least_squares(np.asfortranarray(design), target[:, column]),
            least_squares(design, np.ascontiguousarray(target[:, column])),
        )


def test_longley_has_its_certified_values():
    design = np.column_stack([np.ones(16), LONGLEY[:, 1:]])
    target = np.ascontiguousarray(LONGLEY[:, 0])
    model = _core.LinearModel.of_rows(design, target[:, None])
    np.testing.assert_allclose(model.coefficients[:, 0], CERTIFIED, rtol=KEPT)
    std = np.sqrt(model.squares[0] / 9.0 * model.inverse.diagonal())
    np.testing.assert_allclose(std, CERTIFIED_STD, rtol=KEPT)


@pytest.mark.parametrize("size", [1, 2, 9, 60])
def test_the_inverse_is_that_of_moore_and_penrose_in_scaled_columns(size):
    design, _, _ = drawn(size, 100, size)
    design *= np.logspace(-6, 6, size)
    # Of two columns that are one, each gets half.
    twice = np.column_stack([design, 1e3 * design[:, :1]])
    for x in (design, twice):
        gram = x.T @ x
        scale = np.sqrt(np.diag(gram))
        unit = gram / np.outer(scale, scale)
        expected = np.linalg.pinv(unit, rcond=1e-11, hermitian=True) / np.outer(scale, scale)
        off = (pseudo_inverse(gram) - expected) * np.outer(scale, scale)
        assert np.abs(off).max() < 1e-10
    model = _core.LinearModel.of_sums(twice.T @ twice, np.empty((size + 1, 0)), [])
    assert model.rank == size
    unseen = np.abs(model.unseen[:, 0])
    np.testing.assert_allclose(unseen[[0, -1]], np.sqrt(0.5), rtol=1e-9)


def test_the_determinant_is_that_of_numpy():
    design, target, _ = drawn(5, 80, 6)
    gram = design.T @ design
    expected = np.linalg.slogdet(gram)[1]
    rows = _core.LinearModel.of_rows(design, target)
    sums = _core.LinearModel.of_sums(gram, design.T @ target, [1.0])
    assert rows.log_determinant == pytest.approx(expected, rel=ROUNDING)
    assert sums.log_determinant == pytest.approx(expected, rel=ROUNDING)


def test_sums_about_any_coefficients_are_those_of_the_residuals():
    """Of the best ones and of others, as a prior leaves them."""
    design, target, _ = drawn(13, 40, 3)
    sums = NormalEquations.of_rows(design, target[:, 0])
    for off in (0.0, 0.5):
        coefficients = sums.solved().coefficients[:, 0] + off
        about = sums.about(coefficients)
        wanted = NormalEquations.of_rows(design, target[:, 0] - design @ coefficients)
        np.testing.assert_allclose(about.moment, wanted.moment, atol=1e-9)
        assert about.squares == pytest.approx(wanted.squares, rel=1e-9)


@pytest.mark.parametrize("ridge", [0.0, 1e-2])
def test_each_group_is_predicted_by_a_fit_of_the_rows_of_the_others(ridge):
    design, target, _ = drawn(11, 90, 4)
    target = target[:, 0]
    # One group outweighs all others: its sums less themselves would have no digits left.
    design[:10] *= 1e6
    target[:10] *= 1e6
    parts = [slice(0, 10), slice(10, 35), slice(35, 60), slice(60, 90)]
    groups = [NormalEquations.of_rows(design[p], target[p]) for p in parts]
    coefficients, squares = left_out(groups, ridge)
    for part, found, square in zip(parts, coefficients, squares, strict=True):
        kept = np.ones(90, dtype=bool)
        kept[part] = False
        gram = design[kept].T @ design[kept]
        held = np.sqrt(ridge * np.trace(gram) / 4.0) * np.eye(4)
        rows = np.vstack([design[kept], held])
        expected = np.linalg.lstsq(rows, np.append(target[kept], np.zeros(4)), rcond=None)[0]
        np.testing.assert_allclose(found, expected, rtol=1e-9)
        left = target[part] - design[part] @ expected
        assert square == pytest.approx(left @ left, rel=1e-9)


def test_sums_add_up_and_lose_what_coefficients_explain():
    design, target, _ = drawn(13, 60, 3)
    target = target[:, 0]
    groups = [NormalEquations.of_rows(design[i::3], target[i::3]) for i in range(3)]
    whole = total(groups)
    found = whole.solved().coefficients[:, 0]
    left = target - design @ found
    about = whole.about(found)
    assert np.abs(about.moment).max() < ROUNDING * 60
    assert about.squares == pytest.approx(left @ left, rel=1e-10)
    assert whole.readings == 60
    # About a mean: of products that hold a column of ones.
    rows = np.column_stack([np.ones(60), design, target])
    centred = NormalEquations.of_products(rows.T @ rows)
    direct = NormalEquations.of_rows(design - design.mean(axis=0), target - target.mean())
    np.testing.assert_allclose(centred.gram, direct.gram, atol=1e-12)
    np.testing.assert_allclose(centred.moment, direct.moment, atol=1e-12)


def test_numbers_that_are_not_finite_are_refused():
    design, target, _ = drawn(1, 20, 3)
    design[4, 1] = np.nan
    with pytest.raises(np.linalg.LinAlgError, match="not finite"):
        least_squares(design, target)
    with pytest.raises(np.linalg.LinAlgError, match="not finite"):
        pseudo_inverse(np.full((2, 2), np.inf))
    with pytest.raises(np.linalg.LinAlgError):
        left_out([NormalEquations(np.eye(2), np.ones(2))])


def test_sizes_that_do_not_fit_are_refused():
    with pytest.raises(ValueError, match="targets"):
        _core.LinearModel.of_rows(np.ones((3, 1)), np.ones((2, 1)))
    with pytest.raises(ValueError, match="moments"):
        _core.left_out(np.ones((2, 3, 3)), np.ones((2, 2)), [1.0, 1.0])


def test_clusters_that_share_a_direction_nobody_shows_have_no_covariance():
    x = np.outer(np.arange(1.0, 9.0), [1.0, 2.0])
    clusters = [NormalEquations.of_rows(part, part[:, 0]) for part in (x[:4], x[4:])]
    with pytest.raises(np.linalg.LinAlgError, match="do not determine"):
        cluster_covariance(clusters)
