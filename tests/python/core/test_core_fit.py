"""``_core.fit`` against numpy least squares, its definition and a Monte Carlo run."""

from __future__ import annotations

from math import pi, tau

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from trueangle import _core
from trueangle.errors import RankError

AGREES = 1e-12  # relative to the largest coefficient: rounding of either QR, condition below 10


def design_matrix(theta, period, cycles, orders):
    columns = []
    for f, ks in zip(cycles, orders, strict=True):
        for k in ks:
            phase = tau * k * f * theta / period
            columns += [np.cos(phase), np.sin(phase)]
    return np.stack(columns, axis=1)


def numpy_fit(runs, period, cycles, orders):
    """Coefficients, zeros, covariance of all unknowns (zeros first) and condition number."""
    rows, target = [], []
    for index, (reference, error, weights) in enumerate(runs):
        zeros = np.zeros((len(reference), len(runs)))
        zeros[:, index] = 1
        scale = np.sqrt(weights)
        block = np.hstack([zeros, design_matrix(reference, period, cycles, orders)])
        rows.append(scale[:, None] * block)
        target.append(scale * error)
    rows, target = np.vstack(rows), np.concatenate(target)
    solution, *_ = np.linalg.lstsq(rows, target)
    residual = target - rows @ solution
    freedom = sum(np.count_nonzero(w) for *_, w in runs) - rows.shape[1]
    variance = residual @ residual / freedom
    covariance = variance * np.linalg.inv(rows.T @ rows)
    return solution, covariance, variance, np.linalg.cond(rows)


def coefficients(solution):
    pairs = [
        np.column_stack([a, b]).ravel() for a, b in zip(solution.cosine, solution.sine, strict=True)
    ]
    return np.concatenate(pairs)


def make_runs(seed, sizes, period, cycles, orders, zeros, noise=1e-3):
    rng = np.random.default_rng(seed)
    truth = rng.normal(size=2 * sum(map(len, orders))) * period / 400
    runs = []
    for size, zero in zip(sizes, zeros, strict=True):
        reference = rng.uniform(-2 * period, 2 * period, size)
        error = design_matrix(reference, period, cycles, orders) @ truth
        error += noise * period * rng.normal(size=size) + zero
        runs.append((reference, error, rng.uniform(0.5, 2.0, size)))
    return truth, runs


CASES = {
    "one shaft": (tau, [1.0], [[1, 2, 3]]),
    "degrees": (360.0, [1.0], [list(range(1, 18))]),
    "two shafts": (360.0, [1.0, 100.0], [[1, 2], [1, 2, 4]]),
    "rational ratio": (360.0, [1.0, 2.5], [[1, 2], [1, 3]]),
    "real ratio": (1.0, [1.0, 16 * pi], [[1, 4], [1, 2]]),
    "counts": (65536.0, [1.0], [[1, 2, 400]]),
}


# Shafts of a real ratio never come back to their start together: they have no moments.
@pytest.mark.parametrize(
    ("case", "method"),
    [
        (case, method)
        for case in CASES
        for method in ("plain", "moments", "qr")
        if case != "real ratio" or method == "plain"
    ],
)
@pytest.mark.parametrize("zeros", [[0.0], [0.01, -0.02, 0.03]])
def test_agrees_with_numpy(case, zeros, method):
    period, cycles, orders = CASES[case]
    zeros = [zero * period for zero in zeros]
    size = 300
    if method == "qr":  # factors want a dozen readings or more in each of 6.5 K segments
        size = 40_000 if case in ("two shafts", "counts") else 4000
    _, runs = make_runs(1, [size] * len(zeros), period, cycles, orders, zeros)
    solution = _core.fit([(r, r + e, w) for r, e, w in runs], period, cycles, orders, method=method)
    assert solution.method == method
    expected, covariance, variance, condition = numpy_fit(runs, period, cycles, orders)

    scale = AGREES * abs(expected).max()
    n = len(zeros)
    assert coefficients(solution) == pytest.approx(expected[n:], rel=0, abs=scale)
    assert solution.offsets == pytest.approx(expected[:n], rel=0, abs=scale)
    assert solution.residual_variance == pytest.approx(variance, rel=1e-10)
    assert solution.offset_std == pytest.approx(np.sqrt(np.diag(covariance)[:n]), rel=1e-10)
    np.testing.assert_allclose(
        solution.covariance[1:, 1:], covariance[n:, n:], rtol=0, atol=1e-10 * covariance.max()
    )
    assert solution.condition_number == pytest.approx(condition, rel=1e-10)
    assert solution.rank == len(expected)


