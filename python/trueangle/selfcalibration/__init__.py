"""Calibration without a reference: patterns beside what the log does not know."""

from .calibrate import METHODS, selfcal
from .result import Blind, HeldOutPattern, OrderEstimate, SelfCalibration

__all__ = ["METHODS", "Blind", "HeldOutPattern", "OrderEstimate", "SelfCalibration", "selfcal"]
