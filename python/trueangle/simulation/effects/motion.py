"""Effects of speed: a delay of the reading and a filter in the encoder."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from ...joint.signals import Signals
from .effect import Array, Effect, Surroundings

__all__ = ["FilterLag", "Latency", "low_pass"]

#: Arcsec in a degree.
ARCSEC_PER_DEG = 3600.0


@dataclass(frozen=True)
class Latency(Effect):
    r"""Pure delay: the reading is that of a time tau earlier.

    .. math:: \varepsilon = -v\tau + p(\theta - v\tau) - p(\theta)

    Parameters
    ----------
    delay_s : float
        tau, seconds.
    """

    delay_s: float

    kind: ClassVar[str] = "latency"
    sentence: ClassVar[str] = (
        "The joint's reading is older than the reference's: the error is proportional to "
        "velocity and the pattern is shifted along with it."
    )
    needs: ClassVar[tuple[str, ...]] = ("time",)
    factor: ClassVar[str] = "velocity"
    confounded_with: ClassVar[dict[str, str]] = {
        "backlash": "two speeds at least a factor of 3 apart in both directions",
        "zero_slip": "two speeds or both directions inside one run",
        "filter_lag": "three speeds, the fastest with the gear lines above 10 Hz",
    }
    measure: ClassVar[str] = (
        "record moving, time-stamped, in both directions at two speeds a factor of 3 apart"
    )

    def signal(self, signals: Signals, around: Surroundings, rng: np.random.Generator) -> Array:
        moved = -self.delay_s * np.radians(signals.turns_per_s * 360.0)
        pattern = around.pattern
        ramp = np.degrees(moved) * ARCSEC_PER_DEG
        return np.asarray(
            ramp + pattern.value(signals.theta + moved) - pattern.value(signals.theta)
        )

    @staticmethod
    def regressors(signals: Signals, around: Surroundings) -> Array:
        """Column whose coefficient is tau, arcsec per second, to first order in tau."""
        speed = signals.turns_per_s * (360.0 * ARCSEC_PER_DEG)
        return np.asarray(-(speed * (1.0 + around.pattern.slope(signals.theta)))[:, None])


@dataclass(frozen=True)
class FilterLag(Effect):
    r"""First-order low-pass on the pattern without a ramp error (type-2 tracking loop).

    A line of order m at v turns per second is multiplied by
    :math:`1/(1 + j\,m v/f_c)`.

    Parameters
    ----------
    cutoff_hz : float
        f_c.
    """

    cutoff_hz: float

    kind: ClassVar[str] = "filter_lag"
    sentence: ClassVar[str] = (
        "A filter or tracking loop in the encoder follows the ramp but smooths the pattern: "
        "fast lines shrink and trail in proportion to speed."
    )
    needs: ClassVar[tuple[str, ...]] = ("time",)
    factor: ClassVar[str] = "velocity"
    confounded_with: ClassVar[dict[str, str]] = {
        "latency": "three speeds, the fastest with the gear lines above a tenth of the cutoff",
        "missing_order": "both directions or two speeds",
    }
    measure: ClassVar[str] = (
        "record moving at two or more speeds in both directions, densely enough for gear lines"
    )

    def signal(self, signals: Signals, around: Surroundings, rng: np.random.Generator) -> Array:
        pattern = around.pattern
        seen = pattern.passed(
            signals.theta, signals.turns_per_s, lambda f: low_pass(f, self.cutoff_hz)
        )
        return np.asarray(seen - pattern.value(signals.theta))


def low_pass(frequency: Array, cutoff: float) -> NDArray[np.complex128]:
    """Gain of a first-order low-pass at a signed frequency, both in Hz."""
    return np.asarray(1.0 / (1.0 + 1j * (frequency / cutoff)))
