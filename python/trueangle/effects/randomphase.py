"""A line whose phase is new in every run: how well its place and its amplitude are known."""

from __future__ import annotations

import math

import numpy as np

from ..estimation.linear import least_squares
from ..estimation.regression import Regression
from ..support.arrays import Array


class RandomPhaseLine:
    """A line ``a_r cos f x + b_r sin f x`` in every run r.

    Parameters
    ----------
    regression : Regression
        With the line among its terms.
    cause : str
        Its cause; the run effects of others are subtracted.
    waves : ndarray, shape (n, 2)
        Cosine and sine of the line.
    """

    def __init__(self, regression: Regression, cause: str, waves: Array) -> None:
        self._regression, self._waves = regression, waves
        drawing = [term.cause != cause for term in regression.terms if term.run_effect is not None]
        left = regression.left - regression.whiten.run_part(regression.left, drawing)
        found = []
        for start, stop in regression.bounds:
            wave = waves[start:stop] - waves[start:stop].mean(axis=0)
            found.append(least_squares(wave, left[start:stop]))
        #: Cosine and sine of each run, shape (R, 2).
        self._drawn = np.array(found)

    def place_std(self, along: Array) -> float | None:
        """Standard deviation of f, with x the angles ``along`` in radians of f = 1.

        ::

            σ_f⁻² = |P M x (b_r cos f x - a_r sin f x) |² / σ²

        M makes the noise and the random phases white, and P takes out what is fitted: the bound
        of Cramer and Rao with the phases unknown, ``√6 σ/(π A T √n)`` for
        places evenly over a span T of one run. None where the readings do not determine f.
        """
        slope = np.empty_like(along)
        for (start, stop), (a, b) in zip(self._regression.bounds, self._drawn, strict=True):
            # About the run's middle: the products of large places and waves keep their digits.
            x = along[start:stop] - along[start:stop].mean()
            cosine, sine = self._waves[start:stop].T
            slope[start:stop] = x * (b * cosine - a * sine)
        x, excited = self._regression.projected(slope[:, None])
        power = float(x[:, 0] @ x[:, 0])
        known = excited[0] and power > 0.0
        return math.sqrt(self._regression.variance / power) if known else None

    def amplitude(self) -> tuple[float, float]:
        """Root of the mean square amplitude over the R runs, and its standard deviation.

        ::

            A² = mean(a_r² + b_r²) - 4 R σ² / n,
            σ_A² = max(var_r(a_r² + b_r²) / (4 A² R), 2 σ² / n)

        What the noise of n readings adds is subtracted; the error is by how much the runs differ,
        and no less than what the noise makes them.
        """
        squares = (self._drawn**2).sum(axis=1)
        noise = 2.0 * self._regression.variance / self._regression.n
        mean = float(squares.mean())
        amplitude = math.sqrt(max(mean - 2.0 * squares.size * noise, 0.1 * mean))
        scatter = float(squares.std(ddof=1)) if squares.size > 1 else 0.0
        apart = scatter / math.sqrt(squares.size) / max(2.0 * amplitude, 1e-300)
        return amplitude, max(math.sqrt(noise), apart)
