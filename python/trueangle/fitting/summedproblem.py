"""The least-squares problem of readings too many to keep."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from ..errors import ArgumentError
from ..joint.shafts import ShaftOrders
from ..support.arrays import Array
from .orders.harmonicsums import HarmonicSums
from .problem import Problem, SolvedProblem
from .summed import SummedReadings


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
