"""Patterns of an encoder as functions of the true angle, in radians."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

import trueangle._core as _core

from ..joint.shafts import Shaft
from ..model.model import HarmonicModel

Array = NDArray[Any]

ENCODER: Final = "the encoder"
RIPPLE: Final = "the speed ripple"


def pattern_model(orders: Sequence[float], coefficients: Array) -> HarmonicModel:
    """The pattern as a model in radians; its constant is zero, since nothing shows it."""
    whole = tuple(int(k) for k in orders)
    return HarmonicModel(
        (Shaft("output", 1.0, whole, tuple(coefficients[0::2]), tuple(coefficients[1::2])),)
        if whole
        else (),
        period=2.0 * math.pi,
    )


def pattern_steepness(orders: Sequence[float], coefficients: Array) -> float:
    """The greatest ``|d error / d angle|``."""
    whole = [int(k) for k in orders]
    parts = [list(coefficients[0::2])], [list(coefficients[1::2])]
    return _core.Series(2.0 * math.pi, 0.0, [1.0], [whole], *parts, "indicated").slope_bound


def pattern_series(orders: Sequence[float], coefficients: Array, theta: Array) -> Array:
    """Sum of the harmonics at ``theta``, by the compiled core where orders are whole."""
    if not len(orders):
        return np.zeros_like(theta)
    whole = tuple(int(k) for k in orders)
    shaft = Shaft("output", 1.0, whole, tuple(coefficients[0::2]), tuple(coefficients[1::2]))
    model = HarmonicModel((shaft,), period=2.0 * math.pi, argument="indicated")
    return np.asarray(model.error(theta))
