"""Tests of a pattern: how well one part of the readings predicts another, with a p-value."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..estimation.linear import wald_statistic
from ..support.arrays import Array
from ..support.distributions import chi_squared_tail, f_tail
from .dense import DenseFit
from .orderchoice import noise_spectrum_at
from .result import ARCSEC, HeldOutPattern
from .segments import SegmentReadings
from .steady import SteadyFit, fit_steady


def judged_patterns(
    first: Array, second: Array, chance: float, noise: float, names: tuple[str, str]
) -> HeldOutPattern:
    """Two patterns (cosine and sine in turn, radians) of two parts of the readings.

    ``chance`` is the p-value of the difference under noise alone.
    """
    gap = second - first
    return HeldOutPattern(
        fitted_on=names[0],
        judged_on=names[1],
        rms_before=math.hypot(noise, math.sqrt(0.5 * float(second @ second))) * ARCSEC,
        rms_after=math.hypot(noise, math.sqrt(0.5 * float(gap @ gap))) * ARCSEC,
        p=chance,
    )


def chance_of_parts(fit: DenseFit) -> float:
    """Of so great a difference between the patterns of two parts (`patterns_apart`)."""
    m = fit.patterns.size // 2
    told = fit.projected.told[:m] & fit.projected.told[m:]
    turn = np.concatenate([-np.eye(m)[told], np.eye(m)[told]], axis=1)
    return chance_of_difference(
        turn @ fit.patterns, turn @ fit.covariance @ turn.T, fit.projected.freedom
    )


def chance_of_difference(gap: Array, covariance: Array, freedom: float = math.inf) -> float:
    """Probability that noise makes so great a difference of patterns.

    ::

        g' V⁻¹ g / d ~ F(d, ν)

    with the degrees of freedom of the noise's variance, by which alone V is uncertain; chi-squared
    where they are infinite.
    """
    size = wald_statistic(gap, covariance)
    count = float(max(gap.size, 1))
    if math.isinf(freedom):
        return chi_squared_tail(size, count)
    return f_tail(size / count, count, freedom)


def held_out_patterns(fit: SteadyFit, tested: Sequence[float]) -> dict[str, HeldOutPattern]:
    """Odd turns against even ones, fast against slow, one direction against the other.

    Both parts share the motion; each has a separate pattern. Slow against fast is made
    without ripple columns: it is the only test that shows ripple.
    """
    readings = fit.readings
    found = {}
    turn = _turn_numbers(readings)
    turns = sum(s.turns for s in readings.stretches)
    # Turns in all from which odd ones are compared with even ones.
    if turns >= 4.0:
        found["odd_even_turns"] = _compare(fit, turn & 1, tested, ("odd turns", "even turns"))
    low, high = np.quantile(readings.speed, [0.05, 0.95])
    # Speeds that differ by less than this ratio test nothing.
    if high / low >= 1.3:
        middle = math.sqrt(low * high)
        slow = (readings.speed < middle).astype(np.int64)
        if 0.1 < slow.mean() < 0.9:
            found["speeds"] = _compare(
                fit, slow, tested, ("the faster part", "the slower part"), ripple=False
            )
    directions = np.array([s.direction for s in readings.stretches])
    if (directions > 0).any() and (directions < 0).any():
        back = (directions[readings.stretch] < 0).astype(np.int64)
        found["directions"] = _compare(fit, back, tested, ("forward", "backward"))
    return found


def _turn_numbers(readings: SegmentReadings) -> NDArray[np.int64]:
    """Turns counted from the start of each segment, and on from segment to segment.

    A part of a turn at the end of a segment counts with the turn before.
    """
    found, before = [], 0
    for stretch in readings.stretches:
        whole = max(1, round(stretch.turns))
        number = np.abs(stretch.angle - stretch.angle[0]) / (2.0 * math.pi)
        found.append(before + np.minimum(number.astype(np.int64), whole - 1))
        before += whole
    return np.concatenate(found)


def _compare(
    fit: SteadyFit,
    groups: NDArray[np.int64],
    tested: Sequence[float],
    names: tuple[str, str],
    *,
    ripple: bool = True,
) -> HeldOutPattern:
    parts = fit_steady(
        fit.readings,
        fit.orders,
        fit.ripple_orders if ripple else (),
        start=fit,
        groups=groups,
        thorough=False,
        like=fit.motion,
    )
    m = 2 * len(fit.orders)
    rows = np.array(
        [2 * i + j for i, k in enumerate(fit.orders) if k in tested for j in (0, 1)], dtype=np.int64
    )
    scale = np.ones(len(parts.unknowns))
    # Each part by the noise at its own speeds.
    scale[: 2 * m] = np.sqrt(np.repeat(noise_spectrum_at(fit, fit.orders, groups).ravel(), 2))
    covariance = parts.projected.covariance * np.outer(scale, scale)
    difference = (
        covariance[np.ix_(rows, rows)]
        + covariance[np.ix_(rows + m, rows + m)]
        - covariance[np.ix_(rows, rows + m)]
        - covariance[np.ix_(rows + m, rows)]
    )
    noise = math.sqrt(parts.projected.variance)
    return judged_patterns(
        parts.unknowns[rows],
        parts.unknowns[rows + m],
        chance_of_difference(parts.unknowns[rows + m] - parts.unknowns[rows], difference),
        noise,
        names,
    )
