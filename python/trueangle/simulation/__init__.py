"""Simulation of a joint: what is believed of it, and how it would be measured."""

from __future__ import annotations

from ..joint.joint import Joint
from ..joint.pattern import Harmonic, Pattern
from ..joint.signals import Signals, join_runs
from .designs import RunDesign
from .effects import EFFECTS, Effect
from .effects.dispersion import HeteroscedasticNoise, Outliers
from .effects.lines import MissingOrder, NonIntegerOrder, ReferenceLines, Sidebands
from .effects.load import LoadDependentGearError, StiffeningCompliance, TorsionalCompliance
from .effects.motion import FilterLag, Latency
from .effects.place import ArgumentShift, LocalDefect
from .effects.reversal import Backlash, PreslidingHysteresis
from .effects.run_level import DriftWithinRun, MissedCounts, ScaleError, ZeroSlip
from .effects.temperature import ThermalDrift
from .simulation import Simulation, simulate
from .simulationfile import load_simulation

__all__ = [
    "EFFECTS",
    "ArgumentShift",
    "Backlash",
    "DriftWithinRun",
    "Effect",
    "FilterLag",
    "Harmonic",
    "HeteroscedasticNoise",
    "Joint",
    "Latency",
    "LoadDependentGearError",
    "LocalDefect",
    "MissedCounts",
    "MissingOrder",
    "NonIntegerOrder",
    "Outliers",
    "Pattern",
    "PreslidingHysteresis",
    "ReferenceLines",
    "RunDesign",
    "ScaleError",
    "Sidebands",
    "Signals",
    "Simulation",
    "StiffeningCompliance",
    "ThermalDrift",
    "TorsionalCompliance",
    "ZeroSlip",
    "join_runs",
    "load_simulation",
    "simulate",
]
