"""A least-squares problem: runs, shafts and orders, solved as often as weights change."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from typing import TYPE_CHECKING, Any, Literal, NamedTuple, TypeVar, cast

import numpy as np

import trueangle._core as _core

from ..errors import ArgumentError, RankError
from ..estimation.reference import design_matrix
from ..joint.shafts import ShaftOrders
from ..model.model import Argument
from ..runs.run import CalibrationRun
from ..runs.travel import over_turns
from ..support.angles import circular_mean, common_sign
from ..support.arrays import Array
from ..support.suggestions import check_choice
from .summed import SummedReadings

if TYPE_CHECKING:
    from .summed import SummedReadings

_Look = TypeVar("_Look")

#: Ways of solving; None takes the fastest that keeps QR's accuracy.
METHODS = (None, "plain", "moments", "qr", "counts")

#: Readings looked at together when residuals are only scanned: stays in cache.
_BLOCK = 16384


class PlainSolution(NamedTuple):
    """The core's solution as plain values, for pickles and copies."""

    offsets: Array
    offset_std: Array
    constant: float
    cosine: list[list[float]]
    sine: list[list[float]]
    covariance: Array
    residual_variance: float
    degrees_of_freedom: float
    rank: int
    condition_number: float
    method: Literal["plain", "moments", "qr", "counts", "evidence"]
    residual_bound: float = math.inf


class SolvedProblem:
    """A solution and its series."""

    def __init__(
        self,
        solution: _core.Solution | PlainSolution,
        offsets: Array,
        shafts: Sequence[ShaftOrders],
        period: float,
    ) -> None:
        self.solution = cast(_core.Solution, solution)
        self.shafts, self.period = tuple(shafts), period
        #: Zero of every run; NaN for a run without any weight.
        self.offsets = offsets
        try:
            self.series = (
                _series(solution, shafts, period)
                if isinstance(solution, PlainSolution)
                else solution.series()
            )
        except ArgumentError:
            # Orders that all but cancel: coefficients beyond what any series may have.
            raise RankError(
                f"the angles read cover too little of a turn to determine {self._named()}; "
                "fit fewer orders, or measure over more travel",
                [(i, order) for i, shaft in enumerate(shafts) for order in shaft.orders],
            ) from None

    def _named(self) -> str:
        """The orders, of every shaft that has some."""
        return ", ".join(
            f"{'orders' if len(shaft.orders) > 1 else 'order'} "
            f"{', '.join(f'{order:g}' for order in shaft.orders)} of {shaft.name}"
            for shaft in self.shafts
            if shaft.orders
        )

    def __reduce__(self) -> tuple[Any, ...]:
        values = PlainSolution(*(getattr(self.solution, name) for name in PlainSolution._fields))
        return SolvedProblem, (values, self.offsets, self.shafts, self.period)

    @property
    def amplitude_sum(self) -> float:
        """Sum of all amplitudes."""
        return self.series.amplitude_sum

    def predict(self, angles: Array) -> Array:
        """Error at ``angles``, the runs' mean zero included."""
        return np.asarray(self.series.error(angles))


def _series(solution: PlainSolution, shafts: Sequence[ShaftOrders], period: float) -> _core.Series:
    """The series of plain values."""
    return _core.Series(
        period,
        solution.constant,
        [shaft.cycles_per_turn for shaft in shafts],
        [list(shaft.orders) for shaft in shafts],
        solution.cosine,
        solution.sine,
    )


