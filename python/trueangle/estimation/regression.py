"""Readings, the terms chosen so far, and what candidates would add to them."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import dataclass, field, replace
from typing import Any, Self, TypeVar

import numpy as np
from numpy.typing import NDArray

from ..joint.pattern import JointPattern
from ..joint.signals import Signals
from ..support.arrays import Array
from .cache import Cache
from .extension import Extension as Extension
from .lines import LineBasis
from .projection import ROUNDING as ROUNDING
from .readings import Readings
from .solution import Solution, fields_of_solution
from .whitening import RunEffect

#: Places of a turn at most, and readings per pass and place on average.
MOST_PLACES, PER_CELL = 180, 2


def repeated_part(residual: Array, signals: Signals, by_direction: bool = False) -> Array:
    """The part of a residual that is the same on every pass of a place.

    A pass is a segment of one direction in one run. With the means of cells (place i,
    pass j), each pass about its own mean, the places differ if

    ::

        F = Σ_ij ē_i² / (I - 1) / (Σ_ij (e_ij - ē_i)² / (IJ - I - J)) > 4

    Noise that is correlated in time differs from pass to pass; an error that is a
    function of angle does not, and its neighbours in time are similar for that reason.

    Parameters
    ----------
    residual : ndarray, shape (n,)
    signals : Signals
    by_direction : bool
        A place counts as another one in the other direction; each run, not each pass, is
        taken about its mean.

    Returns
    -------
    ndarray, shape (n,)
        Mean of the place over passes; zeros where nothing repeats or no place was
        passed twice. About 1 ms for 10 000 readings.
    """
    nothing = np.zeros_like(residual)
    _, passed = np.unique(signals.segment, return_inverse=True)
    passes = int(passed.max()) + 1
    _, unit = np.unique(signals.run if by_direction else signals.segment, return_inverse=True)
    turn = np.mod(signals.theta / (2.0 * np.pi), 1.0)
    low, high = float(turn.min()), float(turn.max())
    places = min(residual.size // (PER_CELL * passes), MOST_PLACES)
    if passes < 2 or places < 4 or high <= low:
        return nothing
    place = np.minimum(((turn - low) / (high - low) * places).astype(np.int64), places - 1)
    if by_direction:
        place, places = 2 * place + (signals.direction > 0.0), 2 * places
    centred = residual - (np.bincount(unit, residual) / np.bincount(unit))[unit]
    cell, cells = place * passes + passed, places * passes
    count = np.bincount(cell, minlength=cells).reshape(-1, passes)
    total = np.bincount(cell, centred, minlength=cells).reshape(-1, passes)
    seen = count > 0
    mean = total / np.maximum(count, 1)
    visits = seen.sum(axis=1)
    again = visits > 1
    freedom = int(seen[again].sum()) - int(again.sum()) - int(unit.max()) - 1
    if freedom < 4:
        return nothing
    common = np.where(again, mean.sum(axis=1) / np.maximum(visits, 1), 0.0)
    between = float(visits[again] @ common[again] ** 2) / max(int(again.sum()) - 1, 1)
    within = float((((mean - common[:, None]) ** 2)[again][seen[again]]).sum()) / freedom
    # Variance of the places' means over that of what varies between passes (an F ratio) from which
    # on the residual counts as repeated.
    return np.asarray(common[place]) if between > 4.0 * within else nothing


T = TypeVar("T")

#: Times the standard deviation of the residual beyond which no cause is as large.
BEYOND_SHOWN = 3.0


@dataclass(frozen=True, eq=False, kw_only=True)
class Regression(Solution):
    """A fit of readings, and proposals of causes in addition to its terms.

    Attributes
    ----------
    start : float
        `deviance` without any term.
    least : float
        Evidence below which no candidate matters: searches that stay below it may end early.
    cache : Cache
        Of no consequence for any figure.
    """

    start: float
    least: float = 0.0
    cache: Cache = field(default_factory=Cache)

    @classmethod
    def of(
        cls,
        signals: Signals,
        residual: Array,
        belief: JointPattern,
        weights: Array | None = None,
        lines: LineBasis | None = None,
        rho: float | None = None,
        beside: Array | None = None,
    ) -> Self:
        """The regression of readings without terms; see `Readings`."""
        lines = LineBasis.of(signals.theta, belief.joint) if lines is None else lines
        return cls.of_readings(Readings(signals, residual, belief, lines, weights, beside), rho)

    @classmethod
    def of_readings(
        cls,
        readings: Readings,
        rho: float | None = None,
        cache: Cache | None = None,
        before: Solution | None = None,
    ) -> Self:
        """The regression of readings without terms, of noise of this correlation if given."""
        solution = Solution.solve(readings, rho=rho, before=before)
        cache = Cache() if cache is None else cache
        return cls(**fields_of_solution(solution, Solution), start=solution.deviance, cache=cache)

    # -- other regressions -------------------------------------------------------

    def with_terms(self, terms: Iterable[Extension], rho: float | None = None) -> Self:
        """The same readings with other terms (and this correlation of the noise)."""
        fixed, terms = self.fixed_rho if rho is None else rho, tuple(terms)

        def build() -> tuple[Solution, int]:
            found = Solution.solve(self.readings, terms, fixed, self)
            return found, found.size + self.size

        solution = self.cache.fit((fixed, terms), build)
        return self.with_solution(solution, least=0.0, cache=self.cache.for_other_terms())

    def with_evidence(self, terms: Iterable[Extension]) -> Self:
        """The same terms with another deviance, for example."""
        terms = tuple(terms)
        if sum(term.run_effect is not None for term in terms) > 1:
            return self.with_terms(terms)  # ratios of variance settle among each other
        return replace(self, terms=terms, cache=self.cache.for_other_terms())

    def with_least(self, least: float) -> Self:
        """The same where only candidates of more evidence matter.

        No figure depends on that: what searches need of a fit is computed once for all causes.
        """
        if least == self.least:
            return self
        _ = self.beside, self.left, self.around
        other = object.__new__(type(self))
        other.__dict__.update(self.__dict__, least=least)
        return other

    def weighted(self, weights: Array) -> Self:
        """The readings without terms under other weights.

        What terms explain is counted from the likeliest noise without any, even or uneven: where
        what they explain is still in the readings, a spurious correlation may describe it.
        """
        readings = replace(self.readings, weights=weights)
        found = self.of_readings(readings, cache=self.cache.for_other_errors())
        return replace(found, start=min(self.start, found.start + self.start - self.deviance))

    def of_rows(self, rows: NDArray[np.bool_]) -> Self:
        """Some of the readings without terms, under the correlation found in all."""
        return self.of_readings(self.readings.take(rows), self.whiten.rho)

    def without_repeats(self, by_direction: bool = False) -> Self:
        """The regression without what repeats at the same place; itself where nothing does."""
        left = np.where(self.outlying, 0.0, self.left)
        repeated = repeated_part(left, self.signals, by_direction)
        if not repeated.any():
            return self
        solution = Solution.solve(self.readings.less(repeated), self.terms, self.fixed_rho, self)
        start = self.start + solution.deviance - self.deviance
        return self.with_solution(solution, start=start, cache=self.cache.for_other_errors())

    def jointly_with(self, columns: Array, spread: float = np.inf) -> Self:  # noqa: D102
        joint = super().jointly_with(columns, spread)
        return replace(joint, cache=self.cache.for_other_errors())

    def of_target(self, target: Array) -> Self:  # noqa: D102
        return replace(super().of_target(target), cache=self.cache.for_other_errors())

    # -- candidates --------------------------------------------------------------

    def line_gains(self) -> Array:
        """Deviance that a line of each order of `lines` saves (two coefficients)."""
        return self.pair_gains(self.lines.products)

    def of_pattern(self, name: str, key: object, build: Callable[[], T]) -> T:
        """`Cache.of_motion` of what depends on the pattern, too."""
        pattern = self.around.pattern
        parts = (pattern.orders, pattern.cosine, pattern.sine)
        key = (key, *(part.tobytes() for part in parts))
        return self.cache.of_motion(name, key, build)

    def propose(
        self,
        cause: str,
        shape: dict[str, Any],
        columns: Array,
        parameters: int | None = None,
        log_grid: float = 0.0,
        deviance: float | None = None,
        line: float | None = None,
    ) -> Extension:
        """Extension of regressors with their evidence in this regression.

        None is given for an error larger than the readings show: it would only be there to
        be subtracted again by another one.
        """
        saved, coefficients = self.gain(columns)
        error = columns @ coefficients
        spread = float(error @ error) / self.n - float(error.mean()) ** 2
        if spread > (BEYOND_SHOWN * self.readings.scatter) ** 2:
            saved = 0.0
            deviance = None if deviance is None else 0.0
        return Extension(
            cause,
            shape,
            columns,
            columns.shape[1] if parameters is None else parameters,
            log_grid,
            saved if deviance is None else deviance,
            self.log_n,
            coefficients=coefficients,
            line=line,
        )

    def propose_run_effect(
        self,
        cause: str,
        shape: dict[str, Any],
        columns: Array,
        log_grid: float = 0.0,
    ) -> Extension:
        """Extension of a run effect with its evidence in this regression."""
        ratio, deviance = self.ratio_of(columns)
        return Extension(
            cause,
            shape,
            np.zeros((self.n, 0)),
            1,
            log_grid,
            deviance,
            self.readings.log_runs,
            RunEffect(columns, ratio),
        )

    def is_pruned(self, deviance: float, parameters: int, log_grid: float = 0.0) -> bool:
        """A coarse search this far below its penalty gains nothing by refining."""
        return 1.5 * deviance + 10.0 < parameters * self.log_n + 2.0 * log_grid

    def is_dominated(self, deviance: float, parameters: int, log_grid: float = 0.0) -> bool:
        """A coarse search so far below `least` is not refined to what another one explains."""
        needed = parameters * self.log_n + 2.0 * log_grid + self.least
        # Times what a coarse search finds that the refined one may. Where the noise is correlated a
        # search that does not whiten has its peaks elsewhere: a factor of three was observed.
        return self.least > 0.0 and 4.0 * deviance + 10.0 < needed
