r"""Cluster-robust covariance: scores summed over whole runs, or over long stretches of them.

With :math:`\tilde X_r` the regressors of cluster r about their run's mean, ``e`` the residuals
and :math:`G = \sum_r \tilde X_r' W \tilde X_r`, the covariance is

.. math:: G^{-1} \Big[ \sum_r \tilde X_r' W^{1/2} A_r e_r e_r' A_r' W^{1/2} \tilde X_r \Big] G^{-1},
          \qquad A_r = (I - H_{rr})^{-1/2}

(CR2 of Bell and McCaffrey 2002): unbiased for white noise, and right for any correlation within
a cluster. A coefficient's degrees of freedom are those of Satterthwaite for that sum of squares.
Everything happens among the coefficients: the readings enter by their sums alone.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

__all__ = ["Cluster", "Robust", "robust_covariance", "scatter_statistic"]

Array = NDArray[np.float64]

#: A cluster whose leverage in some direction comes this close to 1 alone decides on it: its
#: residual says nothing there.
_ALONE: Final = 1.0 - 1e-6

#: With more coefficients the adjustment of each cluster is left out (CR1): its factor for all.
_MOST: Final = 256


class Cluster(NamedTuple):
    """Sums over a cluster: ``gram = X' W X`` and ``score = X' W e``, about the run's mean."""

    gram: Array
    score: Array


class Robust(NamedTuple):
    """Covariance of the coefficients and the degrees of freedom of each one's variance."""

    covariance: Array
    freedom: Array


def robust_covariance(clusters: Sequence[Cluster], penalty: float = 0.0) -> Robust:
    """CR2 covariance with Bell and McCaffrey's degrees of freedom.

    Parameters
    ----------
    clusters : sequence of Cluster
        Two or more.
    penalty : float
        Added to the diagonal of the normal matrix by a ridge.

    Examples
    --------
    >>> rng = np.random.default_rng(0)
    >>> parts = [rng.normal(size=(50, 2)) for _ in range(10)]
    >>> found = robust_covariance([Cluster(x.T @ x, x.T @ rng.normal(size=50)) for x in parts])
    >>> bool((found.freedom > 7.0).all() and (found.freedom < 9.5).all())
    True
    """
    count, size = len(clusters), clusters[0].score.size
    gram = np.sum([c.gram for c in clusters], axis=0)
    root = np.linalg.cholesky(gram)
    bread = np.linalg.inv(gram + penalty * np.eye(size))
    if size > _MOST:
        scores = np.array([c.score for c in clusters])
        half = scores @ bread * np.sqrt(count / (count - 1.0))
        return Robust(half.T @ half, np.full(size, count - 1.0))
    inverse = np.linalg.inv(root)
    towards = root.T @ bread
    halves, own, through = [], [], []
    for cluster in clusters:
        share = inverse @ cluster.gram @ inverse.T
        values, vectors = np.linalg.eigh(0.5 * (share + share.T))
        values = np.clip(values, 0.0, 1.0)
        left = np.where(values < _ALONE, 1.0 - values, np.inf)
        turned = vectors.T @ towards
        halves.append((turned / np.sqrt(left)[:, None]).T @ (vectors.T @ (inverse @ cluster.score)))
        own.append((values / left) @ turned**2)
        through.append(vectors @ ((values / np.sqrt(left))[:, None] * turned))
    scores = np.array(halves)
    return Robust(scores.T @ scores, _freedom(np.array(own), np.array(through)))


def _freedom(own: Array, through: Array) -> Array:
    """Satterthwaite's ``(tr B)^2 / tr B^2`` of every coefficient's sum of squares.

    ``B_rs = own_r [r = s] - through_r' through_s`` under white noise.
    """
    found = np.empty(own.shape[1])
    for j in range(found.size):
        form = np.diag(own[:, j]) - through[:, :, j] @ through[:, :, j].T
        square = float((form * form).sum())
        found[j] = np.trace(form) ** 2 / square if square > 0.0 else 1.0
    return np.maximum(found, 1.0)


def scatter_statistic(clusters: Sequence[Cluster], variance: float) -> tuple[float, float]:
    """Chi-squared of the clusters' own coefficients about the common ones, and its freedom.

    Near its degrees of freedom where the residuals are white with this variance.
    """
    total, freedom = 0.0, -float(clusters[0].score.size)
    for cluster in clusters:
        values, vectors = np.linalg.eigh(cluster.gram)
        seen = values > 1e-9 * values[-1]
        total += float(np.sum((vectors.T @ cluster.score)[seen] ** 2 / values[seen])) / variance
        freedom += float(np.count_nonzero(seen))
    return total, max(freedom, 1.0)
