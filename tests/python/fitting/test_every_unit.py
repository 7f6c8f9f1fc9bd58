"""Whole fits in degrees, turns, radians and counts, mirrored and reordered: one result."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import t

import trueangle as ta
from trueangle.fitting.phases import run_phases
from trueangle.fitting.robust import _between_neighbours
from trueangle.fitting.uncertainty import Uncertainty, _with_constant

SEED = 64_000
UNITS = (1.0, 2.0 * np.pi, 4096.0)

#: Relative: rounding of angles of some turns in another unit, through a solution of least squares;
#: of orders that nearly cancel on an arc by as much more.
SAME, NEARLY = 1e-9, 1e-5


def walk(rng: np.random.Generator, n: int, memory: float) -> np.ndarray:
    """Noise of deviation 1 of which each value remembers so much of the one before."""
    values = rng.normal(size=n) * np.sqrt(1.0 - memory**2)
    for k in range(1, n):
        values[k] += memory * values[k - 1]
    return values


def moved(rng: np.random.Generator, speed: float, n: int, drift: float = 0.0):
    """There and back over two turns: ramp, play, delay and a slow drift, in degrees."""
    time = np.linspace(0.0, 1440.0 / speed, n)
    theta = 720.0 - np.abs(720.0 - speed * time)
    velocity = speed * np.sign(720.0 - speed * time + 1e-9)
    error = 0.1 * np.sin(np.radians(theta + 30.0)) + 0.03 * np.cos(np.radians(3.0 * theta))
    error += 3e-5 * theta + 0.01 * np.sign(velocity) - 2e-4 * velocity
    error += drift * np.sin(2.0 * np.pi * time / time[-1] + 0.4) + 2e-3 * rng.normal(size=n)
    return theta, error, {"time": time, "velocity": velocity}


def still(rng: np.random.Generator, memory: float, n: int = 200, stop: float = 360.0):
    theta = np.linspace(0.0, stop, n, endpoint=False)
    error = 0.1 * np.sin(np.radians(theta + 30.0)) + 0.03 * np.cos(np.radians(2.0 * theta))
    return theta, error + 0.01 * walk(rng, n, memory), {}


def outlying(rng: np.random.Generator):
    theta, error, more = still(rng, 0.0)
    error[[20, 77, 150]] += [0.5, -0.4, 3.0]
    return theta, error, {**more, "weights": rng.uniform(0.5, 2.0, theta.size)}


def homed(rng: np.random.Generator, zero: float):
    """A reference with a zero of its own in every run; the pattern stays with the joint."""
    theta, error, more = still(rng, 0.0)
    return theta - zero, error + zero, more


FITS = {
    "nuisances": (
        lambda rng: [moved(rng, v, 300) for v in (20.0, 60.0)],
        {"orders": [1, 3], "nuisance": "ramp,direction,velocity"},
    ),
    "drift": (
        lambda rng: [moved(rng, 30.0, 300, 0.01)],
        {"orders": [1, 3], "nuisance": "drift,ramp"},
    ),
    "chosen": (lambda rng: [moved(rng, v, 300) for v in (20.0, 60.0)], {"orders": [1, 3]}),
    "clusters": (lambda rng: [still(rng, 0.97) for _ in range(9)], {"orders": [1, 2]}),
    "stretches": (
        lambda rng: [still(rng, 0.5, 800) for _ in range(2)],
        {"orders": [1, 2], "covariance": "correlated"},
    ),
    "ridge": (
        lambda rng: [still(rng, 0.0, 120, 100.0) for _ in range(3)],
        {"orders": [1, 2, 3, 4]},
    ),
    "outliers": (lambda rng: [outlying(rng) for _ in range(3)], {"orders": [1, 2]}),
    "homed": (lambda rng: [homed(rng, zero) for zero in (0.0, 40.0, 95.0)], {"orders": [1, 2]}),
    "orders": (lambda rng: [still(rng, 0.0) for _ in range(4)], {}),
}


def runs_of(kind: str, period: float = 360.0, sign: float = 1.0) -> list[ta.CalibrationRun]:
    rng = np.random.default_rng([SEED, len(kind)])
    scale = sign * period / 360.0
    found = []
    for k, (theta, error, more) in enumerate(FITS[kind][0](rng)):
        more = {n: v * (scale if n == "velocity" else 1.0) for n, v in more.items()}
        zero = 0.2 * k
        found.append(
            ta.CalibrationRun(
                scale * theta, scale * (theta + error + zero), period, label=f"r{k}", **more
            )
        )
    return found


def numbers(value: object) -> list[float]:
    if isinstance(value, dict):
        return [n for key in sorted(value) for n in numbers(value[key])]
    if isinstance(value, list | tuple):
        return [n for one in value for n in numbers(one)]
    return [float(value)] if isinstance(value, int | float) else []


def told(found: ta.FitResult) -> tuple[list[float], str]:
    """Numbers of a result and all its words, but of its travel, which is told in its unit."""
    plain = found.to_dict()
    notes = " ".join(plain.pop("notes"))
    # Places are those of runs in their order.
    plain["wild"] = len(plain["wild"])
    return numbers(plain), re.sub(r"Fitted on [^:]*", "", notes)


@pytest.mark.parametrize("kind", FITS)
def test_every_unit_gives_one_result(kind: str) -> None:
    options = FITS[kind][1]
    one, same = ta.fit(runs_of(kind), **options), NEARLY if kind == "ridge" else SAME
    plain, words = told(one)
    for period in UNITS:
        found = ta.fit(runs_of(kind, period), **options)
        values, said = told(found)
        np.testing.assert_allclose(values, plain, rtol=same, atol=1e-6)
        assert said == words
        intervals = 360.0 / period * found.interval(0.9)
        np.testing.assert_allclose(intervals, one.interval(0.9), rtol=same, atol=1e-9)


@pytest.mark.parametrize("kind", [kind for kind in FITS if kind != "drift"])
def test_the_order_of_runs_does_not_matter(kind: str) -> None:
    runs, options = runs_of(kind), FITS[kind][1]
    one, other = (told(ta.fit(each, **options)) for each in (runs, runs[::-1]))
    np.testing.assert_allclose(other[0], one[0], rtol=NEARLY, atol=1e-6)
    assert other[1] == one[1]


@pytest.mark.parametrize("kind", FITS)
def test_a_mirrored_joint_has_the_mirrored_result(kind: str) -> None:
    """Cosines change their sign; errors, sizes and what is said of them stay."""
    options = FITS[kind][1]
    one, other = (ta.fit(runs_of(kind, sign=sign), **options) for sign in (1.0, -1.0))
    mirrored = np.array([-1.0, 1.0] * len(one.orders))
    a, b = (np.ravel([[*zip(s.cosine, s.sine, strict=True)] for s in fit.model.shafts])
            for fit in (one, other))  # fmt: skip
    np.testing.assert_allclose(b, mirrored * a, atol=1e-8)
    signs = np.array([-1.0, *mirrored])
    np.testing.assert_allclose(
        other.covariance, np.outer(signs, signs) * one.covariance, rtol=1e-4, atol=1e-12
    )
    np.testing.assert_allclose(other.freedom, one.freedom, rtol=1e-6)
    np.testing.assert_allclose(other.amplitude_std, one.amplitude_std, rtol=1e-5)
    np.testing.assert_allclose(other.phase_std, one.phase_std, rtol=1e-5)


def test_what_was_taken_out_is_told_with_its_size_and_sign() -> None:
    """As it was put in: 30 ppm, 36 arcsec either way, a delay of 0.2 ms."""
    found = ta.fit(runs_of("nuisances"), orders=[1, 3], nuisance="ramp,direction,velocity")
    said = " ".join(found.notes)
    for pattern, wanted, about in (
        (r"a ramp of (\S+) ppm", 30.0, 3.0),
        (r"a reversal error of \+-(\S+) arcsec", 36.0, 4.0),
        (r"an error of (\S+) ms times the velocity", -0.2, 0.02),
    ):
        assert float(re.search(pattern, said)[1]) == pytest.approx(wanted, abs=about)


@pytest.mark.parametrize("argument", ["reference", "indicated"])
@pytest.mark.parametrize("period", [360.0, 1.0])
def test_phases_of_runs_are_those_of_each_alone(argument: str, period: float) -> None:
    """Amplitudes in arcsec; of a joint's own reading where the fit is of that."""
    runs = runs_of("outliers", period)[:2]
    fit = ta.fit(runs, orders=[1, 2], argument=argument)
    found = run_phases(fit)
    assert [one.labels for one in found] == 2 * [("r0", "r1")]
    for number, run in enumerate(runs):
        alone = ta.fit(run, orders=[1, 2], argument=argument)
        for k, one in enumerate(found):
            wanted = alone.amplitudes[k] * 1_296_000.0 / period
            assert one.amplitude[number] == pytest.approx(wanted, rel=1e-9)
            assert one.phase[number] == pytest.approx(alone.phases[k], abs=1e-9)
            # To 0.1 and 0.03 degrees of 200 readings of 0.01.
            assert one.amplitude[number] == pytest.approx((360.0, 108.0)[k], abs=4.5 * 3.6)
    # One without a name has its number, from 1.
    unnamed = ta.fit([replace(run, label="") for run in runs], orders=[1])
    assert run_phases(unnamed)[0].labels == ("1", "2")


