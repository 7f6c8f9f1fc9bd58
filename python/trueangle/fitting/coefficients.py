"""What a fitted model says of its coefficients, however it was fitted."""

from __future__ import annotations

from functools import cached_property
from typing import TYPE_CHECKING

import numpy as np

from ..errors import ArgumentError
from ..model.model import HarmonicModel
from ..support.arrays import Array
from ..support.distributions import student_quantile
from ..support.plainresult import PlainResult

if TYPE_CHECKING:
    from .uncertainty import Uncertainty


class FittedCoefficients(PlainResult):
    """Coefficients with their uncertainty: what fits of runs and of logs have in common."""

    if TYPE_CHECKING:

        @property
        def model(self) -> HarmonicModel:
            """The fitted model."""
            raise NotImplementedError

        @property
        def uncertainty(self) -> Uncertainty:
            """Covariance, its kind and the degrees of freedom of each coefficient's variance."""
            raise NotImplementedError

    @property
    def covariance(self) -> Array:
        """Of ``[constant, A, B of each order of each shaft in turn]``."""
        if self.model.covariance is None:
            raise ArgumentError(
                "no covariance: as many unknowns as readings leave no residual to take it from"
            )
        return self.model.covariance

    def interval(self, level: float = 0.95) -> Array:
        """Intervals that hold the true coefficients at this level.

        ::

            b_i ± t_{(1+p)/2,ν_i} u(b_i)

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
        >>> import trueangle as ta
        >>> theta = np.arange(0.0, 360.0, 5.0)
        >>> noise = np.random.default_rng(1).normal(0.0, 0.01, theta.size)
        >>> run = ta.CalibrationRun(theta, theta + 0.5 * np.sin(np.radians(theta)) + noise, 360.0)
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
        """Standard error of every amplitude, to first order from the covariance.

        ::

            u(C)² = (A² u_A² + B² u_B² + 2 A B u_AB) / C²

        Where ``C`` is not well above it the amplitude is Rice distributed and this is a
        lower bound: judge such orders by (A, B) and their covariance (JCGM 102).
        """
        return self._polar_std(along=True)

    @cached_property
    def phase_std(self) -> Array:
        """Standard error of every phase in radians.

        ::

            u(φ)² = (B² u_A² + A² u_B² - 2 A B u_AB) / C⁴
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
