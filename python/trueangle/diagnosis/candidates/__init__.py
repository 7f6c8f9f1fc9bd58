"""Candidate causes: one class each, one line in `CANDIDATES`.

Causes of the scatter (outliers, heteroscedastic noise) have no regressors and live in
`trueangle.diagnosis.dispersion`.
"""

from __future__ import annotations

from .blocks import LoadDependentGearCandidate, ThermalCandidate, TorsionalCandidate
from .candidate import Candidate
from .lines import MissingOrderCandidate, ReferenceCandidate, SidebandsCandidate
from .motion import FilterLagCandidate, LatencyCandidate
from .noninteger import NonIntegerCandidate
from .place import ArgumentCandidate, DefectCandidate, MissedCountsCandidate
from .reversal import BacklashCandidate, HysteresisCandidate
from .run_level import DriftCandidate, ScaleCandidate, ZeroSlipCandidate
from .stiffening import StiffeningCandidate

__all__ = ["CANDIDATES", "FLEXIBLE", "SEPARATE", "Candidate"]

#: Every candidate by its cause; where two explain equally much the first is named.
CANDIDATES: dict[str, Candidate] = {
    candidate.cause: candidate
    for candidate in (
        BacklashCandidate(),
        LatencyCandidate(),
        TorsionalCandidate(),
        ScaleCandidate(),
        ThermalCandidate(),
        MissingOrderCandidate(),
        ReferenceCandidate(),
        SidebandsCandidate(),
        ArgumentCandidate(),
        FilterLagCandidate(),
        LoadDependentGearCandidate(),
        StiffeningCandidate(),
        HysteresisCandidate(),
        DefectCandidate(),
        MissedCountsCandidate(),
        ZeroSlipCandidate(),
        DriftCandidate(),
        NonIntegerCandidate(),
    )
}

#: Causes flexible enough to imitate a specific one; chosen only after those had a say.
FLEXIBLE = ("zero_slip", "drift_within_run", "missed_counts", "non_integer_order")

#: Causes whose every term is a finding of its own.
SEPARATE = ("missing_order", "local_defect")
