"""One unit of a fleet: its verdict, why, and its orders against the others'."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Final, Literal, NamedTuple, TypeAlias

from ..support.plainresult import Angle

Verdict: TypeAlias = Literal["fine", "outlier", "recalibrate", "changed", "zero_moved"]

#: The most urgent first.
VERDICTS: Final[tuple[Verdict, ...]] = ("changed", "outlier", "recalibrate", "zero_moved", "fine")


class UnitOrder(NamedTuple):
    """One order of a unit.

    ``amplitude`` and ``std`` in the unit of the fleet's period; ``z`` is the distance from the
    other units' mean in standard deviations between units, of cosine and sine together.
    """

    order: float
    amplitude: Angle
    phase_deg: float
    std: Angle
    z: float


@dataclass(frozen=True)
class FleetUnit:
    """A unit against the fleet.

    Attributes
    ----------
    unit : str
    verdict : {"fine", "outlier", "recalibrate", "changed", "zero_moved"}
    because : str
        What deviates, and its likely cause; empty where nothing does.
    orders : tuple of UnitOrder
        Of the last calibration.
    peak_to_peak : float
        Of the pattern over a turn, in the unit of the fleet's period.
    left : float
        Standard deviation of the readings about the unit's own pattern.
    p : float
        Probability that a sound unit deviates or, where it moved, changes this much, allowing for
        the number of its orders.
    limit : float
        At or below which ``p`` is reported: in 1 % of sound fleets, for all units together.
    """

    unit: str
    verdict: Verdict
    because: str
    orders: tuple[UnitOrder, ...]
    peak_to_peak: Angle
    left: Angle
    p: float
    limit: float
