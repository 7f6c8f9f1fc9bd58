"""Calibration without a reference: patterns beside what the log does not know."""

import warnings
from typing import Any

from .calibrate import METHODS, selfcal
from .result import Blind, HeldOutPattern, OrderEstimate, SelfCalibration

__all__ = ["METHODS", "Blind", "HeldOutPattern", "OrderEstimate", "SelfCalibration", "selfcal"]


def __getattr__(name: str) -> Any:
    if name != "HeldOut":
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
    warnings.warn(
        f"{__name__}.HeldOut is now {__name__}.HeldOutPattern; the former name goes with the next "
        "release",
        DeprecationWarning,
        stacklevel=2,
    )
    return HeldOutPattern
