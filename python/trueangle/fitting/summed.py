"""Readings too many to keep: sums over all of them, and some as they are."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np

from ..errors import ArgumentError
from ..estimation.linear import NormalEquations
from ..estimation.moments import Moments
from ..joint.shafts import ShaftOrders
from ..model.model import Argument
from ..runs.run import CalibrationRun
from ..support.arrays import Array
from .orders.harmonicsums import HarmonicSums
from .orders.unitgroups import MOST_UNITS
from .problem import Fitted, Problem

#: Orders this close to a whole multiple of the base shaft are one.
_WHOLE = 1e-9


@dataclass(frozen=True, eq=False)
class Summed:
    """What one pass over readings keeps of them.

    Attributes
    ----------
    moments : Moments
        Of all readings but the outliers, run by run.
    runs : tuple of CalibrationRun
        Some readings of every run, in their order: blocks at random.
    ends, reach : ndarray
        Angles that hold both ends of the travel of all readings, within a turn and over the turns.
    argument : {"reference", "indicated"}
        The angle of the moments.
    readings, missing : int
        All readings, and rows of the files that an empty cell kept out.
    outliers : tuple of (str, int)
        Label and row of every reading that was set aside.
    """

    moments: Moments
    runs: tuple[CalibrationRun, ...]
    ends: Array
    reach: Array
    argument: Argument
    readings: int
    missing: int
    outliers: tuple[tuple[str, int], ...] = ()

    def sums(self, orders: Sequence[float]) -> HarmonicSums:
        """Normal equations of orders, run by run, from all readings."""
        return sums_of_moments(self.moments, orders)

    def parts(self, orders: Array, share: float) -> Iterator[NormalEquations]:
        """Normal equations of every run as a share of its readings would have them."""
        sums = self.sums(orders.tolist())
        every = range(len(orders))
        for unit in range(sums.units):
            yield sums.equations(unit, every).share(share)

    @property
    def note(self) -> str:
        """What one pass cannot know, in one sentence."""
        kept = sum(map(len, self.runs))
        return (
            f"the coefficients, their evidence and the span are of all {self.readings} readings, "
            "in one pass; what needs readings in their order (positions, repeats, correlation, "
            f"the ridge) is estimated from {kept} of them, taken in blocks at random"
        )


class SummedProblem(Problem):
    """The problem of readings that are known by their sums, and by some of them.

    Raises
    ------
    ArgumentError
        Angles within one turn, of a shaft that comes to another place in every turn.
    """

    summed: Summed

    def __init__(
        self, summed: Summed, shafts: Sequence[ShaftOrders], threads: int | None = None
    ) -> None:
        super().__init__(summed.runs, shafts, summed.argument, None, threads)
        if any(mine is not given for mine, given in zip(self.runs, summed.runs, strict=True)):
            raise ArgumentError(
                "the angles lie within one turn, and a shaft does not turn a whole number of times "
                "in it: turns would have to be counted, which one pass does not; give the angles "
                "over all turns, or fewer readings"
            )
        self.summed = summed
        self.readings = summed.readings
        self.travel = [*self.angles, summed.ends if self.is_periodic else summed.reach]

    def solve(
        self, weights: Sequence[Array | None], penalty: float = 0.0, watch: bool = False
    ) -> Fitted:
        """Least squares on all readings, whatever the weights of those kept."""
        solution = self.summed.moments.solution(self.shafts)
        fitted = Fitted(solution, solution.offsets, self.shafts, self.period)
        return self.penalised(fitted, weights, penalty) if penalty > 0.0 else fitted

    def _weight(self, weights: Sequence[Array | None]) -> float:
        return float(self.summed.moments.count)

    def products(self, weights: Sequence[Array | None], index: int, count: int) -> list[Array]:
        """As of readings in memory; of whole runs only."""
        if count != 1:
            raise ArgumentError(
                "one pass does not keep segments of runs: take covariance='cluster'"
            )
        moments = self.summed.moments
        orders = [k * shaft.cycles_per_turn for shaft in self.shafts for k in shaft.orders]
        steps = np.rint(np.asarray(orders) / moments.cycles).astype(np.int64)
        spectrum = moments.spectrum(moments.runs[index], int(steps.max()))
        cosine, sine = np.arange(steps.size) * 2 + 1, np.arange(steps.size) * 2 + 2
        found = np.empty((2 * steps.size + 2, 2 * steps.size + 2))
        weight, error = spectrum.weight, spectrum.error
        turned = np.concatenate([cosine, sine])
        found[np.ix_(turned, turned)] = HarmonicSums.whole(weight, *2 * [steps.astype(np.float64)])
        found[0, 0], found[-1, -1] = weight[0].real, spectrum.squares
        found[0, cosine], found[0, sine] = weight[steps].real, weight[steps].imag
        found[-1, cosine], found[-1, sine] = error[steps].real, error[steps].imag
        found[0, -1] = error[0].real
        found[:, 0], found[:, -1] = found[0], found[-1]
        found[-1, 0] = found[0, -1] = error[0].real
        return [found]


def sums_of_moments(moments: Moments, orders: Sequence[float]) -> HarmonicSums:
    """Normal equations of output orders, run by run, each run's mean taken out.

    With ``W_m = Σ w e^(imx)``, ``Y_m = Σ w y e^(imx)`` and the mean
    ``ȳ = Y₀ / W₀``, the sums about the mean are ``Y_m - ȳ W_m`` and
    ``Σ w y² - ȳ Y₀``. More than 96 runs are taken together in 32 groups.

    Raises
    ------
    ArgumentError
        Orders that are not whole multiples of the base shaft.
    """
    steps = np.asarray(orders, dtype=np.float64) / moments.cycles
    index = np.rint(steps).astype(np.int64)
    if index.size and np.abs(steps - index).max() > _WHOLE * np.abs(steps).max():
        raise ArgumentError(
            "orders are judged in one pass where all shafts turn a whole number of times in the "
            "turns after which they are back together: fit in memory, or give orders of the others"
        )
    highest = int(index.max(initial=1))
    spectra = [moments.spectrum(run, highest) for run in moments.runs]
    weights = np.array([spectrum.weight[: 2 * highest + 1] for spectrum in spectra])
    errors = np.array([spectrum.error for spectrum in spectra])
    total, first = weights[:, 0].real, errors[:, 0].real
    mean = first / total
    centred = errors[:, index] - mean[:, None] * weights[:, index]
    picked = weights[:, index] / total[:, None]
    squares = np.array([spectrum.squares for spectrum in spectra]) - mean * first
    sums = HarmonicSums(
        index.astype(np.float64).tolist(),
        total,
        np.array([spectrum.samples for spectrum in spectra]),
        np.maximum(squares, 0.0),
        np.concatenate([centred.real, centred.imag], axis=1),
        None,
        weights,
        np.concatenate([picked.real, picked.imag], axis=1),
    )
    sums = sums if sums.units <= MOST_UNITS else sums.in_groups()
    # The spectra count cycles of the base shaft, those who read the sums those of the output.
    return sums.named(orders)
