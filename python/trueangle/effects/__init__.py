"""The physical effects: one file each, and the list of them.

An effect is one frozen dataclass with everything that is known about it: its parameters, the
physics in one sentence, what it needs and is confused with, its signal (simulate), its columns
and the search for it (diagnose), and its term (`trueangle.model.terms`) or the reason why it has
none (correct). To add one, write its file and add its line below.
"""

from __future__ import annotations

# The order is that in which a diagnosis tries them: where two explain equally much the
# first is named, and what two are confused by is declared by the later.
# ruff: isort: off
from .backlash import Backlash as Backlash
from .latency import Latency as Latency
from .torsional_compliance import TorsionalCompliance as TorsionalCompliance
from .scale_error import ScaleError as ScaleError
from .thermal_drift import ThermalDrift as ThermalDrift
from .missing_order import MissingOrder as MissingOrder
from .reference_error import ReferenceLines as ReferenceLines
from .sidebands import Sidebands as Sidebands
from .argument_error import ArgumentShift as ArgumentShift
from .wrong_gear_ratio import WrongGearRatio as WrongGearRatio
from .filter_lag import FilterLag as FilterLag
from .channel_skew import ChannelSkew as ChannelSkew
from .load_dependent_gear_error import LoadDependentGearError as LoadDependentGearError
from .current_coupling import CurrentCoupling as CurrentCoupling
from .joint_coupling import JointCoupling as JointCoupling
from .stiffening_compliance import StiffeningCompliance as StiffeningCompliance
from .presliding_hysteresis import PreslidingHysteresis as PreslidingHysteresis
from .direction_dependent_pattern import DirectionalPattern as DirectionalPattern
from .torque_hysteresis import TorqueHysteresis as TorqueHysteresis
from .local_defect import LocalDefect as LocalDefect
from .missed_counts import MissedCounts as MissedCounts
from .zero_slip import ZeroSlip as ZeroSlip
from .drift_within_run import DriftWithinRun as DriftWithinRun
from .clock_drift import ClockDrift as ClockDrift
from .non_integer_order import NonIntegerOrder as NonIntegerOrder
from .time_periodic import TimePeriodic as TimePeriodic
from .varying_line import VaryingLine as VaryingLine
from .outliers import Outliers as Outliers
from .heteroscedastic_noise import HeteroscedasticNoise as HeteroscedasticNoise
from .timestamp_jitter import TimestampJitter as TimestampJitter
from .quantisation import Quantisation as Quantisation
from .curve import Curve as Curve
# ruff: isort: on

from .effect import EFFECTS, KINDS, Effect

__all__ = ["EFFECTS", "KINDS", "Effect"]

__doc__ = "\n".join(
    [
        __doc__,
        *(f"- ``{kind}``: {effect.sentence}" for kind, effect in EFFECTS.items()),
        "\nWhat cannot be corrected while the joint runs, and why:\n",
        *(f"- ``{k}``: {e.not_at_run_time}." for k, e in EFFECTS.items() if e.not_at_run_time),
    ]
)