def test_a_reference_that_is_homed_anew_is_told_by_how_much() -> None:
    found = ta.fit(runs_of("homed", 1.0), orders=[1, 2])
    assert found.model.argument == "indicated"
    (said,) = re.findall(r"\(by up to (\S+) deg\)", " ".join(found.notes))
    assert float(said) == pytest.approx(95.0 + 0.4, abs=0.1)


@pytest.mark.parametrize("kind", ["clusters", "outliers"])
@pytest.mark.parametrize("level", [0.5, 0.95])
def test_intervals_are_students_about_the_value(kind: str, level: float) -> None:
    """Two-sided, with the degrees of freedom of each."""
    fit = ta.fit(runs_of(kind), **FITS[kind][1])
    low, high = fit.interval(level).T
    times = t.ppf(0.5 + 0.5 * level, fit.freedom)
    np.testing.assert_allclose(high - low, 2.0 * times * np.sqrt(np.diag(fit.covariance)))
    np.testing.assert_allclose(0.5 * (high + low)[0], fit.model.constant)


def test_the_constant_is_wider_by_as_much_as_the_coefficients_in_the_middle() -> None:
    white = np.diag([1.0, 1.0, 1.0, 1.0])
    freedom = np.array([5.0, 7.0, 11.0])
    wide, free = _with_constant(white, np.diag([4.0, 9.0, 16.0]), freedom)
    np.testing.assert_allclose(np.diag(wide), [9.0, 4.0, 9.0, 16.0])
    assert free.tolist() == [7.0, 5.0, 7.0, 11.0]
    narrow, _ = _with_constant(white, np.diag([0.04, 0.09, 0.16]), freedom)
    np.testing.assert_allclose(np.diag(narrow), [1.0, 0.04, 0.09, 0.16])


