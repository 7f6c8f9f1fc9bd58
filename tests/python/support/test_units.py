"""Degrees that are given as radians."""

import warnings

import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import UnitWarning

THETA = np.arange(0.0, 360.0, 5.0)


def said(theta):
    rng = np.random.default_rng(7)
    return theta + 0.5 * np.sin(np.radians(theta + 20.0)) + 0.01 * rng.standard_normal(theta.size)


def test_degrees_without_their_period_are_warned_of():
    with pytest.warns(UnitWarning, match=r"monday goes to 355.*give `period=360`"):
        ta.fit(ta.CalibrationRun(THETA, said(THETA), label="monday"), orders=[1])


@pytest.mark.parametrize(
    ("theta", "period"),
    [
        (THETA, 360.0),
        (np.radians(THETA), 2.0 * np.pi),
        (np.linspace(0.0, 355.0, 700), 2.0 * np.pi),  # a motor of 56 turns, in radians
    ],
    ids=["degrees", "radians", "many turns"],
)
def test_right_units_are_not(theta, period):
    error = 1e-3 * np.sin(2.0 * np.pi * theta / period)
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        ta.fit(ta.CalibrationRun(theta, theta + error, period=period), orders=[1])
