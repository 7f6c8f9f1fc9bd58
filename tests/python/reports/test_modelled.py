"""Coefficients, correlations and phases of a page against the fit they come from."""

import math

import numpy as np
import pytest

import trueangle as ta
from plots.strokes import strokes
from trueangle.fitting.orders.select import select_orders
from trueangle.fitting.phases import run_phases
from trueangle.plots.curves import ModelCurve, Points
from trueangle.plots.pagechart import page_axes, page_chart
from trueangle.plots.phasesoverruns import draw_phase_of_order
from trueangle.reports.figures import ErrorScale, error_scale, line_names, phase_figure
from trueangle.reports.modelled import model_content, order_content
from trueangle.reports.wording import shortened_list
from trueangle.support.display_units import error_unit

SEED = 56_100
NAMES = line_names(None)
PERIODS = (360.0, 2.0 * np.pi, 1.0)


def fitted(period=360.0, arc=200.0, seed=SEED):
    """Three runs over an arc, where the coefficients hang together; a phase below zero."""
    rng, unit = np.random.default_rng(seed), period / 360.0
    theta, runs = np.arange(0.0, arc, 1.0), []
    for k in range(3):
        error = 0.02 * np.sin(np.radians(theta) - 0.7) + 0.01 * np.sin(np.radians(2 * theta) + 2.0)
        error += rng.normal(0.0, 1e-3, theta.size)
        runs.append(ta.CalibrationRun(theta * unit, (theta + error) * unit, period, label=f"r{k}"))
    return ta.fit(runs, [1, 2], loss="linear", covariance="white")


@pytest.fixture(scope="module")
def fit():
    print("seed", SEED)
    return fitted()


@pytest.mark.parametrize("period", PERIODS)
def test_coefficients_have_each_their_own_error_in_seconds_of_arc(period):
    found = fitted(period)
    content, unit = model_content(found, NAMES), 1_296_000.0 / period
    std = np.sqrt(np.diag(found.covariance)) * unit
    (shaft,) = found.model.shafts
    for n, row in enumerate(content["coefficients"]):
        wanted = {
            "cosine_arcsec": unit * shaft.cosine[n], "cosine_std_arcsec": std[1 + 2 * n],
            "sine_arcsec": unit * shaft.sine[n], "sine_std_arcsec": std[2 + 2 * n],
            "amplitude_arcsec": unit * found.amplitudes[n],
            "amplitude_std_arcsec": unit * found.amplitude_std[n],
            "phase_deg": math.degrees(found.phases[n]) % 360.0,
            "phase_std_deg": math.degrees(found.phase_std[n]),
        }  # fmt: skip
        assert {key: row[key] for key in wanted} == pytest.approx(wanted)
        assert row["cosine_std_arcsec"] != pytest.approx(row["sine_std_arcsec"], rel=1e-3)
    assert found.phases.min() < 0.0
    assert content["residual_std_arcsec"] == pytest.approx(3.6, rel=0.1)
    assert content["constant_deg"] == pytest.approx(360.0 * found.model.constant / period)


def test_the_strongest_correlations_are_told_with_their_sign(fit):
    covariance = fit.covariance[1:, 1:]
    std = np.sqrt(np.diag(covariance))
    matrix = covariance / np.outer(std, std)
    names = ["A of output 1", "B of output 1", "A of output 2", "B of output 2"]
    told = model_content(fit, NAMES)["correlations"]
    pairs = {(row["first"], row["second"]): row["correlation"] for row in told}
    wanted = {(names[i], names[j]): matrix[i, j] for i in range(4) for j in range(i + 1, 4)}
    strongest = dict(sorted(wanted.items(), key=lambda pair: -abs(pair[1]))[:5])
    assert pairs == pytest.approx({k: v for k, v in strongest.items() if abs(v) >= 0.3})
    assert min(pairs.values()) < 0.0 < max(pairs.values())


