"""A step that stays until the end of a run."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from ..estimation.extension import Extension
from ..estimation.quantity import quantity
from ..estimation.regression import Regression
from ..joint.pattern import JointPattern
from ..joint.signals import Signals
from .drawing import Drawing
from .effect import ALWAYS, Effect, Reported
from .search import Array, Fitted

#: Readings a step must have on either side of it within its run, up to the next step: a
#: few readings that are off and come back are outliers, no lost counts.
STEP_MARGIN = 5


@dataclass(frozen=True)
class MissedCounts(Effect):
    """A step that stays until the end of its run.

    Parameters
    ----------
    step_arcsec : float
    run : int
        Index of the run, from 0.
    row : int
        First row after the step, from 0.
    """

    step_arcsec: float
    run: int
    row: int

    kind: ClassVar[str] = "missed_counts"
    sentence: ClassVar[str] = (
        "Counts or whole periods were lost at one moment: from there to the end of the run "
        "every reading is off by the same step."
    )
    factor: ClassVar[str] = "time"
    form_of: ClassVar[tuple[str, ...]] = ("run", "run_time")
    measure: ClassVar[str] = "more readings before and after in one run, closing at the start angle"
    transfers: ClassVar[bool] = False
    located: ClassVar[bool] = True
    flexible_below: ClassVar[float] = ALWAYS
    draws_zeros: ClassVar[bool] = True
    has_exact_form: ClassVar[bool] = True
    not_at_run_time: ClassVar[str] = "a step shows only afterwards; remove it in the log"

    def signal(self, signals: Signals, around: JointPattern, rng: np.random.Generator) -> Array:
        after = (signals.run == self.run) & (signals.row >= self.row)
        return np.asarray(self.step_arcsec * after)

    @classmethod
    def drawn(cls, size: float, of: Drawing) -> Self | None:
        bounds = of.signals.run_bounds()
        run = of.whole(0, len(bounds))
        start, stop = bounds[run]
        return cls(size, run, int((stop - start) * of.between(0.2, 0.8)))

    @classmethod
    def propose(cls, regression: Regression) -> Extension | None:
        e = regression.target - regression.design @ regression.coefficients
        scores, places = [], []
        near = np.zeros(regression.n, dtype=bool)
        for term in regression.terms:
            if term.cause == cls.kind:
                away = np.abs(regression.signals.row - term.shape["row"])
                near |= (regression.signals.run == term.shape["run"]) & (away < STEP_MARGIN)
        for start, stop in regression.bounds:
            n = stop - start
            if n < 2 * STEP_MARGIN + 1:
                continue
            part = e[start:stop]
            k = np.arange(1, n)
            after = part.sum() - np.cumsum(part)[:-1]
            inside = slice(STEP_MARGIN - 1, n - STEP_MARGIN)
            own_zero = (after - (n - k) * part.mean()) ** 2 * n / (k * (n - k))
            common_zero = after**2 / (n - k)
            for score in (own_zero[inside], common_zero[inside]):
                best = int(np.argmax(score * ~near[start + 1 : stop][inside]))
                scores.append(float(score[best]))
                places.append((start, start + STEP_MARGIN + best, stop))
        best_extension: Extension | None = None
        for j in np.argsort(scores)[::-1][:6]:
            start, at, stop = places[int(j)]
            for row in {at - 1, at, at + 1}:
                if not start < row < stop or near[row]:
                    continue
                shape = {
                    "run": int(regression.signals.run[row]),
                    "row": int(regression.signals.row[row]),
                }
                columns = cls.columns(regression.signals, regression.around, shape)
                extension = regression.propose(
                    cls.kind, shape, columns, 2, float(np.log(regression.signals.runs))
                )
                # Less than a count is no count.
                # Share of a count of the reading that a step must have.
                if abs(extension.coefficients[0]) < 0.9 * regression.signals.count:
                    continue
                if best_extension is None or extension.deviance > best_extension.deviance:
                    best_extension = extension
        return best_extension

    @classmethod
    def columns(cls, signals: Signals, around: JointPattern, shape: dict[str, Any]) -> Array:
        after = (signals.run == shape["run"]) & (signals.row >= shape["row"])
        return np.asarray(after.astype(np.float64)[:, None])

    @classmethod
    def form_columns(cls, signals: Signals, terms: Sequence[tuple[Extension, Array]]) -> Array:
        # Counts are equal: steps are whole multiples of the sensor's, or of the smallest. What is
        # taken back in the same run is no lost count.
        sizes = np.array([float(coefficients[0]) for _, coefficients in terms])
        runs = np.array([term.shape["run"] for term, _ in terms])
        count = signals.count or float(np.abs(sizes).min())
        whole = np.maximum(np.round(np.abs(sizes) / count), 1.0)
        total = (runs[:, None] == runs) @ sizes
        whole = np.sign(sizes) * whole * (np.sign(total) == np.sign(sizes))
        return np.asarray(np.hstack([term.columns for term, _ in terms]) @ whole)[:, None]

    @classmethod
    def report(cls, regression: Regression, terms: Sequence[Fitted]) -> Reported:
        rows = sorted((t.shape["run"], t.shape["row"], c[0], v[0, 0] ** 0.5) for t, c, v in terms)

        def one(values: Any) -> Any:
            return values[0] if len(values) == 1 else [*values]

        runs, places, steps, errors = zip(*rows, strict=True)
        parameters = {
            "step_arcsec": quantity(one(steps), one(errors)),
            "run": quantity(one([regression.signals.labels[run] for run in runs])),
            "row": quantity(one(places)),
        }
        return parameters, [MissedCounts(step, run, row) for run, row, step, _ in rows]
