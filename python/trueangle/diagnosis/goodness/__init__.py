"""How well an account fits, by tests that need no name.

Tests show whether the residual of the readings is noise: at the same place, in either
direction, from run to run, in time. Each test has a p value that holds for noise that is
correlated, heavy-tailed or uneven, search included; none knows a cause.
"""

from __future__ import annotations

from .evidence import Evidence
from .leftover import Leftover
from .noise import Noise, estimate_noise
from .unexplained import FREE_PATH, LEVEL, Unexplained, goodness_of_fit

__all__ = [
    "FREE_PATH",
    "LEVEL",
    "Evidence",
    "Leftover",
    "Noise",
    "Unexplained",
    "estimate_noise",
    "goodness_of_fit",
]