@pytest.mark.parametrize("period", PERIODS)
def test_the_evidence_of_orders_is_that_of_the_selection(period):
    found = select_orders(fitted(period, arc=360.0).runs)
    content, unit = order_content(found, NAMES), 1_296_000.0 / period
    assert content["noise_arcsec"] == pytest.approx(unit * found.noise.standard_deviation)
    before, after = (unit * x for x in found.holdout_rms)
    assert content["holdout_rms_before_arcsec"] == pytest.approx(before)
    assert content["holdout_rms_after_arcsec"] == pytest.approx(after)
    assert before > 2.0 * after
    for told, row in zip(content["table"], found.table, strict=True):
        wanted = [unit * row.amplitude, unit * row.standard_error, row.phase_deg % 360.0,
                  row.phase_error_deg, 100.0 * row.holdout_gain]  # fmt: skip
        keys = ("amplitude_arcsec", "std_arcsec", "phase_deg", "phase_std_deg",
                "holdout_gain_percent")  # fmt: skip
        for key, value in zip(keys, wanted, strict=True):
            assert told[key] == (pytest.approx(value) if math.isfinite(value) else None), key


def test_phases_of_runs_stand_where_the_runs_have_them(fit):
    """Each within half a turn of the mean, which lies in a turn from zero."""
    for order in run_phases(fit):
        ax = page_axes()
        draw_phase_of_order(ax, order, {"r0": 0, "r1": 1, "r2": 2}, error_unit("arcsec"))
        found = strokes(page_chart(ax))
        assert [one.run for one in found] == [0, 1, 2]
        places, shown = np.vstack([one.points for one in found]).T
        np.testing.assert_allclose(places, [1.0, 2.0, 3.0], atol=1e-3)
        apart = np.exp(1j * np.radians(shown)) - np.exp(1j * order.phase)
        np.testing.assert_allclose(apart, 0.0, atol=1e-3)
        assert 0.0 <= shown.mean() < 360.0
        assert np.ptp(shown) > 1e-3


@pytest.mark.parametrize(
    ("asked", "turn"),
    [("arcsec", 1_296_000.0), ("deg", 360.0), ("mrad", 2000.0 * np.pi), (4096.0, 4096.0)],
)
def test_every_error_of_a_page_is_in_its_unit(asked, turn, fit):
    """A whole turn is what a turn has, in arrays, readings and curves alike."""
    scale = error_scale(asked, 50.0, fit.runs)
    whole = np.array([1_296_000.0, -648_000.0])
    curve = ModelCurve(np.zeros(2), whole, np.abs(whole)).scaled(scale.factor)
    readings = Points("a", np.zeros(2), whole).scaled(scale.factor)
    for values in (readings.y, curve.error):
        np.testing.assert_allclose(values, [turn, -turn / 2.0])
    np.testing.assert_allclose(curve.std, [turn, turn / 2.0])


@pytest.mark.parametrize("count", [12, 13, 40])
def test_a_list_is_shortened_without_losing_count(count):
    lines = shortened_list([str(k) for k in range(count)])
    if count <= 12:
        assert lines == [str(k) for k in range(count)]
    else:
        assert int(lines[-1].split()[1]) + len(lines) - 1 == count


PHASES_SEED = 44


def fit_of(runs, orders=(1, 3)):
    rng = np.random.default_rng(PHASES_SEED)
    made = []
    for k in range(runs):
        x = np.sort(rng.uniform(0.0, 360.0, 200))
        error = 0.02 * np.cos(np.radians(x) - 0.4) + 0.01 * np.cos(np.radians(3 * x) + 0.1 * k)
        made.append(
            ta.CalibrationRun(x, x + error + 1e-4 * rng.normal(size=200), 360.0, label=f"r{k}")
        )
    return ta.fit(made, list(orders))


@pytest.mark.parametrize(("runs", "orders"), [(3, (1, 3)), (2, (1,)), (1, (1, 3))])
def test_every_order_of_several_runs_has_a_chart(runs, orders):
    figure = phase_figure(fit_of(runs, orders), line_names(None), ErrorScale(error_unit("arcsec")))
    if runs == 1:
        assert figure is None
    else:
        assert figure["alt"].startswith(f"Phases of {len(orders)} order")
        assert len(figure["charts"]) == len(orders)
