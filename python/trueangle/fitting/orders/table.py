"""What is known about every order that was looked at: one row of evidence each."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import Final, Self

from ...estimation.evidence import EvidenceEstimate
from ...joint.gear import Explanation
from ...model.model import Argument, HarmonicModel
from ...runs.aliasing import Positions
from ...support.arrays import Array
from ...support.plainresult import PlainResult
from .noise import ReadingVariance

#: Verdicts of orders that a model has.
IN_MODEL: Final = ("retained", "shared")

#: Verdicts of orders that are in the error and that no model shall have.
LEFT_OUT: Final = ("reference", "too long", "negligible", "too steep", "rounding", "in time")

#: How a note begins that no model of these orders is worth using: the answer, so the first line.
UNDETERMINED: Final = "NOT DETERMINED: "

#: How those notes begin that come first, the next about what is no order and no noise of readings.
FIRST: Final = (UNDETERMINED, "Not corrected: ")


@dataclass(frozen=True)
class OrderRow:
    """Evidence of the data for one order.

    Angles are in the unit of the runs unless the name states otherwise.

    Attributes
    ----------
    order : int or float
        Cycles per output turn.
    retained : bool
    verdict : str
        ``"retained"``, ``"noise"``, ``"negligible"``, ``"too steep"``, ``"alias"``,
        ``"reference"``, ``"rounding"``, ``"shared"``, ``"too long"``, ``"in time"``; with method
        ``"paper"`` also ``"small"`` and ``"phase varies"``.
    cosine, sine : float
        Coefficients A and B, fitted jointly with all retained orders.
    standard_error : float
        Of each of A and B, and of the amplitude where it is well above zero; of a retained
        order that of the fit (`FitResult.amplitude_std`).
    statistic : float
        Reduction of the sum of squares over the noise variance; about 2 for noise.
    log10_false_alarm : float
        Logarithm of the probability that noise alone reaches this statistic in the whole search.
    holdout_gain : float
        Part by which the held-out mean square falls when this order joins the other
        retained ones (negative: it makes new data worse).
    phase_spread_deg : float
        Circular range of the phase over the runs, NaN with a single run.
    aliases : tuple of int
        Orders that these readings cannot distinguish from this one.
    explanations : tuple of Explanation
        Known lines of the joint that the order or its alias may be.
    reason : str
    doubtful : bool
        True when an alias of a retained order is a known line of the joint or was a
        candidate too.
    phase_std : float
        Standard error of the phase in radians where a fit gives it, else NaN.
    needed : float
        Amplitude from which it would be significant in the whole search, at the phase that it has;
        NaN where the readings do not determine it.
    probability : float
        That the order is in the error, given the readings; NaN where sums alone are known.
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
    needed: float = math.nan
    probability: float = math.nan

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
class OrderTable(PlainResult):
    """What an `OrderSelection` holds, and what follows from it."""

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
    estimate: EvidenceEstimate | None = field(default=None, compare=False)

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
            ratio = abs(float(self.gear_ratio or math.nan))
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

    @property
    def left_out(self) -> list[float]:
        """Orders that are in the error and that no model shall have."""
        return [row.order for row in self.table if row.verdict in LEFT_OUT]

    @property
    def is_of_all_readings(self) -> bool:
        """Whether the estimate took every reading, and its coefficients are the best."""
        return self.estimate is not None and self.estimate.readings == self.samples

    def with_notes(self, notes: tuple[str, ...]) -> Self:
        """The same selection with these notes."""
        return replace(self, notes=notes)

    def as_fitted(self, model: HarmonicModel, errors: tuple[Array, Array] | None) -> Self:
        """The same with coefficients and standard errors of retained orders as a fit has them.

        One order has one amplitude and one standard error, wherever they are shown; ``errors``
        are those of amplitudes and phases, where a fit gives them.
        """
        lines = {
            order * shaft.cycles_per_turn: (shaft.cosine[i], shaft.sine[i])
            for shaft in model.shafts
            for i, order in enumerate(shaft.orders)
        }
        found = list(lines)
        rows = []
        for row in self.table:
            n = next((n for n, m in enumerate(found) if math.isclose(m, row.order)), None)
            if row.verdict in IN_MODEL and n is not None:
                cosine, sine = lines[found[n]]
                row = replace(row, cosine=float(cosine), sine=float(sine))
                if errors is not None:
                    amplitude, phase = (float(error[n]) for error in errors)
                    row = replace(row, standard_error=amplitude, phase_std=phase)
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
