"""Linear least squares by the core's one solver: rows, normal equations, groups, clusters.

Columns are scaled to unit length. Directions of which less is left than rounding makes are
omitted, ``32 n ε`` of the greatest singular value (of rows) or eigenvalue (of sums) of
n columns: every other limit here is a stated condition on the readings.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

import trueangle._core as _core

from ..support.arrays import Array
from ..support.distributions import digamma, trigamma, trigamma_inverse

#: Variances over those of white noise that all coefficients may have in common.
LEVELS: Final = 10.0 ** np.arange(-2.0, 4.25, 0.25)


def least_squares(design: Array, target: Array, weights: Array | None = None) -> Array:
    """Coefficients ``b`` that minimise ``Σ_i w_i (y_i - x_i' b)²``.

    Parameters
    ----------
    design : ndarray, shape (n, m)
    target : ndarray, shape (n,) or (n, k)
    weights : ndarray, shape (n,), optional

    Returns
    -------
    ndarray, shape (m,) or (m, k)
        Of least norm in scaled columns, where the rows do not separate all of them.

    Raises
    ------
    numpy.linalg.LinAlgError
        A number is not finite.

    Examples
    --------
    >>> x = np.arange(4.0)
    >>> least_squares(np.column_stack([np.ones(4), x]), 3.0 + 2.0 * x).round(12).tolist()
    [3.0, 2.0]
    """
    found = _core.LinearModel.of_rows(design, target.reshape(len(target), -1), weights)
    return found.coefficients.reshape(-1, *target.shape[1:])


def linear_residual(design: Array, target: Array, weights: Array | None = None) -> Array:
    """What `least_squares` leaves of the target, reading by reading."""
    return np.asarray(target - design @ least_squares(design, target, weights))


def without_columns(few: Array, target: Array, weights: Array | None = None) -> Array:
    """`linear_residual` of few columns and many targets, in time ``n p q`` for ``n (p + q)^2``."""
    root = np.ones(len(few)) if weights is None else np.sqrt(weights)
    even = few / np.maximum(np.abs(few).max(axis=0, initial=0.0), 1e-300)
    inverse = np.linalg.pinv(root[:, None] * even)
    return np.asarray(target - even @ (inverse @ (root[:, None] * target)))


def pseudo_inverse(gram: Array) -> Array:
    """Pseudo-inverse of a symmetric matrix that is not negative, in scaled columns.

    Examples
    --------
    >>> found = pseudo_inverse(np.diag([4.0, 0.0, 1e-30])).diagonal()
    >>> (found * [1.0, 1.0, 1e-30]).round(12).tolist()
    [0.25, 0.0, 1.0]
    """
    return _core.LinearModel.of_sums(gram, np.empty((len(gram), 0)), []).inverse


def wald_statistic(gap: Array, covariance: Array) -> float:
    """``g' V⁺ g``: chi-squared of as many degrees of freedom as numbers where the truth is 0.

    Examples
    --------
    >>> round(wald_statistic(np.array([1.0, 2.0]), np.diag([1.0, 4.0])), 12)
    2.0
    """
    return float(gap @ pseudo_inverse(covariance) @ gap)


def inverse_and_log_determinant(covariances: Array) -> tuple[Array, Any]:
    """Of every matrix of a stack that is positive: what the density of normal errors needs."""
    return np.asarray(np.linalg.inv(covariances)), np.linalg.slogdet(covariances)[1]


@dataclass(frozen=True)
class NormalEquations:
    """Sums over some readings: all that least squares needs of them.

    Attributes
    ----------
    gram : ndarray, shape (m, m)
        ``Xᵀ W X``.
    moment : ndarray, shape (m,)
        ``Xᵀ W y``; of clusters the scores, ``y`` being the residuals of a common fit.
    squares : float
        ``yᵀ W y``.
    readings : float
        How many, or their weight.

    Examples
    --------
    >>> x = np.array([[1.0], [2.0]])
    >>> one = NormalEquations.of_rows(x, np.array([2.0, 4.0]))
    >>> one.solved().coefficients.round(12).tolist()
    [[2.0]]
    """

    gram: Array
    moment: Array
    squares: float = 0.0
    readings: float = 0.0

    @classmethod
    def of_rows(cls, design: Array, target: Array) -> NormalEquations:
        """Of rows, with any weights already applied."""
        return cls(design.T @ design, design.T @ target, float(target @ target), len(target))

    @classmethod
    def of_products(cls, products: Array, mean: Array | None = None) -> NormalEquations:
        """From all products of ``[1 | X | y]``, about their own mean or that of a run."""
        first = products[0]
        mean = first / first[0] if mean is None else mean
        about = products - np.outer(mean, first) - np.outer(first, mean)
        about += first[0] * np.outer(mean, mean)
        squares, readings = float(about[-1, -1]), float(first[0])
        return cls(about[1:-1, 1:-1], about[1:-1, -1], squares, readings)

    def share(self, part: float) -> NormalEquations:
        """As a part of the readings would have them."""
        return NormalEquations(
            part * self.gram, part * self.moment, part * self.squares, part * self.readings
        )

    def among(self, columns: NDArray[np.bool_] | NDArray[np.intp]) -> NormalEquations:
        """Of some columns."""
        gram = self.gram[columns][:, columns]
        return NormalEquations(gram, self.moment[columns], self.squares, self.readings)

    def about(self, coefficients: Array) -> NormalEquations:
        """Of the residuals of these coefficients."""
        score = self.moment - self.gram @ coefficients
        squares = self.squares - float(coefficients @ (self.moment + score))
        return NormalEquations(self.gram, score, squares, self.readings)

    def solved(self) -> _core.LinearModel:
        """Least squares from these sums."""
        return _core.LinearModel.of_sums(self.gram, self.moment[:, None], [self.squares])

    def held(self, ridge: float) -> NormalEquations:
        """With a penalty on every coefficient, relative to the mean of the diagonal."""
        mean = max(float(np.trace(self.gram)) / len(self.gram), 1e-300)
        gram = self.gram + ridge * mean * np.eye(len(self.gram))
        return NormalEquations(gram, self.moment, self.squares, self.readings)


def total(groups: Sequence[NormalEquations]) -> NormalEquations:
    """The sums of all groups together."""
    return NormalEquations(
        np.sum([one.gram for one in groups], axis=0),
        np.sum([one.moment for one in groups], axis=0),
        sum(one.squares for one in groups),
        sum(one.readings for one in groups),
    )


def left_out(groups: Sequence[NormalEquations], ridge: float = 0.0) -> tuple[Array, Array]:
    """Each group as a fit of all others predicts it.

    ::

        b_{-r} = (Σ_{s≠r} G_s)⁺ Σ_{s≠r} m_s,
        S_r(b_{-r}) = y_r' y_r - 2 b_{-r}' m_r + b_{-r}' G_r b_{-r}

    Parameters
    ----------
    groups : sequence of NormalEquations
        Two or more.
    ridge : float
        Added to the diagonal of the others' sums, relative to its mean.

    Returns
    -------
    coefficients : ndarray, shape (groups, m)
    squares : ndarray, shape (groups,)
        Sums of squares left of each group.

    Raises
    ------
    numpy.linalg.LinAlgError
        A number is not finite, or there is one group only.

    Notes
    -----
    Nothing is subtracted: m^3 for every group, and m^2 for its sums and the logarithm of their
    number.

    Examples
    --------
    >>> x = np.ones((2, 1))
    >>> groups = [NormalEquations.of_rows(x, y * x[:, 0]) for y in (1.0, 2.0, 6.0)]
    >>> left_out(groups)[0].ravel().round(12).tolist()
    [4.0, 3.5, 1.5]
    """
    squares = [one.squares for one in groups]
    return _core.left_out(*_stacked(groups), squares, ridge)


#: Runs from which whole runs are the clusters.
FEWEST_RUNS: Final = 3


class ClusterCovariance(NamedTuple):
    """Covariance of the coefficients and the degrees of freedom of each one's variance."""

    covariance: Array
    freedom: Array


def cluster_covariance(
    clusters: Sequence[NormalEquations], penalty: float = 0.0
) -> ClusterCovariance:
    """CR2 covariance with Bell and McCaffrey's degrees of freedom.

    With ``X̃_r`` the regressors of cluster r about their run's mean, ``e`` the
    residuals and ``G = Σ_r X̃_r' W X̃_r``, the covariance is

    ::

        G⁻¹ [Σ_r X̃_r' W^(1/2) A_r e_r e_r' A_r' W^(1/2) X̃_r] G⁻¹,
        A_r = (I - H_rr)^(-1/2)

    (CR2 of Bell and McCaffrey 2002): unbiased for white noise, and right for any correlation
    within a cluster. A coefficient's degrees of freedom are those of Satterthwaite for that sum
    of squares. The readings enter by their sums alone.

    Parameters
    ----------
    clusters : sequence of NormalEquations
        Two or more; their moments are the scores, see `NormalEquations.about`.
    penalty : float
        Added to the diagonal of the normal matrix by a ridge.

    Raises
    ------
    numpy.linalg.LinAlgError
        All clusters together do not separate the coefficients.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> parts = [rng.normal(size=(50, 2)) for _ in range(10)]
    >>> clusters = [NormalEquations.of_rows(x, rng.normal(size=50)) for x in parts]
    >>> found = cluster_covariance(clusters)
    >>> bool((found.freedom > 7.0).all() and (found.freedom < 9.5).all())
    True
    """
    return ClusterCovariance(*_core.cluster_covariance(*_stacked(clusters), penalty))


def moderated_covariance(
    scatter: ClusterCovariance, white: Array, freedom: float
) -> ClusterCovariance:
    """Covariance of coefficients by their scatter, by that of white noise, and by one another.

    With the symmetric root of the covariance of white noise the coefficients are combinations of
    as many that it makes independent, of variance 1. Their variances are ``κ_j``, which the scatter
    measures as ``s_j²`` with n degrees of freedom, and which have a distribution:

    ::

        s_j² ~ κ_j χ²_n / n,    κ_j ~ κ d / χ²_d    given d and κ
        κ_j | s_j² ~ κ̃_j (d + n) / χ²_(d+n),    κ̃_j = (d κ + n s_j²) / (d + n)

    (Smyth 2004). Noise may be white, κ = 1 with d of the residual, or have any of `LEVELS` for
    κ and 1, 2, 4 ... 128 for d, each d being as probable. The result is the mixture over them:
    variances and their degrees of freedom have its mean and variance of ``log κ_j``. Those of the
    coefficients follow (Satterthwaite).

    Parameters
    ----------
    scatter : ClusterCovariance
        By clusters, of coefficients without the constant.
    white : ndarray
        Covariance of the same coefficients under white noise.
    freedom : float
        Degrees of freedom of the residual.

    Raises
    ------
    numpy.linalg.LinAlgError
        The covariance of white noise is singular.

    Examples
    --------
    >>> scatter = ClusterCovariance(np.diag([8.0, 12.0]), np.array([2.0, 2.0]))
    >>> found = moderated_covariance(scatter, np.eye(2), 200.0)
    >>> np.diag(found.covariance).round(1).tolist(), found.freedom.round(1).tolist()
    ([9.5, 10.5], [3.4, 3.5])
    """
    levels, alike = (grid.ravel() for grid in np.meshgrid(LEVELS, 2.0 ** np.arange(8.0)))
    level, d = np.append(levels, 1.0)[:, None], np.append(alike, freedom)[:, None]
    chance = np.append(np.full(levels.size, 1.0 / len(LEVELS)), 1.0)

    powers, axes = np.linalg.eigh(white)
    if not powers[0] > 0.0:
        raise np.linalg.LinAlgError("the covariance of white noise is singular")
    root = axes * np.sqrt(powers) @ axes.T
    apart = np.linalg.solve(root, np.linalg.solve(root, scatter.covariance).T)
    own, n = np.maximum(np.diag(apart), 1e-300), float(scatter.freedom.mean())

    known = d + n
    logs = 0.5 * n * np.log(n * own / (d * level)) - 0.5 * known * np.log1p(n * own / (d * level))
    score = np.log(chance) + (logs + _log_gamma(0.5 * known) - _log_gamma(0.5 * d)).sum(axis=1)
    weight = np.exp(score - score.max())
    weight /= weight.sum()

    value = (d * level + n * own) / known
    # Of the logarithm of kappa.
    mean = np.log(0.5 * known * value) - digamma(0.5 * known)
    middle = weight @ mean
    told = 2.0 * trigamma_inverse(weight @ ((mean - middle) ** 2 + trigamma(0.5 * known)))
    variance = np.exp(middle + digamma(0.5 * told)) / (0.5 * told)
    share = weight @ (n * own / (known * value))
    scale = np.sqrt(share * variance / own)
    inside = apart * np.outer(scale, scale) + np.diag((1.0 - share) * variance)
    parts = root**2 * variance
    own_freedom = parts.sum(axis=1) ** 2 / (parts**2 / told).sum(axis=1)
    return ClusterCovariance(root @ inside @ root, own_freedom)


_log_gamma = np.vectorize(math.lgamma, otypes=[float])


def _stacked(groups: Sequence[NormalEquations]) -> tuple[Array, Array]:
    return np.array([one.gram for one in groups]), np.array([one.moment for one in groups])
