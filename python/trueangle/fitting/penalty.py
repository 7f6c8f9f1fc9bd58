"""What a penalty takes from the coefficients: its mean square over patterns like the one seen.

A ridge answers ``b̂ = (G + λ)⁻¹ X'Wy`` and is off by

::

    b̂ - b = (G + λ)⁻¹ X'W e - λ (G + λ)⁻¹ b

The first part is noise. The second depends on the pattern itself, and just where readings say
little of it. Patterns are taken as drawn with variances ``τ² (k / k₀)^(-2q)`` of both
coefficients of order k, ``k₀`` the lowest of its shaft; how probable each size
``τ`` and steepness q is, the readings tell by their marginal likelihood. With
``D`` the mean of these variances the covariance of the second part is

::

    λ² (G + λ)⁻¹ D (G + λ)⁻¹

Intervals from the sum of both hold the truth as often as they say on average over the travel,
and over patterns (Wahba 1983, Nychka 1988): not for each angle by itself, and not for a
pattern whose sizes nothing in the travel shows.
"""

from __future__ import annotations

from typing import Final

import numpy as np
from numpy.typing import NDArray

__all__ = ["bias_covariance", "pattern_variances"]

Array = NDArray[np.float64]

#: How fast sizes fall with the order: not at all, up to twice as fast as those of a kink.
_STEEPNESS: Final = (0.0, 0.5, 1.0, 1.5, 2.0, 3.0)

#: Sizes looked at, relative to the greatest: four decades, 20 to each.
_SIZES: Final = np.logspace(-4.0, 0.0, 81)

#: Noise counts as at least this part of the greatest size: rounding, where there is no noise.
_LEAST_NOISE: Final = 1e-9


def pattern_variances(
    gram: Array, moment: Array, variance: float, steps: Array, greatest: float
) -> Array:
    """Mean variance of every coefficient, over the sizes and slopes that the readings allow.

    ::

        D_i = Σ_{q,τ} p(q, τ | y) τ² s_i^(-2q),
        y ~ N(0, σ² + τ² X S^(-2q) X')

    with every slope, and every decade of sizes below the greatest, equally probable beforehand.

    Parameters
    ----------
    gram, moment : ndarray, shape (n, n) and (n,)
        ``X'WX`` and ``X'Wy`` about the zeros of the runs.
    variance : float
        Of a reading of weight 1.
    steps : ndarray, shape (n,)
        Order of every coefficient relative to the lowest of its shaft.
    greatest : float
        Size that no pattern exceeds.

    Returns
    -------
    ndarray, shape (n,)

    Examples
    --------
    Where readings say all, it is the mean square of the coefficients:

    >>> b = np.tile([3.0, -4.0], 50)
    >>> found = pattern_variances(1e6 * np.eye(100), 1e6 * b, 1.0, np.ones(100), 100.0)
    >>> round(float(found[0]), 1)
    12.8
    """
    if not greatest > 0.0:
        return np.zeros(moment.size)
    noise = max(variance, (_LEAST_NOISE * greatest) ** 2)
    squares = (greatest * _SIZES) ** 2
    values, vectors = np.linalg.eigh(gram)
    seen = values > 1e-14 * values[-1]
    root = vectors[:, seen] * np.sqrt(values[seen])
    whitened = vectors[:, seen].T @ moment / np.sqrt(values[seen])
    evidence, shapes = [], []
    for steepness in _STEEPNESS:
        shape = steps**-steepness
        rows = root * shape[:, None]
        spread, turn = np.linalg.eigh(rows.T @ rows)
        expected = noise + np.outer(squares, np.maximum(spread, 0.0))
        misfit = (turn.T @ whitened) ** 2 / expected
        evidence.append(-0.5 * np.sum(np.log(expected) + misfit, axis=1))
        shapes.append(shape**2)
    chance = np.exp(np.array(evidence) - np.max(evidence))
    return np.asarray((chance @ squares) @ np.array(shapes) / chance.sum())


def bias_covariance(gram: Array, means: Array, penalty: float, variances: Array) -> Array:
    """Covariance of what a penalty takes from ``[constant, A, B, ...]``.

    ::

        M λ² (G + λ)⁻¹ D (G + λ)⁻¹ M',    M = [-x̄'; I]

    for the constant makes good on the readings what the coefficients are off by there.

    Parameters
    ----------
    gram : ndarray, shape (n, n)
    means : ndarray, shape (n,)
        Of every regressor over the readings: the mean of the runs.
    penalty : float
        As added to the diagonal of ``gram``.
    variances : ndarray, shape (n,)
        See `pattern_variances`.

    Returns
    -------
    ndarray, shape (n + 1, n + 1)
    """
    taken = penalty * np.linalg.inv(gram + penalty * np.eye(len(gram)))
    taken = np.vstack([-means @ taken, taken])
    return np.asarray((taken * variances) @ taken.T)
