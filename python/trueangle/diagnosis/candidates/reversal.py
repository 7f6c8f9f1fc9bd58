"""Backlash and presliding hysteresis."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from ...joint.pattern import Surroundings, line_columns
from ...joint.signals import Signals
from ...regression.regression import Extension, Regression
from ...simulation.effects import Effect
from ...simulation.effects.reversal import Backlash, PreslidingHysteresis
from .candidate import (
    Array,
    Candidate,
    Parameters,
    golden_maximum,
    line_parameters,
    quantity,
)

__all__ = ["BacklashCandidate", "HysteresisCandidate"]

#: Elements of a Maxwell-slip model at most, and the ratio of lengths that keeps them apart.
MOST_ELEMENTS = 3
APART = 2.5

#: Orders of the angle with which play may vary from place to place.
PLACE_ORDERS = (1, 2, 3)

#: Transition lengths searched, degrees.
LENGTHS = np.geomspace(0.15, 60.0, 15)


class BacklashCandidate(Candidate):
    """Regressor: the direction of travel; then its product with low orders of the angle."""

    cause: ClassVar[str] = "backlash"

    def propose(self, regression: Regression) -> Extension | None:
        if regression.has("presliding_hysteresis"):
            return None
        shapes: list[dict[str, Any]] = [{"order": 0}]
        if regression.has(self.cause):
            shapes = [{"order": k} for k in PLACE_ORDERS]
        log_grid = float(np.log(len(shapes)))
        extensions = [
            regression.propose(
                self.cause,
                shape,
                self.columns(regression.signals, regression.around, shape),
                log_grid=log_grid,
            )
            for shape in shapes
        ]
        return max(extensions, key=lambda p: p.bic_gain)

    def columns(self, signals: Signals, around: Surroundings, shape: dict[str, Any]) -> Array:
        return _play_columns(signals, shape["order"])

    def report(
        self, regression: Regression, terms: Sequence[tuple[Extension, Array, Array]]
    ) -> tuple[Parameters, list[Effect]]:
        width, std = 0.0, 0.0
        for extension, coefficients, covariance in terms:
            if _everywhere(extension):
                width, std = float(coefficients[0]), float(np.sqrt(covariance[0, 0]))
        lines = _place_lines(terms)
        parameters = {"half_width_arcsec": quantity(width, std)} | _place_parameters(lines)
        return parameters, [Backlash(width, tuple((m, a, p) for m, a, p, _, _ in lines))]


class HysteresisCandidate(Candidate):
    """Regressor: the state of a presliding spring, its length searched.

    A second and third element (Maxwell-slip) may follow, one of no length (play), and play
    that varies with the place.
    """

    cause: ClassVar[str] = "presliding_hysteresis"
    family: ClassVar[tuple[str, ...]] = ("backlash",)
    located: ClassVar[bool] = True

    def propose(self, regression: Regression) -> Extension | None:
        signals = regression.signals
        if np.ptp(signals.direction) == 0.0 and not signals.travel.any():
            return None
        best: tuple[float, float, float] | None = None
        for start in (0.0, 1.0):
            columns = regression.remembered(
                f"presliding {start}",
                None,
                lambda start=start: np.column_stack(  # type: ignore[misc]
                    [signals.presliding(length, start) for length in LENGTHS]
                ),
            )
            gains = regression.gains(columns)
            k = int(np.argmax(gains))
            if best is None or gains[k] > best[0] + 1e-9:
                best = (float(gains[k]), float(LENGTHS[k]), start)
        assert best is not None
        gain, length, start = best
        present = [
            term.shape["length_deg"]
            for term in regression.terms
            if term.cause == self.cause and _everywhere(term)
        ]
        if gain <= 0.0 or len(present) >= MOST_ELEMENTS:
            return None
        step = np.log(LENGTHS[1] / LENGTHS[0])
        log_length, _ = golden_maximum(
            lambda x: float(regression.gains(signals.presliding(np.exp(x), start)[:, None])[0]),
            np.log(length) - step,
            np.log(length) + step,
        )
        shape = {"length_deg": float(np.exp(log_length)), "start_state": start}
        columns = self.columns(signals, regression.around, shape)
        extension = regression.propose(
            self.cause, shape, columns, parameters=2, log_grid=np.log(2.0)
        )
        if not regression.has(self.cause):
            return extension
        # What may follow: play, play that varies with the place, another element.
        further = [self._play(regression, order) for order in (0, *PLACE_ORDERS)]
        apart = all(
            other == 0.0 or abs(np.log(shape["length_deg"] / other)) > np.log(APART)
            for other in present
        )
        if apart:
            further.append(extension)
        further.sort(key=lambda p: -p.bic_gain)
        return next(
            (p for p in further if p.bic_gain > 0.0 and self._pulls_back(regression, p)), None
        )

    def _pulls_back(self, regression: Regression, extension: Extension) -> bool:
        """With this term all elements have one sign, as springs have.

        Elements of unlike signs would only be a difference of two that are alike.
        """
        after = regression.coefficients_with(extension)
        elements = [float(extension.coefficients[0])] if _everywhere(extension) else []
        at = regression.base.shape[1]
        for term in regression.terms:
            if term.cause == self.cause and _everywhere(term):
                elements.append(float(after[at]))
            at += term.columns.shape[1]
        return not elements or min(elements) * max(elements) > 0.0

    def _play(self, regression: Regression, order: int) -> Extension:
        shape = {"length_deg": 0.0, "order": order}
        columns = self.columns(regression.signals, regression.around, shape)
        log_grid = float(np.log(len(PLACE_ORDERS))) if order else 0.0
        return regression.propose(self.cause, shape, columns, log_grid=log_grid)

    def columns(self, signals: Signals, around: Surroundings, shape: dict[str, Any]) -> Array:
        if shape["length_deg"] == 0.0:
            return _play_columns(signals, shape["order"])
        return signals.presliding(shape["length_deg"], shape["start_state"])[:, None]

    def report(
        self, regression: Regression, terms: Sequence[tuple[Extension, Array, Array]]
    ) -> tuple[Parameters, list[Effect]]:
        lines = _place_lines(terms)
        terms = [term for term in terms if _everywhere(term[0])]
        total = sum(float(c[0]) for _, c, _ in terms)
        std = float(np.sqrt(sum(v[0, 0] for _, _, v in terms)))
        weights = np.array([abs(float(c[0])) for _, c, _ in terms])
        lengths = np.array([t.shape["length_deg"] for t, _, _ in terms])
        length = float(weights @ lengths / weights.sum()) if terms else 0.0
        effects: list[Effect] = [
            PreslidingHysteresis(float(c[0]), t.shape["length_deg"], t.shape["start_state"])
            if t.shape["length_deg"] > 0.0
            else Backlash(float(c[0]))
            for t, c, _ in terms
        ]
        if lines:
            effects.append(Backlash(0.0, tuple((m, a, p) for m, a, p, _, _ in lines)))
        parameters = {
            "amplitude_arcsec": quantity(total, std),
            "length_deg": quantity(
                length,
                self._length_std(regression, terms[int(np.argmax(weights))]) if terms else None,
            ),
        }
        if len(terms) > 1:
            parameters["element_lengths_deg"] = quantity(lengths)
            parameters["element_amplitudes_arcsec"] = quantity([float(c[0]) for _, c, _ in terms])
        return parameters | _place_parameters(lines), effects

    def _length_std(
        self, regression: Regression, term: tuple[Extension, Array, Array]
    ) -> float | None:
        """From the curvature: the column's derivative by ln L, all else projected out."""
        extension, coefficients, _ = term
        length = extension.shape["length_deg"]
        if length == 0.0:
            return None
        start, signals, step = extension.shape["start_state"], regression.signals, 0.02
        derivative = (
            coefficients[0]
            * (
                signals.presliding(length * np.exp(step), start)
                - signals.presliding(length * np.exp(-step), start)
            )
            / (2.0 * step)
        )
        x, _ = regression.projected(derivative[:, None])
        information = float(x[:, 0] @ x[:, 0])
        return (
            length * float(np.sqrt(regression.variance / information)) if information > 0 else None
        )


def _everywhere(term: Extension) -> bool:
    """The term is the same at every place."""
    return not term.shape.get("order")


def _play_columns(signals: Signals, order: int) -> Array:
    if order == 0:
        return signals.direction[:, None]
    return signals.direction[:, None] * line_columns(signals.theta, order)


def _place_lines(
    terms: Sequence[tuple[Extension, Array, Array]],
) -> list[tuple[float, float, float, float, float]]:
    """(order, amplitude, phase, their standard deviations) of play that varies with place."""
    return [
        (float(t.shape["order"]), *line_parameters(c, v)) for t, c, v in terms if not _everywhere(t)
    ]


def _place_parameters(lines: list[tuple[float, float, float, float, float]]) -> Parameters:
    if not lines:
        return {}
    return {
        "place_orders": quantity([line[0] for line in lines]),
        "place_amplitudes_arcsec": quantity([line[1] for line in lines], [x[3] for x in lines]),
        "place_phases_deg": quantity([line[2] for line in lines], [x[4] for x in lines]),
    }