@pytest.mark.parametrize("covariance", ["white", "cluster"])
@pytest.mark.parametrize("ridge", [0.01, 1.0])
def test_every_reading_twice_is_no_other_ridge(covariance: str, ridge: float) -> None:
    """A penalty is one for each reading: what it takes, and may have taken, stays."""
    runs = runs_of("ridge")
    twice = [
        ta.CalibrationRun(np.repeat(r.reference, 2), np.repeat(r.indicated, 2), 360.0) for r in runs
    ]
    options = {"orders": [1, 2, 3, 4], "ridge": ridge, "covariance": covariance}
    one, other = ta.fit(runs, **options), ta.fit(twice, **options)
    np.testing.assert_allclose(other.amplitudes, one.amplitudes, rtol=1e-6)
    # A ridge so large that its bias is nearly all; which patterns are likely twice as many tell
    # a little better.
    np.testing.assert_allclose(other.amplitude_std, one.amplitude_std, rtol=0.1)
    by_runs = [ta.fit(r, **{**options, "ridge": 1e-6}) for r in (runs, twice)]
    if covariance == "cluster":
        np.testing.assert_allclose(by_runs[1].amplitude_std, by_runs[0].amplitude_std, rtol=0.05)


def test_neighbours_differ_by_the_noise_whatever_the_model_lacks() -> None:
    """An order of 0.5 that is not fitted, in noise of 0.01: to 4.5 errors of a median of 4000."""
    theta = np.linspace(0.0, 360.0, 4000, endpoint=False)
    rng = np.random.default_rng(SEED)
    error = 0.1 * np.sin(np.radians(theta)) + 0.5 * np.sin(np.radians(2.0 * theta))
    run = ta.CalibrationRun(theta, theta + error + 0.01 * rng.normal(size=4000), 360.0)
    found = ta.fit(run, orders=[1])
    between = _between_neighbours(found.problem, [found.residuals])
    assert between == pytest.approx(0.01, rel=4.5 * 1.17 / np.sqrt(4000.0))


