"""One calibration of one unit: coefficients of its orders, their covariance, normal equations."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from ..estimation.linear import NormalEquations, total
from ..fitting.robust import without_spikes
from ..joint.shafts import ShaftOrders
from ..runs.run import CalibrationRun
from ..runs.travel import over_turns
from ..support.angles import circular_mean
from ..support.arrays import Array

#: Readings whose columns are made together: 220 columns of them take 14 MB.
_BLOCK = 1 << 13


def output_orders(shafts: Sequence[ShaftOrders]) -> Array:
    """Output orders of all harmonics, shaft by shaft."""
    return np.array([k * shaft.cycles_per_turn for shaft in shafts for k in shaft.orders])


def order_columns(angles: Array, orders: Array, period: float) -> Array:
    """Cosine and sine of each order in turn, a row an angle."""
    phase = np.outer(angles, orders * (2.0 * math.pi / period))
    found = np.empty((angles.size, 2 * orders.size))
    np.cos(phase, out=found[:, ::2])
    np.sin(phase, out=found[:, 1::2])
    return found


def normal_matrix(angles: Array, orders: Array, period: float) -> Array:
    """Sums of products of a zero of size 1/sqrt(2) and the columns of each order."""
    found = np.zeros((2 * orders.size + 1, 2 * orders.size + 1))
    for part in _blocks(angles.size):
        columns = order_columns(angles[part], orders, period)
        columns = np.column_stack([np.full(len(columns), math.sqrt(0.5)), columns])
        found += columns.T @ columns
    return found


def _blocks(size: int) -> Iterator[slice]:
    """Readings whose columns are in memory at a time."""
    return (slice(start, start + _BLOCK) for start in range(0, size, _BLOCK))


@dataclass
class CalibrationSums:
    """Sums over the runs of one unit on one day; each run has a separate zero."""

    runs: list[NormalEquations] = field(default_factory=list)
    means: list[Array] = field(default_factory=list)
    when: str | None = None

    def add(self, run: CalibrationRun, orders: Array, periodic: bool) -> None:
        """Add a run, its isolated outliers omitted."""
        run = without_spikes(run if periodic else over_turns(run))
        error = run.centred_error
        share = np.ones(error.size) if run.weights is None else run.weights
        mean = np.zeros(2 * orders.size + 1)
        for part in _blocks(error.size):
            columns = order_columns(run.reference[part], orders, run.period)
            mean += share[part] @ np.column_stack([columns, error[part]])
        mean /= max(float(share.sum()), 1e-300)
        products = np.zeros((mean.size, mean.size))
        for part in _blocks(error.size):
            columns = order_columns(run.reference[part], orders, run.period)
            centred = np.column_stack([columns, error[part]]) - mean
            centred *= np.sqrt(share[part])[:, None]
            products += centred.T @ centred
        count = float(np.count_nonzero(share))
        sums = NormalEquations(
            products[:-1, :-1], products[:-1, -1], float(products[-1, -1]), count
        )
        self.runs.append(sums)
        self.means.append(mean)
        self.when = self.when or run.when

    def merge(self, other: CalibrationSums) -> None:
        """Take in the runs of the same unit and day under another name."""
        self.runs += other.runs
        self.means += other.means
        self.when = self.when or other.when

    def repeats(self, every: Array, inverse: Array) -> tuple[Array, float, Array]:
        """Squares of each order's coefficients of single runs about those of all, and freedom.

        Then the squares that independent readings of unit variance make of them.
        """
        models = [run.solved() for run in self.runs] if len(self.runs) > 1 else []
        if not models or any(model.rank < every.size for model in models):
            return np.zeros(every.size // 2), 0.0, np.zeros(every.size // 2)
        apart = np.array([model.coefficients[:, 0] - every for model in models])
        white = np.sum([np.diag(np.asarray(m.inverse)) - np.diag(inverse) for m in models], axis=0)
        squares, alike = (
            values.reshape(-1, 2).sum(axis=1) for values in ((apart**2).sum(axis=0), white)
        )
        return squares, 2.0 * (len(models) - 1.0), np.maximum(alike, 0.0)

    def within(self) -> tuple[float, float]:
        """Squares that patterns of single runs leave, and their freedom; 0 where one has none."""
        if len(self.runs) < 2:
            return 0.0, 0.0
        squares, freedom = 0.0, 0.0
        for run in self.runs:
            model, size = run.solved(), run.moment.size
            if model.rank < size or run.readings < size + 2:
                return 0.0, 0.0
            squares += max(run.about(model.coefficients[:, 0]).squares, 0.0)
            freedom += run.readings - 1.0 - size
        return squares, freedom


@dataclass(frozen=True, eq=False)
class Calibration:
    """What one day's readings determine about a unit.

    Attributes
    ----------
    unit : str
    when : str or None
        ISO 8601.
    coefficients : ndarray, shape (2 K,)
        Cosine and sine of each order in turn.
    inverse : ndarray, shape (2 K, 2 K)
        Covariance for readings of unit variance.
    zero : float
        Circular mean of the runs' zeros.
    zero_inverse : float
        Variance of `zero` for readings of unit variance.
    squares : float
        Left of the errors' sum of squares.
    freedom : float
        Readings less unknowns.
    readings, runs : int
    repeat_squares : ndarray, shape (K,)
        Squares of cosine and sine of single runs about `coefficients`, summed.
    repeat_freedom : float
        Of each of these sums; 0 of a single run.
    repeat_white : ndarray, shape (K,)
        These sums of independent readings of unit variance.
    within_squares, within_freedom : float
        The same as `squares` and `freedom` about patterns of single runs; 0 where these have none.
    louder : ndarray, shape (K,) or float
        Variance of each order's coefficients over that of independent readings.
    """

    unit: str
    when: str | None
    coefficients: Array
    inverse: Array
    zero: float
    zero_inverse: float
    squares: float
    freedom: float
    readings: int
    runs: int
    repeat_squares: Array
    repeat_freedom: float
    repeat_white: Array
    within_squares: float = 0.0
    within_freedom: float = 0.0
    louder: Array | float = 1.0

    @classmethod
    def of(cls, unit: str, sums: CalibrationSums, period: float) -> Calibration | None:
        """Of one day's sums; None where they do not separate the orders."""
        every = total(sums.runs)
        model = every.solved()
        size = every.moment.size
        freedom = every.readings - len(sums.runs) - size
        if model.rank < size or freedom < 1.0:
            return None
        found = model.coefficients[:, 0]
        inverse = np.asarray(model.inverse)
        means = np.array(sums.means)
        zeros = means[:, -1] - means[:, :-1] @ found
        across = means[:, :-1].mean(axis=0)
        own = sum(1.0 / max(run.readings, 1.0) for run in sums.runs) / len(sums.runs) ** 2
        return cls(
            unit,
            sums.when,
            found,
            inverse,
            circular_mean(zeros, period),
            own + float(across @ inverse @ across),
            max(every.about(found).squares, 0.0),
            freedom,
            round(every.readings),
            len(sums.runs),
            *sums.repeats(found, inverse),
            *sums.within(),
        )

    def blocks(self) -> Array:
        """Covariance of each order's cosine and sine for readings of unit variance, (K, 2, 2).

        Where runs show correlated readings, that of such readings.
        """
        k = 2 * np.arange(self.coefficients.size // 2)
        rows = np.array([[k, k], [k + 1, k + 1]]).transpose(2, 0, 1)
        columns = np.array([[k, k + 1], [k, k + 1]]).transpose(2, 0, 1)
        louder = np.broadcast_to(self.louder, self.coefficients.size // 2)
        return np.asarray(louder[:, None, None] * self.inverse[rows, columns])
