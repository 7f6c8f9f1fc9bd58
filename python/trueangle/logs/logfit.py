"""What a fit of logs in one pass found: the model, its evidence, its uncertainty."""

from __future__ import annotations

import math
from dataclasses import dataclass
from html import escape
from typing import Any

from ..angles import arcsec
from ..errorunits import ErrorsIn, error_unit
from ..fitting.coefficients import Coefficients
from ..fitting.uncertainty import Uncertainty
from ..model import HarmonicModel
from ..moments import Moments, MomentsFit

__all__ = ["LogFit", "LogOrder"]


@dataclass(frozen=True)
class LogOrder:
    """Evidence for one order: a row of `LogFit.table`.

    Attributes
    ----------
    shaft : str
    order : int
        Of the shaft.
    retained : bool
    amplitude, std : float
        And its standard error, in the unit of the model.
    phase_deg : float
    held_out_gain : float
        Part of the held-out mean square error that the order takes away; NaN with one run.
    reason : str
        Why it was left out; empty for a retained one.
    """

    shaft: str
    order: int
    retained: bool
    amplitude: float
    std: float
    phase_deg: float
    held_out_gain: float
    reason: str


@dataclass(frozen=True, repr=False)
class LogFit(Coefficients):
    """A model fitted to logs in one pass.

    Attributes
    ----------
    model : HarmonicModel
    fit : MomentsFit
        Coefficients with their covariance, zeros of the runs.
    moments : Moments
        From which any other set of the accumulated orders can be solved at once.
    table : tuple of LogOrder
        Evidence for every order; empty where the orders were given.
    rows, missing : int
    notes : tuple of str
    uncertainty : Uncertainty
        Covariance of the coefficients, its kind and its degrees of freedom.
    """

    model: HarmonicModel
    fit: MomentsFit
    moments: Moments
    table: tuple[LogOrder, ...]
    rows: int
    missing: int
    notes: tuple[str, ...]
    uncertainty: Uncertainty

    @property
    def readings(self) -> int:
        """As `rows`."""
        return self.rows

    @property
    def residual_std(self) -> float:
        """Residual standard deviation, degrees of freedom allowed for."""
        return math.sqrt(self.fit.residual_variance)

    @property
    def condition_number(self) -> float:
        """Of the design with its columns scaled to unit length."""
        return self.fit.condition_number

    @property
    def method(self) -> str:
        """``"moments"`` or ``"qr"``."""
        return self.fit.method

    @property
    def offset_spread(self) -> float:
        """Standard deviation of the runs' zeros about their circular mean."""
        return 0.0 if self.model.fit is None else self.model.fit.offset_spread

    def __repr__(self) -> str:
        return (
            f"LogFit({len(self.orders)} orders from {self.rows} readings in "
            f"{len(self.moments.runs)} runs, residual {self.residual_std:.3g}, "
            f"period={self.model.period:g})"
        )

    def _repr_html_(self) -> str:
        return f"<pre>{escape(self.summary())}</pre>"

    def to_dict(self) -> dict[str, Any]:
        """The object that ``trueangle fit --json`` prints beside the model."""
        from ..fitting.plain import plain_fit

        return plain_fit(self)

    def summary(self, errors_in: ErrorsIn = "auto") -> str:
        """The result as text.

        Parameters
        ----------
        errors_in : {"auto", "arcsec", "deg", "mrad", "count"} or float
            Unit of the errors; by itself arcsec, or degrees where one reaches a degree. A
            number is the counts of a turn.
        """
        period = self.model.period
        residual = arcsec(math.sqrt(self.fit.residual_variance), period)
        sizes = [residual, *(arcsec(float(c), period) for c in self.model.amplitudes)]
        unit = error_unit(errors_in, max(filter(math.isfinite, sizes), default=0.0), period)
        lines = [
            "Harmonic model of the angle error (error = indicated - reference), one pass",
            "",
            f"  readings   {self.rows} in {len(self.moments.runs)} runs, {self.missing} missing",
            f"  residual   {unit.text(residual)} standard deviation",
            f"  solved by  {self.fit.method}, condition number {self.fit.condition_number:.3g}",
            "",
            "  shaft           order   amplitude     +-     phase",
            f"                         {unit.name:>10} {unit.name:>7}       deg",
        ]
        std = self.amplitude_std
        rows = [(shaft, i) for shaft in self.model.shafts for i in range(len(shaft.orders))]
        for n, (shaft, i) in enumerate(rows):
            size, spread = unit.pair(
                arcsec(float(shaft.amplitudes[i]), period), arcsec(float(std[n]), period)
            )
            lines.append(
                f"  {shaft.name:<15} {shaft.orders[i]:5d}  "
                f"{size:>10} {spread:>7}  "
                f"{math.degrees(float(shaft.phases[i])) % 360.0:8.2f}"
            )
        lines += ["", *(f"  [{i}] {note}" for i, note in enumerate(self.notes, 1))]
        return "\n".join(lines).rstrip()
