"""A group of columns: functions of one factor, with or without lines of the place."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from functools import cached_property
from typing import Final

import numpy as np

from ...joint.pattern import line_columns
from ...support.arrays import Array

#: The factors, in the order in which equally strong ones are stated.
FACTORS: Final = (
    "place",
    "direction",
    "direction_place",
    "reversal_time",
    "speed",
    "speed_place",
    "load",
    "load_sign",
    "load_place",
    "temperature",
    "temperature_place",
    "current",
    "mount_place",
    "run",
    "run_place",
    "run_time",
    "frequency",
)

#: Orders of the output, each a group.
LOW: Final = 12

#: Least ratio of the power of a line to the mean: of noise alone about one of 500 exceeds it.
STANDS_OUT: Final = 8.0

#: Values of a factor at which its function is stated.
GRID: Final = 25


@dataclass(frozen=True, eq=False)
class Group:
    """Columns that are in or out together.

    Attributes
    ----------
    factor : str
        One of `FACTORS`.
    columns : ndarray, shape (n, w)
        At the readings; the mean square of a row is 1.
    orders : tuple of float
        Lines of the place, in cycles of an output turn; none of a function of the factor alone.
        In a product 0 is the function without a line.
    at : ndarray, shape (g,)
        Values of the factor.
    function : callable
        The columns at values of the factor, shape (g, w); of a product with a line its functions of
        the factor, shape (g, w / 2), each of which has a cosine and a sine among the columns. None
        of a group that is none.
    unit : str
    alternatives : float
        Number of groups compared; this was the strongest.
    event : tuple of int or None
        Run and row of what happened once, which no other run will show.
    jump : float or None
        Where a ramp over a turn falls back, degrees.
    """

    factor: str
    columns: Array
    orders: tuple[float, ...]
    at: Array
    function: Callable[[Array], Array] | None
    unit: str
    alternatives: float = 1.0
    event: tuple[int, int] | None = None
    jump: float | None = None

    @cached_property
    def values(self) -> Array:
        """The functions at `at`."""
        return self.functions_at(self.at)

    def values_about_mean(self, x: Array | None = None) -> Array:
        """The functions at `at`, or at other values, less their means over the readings."""
        found = self.functions_at(self.at if x is None else x)
        return np.asarray(found - self.columns.mean(axis=0))

    def functions_at(self, x: Array) -> Array:
        """The functions at values of the factor; zeros where there is none."""
        if self.function is None:
            return np.zeros((x.size, self.columns.shape[1]))
        found: Array = self.function(x)
        return found

    def lines(self) -> Iterator[tuple[float, Array, slice]]:
        """Of a product each line: its order, the functions at `at` of it, and its columns."""
        width = self.columns.shape[1] // len(self.orders)
        for k, order in enumerate(self.orders):
            yield order, self.values / max(order, 1.0), slice(k * width, (k + 1) * width)

    @property
    def is_product(self) -> bool:
        """Functions of the factor times a line."""
        return bool(self.values.shape[1] < self.columns.shape[1])

    @classmethod
    def of_function(
        cls,
        factor: str,
        x: Array,
        basis: Callable[[Array], Array],
        at: Array,
        unit: str,
        orders: tuple[float, ...] = (),
    ) -> Group | None:
        """Functions of a factor's values at the readings; None where they do not change."""
        columns = basis(x)
        scale = _scale(columns)
        if not scale > 0.0:
            return None
        return cls(factor, columns / scale, orders, at, lambda x: basis(x) / scale, unit)

    @classmethod
    def of_product(
        cls,
        factor: str,
        x: Array,
        basis: Callable[[Array], Array],
        at: Array,
        unit: str,
        theta: Array,
        orders: tuple[float, ...],
    ) -> Group:
        """Functions of a factor's values times lines of the angle ``theta``, radians.

        Of several lines those of higher order are expected to be smaller: ``1/m``.
        """
        functions = basis(x)
        products = [functions[:, :, None] * _line(theta, m)[:, None, :] for m in orders]
        columns = np.hstack([product.reshape(len(theta), -1) for product in products])
        scale = _scale(columns)
        return cls(factor, columns / scale, orders, at, lambda x: basis(x) / scale, unit)


def _line(theta: Array, order: float) -> Array:
    return line_columns(theta, order) / max(order, 1.0)


def _scale(columns: Array) -> float:
    """Root mean square of a row, less its mean; 1 of columns that do not change."""
    return float(np.sqrt(np.sum(np.var(columns, axis=0)))) or 1.0
