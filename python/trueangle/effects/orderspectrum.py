"""Spectra of unequally spaced readings at many orders, by gridding and a fast transform."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

import trueangle._core as _core

from ..support.arrays import Array

#: Places of the grid that a reading is spread over, and the shape of the kernel that does it:
#: with a grid of twice the orders they leave 1e-12 of the sum of magnitudes (Barnett, Magland
#: and af Klinteberg 2019, "exponential of semicircle").
WIDTH, SHAPE = 14, 2.30 * 14

#: Readings a run from which on gridding and a transform are quicker than a sum for each order.
DENSE = 128


class OrderSpectrum:
    """Sums over the readings of each run at equally spaced orders.

    ::

        F_k = Σ_j y_j e^(-i (m₀ + k Δ) θ_j),    0 ≤ k < K

    Only one transform depends on y: all that depends on the angles alone is computed once.

    Parameters
    ----------
    theta : ndarray, shape (n,)
        Radians, any number of turns.
    starts : sequence of int
        First reading of every run.
    first, step : float
        m_0 and its increment.
    count : int
        K.
    """

    def __init__(
        self, theta: Array, starts: Sequence[int], first: float, step: float, count: int
    ) -> None:
        self.theta, self.starts = theta, list(starts)
        self.first, self.step, self.count = first, step, count
        self._grid = None if theta.size < DENSE * len(starts) else self._spread()

    def _spread(self) -> tuple[NDArray[np.int64], Array, NDArray[np.complex128], Array]:
        """Every reading's places and shares of them, its turn, and the kernel's transform."""
        places = self._places
        at = self.step * self.theta * (places / (2.0 * np.pi))
        left: Array = np.ceil(at - 0.5 * WIDTH)
        beside = np.arange(WIDTH, dtype=np.float64)
        run = np.searchsorted(self.starts, np.arange(at.size), side="right") - 1
        index = (left[:, None] + beside).astype(np.int64) % places + places * run[:, None]
        # Orders about the middle one: k from -K/2 on.
        middle = self.first + self.step * (self.count // 2)
        turned = np.exp(-1j * middle * self.theta)
        kernel = _kernel((left - at)[:, None] + beside)
        return index.ravel(), kernel, turned, _transform(places, self.count)

    @property
    def _places(self) -> int:
        """Of the grid of a run: twice the orders and more, a power of two."""
        return 2 << int(np.ceil(np.log2(max(self.count, WIDTH))))

    def sums(self, values: Array) -> NDArray[np.complex128]:
        """F of some values, shape (count, runs)."""
        if self._grid is None:
            parts = (self.starts, self.first, self.step, self.count)
            found = _core.unit_sums(self.theta, values[None, :], *parts)
            return np.asarray(found[:, :, 0] + 1j * found[:, :, 1])
        index, kernel, turned, correction = self._grid
        places = self._places
        grid = np.empty(places * len(self.starts), dtype=np.complex128)
        grid.real, grid.imag = (
            np.bincount(index, (part[:, None] * kernel).ravel(), grid.size)
            for part in (turned.real * values, turned.imag * values)
        )
        spectra = np.fft.fft(grid.reshape(-1, places), axis=1)
        low = self.count // 2
        wanted = np.concatenate(
            [spectra[:, places - low :], spectra[:, : self.count - low]], axis=1
        )
        return np.asarray((wanted * correction).T)


def _kernel(away: Array) -> Array:
    """Weight of a reading at grid points ``away`` steps from it."""
    share = np.clip(1.0 - (away / (0.5 * WIDTH)) ** 2, 0.0, None)
    return np.asarray(np.exp(SHAPE * (np.sqrt(share) - 1.0)))


def _transform(places: int, count: int) -> Array:
    """What takes the kernel out of every order: one over its Fourier transform."""
    # Twice as fine as the grid: what folds back is far below what the grid folds back.
    away = np.linspace(0.0, 0.5 * WIDTH, WIDTH + 1)
    weight = np.where(away > 0.0, 1.0, 0.5) * _kernel(away)
    orders = np.arange(count) - count // 2
    return np.asarray(1.0 / (np.cos(np.outer(orders, away * (2.0 * np.pi / places))) @ weight))
