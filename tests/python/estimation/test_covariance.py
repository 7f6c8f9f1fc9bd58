"""Covariances that hold: intervals under white and correlated noise, bounded from both sides."""

import json

import numpy as np
import pytest
from scipy import linalg, optimize, special, stats

import trueangle as ta
from trueangle.cli import main
from trueangle.errors import ArgumentError
from trueangle.estimation.evidence import CORRELATION_TIMES, CorrelatedNoise
from trueangle.estimation.linear import (
    ClusterCovariance,
    NormalEquations,
    cluster_covariance,
    moderated_covariance,
)
from trueangle.support.distributions import student_quantile

#: Order, amplitude (deg), phase (deg).
LINES = ((1, 0.1, 30.0), (2, 0.05, 200.0), (5, 0.03, 100.0))
TRUE = np.ravel([[c * np.sin(np.radians(p)), c * np.cos(np.radians(p))] for _, c, p in LINES])
SIGMA = 0.02
#: Sets of a case, and the shares of intervals that hold the truth: 95 % within 3 standard
#: deviations of 360 coefficients. Errors 1.3 times too large or too small fall out.
SETS, LOW, HIGH = 60, 0.915, 0.985


def correlated(rng, memory, n):
    """AR(1) noise of variance 1, or (None) noise of spectrum 1/f."""
    if memory is None:
        f = np.fft.rfftfreq(4 * n)
        f[0] = f[1]
        x = np.fft.irfft((rng.normal(size=f.size) + 1j * rng.normal(size=f.size)) / np.sqrt(f))
        return x[:n] / x.std()
    e = rng.normal(size=n)
    for i in range(1, n):
        e[i] = memory * e[i - 1] + np.sqrt(1.0 - memory**2) * e[i]
    return e


def some_runs(seed, design, memory, count=8):
    rng = np.random.default_rng(seed)
    runs = []
    for r in range(count):
        if design == "grid":
            x = np.arange(72) * 5.0
        elif design == "arc":
            x = np.linspace(20.0, 300.0, 150)[:: 1 if r % 2 else -1]
        else:
            first = rng.uniform(0.0, 360.0)
            x = np.linspace(first, first + rng.uniform(300.0, 900.0), int(rng.integers(100, 300)))
        error = sum(c * np.sin(np.radians(k * x + p)) for k, c, p in LINES)
        error = error + SIGMA * correlated(rng, memory, x.size)
        runs.append(ta.CalibrationRun(x, x + error + rng.uniform(-5, 5), 360.0, label=f"r{r}"))
    return runs


def coverage(design, memory, **options):
    """Share of the coefficients in their 95 % intervals, and the kinds of covariance taken."""
    hit, kinds = [], []
    for seed in range(SETS):
        found = ta.fit(some_runs(seed, design, memory), orders=[1, 2, 5], **options)
        low, high = found.interval()[1:].T
        hit.append((low < TRUE) & (high > TRUE))
        kinds.append(found.uncertainty.kind)
    return float(np.mean(hit)), kinds


@pytest.mark.parametrize("design", ["grid", "arc", "sweeps"])
@pytest.mark.parametrize("memory", [0.0, 0.9, None])
def test_intervals_hold_the_truth_as_often_as_they_say(design, memory):
    found, kinds = coverage(design, memory)
    assert LOW <= found <= HIGH
    assert set(kinds) == {"cluster"}


def test_white_covariances_do_not_hold_under_correlated_noise():
    assert coverage("sweeps", 0.9, covariance="white")[0] < 0.75


