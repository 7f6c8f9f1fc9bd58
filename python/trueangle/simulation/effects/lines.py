"""Lines: missing orders, sidebands, orders that are not whole, errors of the reference."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ...errors import ArgumentError
from ...joint.signals import Signals
from .effect import Array, Effect, Surroundings, line_sum

__all__ = ["MissingOrder", "NonIntegerOrder", "ReferenceLines", "Sidebands"]

_FREE_ANGLES = (
    "readings at jittered or free angles, or one more round with the artefact clamped "
    "off the grid (plan with 'trueangle plan'; about 2.14 deg for 36 positions)"
)


@dataclass(frozen=True)
class MissingOrder(Effect):
    r"""A periodic line: :math:`C \sin(k f \theta + \varphi)` of a shaft that turns f times.

    Parameters
    ----------
    shaft : str
    order : float
    amplitude_arcsec, phase_deg : float
    """

    shaft: str
    order: float
    amplitude_arcsec: float
    phase_deg: float = 0.0

    kind: ClassVar[str] = "missing_order"
    sentence: ClassVar[str] = "A periodic error of one shaft that the simulation does not have."
    confounded_with: ClassVar[dict[str, str]] = {
        "reference_error": "turn the reference on its mount (0, 130, 250 deg)",
        "torsional_compliance": "a second load",
        "sidebands": _FREE_ANGLES,
    }
    measure: ClassVar[str] = _FREE_ANGLES

    def signal(self, signals: Signals, around: Surroundings, rng: np.random.Generator) -> Array:
        order = around.joint.output_order(self.shaft, self.order)
        return line_sum(signals.theta, ((order, self.amplitude_arcsec, self.phase_deg),))


@dataclass(frozen=True)
class Sidebands(Effect):
    """Lines beside a gear order: its amplitude or phase is modulated once or twice a turn.

    Parameters
    ----------
    carrier : float
        Output order of the modulated line.
    offsets, amplitudes_arcsec, phases_deg : list of float
        Lines at ``carrier + offset``.
    """

    carrier: float
    offsets: tuple[float, ...]
    amplitudes_arcsec: tuple[float, ...]
    phases_deg: tuple[float, ...]

    kind: ClassVar[str] = "sidebands"
    sentence: ClassVar[str] = (
        "Eccentricity or tilt at the output changes the depth of mesh as it turns: a gear line "
        "is modulated and has neighbours one or two orders away."
    )
    confounded_with: ClassVar[dict[str, str]] = {"missing_order": _FREE_ANGLES}
    measure: ClassVar[str] = _FREE_ANGLES

    def __post_init__(self) -> None:
        if not len(self.offsets) == len(self.amplitudes_arcsec) == len(self.phases_deg):
            raise ArgumentError("offsets, amplitudes_arcsec and phases_deg must be equally long")

    def signal(self, signals: Signals, around: Surroundings, rng: np.random.Generator) -> Array:
        lines = zip(self.offsets, self.amplitudes_arcsec, self.phases_deg, strict=True)
        return line_sum(signals.theta, tuple((self.carrier + o, a, p) for o, a, p in lines))


@dataclass(frozen=True)
class NonIntegerOrder(Effect):
    r"""A line whose phase is new in every run: :math:`C\sin(f\theta + \varphi_j)`.

    Parameters
    ----------
    order : float
        Cycles per output turn, not a whole number.
    amplitude_arcsec : float
    """

    order: float
    amplitude_arcsec: float

    kind: ClassVar[str] = "non_integer_order"
    sentence: ClassVar[str] = (
        "A bearing's cage or balls roll with slip: a line at an order that is not whole, with "
        "another phase in every run."
    )
    factor: ClassVar[str] = "run"
    confounded_with: ClassVar[dict[str, str]] = {
        "missing_order": "several turns in each run, and several runs",
        "drift_within_run": "several turns in each run",
    }
    measure: ClassVar[str] = "several turns in one record, and several records, at free angles"
    transfers: ClassVar[bool] = False
    correctable: ClassVar[bool] = False

    def signal(self, signals: Signals, around: Surroundings, rng: np.random.Generator) -> Array:
        phase = rng.uniform(0.0, 2.0 * np.pi, signals.runs)[signals.run]
        return np.asarray(self.amplitude_arcsec * np.sin(self.order * signals.theta + phase))


@dataclass(frozen=True)
class ReferenceLines(Effect):
    r"""Error of the reference, which turns with its mount: lines in :math:`\theta + \psi`.

    Parameters
    ----------
    orders, amplitudes_arcsec, phases_deg : list of float
        ``C sin(h (theta + psi) + phase)`` with the mount angle psi.
    mount_sign : {1, -1}
        -1 where the mount angle was counted the other way.
    """

    orders: tuple[float, ...]
    amplitudes_arcsec: tuple[float, ...]
    phases_deg: tuple[float, ...]
    mount_sign: float = 1.0

    kind: ClassVar[str] = "reference_error"
    sentence: ClassVar[str] = (
        "The reference (polygon, table, encoder) has an error of its own or sits off centre: it "
        "turns with the reference's mount and is not the joint's."
    )
    needs: ClassVar[tuple[str, ...]] = ("mount",)
    factor: ClassVar[str] = "mount"
    confounded_with: ClassVar[dict[str, str]] = {
        "missing_order": "turn the reference on its mount (0, 130, 250 deg)",
    }
    measure: ClassVar[str] = (
        "turn the reference on its mount by unlike angles (0, 130, 250 deg) and repeat"
    )
    correctable: ClassVar[bool] = False

    def __post_init__(self) -> None:
        if not len(self.orders) == len(self.amplitudes_arcsec) == len(self.phases_deg):
            raise ArgumentError("orders, amplitudes_arcsec and phases_deg must be equally long")

    def signal(self, signals: Signals, around: Surroundings, rng: np.random.Generator) -> Array:
        lines = tuple(zip(self.orders, self.amplitudes_arcsec, self.phases_deg, strict=True))
        return line_sum(self.angle(signals, self.mount_sign), lines)

    @staticmethod
    def angle(signals: Signals, mount_sign: float) -> Array:
        """Angle on the reference artefact, radians."""
        if signals.mount is None:
            return signals.theta
        return np.asarray(signals.theta + mount_sign * signals.mount)
