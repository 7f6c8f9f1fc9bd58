"""Constants of two channels: by the likelihood of their curve, or by a reference."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..errors import NoCurveError
from ..runs.checks.channelreadings import ChannelReadings
from ..runs.rawchannels import CONSTANTS, ChannelHarmonic, Channels
from ..support.arrays import Array
from ..support.distributions import normal_quantile
from .linear import least_squares

#: Cells of a period in which readings are counted: coverage, and weights of rests.
CELLS: Final = 64


#: Harmonics ``z_(-m)`` that are tried: radius of order up to 8.
_HARMONICS: Final = tuple(range(2, 8))

#: Harmonics of the curve, where the channels went through their whole period.
_REFERENCED: Final = (-3, -2, 2, 3)


#: Share of the period that a harmonic needs, so that it is not one with the ellipse.
_WHOLE: Final = 0.9


#: Confidence that a correction takes more than it adds.
_CONFIDENCE: Final = 0.99


def estimate_channels(
    sine: Array, cosine: Array, named: str, *, periods: int = 1, period: float = 360.0
) -> ChannelEstimate:
    """Fit the closed curve of two channels without a reference.

    Raises
    ------
    NoCurveError
        A channel is constant, both are one, too few readings, an arc that is too short: one line
        that states which.
    """
    recorded = ChannelReadings.of(sine, cosine).checked(named)
    found = ChannelEstimate(recorded, named, periods, period)
    _refuse_beyond_limit(found, named)
    return found


def cell_counts(phases: Array) -> NDArray[np.intp]:
    """Readings in each cell of the period."""
    cells = np.floor(phases / (2.0 * math.pi) * CELLS).astype(np.intp) % CELLS
    return np.bincount(cells, minlength=CELLS)


def rest_weights(phases: Array, counts: NDArray[np.intp]) -> Array:
    """Weights below one where the shaft rested: a place is known by the arc, not by the time."""
    cells = np.floor(phases / (2.0 * math.pi) * CELLS).astype(np.intp) % CELLS
    # Readings of one cell count for at most this many times those of the median cell.
    most = 4.0 * float(np.median(counts[counts > 0]))
    return np.asarray(np.minimum(1.0, most / counts[cells]))


def inflation(residuals: Array) -> float:
    """How many readings carry the information of one, by the correlation of neighbours.

    ::

        1 + 2 sum_k r_k

    up to the first lag whose correlation is not above two standard errors of white noise.
    """
    n = residuals.size
    power = float(residuals @ residuals)
    total = 1.0
    for lag in range(1, n // 4):
        found = float(residuals[lag:] @ residuals[:-lag]) / power if power > 0.0 else 0.0
        if found * math.sqrt(n) < 2.0:
            break
        total += 2.0 * found
    return total


def _refuse_beyond_limit(found: ChannelEstimate, named: str) -> None:
    """Refuse constants that the arc settles worse than the correction is large."""
    std = np.sqrt(np.diag(np.asarray(found.channels.covariance)))[:2].max()
    # Standard error of the middle, in radii, from which the curvature of the arc is not known.
    if std > 0.2 * abs(found.channels.fundamental):
        raise NoCurveError(
            f"{named}: {found.coverage:.0f} deg of the channels' period with this noise do not "
            "determine the offsets of the channels: turn the shaft further, 120 deg or more"
        )
    # A whole period of a sound sensor: the limit is small, and so is what is taken.
    enough = (1.0 + normal_quantile(_CONFIDENCE)) * found.limit
    if found.takes > enough or found.coverage >= 360.0 * _WHOLE:
        return
    unit = math.degrees(1.0) / found.channels.periods_per_turn
    raise NoCurveError(
        f"{named}: the correction, {found.takes * unit:.2g} deg, is uncertain by "
        f"{found.limit * unit:.2g} deg: the readings cover {found.coverage:.0f} deg of the "
        "channels' period only; turn the shaft 120 deg or more, or average readings"
    )


class ChannelEstimate:
    """The curve of readings, its constants, and what is known about them.

    Attributes
    ----------
    recorded : ChannelReadings
        Of which those without a flag are on the curve.
    channels : Channels
    coverage : float
        Degrees of the channels' period.
    limit, takes : float
        Standard deviation of the decoded angle by that of the constants, over the phases covered
        and without its mean, and what the correction takes there: radians of the channels' phase.
    """

    def __init__(
        self, recorded: ChannelReadings, named: str, periods: int = 1, period: float = 360.0
    ) -> None:
        self.recorded, self.named = recorded, named
        self.sine, self.cosine = (v[recorded.kept] for v in (recorded.sine, recorded.cosine))
        self.weights = np.ones(self.sine.size)
        self.variances = (1.0, 1.0)
        self.orders: Sequence[int] = []
        self.start: tuple[list[int], list[float]] | None = None
        self._solve()
        cells = cell_counts(self.phases)
        weights = rest_weights(self.phases, cells)
        if (weights < 1.0).any():
            self.weights = weights
            self._solve()
        share = float((cells > 0).mean())
        if share >= _WHOLE:
            self._choose_harmonics()
        self._fit_noise_ratio()
        self.coverage = 360.0 * share
        # The cosine's top is at zero: C is real.
        real = np.delete(np.eye(self.parameters.size + 1), 3, axis=1)
        self.channels = channels_of(
            real @ self.parameters,
            real @ self.covariance @ real.T,
            [-order for order in self.orders],
            periods_per_turn=periods,
            period=period,
        )
        self.limit, self.takes = self._limit(cells)

    def _solve(self) -> None:
        found = _core.fit_curve(
            self.sine, self.cosine, self.weights, self.variances, list(self.orders), self.start
        )
        if found is None:
            raise NoCurveError(
                f"{self.named}: the channels draw no ellipse: too short an arc, or noise alone; "
                "turn the shaft through a period of the channels"
            )
        self.parameters, self.unit_covariance, self.phases, self.residuals, self.shares = found
        self.start = (list(self.orders), self.parameters.tolist())

    @property
    def readings(self) -> int:
        """How many are on the curve."""
        return self.sine.size

    @property
    def rests(self) -> int:
        """Readings of less weight."""
        return int((self.weights < 1.0).sum())

    @property
    def variance(self) -> float:
        """Of the residuals, relative to ``variances``."""
        total = float(self.weights @ self.residuals**2)
        freedom = 1.0 - self.parameters.size / self.weights.size
        return total / float(self.weights.sum()) / freedom

    @property
    def correlated(self) -> float:
        """How many readings carry the information of one: neighbours' residuals are correlated."""
        return inflation(self.residuals)

    @property
    def covariance(self) -> Array:
        """Of the parameters, for the noise that the residuals show."""
        return np.asarray(self.unit_covariance * (self.variance * self.correlated))

    def _choose_harmonics(self) -> None:
        """Keep those harmonics that the readings support (BIC), each tested next to all others."""
        n, first = self.readings, len(CONSTANTS)
        # Two readings a parameter, else the residuals are not those of the noise.
        tried = _HARMONICS[: max(n - 2 * first, 0) // 4]
        self.orders = tried
        self._solve()
        kept = []
        for i, order in enumerate(tried):
            pair = slice(first + 2 * i, first + 2 * i + 2)
            both, covariance = self.parameters[pair], self.covariance[pair, pair]
            if both @ np.linalg.solve(covariance, both) > 2.0 * math.log(n):
                kept.append(order)
        self.orders = kept
        self._solve()

    def _fit_noise_ratio(self) -> None:
        """Variance of each channel's noise from distances where the curve is across it."""
        normal = self.shares  # of equal variances: squared cosine of the normal
        design = np.column_stack([normal, 1.0 - normal])
        squares = self.residuals**2
        equal = float(np.average(squares, weights=self.weights))
        found = np.array([equal, equal])
        for _ in range(10):
            fitted = design @ found
            weights = self.weights / fitted**2
            found = np.maximum(least_squares(design, squares, weights), 1e-3 * equal)
        fitted = design @ found
        gain = float(
            self.weights @ (np.log(equal) - np.log(fitted) + squares / equal - squares / fitted)
        )
        if gain / self.correlated > math.log(squares.size):
            self.variances = (1.0, float(found[1] / found[0]))
            self._solve()

    @property
    def size(self) -> float:
        """Radius: size of the fundamental."""
        a, b, d = (float(v) for v in self.parameters[2:5])
        return 0.5 * math.hypot(a + b, d)

    @property
    def noise(self) -> tuple[float, float]:
        """Standard deviation of cosine and sine, relative to the radius."""
        std = math.sqrt(self.variance)
        first, second = (std * math.sqrt(v) / self.size for v in self.variances)
        return first, second

    @property
    def radius_left(self) -> float:
        """Root mean square of the distance to the curve, relative to the radius."""
        first, second = self.variances
        # The squared cosine of the normal, and the distance from that in standard deviations.
        normal = self.shares * second / (self.shares * second + (1.0 - self.shares) * first)
        squares = self.residuals**2 * (normal * first + (1.0 - normal) * second)
        return math.sqrt(float(np.average(squares, weights=self.weights))) / self.size

    def _limit(self, cells: NDArray[np.intp]) -> tuple[float, float]:
        """Standard deviation of the angle by that of the curve, and what the correction takes."""
        middles = (np.arange(CELLS * 4) + 0.5) * (2.0 * math.pi / (CELLS * 4))
        phases: Array = middles[np.repeat(cells > 0, 4)].astype(np.float64)
        rows = _core.curve_slopes(list(self.orders), self.parameters.tolist(), phases).T
        rows = rows - rows.mean(axis=0)
        spread = np.einsum("ij,jk,ik->i", rows, self.covariance, rows)
        sine, cosine = self.channels.curve(phases)
        raw = np.arctan2(sine, cosine) - phases
        unit = np.exp(1j * raw)
        off = np.angle(unit / unit.mean())
        return math.sqrt(float(spread.mean())), float(np.std(off))


def referenced_channels(
    signals: Sequence[tuple[Array, Array, Array]], channels: Channels, named: str
) -> Channels:
    """Constants of channels whose phase a reference determines, of runs with a zero each.

    ``signals`` are sine, cosine and reference of every run; ``channels`` state the sense, periods
    and unit.

    ::

        z = sum_k z_k exp(i k (φ + ψ_r)),    φ = ± 2 pi p θ / period

    Raises
    ------
    NoCurveError
        A channel is dead, or both are one.
    """
    sine, cosine, reference = (np.concatenate([run[i] for run in signals]) for i in range(3))
    kept = ChannelReadings.of(sine, cosine).checked(named).kept
    run = np.repeat(np.arange(len(signals)), [run[0].size for run in signals])[kept]
    sine, cosine = sine[kept], cosine[kept]
    unit = channels.direction * channels.periods_per_turn * 2.0 * math.pi / channels.period
    phase = unit * reference[kept]
    # Every run from where its cosine is at the top; what several runs then differ is estimated.
    for i in range(len(signals)):
        own = run == i
        design = np.column_stack([np.ones(own.sum()), np.cos(phase[own]), -np.sin(phase[own])])
        _, re, im = least_squares(design, cosine[own])
        phase[own] += math.atan2(im, re)
    harmonics = _REFERENCED if (cell_counts(phase) > 0).mean() >= _WHOLE else ()
    target, both = np.concatenate([cosine, sine]), np.tile(run, 2)
    found = least_squares(_design(phase, harmonics), target)
    # Steps to the zeros of several runs, each about squares the distance left.
    for _ in range(4 if len(signals) > 1 else 1):
        # The first zero is in C. Without the others, each a parameter of one run alone:
        slope = (_design(phase, harmonics, derivative=True) @ found) * (both > 0)
        power = np.maximum(np.bincount(both, slope**2), 1e-300)
        rows = np.column_stack([_design(phase, harmonics), target])
        sums = np.stack([np.bincount(both, slope * c) for c in rows.T], axis=1) / power[:, None]
        rows -= slope[:, None] * sums[both]
        model = _core.LinearModel.of_rows(rows[:, :-1].copy(), rows[:, -1:].copy(), None)
        found = np.asarray(model.coefficients).ravel()
        phase = phase + (sums[:, -1] - sums[:, :-1] @ found)[run]
    freedom = target.size - found.size - len(signals) + 1
    if freedom < 1:
        raise NoCurveError(f"{named}: {sine.size} readings are too few; record more")
    residuals = rows[:, -1] - rows[:, :-1] @ found
    variance = float(residuals @ residuals) / freedom
    correlated = max(inflation(residuals[: sine.size]), inflation(residuals[sine.size :]))
    return channels_of(
        found,
        np.asarray(model.inverse) * variance * correlated,
        harmonics,
        direction=channels.direction,
        periods_per_turn=channels.periods_per_turn,
        period=channels.period,
    )


def _design(phase: Array, harmonics: Sequence[int], *, derivative: bool = False) -> Array:
    """Rows of the cosine, then of the sine, by the parameters of `channels_of`; or their slopes."""
    none = np.zeros_like(phase)
    one = none if derivative else np.ones_like(phase)
    columns = [(one, none), (none, one)]
    for k in (1, *harmonics):
        wave = (1j * k if derivative else 1.0) * np.exp(1j * k * phase)
        x, y = wave.real, wave.imag
        columns += [(x, none), (-y, none), (none, y), (none, x)] if k == 1 else [(x, y), (-y, x)]
    return np.column_stack([np.concatenate(pair) for pair in columns])


def channels_of(
    parameters: Array, covariance: Array, orders: Sequence[int], **fields: Any
) -> Channels:
    """Constants of a curve.

    ::

        cosine = p0 + Re(C exp(i φ)),    sine = p1 + Im(S exp(i φ)),
        C = p2 + i p3,  S = p4 + i p5

    then real and imaginary part of ``z_k`` of every harmonic; ``covariance`` is that of all. The
    zero of the phase is that of ``C``.
    """
    c, s = complex(*parameters[2:4]), complex(*parameters[4:6])
    ratio, z1 = abs(s) / abs(c), 0.5 * (c + s)
    # By the parameters: offsets, then the logarithm of C and that of S over C.
    offsets = np.eye(2, 6)
    log_c = np.array([0.0, 0.0, 1.0, 1j, 0.0, 0.0]) / c
    log_ratio = np.array([0.0, 0.0, 0.0, 0.0, 1.0, 1j]) / s - log_c
    slopes = np.vstack(
        [offsets, abs(c) * log_c.real, ratio * log_ratio.real, np.degrees(log_ratio.imag)]
    )
    harmonics = []
    for i, k in enumerate(orders):
        pair = slice(6 + 2 * i, 8 + 2 * i)
        z = complex(*parameters[pair]) * (z1 / abs(z1)) ** (-k) / abs(z1)
        std = math.sqrt(0.5 * float(np.trace(covariance[pair, pair]))) / abs(z1)
        harmonics.append(ChannelHarmonic(k, z.real, z.imag, std))
    return Channels.of_amplitudes(
        complex(*parameters[:2]),
        c,
        s,
        harmonics=tuple(harmonics),
        covariance=tuple(map(tuple, (slopes @ covariance[:6, :6] @ slopes.T).tolist())),
        **fields,
    )
