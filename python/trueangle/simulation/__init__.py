"""Simulation of a joint: what is believed of it, and how it would be measured."""

from __future__ import annotations

from ..effects import (
    EFFECTS,
    ArgumentShift,
    Backlash,
    DriftWithinRun,
    Effect,
    FilterLag,
    HeteroscedasticNoise,
    Latency,
    LoadDependentGearError,
    LocalDefect,
    MissedCounts,
    MissingOrder,
    NonIntegerOrder,
    Outliers,
    PreslidingHysteresis,
    ReferenceLines,
    ScaleError,
    Sidebands,
    StiffeningCompliance,
    ThermalDrift,
    TorsionalCompliance,
    ZeroSlip,
)
from ..joint.declared import Head
from ..joint.joint import Joint
from ..joint.pattern import Harmonic, Pattern
from ..joint.signals import Signals, join_runs
from .designs import RunDesign
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
    "Head",
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
