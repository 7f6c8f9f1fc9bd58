"""The pattern's argument, local defects and missed counts."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ...joint.pattern import Surroundings
from ...joint.signals import Signals
from ...regression.regression import Extension, Regression
from ...simulation.effects import Effect
from ...simulation.effects.place import ArgumentShift, LocalDefect
from ...simulation.effects.run_level import MissedCounts
from .candidate import Array, Candidate, Parameters, golden_maximum, quantity

__all__ = ["ArgumentCandidate", "DefectCandidate", "MissedCountsCandidate"]

#: Places per turn of a shaft at which a defect is searched, and its widths in degrees.
PLACES = 1440
WIDTHS = (0.35, 0.7, 1.4, 2.8, 5.6, 11.0)

#: Degrees of its shaft beyond which a bump is not local: its Fourier series is then a few
#: low orders, which have causes of their own (order 7 falls to 1/e^2 at 16 deg).
WIDEST = 16.0

#: Peaks of the quick search that are scored exactly.
PEAKS = 2

#: Steps by which place and width are made exact.
NEWTON_STEPS = 4

#: Readings' worth of power that a bump must rest on.
LEAST_READINGS = 4.0

#: Readings a step must have on either side of it within its run, up to the next step: a
#: few readings that are off and come back are wild, no lost counts.
STEP_MARGIN = 5


class ArgumentCandidate(Candidate):
    """The pattern at the indicated angle less that at the true one: c is -1 or 0.

    Nothing is free in it, so the evidence is that of c = -1 itself and no parameter is
    paid for; c is fitted for the report only.
    """

    cause: ClassVar[str] = "argument_error"

    def propose(self, regression: Regression) -> Extension | None:
        if regression.around.pattern.orders.size == 0 or regression.has(self.cause):
            return None
        columns = regression.remembered(
            self.cause, None, lambda: self.columns(regression.signals, regression.around, {})
        )
        deviance = float(regression.fixed_gains(-columns)[0])
        return regression.propose(self.cause, {}, columns, parameters=0, deviance=deviance)

    def columns(self, signals: Signals, around: Surroundings, shape: dict[str, Any]) -> Array:
        return ArgumentShift.regressors(signals, around)

    def report(
        self, regression: Regression, terms: Sequence[tuple[Extension, Array, Array]]
    ) -> tuple[Parameters, list[Effect]]:
        _, (coefficient,), covariance = terms[0]
        std = float(np.sqrt(covariance[0, 0]))
        return {"coefficient": quantity(coefficient, std)}, [ArgumentShift(float(coefficient))]


class DefectCandidate(Candidate):
    """Regressor: a bump at a place of a shaft; place, width and shaft are searched.

    The quick search folds the residual on each shaft's turn.
    """

    cause: ClassVar[str] = "local_defect"
    located: ClassVar[bool] = True

    def propose(self, regression: Regression) -> Extension | None:
        e = regression.target - regression.design @ regression.coefficients
        e = e - regression.whiten.run_part(e)
        joint = regression.around.joint
        log_grid = float(np.log(len(joint.shafts) * 360.0))
        best: Extension | None = None
        for shaft, cycles in joint.shafts.items():
            for score, place, width in self._search(regression, cycles, e):
                shape = {"shaft": shaft, "place_deg": place, "width_deg": width}
                if not regression.hopeless(score / regression.variance, 3, log_grid):
                    shape = self._refined(regression, shaft, place, width)
                columns = self.columns(regression.signals, regression.around, shape)
                power = columns[:, 0] ** 2
                # One or two readings are wild readings, not a place of the joint.
                if power.sum() < LEAST_READINGS * power.max(initial=0.0):
                    continue
                extension = regression.propose(self.cause, shape, columns, 3, log_grid)
                if best is None or extension.deviance > best.deviance:
                    best = extension
        return best

    @staticmethod
    def _search(
        regression: Regression, cycles: float, e: Array
    ) -> list[tuple[float, float, float]]:
        phase = np.mod(regression.signals.theta * (cycles / (2.0 * np.pi)), 1.0)
        bins = np.minimum((phase * PLACES).astype(np.int64), PLACES - 1)
        count = np.bincount(bins, minlength=PLACES).astype(np.float64)
        total = np.asarray(np.bincount(bins, weights=e, minlength=PLACES))
        away = np.arange(PLACES, dtype=np.float64) * (360.0 / PLACES)
        away = np.minimum(away, 360.0 - away)
        found = []
        for width in WIDTHS:
            window = np.exp(-0.5 * (away / width) ** 2)

            moment = _circular(total - count * (total.sum() / regression.n), window)
            power = _circular(count, window**2) - _circular(count, window) ** 2 / regression.n
            seen = power > 4.0
            score = np.where(seen, moment**2 / np.where(seen, power, 1.0), 0.0)
            k = int(np.argmax(score))
            found.append((float(score[k]), (k + 0.5) * 360.0 / PLACES, width))
        found.sort(reverse=True)
        return [peak for peak in found[:PEAKS] if peak[0] > 0.0]

    def _refined(
        self, regression: Regression, shaft: str, place: float, width: float
    ) -> dict[str, Any]:
        def gain(c: float, w: float) -> float:
            shape = {"shaft": shaft, "place_deg": c, "width_deg": w}
            columns = self.columns(regression.signals, regression.around, shape)
            return float(regression.gains(columns)[0])

        for _ in range(2):
            gain_at = partial(gain, w=width)
            place, _ = golden_maximum(gain_at, place - width, place + width, 8)
            gain_of = partial(gain, place)
            log_width = float(np.log(width))
            log_width, _ = golden_maximum(
                lambda x, f=gain_of: f(float(np.exp(x))),  # type: ignore[misc]
                log_width - 0.8,
                min(log_width + 0.8, float(np.log(WIDEST))),
                8,
            )
            width = float(np.exp(log_width))
        # The searches stop at some 4 % of the width, a strong bump's place is known better.
        value = gain(place, width)
        for _ in range(NEWTON_STEPS):
            shape = {"shaft": shaft, "place_deg": place, "width_deg": width}
            x, excited = regression.projected(self._tangents(regression, shape, 1.0))
            if not excited.all():
                break
            height, *moves = np.linalg.lstsq(x, regression.r, rcond=1e-10)[0]
            step = np.clip(np.array(moves) / height, -0.3 * width, 0.3 * width)
            following = gain(place + step[0], min(width + step[1], WIDEST))
            if not following > value:
                break
            place, width, value = place + step[0], min(width + step[1], WIDEST), following
        return {"shaft": shaft, "place_deg": float(place % 360.0), "width_deg": float(width)}

    def _tangents(self, regression: Regression, shape: dict[str, Any], height: float) -> Array:
        """The bump and, for its ``height``, its derivatives by place and width."""
        step = 0.05 * shape["width_deg"]

        def bump(**change: float) -> Array:
            return self.columns(regression.signals, regression.around, {**shape, **change})[:, 0]

        place, width = shape["place_deg"], shape["width_deg"]
        return np.column_stack(
            [
                bump(),
                height * (bump(place_deg=place + step) - bump(place_deg=place - step)) / (2 * step),
                height * (bump(width_deg=width + step) - bump(width_deg=width - step)) / (2 * step),
            ]
        )

    def columns(self, signals: Signals, around: Surroundings, shape: dict[str, Any]) -> Array:
        cycles = around.joint.output_order(shape["shaft"], 1)
        phase = signals.theta * cycles
        return LocalDefect.bump(phase, shape["place_deg"], shape["width_deg"])[:, None]

    def report(
        self, regression: Regression, terms: Sequence[tuple[Extension, Array, Array]]
    ) -> tuple[Parameters, list[Effect]]:
        extension, (height,), _ = terms[0]
        shape = extension.shape
        # Place, width and height together.
        columns = self._tangents(regression, shape, float(height))
        others = [term for term in regression.terms if term is not extension]
        x, _ = regression.with_terms(others).projected(columns)
        std = np.sqrt(regression.variance * np.diag(np.linalg.pinv(x.T @ x)))
        place, width = shape["place_deg"], shape["width_deg"]
        parameters = {
            "place_deg": quantity(place, std[1]),
            "width_deg": quantity(width, std[2]),
            "height_arcsec": quantity(height, std[0]),
            "shaft": quantity(shape["shaft"]),
        }
        return parameters, [LocalDefect(place, width, float(height), shape["shaft"])]


def _circular(x: NDArray[Any], window: Array) -> Array:
    """Sum of ``x`` under a symmetric window put at every place of the turn."""
    return np.asarray(np.fft.irfft(np.fft.rfft(x) * np.fft.rfft(window), PLACES))


class MissedCountsCandidate(Candidate):
    """Regressor: one from a row of a run to the run's end; both are searched."""

    cause: ClassVar[str] = "missed_counts"
    located: ClassVar[bool] = True

    def propose(self, regression: Regression) -> Extension | None:
        e = regression.target - regression.design @ regression.coefficients
        scores, places = [], []
        near = np.zeros(regression.n, dtype=bool)
        for term in regression.terms:
            if term.cause == self.cause:
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
                columns = self.columns(regression.signals, regression.around, shape)
                extension = regression.propose(
                    self.cause, shape, columns, 2, float(np.log(regression.signals.runs))
                )
                if best_extension is None or extension.deviance > best_extension.deviance:
                    best_extension = extension
        return best_extension

    def columns(self, signals: Signals, around: Surroundings, shape: dict[str, Any]) -> Array:
        after = (signals.run == shape["run"]) & (signals.row >= shape["row"])
        return np.asarray(after.astype(np.float64)[:, None])

    def report(
        self, regression: Regression, terms: Sequence[tuple[Extension, Array, Array]]
    ) -> tuple[Parameters, list[Effect]]:
        rows = [(float(c[0]), float(np.sqrt(v[0, 0])), t.shape) for t, c, v in terms]
        labels = regression.signals.labels

        def one(values: list[Any]) -> Any:
            return values[0] if len(values) == 1 else values

        parameters = {
            "step_arcsec": quantity(one([row[0] for row in rows]), one([row[1] for row in rows])),
            "run": quantity(one([labels[row[2]["run"]] for row in rows])),
            "row": quantity(one([row[2]["row"] for row in rows])),
        }
        return parameters, [MissedCounts(row[0], row[2]["run"], row[2]["row"]) for row in rows]
