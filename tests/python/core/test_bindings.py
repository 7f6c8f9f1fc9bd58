"""Functions of the core by themselves, against numpy: layouts, defaults, what is refused.

The package calls each in one way, with the right arguments.
"""

import numpy as np
import pytest

from trueangle import _core
from trueangle.errors import ArgumentError

N = 40
RNG = np.random.default_rng(11)
THETA = RNG.uniform(-6.0, 6.0, N)
ORDERS = np.array([1.0, 2.5, 7.0])
COSINE, SINE = RNG.normal(size=(2, ORDERS.size))
PHASES = np.outer(THETA, ORDERS)
BOUNDS = [(0, 15), (15, 16), (16, N)]
ROWS = RNG.normal(size=(N, 3))
ROOTS = RNG.uniform(0.5, 2.0, N)
BANDS = np.column_stack([np.full(N, 5.0), *RNG.uniform(-1.0, 1.0, (3, N))])
SHORT = np.ones(N - 1)

#: Of sums of some dozen numbers around 1; of numbers that single precision keeps.
ROUNDING = 1e-12
SINGLE = 1e-6


def filtering():
    """Matrix of the filter over `BOUNDS`: the defining equation, row by row."""
    matrix = np.diag(np.ones(N)) - 0.6 * np.diag(np.ones(N - 1), -1)
    for start, _ in BOUNDS:
        matrix[start] = 0.0
        matrix[start, start] = 0.8
    return matrix


def zeros(*shape):
    return np.zeros(shape)


def test_lines_are_those_of_numpy():
    columns = np.empty((N, 2 * ORDERS.size))
    columns[:, 0::2], columns[:, 1::2] = np.cos(PHASES), np.sin(PHASES)
    plain, single = (
        _core.line_columns(THETA, ORDERS),
        _core.line_columns(THETA, ORDERS, single=True),
    )
    assert (plain.dtype, single.dtype) == (np.float64, np.float32)
    np.testing.assert_allclose(plain, columns, rtol=0, atol=ROUNDING)
    np.testing.assert_allclose(single, columns, rtol=0, atol=SINGLE)
    value = np.cos(PHASES) @ COSINE + np.sin(PHASES) @ SINE
    slope = np.cos(PHASES) @ (ORDERS * SINE) - np.sin(PHASES) @ (ORDERS * COSINE)
    found = _core.line_sum(THETA, ORDERS, COSINE, SINE)
    np.testing.assert_allclose(found, value, rtol=0, atol=ROUNDING)
    both = _core.line_sum_and_slope(THETA, ORDERS, COSINE, SINE)
    np.testing.assert_allclose(both, [value, slope], rtol=0, atol=10 * ROUNDING)


def test_columns_that_are_rounding_are_zeros_where_that_is_asked_for():
    theta, orders = 2.0 * np.pi / 36.0 * np.arange(36), np.array([18.0, 3.0])
    plain = _core.line_columns(theta, orders)
    most = np.abs(plain[:, 1]).max()
    assert 0.0 < most < ROUNDING
    np.testing.assert_array_equal(
        _core.line_columns(theta, orders, vanishing=0.999 * most / 18.0), plain
    )
    found = _core.line_columns(theta, orders, vanishing=1.001 * most / 18.0)
    np.testing.assert_array_equal(found[:, 1], 0.0)
    np.testing.assert_array_equal(found[:, [0, 2, 3]], plain[:, [0, 2, 3]])


def test_sums_over_units_are_those_of_numpy():
    values, starts = RNG.normal(size=(2, N)), [0, 3, 20]
    found = _core.unit_sums(THETA, values, starts, 0.5, 0.25, 6)
    assert found.shape == (6, 3, 4)
    for k, own in enumerate(found):
        waves = values * np.exp(-1j * (0.5 + 0.25 * k) * THETA)
        sums = np.add.reduceat(waves, starts, axis=1).T
        found_sums = own[:, 0::2] + 1j * own[:, 1::2]
        np.testing.assert_allclose(found_sums, sums, rtol=0, atol=100 * ROUNDING)


