"""Effects that a simulation can have; the vocabulary of causes in one place.

An effect is one frozen dataclass; to add one, write it and add its line to `EFFECTS`.

=========================== ========================================================
kind                        error it adds
=========================== ========================================================
missing_order               a line of one shaft
sidebands                   lines beside a gear order
non_integer_order           a line of free order with a new phase in every run
backlash                    half width times direction of travel
presliding_hysteresis       reversal error that builds up over a length
latency                     minus velocity times delay, the pattern shifted too
filter_lag                  the pattern low-passed with speed, no ramp
thermal_drift               zero, pattern or lines per kelvin
torsional_compliance        torque times compliance
stiffening_compliance       torque, its cube, torque beyond a knee
load_dependent_gear_error   gear lines times torque
zero_slip                   a new zero in every run
drift_within_run            ramp and random walk in time
scale_error                 ramp in angle
reference_error             lines that turn with the reference's mount
argument_error              the pattern at the indicated angle
outliers                    isolated wild readings
missed_counts               a step that stays until the end of a run
heteroscedastic_noise       scatter that depends on angle, speed, load
local_defect                a bump at one place of a shaft
=========================== ========================================================
"""

from __future__ import annotations

from .dispersion import HeteroscedasticNoise, Outliers
from .effect import Effect, Surroundings
from .lines import MissingOrder, NonIntegerOrder, ReferenceLines, Sidebands
from .load import LoadDependentGearError, StiffeningCompliance, TorsionalCompliance
from .motion import FilterLag, Latency
from .place import ArgumentShift, LocalDefect
from .reversal import Backlash, PreslidingHysteresis
from .run_level import DriftWithinRun, MissedCounts, ScaleError, ZeroSlip
from .temperature import ThermalDrift

__all__ = ["EFFECTS", "Effect", "Surroundings"]

#: Every effect by its kind, in the order of the vocabulary.
EFFECTS: dict[str, type[Effect]] = {
    effect.kind: effect
    for effect in (
        MissingOrder,
        Sidebands,
        NonIntegerOrder,
        Backlash,
        PreslidingHysteresis,
        Latency,
        FilterLag,
        ThermalDrift,
        TorsionalCompliance,
        StiffeningCompliance,
        LoadDependentGearError,
        ZeroSlip,
        DriftWithinRun,
        ScaleError,
        ReferenceLines,
        ArgumentShift,
        Outliers,
        MissedCounts,
        HeteroscedasticNoise,
        LocalDefect,
    )
}
