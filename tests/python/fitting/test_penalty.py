"""Intervals of a fit with a ridge: what it takes, how large patterns are, and who is held."""

import json

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.errors import NotInvertibleError, RankError
from trueangle.estimation.reference import design_matrix
from trueangle.fitting.ridge import bias_covariance, pattern_variances
from trueangle.support.distributions import student_quantile

SEED = 20261122
#: Fits of a form. A fit's coefficients and angles hang together: the share of one fit held
#: scatters by some 0.12, that of 200 by 0.009.
SETS = 200
#: Shares of 95 % intervals that hold the truth, both ways. Of single coefficients they hold
#: more: the steepness and size of patterns are known roughly, and that is in them.
COEFFICIENTS = (0.94, 0.997)
CURVE = (0.93, 0.98)

ARCS = (100.0, 120.0, 150.0, 180.0, 200.0)
NOISES = (0.003, 0.06)


def _rows(x, orders):
    """Regressors of a turn of 360, without the constant."""
    return design_matrix(np.asarray(x), [(1.0, tuple(orders))], 360.0)[:, 1:]


def _disc(rng, k):
    """Amplitudes of any order alike, none beyond a bound."""
    size = 0.2 * np.sqrt(rng.uniform(size=k.size))
    phase = rng.uniform(0.0, 2.0 * np.pi, k.size)
    return np.column_stack([size * np.cos(phase), size * np.sin(phase)])


def _steep(rng, k):
    """Each order half of the one before."""
    phase = rng.uniform(0.0, 2.0 * np.pi, k.size)
    size = rng.uniform(0.2, 1.0) * 0.5 ** (k - 1.0)
    return np.column_stack([size * np.cos(phase), size * np.sin(phase)])


def _one_strong(rng, k):
    """One order that stands out of small ones."""
    size = 0.02 * rng.laplace(size=(k.size, 2))
    size[rng.integers(min(3, k.size))] += 0.4 * rng.choice([-1.0, 1.0], 2)
    return size


def _falling(rng, k):
    """Sizes that fall with the order, by a power drawn anew each time."""
    return 0.3 * rng.normal(size=(k.size, 2)) / k[:, None] ** rng.uniform(0.3, 1.8)


FORMS = (_disc, _steep, _one_strong, _falling)


def drawn(form, seed):
    """Runs over a part of a turn, and the coefficients they were made with."""
    rng = np.random.default_rng([SEED, seed])
    k = np.arange(1.0, rng.integers(4, 13))
    arc, noise = rng.choice(ARCS), rng.choice(NOISES)
    low, count = rng.uniform(0.0, 360.0), int(rng.integers(80, 200))
    pattern = form(rng, k)
    runs = []
    for number in range(rng.integers(1, 4)):
        x = (
            low + np.sort(rng.uniform(0.0, arc, count))
            if number
            else low + np.linspace(0, arc, count)
        )
        error = _rows(x, k) @ pattern.ravel() + noise * rng.normal(size=count)
        runs.append(ta.CalibrationRun(x, x + error + rng.uniform(-3.0, 3.0), 360.0))
    return runs, k.astype(int), pattern.ravel(), np.linspace(low, low + arc, 81)


@pytest.mark.parametrize("form", FORMS)
def test_intervals_over_part_of_a_turn_hold_the_truth_as_often_as_they_say(form):
    held, inside, ratio = [], [], []
    for seed in range(SETS):
        runs, orders, pattern, angles = drawn(form, seed)
        try:
            found = ta.fit(runs, orders=orders, loss="linear", covariance="white")
        except (RankError, NotInvertibleError):
            continue  # too little travel, or too steep a pattern: said, and nothing stated
        if not found.ridge > 0.0:
            continue
        low, high = found.interval()[1:].T
        held.append(np.mean((low <= pattern) & (pattern <= high)))
        rows = _rows(angles, orders)
        rows = rows - rows.mean(axis=0)
        std = np.sqrt(np.einsum("ij,jk,ik->i", rows, found.covariance[1:, 1:], rows))
        values = np.ravel([found.model.shafts[0].cosine, found.model.shafts[0].sine], order="F")
        off = rows @ (values - pattern)
        times = student_quantile(0.975, found.uncertainty.fewest)
        inside.append(np.mean(np.abs(off) <= times * std))
        ratio.append(np.sqrt(np.mean(off**2) / np.mean(std**2)))
    print(
        f"{form.__name__}: seeds {SEED}, 0 to {SETS - 1}, {len(held)} with a ridge: "
        f"{100 * np.mean(held):.1f} % of coefficients, {100 * np.mean(inside):.1f} % of angles, "
        f"errors {np.median(ratio):.2f} of what was said"
    )
    assert len(held) > SETS // 2
    assert COEFFICIENTS[0] <= np.mean(held) <= COEFFICIENTS[1]
    assert CURVE[0] <= np.mean(inside) <= CURVE[1]


def test_the_band_holds_the_zero_too():
    """One run: the constant and the pattern make good for each other on the travel."""
    inside = []
    for seed in range(SETS):
        rng = np.random.default_rng([SEED, 7, seed])
        x = np.linspace(20.0, 170.0, 120)
        pattern = 0.2 * rng.normal(size=12)
        error = 1.5 + _rows(x, range(1, 7)) @ pattern + 0.02 * rng.normal(size=120)
        found = ta.fit(ta.CalibrationRun(x, x + error, 360.0), orders=range(1, 7), loss="linear")
        angles = np.linspace(20.0, 170.0, 61)
        off = found.model.error(angles) - (1.5 + _rows(angles, range(1, 7)) @ pattern)
        inside.append(np.mean(np.abs(off) <= 1.97 * found.model.band(angles)))
    print(f"seeds {SEED}, 7, 0 to {SETS - 1}: {100 * np.mean(inside):.1f} %")
    assert CURVE[0] <= np.mean(inside) <= CURVE[1]


