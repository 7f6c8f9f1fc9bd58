"""Tables as the generic C and Rust code evaluate them: by the core's own arithmetic."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np
from numpy.typing import NDArray

import trueangle._core as _core

from ..errors import ArgumentError
from ..support.angles import ARCSEC_PER_TURN
from ..support.arrays import Array
from .knots import cubic_knots, linear_knots, rounded_knots

METHODS = ("linear", "cubic")
NUMBERS = ("q15", "q31", "f32")

#: 2^-32 turns to a turn, and to a radian as the firmware multiplies it.
TURN = 2.0**32
PER_RADIAN = np.float32(TURN / (2.0 * math.pi))

#: Knots the arithmetic of the core is promised; see src/table.
_LARGEST_LINEAR = 2.0**30 - 1.0
_LARGEST_CUBIC = 2.0**27


@dataclass(frozen=True)
class Table:
    """Knots of one shaft's correction, in the numbers the firmware holds.

    Attributes
    ----------
    shaft : str
    cycles : float
        Turns of the shaft per output turn.
    method, number : str
    bits : int
        ``2^bits`` segments to a turn of the shaft.
    shift : int
        Of "q15": a knot counts ``2^shift`` units.
    knots : ndarray
        One knot more than segments, the last one the first again; of a cubic
        ``(knots, 2)``: value, slope per segment.
    """

    shaft: str
    cycles: float
    method: str
    number: str
    bits: int
    shift: int
    knots: NDArray[Any]

    @property
    def entries(self) -> int:
        """Segments to a turn."""
        return 1 << self.bits

    @property
    def bytes(self) -> int:
        """Of flash."""
        return int(self.knots.nbytes)

    @property
    def step(self) -> float:
        """Distance of two neighbouring numbers of the format, in turns of the output."""
        if self.number == "f32":
            largest = float(np.max(np.abs(self.knots))) if self.knots.size else 0.0
            return float(np.spacing(np.float32(largest))) / (2.0 * math.pi)
        return 2.0**self.shift / TURN

    @property
    def floor_arcsec(self) -> float:
        """What rounding the knots alone leaves, rms."""
        return self.step / math.sqrt(18.0) * ARCSEC_PER_TURN

    @property
    def ratio(self) -> tuple[int, int]:
        """Turns of the shaft per turn and per 2^-32 turns of the output, modulo one, times 2^64.

        Products of these with an angle in whole numbers of 64 bits are places of the shaft.
        """
        return ratio_of_cycles(self.cycles)

    def place(self, position: NDArray[np.int64]) -> NDArray[np.uint32]:
        """2^-32 turns of the shaft, at positions of the output with their turns."""
        turns, fraction = (np.uint64(part) for part in self.ratio)
        low = position.astype(np.uint32).astype(np.uint64)
        return (
            ((position >> 32).astype(np.uint64) * turns + low * fraction) >> np.uint64(32)
        ).astype(np.uint32)

    def correction(self, angles: NDArray[np.uint32], contracted: bool = False) -> NDArray[np.int32]:
        """2^-32 turns to subtract, at angles of the shaft in that unit."""
        if contracted:
            radians = self._contracted(angles)
        else:
            flat = np.ascontiguousarray(self.knots).ravel()
            found = _core.table_correction(self.method, flat, self.bits, self.shift, angles)
            if self.number != "f32":
                return np.asarray(found, dtype=np.int32)
            radians = np.asarray(found, dtype=np.float32)
        return (radians * PER_RADIAN).astype(np.int32)

    def _contracted(self, angles: NDArray[np.uint32]) -> NDArray[np.float32]:
        """Float arithmetic where each product is added without being rounded first."""
        i = (angles >> np.uint32(32 - self.bits)).astype(np.intp)
        t = ((angles << np.uint32(self.bits)) >> np.uint32(8)).astype(np.float64) * 2.0**-24
        low, high = self.knots[i], self.knots[i + 1]
        if self.method == "linear":
            return _fused(high - low, t, low)
        step = high[:, 0] - low[:, 0]
        third = low[:, 1] + high[:, 1] - np.float32(2.0) * step
        second = step - low[:, 1] - third
        return _fused(_fused(_fused(third, t, second), t, low[:, 1]), t, low[:, 0])


def _fused(a: NDArray[np.float32], t: Array, b: NDArray[np.float32]) -> NDArray[np.float32]:
    # A product of two float32 is exact in float64; only the sum is rounded, twice at worst.
    return (a.astype(np.float64) * t + b).astype(np.float32)


def ratio_of_cycles(cycles: float) -> tuple[int, int]:
    """`Table.ratio` of a number of cycles.

    Examples
    --------
    >>> ratio_of_cycles(100.0), ratio_of_cycles(0.5)
    ((0, 429496729600), (9223372036854775808, 2147483648))
    """
    exact = Fraction(cycles)
    return round(exact % 1 * 2**64) % 2**64, round(exact * 2**32) % 2**64


def make_table(
    shaft: str,
    cycles: float,
    correction: Callable[[Array], Array],
    method: str,
    number: str,
    entries: int,
) -> Table:
    """Least-squares table of a correction given in turns of its shaft.

    Raises
    ------
    ArgumentError
        ``entries`` is no power of two, or the numbers do not fit the format.
    """
    bits = entries.bit_length() - 1
    if entries != 1 << bits or not 2 <= bits <= 16:
        raise ArgumentError(
            f"entries must be a power of two from 4 to 65536, got {entries}: "
            "the table is found by a shift of the angle"
        )
    if method == "cubic":
        knots = cubic_knots(correction, entries) / cycles
    else:
        knots = linear_knots(correction, entries) / cycles
    knots = np.concatenate([knots, knots[:1]])
    if number == "f32":
        return Table(
            shaft, cycles, method, number, bits, 0, (knots * 2.0 * math.pi).astype(np.float32)
        )
    values = knots * TURN
    largest = float(np.max(np.abs(values), initial=0.0))
    limit = _LARGEST_CUBIC if method == "cubic" else _LARGEST_LINEAR
    if largest > limit:
        raise ArgumentError(
            f"shaft {shaft} needs corrections of {largest / TURN * 360.0:.3g} deg: {number} "
            f'{method} tables hold {limit / TURN * 360.0:.3g}; use `number="f32"`'
        )
    if number == "q31":
        return Table(shaft, cycles, method, number, bits, 0, np.rint(values).astype(np.int32))
    shift = 0
    while not _fits_short(np.rint(values / 2.0**shift), method):
        shift += 1
        if shift > 15:
            raise ArgumentError(
                f"shaft {shaft}: 16 bits do not hold its corrections of up to "
                f'{largest / TURN * 360.0:.3g} deg with {entries} entries; use `number="q31"`'
            )
    if method == "linear":
        whole = rounded_knots(values[:-1] / 2.0**shift)
        if _fits_short(np.append(whole, whole[0]), method):
            rounded = np.append(whole, whole[0]).astype(np.int16)
            return Table(shaft, cycles, method, number, bits, shift, rounded)
    rounded = np.rint(values / 2.0**shift).astype(np.int16)
    return Table(shaft, cycles, method, number, bits, shift, rounded)


def _fits_short(values: Array, method: str) -> bool:
    # What the arithmetic of the core is promised; see src/table.
    if np.max(np.abs(values), initial=0.0) > 32700:
        return False
    return method == "cubic" or bool(np.max(np.abs(np.diff(values, axis=0)), initial=0.0) <= 32767)
