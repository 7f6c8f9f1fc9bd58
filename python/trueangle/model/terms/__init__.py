"""Terms of the correction beyond harmonics: what follows travel, speed, heat, load and current.

A `HarmonicModel` with ``terms`` corrects, with ``φ = θ - vτ``,

::

    indicated = φ + ε_h(φ) + Σ_i ε_i(φ, signals)

A term states which forms of the compiled core it takes; the effects (`trueangle.effects`)
state which effect it removes and what cannot be removed while the joint runs. Missing orders,
sidebands and the argument of the pattern need no term: they are harmonics and the argument of the
model itself.
"""

from __future__ import annotations

from ..term import TERMS, Term
from .curve import CurveTerm as Curve
from .load import CurrentCouplingTerm as CurrentCoupling
from .load import LoadDependentGearErrorTerm as LoadDependentGearError
from .load import StiffeningComplianceTerm as StiffeningCompliance
from .load import TorsionalComplianceTerm as TorsionalCompliance
from .motion import ChannelSkewTerm as ChannelSkew
from .motion import FilterLagTerm as FilterLag
from .motion import LatencyTerm as Latency
from .motion import VaryingLineTerm as VaryingLine
from .place import JointCouplingTerm as JointCoupling
from .place import LocalDefectTerm as LocalDefect
from .place import ScaleErrorTerm as ScaleError
from .place import ThermalDriftTerm as ThermalDrift
from .travel import BacklashTerm as Backlash
from .travel import DirectionalPatternTerm as DirectionalPattern
from .travel import PreslidingHysteresisTerm as PreslidingHysteresis

__all__ = [
    "TERMS",
    "Backlash",
    "ChannelSkew",
    "CurrentCoupling",
    "Curve",
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
