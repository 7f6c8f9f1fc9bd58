"""What follows the time since an event: since the last reversal, or since the start of the run.

With ``s`` seconds since the event and ``d`` the direction, the residual is compared with

::

    g = e^(-s/τ)    and    g = d e^(-s/τ)

about their means between two events, for a few ``τ``. The sums over runs (or pieces of few
runs) are compared with their own scatter by Student's t, for any noise within them.
"""

from __future__ import annotations

import itertools
from dataclasses import replace

import numpy as np

from ...support.arrays import Array
from .evidence import Evidence, drawn_signs, largest_of, made_even
from .leftover import Leftover
from .place import ModulatedSums, unit_sums

#: Form that the tests report.
AFTER_REVERSALS = "relaxes after reversals"
AFTER_START = "relaxes after the start of a run"

#: Time constants, in shares of the time between two events.
CONSTANTS = (0.05, 0.2, 0.6)

#: Readings between two events that show how something relaxes.
LEAST_READINGS = 12


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
