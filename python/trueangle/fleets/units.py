"""The last calibration of every unit side by side, and what the units that belong share."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..joint.shafts import ShaftOrders
from .calibration import Calibration, columns_of, output_orders
from .noise import UnitNoise, noise_of
from .outliers import Deviates, deviates, weights_of
from .variance import Between, held_out_score, reml

__all__ = ["FEWEST", "SharedPattern", "Units", "pattern_of"]

Array = NDArray[np.float64]

#: Units below which none is told to be an outlier: the others are what it is told by.
FEWEST: Final = 5

#: Share of the units that are set aside as outliers, at most (one may always be).
FEW: Final = 0.05

#: Places of a turn for each cycle of the highest order.
_PLACES: Final = 16


class Units:
    """The last calibration of every unit, and all dates of those with several."""

    def __init__(
        self, dated: Sequence[Sequence[Calibration]], shafts: list[ShaftOrders], period: float
    ) -> None:
        self.shafts, self.period = shafts, period
        self.orders = output_orders(shafts)
        every = [one for dates in dated for one in dates]
        self.noise: UnitNoise = noise_of(
            np.array([one.squares for one in every]), np.array([one.freedom for one in every])
        )
        spread = dict(zip(map(id, every), self.noise.units.tolist(), strict=True))
        self.dated = [[(one, spread[id(one)]) for one in dates] for dates in dated]
        self.last = [dates[-1] for dates in self.dated]
        coefficients = np.array([one.coefficients for one, _ in self.last])
        self.coefficients = coefficients
        self.values = [coefficients[:, 2 * k : 2 * k + 2] for k in range(self.orders.size)]
        blocks = np.array([noise * one.blocks() for one, noise in self.last])
        self.own = [np.ascontiguousarray(blocks[:, k]) for k in range(self.orders.size)]
        highest = max(8.0, float(self.orders.max()))
        places = np.linspace(0.0, period, int(_PLACES * highest), endpoint=False)
        curves = coefficients @ columns_of(places, self.orders, period).T
        self.peak_to_peak = np.ptp(curves, axis=1)
        self.left = np.sqrt([max(one.squares / one.freedom, 0.0) for one, _ in self.last])


class SharedPattern(NamedTuple):
    """What the units that belong share, with or without a mean.

    ``belong`` are the units that are no outliers; all of them where more stand out than
    `FEW` says: these are the tails of the design, of which the next unit may be one.
    """

    aligned: bool
    deviates: Deviates
    belong: NDArray[np.bool_]
    between: list[Between]
    scores: Array


def pattern_of(units: Units, aligned: bool) -> SharedPattern:
    """Outliers, and mean and variance of the others."""
    found = deviates(units.values, units.own, aligned, shares=weights_of(units.orders))
    if len(units.last) < FEWEST:
        found = found._replace(outlying=np.zeros(len(units.last), dtype=bool))
    few = found.outlying.sum() <= max(1.0, FEW * len(units.last))
    kept = ~found.outlying if few else np.ones(len(units.last), dtype=bool)
    scores = np.zeros(len(units.last))
    between = []
    for values, own in zip(units.values, units.own, strict=True):
        one = reml(values[kept], own[kept], aligned)
        between.append(one)
        scores[kept] += held_out_score(values[kept], own[kept], one.variance, aligned)
    return SharedPattern(aligned, found, kept, between, scores)
