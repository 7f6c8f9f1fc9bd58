"""Numbers of the tests of what is left, against scipy and against matrices written out."""

import numpy as np
import pytest
from scipy import stats

from trueangle.diagnosis.goodness import Leftover
from trueangle.diagnosis.goodness.noise import _independent, _PatternProducts, _Sums, estimate_noise
from trueangle.diagnosis.goodness.periodogram import _whitened, periodogram
from trueangle.diagnosis.goodness.place import _smallest, unit_sums
from trueangle.diagnosis.goodness.scatter import normal_kurtosis, scatter_of_repeats
from trueangle.effects.search import golden_maximum

from . import readings as made

SEED = 71
BOUNDS = [(0, 30), (30, 75), (75, 120)]
N = 120


def rng():
    print(f"seed {SEED}")
    return np.random.default_rng(SEED)


def about_means(values):
    out = np.array(values, dtype=float)
    for a, b in BOUNDS:
        out[a:b] -= out[a:b].mean(axis=0)
    return out


def leftover(residual, theta=None):
    run = np.repeat(np.arange(3), [b - a for a, b in BOUNDS])
    theta = np.linspace(0.0, 9.0, N) if theta is None else theta
    return Leftover(residual, theta, np.ones(N), run, np.arange(float(N)))


@pytest.mark.parametrize("n", [30, 400, 5000])
@pytest.mark.parametrize("law", ["standard_normal", "standard_cauchy", "random"])
def test_tails_are_those_of_scipy(n, law):
    values = getattr(rng(), law)(n)
    d = values - values.mean()
    found = normal_kurtosis(float(np.mean(d**4) / np.mean(d**2) ** 2), float(n))
    assert found == pytest.approx(stats.kurtosistest(values).statistic, rel=1e-9)


@pytest.mark.parametrize("rho", [0.0, 0.4, -0.3, 0.9])
def test_products_of_correlated_noise_are_those_of_its_inverse(rho):
    chance = rng()
    x, e = chance.normal(size=(N, 3)), chance.normal(size=N)
    sums = _Sums(_PatternProducts(x, BOUNDS), e)
    # Of one innovation of variance 1: a stationary chain in every run.
    covariance = np.zeros((N, N))
    for a, b in BOUNDS:
        lag = np.abs(np.subtract.outer(np.arange(a, b), np.arange(a, b)))
        covariance[a:b, a:b] = rho**lag / (1.0 - rho**2)
    whole = np.column_stack([_PatternProducts(x, BOUNDS).x, e])
    expected = whole.T @ np.linalg.solve(covariance, whole)
    np.testing.assert_allclose(sums.products(rho), expected, rtol=0, atol=1e-9)
    rest, freedom = sums.fitted(rho, 3)
    gram, moment = expected[:-1, :-1], expected[:-1, -1]
    left = expected[-1, -1] - moment @ np.linalg.solve(gram, moment)
    assert (rest, freedom) == (pytest.approx(left, rel=1e-9), N - 3 - 3)


def test_columns_made_independent_span_the_same():
    x = rng().normal(size=(N, 3)) * [1.0, 1e3, 1e-3]
    found = _independent(np.column_stack([x, x @ [1.0, 2.0, 3.0]]))
    assert found.shape == (N, 3)
    np.testing.assert_allclose(found.T @ found, np.eye(3), rtol=0, atol=1e-9)
    np.testing.assert_allclose(found @ (found.T @ x), x, rtol=1e-9, atol=1e-9)


def test_a_peak_is_found():
    place, value = golden_maximum(lambda t: 2.0 - (t - 0.3) ** 2, -1.0, 1.0, 16)
    assert place == pytest.approx(0.3, abs=2e-3)
    assert value == pytest.approx(2.0, abs=1e-5)


