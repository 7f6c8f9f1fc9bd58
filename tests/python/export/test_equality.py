"""Whether two calibrations differ: told at the rate that is stated, whatever the readings."""

import json
import re
from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

import trueangle as ta
from trueangle.cli import main
from trueangle.model.records import FitRecord

SEED = 55_700

#: Pairs of calibrations of one pattern.
PAIRS = 200


def calibrated(rng, runs=2, count=120, orders=range(1, 5), added=(0, 0.0)):
    """A model of readings with a noise of 3 arcsec, every run with a zero of its own."""
    angle = np.arange(count) * (360.0 / count)
    found = []
    for run in range(runs):
        error = sum(10.0 / k * np.cos(k * np.radians(angle)) for k in range(1, 5))
        error += added[1] * np.sin(added[0] * np.radians(angle))
        error += rng.normal(0.0, 3.0, count) + 5.0 * rng.normal()
        run = ta.CalibrationRun(angle, angle + error / 3600.0, 360.0, label=f"r{run}")
        found.append(run)
    return ta.fit(found, orders=orders).model


@pytest.mark.parametrize(
    "design",
    [{}, {"runs": 1, "count": 40}, {"runs": 20, "count": 30}, {"orders": None}],
    ids=["two runs", "few readings", "many runs", "orders selected"],
)
def test_of_one_pattern_p_is_uniform(design):
    print("seed", SEED)
    rng = np.random.default_rng(SEED)
    pairs = [ta.compare(calibrated(rng, **design), calibrated(rng, **design)) for _ in range(PAIRS)]
    p = np.sort([pair.p for pair in pairs])
    told = sum(pair.verdict == "changed" for pair in pairs)
    print(told, p[:5])
    # Kolmogorov and Smirnov's limit at 1 %, and the count's at three standard deviations.
    above = (np.arange(PAIRS) + 0.5) / PAIRS - p
    assert above.max() < 1.63 / np.sqrt(PAIRS)
    # Of orders selected the covariance holds what two runs may differ by: p may be too large.
    assert -above.min() < (0.3 if "orders" in design else 1.63 / np.sqrt(PAIRS))
    assert told <= 0.01 * PAIRS + 3.0 * np.sqrt(0.01 * PAIRS)


#: Runs that scatter may well be told to be unlike.
unlike = pytest.mark.filterwarnings("ignore::trueangle.errors.UnlikeRunsWarning")


def scattered(rng, runs, orders, size, memory=0.0):
    """A model of runs whose coefficients, or whose neighbouring readings, differ by more."""
    angle = 7.5 * np.arange(48)
    found = []
    for _ in range(runs):
        noise = rng.standard_t(8, 48)
        for i in range(1, 48):
            noise[i] += memory * noise[i - 1]
        error = noise + 5.0 * rng.normal()
        for k in orders:
            a, b = rng.normal(0.0, size, 2)
            error += (a + 12.0 / k) * np.cos(k * np.radians(angle)) + b * np.sin(
                k * np.radians(angle)
            )
        found.append(ta.CalibrationRun(angle, angle + error / 3600.0, 360.0))
    return ta.fit(found, orders=orders).model


@unlike
@pytest.mark.parametrize(
    ("runs", "orders", "size", "memory"),
    [((4, 4), [1], 2.0, 0.0), ((4, 6), [1, 3], 2.0, 0.0), ((7, 7), [1, 2, 5], 0.0, 0.9)],
)
def test_p_is_uniform_where_runs_scatter(runs, orders, size, memory):
    """Covariances of three runs each had been taken as known: 83 in 100 pairs below 0.05."""
    print("seed", SEED)
    rng = np.random.default_rng([SEED, *runs, len(orders)])
    pairs = []
    for _ in range(PAIRS):
        models = [scattered(rng, count, orders, size, memory) for count in runs]
        if all(model.fit.freedom is not None for model in models):
            pairs.append(ta.compare(*models))
    assert len(pairs) > 0.9 * PAIRS
    p = np.sort([pair.p for pair in pairs])
    print(p[:5])
    told = sum(pair.verdict == "changed" for pair in pairs)
    # Satterthwaite's freedom of so few runs is itself a guess: twice the limit of 1 %.
    far = np.abs(p - (np.arange(p.size) + 0.5) / p.size).max()
    assert far < 2.0 * 1.63 / np.sqrt(p.size)
    assert told <= 0.01 * PAIRS + 3.0 * np.sqrt(0.01 * PAIRS)


@unlike
def test_scattered_runs_that_changed_are_told():
    print("seed", SEED + 3)
    rng = np.random.default_rng(SEED + 3)
    models = [scattered(rng, 6, orders, 0.5) for orders in ([1, 2], [1, 2])]
    moved = models[1].replace(
        shafts=[
            ta.Shaft("output", 1, s.orders, np.add(s.cosine, 6.0 / 3600.0), s.sine)
            for s in models[1].shafts
        ]
    )
    assert ta.compare(*models).verdict == "same"
    assert ta.compare(models[0], moved).verdict == "changed"


@pytest.mark.parametrize("orders", [range(1, 9), None])
@pytest.mark.parametrize("added", [(2, 3.0), (7, 4.0)])
def test_a_changed_order_is_told_also_where_one_model_lacks_it(orders, added):
    print("seed", SEED)
    rng = np.random.default_rng(SEED + 1)
    found = ta.compare(
        calibrated(rng, orders=orders, count=240),
        calibrated(rng, orders=orders, count=240, added=added),
    )
    assert found.verdict == "changed"
    assert found.p < found.false_alarms
    assert re.match(rf"Changed: order {added[0]} by \d", found.summary())


