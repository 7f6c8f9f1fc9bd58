"""Windows of a watched joint: their estimate of every order, and the cause of an alarm."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

from ..support.plainresult import Angle, ShownResult, plain_row


@dataclass(frozen=True)
class WatchedOrder:
    """One order of a window, less the model's: sizes in the unit of the model's period."""

    order: float
    amplitude: Angle
    phase_deg: float
    statistic: float


@dataclass(frozen=True)
class WatchedWindow(ShownResult):
    """One window of readings.

    Attributes
    ----------
    window : int
        Counted from 1.
    angle : float
        Of the reading that ended it.
    time : float or None
        Of the same, in seconds.
    readings : int
    orders : tuple of WatchedOrder
        What the window has beyond the model.
    statistic, limit : float
        The largest sum of all charts, and what it stays below.
    alarm : bool
    because : str
        Which orders moved by how much and since when, and what makes such orders.
    """

    window: int
    angle: float
    time: float | None
    readings: int
    orders: tuple[WatchedOrder, ...]
    statistic: float
    limit: float
    alarm: bool
    because: str

    def plain(self, scale: float) -> dict[str, Any]:
        """As plain values; sizes times ``scale`` are arcsec."""
        found = plain_row(self, scale)
        return {{"time": "time_s"}.get(k, k): v for k, v in found.items() if k != "readings"}
