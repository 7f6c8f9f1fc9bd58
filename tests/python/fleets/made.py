"""Fleets made by the model itself: units, dates, and what was done to some of them."""

import numpy as np

import trueangle as ta
from trueangle.fleets.calibration import Calibration

ARCSEC = 1.0 / 3600.0
PLACES = np.arange(180) * 2.0

#: Mean pattern of aligned units, cosine and sine of orders 1 to 4, arcsec.
MEAN = np.array([[40.0, 10.0], [20.0, -5.0], [0.0, 0.0], [8.0, 3.0]])


def pattern(coefficients, places=PLACES):
    """Error in degrees."""
    turn = np.radians(places)
    total = sum(
        a * np.cos(k * turn) + b * np.sin(k * turn) for k, (a, b) in enumerate(coefficients, 1)
    )
    return ARCSEC * total


def units(
    rng,
    count=40,
    *,
    dates=(None,),
    change=lambda u, t, b: (b, 0.0),
    spread=10.0,
    noise=3.0,
    runs=3,
    aligned=True,
    places=PLACES,
    tail=None,
):
    """Runs of a fleet; ``change(unit, date, coefficients)`` gives coefficients and zero, arcsec."""
    found = []
    for u in range(count):
        own = rng.normal(0.0, spread, (4, 2))
        if tail is not None:
            own /= np.sqrt(rng.chisquare(tail, (4, 1)) / (tail - 2.0))
        own += MEAN if aligned else 0.0
        for t, when in enumerate(dates):
            coefficients, zero = change(u, t, own.copy())
            mounted = 5.0 * rng.normal()
            for r in range(runs):
                error = pattern(coefficients, places) + ARCSEC * (
                    zero + mounted + rng.normal() + rng.normal(0.0, noise, places.size)
                )
                found.append(
                    ta.CalibrationRun(
                        places, places + error, 360.0, unit=f"u{u}", when=when, label=f"r{r}"
                    )
                )
    return found


def alone(variance, zero_variance, when=None):
    """A calibration of one order in one run; what a reading of variance 1 tells it to."""
    return Calibration(
        unit="u",
        when=when,
        coefficients=np.zeros(2),
        inverse=variance * np.eye(2),
        zero=0.0,
        zero_inverse=zero_variance,
        squares=1.0,
        freedom=9.0,
        readings=12,
        runs=1,
        repeat_squares=np.zeros(1),
        repeat_freedom=0.0,
        repeat_white=np.zeros(1),
    )
