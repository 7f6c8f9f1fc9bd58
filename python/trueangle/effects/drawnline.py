"""A line whose phase every run draws anew: how well its place and its amplitude are known."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ..estimation.regression import Regression

__all__ = ["drawn_amplitude", "place_std"]

Array = NDArray[np.float64]


def place_std(regression: Regression, cause: str, waves: Array, along: Array) -> float | None:
    r"""Standard deviation of the f of a line :math:`a_r \cos f x + b_r \sin f x` in every run r.

    .. math:: \sigma_f^{-2} = \Bigl\| P M x (b_r \cos f x - a_r \sin f x) \Bigr\|^2 / \sigma^2

    M makes the noise and the drawn phases white, and P takes out what is fitted: the bound of
    Cramer and Rao with the phases unknown, :math:`\sqrt 6\,\sigma/(\pi A T \sqrt n)` for places
    evenly over a span T of one run.

    Parameters
    ----------
    regression : Regression
        With the line among its terms.
    cause : str
        Its cause; what others drew is taken off.
    waves : ndarray, shape (n, 2)
        Cosine and sine of the line.
    along : ndarray, shape (n,)
        x: radians of f = 1.

    Returns
    -------
    float or None
        None where the readings do not tell f.
    """
    slope = np.empty_like(along)
    for (start, stop), (a, b) in zip(
        regression.bounds, _drawn(regression, cause, waves), strict=True
    ):
        # About the run's middle: the products of large places and waves keep their digits.
        x = along[start:stop] - along[start:stop].mean()
        slope[start:stop] = x * (b * waves[start:stop, 0] - a * waves[start:stop, 1])
    x, excited = regression.projected(slope[:, None])
    power = float(x[:, 0] @ x[:, 0])
    return math.sqrt(regression.variance / power) if excited[0] and power > 0.0 else None


def drawn_amplitude(regression: Regression, cause: str, waves: Array) -> tuple[float, float]:
    r"""Root of the mean square amplitude over the R runs, and its standard deviation.

    .. math:: A^2 = \overline{a_r^2 + b_r^2} - \frac{4 R \sigma^2}{n}, \qquad
              \sigma_A^2 = \max\Bigl(\frac{\mathrm{var}_r(a_r^2 + b_r^2)}{4 A^2 R},
              \frac{2 \sigma^2}{n}\Bigr)

    What the noise of n readings adds is taken off; the error is by how much the runs differ, and
    no less than what the noise makes them.
    """
    squares = (_drawn(regression, cause, waves) ** 2).sum(axis=1)
    noise = 2.0 * regression.variance / regression.n
    mean = float(squares.mean())
    amplitude = math.sqrt(max(mean - 2.0 * squares.size * noise, 0.1 * mean))
    scatter = float(squares.std(ddof=1)) if squares.size > 1 else 0.0
    apart = scatter / math.sqrt(squares.size) / max(2.0 * amplitude, 1e-300)
    return amplitude, max(math.sqrt(noise), apart)


def _drawn(regression: Regression, cause: str, waves: Array) -> Array:
    """What every run drew: its cosine and sine, shape (R, 2)."""
    drawing = [term.cause != cause for term in regression.terms if term.run_effect is not None]
    left = regression.left - regression.whiten.run_part(regression.left, drawing)
    found = []
    for start, stop in regression.bounds:
        wave = waves[start:stop] - waves[start:stop].mean(axis=0)
        found.append(np.linalg.lstsq(wave, left[start:stop], rcond=None)[0])
    return np.array(found)
