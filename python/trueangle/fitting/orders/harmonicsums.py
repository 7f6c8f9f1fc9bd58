"""Sums that every fit of some orders needs, taken in one pass over the readings.

For integer orders these are the spectra ``sum w e^{imx}`` and ``sum w y e^{imx}`` of
each unit of readings: the normal equations of any set of orders follow from them, so
that 450 orders cost one pass and not 450 fits.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from functools import lru_cache
from typing import Final

import numpy as np
from numpy.typing import NDArray

import trueangle._core as _core

from ...support.angles import power_sums
from ...support.arrays import Array
from .unitgroups import GROUPS, MOST_UNITS, sums_of_unit_means, units_in_groups
from .zerogroups import ZeroGroupReadings

#: Readings from which the core's piecewise moments are faster than this file's powers.
_LARGE: Final = 1024

#: Units of fewer readings whose spectra are kept, some 40 kB each.
_KEPT: Final = 64

#: Readings handled at once: the working set stays in the cache.
_CHUNK: Final = 1 << 15


class HarmonicSums:
    """Normal equations of orders, unit by unit, each unit's own zero taken out.

    Columns are ``cos`` of all orders, then ``sin`` of all orders.
    """

    def __init__(
        self,
        orders: Sequence[float],
        weight: Array,
        count: NDArray[np.int64],
        squares: Array,
        moments: Array,
        grams: list[Array] | None,
        spectra: NDArray[np.complex128] | None,
        means: Array,
    ) -> None:
        self.orders = np.asarray(orders, dtype=np.float64)
        #: Places of the orders in the spectra.
        self._places = self.orders
        #: Readings and their total weight, per unit.
        self.count, self.weight = count, weight
        #: Weighted sum of squares about the unit's mean, per unit.
        self.squares = squares
        self._rhs = moments
        self._grams = grams
        self._spectra = spectra
        self._means = means
        self._total: Array | None = None

    @property
    def units(self) -> int:
        """Number of units."""
        return int(self.count.size)

    def columns(self, index: Sequence[int] | NDArray[np.intp]) -> NDArray[np.intp]:
        """Columns of the orders at ``index``: their cosines, then their sines."""
        i = np.asarray(index, dtype=np.intp)
        return np.concatenate([i, i + self.orders.size])

    def rhs(self, unit: int, index: Sequence[int] | NDArray[np.intp]) -> Array:
        """``X' W y`` of a unit about its means, for the orders at ``index``."""
        return np.asarray(self._rhs[unit, self.columns(index)])

    def gram(
        self,
        unit: int,
        index: Sequence[int] | NDArray[np.intp],
        others: Sequence[int] | NDArray[np.intp] | None = None,
    ) -> Array:
        """``X' W X`` of a unit about its means, for the orders at ``index`` and ``others``."""
        others = index if others is None else others
        rows, columns = self.columns(index), self.columns(others)
        if self._grams is not None:
            return np.asarray(self._grams[unit][rows[:, None], columns])
        assert self._spectra is not None
        mine, theirs = (
            self._places[rows[: rows.size // 2]],
            self._places[columns[: columns.size // 2]],
        )
        gram = self.whole(self._spectra[unit], mine, theirs)
        means = self._means[unit]
        return np.asarray(gram - (self.weight[unit] * means[rows])[:, None] * means[columns])

    def blocks(self, unit: int, index: NDArray[np.intp]) -> Array:
        """``X' W X`` of each order by itself about its means, shape (orders, 2, 2)."""
        pairs = self.columns(index).reshape(2, -1)
        if self._grams is not None:
            return np.asarray(self._grams[unit][pairs.T[:, :, None], pairs.T[:, None, :]])
        assert self._spectra is not None
        spectrum, means = 0.5 * self._spectra[unit], self._means[unit][pairs]
        twice = spectrum[2 * self._places[index].astype(np.intp)]
        whole = np.array([[twice.real, twice.imag], [twice.imag, -twice.real]])
        whole += spectrum[0].real * np.eye(2)[..., None]
        return np.moveaxis(whole - self.weight[unit] * means[:, None] * means, -1, 0)

    @staticmethod
    def whole(spectrum: NDArray[np.complex128], mine: Array, theirs: Array) -> Array:
        """``X' W X`` of whole orders about no mean, by the spectrum of the positions."""
        rows, columns = mine.astype(np.intp)[:, None], theirs.astype(np.intp)
        size, highest = rows.size, spectrum.size - 1
        both = 0.5 * np.concatenate([spectrum[:0:-1].conj(), spectrum])
        plus, minus = both.take(rows + (highest + columns)), both.take(rows + (highest - columns))
        gram = np.empty((2 * size, 2 * columns.size))
        cosine, sine = plus + minus, plus - minus
        gram[:size, : columns.size], gram[size:, : columns.size] = cosine.real, cosine.imag
        gram[:size, columns.size :], gram[size:, columns.size :] = sine.imag, -sine.real
        return gram

    def named(self, orders: Sequence[float]) -> HarmonicSums:
        """The same sums under other names: orders of the output for cycles of a base shaft."""
        self.orders = np.asarray(orders, dtype=np.float64)
        return self

    def in_groups(self) -> HarmonicSums:
        """Units taken together in a few groups, each unit's own zero still taken out."""
        assert self._spectra is not None
        members = [range(group, self.units, GROUPS) for group in range(GROUPS)]
        grams = []
        for units in map(list, members):
            means = self._means[units]
            whole = self.whole(self._spectra[units].sum(axis=0), self._places, self._places)
            grams.append(whole - means.T @ (self.weight[units, None] * means))
        count, weight, squares, rhs = (
            np.array([values[list(units)].sum(axis=0) for units in members])
            for values in (self.count, self.weight, self.squares, self._rhs)
        )
        return HarmonicSums(
            self.orders.tolist(), weight, count, squares, rhs, grams, None, np.zeros_like(rhs)
        )

    def total(self) -> tuple[Array, Array, float]:
        """Sums of all units: ``X' W X``, ``X' W y`` and the sum of squares."""
        if self._total is None:
            everything = np.arange(self.orders.size)
            if self._spectra is None:
                grams = [self.gram(unit, everything) for unit in range(self.units)]
                self._total = np.sum(grams, axis=0)
            else:
                means = self._means
                whole = self.whole(self._spectra.sum(axis=0), self._places, self._places)
                self._total = whole - means.T @ (self.weight[:, None] * means)
        return self._total, self._rhs.sum(axis=0), float(self.squares.sum())


def harmonic_sums(units: Sequence[ZeroGroupReadings], orders: Sequence[float]) -> HarmonicSums:
    """One pass over the readings of every unit.

    Memory per unit is three numbers per order where all orders are whole, else a square
    matrix of twice the number of orders; the readings are never expanded to a matrix. More
    than 96 units are taken together in 32 groups, each with its zeros taken out: the sums
    then have a unit per group.
    """
    whole = all(float(k).is_integer() for k in orders)
    count = np.array([u.turns.size for u in units], dtype=np.int64)
    weight = np.array([u.weights.sum() for u in units])
    centre = [float(np.dot(u.weights, u.error)) / w for u, w in zip(units, weight, strict=True)]
    squares = np.array(
        [float(np.dot(u.weights, (u.error - c) ** 2)) for u, c in zip(units, centre, strict=True)]
    )
    if whole and len(units) > MOST_UNITS:
        return _in_groups(units, orders, weight, count, squares, centre)
    if whole:
        return _from_spectra(units, orders, weight, count, squares, centre)
    return _from_columns(units, orders, weight, count, squares, centre)


def _from_spectra(
    units: Sequence[ZeroGroupReadings],
    orders: Sequence[float],
    weight: Array,
    count: NDArray[np.int64],
    squares: Array,
    centre: list[float],
) -> HarmonicSums:
    index = np.asarray(orders, dtype=np.int64)
    highest = int(index.max(initial=0))
    spectra = np.empty((len(units), 2 * highest + 1), dtype=np.complex128)
    moments = np.empty((len(units), 2 * index.size))
    for i, unit in enumerate(units):
        spectra[i], values = _spectra(unit, centre[i], highest)
        moments[i] = np.concatenate([values[index].real, values[index].imag])
    picked = spectra[:, index] / weight[:, None]
    means = np.concatenate([picked.real, picked.imag], axis=1)
    return HarmonicSums(orders, weight, count, squares, moments, None, spectra, means)


def _in_groups(
    units: Sequence[ZeroGroupReadings],
    orders: Sequence[float],
    weight: Array,
    count: NDArray[np.int64],
    squares: Array,
    centre: list[float],
) -> HarmonicSums:
    """As `_from_spectra`, many units taken together: one normal matrix a group."""
    index, places = np.asarray(orders, dtype=np.int64), np.asarray(orders, dtype=np.float64)
    highest, size = int(index.max(initial=0)), index.size
    grams, moments, groups = [], [], units_in_groups(units)
    for members in groups:
        group = [units[i] for i in members]
        together = ZeroGroupReadings(
            np.concatenate([unit.turns for unit in group]),
            np.concatenate([units[i].error - centre[i] for i in members]),
            np.concatenate([unit.weights for unit in group]),
            "",
        )
        spectrum, values = _spectra(together, 0.0, highest)
        moments.append(np.concatenate([values[index].real, values[index].imag]))
        whole = HarmonicSums.whole(spectrum, places, places)
        grams.append(whole - sums_of_unit_means(group, places))
    sums = [np.array([v[m].sum() for m in groups]) for v in (weight, count, squares)]
    means = np.zeros((len(groups), 2 * size))
    return HarmonicSums(orders, sums[0], sums[1], sums[2], np.array(moments), grams, None, means)


def _spectra(
    unit: ZeroGroupReadings, centre: float, highest: int
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """``sum w e^{imx}`` for m to twice the highest order, ``sum w (y - c) e^{imx}`` to it."""
    if unit.turns.size >= _LARGE and highest > 0:
        error = unit.error - centre
        # The core wraps errors at half a turn: keep these far inside.
        scale = 4.0 * float(np.abs(error).max()) or 1.0
        sums = _core.Moments(1.0, [1.0], [[highest]])
        sums.update(unit.turns, error / scale, unit.weights)
        weights, values, _, _, about = sums.spectrum()
        return weights, scale * (values + about * weights[: values.size])
    error = unit.error - centre
    return _few(unit.turns.tobytes(), unit.weights.tobytes(), error.tobytes(), highest)


@lru_cache(maxsize=_KEPT)
def _few(
    turns: bytes, weights: bytes, error: bytes, highest: int
) -> tuple[NDArray[np.complex128], NDArray[np.complex128]]:
    """`_spectra` of few readings: fits that leave each run out in turn need the same again."""
    weight = np.frombuffer(weights)
    both = np.stack([weight, weight * np.frombuffer(error)], axis=1)
    found = power_sums(np.frombuffer(turns), both, 2 * highest + 1)
    found.flags.writeable = False
    return found[:, 0], found[: highest + 1, 1]


def _from_columns(
    units: Sequence[ZeroGroupReadings],
    orders: Sequence[float],
    weight: Array,
    count: NDArray[np.int64],
    squares: Array,
    centre: list[float],
) -> HarmonicSums:
    angular = 2.0 * math.pi * np.asarray(orders, dtype=np.float64)
    grams, means = [], np.empty((len(units), 2 * angular.size))
    moments = np.empty((len(units), 2 * angular.size))
    for i, unit in enumerate(units):
        gram = np.zeros((2 * angular.size, 2 * angular.size))
        first = np.zeros(2 * angular.size)
        moment = np.zeros(2 * angular.size)
        for start in range(0, unit.turns.size, _CHUNK):
            part = slice(start, start + _CHUNK)
            x = unit.turns[part, None] * angular
            design = np.concatenate([np.cos(x), np.sin(x)], axis=1)
            weighted = design * unit.weights[part, None]
            gram += weighted.T @ design
            first += weighted.sum(axis=0)
            moment += weighted.T @ (unit.error[part] - centre[i])
        means[i] = first / weight[i]
        grams.append(gram - weight[i] * np.outer(means[i], means[i]))
        moments[i] = moment
    return HarmonicSums(orders, weight, count, squares, moments, grams, None, means)
