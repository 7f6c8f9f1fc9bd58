"""How far a table is from its model: every input evaluated in the target's arithmetic."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..angles import ARCSEC_PER_TURN

__all__ = ["EVERY_INPUT_BITS", "Proof", "lost_orders", "prove"]

#: Readings of so many bits are all evaluated; finer ones on the grid of these, with a bound.
EVERY_INPUT_BITS = 24

#: Readings evaluated at once: they fit the caches together with what is made of them.
_BATCH = 1 << 16

_THREADS = min(8, os.cpu_count() or 1)

Array = NDArray[np.float64]
Angles = NDArray[np.uint32]
#: Correction in turns at readings in 2^-32 turns.
Correction = Callable[[Angles], Array]


@dataclass(frozen=True)
class Proof:
    """What was found over the inputs.

    Attributes
    ----------
    max_arcsec : float
        No input differs by more.
    rms_arcsec : float
        Over the inputs evaluated.
    inputs : int
        So many were evaluated.
    every_input : bool
        They are all there are; else ``margin_arcsec`` bounds what lies between them and
        is part of ``max_arcsec``.
    worst : int
        The input, in 2^-32 turns, that differs most.
    """

    max_arcsec: float
    rms_arcsec: float
    inputs: int
    every_input: bool
    margin_arcsec: float
    worst: int

    @property
    def how(self) -> str:
        """In a few words."""
        if self.every_input:
            return f"every one of {self.inputs} inputs evaluated"
        return (
            f"{self.inputs} inputs evaluated, and {self.margin_arcsec:.2g} arcsec for what lies "
            "between them, by the slopes"
        )


def prove(
    corrections: Iterable[Correction],
    exact: Callable[[Array], Array],
    bits: int,
    slope: float,
    resolution: float = 0.0,
) -> Proof:
    """Largest and rms difference of corrections from the exact one.

    Parameters
    ----------
    corrections : iterable of callable
        The target's own arithmetic; of several variants (with and without contracted
        multiplications) the worst counts.
    exact : callable
        Correction in turns at readings in turns.
    bits : int
        Of a reading.
    slope : float
        Bound of the slopes of table and model together, for readings of more bits.
    resolution : float
        Turns by which the target rounds its result, for the same.
    """
    variants = tuple(corrections)
    width = min(bits, EVERY_INPUT_BITS)
    inputs = 1 << width

    def batch(start: int) -> tuple[float, int, list[float]]:
        worst, at, squares = 0.0, 0, []
        counts = np.arange(start, min(start + _BATCH, inputs), dtype=np.uint32)
        angles = counts << np.uint32(32 - width)
        truth = exact(counts / inputs)
        for correction in variants:
            difference = correction(angles) - truth
            difference -= np.rint(difference)
            squares.append(float(difference @ difference))
            k = int(np.argmax(np.abs(difference)))
            if abs(difference[k]) > worst:
                worst, at = abs(float(difference[k])), int(angles[k])
        return worst, at, squares

    # numpy and the core work without the interpreter's lock.
    with ThreadPoolExecutor(_THREADS) as pool:
        found = list(pool.map(batch, range(0, inputs, _BATCH)))
    worst, at, _ = max(found, key=lambda part: part[0])
    squares = np.sum([part[2] for part in found], axis=0)
    every = bits <= EVERY_INPUT_BITS
    margin = 0.0 if every else 0.5 / inputs * slope + resolution
    return Proof(
        max_arcsec=(worst + margin) * ARCSEC_PER_TURN,
        rms_arcsec=math.sqrt(float(squares.max()) / inputs) * ARCSEC_PER_TURN,
        inputs=inputs,
        every_input=every,
        margin_arcsec=margin * ARCSEC_PER_TURN,
        worst=at,
    )


def lost_orders(
    correction: Correction, exact: Callable[[Array], Array], orders: Iterable[float]
) -> dict[int, float]:
    """Amplitude in arcsec by which each whole order of a turn differs: what a table loses."""
    wanted = sorted({round(order) for order in orders})
    if not wanted:
        return {}
    width = min(max(12, math.ceil(math.log2(32 * wanted[-1]))), EVERY_INPUT_BITS)
    counts = np.arange(1 << width, dtype=np.uint32)
    found = correction(counts << np.uint32(32 - width)) - exact(counts / (1 << width))
    found -= np.rint(found)
    spectrum = np.abs(np.fft.rfft(found)) * (2.0 * ARCSEC_PER_TURN / (1 << width))
    return {order: float(spectrum[order]) for order in wanted if order < len(spectrum)}
