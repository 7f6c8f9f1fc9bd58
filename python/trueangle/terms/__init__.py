r"""Terms of the correction beyond harmonics: what follows travel, speed, heat and load.

A `HarmonicModel` with ``terms`` corrects, with :math:`\varphi = \theta - v\tau`,

.. math:: \mathrm{indicated} = \varphi + \varepsilon_h(\varphi)
          + \sum_i \varepsilon_i(\varphi, \text{signals})

To add a term, write its class, add its line to `TERMS` and its variant to the core.

========================= ================================ =========================
kind                      error it adds                    signal
========================= ================================ =========================
backlash                  half width times direction       none, direction, velocity
presliding_hysteresis     builds up after a reversal       none, direction, velocity
latency                   the angle of a time before       velocity
filter_lag                harmonics behind a low-pass      velocity
thermal_drift             zero, pattern, lines per kelvin  temperature
torsional_compliance      torque times compliance          torque
stiffening_compliance     its cube, torque beyond a knee   torque
load_dependent_gear_error gear lines times torque          torque
local_defect              a bump at one place of a shaft   none
========================= ================================ =========================

What cannot be corrected while the joint runs, and why:

- ``zero_slip``: a new zero in every run is not known before the run is referenced;
  set the zero anew (``model.replace(constant=...)``).
- ``drift_within_run``: wander has no cause that a signal shows; what follows the
  temperature is ``thermal_drift``.
- ``non_integer_order``: its phase is new in every run.
- ``outliers``, ``missed_counts``: a single reading does not tell a fault from a motion
  in time; they are found afterwards, in the log.
- ``heteroscedastic_noise``: scatter has no value to subtract, only a weight.
- ``reference_error``: an error of the reference, not of the joint. It must not be
  corrected.

``missing_order``, ``sidebands`` and ``argument_error`` need no term: they are harmonics
and the argument of the model itself. ``scale_error`` is a wrong gear ratio: put the
ratio right where counts become angles.
"""

from __future__ import annotations

from .load import LoadDependentGearError, StiffeningCompliance, TorsionalCompliance
from .motion import FilterLag, Latency
from .place import LocalDefect
from .reversal import Backlash, PreslidingHysteresis
from .term import Term
from .thermal import ThermalDrift

__all__ = [
    "TERMS",
    "Backlash",
    "FilterLag",
    "Latency",
    "LoadDependentGearError",
    "LocalDefect",
    "PreslidingHysteresis",
    "StiffeningCompliance",
    "Term",
    "ThermalDrift",
    "TorsionalCompliance",
]

#: Every term by its kind, in the order of the vocabulary of causes.
TERMS: dict[str, type[Term]] = {
    term.kind: term
    for term in (
        Backlash,
        PreslidingHysteresis,
        Latency,
        FilterLag,
        ThermalDrift,
        TorsionalCompliance,
        StiffeningCompliance,
        LoadDependentGearError,
        LocalDefect,
    )
}
