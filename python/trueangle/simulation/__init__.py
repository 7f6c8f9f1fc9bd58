"""Simulation of a joint: its assumed model, and how it would be measured."""

from __future__ import annotations

from pathlib import Path

from ..effects import (
    EFFECTS,
    ArgumentShift,
    Backlash,
    ChannelSkew,
    ClockDrift,
    CurrentCoupling,
    Curve,
    DirectionalPattern,
    DriftWithinRun,
    Effect,
    FilterLag,
    HeteroscedasticNoise,
    JointCoupling,
    Latency,
    LoadDependentGearError,
    LocalDefect,
    MissedCounts,
    MissingOrder,
    NonIntegerOrder,
    Outliers,
    PreslidingHysteresis,
    Quantisation,
    ReferenceLines,
    ScaleError,
    Sidebands,
    StiffeningCompliance,
    ThermalDrift,
    TimePeriodic,
    TimestampJitter,
    TorqueHysteresis,
    TorsionalCompliance,
    VaryingLine,
    WrongGearRatio,
    ZeroSlip,
)
from ..joint.joint import Head, Joint
from ..joint.pattern import Harmonic, Pattern
from ..joint.signals import Signals, join_runs
from ..support.argumentkinds import told_kinds
from .designs import RunDesign
from .simulation import Simulation, simulate, simulate_along
from .simulationtext import decoded_simulation, guarded_build

__all__ = [
    "EFFECTS",
    "ArgumentShift",
    "Backlash",
    "ChannelSkew",
    "ClockDrift",
    "CurrentCoupling",
    "Curve",
    "DirectionalPattern",
    "DriftWithinRun",
    "Effect",
    "FilterLag",
    "Harmonic",
    "Head",
    "HeteroscedasticNoise",
    "Joint",
    "JointCoupling",
    "Latency",
    "LoadDependentGearError",
    "LocalDefect",
    "MissedCounts",
    "MissingOrder",
    "NonIntegerOrder",
    "Outliers",
    "Pattern",
    "PreslidingHysteresis",
    "Quantisation",
    "ReferenceLines",
    "RunDesign",
    "ScaleError",
    "Sidebands",
    "Signals",
    "Simulation",
    "StiffeningCompliance",
    "ThermalDrift",
    "TimePeriodic",
    "TimestampJitter",
    "TorqueHysteresis",
    "TorsionalCompliance",
    "VaryingLine",
    "WrongGearRatio",
    "ZeroSlip",
    "join_runs",
    "load_simulation",
    "simulate",
    "simulate_along",
]


@told_kinds
def load_simulation(path: str | Path) -> Simulation:
    """Read a simulation file.

    Parameters
    ----------
    path : str or Path
        TOML with ``[joint]``, ``[[harmonic]]``, ``[[effect]]``, ``[noise]``, ``[[run]]``,
        each optional; keys are the parameters of `Joint`, `Harmonic`, the effects and
        `RunDesign`. With a ``gear_ratio`` the ``fixed_member`` is the circular spline and
        the encoder on the motor where the file does not state otherwise.

    Returns
    -------
    Simulation

    Raises
    ------
    FileError
        The file is missing, no TOML, or a key is unknown or out of range: the message
        names the table and the key.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> path = pathlib.Path(tempfile.mkdtemp()) / "joint.toml"
    >>> _ = path.write_text("[joint]" + chr(10) + "gear_ratio = 50.0")
    >>> load_simulation(path).joint.gear_ratio
    50.0
    """
    found = decoded_simulation(path)
    return guarded_build(path, "simulation", lambda: Simulation(*found))
