"""What is fitted: errors, the signals of their readings, and the assumed model of the joint."""

from __future__ import annotations

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from ..joint.pattern import JointPattern, line_columns
from ..joint.signals import Signals
from ..support.arrays import Array
from .extension import penalty_of_parameter
from .lines import LineBasis
from .rounded import MOST_SHARE
from .whitening import LagCorrelation

#: What does not depend on the errors.
OF_MOTION = ("bounds", "base", "correlation", "root_weights", "log_n", "log_runs")

#: Runs from which they, and not the readings, are what informs on a variance between runs.
ENOUGH_RUNS = 8


@dataclass(frozen=True, eq=False)
class Readings:
    """Readings and what the simulation expects of them.

    Attributes
    ----------
    signals : Signals
    residual : ndarray
        Measured minus simulated error, arcsec, unfolded.
    belief : Surroundings
        The joint and the pattern that the simulation assumes.
    lines : LineBasis
        Shared by readings of the same motion.
    weights : ndarray or None
    beside : ndarray or None
        Further columns that are always free, shape (n, k).
    """

    signals: Signals
    residual: Array
    belief: JointPattern
    lines: LineBasis
    weights: Array | None = None
    beside: Array | None = None

    def __len__(self) -> int:
        return len(self.signals)

    @cached_property
    def bounds(self) -> list[tuple[int, int]]:
        """The runs."""
        return self.signals.run_bounds()

    @cached_property
    def base(self) -> Array:
        """Columns that are always free: a constant, the lines of the pattern, those `beside`."""
        lines = [line_columns(self.signals.theta, m) for m in self.belief.pattern.orders]
        beside = [] if self.beside is None else [self.beside]
        return np.column_stack([np.ones(len(self)), *lines, *beside])

    @cached_property
    def correlation(self) -> LagCorrelation:
        """Correlation of neighbours among residuals of these readings."""
        return LagCorrelation(self.signals.clock, self.bounds)

    @cached_property
    def scatter(self) -> float:
        """Standard deviation of the residuals."""
        return float(np.std(self.residual))

    @cached_property
    def rounding(self) -> float:
        """Standard deviation of the rounding to the sensor's counts, arcsec.

        0 where it is more than all residuals are: such steps are none of the sensor's.
        """
        rounding = self.signals.count / float(np.sqrt(12.0))
        return rounding if rounding**2 < MOST_SHARE * self.scatter**2 else 0.0

    @cached_property
    def root_weights(self) -> Array:
        """Square roots of the weights."""
        return np.ones(len(self)) if self.weights is None else np.sqrt(self.weights)

    @cached_property
    def log_n(self) -> float:
        """What a coefficient costs, in units of BIC."""
        return penalty_of_parameter(len(self))

    @cached_property
    def log_runs(self) -> float:
        """What a variance between runs costs."""
        runs = len(self.bounds)
        return float(np.log(runs)) if runs >= ENOUGH_RUNS else self.log_n

    def less(self, error: Array) -> Readings:
        """The readings with a known error subtracted; what follows from the motion is kept."""
        other = replace(self, residual=self.residual - error)
        made = vars(self)
        vars(other).update((name, made[name]) for name in OF_MOTION if name in made)
        return other

    def take(self, rows: NDArray[np.bool_]) -> Readings:
        """Some of the readings."""
        return Readings(
            self.signals.take(rows),
            self.residual[rows],
            self.belief,
            self.lines.take(rows),
            None if self.weights is None else self.weights[rows],
            None if self.beside is None else self.beside[rows],
        )
