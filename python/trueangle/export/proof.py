"""How far a table is from its model: every input in the target's arithmetic, enough bits of it."""

from __future__ import annotations

import math
import os
from collections.abc import Callable, Iterable
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ..errors import ArgumentError
from ..support.angles import ARCSEC_PER_TURN
from ..support.arrays import Array

#: Bits of a reading up to which every reading is evaluated; finer ones on this grid, with a bound.
EVERY_INPUT_BITS = 24

#: Readings evaluated at once: they fit the caches together with what is made of them.
_BATCH = 1 << 16


_THREADS = min(8, os.cpu_count() or 1)

Places = NDArray[np.int64]
#: Correction in turns at readings in 2^-32 turns, of one turn or of several.
Correction = Callable[[Places], Array]


@dataclass(frozen=True)
class Proof:
    """What was found over the inputs, all in terms of the corrected angle at the joint.

    Attributes
    ----------
    max_arcsec : float
        No input differs by more.
    rms_arcsec : float
        Over the inputs evaluated.
    inputs : int
        Number of inputs evaluated.
    every_input : bool
        They are all there are; else ``margin_arcsec`` bounds what lies between them and
        is part of ``max_arcsec``.
    worst : int
        The input, in 2^-32 turns, that differs most.
    turns : int
        Of the output, over which the inputs are.
    """

    max_arcsec: float
    rms_arcsec: float
    inputs: int
    every_input: bool
    margin_arcsec: float
    worst: int
    turns: int = 1

    @property
    def how(self) -> str:
        """In a few words."""
        inputs = f"{self.inputs} inputs" + (f" over {self.turns} turns" if self.turns > 1 else "")
        if self.every_input:
            return f"every one of {inputs} evaluated"
        return (
            f"{inputs} evaluated, and {self.margin_arcsec:.2g} arcsec for what lies "
            "between them, by the steps from one to the next"
        )


def rounded_up(value: float, digits: int = 6) -> float:
    """``value`` rounded up to ``digits`` digits, so that a printed bound remains a bound.

    Examples
    --------
    >>> rounded_up(0.123456001), rounded_up(2.5, 2)
    (0.123457, 2.5)
    """
    shown = float(f"{value:.{digits - 1}e}")
    if shown < value:
        last = 10.0 ** (math.floor(math.log10(abs(value))) - digits + 1)
        shown = float(f"{value + last:.{digits - 1}e}")
    return shown


def enough_bits(asked: int, entries: float) -> int:
    """Bits of inputs that are close enough for what lies between them to be bounded.

    Then the steps next to the ends of a line between two of ``entries`` are evaluated.
    """
    if not 1 <= asked <= 32:
        raise ArgumentError(f"bits must be from 1 to 32, got {asked}")
    # Inputs that are evaluated on a line between two entries, at least.
    return max(asked, math.ceil(math.log2(16 * entries)))


def prove_export(
    corrections: Iterable[Correction],
    exact: Callable[[Array], Array],
    bits: int,
    resolution: float = 0.0,
    turns: int = 1,
    continuous: bool = False,
) -> Proof:
    """Largest and rms difference of corrections from the exact one.

    Between inputs that are not all there are, a difference exceeds the larger of its two
    neighbours by at most half of the step from one to the next.

    Parameters
    ----------
    corrections : iterable of callable
        The target's own arithmetic; of several variants (with and without contracted
        multiplications) the worst counts.
    exact : callable
        Correction in turns at readings in turns.
    bits : int
        Of a reading.
    resolution : float
        Rounding of the target's result, turns, for readings of more bits.
    turns : int
        Over which a joint is looked at whose shafts do not come back after one.
    continuous : bool
        An input is a real number: no grid holds them all.
    """
    variants = tuple(corrections)
    most = (1 << EVERY_INPUT_BITS) // turns
    width = min(bits, most.bit_length() - 1)
    inputs = turns << width
    every = bits == width and not continuous

    def batch(start: int) -> tuple[float, int, list[float], float]:
        worst, at, squares, step = 0.0, 0, [], 0.0
        stop = min(start + _BATCH, inputs)
        # One more, for the step to it.
        counts = np.arange(start, stop + (not every), dtype=np.int64)
        places = counts << (32 - width)
        truth = exact(counts / (1 << width))
        for correction in variants:
            difference = correction(places) - truth
            difference -= np.rint(difference)
            if not every:
                step = max(step, float(np.max(np.abs(np.diff(difference)))))
                difference = difference[:-1]
            squares.append(float(difference @ difference))
            k = int(np.argmax(np.abs(difference)))
            if abs(difference[k]) > worst:
                worst, at = abs(float(difference[k])), int(places[k])
        return worst, at, squares, step

    # numpy and the core work without the interpreter's lock.
    with ThreadPoolExecutor(_THREADS) as pool:
        found = list(pool.map(batch, range(0, inputs, _BATCH)))
    worst, at, _, _ = max(found, key=lambda part: part[0])
    squares = np.sum([part[2] for part in found], axis=0)
    margin = 0.0 if every else max(part[3] for part in found) / 2.0 + resolution
    # Turns within which the model's own correction is found.
    return Proof(
        max_arcsec=(worst + margin + 1e-12) * ARCSEC_PER_TURN,
        rms_arcsec=math.sqrt(float(squares.max()) / inputs) * ARCSEC_PER_TURN,
        inputs=inputs,
        every_input=every,
        margin_arcsec=margin * ARCSEC_PER_TURN,
        worst=at,
        turns=turns,
    )


def lost_orders(
    correction: Correction, exact: Callable[[Array], Array], orders: Iterable[float]
) -> dict[int, float]:
    """Amplitude of each whole order of a turn in the difference, arcsec: what a table loses."""
    wanted = sorted({round(order) for order in orders})
    if not wanted:
        return {}
    width = min(max(12, math.ceil(math.log2(32 * wanted[-1]))), EVERY_INPUT_BITS)
    counts = np.arange(1 << width, dtype=np.int64)
    found = correction(counts << (32 - width)) - exact(counts / (1 << width))
    found -= np.rint(found)
    spectrum = np.abs(np.fft.rfft(found)) * (2.0 * ARCSEC_PER_TURN / (1 << width))
    return {order: float(spectrum[order]) for order in wanted if order < len(spectrum)}
