"""Events: what follows the time since a reversal or the start of the run, and steps.

With ``s`` seconds since the event and ``d`` the direction, the residual is compared with

::

    g = e^(-s/τ)    and    g = d e^(-s/τ)

about their means between two events, for a few ``τ``. The sums over runs (or pieces of few
runs) are compared with their own scatter by Student's t, for any noise within them.

Steps between levels are what changes rarely and by much, not a little all the time. Medians of
blocks of readings in a row (which single readings and tails hardly move) have increments that are
normal for any noise and for a random walk. Something that sits at levels and changes over between
them has few large ones: their kurtosis

::

    b₂ = mean(d⁴) / (mean(d²)²)

is above three, which is tested as Anscombe and Glynn (1983) do, with the number of independent
increments. Every run is taken in units of its own scatter, which lowers the kurtosis of m
increments by ``m/(m + 2)``.
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np

from ...support.arrays import Array
from ...support.display_units import brief_number
from ...support.distributions import normal_tail
from .evidence import Evidence, drawn_signs, largest_of, made_even
from .leftover import Leftover
from .place import ModulatedSums, unit_sums
from .scatter import normal_kurtosis

#: Form that the tests report.
AFTER_REVERSALS = "relaxes after reversals"
AFTER_START = "relaxes after the start of a run"
STEPS = "steps between levels"

#: Time constants, in shares of the time between two events.
CONSTANTS = (0.05, 0.2, 0.6)

#: Readings between two events that show how something relaxes.
LEAST_READINGS = 12

#: Readings of a block, and blocks that a run must have.
BLOCK, LEAST_BLOCKS = 9, 8

#: Increments needed together, and those that neighbours which share a block are worth.
LEAST_INCREMENTS, SHARED = 40, 1.125

#: Kurtosis that medians of readings which share much of their noise may have beyond three:
#: 0.15 was the most in noise of which neighbours share 0 to 0.99.
ALLOWED = 0.2

#: Standard deviations of increments from which on one is reported as a step.
STEP = 4.0


def reversal_test(left: Leftover) -> Evidence | None:
    """Test for an error that relaxes after each reversal, the same or by direction."""
    cuts = np.flatnonzero((np.diff(left.direction) != 0.0) & (np.diff(left.run) == 0)) + 1
    first = {start for start, _ in left.bounds}
    edges = sorted({*first, len(left), *cuts.tolist()})
    stretches = [
        (a, b) for a, b in itertools.pairwise(edges) if a not in first and b - a >= LEAST_READINGS
    ]
    return _relaxing(left, stretches, "after reversals", AFTER_REVERSALS, both=True)


def start_test(left: Leftover) -> Evidence | None:
    """Test for an error that relaxes from the start of every run, the same in all."""
    long = [(a, b) for a, b in left.bounds if b - a >= LEAST_READINGS]
    return _relaxing(left, long, "from the start of the runs", AFTER_START, both=False)


def _relaxing(
    left: Leftover, stretches: list[tuple[int, int]], when: str, looks_like: str, both: bool
) -> Evidence | None:
    units = left.units()
    if len(units) < 3 or len(stretches) < 3:
        return None
    inside = np.zeros(len(left), dtype=bool)
    for a, b in stretches:
        inside[a:b] = True
    about = replace(left, residual=left.centred(stretches) * inside)
    span = float(np.median([left.clock[b - 1] - left.clock[a] for a, b in stretches]))
    if span <= 0.0:
        return None
    found: list[tuple[ModulatedSums, float, float]] = []
    for constant in CONSTANTS:
        since = np.zeros(len(left))
        for a, b in stretches:
            decay = np.exp(-(left.clock[a:b] - left.clock[a]) / (constant * span))
            since[a:b] = decay - decay.mean()
        for g in (since, since * left.direction) if both else (since,):
            rms = float(np.sqrt(np.mean(g**2)))
            found.append((unit_sums(g, about, units), rms, constant * span))

    def smallest(signs: Array | float) -> float:
        # Time constants that differ by a factor of three are half collinear.
        return largest_of(min(sums.chance(signs) for sums, *_ in found), 0.6 * len(found))

    best, rms, constant = min(found, key=lambda item: item[0].chance())
    size = best.size
    p = made_even(smallest(1.0), [smallest(signs) for signs in drawn_signs(len(units))])
    unit = "s" if left.timed else "readings"
    return Evidence(
        f"time since {looks_like.rsplit(' ', 1)[-1]}",
        abs(size),
        p,
        f"the residual relaxes in time {when}, within about {constant:.2g} {unit}",
        rms=abs(size) * rms,
        looks_like=looks_like,
    )


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