@pytest.mark.parametrize("damping", [None, 0.4])
def test_a_lag_is_the_gain_of_its_equation(damping):
    waves = RNG.normal(size=(N, 3)) + 1j * RNG.normal(size=(N, 3))
    frequency = RNG.uniform(-3.0, 3.0, (N, 3))
    jw = 1j * frequency / 2.0
    options = {} if damping is None else {"damping": damping}
    gain = 1.0 / (1.0 + jw) if damping is None else 1.0 / (1.0 + 2.0 * damping * jw + jw**2)
    parts = np.stack([waves.real, waves.imag], axis=2).reshape(N, 6)
    found = _core.lagged(parts, frequency, 2.0, **options)
    expected = (waves * (gain - 1.0)).real.sum(axis=1)
    np.testing.assert_allclose(found, expected, rtol=0, atol=10 * ROUNDING)


@pytest.mark.parametrize("roots", [None, ROOTS])
@pytest.mark.parametrize("order", ["C", "F"])
def test_whitening_is_its_matrix(roots, order):
    matrix = filtering() * (1.0 if roots is None else roots)
    whiten = _core.Whitener(BOUNDS, 0.6, None, None if roots is None else roots**2)
    found = whiten(np.array(ROWS, order=order))
    np.testing.assert_allclose(found, matrix @ ROWS, rtol=0, atol=10 * SINGLE)
    np.testing.assert_array_equal(found[:, 0], whiten(ROWS[:, 0]))
    assert whiten.bounds is BOUNDS
    if roots is not None:
        np.testing.assert_allclose(whiten.root_weights, roots, rtol=ROUNDING)


def test_readings_settle_under_the_noise_of_what_they_leave():
    """One pass after the other in numpy: a fit, what it leaves clipped, its correlation."""
    rng, n = np.random.default_rng(3), 500
    bounds, clock = [(0, 200), (200, n)], np.arange(float(n))
    noise = rng.normal(size=n)
    for k in range(1, n):
        noise[k] += 0.6 * noise[k - 1]
    design = np.column_stack([np.ones(n), np.cos(0.3 * clock), np.sin(0.3 * clock)])
    readings = design @ [10.0, 3.0, -2.0] + noise
    readings[[50, 51, 300]] += 80.0
    lag, ones = _core.LagCorrelation(clock, bounds), np.ones(n)
    white = _core.Whitener(bounds)
    target, rho = readings, 0.0
    for _ in range(2):
        whiten = _core.Whitener(bounds, rho)
        x, y = whiten(design), whiten(target)
        left = readings - design @ np.linalg.lstsq(x, y)[0]
        kept, target, outlying = _core.clipped(readings, left, ones, 4.0)
        rho = lag(np.where(_core.short_stretches(outlying, bounds), 0.0, kept))
    whiten = _core.Whitener(bounds, rho)
    expected = np.linalg.lstsq(whiten(design), whiten(target))[0]
    factors, fit, clipped, flags = _core.settled(design, readings, ones, 0.0, lag, white, None, [])
    np.testing.assert_array_equal(flags, outlying)
    assert flags[[50, 51, 300]].all()
    np.testing.assert_allclose(fit[0], expected, rtol=0, atol=100 * ROUNDING)
    np.testing.assert_allclose(clipped, target, rtol=0, atol=1000 * ROUNDING)
    assert factors[0].whiten.rho == pytest.approx(rho, abs=100 * ROUNDING)
    assert 0.4 < rho < 0.8
    assert factors[-1].whiten is white
    # Another one that begins there makes nothing anew.
    again = _core.settled(factors[0].design, readings, ones, 0.0, lag, white, None, factors)
    assert again[0][0].whiten is factors[0].whiten
    np.testing.assert_array_equal(again[1][0], fit[0])
    # A correlation that is given stays.
    given = _core.settled(design, readings, ones, 0.0, lag, _core.Whitener(bounds, 0.3), 0.3, [])
    assert [factor.whiten.rho for factor in given[0]] == [0.3]


