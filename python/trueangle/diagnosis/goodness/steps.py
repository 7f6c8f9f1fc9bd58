"""Steps between levels: what changes rarely and by much, not a little all the time.

Medians of blocks of readings in a row (which single readings and tails hardly move) have
increments that are normal for any noise and for a random walk. Something that sits at levels and
changes over between them has few large ones: their kurtosis

::

    b₂ = mean(d⁴) / (mean(d²)²)

is above three, which is tested as Anscombe and Glynn (1983) do, with the number of independent
increments. Every run is taken in units of its own scatter, which lowers the kurtosis of m
increments by ``m/(m + 2)``.
"""

from __future__ import annotations

import numpy as np

from ...support.display_units import brief_number
from ...support.distributions import normal_tail
from .evidence import Evidence
from .leftover import Leftover
from .scatter import normal_kurtosis

#: Form that the test reports.
STEPS = "steps between levels"

#: Readings of a block, and blocks that a run must have.
BLOCK, LEAST_BLOCKS = 9, 8

#: Increments needed together, and those that neighbours which share a block are worth.
LEAST_INCREMENTS, SHARED = 40, 1.125

#: Kurtosis that medians of readings which share much of their noise may have beyond three:
#: 0.15 was the most in noise of which neighbours share 0 to 0.99.
ALLOWED = 0.2

#: Standard deviations of increments from which on one is reported as a step.
STEP = 4.0


def steps_test(left: Leftover) -> Evidence | None:
    """Kurtosis of the increments of blocks; None where there are too few."""
    parts, large, fourth = [], [], 0.0
    for start, stop in left.bounds:
        blocks = (stop - start) // BLOCK
        if blocks < LEAST_BLOCKS:
            continue
        rows = left.residual[start : start + blocks * BLOCK].reshape(blocks, BLOCK)
        d = np.diff(np.median(rows, axis=1))
        spread = float(np.sqrt(np.mean(d**2)))
        if spread > 0.0:
            parts.append(d / spread)
            # Reported as steps: those beyond the noise of their own run.
            large.append(d[np.abs(d) > STEP * 1.4826 * float(np.median(np.abs(d)))])
            shared = float(np.mean(d[1:] * d[:-1])) / spread**2
            known = d.size / (1.0 + 2.0 * shared**2)
            fourth += float(np.sum((d / spread) ** 4)) * (known + 2.0) / known
    if not parts or sum(map(len, parts)) < LEAST_INCREMENTS:
        return None
    d = np.concatenate(parts)
    kurtosis = fourth / d.size
    steps = np.concatenate(large)
    size = float(np.sqrt(np.mean(steps**2))) if steps.size else 0.0
    return Evidence(
        "steps in time",
        kurtosis,
        normal_tail(normal_kurtosis(kurtosis - ALLOWED, d.size / SHARED)),
        f"the residual changes in steps between levels: {steps.size} of about "
        f"{brief_number(size)} arcsec",
        rms=0.5 * size,
        looks_like=STEPS,
    )