@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize("turns", [1.0, 7.3])
def test_a_sweep_agrees_with_numpy(turns, weighted):
    """Readings that follow each other fill the rows of their segments by whole vectors."""
    period, cycles, orders = CASES["degrees"]
    ((reference, error, weights),) = make_runs(5, [20_011], period, cycles, orders, [0.0])[1]
    order = np.argsort(reference)
    reference = np.linspace(0.0, turns * period, reference.size) + 1e-3 * reference[order]
    if not weighted:
        weights = np.ones_like(weights)
    given = (reference, reference + error, weights if weighted else None)
    solution = _core.fit([given], period, cycles, orders, method="moments")
    expected, *_ = numpy_fit([(reference, error, weights)], period, cycles, orders)
    size = np.abs(expected).max()
    np.testing.assert_allclose(coefficients(solution), expected[1:], rtol=0, atol=AGREES * size)


@pytest.mark.parametrize("travel", [1.0, 0.5])
def test_counts_agree_with_numpy(travel):
    period, orders = 4096.0, [[1, 2, 5]]
    zeros = [30.0, -2000.0]
    _, runs = make_runs(3, [50_000, 40_000], period, [1.0], orders, zeros)
    runs = [
        (np.rint(travel * (r % period)) + 3 * period, np.rint(e).astype(float), w)
        for r, e, w in runs
    ]
    rows = [(r, r + e, w) for r, e, w in runs]
    solution = _core.fit(rows, period, [1.0], orders)
    assert solution.method == "counts"
    expected, covariance, variance, condition = numpy_fit(runs, period, [1.0], orders)
    scale = AGREES * condition * abs(expected).max()
    assert coefficients(solution) == pytest.approx(expected[2:], rel=0, abs=scale)
    assert solution.offsets == pytest.approx(expected[:2], rel=0, abs=scale)
    assert solution.residual_variance == pytest.approx(variance, rel=1e-10)
    assert solution.condition_number == pytest.approx(condition, rel=1e-6)
    np.testing.assert_allclose(
        solution.covariance[1:, 1:], covariance[2:, 2:], rtol=0, atol=1e-8 * covariance.max()
    )
    with pytest.raises(ValueError, match="whole numbers"):
        _core.fit([(r + 0.5, r, None) for r, _, _ in rows], period, [1.0], orders, method="counts")


@pytest.mark.parametrize(
    ("travel", "highest", "expected"),
    [(360, 17, "moments"), (270, 17, "qr"), (180, 8, "qr"), (90, 5, "qr"), (180, 17, "plain")],
)
def test_path_follows_the_condition_number_and_is_as_good_as_qr(travel, highest, expected):
    rng = np.random.default_rng(10)
    orders = list(range(1, highest + 1))
    reference = rng.uniform(0, travel, 20_000)
    truth = rng.normal(size=2 * highest)
    error = design_matrix(reference, 360.0, [1.0], [orders]) @ truth
    runs = [(reference, reference + error, None)]
    solution = _core.fit(runs, 360.0, [1.0], [orders])
    assert solution.method == expected
    plain = _core.fit(runs, 360.0, [1.0], [orders], method="plain")
    # The readings themselves are rounded to 360 * 1.1e-16.
    worst = max(1e-13, 1e-14 * plain.condition_number)
    assert coefficients(solution) == pytest.approx(coefficients(plain), abs=worst)
    assert solution.condition_number == pytest.approx(plain.condition_number, rel=1e-3)