def test_what_cannot_be_told_has_no_verdict():
    shaft = ta.Shaft("output", 1, [1], [0.5], [0.0])
    plain = ta.HarmonicModel([shaft])
    known = ta.HarmonicModel([shaft], covariance=np.diag([0.0, 1e-4, 1e-4]))
    other = ta.HarmonicModel([ta.Shaft("output", 1, [2], [0.2], [0.0])], covariance=np.eye(3))
    for pair in ((plain, known), (known, other), (known, known.replace(argument="indicated"))):
        found = ta.compare(*pair)
        assert found.verdict is None
        assert found.p is None
        assert "a change is reported" not in found.summary()
    assert ta.compare(known, known).verdict == "same"


def test_the_command_prints_the_verdict(tmp_path, capsys):
    print("seed", SEED)
    rng = np.random.default_rng(SEED + 2)
    paths = [str(tmp_path / name) for name in ("a.json", "b.json")]
    for path, size in zip(paths, (0.0, 3.0), strict=True):
        calibrated(rng, added=(2, size)).save(path)
    assert main(["compare", *paths]) == 0
    assert "a change is reported below 0.01" in " ".join(capsys.readouterr().out.split())
    assert main(["compare", *paths, "--json"]) == 0
    printed = json.loads(capsys.readouterr().out)
    assert printed["verdict"] == "changed"
    assert printed["false_alarms"] == 0.01


def recorded(orders, values, variances, readings, period=1.0):
    """Coefficients with a variance each, of so many readings in 4 runs of which 3 are outliers."""
    pairs = np.reshape(values, (-1, 2))
    shaft = ta.Shaft("output", 1, orders, pairs[:, 0] * period, pairs[:, 1] * period)
    covariance = np.diag([9.0, *np.asarray(variances, float)]) * period**2
    record = FitRecord(readings, 4, (0.0, period), 0.0, wild=3)
    return ta.HarmonicModel([shaft], period=period, covariance=covariance, fit=record)


def test_p_is_that_of_hotelling_with_the_freedom_of_both():
    """Two variances of 8 and 18 degrees of freedom, put together by Satterthwaite's formula."""
    first = recorded([1, 2], [0.01, 0.0, 0.002, 0.0], [1e-8] * 4, 8 + 3 + 4 + 4)
    second = recorded([1, 2], [0.0103, 0.0, 0.002, 1e-4], [4e-8] * 4, 18 + 3 + 4 + 4, 360.0)
    squares = (0.0003**2 + 1e-4**2) / 5e-8
    freedom = 5.0**2 / (1.0 / 8.0 + 16.0 / 18.0)
    told = stats.f.sf(squares / 4.0, 4, freedom)
    for pair in ((first, second), (second, first)):
        assert ta.compare(*pair).p == pytest.approx(told, rel=1e-6)


def test_an_order_that_one_model_lacks_is_tested_by_itself():
    """With twice its covariance, among 220 orders of which one stands out by chance."""
    first = recorded([1], [0.01, 0.0], [1e-8] * 2, 109)
    second = recorded([1, 7], [0.01, 0.0, 0.0006, 0.0003], [1e-8] * 4, 111)
    # 100 degrees of freedom each, in equal parts.
    told = 220.0 * stats.f.sf((36.0 + 9.0) / 2.0 / 2.0, 2, 200)
    assert 1e-9 < told < 0.01
    for pair in ((first, second), (second, first)):
        assert ta.compare(*pair).p == pytest.approx(told, rel=1e-6)
        assert ta.compare(*pair).verdict == "changed"


def test_p_of_scattered_runs_is_that_of_the_order_that_differs_most():
    """Freedoms of 3 and 5 in equal parts: 15/2 by Satterthwaite, one less for two numbers."""
    models = []
    for moved, freedom in ((0.0, 3.0), (4e-4, 5.0)):
        made = recorded([1, 2], [0.01 + moved, 0.0, 0.002, moved / 2.0], [1e-8] * 4, 500)
        models.append(made.replace(fit=replace(made.fit, freedom=freedom)))
    freedom = 4.0 / (1.0 / 3.0 + 1.0 / 5.0)
    squares = np.array([4e-4**2, 2e-4**2]) / 2e-8
    each = stats.f.sf(squares * (freedom - 1.0) / (2.0 * freedom), 2, freedom - 1.0)
    told = 1.0 - (1.0 - each.min()) ** 2
    assert ta.compare(*models).p == pytest.approx(told, rel=1e-9)
    assert ta.compare(*models[::-1]).p == pytest.approx(told, rel=1e-9)


@unlike
def test_the_freedom_of_a_scatter_is_saved_and_read_back(tmp_path):
    rng = np.random.default_rng(SEED + 4)
    model = scattered(rng, 4, [1], 2.0)
    # Three of each coefficient's scatter, and what the two have in common.
    assert 3.0 <= model.fit.freedom <= 6.0
    model.save(tmp_path / "m.json")
    assert ta.load_model(tmp_path / "m.json").fit.freedom == model.fit.freedom
    table = json.loads((tmp_path / "m.json").read_text())
    table["fit"]["freedom"] = 0.0
    (tmp_path / "m.json").write_text(json.dumps(table))
    with pytest.raises(ta.TrueAngleError, match=r"fit\.freedom"):
        ta.load_model(tmp_path / "m.json")
    white = calibrated(rng)
    assert white.fit.freedom is None
    white.save(tmp_path / "w.json")
    assert "freedom" not in json.loads((tmp_path / "w.json").read_text())["fit"]
