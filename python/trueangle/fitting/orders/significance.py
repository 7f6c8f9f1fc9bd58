"""Significance of orders: what each takes off the sum of squares, against the noise it has."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np

from ...support.arrays import Array
from .evidence import COLLINEAR, fit_chosen_orders, log_chi_squared_tail
from .harmonicsums import HarmonicSums
from .noisespectrum import NoiseSpectrum, log_chance

#: Scatter between runs counts as an order's own where chance makes it rarer than this.
OVERDISPERSED: Final = 1e-3

#: Halvings of an interval: to a millionth of it.
_HALVINGS: Final = 20


class OrderTest(NamedTuple):
    """Statistics of orders beside the chosen ones (or among them).

    Arrays have one entry per order asked for; ``cosine``/``sine`` are the coefficients
    with all chosen orders in the model, ``gain`` is what the order takes off the sum of squares.
    ``scatter`` is its own variance where it is judged by that, of so many degrees of freedom
    ``each``, else nan: by ``noise``.
    """

    cosine: Array
    sine: Array
    variance: Array
    statistic: Array
    gain: Array
    noise: NoiseSpectrum
    scatter: Array
    each: int

    def log_chance(self, gain: Array) -> Array:
        """Log of the chance that noise alone has such gains."""
        own = np.isfinite(self.scatter)
        by_own = log_chance(gain / np.where(own, self.scatter, 1.0), self.each)
        return np.where(own, by_own, self.noise.log_chance(gain))

    @property
    def log_p(self) -> Array:
        """That of the gains there are."""
        return self.log_chance(self.gain)

    def needed(self, log_limits: Array) -> Array:
        """Amplitude from which each order is as rare as its limit, at the phase that it has."""
        level = np.where(np.isfinite(self.scatter), self.scatter, self.noise.variance)
        low, high = np.zeros(level.size), 2.0 * np.maximum(level, 1e-300)
        while (short := self.log_chance(high) > log_limits).any() and np.isfinite(high).all():
            high = np.where(short, 4.0 * high, high)
        for _ in range(_HALVINGS):
            middle = 0.5 * (low + high)
            short = self.log_chance(middle) > log_limits
            low, high = np.where(short, middle, low), np.where(short, high, middle)
        amplitude = np.hypot(self.cosine, self.sine)
        with np.errstate(divide="ignore", invalid="ignore"):
            return np.where(self.gain > 0.0, amplitude * np.sqrt(high / self.gain), math.nan)


def examine_orders(
    sums: HarmonicSums,
    chosen: Sequence[int],
    orders: Sequence[int],
    noise: NoiseSpectrum,
    scatter: Array | None,
    each: int = 1,
) -> OrderTest:
    """Significance of ``orders``, each beside the other chosen ones.

    ``noise`` is that of these orders; ``scatter`` (from `run_scatter`), of so many degrees of
    freedom ``each``, replaces it for an order where it is more.
    """
    total, rhs, _ = sums.total()
    n = len(orders)
    # Of orders that are aliases of the chosen ones nothing is known.
    cosine, sine, of_one = np.full((3, n), math.nan)
    gain = np.zeros(n)
    level, own = noise.variance, np.full(n, math.nan)
    if scatter is not None:
        ratio = np.maximum(scatter, 0.0) / level * each
        more = np.isfinite(scatter) & (log_chi_squared_tail(ratio, each) < math.log(OVERDISPERSED))
        np.copyto(level, scatter, where=more)
        np.copyto(own, scatter, where=more)
    position = {k: i for i, k in enumerate(chosen)}
    coefficients, inverse, _ = fit_chosen_orders(sums, chosen)
    base = sums.columns(chosen)
    size = len(chosen)
    outside = [k for k in orders if k not in position]
    if outside:
        other = sums.columns(outside)
        cross = total[np.ix_(base, other)]
        slope = inverse @ cross
        blocks = total[np.ix_(other, other)] - cross.T @ slope
        scores = rhs[other] - cross.T @ coefficients
    # Those among the chosen ones, and those that would join them.
    mine = np.array([i for i, k in enumerate(orders) if k in position], dtype=np.intp)
    others = np.array([i for i, k in enumerate(orders) if k not in position], dtype=np.intp)
    if mine.size:
        place = np.array([position[orders[i]] for i in mine])
        pair = np.stack([place, place + size], axis=1)
        inverses = inverse[pair[:, :, None], pair[:, None, :]]
        value = coefficients[pair]
        gain[mine] = np.einsum("ki,kij,kj->k", value, np.linalg.pinv(inverses), value)
        cosine[mine], sine[mine] = value.T
        of_one[mine] = 0.5 * np.trace(inverses, axis1=1, axis2=2)
    if others.size:
        pair = np.stack([np.arange(others.size), np.arange(others.size) + others.size], axis=1)
        block = blocks[pair[:, :, None], pair[:, None, :]]
        energy = total.diagonal()[other][pair].sum(axis=1)
        # Where orders nearly cancel, rounding leaves no symmetric block, and its inverse no
        # positive variances: those of its symmetric part are.
        values, vectors = np.linalg.eigh(0.5 * (block + block.transpose(0, 2, 1)))
        told = values[:, 0] > COLLINEAR * energy
        others, score, vectors = others[told], scores[pair][told], vectors[told]
        inverses = (vectors / values[told][:, None, :]) @ vectors.transpose(0, 2, 1)
        value = np.einsum("kij,kj->ki", inverses, score)
        gain[others] = np.einsum("ki,ki->k", value, score)
        cosine[others], sine[others] = value.T
        of_one[others] = 0.5 * np.trace(inverses, axis1=1, axis2=2)
    variance = level * of_one
    # Of orders that nearly are each other rounding leaves nothing, or less.
    variance = np.maximum(variance, 0.0)
    with np.errstate(divide="ignore", invalid="ignore"):
        statistic = np.where(level > 0.0, gain / level, math.inf)
    statistic[np.isnan(cosine)] = 0.0
    gain[np.isnan(cosine)] = 0.0
    return OrderTest(cosine, sine, variance, statistic, gain, noise, own, each)
