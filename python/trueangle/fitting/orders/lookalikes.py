"""Orders that the readings themselves cannot distinguish from those retained.

On one grid an alias explains exactly as much. Where the zeros of the runs differ a
little, an order m turns by ``m`` times the shift: given noise and amplitude, that may
or may not suffice to decide. The likelihood determines it.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from ...estimation.linear import pseudo_inverse
from ...runs.aliasing import Positions, position_coherence
from .zerogroups import ZeroGroupReadings, unit_columns

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
    columns = np.concatenate(unit_columns(units, [*rest, order, *others]))
    products = columns.T @ columns
    kept = np.arange(2 * len(rest))
    first = kept.size

    def left(start: int) -> float:
        own = np.append(kept, [start, start + 1])
        score = products[own, -1]
        return float(products[-1, -1] - score @ pseudo_inverse(products[np.ix_(own, own)]) @ score)

    best = left(first)
    return [left(first + 2 * j) - best for j in range(1, len(others) + 1)]