@pytest.mark.parametrize("threads", [1, 2, 3])
@pytest.mark.parametrize("method", ["moments", "qr"])
def test_threads_do_not_change_a_bit(threads, method):
    rng = np.random.default_rng(11)
    reference = rng.uniform(0, 360, 300_000)
    runs = [(reference, reference + rng.normal(size=reference.size), None)]
    one, more = (
        _core.fit(runs, 360.0, [1.0], [[1, 2, 3]], method=method, threads=n) for n in (1, threads)
    )
    assert coefficients(one).tolist() == coefficients(more).tolist()
    assert one.covariance.tolist() == more.covariance.tolist()


def test_constant_is_the_circular_mean_and_its_variance_follows():
    zeros = [170.0, -175.0, 178.0]
    _, runs = make_runs(2, [200, 300, 400], 360.0, [1.0], [[1, 2]], zeros)
    solution = _core.fit([(r, r + e, w) for r, e, w in runs], 360.0, [1.0], [[1, 2]])
    expected, covariance, *_ = numpy_fit(runs, 360.0, [1.0], [[1, 2]])
    directions = np.exp(1j * np.radians(expected[:3]))
    mean = np.degrees(np.angle(directions.sum()))
    assert solution.constant == pytest.approx(mean, abs=1e-9)
    share = np.cos(np.radians(expected[:3] - mean)) / abs(directions.sum())
    jacobian = np.zeros((5, 7))
    jacobian[0, :3], jacobian[1:, 3:] = share, np.eye(4)
    np.testing.assert_allclose(
        solution.covariance,
        jacobian @ covariance @ jacobian.T,
        rtol=0,
        atol=1e-10 * covariance.max(),
    )


@given(
    zero=st.floats(-180, 180),
    turns=st.integers(-1000, 1000),
    backwards=st.booleans(),
    wrap=st.booleans(),
    unit=st.sampled_from([tau, 1.0, 360.0, 65536.0]),
    argument=st.sampled_from(["reference", "indicated"]),
)
def test_zero_wrap_unit_and_row_order_do_not_matter(zero, turns, backwards, wrap, unit, argument):
    _, ((reference, error, weights),) = make_runs(3, [200], 360.0, [1.0], [[1, 2, 5]], [0.0])
    indicated = reference + error
    plain = _core.fit([(reference, indicated, weights)], 360.0, [1.0], [[1, 2, 5]], argument)

    moved = indicated + zero + 360.0 * turns
    moved_reference = reference
    if argument == "indicated":  # the pattern is tied to the indicated angle: move the truth
        moved, moved_reference = indicated, reference - zero - 360.0 * turns
    if wrap:
        moved, moved_reference = moved % 360.0, moved_reference % 360.0
    step = -1 if backwards else 1
    arrays = [
        np.ascontiguousarray(v[::step]) * s
        for v, s in ((moved_reference, unit / 360), (moved, unit / 360), (weights, 1.0))
    ]
    other = _core.fit([tuple(arrays)], unit, [1.0], [[1, 2, 5]], argument)
    # The angles given are rounded: a reading near 4e5 deg carries 6e-11 deg.
    tolerance = 1e-12 + 1e-12 * abs(turns)
    assert coefficients(other) * 360 / unit == pytest.approx(coefficients(plain), abs=tolerance)
    shift = other.constant * 360 / unit - plain.constant - zero
    assert (shift + 180) % 360 - 180 == pytest.approx(0, abs=10 * tolerance)
    assert -unit / 2 < other.constant <= unit / 2


