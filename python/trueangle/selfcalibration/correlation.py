"""How residuals correlate with their neighbours: an autoregression of as many terms as they need.

::

    e_i = φ₁ e_{i-1} + ... + φ_p e_{i-p} + w_i,    S(f) = c / |1 - Σ φ_j exp(-2πi j f)|²

with c such that the mean of S over all frequencies is 1. Of white noise p is 0 and S is 1.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from ..support.arrays import Array

#: Points of frequency over which a spectrum is averaged.
_GRID: Final = 8192


@dataclass(frozen=True)
class Correlation:
    """The spectrum of noise of unit variance, by the ``terms`` of its autoregression."""

    terms: Array

    @property
    def is_white(self) -> bool:
        """Whether neighbours do not correlate."""
        return self.terms.size == 0

    def spectrum(self, frequency: NDArray[Any]) -> Array:
        """Power relative to white noise, at frequencies in cycles per reading."""
        if self.is_white:
            return np.ones(np.shape(frequency))
        return np.asarray(self._shape(frequency) / self.level)

    def _shape(self, frequency: NDArray[Any]) -> Array:
        turned = np.exp(-2j * math.pi * frequency)
        # Horner: 1 - turned (φ1 + turned (φ2 + ...)).
        sums = np.zeros_like(turned)
        for term in self.terms[::-1]:
            sums = turned * (term + sums)
        return np.asarray(1.0 / np.abs(1.0 - sums) ** 2)

    @cached_property
    def level(self) -> float:
        """Variance relative to that of the one-step prediction error: 1 for white noise."""
        return float(self._shape((np.arange(_GRID) + 0.5) / (2.0 * _GRID)).mean())

    def over_lags(self, count: int) -> Array:
        """Correlations of readings 0, 1 ... ``count - 1`` apart."""
        power = self.spectrum(np.arange(_GRID + 1) / (2.0 * _GRID))
        return np.asarray(np.fft.irfft(power)[:count])

    def times(self, rows: Array) -> Array:
        """``R X``: rows of one series, along which the noise correlates."""
        if self.is_white:
            return rows
        # Zeros that are appended to a series: noise further apart is uncorrelated.
        n = 1 << (len(rows) + min(len(rows), 1024) - 1).bit_length()
        power = self.spectrum(np.fft.rfftfreq(n))[:, None]
        found = np.fft.irfft(power * np.fft.rfft(rows, n, axis=0), n, axis=0)
        return np.asarray(found[: len(rows)])

    def whitened(self, rows: Array) -> Array:
        """The part of each row of one series that earlier rows do not predict."""
        p = self.terms.size
        found = rows[p:].copy()
        for lag, term in enumerate(self.terms, 1):
            found -= term * rows[p - lag : len(rows) - lag]
        return found


#: Of white noise.
WHITE: Final = Correlation(np.zeros(0))


def lag_sums(one: Array, other: Array, most: int) -> Array:
    """``Σ_i one_i other_{i+l}`` for lags l of 0, 1 ... most, over rows and all columns."""
    n = len(one)
    return np.array(
        [float(np.vdot(one[: n - lag], other[lag:])) for lag in range(min(most + 1, n))]
        + [0.0] * max(most + 1 - n, 0)
    )


def lag_pairs(lengths: Sequence[int], most: int) -> Array:
    """Pairs of readings of one series that are 0, 1 ... most apart."""
    apart = np.array(lengths)[:, None] - np.arange(most + 1)
    return np.asarray(np.maximum(apart, 0).sum(axis=0), dtype=np.float64)


def _most_terms(lengths: Sequence[int]) -> int:
    """Most terms that series of these lengths can determine."""
    # Terms of an autoregression, at most, and readings to a term, at least.
    return min(24, sum(lengths) // 10, max(lengths, default=1) - 1)


def correlation_of(
    series: Sequence[Array], absorbed: Callable[[Correlation, int], Array] | None = None
) -> Correlation:
    """The autoregression of the noise in these residuals, its length by BIC.

    By the equations of Yule and Walker, to whose sums over lags that is added which a fit took
    from the noise: a fit of slow patterns leaves nothing slow.

    Parameters
    ----------
    series : sequence of ndarray
        Residuals, series by series.
    absorbed : callable, optional
        Sums over lags that a fit absorbs of noise of unit variance and some correlation.

    Examples
    --------
    >>> rng = np.random.default_rng(1)
    >>> noise = np.convolve(rng.normal(size=4000), 0.8 ** np.arange(60), "valid")
    >>> correlation_of([noise]).terms.round(1), correlation_of([rng.normal(size=4000)]).is_white
    (array([0.8]), True)
    """
    lengths = [one.size for one in series]
    count, most = sum(lengths), _most_terms(lengths)
    left = np.sum([lag_sums(one, one, most) for one in series], axis=0) if count else np.zeros(1)
    if most < 1 or not left[0] > 0.0:
        return WHITE
    pairs = lag_pairs(lengths, most)
    found = WHITE
    # Rounds in which what a fit absorbed settles.
    for _ in range(1 if absorbed is None else 4):
        taken = np.zeros(most + 1) if absorbed is None else absorbed(found, most)
        variance = left[0] / max(count - taken[0], 1.0)
        lags = (left + variance * taken) / np.maximum(pairs, 1) / variance
        before, found = found, _autoregression(lags, count)
        if before.terms.size == found.terms.size == 0:
            break
    return found


def correlation_above(series: Sequence[Array], cut: float) -> tuple[Correlation, float]:
    """As `correlation_of`, where a fitted slow motion removed everything below a frequency.

    The power there is assumed to equal that between this frequency and twice it; the noise is
    taken as white where that covers most frequencies. Returns also the variance of a reading,
    including what the motion removed.

    Parameters
    ----------
    series : sequence of ndarray
    cut : float
        Cycles per reading.
    """
    lengths = [one.size for one in series]
    count, most = sum(lengths), _most_terms(lengths)
    # Above, fitted motion does not remove everything.
    if most < 1 or cut > 0.15:
        return WHITE, sum(float(one @ one) for one in series) / max(count, 1)
    left = np.zeros(most + 1)
    for one in series:
        n = 1 << (2 * one.size - 1).bit_length()
        power = np.abs(np.fft.rfft(one, n)) ** 2
        frequency = np.fft.rfftfreq(n)
        # The fewest cycles of a series over which the power just above is averaged.
        above = (frequency >= cut) & (frequency <= max(2.0 * cut, cut + 10.0 / one.size))
        if cut > 0.0 and above.any():
            power[frequency < cut] = power[above].mean()
        found = np.fft.irfft(power, n)[: most + 1]
        left[: found.size] += found
    if not left[0] > 0.0:
        return WHITE, 0.0
    lags = left / np.maximum(lag_pairs(lengths, most), 1.0)
    return _autoregression(lags / lags[0], count), float(lags[0])


def _autoregression(lags: Array, count: int) -> Correlation:
    """Levinson's recursion on correlations of neighbours, with as many terms as BIC selects."""
    terms, best = np.zeros(0), np.zeros(0)
    share, least = 1.0, 0.0
    for p in range(1, lags.size):
        part = (lags[p] - terms @ lags[p - 1 : 0 : -1]) / share if p > 1 else lags[1]
        if abs(part) >= 1.0:
            break
        terms = np.append(terms - part * terms[::-1], part)
        share *= 1.0 - part * part
        criterion = count * math.log(share) + p * math.log(count)
        if criterion < least:
            least, best = criterion, terms
    return Correlation(best)
