"""The result of a selection of orders: one row of evidence per order."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any

from ...joint.gear import Explanation
from ...model.model import Argument
from ...runs.aliasing import Positions
from ...support.display_units import ErrorsIn
from ...support.plainresult import PlainResult, result_picture
from .noise import ReadingVariance

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..result import FitResult

#: Orders that the one line of a selection lists.
_SHOWN = 6


@dataclass(frozen=True)
class OrderRow:
    """What the data say about one order.

    Angles are in the unit of the runs unless the name says otherwise.

    Attributes
    ----------
    order : int or float
        Cycles per output turn.
    retained : bool
    verdict : str
        ``"retained"``, ``"noise"``, ``"no held-out gain"``, ``"negligible"``,
        ``"too steep"``, ``"alias"``, ``"reference"``, ``"weak"``, ``"rounding"``,
        ``"too long"``; with method ``"paper"`` also ``"small"`` and ``"phase varies"``.
    cosine, sine : float
        Coefficients A and B beside all retained orders.
    standard_error : float
        Of each of A and B, and of the amplitude where it is well above zero; of a retained
        order that of the fit (`FitResult.amplitude_std`).
    statistic : float
        Reduction of the sum of squares over the noise variance; about 2 for noise.
    log10_false_alarm : float
        Logarithm of the chance that noise alone does as well in the whole search.
    holdout_gain : float
        Part by which the held-out mean square falls when this order joins the other
        retained ones (negative: it makes new data worse).
    phase_spread_deg : float
        Circular range of the phase over the runs, NaN with a single run.
    aliases : tuple of int
        Orders that these readings cannot tell from this one.
    explanations : tuple of Explanation
        Known lines of the joint that the order or an alias of it may be.
    reason : str
    doubtful : bool
        True when an alias of a retained order is a known line of the joint or was a
        candidate too.
    phase_std : float
        Standard error of the phase in radians where a fit tells it, else NaN.
    """

    order: float
    retained: bool
    verdict: str
    cosine: float
    sine: float
    standard_error: float
    statistic: float
    log10_false_alarm: float
    holdout_gain: float
    phase_spread_deg: float
    aliases: tuple[float, ...] = ()
    explanations: tuple[Explanation, ...] = ()
    reason: str = ""
    doubtful: bool = False
    phase_std: float = math.nan

    @property
    def amplitude(self) -> float:
        """``hypot(A, B)``."""
        return math.hypot(self.cosine, self.sine)

    @property
    def phase_deg(self) -> float:
        """``atan2(A, B)`` in degrees, in (-180, 180]."""
        return math.degrees(math.atan2(self.cosine, self.sine))

    @property
    def phase_error_deg(self) -> float:
        """Standard error of the phase; 180 at most."""
        if math.isfinite(self.phase_std):
            return min(180.0, math.degrees(self.phase_std))
        ratio = self.standard_error / self.amplitude if self.amplitude > 0.0 else math.inf
        return min(180.0, math.degrees(ratio))


@dataclass(frozen=True, eq=False, repr=False)
class OrderSelection(PlainResult):
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

    orders: tuple[float, ...]
    table: tuple[OrderRow, ...]
    reason: str
    method: str
    period: float
    positions: Positions
    samples: int
    runs: int
    noise: ReadingVariance
    holdout: str
    holdout_rms: tuple[float, float]
    gear_ratio: float | None = None
    notes: tuple[str, ...] = ()
    argument: Argument = "reference"
    shafts: Mapping[str, float] = field(default_factory=dict)

    @property
    def by_shaft(self) -> Mapping[str, tuple[int, ...]]:
        """Retained orders as `trueangle.fit` takes them: whole ones belong to the output.

        Orders that are not whole are those of a gear whose ratio is not; they belong to
        the motor, or to the wave generator one turn apart from it.
        """
        found: dict[str, list[int]] = {}
        for order in self.orders:
            if float(order).is_integer():
                found.setdefault("output", []).append(int(order))
                continue
            ratio = float(self.gear_ratio or math.nan)
            for shaft, cycles in (
                *self.shafts.items(),
                ("motor", ratio),
                ("wave_generator", ratio + 1.0),
                ("wave_generator", ratio - 1.0),
            ):
                if abs(order / cycles - round(order / cycles)) < 1e-9:
                    found.setdefault(shaft, []).append(round(order / cycles))
                    break
        return {shaft: tuple(orders) for shaft, orders in found.items()}

    def with_notes(self, notes: tuple[str, ...]) -> OrderSelection:
        """The same selection with these notes."""
        return replace(self, notes=notes)

    def as_fitted(self, fit: FitResult) -> OrderSelection:
        """The same with coefficients and standard errors of retained orders as a fit has them.

        One order has one amplitude and one standard error, wherever they are shown.
        """
        known = fit.model.covariance is not None
        lines = {
            order * shaft.cycles_per_turn: (shaft.cosine[i], shaft.sine[i])
            for shaft in fit.model.shafts
            for i, order in enumerate(shaft.orders)
        }
        found = list(lines)
        rows = []
        for row in self.table:
            n = next((n for n, m in enumerate(found) if math.isclose(m, row.order)), None)
            if row.retained and n is not None:
                cosine, sine = lines[found[n]]
                row = replace(row, cosine=float(cosine), sine=float(sine))
                if known:
                    errors = float(fit.amplitude_std[n]), float(fit.phase_std[n])
                    row = replace(row, standard_error=errors[0], phase_std=errors[1])
            rows.append(row)
        return replace(self, table=tuple(rows))

    def row(self, order: float) -> OrderRow:
        """The row of one order.

        Raises
        ------
        KeyError
            The order was not among the candidates.
        """
        for row in self.table:
            if row.order == order:
                return row
        raise KeyError(order)

    @property
    def note(self) -> str:
        """The notes in one line, for a model's record."""
        return ". ".join(note[:1].upper() + note[1:] for note in self.notes)

    def to_dict(self) -> dict[str, Any]:
        """The object that ``trueangle orders`` prints as JSON."""
        from .summary import plain_selection

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
        from .summary import selection_summary

        return selection_summary(self, errors_in)

    def __repr__(self) -> str:
        orders = ", ".join(f"{k:g}" for k in self.orders[:_SHOWN])
        more = ", ..." if len(self.orders) > _SHOWN else ""
        return (
            f"OrderSelection(orders=({orders}{more}), {self.samples} readings in "
            f"{self.runs} runs, period={self.period:g})"
        )
