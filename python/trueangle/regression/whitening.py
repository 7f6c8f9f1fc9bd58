"""Noise that is not white: correlation in time and errors that are common to a run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

__all__ = ["RunEffect", "Whitener", "lag_correlation", "wander_basis"]

Array = NDArray[np.float64]

#: Half periods per run that count as wander and not as correlation of the noise.
WANDER_TERMS = 8

#: Correlation between neighbours below which the noise counts as white.
WHITE_BELOW = 0.05


@dataclass(frozen=True, eq=False)
class RunEffect:
    """An error whose size is drawn anew in every run (random effect).

    Attributes
    ----------
    columns : ndarray, shape (n, k)
        Its shapes; coefficients of different runs are independent, of variance
        ``ratio`` times that of one reading.
    ratio : float
    """

    columns: Array
    ratio: float = 1.0


def wander_basis(clock: Array, terms: int = WANDER_TERMS) -> Array:
    """Cosines of 1 to ``terms`` half periods over the record, shape (n, terms)."""
    span = clock[-1] - clock[0]
    u = (clock - clock[0]) / span if span > 0.0 else np.zeros_like(clock)
    return np.asarray(np.cos(np.pi * np.outer(u, np.arange(1, terms + 1))))


def lag_correlation(residual: Array, clock: Array, bounds: list[tuple[int, int]]) -> float:
    """Correlation between neighbours within runs, after wander is taken out.

    Pooled over runs and at least 0; 0 below `WHITE_BELOW` or within four standard
    errors of it, so white noise stays exactly white.
    """
    product = power = 0.0
    pairs = 0
    for start, stop in bounds:
        if stop - start <= 2 * WANDER_TERMS:
            continue
        basis = np.column_stack([np.ones(stop - start), wander_basis(clock[start:stop])])
        q, _ = np.linalg.qr(basis)
        e = residual[start:stop] - q @ (q.T @ residual[start:stop])
        product += float(e[1:] @ e[:-1])
        power += float(e @ e)
        pairs += stop - start - 1
    if pairs == 0 or power == 0.0:
        return 0.0
    # The basis takes out a share of the slow part: about K/n of the correlation.
    rho = product / power
    return min(rho, 0.98) if rho > max(WHITE_BELOW, 4.0 / np.sqrt(pairs)) else 0.0


class Whitener:
    r"""Linear map that makes the noise of every reading independent and equal.

    Within a run the noise is :math:`n + \sum_k Z_k u_k` with n of first-order
    correlation rho and run effects u: the map is
    :math:`(I + A A^T)^{-1/2} F`, F the filter :math:`x_t - \rho x_{t-1}` and
    :math:`A = F Z \sqrt{\mathrm{ratio}}`.

    Attributes
    ----------
    log_determinant : float
        -2 ln|map|, to be added to the log-likelihood's ``n ln RSS``.
    """

    def __init__(
        self,
        bounds: list[tuple[int, int]],
        rho: float = 0.0,
        effects: list[RunEffect] | None = None,
        weights: Array | None = None,
    ) -> None:
        self.bounds = bounds
        self.rho = rho
        self.effects = list(effects or ())
        self.root_weights = None if weights is None else np.sqrt(weights)
        self._rotations: list[tuple[Array, Array]] = []
        self._log_determinants: list[float] = []
        self.log_determinant: float = -len(bounds) * float(np.log1p(-(rho**2)))
        if weights is not None:
            self.log_determinant -= float(np.log(weights).sum())
        if self.effects:
            stacked = self._filtered(
                np.hstack([np.sqrt(effect.ratio) * effect.columns for effect in self.effects])
            )
            for start, stop in bounds:
                u, s, _ = np.linalg.svd(stacked[start:stop], full_matrices=False)
                self._rotations.append((u, 1.0 - 1.0 / np.sqrt(1.0 + s**2)))
                log_determinant = float(np.log1p(s**2).sum())
                self._log_determinants.append(log_determinant)
                self.log_determinant += log_determinant

    def log_determinant_of(self, run: int) -> float:
        """The part of `log_determinant` of one run, without that of the weights."""
        part = -float(np.log1p(-(self.rho**2)))
        return part + (self._log_determinants[run] if self._log_determinants else 0.0)

    @property
    def is_identity(self) -> bool:
        """Nothing to do: white noise, no run effects."""
        return self.rho == 0.0 and not self.effects and self.root_weights is None

    def _filtered(self, x: NDArray[Any]) -> NDArray[Any]:
        if self.root_weights is not None:
            scale = self.root_weights.astype(x.real.dtype)
            x = x * (scale if x.ndim == 1 else scale[:, None])
        if self.rho == 0.0:
            return x
        out = x.copy()
        out[1:] -= x.dtype.type(self.rho) * x[:-1]
        first = [start for start, _ in self.bounds]
        out[first] = x[first] * x.dtype.type(np.sqrt(1.0 - self.rho**2))
        return out

    def __call__(self, x: NDArray[Any]) -> NDArray[Any]:
        """The map applied to a column or to columns, shape (n,) or (n, k)."""
        if np.iscomplexobj(x):
            # Real and imaginary parts side by side: the map is real.
            parts = np.ascontiguousarray(x).view(x.real.dtype)
            mapped = self(parts)
            return x if mapped is parts else mapped.view(x.dtype)
        out = self._filtered(x)
        if not self.effects:
            return out
        if out is x:
            out = x.copy()
        for (start, stop), (u, shrink) in zip(self.bounds, self._rotations, strict=True):
            block = out[start:stop]
            v = u.astype(x.real.dtype, copy=False)
            inner = v.T @ block
            factor = shrink.astype(x.real.dtype, copy=False)
            block -= v @ (inner * (factor if inner.ndim == 1 else factor[:, None]))
        return out

    def run_part(self, residual: Array, chosen: Sequence[bool] | None = None) -> Array:
        """Best guess of the run effects' own share of a raw residual, of all or some."""
        if not self.effects:
            return np.zeros_like(residual)
        part = np.zeros_like(residual)
        kept: Array | None = None
        if chosen is not None:
            widths = [effect.columns.shape[1] for effect in self.effects]
            kept = np.repeat(np.asarray(chosen, dtype=np.float64), widths)
        stacked = np.hstack([np.sqrt(effect.ratio) * effect.columns for effect in self.effects])
        for start, stop in self.bounds:
            a = stacked[start:stop]
            inner = np.linalg.solve(np.eye(a.shape[1]) + a.T @ a, a.T @ residual[start:stop])
            part[start:stop] = (a if kept is None else a * kept) @ inner
        return part
