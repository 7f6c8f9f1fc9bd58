"""Noise that is not white: correlation in time and errors that are common to a run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

import trueangle._core as _core

from ..support.arrays import Array

#: Half periods per run that count as wander and not as correlation of the noise.
WANDER_TERMS = 8

#: Correlation between neighbours below which the noise counts as white.
WHITE_BELOW = 0.05

#: Share of the power of the strongest combination of columns below which one is rounding.
VANISHES = 1e-14


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


def principal(columns: Array, bounds: list[tuple[int, int]]) -> tuple[Array, Array]:
    """Columns turned so that within every run they are at right angles, and their power.

    Shapes (R, k) and (n, k), weakest first.
    """
    grams = np.array([columns[a:b].T @ columns[a:b] for a, b in bounds])
    power, vectors = np.linalg.eigh(grams)
    turned = np.empty_like(columns)
    for (start, stop), v in zip(bounds, vectors, strict=True):
        np.matmul(columns[start:stop], v, out=turned[start:stop])
    return np.maximum(power, 0.0), turned


class LagCorrelation:
    """Correlation between neighbours within runs, after wander is taken out.

    Parameters
    ----------
    clock : ndarray, shape (n,)
        Increasing within a run.
    bounds : list of (int, int)
        The runs.
    """

    def __init__(self, clock: Array, bounds: list[tuple[int, int]]) -> None:
        #: First and one-past-last reading of every run, and its mean and wander at right angles.
        self.bases: list[tuple[int, int, Array]] = []
        for start, stop in bounds:
            if stop - start > 2 * WANDER_TERMS:
                basis = [np.ones(stop - start), wander_basis(clock[start:stop])]
                self.bases.append((start, stop, np.linalg.qr(np.column_stack(basis))[0]))

    def __call__(self, residual: Array) -> float:
        """Pooled over runs and at least 0.

        0 below `WHITE_BELOW` or within four standard errors of it, so white noise stays
        exactly white.
        """
        product = power = 0.0
        pairs = 0
        for start, stop, q in self.bases:
            part = residual[start:stop]
            e = part - q @ (q.T @ part)
            product += float(e[1:] @ e[:-1])
            power += float(e @ e)
            pairs += stop - start - 1
        if pairs == 0 or power == 0.0:
            return 0.0
        # The basis takes out a share of the slow part: about K/n of the correlation.
        rho = product / power
        return min(rho, 0.98) if rho > max(WHITE_BELOW, 4.0 / np.sqrt(pairs)) else 0.0


class Whitener:
    """Linear map that makes the noise of every reading independent and equal.

    Within a run the noise is ``n + Σ_k Z_k u_k`` with n of first-order
    correlation rho and run effects u: the map is
    ``(I + A Aᵀ)^(-1/2) F``, F the filter ``x_t - ρ x_{t-1}`` and
    ``A = F Z √(ratio)``.

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
        self.weights = weights
        self.root_weights = None if weights is None else np.sqrt(weights)
        self._rotations: list[tuple[Array, Array]] = []
        self._log_determinants: list[float] = []
        self._shares: tuple[Array, Array] | None = None
        self.log_determinant: float = -len(bounds) * float(np.log1p(-(rho**2)))
        if weights is not None:
            self.log_determinant -= float(np.log(weights).sum())
        if self.effects:
            stacked = self._filtered(
                np.hstack([np.sqrt(effect.ratio) * effect.columns for effect in self.effects])
            )
            power, turned = principal(stacked, bounds)
            shrink = 1.0 - 1.0 / np.sqrt(1.0 + power)
            for j, (start, stop) in enumerate(bounds):
                # Columns that add nothing to the others point nowhere.
                kept = power[j] > VANISHES * power[j].max(initial=0.0)
                u = turned[start:stop, kept] / np.sqrt(power[j, kept])
                self._rotations.append((u, shrink[j, kept]))
                log_determinant = float(np.log1p(power[j, kept]).sum())
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

    def has(self, rho: float, effects: Sequence[RunEffect], weights: Array | None) -> bool:
        """It is the map of this noise; told without looking at the readings."""
        return (
            self.rho == rho
            and len(self.effects) == len(effects)
            and all(a is b for a, b in zip(self.effects, effects, strict=True))
            and self.weights is weights
        )

    def _filtered(self, x: NDArray[Any], transposed: bool = False) -> NDArray[Any]:
        """Under the weights and the filter alone, or their transpose."""
        if self.rho == 0.0 and self.root_weights is None:
            return x
        rows = x if x.ndim == 2 else x[:, None]
        if not rows.flags.f_contiguous:
            rows = np.ascontiguousarray(rows)
        found = _core.whitened(rows, self.bounds, self.rho, self.root_weights, transposed)
        return found.reshape(x.shape)

    def taken(self) -> tuple[Array, Array]:
        """What run effects take from products of columns, as columns w and shares c.

        With F the filter alone, ``map(x) @ map(y)`` is ``F x @ F y`` less, run by run,
        ``(w @ x) c (w @ y)``. Runs have their columns side by side, shape (n, k) and (R, k).
        """
        width = max((u.shape[1] for u, _ in self._rotations), default=0)
        w = np.zeros((self.bounds[-1][1], width))
        c = np.zeros((len(self.bounds), width))
        for j, ((start, stop), (u, shrink)) in enumerate(
            zip(self.bounds, self._rotations, strict=True)
        ):
            w[start:stop, : u.shape[1]] = u
            c[j, : u.shape[1]] = shrink * (2.0 - shrink)
        return self._filtered(w, transposed=True), c

    def beside(self, q: Array, r: Array, squares: float, excited: float) -> _core.Beside:
        """A fit's orthonormal columns and residual, as columns that are not mapped see them."""
        taken = None
        if self.effects:
            both, taken = np.column_stack([q, r]), self.taken()
            self._shrink(both)
            q, r = both[:, :-1], np.ascontiguousarray(both[:, -1])
        return _core.Beside(q, r, squares, excited, self.bounds, self.rho, self.root_weights, taken)

    def _shrink(self, out: NDArray[Any]) -> None:
        for (start, stop), (u, shrink) in zip(self.bounds, self._rotations, strict=True):
            block = out[start:stop]
            v = u.astype(out.real.dtype, copy=False)
            inner = v.T @ block
            factor = shrink.astype(out.real.dtype, copy=False)
            block -= v @ (inner * (factor if inner.ndim == 1 else factor[:, None]))

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
            out = x.copy(order="K")
        self._shrink(out)
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
        if self._shares is None:
            scaled = [np.sqrt(effect.ratio) * effect.columns for effect in self.effects]
            stacked = scaled[0] if len(scaled) == 1 else np.hstack(scaled)
            grams = np.array([stacked[a:b].T @ stacked[a:b] for a, b in self.bounds])
            self._shares = stacked, _inverse_beside_one(grams)
        stacked, shares = self._shares
        for (start, stop), share in zip(self.bounds, shares, strict=True):
            a = stacked[start:stop]
            inner = share @ (a.T @ residual[start:stop])
            np.matmul(a, inner if kept is None else kept * inner, out=part[start:stop])
        return part


def _inverse_beside_one(grams: Array) -> Array:
    """Inverse of the unit matrix plus each of the matrices, none of which is negative.

    Well conditioned where it matters; beside columns 1e8 times as large as others the unit is
    lost in rounding, and the eigenvalues are told one by one.
    """
    try:
        return np.asarray(np.linalg.inv(np.eye(grams.shape[-1]) + grams))
    except np.linalg.LinAlgError:
        values, vectors = np.linalg.eigh(grams)
        shares = 1.0 / (1.0 + np.maximum(values, 0.0))
        return np.asarray((vectors * shares[:, None, :]) @ np.swapaxes(vectors, 1, 2))
