"""Zero and line amplitudes that follow the temperature."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ...joint.signals import Signals
from .effect import Array, Effect, Surroundings, line_sum

__all__ = ["ThermalDrift"]


@dataclass(frozen=True)
class ThermalDrift(Effect):
    r"""Error that grows with :math:`\Delta T = T - T_0`.

    .. math:: \varepsilon = \Delta T\,[k_0 + k_p\,p(\theta)
              + \sum_m C_m \sin(m\theta + \varphi_m)]

    Parameters
    ----------
    zero_arcsec_per_K : float
        k_0.
    pattern_per_K : float
        k_p: relative growth of the whole pattern (field strength).
    lines_per_K : list of [output order, arcsec per kelvin, phase_deg]
    reference_C : float
        T_0, where the simulation's lines hold.
    """

    zero_arcsec_per_K: float = 0.0
    pattern_per_K: float = 0.0
    lines_per_K: tuple[tuple[float, float, float], ...] = ()
    reference_C: float = 20.0

    kind: ClassVar[str] = "thermal_drift"
    sentence: ClassVar[str] = (
        "Mounts expand and the magnet weakens with temperature: the zero and the lines of the "
        "encoder or the gear change in proportion to the temperature."
    )
    needs: ClassVar[tuple[str, ...]] = ("temperature",)
    factor: ClassVar[str] = "temperature"
    confounded_with: ClassVar[dict[str, str]] = {
        "zero_slip": "several runs at each temperature, in random order",
        "drift_within_run": "heat twice and return, temperatures in random order",
        "load_dependent_gear_error": "change load and temperature independently",
        "torsional_compliance": "change load and temperature independently",
        "backlash": "both directions at each temperature",
    }
    measure: ClassVar[str] = (
        "repeat the runs at a second temperature at least 10 K away, logging the sensor's own"
    )

    def signal(self, signals: Signals, around: Surroundings, rng: np.random.Generator) -> Array:
        if signals.temperature is None:
            return np.zeros(len(signals))
        per_kelvin = self.zero_arcsec_per_K + line_sum(signals.theta, self.lines_per_K)
        if self.pattern_per_K:
            per_kelvin = per_kelvin + self.pattern_per_K * around.pattern.value(signals.theta)
        return np.asarray((signals.temperature - self.reference_C) * per_kelvin)
