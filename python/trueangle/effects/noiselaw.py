"""A law of noise that is not the same everywhere, by its likelihood."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ..estimation.linear import pseudo_inverse
from ..estimation.regression import Regression
from ..support.distributions import chi_squared_tail
from .search import Array

#: Logarithm of the largest ratio of a reading's variance to the mean one: a thousand times the
#: standard deviation is more than noise of one kind does.
WIDEST = 2.0 * float(np.log(1e3))

#: Largest number of scoring steps, the change of a logarithm below which they end, and the
#: largest change in one step.
STEPS, SETTLED, LARGEST_STEP = 30, 1e-8, 2.0


@dataclass(frozen=True)
class NoiseLaw:
    """Variance of the noise of every reading, as it was fitted.

    ::

        σ² = exp(X γ) + g s²

    Attributes
    ----------
    coefficients : ndarray, shape (p,)
        γ.
    log_growth : float
        ln g; minus infinity where no s was given.
    covariance : ndarray
        Of γ, and of ln g behind it where there is one.
    log_variance : ndarray, shape (n,)
    log_likelihood : float
        Normal up to `SQUARE_CLIP`; beyond it the tail has clipped squares as its slope. So laws
        of different form are compared with the weights that the readings have in the fits.
    """

    coefficients: Array
    log_growth: float
    covariance: Array
    log_variance: Array
    log_likelihood: float

    @property
    def weights(self) -> Array:
        """Inverse variances, of mean 1."""
        weights = np.exp(-self.log_variance)
        return np.asarray(weights / weights.mean())


def noise_law(square: Array, columns: Array, growing: Array | None = None) -> NoiseLaw:
    """The most likely law of squared residuals.

    Parameters
    ----------
    square : ndarray, shape (n,)
        Squared residuals, standardised by any one deviation.
    columns : ndarray, shape (n, p)
        X; the first one is 1.
    growing : ndarray, shape (n,), optional
        s: what a part of the variance is the square of, 1 at most.
    """
    mean = float(np.log(np.minimum(square, SQUARE_CLIP).mean()))
    if growing is None:
        return _of_columns(square, columns, mean)
    # Ratios of the variance that grows to the other one, to start from.
    found = [_with_growth(square, columns, growing**2, mean, start) for start in (0.3, 10.0, 1e3)]
    return max(found, key=lambda law: law.log_likelihood)


def log_likelihood(square: Array, log_variance: Array) -> float:
    """Of squared residuals with these variances (`NoiseLaw.log_likelihood`)."""
    x = square * np.exp(-log_variance)
    beyond = SQUARE_CLIP * (1.0 + np.log(np.maximum(x, SQUARE_CLIP) / SQUARE_CLIP))
    taken = np.where(x > SQUARE_CLIP, beyond, x) / CLIPPED_MEAN
    return -0.5 * float(np.sum(log_variance + taken))


def _of_columns(square: Array, columns: Array, mean: float) -> NoiseLaw:
    gamma = np.zeros(columns.shape[1])
    gamma[0] = mean
    inverse = pseudo_inverse(columns.T @ columns)
    for _ in range(STEPS):
        away = clipped_squares(square, np.exp(columns @ gamma)) - 1.0
        step = inverse @ (columns.T @ away)
        if np.abs(columns @ (gamma + step) - mean).max() > WIDEST:
            break  # readings that do not scatter at all have no largest likelihood
        gamma += step
        if np.abs(step).max() < SETTLED:
            break
    log_variance = columns @ gamma
    likely = log_likelihood(square, log_variance)
    return NoiseLaw(gamma, -np.inf, CLIPPED_VARIANCE * inverse, log_variance, likely)


def _with_growth(
    square: Array, columns: Array, power: Array, mean: float, start: float
) -> NoiseLaw:
    """By scoring from one ratio of the two parts."""
    found = np.zeros(columns.shape[1] + 1)
    found[0] = mean - float(np.log1p(start * power).mean())
    found[-1] = found[0] + float(np.log(start))

    least, most = mean - WIDEST, mean + WIDEST  # beyond these logarithms a part is not there

    def parts(at: Array) -> tuple[Array, Array]:
        """Logarithm of the variance, and its derivatives."""
        own = np.exp(np.clip(columns @ at[:-1], least, most))
        grown = np.exp(at[-1]) * power
        share = own / (own + grown)
        return np.log(own + grown), np.column_stack([share[:, None] * columns, 1.0 - share])

    for _ in range(STEPS):
        log_variance, tangents = parts(found)
        away = clipped_squares(square, np.exp(log_variance)) - 1.0
        step = pseudo_inverse(tangents.T @ tangents) @ (tangents.T @ away)
        moved = np.clip(found + np.clip(step, -LARGEST_STEP, LARGEST_STEP), least, most)
        settled = float(np.abs(moved - found).max()) < SETTLED
        found = moved
        if settled:
            break
    log_variance, tangents = parts(found)
    covariance = CLIPPED_VARIANCE * pseudo_inverse(tangents.T @ tangents)
    return NoiseLaw(
        found[:-1],
        float(found[-1]),
        covariance,
        log_variance,
        log_likelihood(square, log_variance),
    )


#: Multiple of their variances to which squared residuals are clipped.
SQUARE_CLIP = 9.0

# Of z^2 of a normal z where it is below the clip, moments by tails of chi squared (1, 3 and 5
# degrees of freedom): E[z^2], and of min(z^2, clip) mean and mean square.
_ABOVE = chi_squared_tail(SQUARE_CLIP, 1)
_BELOW_SQUARE = 1.0 - chi_squared_tail(SQUARE_CLIP, 3)
CLIPPED_MEAN = _BELOW_SQUARE + SQUARE_CLIP * _ABOVE
_CLIPPED_POWER = 3.0 * (1.0 - chi_squared_tail(SQUARE_CLIP, 5)) + SQUARE_CLIP**2 * _ABOVE

#: Variance of the logarithm of a variance estimated from one clipped square; 2 without the clip.
CLIPPED_VARIANCE = (_CLIPPED_POWER - CLIPPED_MEAN**2) / _BELOW_SQUARE**2

#: Evidence that uneven noise must bring beyond its penalty. Half of what other causes must:
#: nothing in the mean of the readings imitates it.
NEW_SCATTER = 3.0


def standardised_residuals(regression: Regression) -> Array:
    """Whitened residuals in robust standard deviations."""
    e = regression.whiten(regression.residual - regression.design @ regression.coefficients)
    spread = 1.4826 * float(np.median(np.abs(e)))
    return np.asarray(e / max(spread, 1e-300))


def clipped_squares(square: Array, variance: Array) -> Array:
    """Squared residuals in their own variances, clipped, with the mean 1 for normal noise."""
    return np.asarray(np.minimum(square / variance, SQUARE_CLIP) / CLIPPED_MEAN)
