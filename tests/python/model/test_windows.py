"""What a window says of each order, against least squares; limits, sums of shafts, units."""

import re

import numpy as np
import pytest
from scipy.stats import norm, t

import trueangle as ta
from trueangle.model.monitor import _lines, _variances
from trueangle.support.runlength import chart_limit

SEED = 53_500
PER = 90
UNITS = (360.0, 1.0, 2.0 * np.pi)


def model(period=360.0, covariance=None):
    """Output orders 1 and 4; order 2 of the output and order 1 of a shaft twice as fast."""
    unit = period / 360.0
    shafts = [
        ta.Shaft("output", 1, [1, 2, 4], [1e-2 * unit, 4e-3 * unit, 0.0], [0.0, 0.0, 2e-3 * unit]),
        ta.Shaft("motor", 2, [1], [-0.001 * unit], [0.003 * unit]),
    ]  # fmt: skip
    return ta.HarmonicModel(shafts, period=period, covariance=covariance)


def readings(turns, period=360.0, seed=SEED):
    x = np.arange(PER * turns) / PER
    noise = np.random.default_rng(seed).normal(0.0, 0.001, x.size)
    return x * period, model(period).error(x * period) + noise * period / 360.0


def test_lines_of_several_shafts_are_added_and_so_are_their_variances():
    orders, cosine, sine = _lines(model())
    assert orders == [1, 2, 4]
    assert cosine == pytest.approx([0.01, 0.003, 0.0])
    assert sine == pytest.approx([0.0, 0.003, 0.002])
    known = model(covariance=np.diag(np.arange(1.0, 10.0)))
    # After the constant: cosine and sine of output 1, 2, 4, and of the motor.
    assert _variances(known, orders) == [2.0, 3.0, 4.0 + 8.0, 5.0 + 9.0, 6.0, 7.0]


@pytest.mark.parametrize("shift", [0.5, 1.0, 2.0])
def test_the_limit_is_that_of_all_charts_of_both_coefficients_and_the_zero(shift):
    watch = ta.Monitor(model(), shift=shift, run_length=300.0)
    assert watch.limit == pytest.approx(chart_limit(0.5 * shift, 300.0 * 1.25 * 7.0))
    assert watch._step == pytest.approx(norm.isf(0.5 / (300.0 * 1.25 * 7.0)))


@pytest.mark.parametrize("period", UNITS)
def test_a_window_is_the_least_squares_of_its_readings_beyond_the_model(period):
    angle, error = readings(6, period)
    x = 2.0 * np.pi * angle / period
    error = error + 0.02 * period / 360.0 * np.cos(2.0 * x)
    windows = ta.Monitor(model(period)).windows_of(angle, error, time=0.1 * np.arange(x.size))
    assert [one.window for one in windows] == list(range(1, len(windows) + 1))
    assert len(windows) >= 5
    start = 0
    for one in windows:
        stop = start + one.readings
        rows = slice(start, stop)
        columns = [np.ones(stop - start)]
        columns += [f(k * x[rows]) for k in (1, 2, 4) for f in (np.cos, np.sin)]
        left = error[rows] - model(period).error(angle[rows])
        found = np.linalg.lstsq(np.column_stack(columns), left, None)[0][1:].reshape(-1, 2)
        for row, (a, b) in zip(one.orders, found, strict=True):
            phase = np.radians(row.phase_deg)
            assert row.amplitude * np.sin(phase) == pytest.approx(a, abs=1e-6 * period / 360.0)
            assert row.amplitude * np.cos(phase) == pytest.approx(b, abs=1e-6 * period / 360.0)
        assert one.time == pytest.approx(0.1 * (angle == one.angle).argmax())
        start = stop


@pytest.mark.parametrize("phase", [0.0, 90.0, 180.0, 270.0])
def test_a_change_of_cosine_or_sine_either_way_is_the_statistic_of_its_order(phase):
    """Of the sums the greatest is the window's, and stands at the order that moved."""
    angle, error = readings(60)
    x, after = np.radians(angle), PER * 50
    error[after:] += 0.003 * np.sin(4.0 * x[after:] + np.radians(phase))
    found = [one for one in ta.Monitor(model()).update(angle, error) if one.window > 50]
    first = found[0]
    sums = {row.order: row.statistic for row in first.orders}
    assert max(sums, key=sums.__getitem__) == 4.0
    assert first.statistic == sums[4.0] > first.limit
    row = first.orders[2]
    assert row.amplitude == pytest.approx(0.003, rel=0.2)
    assert (row.phase_deg - phase + 180.0) % 360.0 - 180.0 == pytest.approx(0.0, abs=12.0)
    assert "order 4 moved" in first.because


def test_a_step_of_the_zero_is_told_on_the_scale_of_the_sums():
    angle, error = readings(60)
    error[PER * 50 :] += 0.005
    first = next(one for one in ta.Monitor(model()).update(angle, error) if one.window > 50)
    told = re.match(r"the zero moved by (\S+) arcsec \(\+- (\S+) arcsec", first.because)
    size, std = map(float, told.groups())
    # Steps of zeros known to 0.001 sqrt(1 / 90) each.
    assert std == pytest.approx(3.6 * np.sqrt(2.0 / PER), rel=0.4)
    assert abs(size - 18.0) < 4.5 * std
    assert first.statistic > first.limit > max(row.statistic for row in first.orders)
    # The normal number as rare as Student's of the steps before.
    z = norm.isf(t.sf(size / std / np.sqrt(1.0 + 1.0 / 49.0), 48.0))
    watch = ta.Monitor(model())
    assert first.statistic == pytest.approx(z * watch.limit / watch._step, rel=0.02)


def test_what_was_never_the_models_is_an_alarm():
    angle, error = readings(12)
    error = error + 0.004 * np.sin(4.0 * np.radians(angle))
    found = ta.Monitor(model()).update(angle, error)
    assert any("order 4 is not the model's since the start: 14" in one.because for one in found)
    assert all(one.alarm for one in found)


def test_every_unit_raises_the_same_alarms():
    told = []
    for period in UNITS:
        angle, error = readings(60, period)
        x, after = 2.0 * np.pi * angle / period, PER * 50
        error[after:] += 0.003 * period / 360.0 * np.sin(x[after:])
        watch = ta.Monitor(model(period))
        found = watch.windows_of(angle, error)
        scale = 1_296_000.0 / period
        told.append([
            [one.alarm, one.statistic, scale * one.orders[0].amplitude, one.orders[0].phase_deg]
            for one in found
        ])  # fmt: skip
        assert watch.state["limit"] == watch.limit
    np.testing.assert_allclose(told[1], told[0], rtol=1e-6)
    np.testing.assert_allclose(told[2], told[0], rtol=1e-6)


def test_readings_in_pieces_raise_the_alarms_of_all_at_once():
    angle, error = readings(60)
    error[PER * 50 :] += 0.004 * np.cos(np.radians(angle[PER * 50 :]))
    whole, pieces = ta.Monitor(model()), ta.Monitor(model())
    alarms = whole.update(angle, error)
    cuts = np.sort(np.random.default_rng(SEED).integers(0, angle.size, 40))
    parts = [a for part in zip(np.split(angle, cuts), np.split(error, cuts), strict=True)
             for a in pieces.update(*part)]  # fmt: skip
    assert [a.plain(1.0) for a in parts] == [a.plain(1.0) for a in alarms]
    assert pieces.state == whole.state
