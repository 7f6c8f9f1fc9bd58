"""One test of a goodness of fit, and p values of the largest of many."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from ...support.plainresult import finite

__all__ = ["Evidence", "largest_of"]


@dataclass(frozen=True)
class Evidence:
    """What one test says.

    Attributes
    ----------
    test : str
        Its name.
    statistic : float
    p : float
        Chance that noise alone gives as large a statistic, the search included.
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
    """

    test: str
    statistic: float
    p: float
    says: str
    decides: bool = True
    rms: float = 0.0
    at: float | None = None
    looks_like: str = ""

    def to_dict(self) -> dict[str, Any]:
        """The entry of ``unexplained.evidence``."""
        return {
            "test": self.test,
            "statistic": finite(self.statistic),
            "p": self.p,
            "says": self.says,
            "decides": self.decides,
            "looks_like": self.looks_like,
        }


def largest_of(p: float, count: float) -> float:
    """Chance that the smallest of ``count`` independent p values is ``p`` or less.

    Examples
    --------
    >>> round(largest_of(0.001, 10), 6)
    0.009955
    """
    return float(-np.expm1(count * np.log1p(-min(max(p, 0.0), 1.0 - 1e-16))))