def angles_of(rng, design, count):
    if design == "scattered":
        return rng.uniform(0.0, 360.0, count)
    there = np.linspace(0.0, 360.0, count // 2, endpoint=False)
    return (
        np.concatenate([there, there[::-1]])
        if design == "back"
        else 2.0 * np.r_[there[: count // 2], there + 360.0]
    )


@pytest.mark.parametrize("design", ["scattered", "sweep", "back"])
@pytest.mark.parametrize("memory", [0.0, 0.5, 0.9])
@pytest.mark.parametrize("count", [1, 2])
def test_intervals_of_one_and_two_runs_hold_in_noise_that_remembers(count, memory, design):
    """In the order of time: scattered places are known far better than those of a sweep."""
    hit, pulls, kinds = [], [], []
    for seed in range(SETS):
        rng = np.random.default_rng([61, count, seed])
        runs = []
        for _ in range(count):
            x = angles_of(rng, design, 300)
            error = sum(c * np.sin(np.radians(k * x + p)) for k, c, p in LINES)
            error = error + SIGMA * correlated(rng, memory, x.size)
            runs.append(ta.CalibrationRun(x, x + error, 360.0))
        found = ta.fit(runs, orders=[1, 2, 5])
        kinds.append(found.uncertainty.kind)
        low, high = found.interval()[1:].T
        hit.append((low < TRUE) & (high > TRUE))
        shaft = found.model.shafts[0]
        own = np.ravel(np.column_stack([shaft.cosine, shaft.sine]))
        pulls.append((own - TRUE) / np.sqrt(np.diag(found.covariance))[1:])
    pull = np.sqrt(np.mean(np.square(pulls)))
    print(f"{count} runs, {design}, {memory}: {100 * np.mean(hit):.1f} %, pull {pull:.2f}")
    assert np.mean(hit) >= LOW
    assert 0.65 < pull < 1.2
    assert kinds.count("white" if memory == 0.0 else "correlated") >= 0.95 * SETS
    assert any("does not show in" in note for note in found.notes) == (memory > 0.0)


def dense(noise, size):
    """Covariance of equally spaced readings, number by number."""
    apart = np.abs(np.subtract.outer(np.arange(size), np.arange(size)))[..., None]
    terms = noise.variances[1:] * np.exp(-apart / np.array(CORRELATION_TIMES))
    return noise.variances[0] * np.eye(size) + terms.sum(axis=-1)


def test_correlated_noise_moves_coefficients_as_its_matrix_does():
    """Weighted readings of two runs, all matrices written out."""
    rng = np.random.default_rng(62)
    runs, rows, left = [], [], []
    for size in (140, 90):
        x, weights = rng.uniform(0.0, 360.0, size), rng.uniform(0.5, 2.0, size)
        error = SIGMA * correlated(rng, 0.8, size) / np.sqrt(weights)
        runs.append(ta.CalibrationRun(x, x + error, 360.0, weights=weights))
    found = ta.fit(runs, orders=[1, 3], covariance="correlated", loss="linear")
    for run, rest in zip(runs, found.problem.residuals(found.fitted), strict=True):
        waves = np.radians(run.reference)[:, None] * [1.0, 3.0]
        columns = np.stack([np.cos(waves), np.sin(waves)], axis=2).reshape(len(waves), 4)
        columns -= np.average(columns, axis=0, weights=run.weights)
        rows.append(np.sqrt(run.weights)[:, None] * columns)
        left.append(np.sqrt(run.weights) * rest)
    noise = CorrelatedNoise.of(rows, left, found.residual_variance)
    inverse = np.linalg.inv(sum(x.T @ x for x in rows))
    own = inverse @ sum(x.T @ dense(noise, len(x)) @ x for x in rows) @ inverse
    np.testing.assert_allclose(np.diag(found.covariance)[1:], np.diag(own), rtol=1e-9)
    for x in rows:
        np.testing.assert_allclose(noise.covariance_times(x), dense(noise, len(x)) @ x, atol=1e-12)
    c = dense(noise, 140) - dense(noise, 140).min()
    freedom = np.trace(c) ** 2 / np.sum(c**2) / 140 * found.degrees_of_freedom
    np.testing.assert_allclose(found.uncertainty.freedom[1:], freedom, rtol=1e-9)


def test_the_odds_of_correlated_noise_are_those_of_two_normal_densities():
    """Coefficients and the zero of a run under a prior that is as good as flat."""
    rng = np.random.default_rng(63)
    x, y = rng.normal(size=(80, 2)), correlated(rng, 0.7, 80)
    noise = CorrelatedNoise.of([x], [y], 1.3)
    free = np.column_stack([x, np.ones(80)])
    logs = []
    for c in (dense(noise, 80), 1.3 * np.eye(80)):
        inverse = np.linalg.inv(c)
        gram = free.T @ inverse @ free
        off = y - free @ np.linalg.solve(gram, free.T @ inverse @ y)
        logs.append(-0.5 * (sum(np.linalg.slogdet(m)[1] for m in (c, gram)) + off @ inverse @ off))
    assert noise.odds == pytest.approx(logs[0] - logs[1], abs=1e-4)
    # Over a short arc columns are alike but for rounding.
    alike = np.column_stack([x, x[:, 0] + 1e-9 * x[:, 1]])
    assert CorrelatedNoise.of([alike], [y], 1.3).odds == pytest.approx(noise.odds, abs=1e-3)


def test_few_readings_say_that_they_cannot_tell():
    rng = np.random.default_rng(3)
    x = np.arange(72) * 5.0
    found = ta.fit(
        ta.CalibrationRun(x, x + 0.1 * np.sin(np.radians(x)) + 0.01 * rng.normal(size=72), 360.0),
        [1],
    )
    assert any("cannot show whether neighbours correlate" in note for note in found.notes)


def test_the_sandwich_is_that_of_the_readings_one_by_one():
    """CR2 and its degrees of freedom by dense matrices, as Bell and McCaffrey wrote them."""
    rng = np.random.default_rng(4)
    sizes = (12, 20, 30, 9)
    parts = [rng.normal(size=(n, 3)) for n in sizes]
    left = [rng.normal(size=n) for n in sizes]
    x = np.vstack(parts)
    inverse = np.linalg.inv(x.T @ x)
    hat = np.eye(len(x)) - x @ inverse @ x.T
    edges = np.cumsum((0, *sizes))
    meat, rows = np.zeros((3, 3)), []
    for part, e, a, b in zip(parts, left, edges[:-1], edges[1:], strict=True):
        values, vectors = np.linalg.eigh(hat[a:b, a:b])
        adjust = vectors @ np.diag(values**-0.5) @ vectors.T
        score = part.T @ adjust @ e
        meat += np.outer(score, score)
        rows.append(np.zeros((3, len(x))))
        rows[-1][:, a:b] = inverse @ part.T @ adjust
    found = cluster_covariance(
        [NormalEquations(p.T @ p, p.T @ e) for p, e in zip(parts, left, strict=True)]
    )
    np.testing.assert_allclose(found.covariance, inverse @ meat @ inverse, rtol=1e-9)
    for j in range(3):
        g = np.array([row[j] @ hat for row in rows])
        form = g @ g.T
        assert found.freedom[j] == pytest.approx(np.trace(form) ** 2 / np.sum(form**2), rel=1e-9)


def test_equal_runs_have_one_degree_of_freedom_less_than_runs():
    found = ta.fit(some_runs(1, "grid", 0.0), orders=[1, 2, 5], covariance="cluster")
    np.testing.assert_allclose(found.freedom, 7.0, rtol=1e-6)
    std = np.sqrt(np.diag(found.covariance))
    low, high = found.interval(0.99).T
    np.testing.assert_allclose(high - low, 2.0 * student_quantile(0.995, 7.0) * std, rtol=1e-6)
    assert "by the scatter between runs" in found.summary()
    assert "2.36 times the +- shown" in found.summary()


def test_amplitude_intervals_hold_the_amplitudes():
    hit = []
    for seed in range(SETS):
        found = ta.fit(some_runs(seed, "sweeps", 0.9), orders=[1, 2, 5])
        low, high = found.amplitude_interval().T
        hit.append([a < c < b for a, b, (_, c, _) in zip(low, high, LINES, strict=True)])
    # Few of 180: 3 standard deviations of the share.
    assert 0.90 <= np.mean(hit) <= 0.995


def test_what_is_asked_for_is_taken_or_refused():
    runs = some_runs(2, "sweeps", 0.9)
    for kind in ("white", "cluster", "correlated"):
        assert ta.fit(runs, [1, 2, 5], covariance=kind).uncertainty.kind == kind
    with pytest.raises(ArgumentError, match="covariance must be one of"):
        ta.fit(runs, [1], covariance="robust")
    with pytest.raises(ArgumentError, match="two at least"):
        ta.fit(runs[0], [1], covariance="cluster")
    with pytest.raises(ArgumentError, match="level must lie between"):
        ta.fit(runs, [1]).interval(95)


def test_the_command_takes_a_covariance(tmp_path, capsys):
    lines = ["run,reference_deg,indicated_deg"]
    for run in some_runs(5, "sweeps", 0.9):
        pairs = zip(run.reference.tolist(), run.indicated.tolist(), strict=True)
        lines += [f"{run.label},{x!r},{y!r}" for x, y in pairs]
    path, model = tmp_path / "runs.csv", tmp_path / "model.json"
    path.write_text("\n".join(lines) + "\n")
    command = ["fit", str(path), "-o", str(model), "--orders", "1,2,5", "--json"]
    found = {}
    for kind in ("auto", "white"):
        assert main([*command, "--covariance", kind]) == 0
        found[kind] = json.loads(capsys.readouterr().out)
    assert found["auto"]["covariance"] == "cluster"
    assert found["white"]["covariance"] == "white"
    wide, narrow = (found[kind]["orders"][0]["std_arcsec"] for kind in ("auto", "white"))
    assert wide > 1.5 * narrow
    low, high = found["auto"]["orders"][0]["interval_arcsec"]
    assert low < found["auto"]["orders"][0]["amplitude_arcsec"] < high


def test_many_coefficients_have_the_covariance_of_the_scatter_of_their_scores():
    """Beyond 256 coefficients the adjustment is one factor: CR1, by its definition."""
    rng = np.random.default_rng(6)
    size, count = 260, 12
    parts = [rng.normal(size=(400, size)) for _ in range(count)]
    left = [rng.normal(size=400) for _ in range(count)]
    found = cluster_covariance(
        [NormalEquations(p.T @ p, p.T @ e) for p, e in zip(parts, left, strict=True)]
    )
    bread = np.linalg.inv(sum(p.T @ p for p in parts))
    scores = np.array([p.T @ e for p, e in zip(parts, left, strict=True)])
    expected = bread @ (scores.T @ scores) @ bread * count / (count - 1.0)
    np.testing.assert_allclose(found.covariance, expected, rtol=1e-9, atol=1e-18)
    np.testing.assert_array_equal(found.freedom, count - 1.0)


def by_integrals(ratio, n, freedom):
    """Mean and variance of log kappa of independent coefficients, hypothesis by hypothesis."""
    logs = np.linspace(-14.0, 60.0, 20_001)
    kappa = np.exp(logs)
    given = [(1.0, freedom, 1.0)]
    given += [(10.0**k, 2.0**d, 1 / 25) for k in np.arange(-2.0, 4.1, 0.25) for d in range(8)]
    scores, moments = [], []
    for level, d, prior in given:
        scores.append(np.log(prior / level**ratio.size) + stats.f.logpdf(ratio / level, n, d).sum())
        # Of chi-squared variables, before the scatter is known and after.
        density = stats.invgamma.pdf(kappa, d / 2.0, scale=d * level / 2.0) * kappa
        density = density[:, None] * stats.gamma.pdf(ratio, n / 2.0, scale=2.0 * kappa[:, None] / n)
        density /= density.sum(axis=0)
        moments.append([logs @ density, logs**2 @ density])
    weight = np.exp(np.array(scores) - max(scores))
    mean, square = np.tensordot(weight / weight.sum(), np.array(moments), 1)
    return mean, square - mean**2


@pytest.mark.parametrize("tied", [0.0, 0.8])
def test_moderated_variances_have_the_moments_of_the_mixture(tied):
    """Of an inverse gamma variable of as many degrees of freedom, whatever they scatter by."""
    white = np.array([[2.0, tied * 6.0, 0.0], [tied * 6.0, 18.0, 0.0], [0.0, 0.0, 0.5]])
    own = np.array([[9.0, 2.0, -1.0], [2.0, 20.0, 0.5], [-1.0, 0.5, 0.6]])
    found = moderated_covariance(ClusterCovariance(own, np.full(3, 2.5)), white, 150.0)
    root = linalg.sqrtm(white)
    whitened = np.linalg.inv(root) @ np.array([own, found.covariance]) @ np.linalg.inv(root)
    mean, variance = by_integrals(np.diag(whitened[0]), 2.5, 150.0)
    half = np.array([optimize.brentq(lambda x, v=v: special.polygamma(1, x) - v, 0.1, 1e3)
                     for v in variance])  # fmt: skip
    ratio = np.exp(mean + special.digamma(half)) / half
    np.testing.assert_allclose(np.diag(whitened[1]), ratio, rtol=1e-6)
    part = root**2 * ratio
    freedom = part.sum(axis=1) ** 2 / (part**2 / (2.0 * half)).sum(axis=1)
    np.testing.assert_allclose(found.freedom, freedom, rtol=1e-6)
    assert np.linalg.eigvalsh(found.covariance).min() > 0.0


@pytest.mark.parametrize("apart", [0.0, 2.0])
@pytest.mark.parametrize("count", [3, 6])
def test_intervals_hold_what_runs_share_where_each_has_a_part_of_its_own(count, apart):
    """In standard errors of one run. Where no test found a difference, they held too little."""
    hit, wide, theta = [], [], np.arange(60) * 6.0
    std = SIGMA * np.sqrt(2.0 / 60.0)
    for seed in range(SETS):
        rng = np.random.default_rng([74, count, seed])
        runs = []
        for _ in range(count):
            pairs = TRUE.reshape(-1, 2) + apart * std * rng.normal(size=(3, 2))
            waves = [np.exp(-1j * k * np.radians(theta)) for k, _, _ in LINES]
            error = ((pairs @ [1.0, 1j]) @ waves).real + SIGMA * rng.normal(size=60)
            runs.append(ta.CalibrationRun(theta, theta + error, 360.0))
        found = ta.fit(runs, orders=[1, 2, 5], loss="linear")
        low, high = found.interval()[1:].T
        hit.append((low < TRUE) & (high > TRUE))
        wide.append((high - low) / (2.0 * 1.96 * std * np.sqrt((1.0 + apart**2) / count)))
    print(f"{count} runs, {apart:g}: {100 * np.mean(hit):.1f} %, {np.median(wide):.2f} as wide")
    assert LOW <= np.mean(hit) <= HIGH
    # By the scatter of three runs alone it is 1.8 times the least width.
    assert np.median(wide) < 1.25


def test_the_constant_is_no_surer_than_the_coefficients():
    """How the zeros scatter tells nothing of it: its error widens as theirs do."""
    runs = some_runs(3, "sweeps", 0.9)
    white, cluster = (ta.fit(runs, [1, 2, 5], covariance=kind) for kind in ("white", "cluster"))
    wider = np.sqrt(np.diag(cluster.covariance) / np.diag(white.covariance))
    assert wider[0] == pytest.approx(max(1.0, np.median(wider[1:])), rel=1e-9)
    assert wider[0] > 1.5


@pytest.mark.parametrize("ridge", [0.0, 1e-3])
def test_readings_written_twice_scatter_no_less_between_runs(ridge, monkeypatch):
    """Sums, penalty and scores double together: neither coefficients nor their errors move."""
    from trueangle.fitting import uncertainty

    # What a penalty may take from the coefficients counts readings: that is told apart.
    monkeypatch.setattr(uncertainty, "_bias", lambda *_: np.zeros((7, 7)))
    runs = some_runs(11, "arc", 0.9)
    twice = [
        ta.CalibrationRun(np.repeat(r.reference, 2), np.repeat(r.indicated, 2), 360.0) for r in runs
    ]
    once, again = (
        ta.fit(r, [1, 2, 5], ridge=ridge, covariance="cluster", loss="linear")
        for r in (runs, twice)
    )
    np.testing.assert_allclose(again.model.amplitudes, once.model.amplitudes, rtol=1e-8)
    np.testing.assert_allclose(again.covariance[1:, 1:], once.covariance[1:, 1:], rtol=1e-7)
    np.testing.assert_allclose(again.uncertainty.freedom, once.uncertainty.freedom, rtol=1e-7)