def test_medians_and_what_is_clipped():
    assert _core.median(np.array([3.0, -1.0, 9.0, 4.0])) == 3.5
    assert _core.median(np.arange(12.0)[::3]) == 4.5
    assert np.isnan(_core.median(np.array([1.0, np.nan, 2.0])))
    left = 0.1 * RNG.normal(size=N)
    left[[3, 30]] = 5.0, -7.0
    readings = 100.0 + left
    away = left * ROOTS
    limit = 4.0 * 1.4826 * np.median(np.abs(away - np.median(away))) / ROOTS
    kept, target, outlying = _core.clipped(readings, left, ROOTS, 4.0)
    assert outlying.dtype == np.bool_
    np.testing.assert_array_equal(outlying, np.abs(left) > limit)
    np.testing.assert_allclose(kept, np.clip(left, -limit, limit), rtol=ROUNDING)
    np.testing.assert_allclose(target, 100.0 + kept, rtol=ROUNDING)
    # No reading is known better than the least.
    kept, _, outlying = _core.clipped(readings, left, ROOTS, 4.0, 1.5)
    np.testing.assert_array_equal(outlying, np.abs(left) > 6.0 / ROOTS)
    np.testing.assert_allclose(kept, np.clip(left, -6.0 / ROOTS, 6.0 / ROOTS), rtol=ROUNDING)


def test_a_banded_system_is_that_of_numpy():
    dense = np.diag(BANDS[:, 0])
    for lag in (1, 2, 3):
        dense += np.diag(BANDS[: N - lag, lag], lag) + np.diag(BANDS[: N - lag, lag], -lag)
    factor = _core.Banded.factor(BANDS)
    assert factor.log_determinant == pytest.approx(np.linalg.slogdet(dense)[1], rel=ROUNDING)
    right = ROWS.copy()
    factor.solve(right)
    np.testing.assert_allclose(dense @ right, ROWS, rtol=0, atol=ROUNDING)
    assert _core.Banded.factor(-BANDS) is None


def test_rows_of_harmonics_are_those_of_numpy():
    factor, lead = RNG.uniform(0.5, 2.0, N), RNG.uniform(-1.0, 1.0, N)
    orders = np.array([1, 2, 9])
    for scale, turn, options in (
        (np.ones(N), np.zeros(N), {}),
        (factor, lead, {"factor": factor, "lead": lead}),
    ):
        phases = orders[:, None] * THETA + turn / orders[:, None]
        expected = np.empty((6, N))
        expected[0::2], expected[1::2] = scale * np.cos(phases), scale * np.sin(phases)
        rows = zeros(6, N)
        _core.harmonic_rows(THETA, orders, rows, **options)
        np.testing.assert_allclose(rows, expected, rtol=0, atol=ROUNDING)
        total = zeros(N)
        coefficients = np.arange(1.0, 7.0)
        _core.harmonic_sum(THETA, orders, coefficients, total, **options)
        np.testing.assert_allclose(total, coefficients @ expected, rtol=0, atol=100 * ROUNDING)


@pytest.mark.parametrize("order", ["C", "F"])
def test_a_fit_is_seen_however_its_columns_lie(order):
    whiten = _core.Whitener(BOUNDS, 0.6)
    found = whiten.beside(np.array(ROWS, order=order), THETA, 1.0, 0.0).seen
    expected = filtering().T @ np.column_stack([ROWS, THETA])
    np.testing.assert_allclose(found, expected.T, rtol=0, atol=10 * ROUNDING)


def test_sums_count_what_has_a_weight():
    sums = _core.Moments(360.0, [0.5], [[1]])
    assert (sums.count, sums.cycles) == (0, 0.5)
    sums.update(THETA, THETA, zeros(N))
    assert sums.count == 0
    sums.update(THETA, THETA, ROOTS)
    assert sums.update_known(THETA, np.append(np.nan, THETA[1:]), False) == N - 1
    assert (sums.count, sums.copy().count) == (2 * N - 1, 2 * N - 1)


def test_sums_of_no_readings_are_counted_from_zero():
    weight, error, *rest = _core.Moments(360.0, [1.0], [[1, 3]]).spectrum()
    assert not weight.any()
    assert not error.any()
    assert rest == [0.0, 0, 0.0]


def test_joints_alike_are_copied_whole():
    copied = ALIKE.copy()
    assert (len(ALIKE), len(copied)) == (2, 2)
    np.testing.assert_array_equal(copied.error(THETA[:2]), ALIKE.error(THETA[:2]))


def power(cuts, boxes, columns):
    _core.add_relative_power(zeros(9), np.array(cuts), boxes, zeros(1, columns))


LINES = (THETA, ORDERS, COSINE, SINE)
NOISE = _core.Whitener(BOUNDS, 0.5)
LAG = _core.LagCorrelation(THETA, BOUNDS)
MOMENTS = _core.Moments(360.0, [1.0], [[1]])
ALIKE = _core.Alike(
    _core.Corrector(_core.Series(360.0, 0.0, [1.0], [[1]], [[0.1]], [[0.0]]), []), 2
)


