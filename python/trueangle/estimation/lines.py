"""Cosines and sines of every order that is searched for, once for all scores."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

import trueangle._core as _core

from ..joint.joint import Joint
from .blocks import BlockProducts

#: Orders searched at least, and at most: bounds memory and the penalty of the search.
LEAST_ORDERS, MOST_ORDERS = 128, 1024


#: Output orders up to this one are expected of any rotary part.
LOW_ORDERS = 24


@dataclass(frozen=True, eq=False)
class LineBasis:
    """Cosine and sine of ``m theta`` for every order m searched, in single precision.

    Attributes
    ----------
    orders : ndarray, shape (k,)
    plausible : ndarray of bool, shape (k,)
        Orders that physics expects; they pay a lower penalty for the search.
    columns : callable
        Gives `values` when they are first used.
    """

    orders: NDArray[np.float64]
    plausible: NDArray[np.bool_]
    columns: Callable[[], NDArray[np.float32]]

    @classmethod
    def of(cls, theta: NDArray[np.float64], joint: Joint) -> LineBasis:
        """Lines of a joint's readings.

        Whole output orders up to four turns of the fastest shaft and a bit, and the lowest
        multiples of every shaft.
        """
        top = math.ceil(4.0 * max(joint.shafts.values())) + 8
        top = min(max(top, LEAST_ORDERS), MOST_ORDERS)
        whole = {float(m) for m in range(1, top + 1)}
        multiples = {
            k * cycles
            for cycles in joint.shafts.values()
            # Orders of each shaft (per pole pair of the encoder) searched beyond the whole ones.
            for k in range(1, 12 * min(joint.pole_pairs, 4) + 1)
        }
        further = sorted(multiples - whole)
        orders = np.array([*sorted(whole), *further], dtype=np.float64)
        apart = np.abs(orders[:, None] - np.array(plausible_orders(joint)))
        plausible = np.asarray(apart.min(axis=1) < 1e-9)
        return cls(orders, plausible, lambda: _core.line_columns(theta, orders, True))

    @cached_property
    def values(self) -> NDArray[np.float32]:
        """Cosine and sine of every order side by side, shape (n, 2 k)."""
        return self.columns()

    @cached_property
    def products(self) -> BlockProducts:
        """Sums of cos^2, sin^2 and cos sin of every order under any noise."""
        return BlockProducts(self.values, 2)

    def take(self, rows: NDArray[np.bool_]) -> LineBasis:
        """The basis of some of the readings."""
        return replace(self, columns=lambda: self.values[rows])


def plausible_orders(joint: Joint) -> list[float]:
    """Output orders with a standard physical cause, and the neighbours of gear orders."""
    found = {float(m) for m in range(1, LOW_ORDERS + 1)}
    found |= {joint.output_order(shaft, k) for shaft, k in joint.gear_orders()}
    if "wave_generator" in joint.shafts:
        found.add(joint.shafts["motor"] + joint.shafts["wave_generator"])
    return sorted(found)
