"""The result of a fit: a model, its uncertainties, and what not to trust."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Literal, TypeAlias

from ..support.display_units import ErrorsIn
from ..support.plainresult import result_picture
from .model import FittedCoefficients
from .summary import fit_summary, plain_fit

if TYPE_CHECKING:
    from matplotlib.axes import Axes

Picture: TypeAlias = Literal["errors", "spectrum", "phases", "residuals"]


class FitResult(FittedCoefficients):
    """A fitted model and everything needed to judge it.

    All angles, amplitudes and errors are in the unit of the runs (`HarmonicModel.period`).
    Of logs too large to keep (`trueangle.fit_logs`) the readings are known by their sums:
    then `moments` has them, `weights` is None, and `runs`, `residuals` and `plot` raise.

    Attributes
    ----------
    problem : Problem
        The readings, shafts and orders that were put in.
    fitted : SolvedProblem
        The core's solution.
    weighted : Weighted
        What the loss did to the weights.
    loss : str
        The loss requested.
    ridge : float
        Tikhonov penalty relative to the sum of weights; 0 on a full turn.
    span : Span
        Segment of the turn that was travelled.
    evidence : OrderSelection or None
        What was searched, when the orders were chosen by evidence; `selection` is what it found.
    joint : tuple
        Gear ratio (or None) and fixed member, as given.
    remarks : tuple of str
        What the choice of the angle, of the weights and of the runs found; among `notes`.
    covariance_asked : {"auto", "white", "cluster", "correlated"}
        The covariance requested; `uncertainty` has the one taken.
    nuisance : Nuisance or None
        Effects other than the pattern that were removed from the readings: `runs` are without them.
    posterior : Posterior or None
        What a prior did: the share of each order that is the unit's own (`fit`, ``prior=``).
    known : Uncertainty or None
        Covariance that came with the coefficients, where orders were chosen by evidence.
    """

    def plot(self, kind: Picture = "errors", ax: Axes | None = None, **options: Any) -> Axes:
        """A picture of the fit (needs ``trueangle[plot]``).

        Parameters
        ----------
        kind : {"errors", "spectrum", "phases", "residuals"}
            Error curves with the model and its band, amplitudes of the orders, phases over
            the runs, or residuals (``against=`` angle, time, speed, temperature, torque,
            direction): see `trueangle.plots`.
        ax : matplotlib Axes, optional

        Returns
        -------
        matplotlib Axes
        """
        axes: Axes = result_picture(self, kind, ax, **options)
        return axes

    def to_dict(self) -> dict[str, Any]:
        """The object that ``trueangle fit`` prints as JSON in addition to the model."""
        return plain_fit(self)

    def summary(self, errors_in: ErrorsIn = "auto") -> str:
        """The result as text: coefficients with uncertainties, quality, notes.

        Parameters
        ----------
        errors_in : {"auto", "arcsec", "deg", "mrad", "count"} or float
            Unit of the errors; by itself arcsec, or degrees where errors are that large. A
            number is the counts of a turn.
        """
        return fit_summary(self, errors_in)

    def __repr__(self) -> str:
        return (
            f"FitResult({len(self.orders)} orders from {self.readings} readings in "
            f"{len(self.problem.runs)} runs, residual {self.residual_std:.3g}, "
            f"period={self.model.period:g})"
        )