def test_sign_reversal():
    _, ((reference, error, weights),) = make_runs(4, [99], 360.0, [1.0], [[1, 3]], [4.0])
    plus = _core.fit([(reference, reference + error, weights)], 360.0, [1.0], [[1, 3]])
    minus = _core.fit([(reference, reference - error, weights)], 360.0, [1.0], [[1, 3]])
    assert coefficients(minus) == pytest.approx(-coefficients(plus), abs=1e-12)
    assert minus.constant == pytest.approx(-plus.constant, abs=1e-12)


def test_zero_weight_readings_do_not_count():
    _, ((reference, error, weights),) = make_runs(5, [80], 360.0, [1.0], [[1, 2]], [4.0])
    keep = np.arange(80) % 4 != 0
    masked = _core.fit([(reference, reference + error, weights * keep)], 360.0, [1.0], [[1, 2]])
    apart = _core.fit(
        [(reference[keep], (reference + error)[keep], weights[keep])], 360.0, [1.0], [[1, 2]]
    )
    assert coefficients(masked) == pytest.approx(coefficients(apart), abs=1e-13)
    assert masked.degrees_of_freedom == apart.degrees_of_freedom == 55


def test_standard_errors_agree_with_monte_carlo():
    period, cycles, orders, noise = 360.0, [1.0], [[1, 2, 3]], 1e-4
    trials = 2000
    rng = np.random.default_rng(6)
    reference = rng.uniform(0, 250, 60)
    base = np.array([1.0, 0.5, -0.3, 0.2, 0.1, 0.4])
    clean = design_matrix(reference, period, cycles, orders) @ base
    found, variances = [], []
    for _ in range(trials):
        noisy = reference + clean + noise * period * rng.normal(size=60)
        solution = _core.fit([(reference, noisy, None)], period, cycles, orders)
        found.append([solution.constant, *coefficients(solution)])
        variances.append(np.diag(solution.covariance))
    ratio = np.var(found, axis=0) / np.mean(variances, axis=0)
    # A variance from 2000 trials has a standard error of sqrt(2 / 2000) = 3.2 %.
    assert ratio == pytest.approx(1.0, abs=5 * 0.032)


@pytest.mark.parametrize(
    ("positions", "orders", "at_fault", "words"),
    [
        (36, [1, 18], [(0, 18)], "the sine of order 18 is zero"),
        (36, [16, 20], [(0, 16), (0, 20)], "order 20 cannot be distinguished from order 16"),
        (36, [1, 36], [(0, 36)], "cosine of order 36 is the same"),
        (10, list(range(1, 8)), [(0, 5), (0, 6), (0, 7)], "10 distinct angles"),
    ],
)
@pytest.mark.parametrize("period", [360.0, tau, 1.0])
@pytest.mark.parametrize("closed", [False, True])
def test_rank_deficiency_names_the_orders(positions, orders, at_fault, words, period, closed):
    grid = np.arange(positions + closed) * (period / positions)
    reference = np.tile(grid, 3)
    indicated = reference + 0.01 * period * np.cos(tau * reference / period)
    with pytest.raises(RankError, match=words) as caught:
        _core.fit([(reference, indicated, None)], period, [1.0], [orders])
    assert list(caught.value.orders) == at_fault


def test_closed_turn_counts_once():
    # 0 and 360 are one place: 10 readings determine 9 unknowns, 11 rows or not.
    reference = np.arange(10) * 40.0
    with pytest.raises(RankError, match="9 distinct angles"):
        _core.fit([(reference, reference, None)], 360.0, [1.0], [[1, 2, 3, 4, 5]])
    solution = _core.fit([(reference, reference + 1, None)], 360.0, [1.0], [[1, 2, 3, 4]])
    assert solution.constant == pytest.approx(1, abs=1e-13)
    assert solution.degrees_of_freedom == 1