def test_what_a_ridge_takes_is_what_it_misses_without_noise():
    """Column by column: the ridge's answer to readings of one coefficient alone, by lstsq."""
    rng = np.random.default_rng(SEED)
    x = rng.uniform(0.0, 130.0, 200)
    columns = _rows(x, (1, 2, 4))
    mean = columns.mean(axis=0)
    about = columns - mean
    penalty, variances = 0.3, np.array([4.0, 3.0, 2.0, 1.0, 0.5, 0.1])
    misses = []
    for j in range(6):
        stacked = np.block(
            [[np.ones((200, 1)), columns], [np.zeros((6, 1)), np.sqrt(penalty) * np.eye(6)]]
        )
        answer = np.linalg.lstsq(stacked, np.concatenate([columns[:, j], np.zeros(6)]))[0]
        answer[1 + j] -= 1.0
        misses.append(answer)
    expected = np.transpose(misses) * variances @ np.array(misses)
    found = bias_covariance(about.T @ about, mean, penalty, variances)
    np.testing.assert_allclose(found, expected, rtol=1e-9, atol=1e-12)


def test_sizes_of_patterns_are_those_of_the_likelihood_of_the_readings():
    """The slow form: the density of all readings under every size and steepness."""
    rng = np.random.default_rng(SEED + 1)
    x = rng.uniform(0.0, 130.0, 60)
    columns = _rows(x, (1, 2, 3))
    columns = columns - columns.mean(axis=0)
    steps = np.repeat([1.0, 2.0, 3.0], 2)
    y = columns @ (0.4 * rng.normal(size=6) / steps) + 0.05 * rng.normal(size=60)
    total = np.zeros(6)
    weight = 0.0
    logs, drawn_variances = [], []
    for steepness in (0.0, 0.5, 1.0, 1.5, 2.0, 3.0):
        for size in 2.0 * np.logspace(-4.0, 0.0, 81):
            variances = size**2 * steps ** (-2.0 * steepness)
            whole = 0.05**2 * np.eye(60) + columns * variances @ columns.T
            sign, log = np.linalg.slogdet(whole)
            assert sign > 0.0
            logs.append(-0.5 * (log + y @ np.linalg.solve(whole, y)))
            drawn_variances.append(variances)
    chance = np.exp(np.array(logs) - max(logs))
    total = chance @ np.array(drawn_variances)
    weight = chance.sum()
    found = pattern_variances(columns.T @ columns, columns.T @ y, 0.05**2, steps, 2.0)
    np.testing.assert_allclose(found, total / weight, rtol=1e-6)


def test_no_error_at_all_has_no_size():
    assert np.array_equal(pattern_variances(np.eye(2), np.zeros(2), 0.0, np.ones(2), 0.0), [0, 0])
    x = np.linspace(0.0, 90.0, 100)
    run = ta.CalibrationRun(x, x + 0.25, 360.0)
    found = ta.fit(run, orders=[1, 2, 3], ridge=1e-3)
    assert np.isfinite(found.covariance).all()
    assert np.sqrt(np.diag(found.covariance)).max() < 1e-9


def test_a_ridge_is_told_with_the_intervals(tmp_path, capsys):
    runs, orders, _, _ = drawn(_disc, 3)
    found = ta.fit(runs, orders=orders)
    assert found.ridge > 0.0
    assert "with the bias of the ridge" in " ".join(found.summary().split())
    assert any("include the bias of the ridge" in note for note in found.notes)
    lines = ["run,reference_deg,indicated_deg"]
    for number, run in enumerate(runs):
        pairs = zip(run.reference.tolist(), run.indicated.tolist(), strict=True)
        lines += [f"{number},{x!r},{y!r}" for x, y in pairs]
    path = tmp_path / "runs.csv"
    path.write_text("\n".join(lines) + "\n")
    asked = ",".join(map(str, orders))
    command = ["fit", str(path), "-o", str(tmp_path / "m.json"), "--orders", asked, "--json"]
    assert main(command) == 0
    assert json.loads(capsys.readouterr().out)["intervals_hold"] == ["noise", "ridge"]
    x = np.arange(0.0, 360.0, 10.0)
    full = "\n".join(["reference_deg,indicated_deg", *(f"{v},{v + 0.1}" for v in x.tolist())])
    path.write_text(full + "\n")
    assert main([*command[:5], "1", "--json"]) == 0
    assert json.loads(capsys.readouterr().out)["intervals_hold"] == ["noise"]


def test_degrees_of_freedom_are_those_of_the_noise_where_it_is_all():
    """Few runs that scatter: the part of the ridge, taken as known, raises the freedom."""
    runs = []
    for seed in range(4):
        rng = np.random.default_rng([SEED, 9, seed])
        x = np.linspace(0.0, 140.0, 150)
        wander = np.cumsum(rng.normal(size=150)) * 0.004
        error = 0.3 * np.sin(np.radians(x)) + 0.1 * np.cos(np.radians(3.0 * x)) + wander
        runs.append(ta.CalibrationRun(x, x + error, 360.0))
    found = ta.fit(runs, orders=range(1, 6), covariance="cluster", loss="linear")
    assert found.ridge > 0.0
    assert found.uncertainty.fewest <= 3.0 + 1e-6
    assert found.freedom.max() > found.uncertainty.fewest
