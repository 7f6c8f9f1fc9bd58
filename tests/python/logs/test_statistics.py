"""What was done to readings: root mean square and greatest correction, missing, outside."""

import numpy as np
import pytest

from trueangle.logs.statistics import CorrectionStatistics

SEED = 66_000
UNITS = (360.0, 1.0, 2.0 * np.pi, 65536.0, -360.0)


def readings():
    rng = np.random.default_rng(SEED)
    angle = rng.uniform(-2.0, 3.0, 500)
    change = rng.normal(0.0, 1e-3, 500)
    change[7] = -0.01
    angle[[3, 99]] = np.nan
    return angle, angle + change, change


@pytest.mark.parametrize("period", UNITS)
@pytest.mark.parametrize("cuts", [[], [1, 8, 300]])
def test_they_are_those_of_all_readings_in_every_unit_however_they_come(period, cuts):
    """Against one pass of numpy; a period below 0 is a joint that counts the other way."""
    indicated, corrected, change = readings()
    known = np.isfinite(indicated)
    found = CorrectionStatistics()
    parts = zip(np.split(indicated, cuts), np.split(corrected, cuts), strict=True)
    span = (0.1 * period, 0.6 * period)
    for one, other in parts:
        found.update(period * one, period * other, period, span)
    assert (found.rows, found.missing) == (500, 2)
    seconds = 1_296_000.0
    rms = np.sqrt(np.mean(change[known] ** 2))
    assert found.rms_arcsec == pytest.approx(seconds * rms, rel=1e-6)
    assert found.max_abs_arcsec == pytest.approx(seconds * np.abs(change[known]).max(), rel=1e-6)
    place = np.mod(corrected[known], 1.0)
    outside = int(np.count_nonzero((place < 0.1) | (place > 0.6)))
    assert found.outside == outside
    assert 200 < outside < 300


def test_nothing_was_done_to_no_readings():
    found = CorrectionStatistics()
    assert (found.rms_arcsec, found.max_abs_arcsec) == (0.0, 0.0)
    found.update(np.full(3, np.nan), np.full(3, np.nan), 360.0, None)
    assert (found.rows, found.missing, found.rms_arcsec, found.outside) == (3, 3, 0.0, 0)


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_greatest_correction_is_that_of_either_sign(sign):
    found = CorrectionStatistics()
    found.update(np.zeros(3), sign * np.array([0.0, 0.5, 0.1]), 360.0, None)
    found.update(np.zeros(2), -sign * np.array([0.2, 0.3]), 360.0, None)
    assert found.max_abs_arcsec == pytest.approx(1800.0)
    assert found.rms_arcsec == pytest.approx(3600.0 * np.sqrt((0.26 + 0.13) / 5.0))


@pytest.mark.parametrize("sign", [1.0, -1.0])
def test_the_ends_of_the_part_fitted_are_inside(sign):
    found = CorrectionStatistics()
    ends = sign * np.array([32.0, 160.0, 31.9, 160.1])
    found.update(ends, ends, sign * 256.0, (sign * 32.0, sign * 160.0))
    assert found.outside == 2
