"""Orders that the readings themselves cannot distinguish from those retained.

On one grid an alias explains exactly as much. Where the zeros of the runs differ a
little, an order m turns by ``m`` times the shift: given noise and amplitude, that may
or may not suffice to decide. The likelihood determines it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from ...runs.aliasing import Positions, position_coherence
from .chosen import fit_chosen_orders
from .harmonicsums import harmonic_sums
from .zerogroups import ZeroGroupReadings

#: Two orders are separated when one explains better by this many noise variances: a
#: likelihood ratio of e^5, about 150 to 1.
DECISIVE: Final = 10.0


def find_lookalikes(
    units: Sequence[ZeroGroupReadings],
    positions: Positions,
    orders: Sequence[float],
    variance: float,
    highest: int,
) -> list[dict[int, float]]:
    """For each of ``orders``, those up to ``highest`` that could take its place.

    Ascending, with the increase of the sum of squares that each would cost; none where the readings
    decide.
    """
    every = np.arange(1, highest + 1)
    found: list[dict[int, float]] = []
    for order in orders:
        coherence = position_coherence(positions, order, every.astype(np.float64))
        coherence[[int(k) - 1 for k in orders if k <= highest and k == int(k)]] = 0.0
        # From here on two orders are one at the positions, whatever the noise.
        same = {int(m): 0.0 for m in every[coherence > 1.0 - 1e-9]}
        # Only orders at least this coherent at the positions are tried: one below explains at most
        # ``coherence^2`` of the other's energy and fails by itself.
        alike = [int(m) for m in every[coherence > 0.9] if m not in same]
        losses = _substitution_losses(units, orders, order, alike) if alike else []
        tried = same | dict(zip(alike, losses, strict=True))
        found.append({m: tried[m] for m in sorted(tried) if tried[m] < DECISIVE * variance})
    return found


def _substitution_losses(
    units: Sequence[ZeroGroupReadings],
    orders: Sequence[float],
    order: float,
    others: Sequence[float],
) -> list[float]:
    """Increase of the sum of squares when each of ``others`` takes the place of ``order``."""
    rest = [k for k in orders if k != order]
    together = [*rest, order, *others]
    sums = harmonic_sums(units, together)
    kept = list(range(len(rest)))
    best = fit_chosen_orders(sums, [*kept, len(rest)])[2]
    return [
        fit_chosen_orders(sums, [*kept, len(rest) + 1 + j])[2] - best for j in range(len(others))
    ]
