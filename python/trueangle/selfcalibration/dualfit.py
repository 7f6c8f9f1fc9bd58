"""Both encoders of a geared joint by least squares: lines jointly with zero, direction and speed.

Over an arc the output's low orders, its zero and the slope of one reading over the other are
nearly collinear. So a ratio is always estimated jointly with orders 1 and 2, significant or not.
Of the output's orders only as many are fitted as the readings need, the lowest first.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..estimation.linear import linear_residual, wald_statistic
from ..support.distributions import chi_squared_quantile
from .dense import DenseFit, fit_dense, low_frequency_inflation
from .densetriangle import DenseRows
from .gearlines import (
    GearedChannels,
    SharedLine,
    gear_motion,
    lines_of_gear,
    motion_varies,
    near_reversal,
)
from .projected import Unknown, harmonic_unknowns

#: Probability of selecting any line that is not there.
_CHANCE: Final = 0.01

#: Orders of the output that are estimated jointly with a ratio: eccentricity and ellipse.
BESIDE_RATIO: Final = (1, 2)


#: The column of the ratio among the patterns.
_RATIO: Final = Unknown("the gear ratio", 0.0, "")

_CHUNK: Final = 8192


class DualSample(NamedTuple):
    """Readings that take part: those of every other of ``blocks`` blocks of a run; all where 1."""

    blocks: int = 1
    first: int = 0

    def of(self, size: int) -> NDArray[np.bool_]:
        """Which of ``size`` readings."""
        block = np.arange(size) * self.blocks // size
        return np.asarray(block % 2 == self.first) if self.blocks > 1 else np.ones(size, bool)


class DualFit(NamedTuple):
    """Lines fitted to both channels."""

    dense: DenseFit
    lines: tuple[SharedLine, ...]
    zeros: tuple[float, ...]
    """Of each run, radians: the place is the motor's angle over the ratio and this."""


class RatioEstimate(NamedTuple):
    """Motor turns per output turn, and its standard error; infinite where not identifiable."""

    value: float
    std: float


def fit_dual_lines(
    channels: GearedChannels,
    ratio: float,
    lines: Sequence[SharedLine],
    *,
    slope: bool = False,
    settled: bool = True,
) -> DualFit:
    """Least squares for the lines, and with ``slope`` for the ratio as the last pattern.

    The patterns are functions of the corrected place, so that its zero is that of the fit.
    """
    columns = [c for line in lines for c in harmonic_unknowns(line.of, [line.order])]
    columns += [_RATIO] * slope
    zeros = [float(np.median(o - m / ratio)) for m, o in zip(*channels[:2], strict=True)]
    for _ in range(2 if settled and any(line.output for line in lines) else 1):
        at = tuple(zeros)
        dense = fit_dense(list(dual_rows(channels, ratio, lines, at, slope=slope)), columns)
        zeros = [z + float(dz) for z, dz in zip(at, dense.nuisances[-len(at) :], strict=True)]
    return DualFit(dense, tuple(lines), at)


def dual_rows(
    channels: GearedChannels,
    ratio: float,
    lines: Sequence[SharedLine],
    zeros: Sequence[float],
    sample: DualSample | None = None,
    *,
    slope: bool = False,
) -> Iterator[DenseRows]:
    """Nuisances: direction, velocity where time is known, a zero per run (the last ones)."""
    reversing, timed = map(int, motion_varies(channels, ratio))
    for j, (m, o, t) in enumerate(zip(*channels, strict=True)):
        theta = m / ratio
        way, speed = gear_motion(theta, t)
        place = theta + zeros[j]
        nuisances = np.zeros((o.size, reversing + timed + len(zeros)))
        if reversing:
            nuisances[:, 0] = way
        if timed:
            nuisances[:, reversing] = speed
        nuisances[:, reversing + timed + j] = 1.0
        rows = np.empty((o.size, 2 * len(lines) + slope))
        for i, line in enumerate(lines):
            angle = line.order * place if line.output else line.motor * np.sign(ratio) * m
            rows[:, 2 * i], rows[:, 2 * i + 1] = np.cos(angle), np.sin(angle)
        if slope:
            rows[:, -1] = theta - float(np.mean(theta))
        target = o - place
        for part in _used(way, (sample or DualSample()).of(o.size), bool(reversing)):
            yield DenseRows(rows[part], nuisances[part], target[part])


def _used(
    way: NDArray[np.float64], sampled: NDArray[np.bool_], reversing: bool
) -> Iterator[NDArray[np.int64]]:
    """Readings of a run that take part, some thousand after the other."""
    known = ~near_reversal(way)
    if reversing and np.mean(known) > 0.5:  # else it is noise that turns
        sampled = sampled & known
    used = np.flatnonzero(sampled)
    return (used[a : a + _CHUNK] for a in range(0, used.size, _CHUNK))


def dual_groups(
    channels: GearedChannels, ratio: float, sample: DualSample
) -> Iterator[NDArray[np.bool_]]:
    """Which rows of `dual_rows` a sample holds."""
    reversing = bool(motion_varies(channels, ratio)[0])
    for m, o, t in zip(*channels, strict=True):
        way, _ = gear_motion(m / ratio, t)
        sampled = sample.of(o.size)
        for part in _used(way, np.ones(o.size, bool), reversing):
            yield sampled[part]


