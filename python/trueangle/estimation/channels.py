"""Constants of two channels: by the likelihood of their curve, or by a reference."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final, NamedTuple

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..errors import NoModelError
from ..runs.checks.channelreadings import ChannelReadings
from ..runs.rawchannels import ChannelHarmonic, Channels
from ..support.arrays import Array
from ..support.distributions import normal_quantile
from .linear import least_squares

#: Cells of a period in which readings are counted: coverage, and weights of rests.
CELLS: Final = 64

#: Readings of one cell count for at most this many times those of the median cell.
_MOST_IN_CELL: Final = 4.0

#: Harmonics ``z_(-m)`` that are tried: radius of order up to 8.
_HARMONICS: Final = tuple(range(2, 8))

#: Share of the period that a harmonic needs, so that it is not one with the ellipse.
_WHOLE: Final = 0.9

#: Standard error of the middle, in radii, from which the curvature of the arc is not known.
_LINEAR: Final = 0.2

#: Confidence that a correction takes more than it adds.
_CONFIDENCE: Final = 0.99


class ChannelEstimate(NamedTuple):
    """Constants with what is known about them.

    ``limit`` is the standard deviation of the decoded angle by that of the constants, over the
    phases covered and without its mean; ``takes`` what the correction takes there, in radians of
    the channels' phase; ``noise`` that of one channel and ``radius_left`` the distance to the
    curve, both relative to the radius. ``readings`` of those ``recorded`` are on the curve.
    """

    channels: Channels
    limit: float
    takes: float
    coverage: float
    noise: tuple[float, float]
    radius_left: float
    phases: Array
    readings: int
    recorded: ChannelReadings
    rests: int
    correlated: float


def estimate_channels(
    sine: Array, cosine: Array, named: str, *, periods: int = 1, period: float = 360.0
) -> ChannelEstimate:
    """Fit the closed curve of two channels without a reference.

    Raises
    ------
    NoModelError
        A channel is constant, both are one, too few readings, an arc that is too short: one line
        that states which.
    """
    recorded = ChannelReadings.of(sine, cosine).checked(named)
    y, x = sine[recorded.kept], cosine[recorded.kept]
    found = _Fit(y, x, named)
    share = float((found.cells > 0).mean())
    if share >= _WHOLE:
        found.add_harmonics()
    channels = found.channels(periods, period)
    limit, takes = found.limit()
    result = ChannelEstimate(
        channels,
        limit,
        takes,
        360.0 * share,
        found.noise,
        found.radius_left,
        found.phases,
        y.size,
        recorded,
        int((found.weights < 1.0).sum()),
        found.correlated,
    )
    _refuse_beyond_limit(result, named)
    return result


def cell_counts(phases: Array) -> NDArray[np.intp]:
    """Readings in each cell of the period."""
    cells = np.floor(phases / (2.0 * math.pi) * CELLS).astype(np.intp) % CELLS
    return np.bincount(cells, minlength=CELLS)


def rest_weights(phases: Array, counts: NDArray[np.intp]) -> Array:
    """Weights below one where the shaft rested: a place is known by the arc, not by the time."""
    cells = np.floor(phases / (2.0 * math.pi) * CELLS).astype(np.intp) % CELLS
    most = _MOST_IN_CELL * float(np.median(counts[counts > 0]))
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
    if std > _LINEAR * abs(found.channels.fundamental):
        raise NoModelError(
            f"{named}: {found.coverage:.0f} deg of the channels' period with this noise do not "
            "determine the offsets of the channels: turn the shaft further, 120 deg or more"
        )
    if found.takes > (1.0 + normal_quantile(_CONFIDENCE)) * found.limit:
        return
    if found.coverage >= 360.0 * _WHOLE:
        return  # a sound sensor: the limit is small, and so is what is taken
    unit = math.degrees(1.0) / found.channels.periods_per_turn
    raise NoModelError(
        f"{named}: {found.coverage:.0f} deg of the channels' period with this noise settle the "
        f"angle to {found.limit * unit:.2g} deg, and the correction takes "
        f"{found.takes * unit:.2g} deg: turn the shaft further, 120 deg or more, or average "
        "readings"
    )


class _Fit:
    """The curve of kept readings, with its harmonics and the ratio of the channels' noise."""

    def __init__(self, sine: Array, cosine: Array, named: str) -> None:
        self.sine, self.cosine, self.named = sine, cosine, named
        self.weights = np.ones(sine.size)
        self.variances = (1.0, 1.0)
        self.orders: tuple[int, ...] = ()
        self.start: tuple[list[int], list[float]] | None = None
        self._solve()
        self.cells = cell_counts(self.phases)
        weights = rest_weights(self.phases, self.cells)
        if (weights < 1.0).any():
            self.weights = weights
            self._solve()
        self._fit_noise_ratio()

    def _solve(self) -> None:
        found = _core.fit_curve(
            np.ascontiguousarray(self.sine),
            np.ascontiguousarray(self.cosine),
            self.weights,
            self.variances,
            list(self.orders),
            self.start,
        )
        if found is None:
            raise NoModelError(
                f"{self.named}: the channels draw no ellipse: too short an arc, or noise alone; "
                "turn the shaft through a period of the channels"
            )
        self.parameters, self.unit_covariance, self.phases, self.residuals, self.shares = found
        self.start = (list(self.orders), self.parameters.tolist())

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

    def add_harmonics(self) -> None:
        """Add harmonics one after the other, each where the likelihood pays for it (BIC)."""
        for order in _HARMONICS:
            before = self.__dict__.copy()
            old = float(self.weights @ self.residuals**2)
            self.orders = (*self.orders, order)
            self._solve()
            new = float(self.weights @ self.residuals**2)
            n = self.weights.size
            gain = n * math.log(old / new) if 0.0 < new < old else 0.0
            if gain / self.correlated <= 2.0 * math.log(n):
                self.__dict__.update(before)

    @property
    def covariance(self) -> Array:
        """Of the parameters, for the noise that the residuals show."""
        return np.asarray(self.unit_covariance * (self.variance * self.correlated))

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

    def limit(self) -> tuple[float, float]:
        """Standard deviation of the angle by that of the curve, and what the correction takes."""
        middles = (np.arange(CELLS * 4) + 0.5) * (2.0 * math.pi / (CELLS * 4))
        phases: Array = middles[np.repeat(self.cells > 0, 4)].astype(np.float64)
        rows = _core.curve_slopes(list(self.orders), self.parameters.tolist(), phases).T
        rows = rows - rows.mean(axis=0)
        spread = np.einsum("ij,jk,ik->i", rows, self.covariance, rows)
        sine, cosine = self.channels(1, 2.0 * math.pi).curve(phases)
        raw = np.arctan2(sine, cosine) - phases
        unit = np.exp(1j * raw)
        off = np.angle(unit / unit.mean())
        return math.sqrt(float(spread.mean())), float(np.std(off))

    def channels(self, periods: int, period: float) -> Channels:
        """The constants, with the covariance of their curve."""
        return channels_of(
            self.parameters,
            self.covariance,
            [-m for m in self.orders],
            periods_per_turn=periods,
            period=period,
        )


