"""Orders, coefficients and noise of runs by the evidence of one linear model of all readings."""

from __future__ import annotations

import math
from collections.abc import Collection, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from .._core import Evidence, Groups
from ..support.arrays import Array
from .factor import orthonormal_basis
from .linear import pseudo_inverse

#: Correlation times of the noise's exponential terms, in median steps of a run's time.
CORRELATION_TIMES = tuple(Evidence.CORRELATION_TIMES)


class RunReadings(NamedTuple):
    """Readings of one run in the order in which they were read."""

    theta: Array  #: Angles, radians.
    error: Array  #: Errors, any unit.
    time: Array | None = None  #: Times that do not decrease; None: equally spaced.
    weights: Array | None = None  #: Above 0; the noise of a reading is over their roots.


class WeightedModel(NamedTuple):
    """One model of a mixture."""

    weight: float  #: Posterior probability.
    tau: Array  #: Prior variance of each order's coefficients; 0: not in the model.
    omega: Array  #: Variance of what differs from run to run, of each order.


class Alone(NamedTuple):
    """One order by itself, in addition to those of the most probable model."""

    cosine: float
    sine: float
    cosine_variance: float
    sine_variance: float

    @property
    def statistic(self) -> float:
        """Sum of squares of both over their variances; 2 on average where there is none."""
        return self.cosine**2 / self.cosine_variance + self.sine**2 / self.sine_variance