def test_partial_travel_is_not_rank_deficiency():
    rng = np.random.default_rng(7)
    reference = rng.uniform(0, 180, 500)
    truth = rng.normal(size=16)
    error = design_matrix(reference, 360.0, [1.0], [list(range(1, 9))]) @ truth
    solution = _core.fit([(reference, reference + error, None)], 360.0, [1.0], [list(range(1, 9))])
    assert solution.condition_number > 1e5
    assert coefficients(solution) == pytest.approx(truth, abs=1e-14 * solution.condition_number)


def test_too_little_travel_is_refused():
    reference = np.linspace(0, 5, 500)
    with pytest.raises(RankError, match="too little of a turn"):
        _core.fit([(reference, reference, None)], 360.0, [1.0], [list(range(1, 18))])


def test_ridge_agrees_with_the_normal_equations():
    orders = [[1, 2, 3]]
    _, ((reference, error, weights),) = make_runs(8, [50], 360.0, [1.0], orders, [1.0])
    ridge = np.array([0.0, 1.0, 2.0, 3.0, 10.0, 20.0])
    solution = _core.fit(
        [(reference, reference + error, weights)], 360.0, [1.0], orders, ridge=ridge
    )
    rows = np.hstack([np.ones((50, 1)), design_matrix(reference, 360.0, [1.0], orders)])
    gram = rows.T @ (weights[:, None] * rows)
    held = np.linalg.inv(gram + np.diag([0, *ridge]))
    expected = held @ rows.T @ (weights * error)
    residual = error - rows @ expected
    freedom = 50 - np.trace(held @ gram)
    variance = residual @ (weights * residual) / freedom
    assert [solution.constant, *coefficients(solution)] == pytest.approx(expected, abs=1e-12)
    assert solution.degrees_of_freedom == pytest.approx(freedom, rel=1e-12)
    np.testing.assert_allclose(
        solution.covariance, variance * held @ gram @ held, rtol=0, atol=1e-12 * variance
    )


def test_ridge_lifts_a_rank_deficiency():
    reference = np.arange(4) * 90.0
    indicated = reference + np.cos(np.radians(reference))
    solution = _core.fit(
        [(reference, indicated, None)], 360.0, [1.0], [[1, 2, 3]], ridge=[1e-6] * 6
    )
    # Orders 1 and 3 share the pattern they cannot be told apart by.
    assert solution.cosine[0] == pytest.approx([0.5, 0, 0.5], abs=1e-6)


def test_bad_arguments():
    x = np.zeros(3)
    for runs, message in [
        ([(x, x[:2], None)], "indicated has 2 elements, reference has 3"),
        ([(x, np.array([0, np.nan, 0]), None)], r"indicated\[1\] must be finite"),
        ([(x, x, np.array([1.0, -1, 1]))], r"weights\[1\] must be finite and not negative"),
        ([(x, x, x)], "run 0 has no reading of positive weight"),
        ([], "there are no runs"),
    ]:
        with pytest.raises(ValueError, match=message):
            _core.fit(runs, 360.0, [1.0], [[1]])
    good = np.linspace(0, 2 * pi, 9)
    for keywords, message in [
        ({"argument": "encoder"}, "argument must be"),
        ({"method": "magic"}, "method must be"),
        ({"threads": 0}, "threads must be 1 or more"),
        ({"ridge": [1.0]}, "ridge has 1 elements"),
        ({"ridge": [1.0, -1.0]}, r"ridge\[1\]"),
    ]:
        with pytest.raises(ValueError, match=message):
            _core.fit([(good, good, None)], tau, [1.0], [[1]], **keywords)


FOLDED = 1e-13  # relative to the largest sum of products: rounding of sums of so many readings


