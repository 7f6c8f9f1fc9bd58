"""A group of columns: functions of one factor, with or without lines of the place."""

from __future__ import annotations

from collections.abc import Callable, Container, Sequence
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import product
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ...joint.pattern import line_columns
from ...support.arrays import Array

#: Factors that act together: play under load, a delay in the cold, creep under load, a scale that
#: expands.
PAIRS: Final = (
    *product(("direction", "speed", "travel"), ("load", "temperature")),
    ("load", "temperature"),
)
TOGETHER: Final = tuple(map("_".join, PAIRS))

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
    "current_place",
    "mount_place",
    "run",
    "run_place",
    "run_time",
    "frequency",
    *TOGETHER,
)

#: Columns of a narrow group.
FEW: Final = 4

#: Orders of the output, each a group.
LOW: Final = 12

#: Least ratio of the power of a line to the mean: of noise alone about one of 500 exceeds it.
STANDS_OUT: Final = 8.0

#: Values of a factor at which its function is stated.
GRID: Final = 25


#: Functions of a factor's values, as columns.
Basis = Callable[[Array], Array]


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
    factors : int
        Number of factors whose functions it holds.
    """

    factor: str
    columns: Array
    orders: tuple[float, ...]
    at: Array
    function: Basis | None
    unit: str
    alternatives: float = 1.0
    event: tuple[str, int] | None = None
    jump: float | None = None
    factors: int = 1

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

    def as_constant_of(self, product: Group) -> Group:
        """A line of the place as what a product with it is on average."""
        level = float(self.functions_at(np.zeros(1))[0, 0]) * max(*self.orders, 1.0)
        return replace(
            self,
            factor=product.factor,
            at=product.at,
            unit=product.unit,
            function=lambda x: np.full((x.size, 1), level),
        )

    @property
    def is_product(self) -> bool:
        """Functions of the factor times a line."""
        return bool(self.values.shape[1] < self.columns.shape[1])

    def is_of_line(self, orders: Container[float]) -> bool:
        """Products of a factor with one of these lines."""
        of_place = self.factor.endswith("_place") and self.factor != "mount_place"
        return of_place and any(m in orders for m in self.orders)

    @classmethod
    def of_function(
        cls,
        factor: str,
        x: Array,
        basis: Basis,
        at: Array,
        unit: str,
        orders: tuple[float, ...] = (),
    ) -> Group:
        """Functions of a factor's values at the readings."""
        columns = basis(x)
        scale = _scale(columns)
        return cls(factor, columns / scale, orders, at, lambda x: basis(x) / scale, unit)

    @classmethod
    def of_product(
        cls,
        factor: str,
        x: Array,
        basis: Basis,
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


def lines_of(groups: Sequence[Group]) -> dict[float, tuple[Array, NDArray[np.int64]]]:
    """Of products of a factor each line: the functions at `at`, and the columns of all groups."""
    found: dict[float, list[tuple[Array, NDArray[np.int64]]]] = {}
    first = 0
    for group in groups:
        width = group.columns.shape[1] // len(group.orders)
        for order in group.orders:
            values = group.values / max(order, 1.0)
            found.setdefault(order, []).append((values, np.arange(first, first + width)))
            first += width
    return {
        order: (np.hstack([f for f, _ in parts]), np.concatenate([c for _, c in parts]))
        for order, parts in found.items()
    }


def _line(theta: Array, order: float) -> Array:
    return line_columns(theta, order) / max(order, 1.0)


def _scale(columns: Array) -> float:
    """Root mean square of a row, less its mean; 1 of columns that do not change."""
    return float(np.sqrt(np.sum(np.var(columns, axis=0)))) or 1.0
