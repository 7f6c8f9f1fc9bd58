"""What pictures of a fleet and of a watched joint draw is what their results say."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import chi2

import trueangle as ta
from fleets.made import units
from model.test_windows import PER, model, readings
from trueangle.plots.controlcharts import watched_windows

matplotlib = pytest.importorskip("matplotlib")
matplotlib.use("Agg")

SEED = 52_900
DATES = ("2026-01-10", "2026-03-10", "2026-05-10")
UNITS = [("arcsec", 3600.0), ("mrad", np.pi / 0.18)]


@pytest.fixture(scope="module")
def fleet():
    print("seed", SEED)

    def eccentric(u, t, b):
        return b + np.array([[120.0, 0.0]] + 3 * [[0.0, 0.0]]) * (u == 3), 0.0

    return ta.fleet(
        units(np.random.default_rng(SEED), 10, dates=DATES, change=eccentric, runs=1), orders=[1, 2]
    )


@pytest.fixture(autouse=True)
def _closed():
    yield
    from matplotlib import pyplot

    pyplot.close("all")


def lines(ax):
    """Data of lines by their labels."""
    return {line.get_label(): np.array(line.get_data(), dtype=object) for line in ax.lines}


@pytest.mark.parametrize(("errors_in", "per"), UNITS)
def test_phasors_and_their_circle(fleet, errors_in, per):
    """At the angle of the phase of C sin(kx + phase): sine to the right, cosine upwards."""
    ax = fleet.plot("phasors", order=1, errors_in=errors_in)
    drawn = lines(ax)
    angle, radius = drawn["95 % of units"].astype(float)
    common, between = fleet.common[0], fleet.between[0]
    away = radius * np.exp(1j * angle) - per * complex(common.sine, common.cosine)
    np.testing.assert_allclose(
        np.abs(away), per * between.std * np.sqrt(chi2.ppf(0.95, 2)), rtol=1e-9
    )
    for label, fine in (("fine", True), ("not fine", False)):
        rows = [unit.orders[0] for unit in fleet.units if (unit.verdict == "fine") == fine]
        assert rows
        phase, size = drawn[label].astype(float)
        np.testing.assert_allclose(phase, np.radians([row.phase_deg for row in rows]))
        np.testing.assert_allclose(size, [per * row.amplitude for row in rows])


@pytest.mark.parametrize(("errors_in", "per"), UNITS)
def test_sizes_and_the_band_of_the_limit(fleet, errors_in, per):
    ax = fleet.plot("sizes", errors_in=errors_in)
    drawn = lines(ax)
    ranked = sorted(fleet.units, key=lambda unit: unit.peak_to_peak)
    for label, fine in (("fine", True), ("not fine", False)):
        rows = [
            (i, u.peak_to_peak) for i, u in enumerate(ranked, 1) if (u.verdict == "fine") == fine
        ]
        place, size = drawn[label].astype(float)
        assert place.tolist() == [i for i, _ in rows]
        np.testing.assert_allclose(size, [per * ptp for _, ptp in rows])
    (band,) = ax.patches
    assert band.get_height() == pytest.approx(per * fleet.tolerance.peak_to_peak)


@pytest.mark.parametrize(("errors_in", "per"), UNITS)
def test_patterns_are_the_units_and_the_common_one(fleet, errors_in, per):
    axes = fleet.plot("patterns", errors_in=errors_in).figure.axes
    x = np.radians(np.linspace(0.0, 360.0, 361))
    common = sum(
        row.cosine * np.cos(row.order * x) + row.sine * np.sin(row.order * x)
        for row in fleet.common
    )
    for unit, ax in zip(fleet.units, axes, strict=True):
        shared, own = (line.get_ydata() for line in ax.lines[:2])
        np.testing.assert_allclose(shared, per * common, atol=1e-9)
        wave = sum(r.amplitude * np.sin(r.order * x + np.radians(r.phase_deg)) for r in unit.orders)
        np.testing.assert_allclose(own, per * wave, atol=1e-9)
        assert np.ptp(own) == pytest.approx(per * unit.peak_to_peak, rel=1e-2)
        assert ax.get_xlim() == (0.0, 360.0)


def test_the_charts_of_a_unit_have_each_their_statistic_and_its_limit(fleet):
    upper, lower = fleet.plot("history", unit="u5").figure.axes
    rows = [row for row in fleet.history if row.unit == "u5"]
    for ax, name, limit in (
        (upper, "statistic", rows[-1].limit),
        (lower, "cusum", rows[-1].cusum_limit),
    ):
        drawn = lines(ax)
        assert set(drawn["limit"][1]) == {limit}
        for k, order in enumerate((1, 2)):
            wanted = [getattr(row.orders[k], name) for row in rows]
            assert drawn[f"order {order}"][1].tolist() == pytest.approx(wanted)


@pytest.mark.parametrize(("errors_in", "per"), UNITS)
def test_windows_of_a_watched_joint(errors_in, per):
    angle, error = readings(60)
    error[PER * 50 :] += 0.004 * np.sin(4.0 * np.radians(angle[PER * 50 :]))
    windows = ta.Monitor(model()).windows_of(angle, error)
    upper, lower = watched_windows(windows, 360.0, errors_in).figure.axes
    sums, sizes = lines(upper), lines(lower)
    assert set(sums["limit"][1]) == {windows[0].limit}
    for k, order in enumerate((1, 2, 4)):
        assert sums[f"order {order}"][1].tolist() == [one.orders[k].statistic for one in windows]
        wanted = [per * one.orders[k].amplitude for one in windows]
        assert sizes[f"order {order}"][1].tolist() == pytest.approx(wanted)
        assert sizes[f"order {order}"][0].tolist() == [one.window for one in windows]
    alarms = [(one.window, one.statistic) for one in windows if one.alarm]
    assert list(zip(*sums["alarm"], strict=True)) == alarms != []
