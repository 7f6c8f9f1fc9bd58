"""What a coarse sensor's rounding adds to errors where positions repeat."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

import trueangle as ta
from coarse import Sensor
from trueangle.cli import main
from trueangle.fitting.rounding import repeated_rounding_variance


@pytest.mark.parametrize("noise", [0.05, 0.15, 0.3, 0.6])
def test_the_variance_that_repeats_is_that_of_the_means_at_each_place(noise):
    """400 places of 400 readings: means and scatter about them, by draws."""
    rng = np.random.default_rng([23, round(100 * noise)])
    place = rng.uniform(size=(400, 1))
    error = np.round(place + rng.normal(0.0, noise, (400, 400))) - place
    scatter = float(error.var(axis=1, ddof=1).mean())
    means = float(error.mean(axis=1).var(ddof=1)) - scatter / 400
    found = repeated_rounding_variance(1.0, scatter)
    assert found == pytest.approx(means, rel=5.0 * math.sqrt(2.0 / 400), abs=5e-4)
    assert repeated_rounding_variance(316.4, 316.4**2 * scatter) == pytest.approx(
        316.4**2 * found, rel=1e-9
    )


def test_what_does_not_scatter_repeats_whole():
    assert repeated_rounding_variance(1.0, 0.0) == pytest.approx(1.0 / 12.0, rel=0.005)
    assert repeated_rounding_variance(1.0, 4.0) < 1e-12


def pulls(places: int, runs: int, noise: float, spread: bool, covariance: str) -> np.ndarray:
    """Errors over their standard errors of 60 fits of a line of three counts."""
    found = []
    for seed in range(30):
        sensor = Sensor(12, places, runs, spread, noise, 3.0, 2, 2000 + seed)
        fit = ta.fit(sensor.read(), orders=[2], covariance=covariance)
        shaft = fit.model.shafts[0]
        std = np.sqrt(np.diag(fit.model.covariance))[-2:]
        found += ((np.array([shaft.cosine[0], shaft.sine[0]]) - sensor.sizes) / std).tolist()
    return np.array(found)


@pytest.mark.parametrize("covariance", ["auto", "white", "cluster"])
@pytest.mark.parametrize(("runs", "noise"), [(3, 0.0), (8, 0.0), (8, 0.05), (8, 0.15)])
def test_errors_hold_on_the_same_positions_however_often(runs, noise, covariance):
    """36 positions: what 95 % intervals held had been 42 % with 8 runs and little noise."""
    z = pulls(36, runs, noise, False, covariance)
    assert np.mean(np.abs(z) < 1.96) > 0.86
    assert 0.7 < math.sqrt(float(np.mean(z**2))) < 1.35


def test_errors_are_no_wider_where_positions_differ():
    z = pulls(36, 8, 0.15, True, "white")
    assert 0.75 < math.sqrt(float(np.mean(z**2))) < 1.25


@pytest.mark.parametrize("unit", [1.0, 2.0 * math.pi, 65536.0])
def test_the_unit_does_not_matter(unit):
    runs = Sensor(12, 36, 4, False, 0.1, 2.0, 2, 5).read()
    other = [
        ta.CalibrationRun(r.reference * unit / 360.0, r.indicated * unit / 360.0, period=unit)
        for r in runs
    ]
    one, same = ta.fit(runs, orders=[2]), ta.fit(other, orders=[2])
    wide = np.asarray(one.model.covariance) * (unit / 360.0) ** 2
    np.testing.assert_allclose(same.model.covariance, wide, atol=1e-6 * wide.max())


def test_one_pass_says_the_same(tmp_path, capsys):
    runs = Sensor(12, 72, 4, False, 0.05, 1.5, 2, 12).read()
    lines = ["run,reference_deg,indicated_deg"]
    for k, run in enumerate(runs):
        pairs = zip(run.reference.tolist(), run.indicated.tolist(), strict=True)
        lines += [f"{k},{true},{said}" for true, said in pairs]
    path, model = tmp_path / "r.csv", tmp_path / "m.json"
    path.write_text("\n".join(lines))
    said = []
    for further in ([], ["--one-pass"]):
        assert main(["fit", str(path), *further, "-o", str(model), "--json"]) == 0
        capsys.readouterr()
        kept = json.loads(model.read_text())
        said.append((kept["shafts"], kept["covariance"]))
    assert [s["orders"] for s in said[0][0]] == [s["orders"] for s in said[1][0]] == [[2]]
    covariances = [np.array(each[1]) for each in said]
    np.testing.assert_allclose(*covariances, atol=1e-6 * covariances[0].max())
