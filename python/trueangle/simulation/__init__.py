"""Simulation of a joint: its assumed model, and how it would be measured."""

from __future__ import annotations

from pathlib import Path

from ..effects import EFFECTS as EFFECTS
from ..effects import ArgumentShift as ArgumentShift
from ..effects import Backlash as Backlash
from ..effects import ChannelSkew as ChannelSkew
from ..effects import ClockDrift as ClockDrift
from ..effects import CurrentCoupling as CurrentCoupling
from ..effects import Curve as Curve
from ..effects import DirectionalPattern as DirectionalPattern
from ..effects import DriftWithinRun as DriftWithinRun
from ..effects import Effect as Effect
from ..effects import FilterLag as FilterLag
from ..effects import HeteroscedasticNoise as HeteroscedasticNoise
from ..effects import JointCoupling as JointCoupling
from ..effects import Latency as Latency
from ..effects import LoadDependentGearError as LoadDependentGearError
from ..effects import LocalDefect as LocalDefect
from ..effects import MissedCounts as MissedCounts
from ..effects import MissingOrder as MissingOrder
from ..effects import NonIntegerOrder as NonIntegerOrder
from ..effects import Outliers as Outliers
from ..effects import PreslidingHysteresis as PreslidingHysteresis
from ..effects import Quantisation as Quantisation
from ..effects import ReferenceLines as ReferenceLines
from ..effects import ScaleError as ScaleError
from ..effects import Sidebands as Sidebands
from ..effects import StiffeningCompliance as StiffeningCompliance
from ..effects import ThermalDrift as ThermalDrift
from ..effects import TimePeriodic as TimePeriodic
from ..effects import TimestampJitter as TimestampJitter
from ..effects import TorqueHysteresis as TorqueHysteresis
from ..effects import TorsionalCompliance as TorsionalCompliance
from ..effects import VaryingLine as VaryingLine
from ..effects import WrongGearRatio as WrongGearRatio
from ..effects import ZeroSlip as ZeroSlip
from ..joint.joint import Head as Head
from ..joint.joint import Joint as Joint
from ..joint.pattern import Harmonic as Harmonic
from ..joint.pattern import Pattern as Pattern
from ..joint.signals import Signals as Signals
from ..joint.signals import join_runs as join_runs
from ..support.argumentkinds import told_kinds
from .designs import RunDesign as RunDesign
from .simulation import Simulation as Simulation
from .simulation import simulate as simulate
from .simulation import simulate_along as simulate_along
from .simulationtext import decoded_simulation, guarded_build


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