@dataclass(frozen=True)
class EvidenceEstimate:
    """Posterior of orders, coefficients and noise.

    Attributes
    ----------
    orders : tuple of float
        The orders that were looked at.
    probability : ndarray, shape (K,)
        Posterior probability that each of them is in the error.
    told : tuple of float
        Orders that some model of the mixture has.
    mean, covariance : ndarray, shapes (2 M,) and (2 M, 2 M)
        Of the cosine and the sine of every order of ``told`` in turn; the mixture over models and
        noises.
    noise : ndarray, shape (6,)
        Variances of the noise at the maximum of the evidence: its white part, and the terms with
        the correlation times `CORRELATION_TIMES`.
    within : ndarray, shape (6,)
        The same without what all readings of a run have in common, which is its zero.
    models : tuple of WeightedModel
        Models of the mixture over ``told``, the most probable first.
    zeros : ndarray, shape (R,)
        Variance of the zero of each run, where the coefficients are known; what all readings of a
        run have in common is its zero, and not noise.
    readings : int
    alone : tuple of Alone or None
        Each of ``orders`` by itself; None where the readings do not distinguish it from the others.
    runs : tuple of RunReadings
        What it is the estimate of.
    prior : ndarray, shape (K,)
        Prior probability of each order.
    """

    orders: tuple[float, ...]
    probability: Array
    told: tuple[float, ...]
    mean: Array
    covariance: Array
    noise: Array
    within: Array
    models: tuple[WeightedModel, ...]
    zeros: Array
    alone: tuple[Alone | None, ...]
    readings: int
    runs: tuple[RunReadings, ...] = field(repr=False)
    prior: Array = field(repr=False)

    @property
    def present(self) -> tuple[float, ...]:
        """Orders that runs more probably share or differ by than not."""
        return self._probable([(m.tau > 0.0) | (m.omega > 0.0) for m in self.models])

    @property
    def differing(self) -> tuple[float, ...]:
        """Orders that runs more probably differ by than not."""
        return self._probable([m.omega > 0.0 for m in self.models])

    def _probable(self, has: Sequence[NDArray[np.bool_]]) -> tuple[float, ...]:
        """Orders that models have, more probably than not."""
        some = np.array([model.weight for model in self.models]) @ has
        return tuple(k for k, p in zip(self.told, some, strict=True) if p > 0.5)

    def without(self, left_out: Collection[int]) -> EvidenceEstimate:
        """The estimate of the other runs, of the orders in ``told`` and under the same noise.

        Models are sought again from the sums of the other runs. Cost: one pass over their readings.
        """
        runs = tuple(run for r, run in enumerate(self.runs) if r not in left_out)
        places = [self.orders.index(k) for k in self.told]
        best = self.models[0]
        omega = best.omega if len(runs) > 1 else np.zeros_like(best.omega)
        given = [tuple(map(_column, run)) for run in runs]
        found, mean, covariance = Evidence(given, self.told).under(
            self.noise.tolist(), self.prior[places].tolist(), best.tau.tolist(), omega.tolist()
        )
        models = tuple(WeightedModel(w, np.array(tau), np.array(own)) for w, tau, own in found)
        probability = np.zeros_like(self.probability)
        probability[places] = np.sum([m.weight * (m.tau > 0.0) for m in models], axis=0).clip(max=1)
        return replace(
            self,
            probability=probability,
            mean=mean,
            covariance=covariance,
            models=models,
            zeros=np.delete(self.zeros, list(left_out)),
            readings=sum(len(run.theta) for run in runs),
            runs=runs,
        )

    def curve(self, theta: Array) -> tuple[Array, Array]:
        """Error curve at angles in radians, less its mean over them, and its standard deviation."""
        return self._curve(theta, ())

    def carriers(self, theta: Array, beside: Sequence[float] = ()) -> tuple[float, ...]:
        """The fewest orders that hold the curve at these angles.

        These are the orders that are there with more than half of the probability, and, where
        orders are nearly collinear, the likeliest of the others. Orders are added until what they
        omit of the mean curve has less than a quarter of the curve's variance.

        Parameters
        ----------
        theta : ndarray
            Angles in radians.
        beside : sequence of float
            Orders that are fitted and not wanted.
        """
        chance = dict(zip(self.orders, self.probability, strict=True))
        ranked = sorted((k for k in self.told if k not in beside), key=lambda k: -chance[k])
        count = sum(chance[k] >= 0.5 for k in ranked)
        curve, std = self._curve(theta, beside)
        while count < len(ranked):
            mean, _ = self.among(sorted(ranked[:count]), theta, beside)
            held = _columns(theta, sorted(ranked[:count])) @ mean
            # A curve within its own standard deviation is none.
            # Part of the variance of the curve that orders omitted from a model may take from its
            # mean.
            share = 0.25 if count else 1.0
            if np.mean((curve - held) ** 2) <= share * np.mean(std**2):
                break
            count += 1
        return tuple(sorted(ranked[:count]))

    def among(
        self, orders: Sequence[float], theta: Array, beside: Sequence[float] = ()
    ) -> tuple[Array, Array]:
        """Mean and covariance of coefficients whose curve at these angles is nearest to this one.

        ::

            b_S = M b,   M = argmin |X_S M - X|² / N + v |M / 3 s|² / p

        so that an order that is not among those wanted is held by those it looks like. With the
        variance v of the curve, which p coefficients hold, and s² = E b_S² + Σ E b², the sum over
        the orders not wanted, no order becomes larger than it may be.
        """
        wanted = [2 * list(orders).index(k) if k in orders else -1 for k in self.told]
        onto = np.zeros((2 * len(orders), 2 * len(self.told)))
        square = np.reshape(self.mean**2 + np.diag(self.covariance), (-1, 2)).mean(axis=1)
        size = np.zeros(len(orders))
        others = []
        for i, (order, place) in enumerate(zip(self.told, wanted, strict=True)):
            if place >= 0:
                onto[place : place + 2, 2 * i : 2 * i + 2] = np.eye(2)
                size[place // 2] = square[i]
            elif order not in beside:
                others.append(i)
        if others and len(orders):
            size += square[others].sum()
            bound = np.sqrt(np.mean(self._curve(theta, beside)[1] ** 2) / (len(onto) * size)) / 3.0
            columns = _columns(theta, orders) / math.sqrt(len(theta))
            rows = np.vstack([columns, np.diag(np.repeat(bound, 2))])
            looks = _columns(theta, [self.told[i] for i in others]) / math.sqrt(len(theta))
            target = np.vstack([looks, np.zeros((len(onto), looks.shape[1]))])
            places = np.ravel([(2 * i, 2 * i + 1) for i in others])
            # Singular values of columns, over the largest, below which they are one column at the
            # angles.
            onto[:, places] = np.linalg.lstsq(rows, target, rcond=1e-6)[0]
        return onto @ self.mean, onto @ self.covariance @ onto.T

    def gain_of_a_run(self, theta: Array) -> tuple[float, float]:
        """Mean and standard deviation of the gain of the mean curve on a further run.

        ::

            g = 2 (b + d)' G m - m' G m,    E g = m' G m,    var g = 4 m' G Ω G m

        with the Gram matrix G of the columns at these angles over their number, and the variances
        Ω of what differs from run to run.
        """
        columns = _columns(theta, self.told)
        reach = columns.T @ (columns @ self.mean) / len(columns)
        omega = np.sum([m.weight * m.omega for m in self.models], axis=0)
        spread = float(np.repeat(omega, 2) @ reach**2)
        return float(self.mean @ reach), 2.0 * float(np.sqrt(spread))

    def freedom_of_runs(self, orders: Sequence[float], variance: Array, freedom: float) -> Array:
        """Effective degrees of freedom of the variances of coefficients (Welch-Satterthwaite).

        ::

            1 / ν = p² / 2 (R - 1) + (1 - p)² / f,    p = ω / R var b

        with the part p of a variance that comes from what differs between R runs, two
        coefficients of which estimate ω, and f degrees of freedom of the readings.
        """
        runs = len(self.runs)
        mean = np.sum([m.weight * m.omega for m in self.models], axis=0)
        omega = dict(zip(self.told, mean.tolist(), strict=True))
        each = np.repeat([omega.get(k, 0.0) for k in orders], 2) / runs
        part = np.minimum(each / np.maximum(variance, 1e-300), 1.0)
        return 1.0 / (part**2 / max(2.0 * (runs - 1), 1.0) + (1.0 - part) ** 2 / freedom)

    def _curve(self, theta: Array, beside: Sequence[float]) -> tuple[Array, Array]:
        columns = _columns(theta, self.told)
        columns[:, np.repeat(np.isin(self.told, list(beside)), 2)] = 0.0
        variance = np.einsum("ij,jk,ik->i", columns, self.covariance, columns)
        return columns @ self.mean, np.sqrt(np.maximum(variance, 0.0))


def _columns(theta: Array, orders: Sequence[float]) -> Array:
    """Cosine and sine of every order in turn, less their means over the angles."""
    waves = np.multiply.outer(theta, np.asarray(orders, dtype=float))
    columns = np.stack([np.cos(waves), np.sin(waves)], axis=2).reshape(len(theta), -1)
    return np.asarray(columns - columns.mean(axis=0))


def estimate_by_evidence(
    runs: Sequence[RunReadings], orders: Sequence[float], probability: Sequence[float] | None = None
) -> EvidenceEstimate:
    """Estimate orders, their coefficients and the noise of runs together.

    The model of the readings y of run r, with X the cosines and sines of the orders:

    ::

        y_r = z_r + X_r (b + d_r) + n_r
        b_k ~ 0 or N(0, tau_k I),   d_rk ~ N(0, omega_k I),   z_r flat
        n_r ~ N(0, C),   C = w I + sum_j a_j exp(-|dt| / T_j)

    Noise and variances are those of most evidence, and the result is the mixture over the models
    and noises that are nearly as probable. Nothing is random.

    Parameters
    ----------
    runs : sequence of RunReadings
    orders : sequence of float
        Positive, increasing; as many as one likes, for those that are not significant cost a pass.
    probability : sequence of float, optional
        Prior probability of each order, above 0 and below 1; 1/K of each by default, or 1/2 of one.

    Raises
    ------
    ArgumentError
        Readings that are not finite or not equally many, times that decrease, weights that are not
        above 0, orders that do not increase.

    Examples
    --------
    >>> theta = np.linspace(0.0, 2.0 * np.pi, 90, endpoint=False)
    >>> ripple = 0.3 * np.cos(np.arange(90.0) ** 2)
    >>> runs = [RunReadings(theta, 5.0 * np.cos(2.0 * theta) + s * ripple) for s in (1.0, -1.0)]
    >>> estimate_by_evidence(runs, [1, 2, 3, 4]).present
    (2,)
    """
    if probability is None:
        probability = [1.0 / max(len(orders), 2)] * len(orders)
    given = [tuple(map(_column, run)) for run in runs]
    own, places, mean, covariance, noise, within, models, zeros, alone = Evidence(
        given, orders
    ).estimate(probability)
    return EvidenceEstimate(
        tuple(orders),
        own,
        tuple(orders[k] for k in places),
        mean,
        covariance,
        noise,
        within,
        tuple(WeightedModel(w, np.array(tau), np.array(omega)) for w, tau, omega in models),
        zeros,
        tuple(None if own is None else Alone(*own) for own in alone),
        sum(len(run.theta) for run in runs),
        tuple(runs),
        np.asarray(probability, dtype=float),
    )


@dataclass(frozen=True)
class CorrelatedNoise:
    """Noise of equally spaced readings that is of most evidence.

    Attributes
    ----------
    readings : Groups
        Columns of a fit and what it leaves, run by run: whole runs, up to 12 000 readings.
    tau : list of float
        Prior variance of the coefficients, as good as flat.
    scale : float
        Variance of what is left, above 0.
    """

    readings: Groups
    tau: list[float]
    scale: float

    @classmethod
    def of(cls, columns: Sequence[Array], left: Sequence[Array], scale: float) -> CorrelatedNoise:
        """From the columns and what a fit of them leaves, run by run.

        Taking p columns out of n readings costs n p². Beyond 2.5e8 the noise is that of what is
        left, whose mean square is ``scale``.
        """
        room = 12_000
        if min(room, sum(map(len, left))) * columns[0].shape[1] ** 2 > 2.5e8:
            columns = [x[:, :1] for x in columns]
            held = math.sqrt(scale / np.mean(np.concatenate(left) ** 2))
            left = [held * y for y in left]
        sizes = np.diff(np.minimum(np.cumsum([0, *map(len, left)]), room)).tolist()
        # Over the arc of the first readings the columns may be alike.
        rows = orthonormal_basis(np.vstack([x[:n] for x, n in zip(columns, sizes, strict=True)]))
        parts = np.split(rows, np.cumsum(sizes)[:-1])
        pairs = [(x, y[:n], None) for x, y, n in zip(parts, left, sizes, strict=True) if n]
        readings = Groups(pairs, [rows.shape[1]])
        return cls(readings, [1e6 * scale * sum(map(len, left))], scale)

    @cached_property
    def variances(self) -> Array:
        """Of its white part, and of the terms with the correlation times `CORRELATION_TIMES`."""
        return self.readings.noise(self.tau, self.scale)

    @property
    def odds(self) -> float:
        """Logarithm of its evidence over that of white noise."""
        white = self.scale * np.eye(1, len(self.variances))[0]
        own, other = (
            self.readings.sums(noise, self.scale).posterior(self.tau)[0]
            for noise in (self.variances, white)
        )
        return float(own - other)

    def covariances(self, count: int) -> Array:
        """Of readings 0 to ``count - 1`` steps apart."""
        decay = np.exp(-np.arange(count)[:, None] / np.array(CORRELATION_TIMES))
        return np.asarray(decay @ self.variances[1:] + self.variances[0] * np.eye(1, count)[0])

    def correlation(self, count: int) -> Array:
        """Of ``count`` readings of a run, without what all have in common, which is its zero."""
        near = self.covariances(count)
        return np.asarray((near - near[-1]) / (near[0] - near[-1]))

    def covariance_times(self, rows: Array) -> Array:
        """Its covariance times columns of a run, by a cyclic convolution."""
        count = len(rows)
        size = 1 << (2 * count - 1).bit_length()
        near = self.covariances(count)
        spectrum = 2.0 * np.fft.rfft(near, size).real - near[0]
        back = [np.fft.irfft(spectrum * np.fft.rfft(x, size), size)[:count] for x in rows.T]
        return np.column_stack(back)

    def widening(self, columns: Sequence[Array], held: float = 0.0) -> Array:
        """Standard errors of least-squares coefficients over those of independent readings.

        ::

            cov b = (G + h)⁻¹ X' C X (G + h)⁻¹,    G = X' X

        with the columns X of every run less what is its own, its zero, and a penalty h.
        """
        gram = np.sum([x.T @ x for x in columns], axis=0)
        inverse = pseudo_inverse(gram + held * np.eye(len(gram)))
        meat = np.sum([x.T @ self.covariance_times(x) for x in columns], axis=0)
        before, after = (np.diag(inverse @ form @ inverse) for form in (self.scale * gram, meat))
        return np.sqrt(after / before)

    def share(self, count: int) -> float:
        """Degrees of freedom of a variance of ``count`` readings over their number.

        ::

            (tr C)² / n tr C² = 1 / (2 Σ_l (1 - l/n) ρ_l² - 1)
        """
        squares = self.correlation(count) ** 2 * (1.0 - np.arange(count) / count)
        return float(1.0 / (2.0 * squares.sum() - 1.0))


def noise_information(
    columns: Array, left: Array, bounds: Sequence[tuple[int, int]], scale: float
) -> Array:
    """Information of readings about coefficients, under the noise of most evidence.

    ::

        X' C^-1 X,    C = w I + sum_j a_j exp(-|dt| / T_j) - c   in every run

    with the variances of most evidence for what a fit of the columns leaves (`CorrelatedNoise`)
    and the least covariance c: what all readings of a run have in common is a zero, and no noise.

    Parameters
    ----------
    columns : ndarray, shape (n, p)
    left : ndarray, shape (n,)
    bounds : sequence of (int, int)
        First reading and end of every run.
    scale : float
        Variance of what is left, above 0.
    """
    parts, rests = ([values[a:b] for a, b in bounds] for values in (columns, left))
    noise = CorrelatedNoise.of(parts, rests, scale)
    pairs = [(x, y, None) for x, y in zip(parts, rests, strict=True)]
    return Groups(pairs, [columns.shape[1]]).sums(noise.variances, scale).information()


def _column(values: Array | None) -> Array | None:
    return None if values is None else np.asarray(values, float)
