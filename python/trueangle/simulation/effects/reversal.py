"""Reversal errors: backlash and presliding hysteresis."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ...joint.signals import Signals
from .effect import Array, Effect, Surroundings, line_sum

__all__ = ["Backlash", "PreslidingHysteresis"]

_TWO_SPEEDS = (
    "move in both directions at two speeds at least a factor of 3 apart, or read at rest as well"
)
_WITHIN_ONE_RUN = "reverse inside a run: both directions between two zeros"
_AFTER_REVERSAL = (
    "record the first 10 to 30 deg after each reversal in steps of 0.3 deg or less, "
    "with several reversal points"
)


@dataclass(frozen=True)
class Backlash(Effect):
    r"""Constant reversal error: :math:`\varepsilon = b\,d`, d = direction of travel.

    Parameters
    ----------
    half_width_arcsec : float
        b: half of forward minus reverse, on average over a turn.
    lines : list of [output order, arcsec, phase_deg]
        How b varies with the place.
    """

    half_width_arcsec: float
    lines: tuple[tuple[float, float, float], ...] = ()

    kind: ClassVar[str] = "backlash"
    sentence: ClassVar[str] = (
        "Play in the gear, a coupling or a key: the output lags by a constant angle "
        "whose sign is the direction of travel, whatever the speed, load and place."
    )
    factor: ClassVar[str] = "direction"
    confounded_with: ClassVar[dict[str, str]] = {
        "latency": _TWO_SPEEDS,
        "presliding_hysteresis": _AFTER_REVERSAL,
        "zero_slip": _WITHIN_ONE_RUN,
    }
    measure: ClassVar[str] = "approach every position from both directions, within each run"

    def signal(self, signals: Signals, around: Surroundings, rng: np.random.Generator) -> Array:
        width = self.half_width_arcsec + line_sum(signals.theta, self.lines)
        return np.asarray(width * signals.direction)


@dataclass(frozen=True)
class PreslidingHysteresis(Effect):
    r"""Reversal error with a transition length L (Dahl): :math:`\varepsilon = h\,z(s)`.

    .. math:: z(s) = d - (d - z_0)\,e^{-s/L}

    for travel s since the reversal, z_0 being the state there.

    Parameters
    ----------
    amplitude_arcsec : float
        h: half of the reversal error far from the reversal.
    length_deg : float
        L: travel in which it builds up.
    start_state : float
        Share of the wind-up that is there when a run starts: 0 relaxed, 1 run in.
    """

    amplitude_arcsec: float
    length_deg: float
    start_state: float = 0.0

    kind: ClassVar[str] = "presliding_hysteresis"
    sentence: ClassVar[str] = (
        "Friction winds up the elastic parts after each reversal: the error moves from one "
        "branch to the other over a transition length and remembers where it turned."
    )
    factor: ClassVar[str] = "direction"
    confounded_with: ClassVar[dict[str, str]] = {
        "backlash": _AFTER_REVERSAL,
        "latency": _TWO_SPEEDS,
        "zero_slip": _WITHIN_ONE_RUN,
    }
    measure: ClassVar[str] = _AFTER_REVERSAL

    def signal(self, signals: Signals, around: Surroundings, rng: np.random.Generator) -> Array:
        return self.amplitude_arcsec * signals.presliding(self.length_deg, self.start_state)