@pytest.mark.parametrize("within", [True, False])
def test_a_modulator_alone_is_a_slope_and_its_t_test(within):
    """Within runs where it changes in them, else between them."""
    chance = rng()
    per_run = np.repeat([-0.7, 0.2, 1.1], [b - a for a, b in BOUNDS])
    g = chance.normal(size=N) + per_run if within else per_run
    zeros = np.repeat([0.5, -0.4, 0.1] if within else [0.5] * 3, [b - a for a, b in BOUNDS])
    units = [(a, (a + b) // 2) for a, b in BOUNDS] + [((a + b) // 2, b) for a, b in BOUNDS]
    units.sort()
    exact = unit_sums(g, leftover(0.3 * g + zeros), units)
    if within:
        assert exact.size == pytest.approx(0.3, rel=1e-9)
    found = unit_sums(g, leftover(0.3 * g + zeros + chance.normal(size=N)), units)
    t = stats.ttest_1samp(found.sums, 0.0)
    assert found.chance() == pytest.approx(t.pvalue, rel=1e-9)
    signs = np.array([1.0, -1.0, 1.0, 1.0, -1.0, 1.0])
    assert found.chance(signs) == pytest.approx(stats.ttest_1samp(found.sums * signs, 0.0).pvalue)


def test_a_modulator_that_tells_nothing_has_no_size():
    g = np.ones(N)
    units = [(a, b) for a, b in BOUNDS]
    assert unit_sums(g, leftover(rng().normal(size=N)), units).chance() == 1.0


def test_evidence_of_an_order_is_its_share_of_the_units():
    """Of one order that all units agree on: Hotelling's share, and no more than chance allows."""
    chance = rng()
    w = chance.normal(size=(40, 6, 2)) @ [1.0, 1.0j] / np.sqrt(2.0)
    w[11] = np.exp(0.3j) * chance.uniform(0.9, 1.1, 6)
    p, statistic, band, k, logs = _smallest(w, None, np.ones(6))
    coherent, own = abs(w[11].sum()) ** 2, (np.abs(w[11]) ** 2).sum()
    assert k == 11
    assert logs[11] == pytest.approx(min(coherent / 6, -5 * np.log1p(-coherent / (6 * own))))
    assert 0.0 < p <= 1.0
    # The same units with signs that cancel do not agree.
    cancel = np.array([1.0, -1.0, 1.0, -1.0, 1.0, -1.0])
    assert _smallest(w, None, cancel)[4][11] < 0.1 * logs[11]
    sums = np.cumsum(logs)
    if band > 0.0:
        assert statistic == pytest.approx(sums[int(band) - 1] / band)


@pytest.mark.parametrize("even", [True, False])
@pytest.mark.parametrize("amplitude", [3.0, 12.0])
def test_a_line_is_told_by_its_frequency_and_amplitude(even, amplitude):
    chance = rng()
    bounds = [(0, 400), (400, 900)]
    clock = np.concatenate([np.arange(n) * 0.1 for n in (400, 500)])
    if not even:
        clock = np.concatenate([np.sort(chance.uniform(0.0, 0.1 * n, n)) for n in (400, 500)])
    phase = np.repeat([0.4, 2.9], [400, 500])
    values = amplitude * np.cos(2.0 * np.pi * 0.83 * clock + phase) + chance.normal(size=900)
    found = periodogram(values, clock, bounds)
    assert found.even is even
    assert found.peak == pytest.approx(0.83, abs=0.5 / 50.0)
    assert found.amplitude == pytest.approx(amplitude, rel=0.08)
    assert found.p < 1e-6
    assert found.power.size == found.frequency.size
    assert found.statistic == pytest.approx(found.power.max(), rel=1e-9) or found.width > 1


def test_of_noise_alone_the_power_is_one_and_p_no_less_than_its_chance():
    """Widths share readings, so that p is on the safe side: a half is reached, a tenth seldom."""
    chance = rng()
    bounds = [(0, 200), (200, 400), (400, 600)]
    clock = np.concatenate([np.sort(chance.uniform(0.0, 60.0, 200)) for _ in bounds])
    made = [periodogram(chance.normal(size=600), clock, bounds) for _ in range(60)]
    assert np.mean([found.power.mean() for found in made]) == pytest.approx(1.0, abs=0.03)
    p = np.array([found.p for found in made])
    # Four standard deviations of a binomial count beyond a tenth of 60.
    assert np.sum(p < 0.1) <= 6 + 4.0 * np.sqrt(60 * 0.1 * 0.9)
    assert 2 <= np.sum(p < 0.5) <= 30 + 4.0 * np.sqrt(60 * 0.5 * 0.5)


@pytest.mark.parametrize("even", [True, False])
@pytest.mark.parametrize("span", [0.5, 40.0])
def test_lines_are_looked_for_from_five_resolution_cells_over_four_at_least(even, span):
    clock = np.linspace(0.0, span, 200)
    if not even:
        clock[1:-1] = np.sort(rng().uniform(0.0, span, 198))
    noise = rng().normal(size=200)
    # A cell is one period over the record; the steps of the transform round by half of one.
    assert periodogram(noise, clock, [(0, 200)], top=8.4 / span) is None
    found = periodogram(noise, clock, [(0, 200)], top=9.6 / span)
    cells = found.frequency * span
    assert found.even is even
    assert 5.0 <= cells[0] < 5.5
    assert 9.0 < cells[-1] <= 9.6


@pytest.mark.parametrize("correlation", [-0.1, -0.024, -0.016, -0.008, 0.0, 0.008, 0.1, 0.4])
def test_the_error_of_a_correlation_is_that_of_so_many_pairs(correlation):
    """Whatever it is found to be, none or below none too: (1 - rho^2) / n is its variance."""
    size, wave = 3000, rng().normal(size=3000)
    for k in range(1, size):
        wave[k] = correlation * wave[k - 1] + np.sqrt(1.0 - correlation**2) * wave[k]
    theta = np.sort(rng().uniform(0.0, 12.0, size))
    left = Leftover(wave, theta, np.ones(size), np.zeros(size, dtype=np.int64), np.arange(size))
    found = estimate_noise(left)
    assert found.root * correlation >= 0.0 or abs(correlation) < 0.1
    # 25 columns of a pattern and the estimate itself: a few percent.
    rho = max(correlation, 0.0)
    assert found.std == pytest.approx(np.sqrt((1.0 - rho**2) / size), rel=0.05)


@pytest.mark.parametrize("correlation", [-0.6, 0.3, 0.95])
def test_readings_are_whitened_as_the_covariance_of_neighbours_says(correlation):
    """The triangle of its inverse, row by row: the first reading stands for itself."""
    e = rng().normal(size=40)
    lags = np.abs(np.subtract.outer(np.arange(40), np.arange(40)))
    over = np.linalg.inv(np.linalg.cholesky(correlation**lags))
    white = np.sqrt(1.0 - correlation**2) * over @ e
    np.testing.assert_allclose(_whitened(e, correlation), white - white.mean(), atol=1e-9)
    assert _whitened(e, 0.0) is e


@pytest.mark.parametrize(
    ("readings", "spread", "highest"),
    [
        # Half of the rate of even readings; 60 times the mean rate of others, up to 2^16 cells of
        # which a period takes four.
        (400, 0.0, 0.5 * 40.0),
        (100, 0.9, 60.0 * 10.0),
        (1000, 0.9, 2.0**16 / 40.0),
    ],
)
def test_frequencies_go_as_far_as_readings_and_cells_resolve_them(readings, spread, highest):
    chance = rng()
    step = 10.0 / readings
    axis = step * (np.arange(readings) + spread * chance.uniform(-0.5, 0.5, readings))
    axis[-1] = axis[0] + 10.0
    found = periodogram(chance.normal(size=readings), axis, [(0, readings)])
    assert found.even == (spread == 0.0)
    assert found.frequency[-1] == pytest.approx(highest, rel=0.02)
    # From five resolution cells on, in steps of half a cell or less; no further than is asked.
    assert found.frequency[0] == pytest.approx(0.5, abs=0.06)
    assert np.diff(found.frequency).max() <= 0.05 + 1e-9
    less = periodogram(chance.normal(size=readings), axis, [(0, readings)], top=7.0)
    assert less.frequency[-1] == pytest.approx(7.0, rel=0.02)


def test_repeats_scatter_about_the_mean_of_their_place_and_direction():
    """Group by group, the zeros of the runs left out."""
    left = made.leftover("grid", "gauss", 7_901)
    e = left.residual.copy()
    for start, stop in left.bounds:
        e[start:stop] -= e[start:stop].mean()
    groups: dict[tuple[float, float], list[float]] = {}
    places = np.round(np.mod(np.degrees(left.theta), 360.0), 3) % 360.0
    for place, direction, value in zip(places, left.direction, e, strict=True):
        groups.setdefault((float(place), float(direction)), []).append(float(value))
    freedom = sum(len(group) - 1 for group in groups.values()) - (len(left.bounds) - 1)
    power = sum(float(np.var(group)) * len(group) for group in groups.values())
    found = scatter_of_repeats(left)
    assert found is not None
    assert found == pytest.approx((np.sqrt(power / freedom), freedom))
    assert {direction for _, direction in groups} == {-1.0, 1.0}
