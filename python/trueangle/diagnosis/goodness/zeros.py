"""Runs that differ in their zeros by more than the noise within them allows."""

from __future__ import annotations

import numpy as np

from ...support.display_units import brief_number
from ...support.distributions import f_tail
from .evidence import Evidence
from .leftover import Leftover
from .noise import Noise

#: The name of the test.
ZEROS = "zeros of the runs"

#: Runs from which on zeros can differ.
LEAST_RUNS = 3


def variance_of_mean(readings: int, noise: Noise) -> float:
    """Variance of the mean of readings in a row.

    ::

        (σ² / n²)(n + 2Σ_{k=1..n-1} (n - k) ρ^k)

    Examples
    --------
    >>> variance_of_mean(4, Noise(2.0, 0.0, 0.0, 0.0, 3.0, 0.0))
    1.0
    """
    n, rho = float(readings), noise.correlation
    total = n
    if rho:
        total += 2.0 * rho * (n * (1.0 - rho) - (1.0 - rho**n)) / (1.0 - rho) ** 2
    return noise.sigma**2 * total / n**2


def run_test(left: Leftover, noise: Noise) -> Evidence | None:
    """Scatter of the runs' means against what correlated noise makes of them.

    The noise's own estimate and the difference between the halves of each run (which
    holds for slower noise too) must both be exceeded.
    """
    bounds = left.bounds
    if len(bounds) < LEAST_RUNS:
        return None
    means, expected, halves = [], [], []
    for start, stop in bounds:
        part = left.residual[start:stop]
        middle = part.size // 2
        means.append(float(part.mean()))
        expected.append(variance_of_mean(part.size, noise))
        if middle:
            halves.append(0.25 * float(part[:middle].mean() - part[middle:].mean()) ** 2)
    weights = 1.0 / np.maximum(np.array(expected), 1e-300)
    m = np.array(means)
    m -= weights @ m / weights.sum()
    between = float(weights @ m**2)
    runs = len(bounds)
    rho = noise.correlation
    # Number of independent readings with as much information about the variance.
    freedom = max(noise.freedom * (1.0 - rho) / (1.0 + rho) / 2.0, 1.0)
    statistic = between / (runs - 1)
    p = f_tail(statistic, runs - 1, freedom)
    if halves:
        within = float(np.mean(np.array(halves) * weights[: len(halves)]))
        p = max(p, f_tail(statistic / max(within, 1e-300), runs - 1, len(halves)))
    spread = float(np.sqrt(max(float(np.var(m, ddof=1)) - float(np.mean(expected)), 0.0)))
    return Evidence(
        ZEROS,
        statistic,
        p,
        f"the runs differ in their zeros by {brief_number(spread)} arcsec beyond what the noise "
        "explains",
        rms=spread,
        looks_like="a new zero in every run",
    )
