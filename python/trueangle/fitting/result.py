"""The result of a fit: a model, its uncertainties, and what not to trust."""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import cached_property
from html import escape
from typing import TYPE_CHECKING, Any

import numpy as np
from numpy.typing import NDArray

from ..distributions import student_quantile
from ..errors import ArgumentError
from ..model import HarmonicModel
from ..runs import CalibrationRun
from .model import build_model, fit_notes
from .nuisance import Nuisance
from .problem import Fitted, Problem
from .robust import Weighted
from .travel import Span
from .uncertainty import CovarianceKind, Uncertainty, uncertainty

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..orders.select import OrderSelection

__all__ = ["FitResult"]

Array = NDArray[np.float64]


@dataclass(frozen=True, eq=False, repr=False)
class FitResult:
    """A fitted model and everything needed to judge it.

    All angles, amplitudes and errors are in the unit of the runs (`HarmonicModel.period`).

    Attributes
    ----------
    problem : Problem
        The readings, shafts and orders that were put in.
    fitted : Fitted
        The core's solution.
    weighted : Weighted
        What the loss did to the weights.
    loss : str
        The loss asked for.
    ridge : float
        Tikhonov penalty relative to the sum of weights; 0 on a full turn.
    span : Span
        Stretch of the turn that was travelled.
    selection : OrderSelection or None
        The evidence, when the orders were chosen by it.
    joint : tuple
        Gear ratio (or None) and fixed member, as told.
    remarks : tuple of str
        What the choice of the angle, of the weights and of the runs found; among `notes`.
    covariance_asked : {"auto", "white", "cluster", "hac"}
        The covariance asked for; `uncertainty` has the one taken.
    nuisance : Nuisance or None
        What was taken out of the readings beside the pattern: `runs` are without it.
    """

    problem: Problem
    fitted: Fitted
    weighted: Weighted
    loss: str
    ridge: float
    span: Span
    selection: OrderSelection | None
    joint: tuple[float | None, str]
    remarks: tuple[str, ...] = ()
    covariance_asked: CovarianceKind = "auto"
    nuisance: Nuisance | None = None

    @cached_property
    def model(self) -> HarmonicModel:
        """The fitted model, with its covariance and the record of this fit."""
        return build_model(self)

    @cached_property
    def notes(self) -> tuple[str, ...]:
        """What not to trust and why."""
        return tuple(fit_notes(self))

    @property
    def weights(self) -> list[Array] | None:
        """Weights that a robust loss ended with; 0 marks readings set aside as wild."""
        return self.weighted.weights

    @property
    def runs(self) -> tuple[CalibrationRun, ...]:
        """The runs fitted, as given but for `nuisance`."""
        return tuple(self.problem.runs)

    @property
    def offsets(self) -> Array:
        """Zero of every run, a nuisance of the fit; the constant is their circular mean."""
        return self.fitted.offsets

    @property
    def offset_std(self) -> Array:
        """Standard errors of `offsets`."""
        std = np.full(len(self.problem.runs), np.nan)
        std[np.isfinite(self.offsets)] = self.fitted.solution.offset_std
        return std

    @property
    def offset_spread(self) -> float:
        """Standard deviation of the runs' zeros about their circular mean."""
        return 0.0 if self.model.fit is None else self.model.fit.offset_spread

    @property
    def residual_variance(self) -> float:
        """Weighted sum of squared residuals over `degrees_of_freedom`."""
        return self.fitted.solution.residual_variance

    @property
    def residual_std(self) -> float:
        """Residual standard deviation, degrees of freedom allowed for."""
        return math.sqrt(self.residual_variance)

    @property
    def degrees_of_freedom(self) -> float:
        """Readings less unknowns; effective (not whole) with a ridge."""
        return self.fitted.solution.degrees_of_freedom

    @property
    def rank(self) -> int:
        """Numerical rank of the design."""
        return self.fitted.solution.rank

    @property
    def condition_number(self) -> float:
        """Of the design with its columns scaled to unit length."""
        return self.fitted.solution.condition_number

    @property
    def method(self) -> str:
        """The way taken: ``"plain"``, ``"moments"``, ``"qr"`` or ``"counts"``, see `fit`."""
        return self.fitted.solution.method

    @property
    def covariance(self) -> Array:
        """Of ``[constant, A, B of each order of each shaft in turn]``."""
        if self.model.covariance is None:
            raise ArgumentError(
                "no covariance: as many unknowns as readings leave no residual to take it from"
            )
        return self.model.covariance

    @cached_property
    def uncertainty(self) -> Uncertainty:
        """Covariance, its kind and the degrees of freedom of each coefficient's variance."""
        weights = self.weights or self.problem.base
        found = uncertainty(self.problem, self.fitted, weights, self.ridge, self.covariance_asked)
        if self.nuisance is None or not self.nuisance.inflation:
            return found
        wider = np.array([1.0, *self.nuisance.inflation])
        return found._replace(covariance=found.covariance * np.outer(wider, wider))

    def interval(self, level: float = 0.95) -> Array:
        r"""Intervals that hold the true coefficients at this level.

        .. math:: b_i \pm t_{(1 + p) / 2,\, \nu_i} \, u(b_i)

        with Student's quantile for the effective degrees of freedom of each standard error:
        few runs tell a standard error roughly.

        Parameters
        ----------
        level : float
            Between 0 and 1.

        Returns
        -------
        ndarray, shape (coefficients, 2)
            Low and high end for ``[constant, A, B of each order of each shaft in turn]``.

        Examples
        --------
        >>> theta = np.arange(0.0, 360.0, 5.0)
        >>> noise = np.random.default_rng(1).normal(0.0, 0.01, theta.size)
        >>> run = CalibrationRun(theta, theta + 0.5 * np.sin(np.radians(theta)) + noise, 360.0)
        >>> import trueangle as ta
        >>> low, high = ta.fit(run, orders=[1]).interval()[2]
        >>> bool(low < 0.5 < high)
        True
        """
        pairs = [(a, b) for s in self.model.shafts for a, b in zip(s.cosine, s.sine, strict=True)]
        values = np.concatenate([[self.model.constant], np.ravel(pairs)])
        return self._around(values, np.sqrt(np.diag(self.covariance)), self.freedom, level)

    def amplitude_interval(self, level: float = 0.95) -> Array:
        """Intervals of `amplitudes`, as `interval`; the low end is 0 at least.

        Right where the amplitude is well above its standard error (`amplitude_std`).
        """
        both = self.freedom[1:].reshape(-1, 2).min(axis=1)
        found = self._around(self.amplitudes, self.amplitude_std, both, level)
        return np.asarray(np.maximum(found, 0.0))

    @property
    def freedom(self) -> Array:
        """Effective degrees of freedom of each variance in the diagonal of `covariance`."""
        return self.uncertainty.freedom

    @staticmethod
    def _around(values: Array, std: Array, freedom: Array, level: float) -> Array:
        if not 0.0 < level < 1.0:
            raise ArgumentError(f"level must lie between 0 and 1, got {level!r}")
        times = np.array([student_quantile(0.5 + 0.5 * level, float(v)) for v in freedom])
        return np.asarray(np.column_stack([values - times * std, values + times * std]))

    @cached_property
    def residuals(self) -> Array:
        """Measured less fitted error of every reading, run after run, zeros removed."""
        return np.concatenate(self.problem.residuals(self.fitted))

    @property
    def wild(self) -> tuple[tuple[str, int], ...]:
        """Label and row (from 0) of every reading that was set aside."""
        if self.weights is None:
            return ()
        return tuple(
            (run.label or str(i), int(row))
            for i, (run, weights) in enumerate(zip(self.runs, self.weights, strict=True))
            for row in np.flatnonzero(
                (weights == 0.0) & (True if run.weights is None else run.weights > 0.0)
            )
        )

    @property
    def orders(self) -> tuple[float, ...]:
        """Output orders of all harmonics, shaft by shaft."""
        return self.model.orders

    @property
    def amplitudes(self) -> Array:
        """``C_k`` of all harmonics."""
        return self.model.amplitudes

    @property
    def phases(self) -> Array:
        """``phi_k`` in radians of all harmonics."""
        return self.model.phases

    @cached_property
    def amplitude_std(self) -> Array:
        r"""Standard error of every amplitude, to first order from the covariance.

        .. math:: u(C)^2 = (A^2 u_A^2 + B^2 u_B^2 + 2 A B u_{AB}) / C^2

        Where ``C`` is not well above it the amplitude is Rice distributed and this is a
        lower bound: judge such orders by (A, B) and their covariance (JCGM 102).
        """
        return self._polar_std(along=True)

    @cached_property
    def phase_std(self) -> Array:
        r"""Standard error of every phase in radians.

        .. math:: u(\varphi)^2 = (B^2 u_A^2 + A^2 u_B^2 - 2 A B u_{AB}) / C^4
        """
        with np.errstate(divide="ignore", invalid="ignore"):
            return self._polar_std(along=False) / self.amplitudes

    def _polar_std(self, along: bool) -> Array:
        a = np.concatenate([np.zeros(0), *(s.cosine for s in self.model.shafts)])
        b = np.concatenate([np.zeros(0), *(s.sine for s in self.model.shafts)])
        index = 1 + 2 * np.arange(a.size)
        cov = self.covariance
        aa, bb, ab = cov[index, index], cov[index + 1, index + 1], cov[index, index + 1]
        with np.errstate(divide="ignore", invalid="ignore"):
            u, v = (a, b) / np.hypot(a, b) if along else (b, -a) / np.hypot(a, b)
        # A zero amplitude has no direction: any will do.
        u, v = np.where(np.isfinite(u), u, 1.0), np.where(np.isfinite(v), v, 0.0)
        return np.asarray(np.sqrt(np.maximum(u * u * aa + v * v * bb + 2.0 * u * v * ab, 0.0)))

    def plot(self, kind: str = "errors", ax: Axes | None = None, **options: Any) -> Axes:
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
        from ..plots import fit_plot

        return fit_plot(self, kind, ax, **options)

    def summary(self) -> str:
        """The result as text: coefficients with uncertainties, quality, notes."""
        from .summary import fit_summary

        return fit_summary(self)

    def __repr__(self) -> str:
        readings = sum(len(run) for run in self.runs)
        return (
            f"FitResult({len(self.orders)} orders from {readings} readings in "
            f"{len(self.runs)} runs, residual {self.residual_std:.3g}, "
            f"period={self.model.period:g})"
        )

    def _repr_html_(self) -> str:
        return f"<pre>{escape(self.summary())}</pre>"
