"""The result of a selection of orders."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any

from ...support.display_units import ErrorsIn
from ...support.plainresult import result_picture
from .summary import plain_selection, selection_summary
from .table import OrderTable

if TYPE_CHECKING:
    from matplotlib.axes import Axes

#: Orders that the one line of a selection lists.
_SHOWN = 6


class OrderSelection(OrderTable):
    """Orders that the data support, and the evidence for and against each candidate.

    Attributes
    ----------
    orders : tuple of int (or float for a gear whose ratio is not whole)
        Retained orders of the output turn, ascending; may be empty.
    table : tuple of OrderRow
        One row per candidate that was looked at closely, ascending.
    reason : str
        Why nothing was retained; empty otherwise.
    method : str
    period : float
        Unit of the amplitudes.
    positions : Positions
        Distinct positions of the readings.
    samples, runs : int
    noise : Noise
        Variance of a reading of weight 1 and where it comes from.
    holdout : str
        What was held out.
    holdout_rms : (float, float)
        Held-out rms without any order and with the retained ones.
    gear_ratio : float or None
    notes : tuple of str
        What a user must know before trusting the orders.
    argument : {"reference", "indicated"}
        Angle that the orders were sought in.
    shafts : mapping of str to float
        Further shafts that were declared, and their cycles per output turn.
    """

    def to_dict(self) -> dict[str, Any]:
        """The object that ``trueangle orders`` prints as JSON."""
        return plain_selection(self)

    def plot(self, ax: Axes | None = None, errors_in: ErrorsIn = "auto") -> Axes:
        """Amplitude of every candidate with its threshold (needs ``trueangle[plot]``)."""
        axes: Axes = result_picture(self, ax, errors_in)
        return axes

    def summary(self, errors_in: ErrorsIn = "auto") -> str:
        """The table and its notes as text.

        Parameters
        ----------
        errors_in : {"auto", "arcsec", "deg", "mrad", "count"} or float
            Unit of the errors; by itself arcsec, or degrees where errors are that large. A
            number is the counts of a turn.
        """
        return selection_summary(self, errors_in)

    def __repr__(self) -> str:
        orders = ", ".join(f"{k:g}" for k in self.orders[:_SHOWN])
        more = ", ..." if len(self.orders) > _SHOWN else ""
        return (
            f"OrderSelection(orders=({orders}{more}), {self.samples} readings in "
            f"{self.runs} runs, period={self.period:g})"
        )
