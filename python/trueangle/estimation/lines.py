"""Cosines and sines of every order that is searched for, once for all scores."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

import trueangle._core as _core

from ..joint.joint import Joint
from .batch import Products

__all__ = ["LineBasis", "plausible_orders"]

#: Orders searched at least, and at most: bounds memory and the penalty of the search.
LEAST_ORDERS, MOST_ORDERS = 128, 1024

#: Orders of each shaft (per pole pair of the encoder) searched beyond the whole ones.
SHAFT_ORDERS = 12

#: Output orders up to this one are expected of any rotary part.
LOW_ORDERS = 24


class LineBasis:
    """Cosine and sine of ``m theta`` for every order m searched, in single precision.

    Whole output orders up to four turns of the fastest shaft and a bit, and the lowest
    multiples of every shaft.

    Attributes
    ----------
    orders : ndarray, shape (k,)
    plausible : ndarray of bool, shape (k,)
        Orders that physics expects; they pay a lower penalty for the search.
    """

    def __init__(
        self, theta: NDArray[np.float64], joint: Joint, values: NDArray[np.float32] | None = None
    ) -> None:
        self.theta = theta
        self.joint = joint
        top = math.ceil(4.0 * max(joint.shafts.values())) + 8
        top = min(max(top, LEAST_ORDERS), MOST_ORDERS)
        whole = {float(m) for m in range(1, top + 1)}
        multiples = {
            k * cycles
            for cycles in joint.shafts.values()
            for k in range(1, SHAFT_ORDERS * min(joint.pole_pairs, 4) + 1)
        }
        further = sorted(multiples - whole)
        self.orders = np.array([*sorted(whole), *further], dtype=np.float64)
        expected = plausible_orders(joint)
        self.plausible = np.array([any(abs(m - p) < 1e-9 for p in expected) for m in self.orders])
        self._values = values
        #: Those of more readings and the rows of these, until they are asked for.
        self._source: tuple[NDArray[np.float32], NDArray[np.bool_]] | None = None
        self._products: Products | None = None
        #: What else follows from the motion alone, by name: see `once`.
        self.kept: dict[str, tuple[object, Any]] = {}

    @property
    def values(self) -> NDArray[np.float32]:
        """Cosine and sine of every order side by side, shape (n, 2 k); made at first use."""
        if self._values is None and self._source is not None:
            whole, rows = self._source
            self._values, self._source = whole[rows], None
        if self._values is None:
            self._values = _core.line_columns(self.theta, self.orders, True)
        return self._values

    @property
    def products(self) -> Products:
        """Sums of cos^2, sin^2 and cos sin of every order under any noise."""
        if self._products is None:
            self._products = Products(self.values, 2)
        return self._products

    def once(self, name: str, key: object, build: Callable[[], Any]) -> Any:
        """What ``build`` makes of the motion for ``key``; of every name the last one is kept.

        Shared by all regressions of the same readings, whatever they are held against.
        """
        kept = self.kept.get(name)
        if kept is None or kept[0] != key:
            kept = self.kept[name] = (key, build())
        return kept[1]

    def take(self, rows: NDArray[np.bool_]) -> LineBasis:
        """The basis of some of the readings."""
        part = object.__new__(LineBasis)
        part.__dict__.update(self.__dict__)
        part.theta = self.theta[rows]
        part._products = None
        part.kept = {}
        part._values = None
        part._source = None if self._values is None else (self._values, rows)
        return part


def plausible_orders(joint: Joint) -> list[float]:
    """Output orders with a standard physical cause, and the neighbours of gear orders."""
    found = {float(m) for m in range(1, LOW_ORDERS + 1)}
    found |= {joint.output_order(shaft, k) for shaft, k in joint.gear_orders()}
    if "wave_generator" in joint.shafts:
        found.add(joint.shafts["motor"] + joint.shafts["wave_generator"])
    return sorted(found)
