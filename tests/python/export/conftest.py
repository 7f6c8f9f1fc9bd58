"""The model of the golden vectors, and other forms that nothing was tuned on."""

import math
from pathlib import Path

import numpy as np
import pytest

import trueangle as ta

DATA = Path(__file__).parent / "data"

#: error = sum C sin(k theta + phi), in radians; see data/README.md.
ORDERS = (1, 2, 4, 8)
AMPLITUDES = np.array([0.012, 0.006, 0.003, 0.0012])
PHASES = np.array([5.057982542713582, 5.076441699143409, 3.237885993554064, 1.7957430321414596])

ARCSEC = math.pi / 648_000.0


def golden_model(period=2.0 * math.pi):
    c = AMPLITUDES * period / (2.0 * math.pi)
    return ta.HarmonicModel(
        (ta.Shaft("output", 1, ORDERS, c * np.sin(PHASES), c * np.cos(PHASES)),), period=period
    )


def truth(indicated):
    """theta with theta + error(theta) = indicated, by Newton, in plain numpy."""
    theta = np.array(indicated, dtype=np.float64)
    for _ in range(30):
        angle = np.multiply.outer(theta, ORDERS) + PHASES
        error = np.sin(angle) @ AMPLITUDES
        slope = np.cos(angle) @ (AMPLITUDES * ORDERS)
        theta -= (theta + error - indicated) / (1.0 + slope)
    return theta


@pytest.fixture
def model():
    return golden_model()


@pytest.fixture
def joint():
    """Two shafts, a play and a constant, in degrees."""
    a = 1.0 / 3600.0
    return ta.HarmonicModel(
        (
            ta.Shaft("output", 1, (1, 2), (60 * a, 0.0), (0.0, 20 * a)),
            ta.Shaft("motor", 100, (1, 2, 4), (30 * a, 0.0, 6 * a), (0.0, 20 * a, 8 * a)),
        ),
        period=360.0,
    )


def columns(name, skip=1):
    return np.loadtxt(DATA / name, delimiter=",", skiprows=skip)
