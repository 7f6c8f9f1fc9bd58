"""Terms of the correction beyond harmonics: what follows travel, speed, heat, load and current.

A `HarmonicModel` with ``terms`` corrects, with ``φ = θ - vτ``,

::

    indicated = φ + ε_h(φ) + Σ_i ε_i(φ, signals)

A term stands in the file of its effect (`trueangle.effects`) and says which forms of the
compiled core it takes. Missing orders, sidebands and the argument of the pattern need no
term: they are harmonics and the argument of the model itself.
"""

from __future__ import annotations

from .effects import EFFECTS
from .effects.backlash import BacklashTerm as Backlash
from .effects.channel_skew import ChannelSkewTerm as ChannelSkew
from .effects.current_coupling import CurrentCouplingTerm as CurrentCoupling
from .effects.direction_dependent_pattern import DirectionalPatternTerm as DirectionalPattern
from .effects.filter_lag import FilterLagTerm as FilterLag
from .effects.joint_coupling import JointCouplingTerm as JointCoupling
from .effects.latency import LatencyTerm as Latency
from .effects.load_dependent_gear_error import LoadDependentGearErrorTerm as LoadDependentGearError
from .effects.local_defect import LocalDefectTerm as LocalDefect
from .effects.presliding_hysteresis import PreslidingHysteresisTerm as PreslidingHysteresis
from .effects.scale_error import ScaleErrorTerm as ScaleError
from .effects.stiffening_compliance import StiffeningComplianceTerm as StiffeningCompliance
from .effects.thermal_drift import ThermalDriftTerm as ThermalDrift
from .effects.torsional_compliance import TorsionalComplianceTerm as TorsionalCompliance
from .effects.varying_line import VaryingLineTerm as VaryingLine
from .model.term import TERMS, Term

__all__ = [
    "TERMS",
    "Backlash",
    "ChannelSkew",
    "CurrentCoupling",
    "DirectionalPattern",
    "FilterLag",
    "JointCoupling",
    "Latency",
    "LoadDependentGearError",
    "LocalDefect",
    "PreslidingHysteresis",
    "ScaleError",
    "StiffeningCompliance",
    "Term",
    "ThermalDrift",
    "TorsionalCompliance",
    "VaryingLine",
]

__doc__ = "\n".join(
    [
        __doc__,
        "What cannot be corrected while the joint runs, and why:\n",
        *(
            f"- ``{kind}``: {effect.not_at_run_time}."
            for kind, effect in EFFECTS.items()
            if effect.not_at_run_time
        ),
    ]
)
