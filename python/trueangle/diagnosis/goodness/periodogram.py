"""Lines that are new in every run: of one frequency in time, or of one order in angle.

The periodograms of the runs, each divided by its own level about every frequency (which takes
correlation and drift away), add up to

::

    P(f) = Σ_j |z_j(f)|² / s_j²(f) ~ Γ(R, 1)

without asking for phases. Noise that neighbouring readings share comes back at every multiple
of the rate of readings, on any axis: it is taken out reading by reading first, and beyond
half of the rate of evenly taken readings the level is that of the frequency which they fold it
to. The false-alarm probability counts the independent frequencies
(Baluev 2008 bounds it in the same way). A line that is not quite steady is looked for in bands as
well.
"""

from __future__ import annotations

import itertools
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

import trueangle._core as _core

from ...support.arrays import Array, distinct
from ...support.display_units import brief_number
from ...support.distributions import f_tail
from .evidence import Evidence, largest_of
from .leftover import Leftover

#: Cells of the finest transform, of which a record takes half.
MOST_BINS = 1 << 17

#: Cells per period of the highest frequency: a reading is at most 1/8 period out of place.
CELLS = 4.0

#: Resolution cells that make the level, to each side; lowest frequency, in cells.
LEVEL_CELLS, LOWEST = 48, 5

#: Cells of information in the level of a block: a median has half that of a mean, and three
#: neighbours share it.
SHARED = 1.2

#: Independent frequencies per resolution cell, for the maximum of a line's power.
PER_CELL = 3.0

#: Blocks beyond that of a frequency which its level depends on.
SHARED_BLOCKS = 2

#: Widths of bands, in resolution cells.
WIDTHS = (1, 3, 9)

#: Departure of the steps from those of one clock up to which a record counts as evenly sampled.
EVEN = 0.02

#: Readings below which a run has no periodogram.
LEAST_READINGS = 32


@dataclass(frozen=True, eq=False)
class _Periodogram:
    """Sum over runs of periodograms divided by their levels.

    Attributes
    ----------
    frequency : ndarray
        Cycles per unit of the axis.
    power : ndarray
        Mean over runs: 1 on average for noise.
    peak : float
        The most significant frequency.
    width : int
        Its width in resolution cells.
    statistic : float
        Power there.
    amplitude : float
        Of the line, root mean square over runs, times the root of 2.
    p : float
        False-alarm probability.
    even : bool
        Equal steps: the line may be an alias.
    """

    frequency: Array
    power: Array
    peak: float
    width: int
    statistic: float
    amplitude: float
    p: float
    even: bool


