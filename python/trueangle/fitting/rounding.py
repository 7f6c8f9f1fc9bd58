"""What the rounding of a coarse sensor adds to errors where positions are read again.

At one position a sensor that rounds to steps q has the same error each time, as far as its noise σ
does not carry it to another step. Over the positions that repeated part has the variance

::

    v(σ) = Σ_k q²/(2π²k²) exp(-(2πkσ/q)²),    v(0) = q²/12,

which further readings at the same positions do not make smaller. Their scatter about the mean of
their position, ``s² = σ² + q²/12 - v(σ)``, gives σ. Source: Widrow and Kollar, Quantization Noise
(2008), for the moments of a rounded normal number.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING, Final

import numpy as np

from ..joint.lattice import sensor_lattice
from ..runs.aliasing import Positions
from ..runs.run import CalibrationRun
from ..support.angles import ARCSEC_PER_TURN

if TYPE_CHECKING:
    from .orders.noise import ReadingVariance


#: Readings up to which positions are separated, by sorting.
COUNTED: Final = 20_000


def rounding_step(runs: Sequence[CalibrationRun], positions: Positions) -> float:
    """Step of the sensor, in the unit of the runs, at positions that are evenly spaced; else 0."""
    if positions.divisions is None or sum(map(len, runs)) > COUNTED:
        return 0.0
    theta = np.concatenate([run.unwrapped_reference * (2.0 * math.pi / run.period) for run in runs])
    return sensor_lattice(runs, theta)[0] * runs[0].period / ARCSEC_PER_TURN


def repeated_rounding_variance(step: float, scatter: float) -> float:
    """Variance of the rounding that repeats at each position, by that of the readings there.

    Examples
    --------
    >>> [round(repeated_rounding_variance(1.0, scatter), 3) for scatter in (0.0, 0.05, 0.2)]
    [0.083, 0.041, 0.0]
    """
    k = np.arange(1, 201)

    def repeated(sigma: float) -> float:
        damped = np.exp(-((2.0 * math.pi * k * sigma / step) ** 2)) / (2.0 * (math.pi * k) ** 2)
        return step**2 * float(damped.sum())

    low, high = 0.0, math.sqrt(scatter) + step
    for _ in range(60):
        sigma = 0.5 * (low + high)
        if sigma**2 + step**2 / 12.0 - repeated(sigma) < scatter:
            low = sigma
        else:
            high = sigma
    return repeated(low)


def rounding_over_repeats(step: float, repeats: ReadingVariance | None, readings: float) -> float:
    """``R v(σ)`` for R readings at each position; 0 without a step or repeated readings."""
    if not step or repeats is None:
        return 0.0
    return readings * repeated_rounding_variance(step, repeats.variance)


def rounding_variance(runs: Sequence[CalibrationRun], positions: Positions) -> float:
    """Variance of the rounding that repeats at each of these positions; 0 where none does."""
    from .orders.noise import pure_error
    from .orders.zerogroups import zero_groups

    step = rounding_step(runs, positions)
    if step == 0.0:
        return 0.0
    units, places = zero_groups(runs, True)
    return rounding_over_repeats(step, pure_error(units, positions.of_rows(places)), 1.0)