def channels_of(
    parameters: Array, covariance: Array, orders: Sequence[int], **fields: Any
) -> Channels:
    """Constants of a curve whose cosine channel has its top at phase zero.

    ::

        cosine = p0 + p2 cos φ,    sine = p1 + p3 sin φ + p4 cos φ

    then real and imaginary part of ``z_k`` of every harmonic; ``covariance`` is that of all.
    """
    offset_cosine, offset_sine, a, b, d = (float(v) for v in parameters[:5])
    size = math.hypot(b, d)
    # Derivatives of amplitude, ratio and phase by a, b and d.
    slopes = np.zeros((5, 5))
    slopes[0, 0] = slopes[1, 1] = slopes[2, 2] = 1.0
    slopes[3, 2:] = (-size / a**2, b / size / a, d / size / a)
    slopes[4, 3:] = np.degrees([-d / size**2, b / size**2])
    z1 = complex(a + b, d) / 2.0
    turn, radius = z1 / abs(z1), abs(z1)
    harmonics = []
    for i, k in enumerate(orders):
        pair = slice(5 + 2 * i, 7 + 2 * i)
        z = complex(*parameters[pair]) * turn ** (-k) / radius
        std = math.sqrt(0.5 * float(np.trace(covariance[pair, pair]))) / radius
        harmonics.append(ChannelHarmonic(k, z.real, z.imag, std))
    return Channels(
        offset_sine=offset_sine,
        offset_cosine=offset_cosine,
        amplitude=a,
        gain_ratio=size / a,
        phase_deg=math.degrees(math.atan2(d, b)),
        harmonics=tuple(harmonics),
        covariance=tuple(map(tuple, (slopes @ covariance[:5, :5] @ slopes.T).tolist())),
        **fields,
    )