def choose_dual_lines(
    channels: GearedChannels,
    ratio: float,
    lines: Sequence[SharedLine],
    *,
    slope: bool = False,
    held: Sequence[int] = (),
) -> tuple[list[SharedLine], list[SharedLine]]:
    """Lines that are significant, and those that the travel is too short to determine.

    ``held`` are orders of the output that are always kept.

    The output's own orders are kept up to the lowest beyond which no higher one is significant;
    of these, and of the motor's, insignificant ones are omitted. Jointly with a ratio (``slope``)
    and ``held`` none is omitted, and one more is kept: over an arc an order that is not
    significant may still change the ratio.
    """
    fit = fit_dual_lines(channels, ratio, lines, slope=slope, settled=False).dense
    scale = fit.projected.variance * low_frequency_inflation(fit)
    own = [i for i, line in enumerate(lines) if not line.motor]
    fixed = [i for i in own if lines[i].output in held]
    motor = [i for i, line in enumerate(lines) if line.motor]
    triangle = fit.triangle
    beside = triangle.shape[1] - 1 - 2 * len(lines) - slope

    def squares(kept: Sequence[int]) -> float:
        columns = [*range(beside), *(beside + 2 * i + j for i in (*motor, *kept) for j in (0, 1))]
        columns += [triangle.shape[1] - 2] * slope
        left = linear_residual(triangle[:, columns], triangle[:, -1])
        return float(left @ left)

    everything = squares(own)
    kept: list[int] = own
    for count in range(len(fixed), len(own)):
        limit = chi_squared_quantile(1.0 - _CHANCE, 2.0 * (len(own) - count))
        if squares(own[:count]) - everything < limit * scale:
            kept = own[: count + (slope and bool(held))]
            break
    limit = chi_squared_quantile(1.0 - _CHANCE / max(len(lines), 1), 2.0)
    while not (slope and held) and (droppable := [i for i in kept if i not in fixed]):
        loss = [squares([i for i in kept if i != j]) for j in droppable]
        if min(loss) - squares(kept) >= limit * scale:
            break
        kept = [i for i in kept if i != droppable[int(np.argmin(loss))]]
    retained = fit.projected.retained()
    # An order that retains less than this share, jointly with the others, is not determined.
    lost = [i for i in own if i not in kept and float(retained[2 * i : 2 * i + 2].min()) < 0.02]
    candidates = [lines[i] for i in sorted((*motor, *kept))]
    fit = fit_dual_lines(channels, ratio, candidates, slope=slope, settled=False).dense
    told = [
        line
        for i, line in enumerate(candidates)
        if not line.motor or _statistic(fit, slice(2 * i, 2 * i + 2)) > limit
    ]
    return told, [lines[i] for i in lost]


def _statistic(fit: DenseFit, pair: slice) -> float:
    return wald_statistic(fit.patterns[pair], fit.covariance[pair, pair])


def estimate_dual_ratio(
    channels: GearedChannels,
    start: float,
    orders: str | Sequence[float],
    turns: float,
    beside: Sequence[int] = BESIDE_RATIO,
) -> RatioEstimate:
    """The ratio jointly with orders 1 and 2 of the output, and with what else there may be.

    With ``orders="auto"`` one order more than the readings need is fitted: over an arc the lowest
    orders and the slope are nearly collinear, and an undetected order would bias the ratio.

    Examples
    --------
    >>> theta = np.linspace(0.0, 5.0, 1500)
    >>> noise = 1e-5 * np.random.default_rng(1).normal(size=theta.size)
    >>> channels = GearedChannels([101.0 * theta], [theta + 2e-3 * np.sin(theta) + noise], [None])
    >>> found = estimate_dual_ratio(channels, 101.2, "auto", 0.8)
    >>> abs(found.value - 101.0) < 4.0 * found.std < 0.1
    True
    """
    if not isinstance(orders, str):
        orders = sorted({*orders, *beside})
    ratio = start
    # A ratio converges within these fits.
    for _ in range(3):
        lines = lines_of_gear(orders, ratio, turns)
        if isinstance(orders, str):
            lines = choose_dual_lines(channels, ratio, lines, slope=True, held=beside)[0]
        fit = fit_dual_lines(channels, ratio, lines, slope=True).dense
        if not fit.projected.seen[-1]:
            return RatioEstimate(start, math.inf)
        slope, variance = float(fit.patterns[-1]), float(fit.covariance[-1, -1])
        fitted, ratio = ratio, ratio / (1.0 + slope)
        if abs(slope) < 0.1 * math.sqrt(variance):
            break
    if isinstance(orders, str) and beside:
        variance *= _doubt(channels, fitted, lines, fit, beside)
    return RatioEstimate(ratio, abs(ratio) * math.sqrt(max(variance, 0.0)))


def _doubt(
    channels: GearedChannels,
    ratio: float,
    lines: Sequence[SharedLine],
    fit: DenseFit,
    beside: Sequence[int],
) -> float:
    """By what the variance of a ratio grows where the highest order of the output moves it.

    More than twice as far as the noise allows: then higher ones would move it on.
    """
    highest = max((line.output for line in lines if not line.motor), default=0)
    if highest in (0, *beside):
        return 1.0
    fewer = [line for line in lines if line.motor or line.output != highest]
    (after, wide), (before, narrow) = (
        (float(each.patterns[-1]), float(each.covariance[-1, -1]))
        for each in (fit, fit_dual_lines(channels, ratio, fewer, slope=True).dense)
    )
    allowed = 4.0 * max(wide - narrow, 0.0)
    return max((after - before) ** 2 / allowed, 1.0) if allowed > 0.0 else 1.0
