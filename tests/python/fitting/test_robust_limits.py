"""Where robust fits draw their lines: constants by their definitions, shares from both sides."""

import math
from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import norm

import trueangle as ta
from trueangle.fitting import robust
from trueangle.fitting.robust import RobustFit, fit_robustly, fit_without_outliers
from trueangle.runs import outliers
from trueangle.runs.outliers import robust_scale

SEED = 88_127
X = np.linspace(-9.0, 9.0, 200_001)
DENSITY = norm.pdf(X) * (X[1] - X[0])


def test_constants_are_those_of_normal_readings():
    """Efficiency of 95 %, deviations of one, shares as the comments and messages have them."""
    u = X / robust.TUKEY
    psi = np.where(np.abs(u) < 1.0, X * (1.0 - u**2) ** 2, 0.0)
    rise = np.where(np.abs(u) < 1.0, (1.0 - u**2) * (1.0 - 5.0 * u**2), 0.0)
    assert (DENSITY @ rise) ** 2 / (DENSITY @ psi**2) == pytest.approx(0.95, abs=1e-3)
    assert norm.ppf(0.75) == pytest.approx(1.0 / outliers.MAD_TO_SIGMA, abs=1e-5)
    assert f"{200.0 * norm.sf(robust.FAR):.1f} %" == "0.7 %"
    assert 2e12 * norm.sf(outliers.WILD) < 1.0 < 2e12 * norm.sf(outliers.WILD - 1.0)


def fixed(rest, base=None, angles=None, **more):
    """A problem whose residuals are the same whatever is asked of it."""
    runs = [np.zeros(r.size) for r in rest]
    size = sum(r.size for r in rest)
    base = [None] * len(rest) if base is None else base
    counted = np.concatenate(
        [r if b is None else r[b > 0.0] for r, b in zip(rest, base, strict=True)]
    )
    values = {
        "runs": runs, "base": base, "angles": angles, "period": 360.0, "readings": size,
        "unknowns": 3, "solve": lambda weights, watch=False: weights, "residuals": lambda _: rest,
        "scan": lambda _: (counted, math.inf), "largest": lambda _: np.abs(counted).max(),
    } | more  # fmt: skip
    return SimpleNamespace(**values)


@pytest.mark.parametrize(("size", "share"), [(49, 0.0), (50, 0.1), (51, 5 / 51)])
def test_of_fewer_than_fifty_readings_no_share_is_told(size, share):
    print(f"seed {SEED}")
    rest = np.where(np.arange(size) % 2, 1.0, -1.0)
    rest[:5] = 2.71 * outliers.MAD_TO_SIGMA
    rest[5:10] = -2.69 * outliers.MAD_TO_SIGMA
    assert fit_without_outliers(fixed([rest]), 0) == (
        [None], None, 0, pytest.approx(share), 0
    )  # fmt: skip
    assert fit_without_outliers(fixed([rest]), 7)[2:4] == (7, pytest.approx(7 / size))


@pytest.mark.parametrize("absent", [0, 30])
@pytest.mark.parametrize(("wild", "aside"), [(1, True), (20, True), (21, False), (40, False)])
def test_a_fifth_of_the_readings_that_count_is_set_aside_and_not_more(wild, aside, absent):
    """Of 100; more are an effect that the model lacks. Each by its own run."""
    print(f"seed {SEED}")
    rest = np.where(np.arange(100) % 2, 1.0, -1.0)
    rest[:wild] *= 1000.0
    rest = np.concatenate([rest, np.full(absent, 5000.0)])
    weights = np.concatenate([np.full(100, 2.0), np.zeros(absent)])
    cut = 37
    problem = fixed([rest[:cut], rest[cut:]], [weights[:cut], weights[cut:]])
    found = fit_robustly(problem, "auto", 0.0)
    assert found.wild == (wild if aside else 0)
    if aside:
        assert found.far == pytest.approx(wild / 100.0)
        kept = np.where(np.abs(rest) > 100.0, 0.0, weights)
        assert [w.tolist() for w in found.weights] == [kept[:cut].tolist(), kept[cut:].tolist()]
    else:
        assert found.weights is None
    assert found.unsettled == 0