@pytest.mark.parametrize(
    ("call", "arguments", "word"),
    [
        (_core.line_sum, (*LINES[:2], COSINE[:2], SINE), "cosine"),
        (_core.line_sum, (*LINES[:3], SINE[:2]), "sine"),
        (_core.line_sum_and_slope, (*LINES[:2], COSINE[:2], SINE), "cosine"),
        (_core.unit_sums, (THETA, np.ones((2, N - 1)), [0], 1.0, 1.0, 2), "row, got 39"),
        (_core.lagged, (np.ones((N, 5)), np.ones((N, 3)), 1.0), "waves"),
        (_core.Whitener, ([(0, 10), (11, N)], 0.5), "one after the other"),
        (_core.Whitener, ([(0, 30), (30, 20), (20, N)], 0.5), "one after the other"),
        (_core.Whitener, (BOUNDS, 0.5, None, SHORT), "roots"),
        (_core.Whitener, (BOUNDS, 0.5, [_core.RunEffect(ROWS[1:])]), "columns"),
        (NOISE, (ROWS[1:],), "x"),
        (NOISE.run_part, (SHORT,), "residual"),
        (_core.LagCorrelation, (SHORT, BOUNDS), "readings in all"),
        (_core.LagCorrelation(THETA, BOUNDS), (SHORT,), "residual"),
        (_core.Factor, (NOISE, ROWS[1:]), "design"),
        (_core.Factor(NOISE, ROWS).project, (SHORT,), "target"),
        (_core.Factor(NOISE, ROWS).without, ([9], THETA, ROOTS, 0.0, LAG), "places of the"),
        (_core.Factor(NOISE, ROWS).without, ([0], SHORT, ROOTS, 0.0, LAG), "readings"),
        (_core.short_stretches, (np.ones(3, dtype=bool), BOUNDS), "of 3 readings in all"),
        (_core.clipped, (THETA, SHORT, ROOTS, 3.0), "left"),
        (_core.clipped, (THETA, THETA, SHORT, 3.0), "roots"),
        (_core.Banded.factor, (np.ones((N, 3)),), "bands"),
        (_core.Banded.factor(BANDS).solve, (zeros(N - 1, 2),), "right"),
        (_core.harmonic_rows, (THETA, [1, 2], zeros(4, N), SHORT), "factor"),
        (_core.harmonic_rows, (THETA, [1, 2], zeros(4, N), None, SHORT), "lead"),
        (power, ([0, 9], [], 9), "totals"),
        (power, ([0, 10], [(1, 1.0)], 9), "0 to 9"),
        (power, ([0, 5, 5], [(1, 1.0)], 9), "grow"),
        (power, ([-1, 9], [(1, 1.0)], 9), "grow"),
        (power, ([4], [(1, 1.0)], 9), "two edges"),
        (power, ([0, 9], [(1, 1.0)], 10), "9 columns"),
        (NOISE.beside, (ROWS, THETA[1:], 1.0, 0.0), "r has 39"),
        (NOISE.beside, (ROWS[1:], THETA, 1.0, 0.0), "q"),
        (NOISE.beside(ROWS, THETA, 1.0, 0.0).gain, (ROWS[1:],), "columns"),
        (NOISE.beside(ROWS, THETA, 1.0, 0.0).line, (SHORT, 1.0, 2.0, 4, 0.0), "angles"),
        (MOMENTS.update, (THETA, SHORT), "error"),
        (MOMENTS.update, (THETA, THETA, SHORT), "weights"),
        (MOMENTS.update_known, (THETA, SHORT, False), "indicated"),
        (MOMENTS.restore, (np.ones(3),), "sums of such moments"),
        (MOMENTS.merge, (_core.Moments(360.0, [1.0], [[2]]),), "merge"),
        (MOMENTS.subtract, (_core.Moments(1.0, [1.0], [[1]]),), "merge"),
        (ALIKE.reset, ([0, 2],), "no joint 2 among 2"),
        (ALIKE.error, (np.ones(3),), "angles has 3 elements, joint has 2"),
    ],
)  # fmt: skip
def test_a_wrong_argument_is_named(call, arguments, word):
    with pytest.raises(ArgumentError, match=word):
        call(*arguments)