def periodogram(
    values: Array,
    axis: Array,
    bounds: list[tuple[int, int]],
    top: float | None = None,
    correlation: float = 0.0,
) -> _Periodogram | None:
    """Periodogram of ``values`` along ``axis``, for any phases of the runs.

    Parameters
    ----------
    values, axis : ndarray, shape (n,)
        The axis (s, turns) may go back and forth.
    bounds : list of (int, int)
        The runs.
    top : float, optional
        Highest frequency; half of the sampling rate of even records, else what
        2^16 cells resolve, up to 60 times the mean rate.
    correlation : float
        Of the noise between readings that follow each other, which is taken out.

    Returns
    -------
    Periodogram or None
        None where the runs are too short, or do not scatter.
    """
    kept = [
        (a, b)
        for a, b in bounds
        if b - a >= LEAST_READINGS and np.ptp(axis[a:b]) > 0.0 and np.ptp(values[a:b]) > 0.0
    ]
    if not kept:
        return None
    spans = np.array([float(np.ptp(axis[a:b])) for a, b in kept])
    longest = float(spans.max())
    even, rate, folds = _sampling(axis, kept)
    highest = min(0.5 * MOST_BINS / (CELLS * longest), 0.5 * rate if even else 60.0 * rate)
    top = highest if top is None else min(top, highest)
    cell = 1.0 / (2.0 * rate) if even and top > 0.2 * rate else 1.0 / (CELLS * top)
    size = int(2 ** np.ceil(np.log2(2.0 * longest / cell + 2.0)))
    frequency = np.arange(size // 2 + 1) / (size * cell)
    over = 1.0 / (longest * float(frequency[1]))  # bins per resolution cell
    first = int(np.ceil(LOWEST * over))
    last = int(min(top / frequency[1], frequency.size - 1))
    if last - first < 4 * over:
        return None
    boxes = [int(width * over + 0.5) if width > 1 else 1 for width in WIDTHS]
    total = np.zeros((len(WIDTHS), last))
    known = np.zeros(last)
    freedom = np.zeros(len(WIDTHS))
    # The amplitude of a line near the highest frequency needs those beyond it, too.
    raw = np.zeros(min(last + boxes[-1], frequency.size))
    for (a, b), span, fold in zip(kept, spans, folds, strict=True):
        place = ((axis[a:b] - axis[a:b].min()) / cell + 0.5).astype(np.int64)
        e = values[a:b] - values[a:b].mean()
        power = _power(place, _whitened(e, correlation), size)
        whole = _power(place, e, size) if correlation else power
        raw += whole[: raw.size] * (4.0 / ((b - a) ** 2 * len(kept)))
        cuts, cells = _blocks(frequency.size, over * longest / span)
        held = [max(1.0, width * span / longest) for width in WIDTHS]
        half = int(fold / (2.0 * frequency[1])) if fold else last
        if half < last - over:
            cuts = cuts[cuts <= half]
            if cuts.size < 2 + SHARED_BLOCKS:
                continue
            place = _folded(np.arange(power.size), 2 * half)
            total += _beyond(power, cuts, place, boxes, held, first, last)
            known += cells[np.maximum(place[:last], first)]
            freedom += held
            continue
        # Levels are shared between blocks, and bands reach beyond their middle.
        needed = np.searchsorted(cuts, last + boxes[-1]) + SHARED_BLOCKS
        cuts = cuts[: needed + 1]
        power = power[: cuts[-1]].copy()
        known += cells[:last]
        freedom += held
        _core.add_relative_power(power, cuts, list(zip(boxes, held, strict=True)), total)
    if not freedom[0]:
        return None
    best: tuple[float, int, int] | None = None
    # Rounded down to a few values, each of which is one test of a maximum.
    blocks = 2.0 ** (np.floor(2.0 * np.log2(np.maximum(known[first:], 1.0))) / 2.0)
    for k, width in enumerate(WIDTHS):
        p, j = _likeliest(total[k, first:], float(freedom[k]), blocks)
        p = largest_of(p, (last - first) / over * PER_CELL / width)
        if best is None or p < best[0]:
            best = (p, k, first + j)
    assert best is not None
    p, k, j = best
    reach = int(WIDTHS[k] * over)
    near = slice(max(j - reach, first), j + reach + 1)
    amplitude = float(np.sqrt(max(float(raw[near].max()), 0.0)))
    return _Periodogram(
        frequency[first:last],
        total[0, first:] / freedom[0],
        float(frequency[j]),
        WIDTHS[k],
        float(total[k, j] / freedom[k]),
        amplitude,
        largest_of(p, float(len(WIDTHS))),
        even,
    )


def _power(place: NDArray[np.int64], values: Array, size: int) -> Array:
    """Squares of the amplitudes of values in cells."""
    spectrum = np.fft.rfft(np.bincount(place, weights=values, minlength=size)[:size])
    power = spectrum.real**2
    power += spectrum.imag**2
    return np.asarray(power)


def _whitened(e: Array, correlation: float) -> Array:
    """Readings of a run less the prediction by the one before."""
    if not correlation:
        return e
    out = e * np.sqrt(1.0 - correlation**2)
    out[1:] = e[1:] - correlation * e[:-1]
    return np.asarray(out - out.mean())


def _folded(cells: NDArray[np.int64], rate: int) -> NDArray[np.int64]:
    """Frequencies as evenly taken readings show them: between 0 and half of their rate."""
    inside = np.mod(cells, rate)
    return np.asarray(np.minimum(inside, rate - inside))


def _beyond(
    power: Array,
    cuts: NDArray[np.int64],
    place: NDArray[np.int64],
    boxes: list[int],
    held: list[float],
    first: int,
    last: int,
) -> Array:
    """Means of relative power over ``boxes``, the level that of the folded frequency.

    Where that is below the lowest frequency searched, the mean of noise is used.
    """
    told = power[: cuts[-1]].copy()
    _core.add_relative_power(told, cuts, [(1, 1.0)], np.zeros((1, 1)))
    level = power[: cuts[-1]] / np.where(told > 0.0, told, 1.0)
    level = level[np.minimum(place, cuts[-1] - 1)]
    # Without a level (readings without noise) nothing can be significant.
    relative = np.divide(power, level, out=np.ones_like(power), where=level > 1e-300 * power)
    relative[place < first] = 1.0
    total = np.concatenate([[0.0], np.cumsum(relative)])
    found = np.empty((len(boxes), last))
    k = np.arange(last)
    for row, (box, weight) in enumerate(zip(boxes, held, strict=True)):
        low = np.maximum(k - box // 2, 0)
        high = np.minimum(k + box - box // 2, relative.size)
        found[row] = (total[high] - total[low]) / (high - low) * weight
    return found


def time_test(left: Leftover, correlation: float = 0.0) -> Evidence | None:
    """A line of one frequency in time (of one over readings where no time is known).

    ``correlation`` of the noise between neighbouring readings is taken out first.
    """
    found = periodogram(left.residual, left.clock, left.bounds, correlation=correlation)
    if found is None:
        return None
    unit = "Hz" if left.timed else "cycles per reading"
    detail = " (or an alias)" if found.even else ""
    return Evidence(
        "time periodogram",
        found.statistic,
        found.p,
        f"a line of {found.peak:.5g} {unit}{detail}, about {brief_number(found.amplitude)} arcsec, "
        "with a new phase in every run",
        looks_like="a line in time",
        rms=float(found.amplitude / np.sqrt(2.0)),
        at=found.peak,
    )


def order_test(left: Leftover, top: float, correlation: float = 0.0) -> Evidence | None:
    """A line of one order in angle whose phase is new in every run; as `time_test`."""
    turns = left.theta / (2.0 * np.pi)
    found = periodogram(left.residual, turns, left.bounds, top, correlation)
    if found is None:
        return None
    return Evidence(
        "place within runs",
        found.statistic,
        found.p,
        f"a line of order {found.peak:.5g}, about {brief_number(found.amplitude)} arcsec, repeats "
        "within a run, with a new phase in every run",
        looks_like="a line whose size changes in time",
        rms=float(found.amplitude / np.sqrt(2.0)),
        at=found.peak,
    )


def _sampling(axis: Array, bounds: list[tuple[int, int]]) -> tuple[bool, float, list[float]]:
    """Whether all steps are of one clock, readings per unit, each run's rate (0: uneven)."""
    steps = [np.abs(np.diff(axis[a:b])) for a, b in bounds]
    tick = _tick(np.concatenate(steps))
    ticks = [_tick(own) for own in steps]
    rates = [1.0 / own if own else 0.0 for own in ticks]
    mean = [(b - a - 1) / float(np.ptp(axis[a:b])) for a, b in bounds]
    return tick > 0.0, 1.0 / tick if tick else float(np.max(mean)), rates


def _tick(steps: Array) -> float:
    """The step of a clock of which all steps are whole multiples, some readings left out, or 0."""
    for tick in (float(np.median(steps)), float(steps.min())):
        away = np.abs(steps - np.maximum(np.rint(steps / tick), 1.0) * tick) if tick else steps
        if float(np.mean(away < EVEN * tick)) > 0.95:
            return tick
    return 0.0


def _blocks(size: int, over: float) -> tuple[NDArray[np.int64], Array]:
    """Edges of the blocks whose medians are a spectrum's level, and its equivalent number of cells.

    Blocks are as wide as a third of their frequency at most, so that slopes stay slopes.
    """
    width = max(2.0 * LEVEL_CELLS * over, 8.0)
    edges = [1.0]
    while edges[-1] < size:
        edges.append(edges[-1] + min(width, max(edges[-1] * 0.5, 4.0 * over)))
    cuts = distinct(np.minimum(np.array(edges), size).astype(np.int64))
    # Short blocks at the low end are uncertain: neighbours share what they know.
    cells = np.repeat(SHARED * np.diff(cuts) / over, np.diff(cuts))
    return cuts, np.concatenate([cells[:1], cells])


def _likeliest(total: Array, freedom: float, cells: Array) -> tuple[float, int]:
    """Smallest p value of a bin, each against a level from its number of ``cells``; and its bin."""
    best = (1.0, 0)
    cuts = np.flatnonzero(np.diff(cells)) + 1
    edges = np.concatenate([[0], cuts, [total.size]])
    for a, b in itertools.pairwise(edges.tolist()):
        j = a + int(np.argmax(total[a:b]))
        p = f_tail(float(total[j]) / freedom, 2.0 * freedom, 2.0 * float(cells[j]))
        if p < best[0]:
            best = (p, j)
    return best