def test_an_amplitude_has_the_fewer_degrees_of_freedom(monkeypatch: pytest.MonkeyPatch) -> None:
    fit = ta.fit(runs_of("outliers"), orders=[1, 2])
    freedom = np.array([9.0, 3.0, 8.0, 7.0, 4.0])
    monkeypatch.setattr(type(fit), "freedom", property(lambda _: freedom))
    wide = 0.5 * np.diff(fit.amplitude_interval(0.9), axis=1)[:, 0]
    np.testing.assert_allclose(wide, t.ppf(0.95, [3.0, 4.0]) * fit.amplitude_std)


def test_a_known_bias_adds_to_the_variance_and_to_its_freedom() -> None:
    """Welch and Satterthwaite with a part that is known: (a + b)^2 / (a^2 / n)."""
    noise = Uncertainty("white", np.diag([4.0, 1.0, 0.0]), np.array([10.0, 20.0, 30.0]))
    found = noise.beside(np.diag([4.0, 2.0, 5.0]))
    np.testing.assert_allclose(np.diag(found.covariance), [8.0, 3.0, 5.0])
    np.testing.assert_allclose(found.freedom[:2], [10.0 * 4.0, 20.0 * 9.0])
    assert found.fewest == noise.fewest == 10.0


def test_an_amplitude_and_its_phase_have_the_errors_of_their_draws() -> None:
    """Rotated covariance: along the amplitude and across it, of 4000 draws to 4.5 errors."""
    fit = ta.fit(runs_of("ridge"), orders=[1, 2, 3, 4])
    rng = np.random.default_rng(SEED)
    model = fit.model.shafts[0]
    mean = np.ravel([*zip(model.cosine, model.sine, strict=True)])
    # Of a hundredth of the covariance, so that amplitudes are normal.
    spread = 1e-4 * fit.covariance[1:, 1:]
    drawn = rng.multivariate_normal(mean, spread, 4000, method="eigh").reshape(-1, 4, 2)
    sizes = np.hypot(drawn[..., 0], drawn[..., 1])
    phases = np.unwrap(np.arctan2(drawn[..., 0], drawn[..., 1]), axis=0)
    about = 4.5 / np.sqrt(2.0 * 4000.0)
    np.testing.assert_allclose(100.0 * sizes.std(axis=0), fit.amplitude_std, rtol=about + 0.01)
    np.testing.assert_allclose(100.0 * phases.std(axis=0), fit.phase_std, rtol=about + 0.01)


@pytest.mark.filterwarnings("ignore::trueangle.errors.UnlikeRunsWarning")
def test_labels_of_runs_stay_where_one_without_a_label_holds_no_order() -> None:
    """A run without a label is called by its place among all runs, not among those that remain."""
    rng = np.random.default_rng(SEED)
    sizes = {0: 0.1, 2: 0.2, 3: 0.3}
    runs = []
    for k, label in enumerate(("", "", "third", "")):
        theta = np.linspace(7.0 * k, 360.0 + 7.0 * k, 3 if k == 1 else 90, endpoint=False)
        error = sizes.get(k, 0.1) * np.sin(np.radians(theta)) + 1e-4 * rng.normal(size=theta.size)
        runs.append(ta.CalibrationRun(theta, theta + error, 360.0, label=label))
    (first, _) = run_phases(ta.fit(runs, [1, 2], loss="linear"))
    assert first.labels == ("1", "third", "4")
    np.testing.assert_allclose(first.amplitude / 3600.0, list(sizes.values()), atol=1e-3)
