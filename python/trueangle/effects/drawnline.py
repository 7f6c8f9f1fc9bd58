"""A line whose phase every run draws anew: how well its frequency or order is known."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..estimation.regression import Regression

__all__ = ["place_std"]

Array = NDArray[np.float64]


def place_std(regression: Regression, waves: Array, along: Array) -> float:
    r"""Standard deviation of the f of a line :math:`a_r \cos f x + b_r \sin f x` in every run r.

    .. math:: \sigma_f^{-2} = \Bigl\| P M x (b_r \cos f x - a_r \sin f x) \Bigr\|^2 / \sigma^2

    M makes the noise and the drawn phases white, and P takes out what is fitted: the bound of
    Cramer and Rao with the phases unknown, :math:`\sqrt 6\,\sigma/(\pi A T \sqrt n)` for places
    evenly over a span T of one run.

    Parameters
    ----------
    regression : Regression
        With the line among its terms.
    waves : ndarray, shape (n, 2)
        Cosine and sine of the line.
    along : ndarray, shape (n,)
        x: radians of f = 1.

    Returns
    -------
    float
        Infinite where the readings do not tell f.
    """
    slope = np.empty_like(along)
    for start, stop in regression.bounds:
        wave = waves[start:stop] - waves[start:stop].mean(axis=0)
        a, b = np.linalg.lstsq(wave, regression.left[start:stop], rcond=None)[0]
        # About the run's middle: the products of large places and waves keep their digits.
        x = along[start:stop] - along[start:stop].mean()
        slope[start:stop] = x * (b * waves[start:stop, 0] - a * waves[start:stop, 1])
    x, excited = regression.projected(slope[:, None])
    power = float(x[:, 0] @ x[:, 0])
    return float(np.sqrt(regression.variance / power)) if excited[0] and power else float("inf")