@pytest.mark.parametrize(("factor", "aside"), [(1.02, True), (0.98, False)])
@pytest.mark.parametrize(("far", "looks"), [(7, True), (6, False)])
def test_what_hid_is_set_aside_where_the_rest_is_five_times_quieter(far, looks, factor, aside):
    """Looked for only where more than 6 % lie far off; else the plain fit stands."""
    quiet = np.where(np.arange(100) % 2, 1.0, -1.0)
    before = 5.0 * factor * quiet
    before[:far] *= 5.0  # beyond 2.7 robust deviations, within 8
    after = quiet.copy()
    after[:far] *= 100.0

    def solve(weights, watch=False):
        return "plain" if watch else "robust"

    def scan(fitted):
        return (before, np.abs(before).max()) if fitted == "plain" else (quiet, 1.0)

    problem = fixed([after], solve=solve, scan=scan)
    found = fit_robustly(problem, "auto", 0.0)
    assert found.wild == (far if looks and aside else 0)


def of_ratio(ratio, count=4000):
    """Residuals whose scale is that many times what neighbours in angle differ by, shuffled."""
    rng = np.random.default_rng(SEED)
    angle = np.sort(rng.uniform(0.0, 360.0, count))
    noise, wave = rng.normal(0.0, 1.0, count), np.sin(np.radians(angle))

    def reached(size):
        rest = noise + size * wave
        steps = np.median(np.abs(np.diff(rest))) / math.sqrt(2.0)
        return np.median(np.abs(rest)) / steps, rest

    low, high = 0.0, 100.0
    for _ in range(60):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if reached(middle)[0] < ratio else (low, middle)
    order = rng.permutation(count)
    return angle[order] + 360.0 * rng.integers(-2, 3, count), reached(high)[1][order]


@pytest.mark.parametrize(
    ("ratio", "share", "robust_one", "told"),
    [
        (1.5, 0.05, False, ""),
        (1.5, 0.07, False, ""),
        (2.95, 0.07, False, ""),
        (3.1, 0.07, False, "it lacks"),
        (3.1, 0.05, False, ""),  # hardly any is far off: the model follows
        (3.1, 0.05, True, "it lacks"),
        (2.95, 0.149, True, ""),
        (2.95, 0.151, True, "15 %"),
        (3.1, 0.061, True, "6 %"),
        (3.1, 0.059, True, "it lacks"),
        (2.95, 0.20, False, ""),
    ],
)
@pytest.mark.parametrize("absent", [False, True])
def test_a_fit_says_where_readings_stand_together(ratio, share, robust_one, told, absent):
    print(f"seed {SEED}")
    angle, rest = of_ratio(ratio)
    base = None
    if absent:  # readings that do not count are far away, between all the others
        angle = np.concatenate([angle, np.linspace(0.0, 360.0, 4000)])
        rest = np.concatenate([rest, np.tile([900.0, -900.0], 2000)])
        base = np.concatenate([np.full(4000, 0.5), np.zeros(4000)])
    problem = fixed([rest], [base], [angle])
    found = robust.robust_breakdown_sentence(
        problem, RobustFit(None, [np.ones(1)] if robust_one else None, 0, share)
    )
    assert told in found
    assert bool(found) == bool(told)
    if told == "it lacks":
        assert found.startswith(f"neighbours in angle agree {ratio:g} times better")
        assert ("which a robust fit does not withstand" in found) == robust_one


@pytest.mark.parametrize(
    ("counts", "spike"), [(1, False), (2, False), (3, True), (-2, False), (-3, True)]
)
def test_a_reading_two_counts_off_its_neighbours_is_only_rounded(counts, spike):
    count = 360.0 / 4096.0
    reference = np.arange(0, 4096, 16) * count
    indicated = reference.copy()
    indicated[5::31] += count  # and a few by one, most by none
    indicated[70] += counts * count
    run = robust.without_spikes(ta.CalibrationRun(reference, indicated, 360.0))
    if spike:
        assert np.flatnonzero(run.weights == 0.0).tolist() == [70]
    else:
        assert run.weights is None


@pytest.mark.parametrize(("sizes", "spike"), [(6.8, False), (14.0, True)])
@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_on_a_slope_a_spike_is_eight_deviations_of_the_noise(sign, sizes, spike):
    print(f"seed {SEED}")
    rng = np.random.default_rng(SEED)
    count, noise, step = 4000, 1e-4, 0.97e-2
    reference = np.arange(count) * (360.0 / count)
    error = step * np.minimum(np.arange(count), count - np.arange(count))
    error = sign * error + rng.normal(0.0, noise, count)
    at = 700
    error[at] = sign * (step * at + sizes * noise)
    run = ta.CalibrationRun(reference, reference + error, 360.0)
    found = robust.without_spikes(run)
    assert robust_scale(np.diff(error, 2)) == pytest.approx(math.sqrt(6.0) * noise, rel=0.1)
    aside = () if found.weights is None else np.flatnonzero(found.weights == 0.0)
    # Beyond the noise of lines through two readings, which it has to be off as well.
    assert list(aside) == [at] * spike