class Problem:
    """The readings of several runs and the regressors requested.

    The runs are of one period; ``method`` and ``threads`` are the core's.
    """

    def __init__(
        self,
        runs: Sequence[CalibrationRun],
        shafts: Sequence[ShaftOrders],
        argument: Argument,
        method: str | None = None,
        threads: int | None = None,
    ) -> None:
        #: False where a shaft turns a fraction of times per output turn.
        self.is_periodic = all(s.cycles_per_turn % 1.0 == 0.0 for s in shafts)
        self.runs = runs if self.is_periodic else [over_turns(run) for run in runs]
        self.shafts = shafts
        if method is not None:
            check_choice("method", method, filter(None, METHODS))
        self.argument = argument
        self.method = method
        self.threads = threads
        self.period = runs[0].period
        self.indicated_sign = common_sign(run.indicated_sign for run in runs)
        self.base: list[Array | None] = [run.weights for run in runs]
        #: Reference, indicated angle and weights of every run, as the core takes them.
        self.rows = [(run.reference, run.indicated, run.weights) for run in self.runs]
        #: The argument of every run.
        self.angles: list[Array] = [getattr(run, argument) for run in self.runs]
        self.readings = sum(map(len, self.angles))
        #: Angles that hold both ends of the travel.
        self.travel: list[Array] = self.angles
        #: Cycles per turn of every shaft, and its orders, as the core takes them.
        self.design = ([s.cycles_per_turn for s in shafts], [list(s.orders) for s in shafts])

    #: Sums of readings too many to keep, of which the runs are some.
    summed: SummedReadings | None = None

    @property
    def unknowns(self) -> int:
        """Two per order; the zeros of the runs are not counted."""
        return 2 * sum(len(shaft.orders) for shaft in self.shafts)

    def solve(
        self, weights: Sequence[Array | None], penalty: float = 0.0, watch: bool = False
    ) -> SolvedProblem:
        """Least squares under ``weights``, with an optional Tikhonov penalty.

        ``penalty`` is relative to the sum of weights, see `trueangle.fitting.ridge.choose_ridge`.
        With ``watch`` the solution of many readings knows what no residual exceeds.
        """
        used = [weight is None or bool(weight.any()) for weight in weights]
        rows = self.rows
        if weights is not self.base or not all(used):
            every = zip(rows, weights, used, strict=True)
            rows = [(x, y, weight) for (x, y, _), weight, taken in every if taken]
        if not rows:
            raise ArgumentError("every reading has weight 0: nothing is left to fit")
        ridge = self._penalties(weights, penalty) if penalty > 0.0 else None
        solution = _core.fit(
            rows, self.period, *self.design, self.argument, self.method, ridge, self.threads, watch
        )
        offsets = solution.offsets
        if len(rows) < len(self.runs):
            offsets = np.full(len(self.runs), np.nan)
            offsets[used] = solution.offsets
        return SolvedProblem(solution, offsets, self.shafts, self.period)

    def penalised(
        self, fitted: SolvedProblem, weights: Sequence[Array | None], penalty: float
    ) -> SolvedProblem:
        """What `solve` gives for the readings of ``fitted`` with a penalty, from its sums alone."""
        solution = fitted.solution.penalised(self._penalties(weights, penalty))
        offsets = fitted.offsets.copy()
        offsets[~np.isnan(offsets)] = solution.offsets
        return SolvedProblem(solution, offsets, self.shafts, self.period)

    def _penalties(self, weights: Sequence[Array | None], penalty: float) -> list[float]:
        """Of every coefficient, for one relative to the sum of weights."""
        return [penalty * self._weight(weights)] * self.unknowns

    def _weight(self, weights: Sequence[Array | None]) -> float:
        """Sum of the weights of all readings."""
        return sum(
            len(run) if weight is None else float(weight.sum())
            for run, weight in zip(self.runs, weights, strict=True)
        )

    def columns(self, index: int) -> Array:
        """Cosine and sine of every order at the readings of a run."""
        shafts = zip(*self.design, strict=True)
        return design_matrix(self.angles[index], shafts, self.period, constant=False)

    def private(self, index: int) -> Array:
        """Columns that a run has for itself: its zero."""
        return np.ones((len(self.runs[index]), 1))

    def products(self, weights: Sequence[Array | None], index: int) -> Array:
        """Sums of products of ``[1, columns, error]`` of a run."""
        run = self.runs[index]
        rows = _core.triangle(
            (run.reference, run.indicated, weights[index]),
            self.period,
            *self.design,
            self.argument,
            circular_mean(run.indicated - run.reference, self.period),
            self.threads,
        )
        return np.asarray(rows.T @ rows)

    def residuals(self, fitted: SolvedProblem) -> list[Array]:
        """Measured less fitted error of every run, each around its own zero."""
        return [np.concatenate(list(self._blocks(fitted, i))) for i in range(len(self.runs))]

    def scan(self, fitted: SolvedProblem) -> tuple[Array, float]:
        """A sample of the residuals of weight above 0, and a bound of all, from few of them.

        The bound is the largest of few readings, else what the solution knows, or infinite.
        """
        stride = max(1, self.readings // _BLOCK)
        if stride == 1:
            found = self._each(_core.scan_residuals, fitted, 1)
            if len(found) == 1:
                return found[0]
            return np.concatenate([part for part, _ in found]), max(most for _, most in found)
        parts = self._each(_core.sample_residuals, fitted, stride)
        return np.concatenate(parts), fitted.solution.residual_bound

    def largest(self, fitted: SolvedProblem) -> float:
        """The largest of all residuals of weight above 0, signs left away; constant memory."""
        found = self._each(_core.scan_residuals, fitted, self.readings)
        return max(most for _, most in found)

    def _each(self, look: Callable[..., _Look], fitted: SolvedProblem, stride: int) -> list[_Look]:
        """What the core sees in the residuals of each run that has a zero."""
        series, constant = fitted.series, fitted.solution.constant
        return [
            look(series, row, self.argument, offset - constant, stride, self.threads)
            for row, offset in zip(self.rows, fitted.offsets.tolist(), strict=True)
            if not math.isnan(offset)
        ]

    def _blocks(self, fitted: SolvedProblem, index: int) -> Iterator[Array]:
        """Residuals of one run, piece by piece."""
        run, angles = self.runs[index], self.angles[index]
        offset = fitted.offsets[index] - fitted.solution.constant
        for i in range(0, len(run), _BLOCK):
            part = slice(i, i + _BLOCK)
            indicated, reference = run.indicated[part], run.reference[part]
            block = fitted.predict(angles[part])
            if np.isnan(offset):
                offset = circular_mean(indicated - reference - block, self.period)
            _core.residuals(indicated, reference, offset, self.period, block)
            yield block


class SummedProblem(Problem):
    """The problem of readings that are known by their sums, and by some of them.

    Raises
    ------
    ArgumentError
        Angles within one turn, of a shaft that comes to another place in every turn.
    """

    summed: SummedReadings

    def __init__(
        self, summed: SummedReadings, shafts: Sequence[ShaftOrders], threads: int | None = None
    ) -> None:
        super().__init__(summed.runs, shafts, summed.argument, None, threads)
        if any(mine is not given for mine, given in zip(self.runs, summed.runs, strict=True)):
            raise ArgumentError(
                "the angles are within one turn, and a shaft is not "
                "periodic in it: one pass does not count turns. Give unwrapped "
                "angles, or fewer readings"
            )
        self.summed = summed
        self.readings = summed.readings
        self.travel = [*self.angles, summed.ends if self.is_periodic else summed.reach]

    def solve(
        self, weights: Sequence[Array | None], penalty: float = 0.0, watch: bool = False
    ) -> SolvedProblem:
        """Least squares on all readings, for any weights of those kept."""
        solution = self.summed.moments.solution(self.shafts)
        fitted = SolvedProblem(solution, solution.offsets, self.shafts, self.period)
        return self.penalised(fitted, weights, penalty) if penalty > 0.0 else fitted

    def _weight(self, weights: Sequence[Array | None]) -> float:
        return float(self.summed.moments.count)

    def products(self, weights: Sequence[Array | None], index: int) -> Array:
        """As of readings in memory."""
        moments = self.summed.moments
        orders = [k * shaft.cycles_per_turn for shaft in self.shafts for k in shaft.orders]
        steps = np.rint(np.asarray(orders) / moments.cycles).astype(np.int64)
        spectrum = moments.spectrum(moments.runs[index], int(steps.max()))
        cosine, sine = np.arange(steps.size) * 2 + 1, np.arange(steps.size) * 2 + 2
        found = np.empty((2 * steps.size + 2, 2 * steps.size + 2))
        weight, error = spectrum.weight, spectrum.error
        # cos a cos b = (cos(a - b) + cos(a + b)) / 2, and so on.
        both = np.concatenate([weight[:0:-1].conj(), weight])
        middle = weight.size - 1
        plus = 0.5 * both[middle + np.add.outer(steps, steps)]
        minus = 0.5 * both[middle + np.subtract.outer(steps, steps)]
        found[np.ix_(cosine, cosine)] = (plus + minus).real
        found[np.ix_(sine, sine)] = (minus - plus).real
        found[np.ix_(cosine, sine)] = (plus - minus).imag
        found[np.ix_(sine, cosine)] = (plus + minus).imag
        found[0, 0], found[-1, -1] = weight[0].real, spectrum.squares
        found[0, cosine], found[0, sine] = weight[steps].real, weight[steps].imag
        found[-1, cosine], found[-1, sine] = error[steps].real, error[steps].imag
        found[0, -1] = error[0].real
        found[:, 0], found[:, -1] = found[0], found[-1]
        found[-1, 0] = found[0, -1] = error[0].real
        return found
