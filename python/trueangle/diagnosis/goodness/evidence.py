"""One test of goodness of fit; p values of the largest of many, made uniform by random signs."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...support.plainresult import plain_fields

#: Repetitions of a search with random signs, and units from which on the signs differ enough.
DRAWS, ENOUGH_UNITS = 32, 6


@dataclass(frozen=True)
class Evidence:
    """Result of one test.

    Attributes
    ----------
    test : str
        Its name.
    statistic : float
    p : float
        Probability that noise alone gives as large a statistic, the search included.
    says : str
        What it means, in one sentence.
    decides : bool
        The test is one of place, direction, run and time, which decide that something is
        unexplained; the others describe the noise.
    rms : float
        Of the structure that it shows, in units of the residual.
    at : float or None
        Frequency (per s, or per turn) of the line that it shows, where it shows one.
    looks_like : str
        What such structure resembles.
    lines : tuple of float
        Output orders that it shows with one phase at every reading.
    """

    test: str
    statistic: float
    p: float
    says: str
    decides: bool = True
    rms: float = 0.0
    at: float | None = None
    looks_like: str = ""
    lines: tuple[float, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """The entry of ``unexplained.evidence``."""
        return plain_fields(self, "test statistic p says decides looks_like")


def largest_of(p: float, count: float) -> float:
    """Probability that the smallest of ``count`` independent p values is ``p`` or less.

    Examples
    --------
    >>> round(largest_of(0.001, 10), 6)
    0.009955
    """
    return float(-np.expm1(count * np.log1p(-min(max(p, 0.0), 1.0 - 1e-16))))


def drawn_signs(units: int) -> NDArray[np.float64]:
    """Signs of units sampled at random, shape (draws, units); no draws for few units.

    What noise gives a unit it might have given with the other sign; what they share is lost.
    """
    draws = DRAWS if units >= ENOUGH_UNITS else 0
    return np.random.default_rng(units).choice([-1.0, 1.0], (draws, units))


def made_even(p: float, drawn: Sequence[float]) -> float:
    """A p value of a search, uniform under noise, by the same search with random signs.

    Trials depend on each other: the smallest of them has ``x = - ln(1 - p)`` exponentially
    distributed with a rate that B draws estimate, so that the probability of less is

    ::

        1 - (1 + x / (Σ_b x_b))^(-B).

    Examples
    --------
    >>> round(made_even(0.01, [0.5] * 32), 4)
    0.0144
    >>> made_even(0.01, [])
    0.01
    """
    if not len(drawn):
        return p
    x = -np.log1p(-np.clip([p, *drawn], 0.0, 1.0 - 1e-12))
    total = max(float(x[1:].sum()), 1e-300)
    return float(-np.expm1(-len(drawn) * np.log1p(x[0] / total)))
