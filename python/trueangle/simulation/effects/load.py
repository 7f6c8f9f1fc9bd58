"""Effects of torque: wind-up, stiffening springs, gear lines that grow with load."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ...joint.signals import Signals
from .effect import Array, Effect, Surroundings, line_sum

__all__ = ["LoadDependentGearError", "StiffeningCompliance", "TorsionalCompliance"]


def _torque(signals: Signals) -> Array:
    return np.zeros(len(signals)) if signals.torque is None else signals.torque


@dataclass(frozen=True)
class TorsionalCompliance(Effect):
    r"""Wind-up in proportion to torque: :math:`\varepsilon = \tau\,[c + g(\theta)]`.

    Parameters
    ----------
    arcsec_per_Nm : float
        c = 1/K: the measured torque at the reading times the compliance.
    lines_per_Nm : list of [output order, arcsec per Nm, phase_deg]
        g: gravity, where the torque column holds the load and not its moment
        (order 1).
    """

    arcsec_per_Nm: float = 0.0
    lines_per_Nm: tuple[tuple[float, float, float], ...] = ()

    kind: ClassVar[str] = "torsional_compliance"
    sentence: ClassVar[str] = (
        "The gear and its parts twist under torque: the error is proportional to the torque, "
        "and under gravity follows it once per turn."
    )
    needs: ClassVar[tuple[str, ...]] = ("torque",)
    factor: ClassVar[str] = "torque"
    confounded_with: ClassVar[dict[str, str]] = {
        "stiffening_compliance": "three loads or more, of both signs",
        "zero_slip": "several runs at each load, in random order",
        "thermal_drift": "change load and temperature independently",
        "missing_order": "a second load, or the base turned by 180 deg",
        "reference_error": "a second load and a turned reference",
    }
    measure: ClassVar[str] = "repeat the runs at a second, known load (or with the arm off)"

    def signal(self, signals: Signals, around: Surroundings, rng: np.random.Generator) -> Array:
        torque = _torque(signals)
        return np.asarray(
            torque * (self.arcsec_per_Nm + line_sum(signals.theta, self.lines_per_Nm))
        )


@dataclass(frozen=True)
class StiffeningCompliance(Effect):
    r"""A spring that stiffens: :math:`\varepsilon = c_1\tau + c_3\tau^3 + c_k\,h(\tau)`.

    h is the torque beyond a knee, :math:`h = \mathrm{sign}(\tau)\max(|\tau| - \tau_k, 0)`
    (the catalogue's K1, K2).

    Parameters
    ----------
    arcsec_per_Nm, arcsec_per_Nm3 : float
        c_1 and c_3.
    beyond_knee_arcsec_per_Nm, knee_Nm : float
        c_k and the knee.
    gravity_deg : float or NaN
        Where finite, the moment is :math:`\tau\sin(\theta - \theta_g)` of the load in
        the torque column.
    """

    arcsec_per_Nm: float = 0.0
    arcsec_per_Nm3: float = 0.0
    beyond_knee_arcsec_per_Nm: float = 0.0
    knee_Nm: float = 0.0
    gravity_deg: float | None = None

    kind: ClassVar[str] = "stiffening_compliance"
    sentence: ClassVar[str] = (
        "The gear stiffens under torque, as K1 and K2 of its catalogue say: the wind-up grows "
        "less than in proportion, which under gravity leaves orders 1 and 3."
    )
    needs: ClassVar[tuple[str, ...]] = ("torque",)
    factor: ClassVar[str] = "torque"
    confounded_with: ClassVar[dict[str, str]] = {
        "torsional_compliance": "three loads or more, of both signs",
    }
    measure: ClassVar[str] = "repeat the runs at three or more loads of both signs"

    def signal(self, signals: Signals, around: Surroundings, rng: np.random.Generator) -> Array:
        torque = self.moment(signals, self.gravity_deg)
        return np.asarray(
            self.arcsec_per_Nm * torque
            + self.arcsec_per_Nm3 * torque**3
            + self.beyond_knee_arcsec_per_Nm * self.beyond(torque, self.knee_Nm)
        )

    @staticmethod
    def moment(signals: Signals, gravity_deg: float | None) -> Array:
        """The torque itself, or the moment of the load it states."""
        torque = _torque(signals)
        if gravity_deg is None:
            return torque
        return np.asarray(torque * np.sin(signals.theta - np.radians(gravity_deg)))

    @staticmethod
    def beyond(torque: Array, knee: float) -> Array:
        """Torque beyond a knee, with its sign."""
        return np.asarray(np.sign(torque) * np.maximum(np.abs(torque) - knee, 0.0))


@dataclass(frozen=True)
class LoadDependentGearError(Effect):
    r"""Gear lines that grow with torque l (signed or absolute).

    .. math:: \varepsilon = \ell\,\sum_m C_m \sin(m\theta + \varphi_m)

    Parameters
    ----------
    lines_per_Nm : list of [output order, arcsec per Nm, phase_deg]
    torque : {"signed", "absolute"}
        Whether l is the torque or its absolute value.
    """

    lines_per_Nm: tuple[tuple[float, float, float], ...]
    torque: str = "signed"

    kind: ClassVar[str] = "load_dependent_gear_error"
    sentence: ClassVar[str] = (
        "Load presses the teeth of the gear into each other: its lines (motor and wave "
        "generator orders) grow with torque."
    )
    needs: ClassVar[tuple[str, ...]] = ("torque",)
    factor: ClassVar[str] = "torque"
    confounded_with: ClassVar[dict[str, str]] = {
        "thermal_drift": "change load and temperature independently",
        "missing_order": "a second load",
    }
    measure: ClassVar[str] = "repeat the runs at a second load, densely enough for the gear's lines"

    def signal(self, signals: Signals, around: Surroundings, rng: np.random.Generator) -> Array:
        torque = _torque(signals)
        if self.torque == "absolute":
            torque = np.abs(torque)
        return np.asarray(torque * line_sum(signals.theta, self.lines_per_Nm))