@pytest.mark.parametrize("weighted", [False, True])
@pytest.mark.parametrize("argument", ["reference", "indicated"])
@pytest.mark.parametrize("count", [300, 60_000])
def test_folds_are_the_readings_between_their_ends(count, argument, weighted):
    seed = int(np.random.SeedSequence().entropy % 2**32)
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    period, orders, zero = 360.0, [[1, 2, 7]], 12.0
    reference = rng.uniform(-50.0, 700.0, count)  # more than one turn, in no order
    indicated = reference + zero + np.sin(np.radians(reference)) + rng.normal(0.0, 0.1, count)
    weights = rng.uniform(0.5, 2.0, count) * (rng.random(count) > 0.1) if weighted else None
    angle = reference if argument == "reference" else indicated
    # Of two ends nearly nothing lies between, and nothing beyond the last.
    ends = [0.0, 150.0, 150.01, 400.0, 2000.0]
    run = (reference, indicated, weights)
    found = _core.folds(run, period, [1.0], orders, argument, ends, zero)
    assert len(found) == len(ends) + 1
    place = np.searchsorted(ends, angle, side="left")
    design = np.column_stack(
        [np.ones(count), design_matrix(angle, period, [1.0], orders), indicated - reference - zero]
    )
    given = np.ones(count) if weights is None else weights
    for fold, (triangle, weight) in enumerate(found):
        rows, w = design[place == fold], given[place == fold]
        wanted = rows.T @ (w[:, None] * rows)
        assert weight == pytest.approx(w.sum(), rel=FOLDED)
        assert np.abs(triangle.T @ triangle - wanted).max() <= FOLDED * count
        assert np.array_equal(triangle, np.triu(triangle))


def test_folds_name_the_reading_that_is_not_finite():
    angle = np.linspace(0.0, 300.0, 50)
    angle[7] = np.nan
    with pytest.raises(ValueError, match=r"indicated\[7\]"):
        _core.folds(
            (np.linspace(0.0, 300.0, 50), angle, None),
            360.0,
            [1.0],
            [[1]],
            "reference",
            [90.0],
            0.0,
        )


def test_a_penalty_needs_no_second_look_at_the_readings():
    seed = int(np.random.SeedSequence().entropy % 2**32)
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    runs = []
    for count in (400, 90):
        theta = rng.uniform(0.0, 200.0, count)
        error = np.cos(np.radians(theta)) + rng.normal(0.0, 0.1, count)
        runs.append((theta, theta + error, rng.uniform(0.5, 2.0, count)))
    ridge = [3.0, 0.5, 2.0, 0.1]
    plain = _core.fit(runs, 360.0, [1.0], [[1, 2]])
    again = plain.penalised(ridge)
    wanted = _core.fit(runs, 360.0, [1.0], [[1, 2]], ridge=ridge)
    for name in ("offsets", "offset_std", "constant", "cosine", "sine", "covariance"):
        assert np.array_equal(getattr(again, name), getattr(wanted, name)), name
    assert again.residual_variance == wanted.residual_variance
    assert again.degrees_of_freedom == wanted.degrees_of_freedom != plain.degrees_of_freedom
    with pytest.raises(ValueError, match="ridge"):
        plain.penalised([1.0])


@pytest.mark.parametrize(("size", "highest"), [(3000, 300), (5000, 450)])
def test_many_orders_of_few_readings_take_moments_and_agree_with_numpy(size, highest):
    """Two readings in a segment: QR of rows would cost size * (2 highest + 1)^2."""
    rng = np.random.default_rng(size)
    x = rng.uniform(0.0, 360.0, size)
    e = np.cos(np.radians(x - 20.0)) + 0.1 * rng.normal(size=size)
    found = _core.fit([(x, x + e, None)], 360.0, [1.0], [list(range(1, highest + 1))])
    assert found.method == "moments"
    phase = np.radians(np.outer(x, np.arange(1, highest + 1)))
    columns = np.column_stack([np.ones(size), np.cos(phase), np.sin(phase)])
    expected = np.linalg.lstsq(columns, e, rcond=None)[0]
    got = np.concatenate([[found.constant], found.cosine[0], found.sine[0]])
    np.testing.assert_allclose(got, expected, rtol=0, atol=1e-12 * np.abs(expected).max())
