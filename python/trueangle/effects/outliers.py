"""Isolated readings, or a few in a row, that are far off."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from math import lgamma
from typing import ClassVar, Self

import numpy as np
from numpy.typing import NDArray

import trueangle._core as _core

from ..estimation.quantity import Parameters, quantity
from ..estimation.regression import Regression
from ..estimation.segments import MOST_IN_ROW, flagged_segments, less_local_level, within_segments
from ..joint.pattern import JointPattern
from ..joint.signals import Signals
from ..support.distributions import binomial_tail
from .drawing import Drawing
from .effect import Effect, ScatterFinding
from .local_defect import LocalDefect
from .presliding_hysteresis import PreslidingHysteresis
from .search import Array

#: Degrees of freedom of heavy-tailed noise, sizes of outliers to start from.
TAILS = (2.5, 3.0, 4.0, 5.0, 6.0, 8.0, 12.0, 20.0, 40.0)
SIZES = (3.0, 10.0, 100.0)

#: Readings next to outliers are smaller by this factor; at least this share of the segments
#: of outliers must be isolated like that.
BESIDE = 0.5
ISOLATED = 0.5

#: Pairs of outliers in a row, beyond three times those expected, that distinguish a burst from a
#: manoeuvre, and the share of them that must change sides: half do so at random.
LEAST_PAIRS = 8
TURNING = 0.3

#: Readings on either side of a reversal that are near it.
NEAR_REVERSAL = 3

#: Readings after a start or a reversal within which outliers may gather, and the probability that
#: as many do, below which they are not independent of it.
AFTER = (1, 2, 4, 8)
GATHERED = 1e-3

#: Outliers smaller than this many standard deviations are not detected. If sizes are uniform
#: up to ``size``, their share is ``HIDDEN / size``; it follows from the form of the wide normal
#: and no reading shows it. It counts as the uncertainty of the fraction.
HIDDEN = 3.0

#: Standard deviations from which on an isolated deviation is not used to predict neighbours.
WILD = 6.0

#: Scale below which no normal is narrow: identical readings have none.
NARROWEST = 1e-6

#: Steps of expectation-maximisation.
EM_STEPS = 60

SCALES = np.linspace(0.85, 1.1, 11)


#: Ratio of the largest of readings with a tail ``x^(-nu)`` to the next that is passed by a
#: probability of ``8^(-nu)``: 0.2 % for nu = 3, 3e-5 for nu = 5. Such a reading is of another kind.
APART = 8.0

#: Largest share of the readings that may be of that kind.
MOST_APART = 0.01


@dataclass(frozen=True)
class Outliers(Effect):
    """Isolated outliers and bursts: a share of the readings gets an additional normal error.

    Parameters
    ----------
    fraction : float
        Share of the readings.
    size_arcsec : float
        Standard deviation of their error.
    """

    fraction: float
    size_arcsec: float

    kind: ClassVar[str] = "outliers"
    size_name: ClassVar[str] = "size_arcsec"
    sentence: ClassVar[str] = (
        "Single readings, or a few in a row, are far off (bit flips, glitches, mistaken entries) "
        "and their neighbours are not."
    )
    factor: ClassVar[str] = "none"
    measure: ClassVar[str] = "more readings, each taken twice"
    transfers: ClassVar[bool] = False
    confused_with: ClassVar[Mapping[type[Effect], str]] = {
        LocalDefect: "a second pass over the same place",
    }
    not_at_run_time: ClassVar[str] = "one reading may be motion; reject it in the data"

    def signal(self, signals: Signals, around: JointPattern, rng: np.random.Generator) -> Array:
        far_off = rng.random(len(signals)) < self.fraction
        return np.asarray(far_off * self.size_arcsec * rng.standard_normal(len(signals)))

    @classmethod
    def drawn(cls, size: float, of: Drawing) -> Self | None:
        return cls(of.between(0.01, 0.03), size)

    @classmethod
    def find_scatter(cls, regression: Regression) -> ScatterFinding | None:
        """Outliers: a narrow and a wide normal must beat one normal and heavy tails."""
        if regression.is_explained:
            return None
        e, deviation = _beside_neighbours(regression)
        n = regression.n
        normal = _normal(e, max(float(np.sqrt(np.mean(e**2))), NARROWEST))
        tails = max(_student(e, nu, s) for nu in TAILS for s in SCALES)
        value, share, size, scale = max(
            _core.two_normals(e, start, EM_STEPS, NARROWEST) for start in SIZES
        )
        value -= 0.5 * n * np.log(2.0 * np.pi)
        gain = 2.0 * (value - normal) - 2.0 * regression.log_n
        beyond = 2.0 * (value - tails) - regression.log_n
        if gain <= 0.0:
            return None
        # Evidence by which outliers must beat mere heavy tails.
        if beyond > 2.0:
            x = e / scale
            wide = share / size * np.exp(-0.5 * (x / size) ** 2)
            chance = wide / (wide + (1.0 - share) * np.exp(-0.5 * x**2))
            rows = np.flatnonzero(chance > 0.5)
        else:
            rows = _apart(e)
            share = rows.size / n
            size = float(np.sqrt(np.sum(e[rows] ** 2) / max(rows.size, 1))) / scale
        if rows.size == 0:
            return None  # the form of the noise, and no outlying reading
        kept = _glitches(_unfiltered(regression), rows, regression.bounds)
        if _is_scattered(regression, rows):
            kept = rows
        elif len(_lengths(regression, kept)) < ISOLATED * len(_lengths(regression, rows)):
            return None
        rows = kept
        bursts = int(np.count_nonzero(_lengths(regression, rows) > 1))
        if _at_reversals(regression, rows):
            return None
        # Not by the variance of all readings: outliers are in it, clipped.
        spread = size * scale * deviation
        std = float(np.sqrt(share * (1.0 - share) / n))
        parameters: Parameters = {
            "fraction": quantity(
                float(share), max(std, float(share) * float(np.clip(HIDDEN / size, 0.2, 1.0)))
            ),
            # The standard error of a standard deviation of that many readings.
            "size_arcsec": quantity(float(spread), float(spread / np.sqrt(2.0 * rows.size))),
            **({"bursts": quantity(bursts)} if bursts else {}),
            "rows": quantity(
                [
                    [
                        regression.signals.labels[int(regression.signals.run[k])],
                        int(regression.signals.row[k]),
                    ]
                    for k in rows
                ]
            ),
        }
        weights = np.ones(n)
        weights[rows] = 1e-6
        return ScatterFinding(
            cls.kind,
            float(gain),
            parameters,
            [Outliers(float(share), float(spread))],
            weights,
            size,
            doubt=_gathered(regression, rows),
        )


def _apart(e: Array) -> NDArray[np.int64]:
    """Rows of the few readings that no tail reaches: far above the largest of all others."""
    order = np.argsort(-np.abs(e))
    sizes = np.abs(e)[order][: 2 + int(MOST_APART * e.size)]
    gaps = np.flatnonzero(sizes[:-1] > APART * sizes[1:])
    return np.sort(order[: gaps[-1] + 1]) if gaps.size else order[:0]


def _beside_neighbours(regression: Regression) -> tuple[Array, float]:
    """Residuals less their prediction by both neighbours, in robust standard deviations; and that.

    ::

        e_k - (ρ / (1 + ρ²))(e_{k-1} + e_{k+1})

    is what a correlation leaves of one reading. Whitened residuals show an outlier twice,
    and what lasts over many readings as large as it is. White noise stays as it is.
    Outliers are compared with the level about them, and do not predict their neighbours.
    """
    left = _unfiltered(regression)
    away = less_local_level(left, regression.bounds)
    wild = np.abs(away) > WILD * 1.4826 * float(np.median(np.abs(away)))
    rows = _glitches(left, np.flatnonzero(wild), regression.bounds)
    known = left.copy()
    known[rows] -= away[rows]
    rho = regression.whiten.rho
    e = _interpolated(known, rho, regression.bounds)
    spread = 1.4826 * float(np.median(np.abs(e)))
    is_end = np.zeros(left.size, dtype=np.bool_)
    is_end[np.array(regression.bounds) - [0, 1]] = True
    beside = e[rows] + away[rows] / np.where(is_end[rows], np.sqrt(1.0 + rho**2), 1.0)
    e[rows] = np.where(np.abs(beside) < np.abs(away[rows]), beside, away[rows])
    return np.asarray(e / max(spread, 1e-300)), spread


def _unfiltered(regression: Regression) -> Array:
    """The residual, weighed and not whitened."""
    left = regression.left_within_runs
    return np.asarray(left * regression.root_weights)


def _interpolated(left: Array, rho: float, bounds: list[tuple[int, int]]) -> Array:
    """Residuals less their prediction by the neighbours in the run, scaled to one deviation.

    The first and the last reading have only one neighbour, and scatter more about it.
    """
    out = left.copy()
    share, wider = rho / (1.0 + rho**2), float(np.sqrt(1.0 + rho**2))
    for start, stop in bounds:
        run = left[start:stop]
        if run.size > 2:
            out[start + 1 : stop - 1] -= share * (run[:-2] + run[2:])
            out[start] = (run[0] - rho * run[1]) / wider
            out[stop - 1] = (run[-1] - rho * run[-2]) / wider
    return out


def _glitches(
    left: Array, rows: NDArray[np.int64], bounds: list[tuple[int, int]]
) -> NDArray[np.int64]:
    """Those of ``rows`` that are in short segments with an abrupt beginning and end.

    A glitch is over within a few readings, and those next to it in its run are far smaller;
    what lasts (a transition at a reversal, a manoeuvre) or fades is an error of the mean.
    """
    away = np.pad(np.abs(less_local_level(left, bounds)), 1)
    ends = np.zeros(left.size + 1, dtype=bool)
    ends[[0, *(stop for _, stop in bounds)]] = True
    flags = _flags(rows, left.size)
    starts, stops = flagged_segments(flags, bounds)
    before = np.where(ends[starts], 0.0, away[starts])
    after = np.where(ends[stops], 0.0, away[stops + 1])
    abrupt = (before < BESIDE * away[starts + 1]) & (after < BESIDE * away[stops])
    abrupt &= stops - starts <= MOST_IN_ROW
    return np.flatnonzero(within_segments(starts[abrupt], stops[abrupt], left.size))


def _flags(rows: NDArray[np.int64], n: int) -> NDArray[np.bool_]:
    found = np.zeros(n, dtype=bool)
    found[rows] = True
    return found


def _lengths(regression: Regression, rows: NDArray[np.int64]) -> NDArray[np.int64]:
    """Lengths of the segments of rows that follow each other."""
    starts, stops = flagged_segments(_flags(rows, regression.n), regression.bounds)
    return stops - starts


def _is_scattered(regression: Regression, rows: NDArray[np.int64]) -> bool:
    """Rows that follow each other lie on both sides at random: bursts, no manoeuvre."""
    # Not whitened: that would make neighbours change sides.
    e = regression.left_within_runs
    next_to = np.flatnonzero(np.diff(rows) == 1)
    turns = e[rows[next_to]] * e[rows[next_to + 1]] < 0.0
    by_chance = rows.size**2 / regression.n
    return turns.size > LEAST_PAIRS + 3.0 * by_chance and float(turns.mean()) > TURNING


def _at_reversals(regression: Regression, rows: NDArray[np.int64]) -> bool:
    """Most of the rows lie where the joint reverses: a transition, no outliers."""
    segment = regression.signals.segment
    cuts = np.flatnonzero((np.diff(segment) != 0) & (np.diff(regression.signals.run) == 0)) + 1
    near = np.zeros(regression.n, dtype=bool)
    for shift in range(-NEAR_REVERSAL, NEAR_REVERSAL):
        near[np.clip(cuts + shift, 0, regression.n - 1)] = True
    share = float(near[rows].mean()) if rows.size else 0.0
    return share > ISOLATED and share > 2.0 * float(near.mean())


def _gathered(regression: Regression, rows: NDArray[np.int64]) -> str:
    """Why outliers are not independent of each other, as they gather where a motion begins.

    Segments of them are counted, each once: independent ones fall anywhere.
    """
    signals = regression.signals
    begins = np.diff(signals.segment, prepend=-1) != 0
    begins[[start for start, _ in regression.bounds]] = True
    places = np.arange(regression.n)
    since = places - np.maximum.accumulate(np.where(begins, places, 0))
    starts, _ = flagged_segments(_flags(rows, regression.n), regression.bounds)
    near = [int(np.count_nonzero(since[starts] < within)) for within in AFTER]
    chances = [
        len(AFTER) * binomial_tail(count, starts.size, float(np.mean(since < within)))
        for count, within in zip(near, AFTER, strict=True)
    ]
    k = int(np.argmin(chances))
    if chances[k] > GATHERED or near[k] <= ISOLATED * starts.size:
        return ""
    reach = "the first reading" if AFTER[k] == 1 else f"the first {AFTER[k]} readings"
    return (
        f"{near[k]} of its {starts.size} places are among {reach} after a start or a reversal "
        f"(p {chances[k]:.1g}): something that winds up or settles there leaves them, as "
        f"{PreslidingHysteresis.kind} does"
    )


def _normal(e: Array, scale: float) -> float:
    n = e.size
    return -0.5 * float(e @ e) / scale**2 - n * float(np.log(scale) + 0.5 * np.log(2.0 * np.pi))


def _student(e: Array, nu: float, scale: float) -> float:
    constant = lgamma(0.5 * (nu + 1.0)) - lgamma(0.5 * nu) - 0.5 * float(np.log(np.pi * nu))
    body = -0.5 * (nu + 1.0) * float(np.sum(np.log1p((e / scale) ** 2 / nu)))
    return body + e.size * (constant - float(np.log(scale)))
