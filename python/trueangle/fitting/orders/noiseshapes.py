"""Shapes that the spectrum of noise may have, and their fit to what orders tell of it."""

from __future__ import annotations

from functools import lru_cache
from typing import Final, NamedTuple

import numpy as np

from ...support.arrays import Array
from ...support.distributions import chi_squared_quantile, chi_squared_tail

#: Cosines of the order that a spectrum has at most.
_COSINES: Final = 4

#: Corners of its power of the order, in parts of the highest: below them it is flat.
_BENDS: Final = (0.0, 0.03, 0.2)

#: Corners of noise that forgets that are looked at, and the lowest order of one.
_CORNERS: Final = 8
_LOWEST: Final = 0.5

#: Beliefs beforehand: white noise, noise that forgets exponentially, any other.
_PRIORS: Final = (0.5, 0.45, 0.05)

#: Chance of noise beyond which what an order tells counts as a line, and no further.
_BEYOND: Final = 0.05

#: Steps of Fisher's scoring, and the change of a logarithm that ends them.
_STEPS: Final = 60
_SETTLED: Final = 1e-4


class Shapes(NamedTuple):
    """Shapes of as many coefficients.

    Attributes
    ----------
    basis, known : ndarray
        Terms of their logarithms at every order, and what is added to them.
    prior : ndarray
    scoring : ndarray
        Coefficients by what the orders that tell the noise do.
    share : ndarray
        Part of each order's logarithm that it tells itself, as one of these.
    """

    basis: Array
    known: Array
    prior: Array
    scoring: Array
    share: Array

    @classmethod
    def of(cls, basis: Array, known: Array, prior: Array, seen: Array) -> Shapes:
        """With what follows of them and of the orders that tell the noise."""
        scoring = np.linalg.pinv(basis[:, seen])
        covariance = scoring @ scoring.transpose(0, 2, 1)
        return cls(basis, known, prior, scoring, ((basis @ covariance) * basis).sum(axis=2))


@lru_cache(maxsize=16)
def shapes(whole: bytes, told: bytes, flat_below: float, most: int) -> list[Shapes]:
    """White noise, noise that forgets exponentially, and what so many coefficients can follow."""
    orders, seen = np.frombuffer(whole), np.frombuffer(told, dtype=bool)
    highest = float(orders.max())
    corners = np.geomspace(max(flat_below, _LOWEST), max(highest, 2.0 * flat_below), _CORNERS)
    corners = corners if flat_below else np.append(0.0, corners)
    scale = np.pi / highest
    # Seen up to half its sampling, or less.
    steps = (scale * orders, 2.0 * np.sin(0.5 * scale * orders))
    known = [-np.log(step**2 + (scale * corner) ** 2) for step in steps for corner in corners]
    prior = [_PRIORS[0], *[_PRIORS[1] / len(known)] * len(known)]
    level = np.ones((len(prior), orders.size, 1))
    zero = np.zeros(orders.size)
    found = [Shapes.of(level, np.array([zero, *known]), np.array(prior), seen)]
    clipped = np.maximum(orders, flat_below)
    free = _free(clipped / float(clipped.max()), most)
    each = _PRIORS[2] / max(1, sum(map(len, free.values())))
    for bases in free.values():
        shape = len(bases), orders.size
        same = np.full(len(bases), each)
        found.append(Shapes.of(np.array(bases), np.zeros(shape), same, seen))
    return found


def _free(share: Array, most: int) -> dict[int, list[Array]]:
    """Cosines of the order, and a power of it beside them, by their number."""
    waves = np.cos(np.pi * np.outer(share, np.arange(_COSINES + 1)))
    powers = [np.log(share**2 + corner**2) for corner in _BENDS]
    found: dict[int, list[Array]] = {}
    for size in range(2, min(_COSINES + 2, most) + 1):
        found[size] = [waves[:, :size]] if size <= _COSINES + 1 else []
        found[size] += [np.column_stack([waves[:, : size - 1], power]) for power in powers]
    return found


class Bend(NamedTuple):
    """Where what an order tells is bent, its mean then, and how much wider estimates are."""

    at: float
    mean: float
    widening: float


@lru_cache(maxsize=64)
def bend_of(freedom: int) -> Bend:
    """Of ``min(v, a)`` with v a chi-squared over its freedom, by its moments."""
    x = chi_squared_quantile(1.0 - _BEYOND, freedom)
    at = x / freedom
    low = [1.0 - chi_squared_tail(x, freedom + 2 * power) for power in (1, 2)]
    mean = low[0] + at * _BEYOND
    square = low[1] * (freedom + 2.0) / freedom + at * at * _BEYOND
    variance = square / mean**2 - 1.0
    return Bend(at, mean, variance / (low[0] / mean) ** 2 * freedom / 2.0)


def _levels(values: Array, bend: Bend) -> Array:
    """The level c of each row at which the mean of ``min(v / c, a)`` is that of noise."""
    ordered = np.sort(values, axis=1)
    sums, count = np.cumsum(ordered, axis=1), values.shape[1]
    # A value v is bent where the mean at c = v / a is below that of noise.
    below = np.divide(sums, ordered, out=np.full_like(sums, np.inf), where=ordered > 0.0)
    is_free = below + np.arange(count)[::-1] >= count * bend.mean / bend.at
    free = np.count_nonzero(is_free, axis=1)
    total = np.take_along_axis(sums, free[:, None] - 1, axis=1)[:, 0]
    return np.maximum(total / (count * bend.mean - (count - free) * bend.at), 1e-300)


def fit_shapes(basis: Array, scoring: Array, values: Array, bend: Bend) -> tuple[Array, Array]:
    """Coefficients of the logarithm of each shape, and the loss: half the deviance, and a constant.

    ``basis`` has shape (shapes, orders, coefficients) and the pseudo-inverse ``scoring``,
    ``values`` has shape (shapes, orders).
    """
    found = np.zeros((basis.shape[0], basis.shape[2]))
    found[:, 0] = np.log(_levels(values, bend))
    for _ in range(_STEPS):
        ratio = values * np.exp(-np.einsum("mkp,mp->mk", basis, found))
        step = np.einsum("mpk,mk->mp", scoring, np.minimum(ratio, bend.at) / bend.mean - 1.0)
        found += step
        if float(np.abs(step).max()) < _SETTLED:
            break
    log = np.einsum("mkp,mp->mk", basis, found)
    ratio = values * np.exp(-log)
    over = np.maximum(ratio / bend.at, 1.0)
    bent = np.minimum(ratio, bend.at) / bend.mean + bend.at / bend.mean * np.log(over)
    return found, (log + bent).sum(axis=1)
