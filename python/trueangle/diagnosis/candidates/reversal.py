"""Backlash and presliding hysteresis."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from ...simulation.effects import Effect, Surroundings
from ...simulation.effects.effect import line_columns
from ...simulation.effects.reversal import Backlash, PreslidingHysteresis
from ...simulation.signals import Signals
from ..space import Proposal, Space
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

    def propose(self, space: Space) -> Proposal | None:
        if space.has("presliding_hysteresis"):
            return None
        shapes: list[dict[str, Any]] = [{"order": 0}]
        if space.has(self.cause):
            shapes = [{"order": k} for k in PLACE_ORDERS]
        log_grid = float(np.log(len(shapes)))
        proposals = [
            space.propose(
                self.cause,
                shape,
                self.columns(space.signals, space.around, shape),
                log_grid=log_grid,
            )
            for shape in shapes
        ]
        return max(proposals, key=lambda p: p.bic_gain)

    def columns(self, signals: Signals, around: Surroundings, shape: dict[str, Any]) -> Array:
        return _play_columns(signals, shape["order"])

    def report(
        self, space: Space, terms: Sequence[tuple[Proposal, Array, Array]]
    ) -> tuple[Parameters, list[Effect]]:
        width, std = 0.0, 0.0
        for proposal, coefficients, covariance in terms:
            if _everywhere(proposal):
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

    def propose(self, space: Space) -> Proposal | None:
        signals = space.signals
        if np.ptp(signals.direction) == 0.0 and not signals.travel.any():
            return None
        best: tuple[float, float, float] | None = None
        for start in (0.0, 1.0):
            columns = space.remembered(
                f"presliding {start}",
                None,
                lambda start=start: np.column_stack(  # type: ignore[misc]
                    [signals.presliding(length, start) for length in LENGTHS]
                ),
            )
            gains = space.gains(columns)
            k = int(np.argmax(gains))
            if best is None or gains[k] > best[0] + 1e-9:
                best = (float(gains[k]), float(LENGTHS[k]), start)
        assert best is not None
        gain, length, start = best
        present = [
            term.shape["length_deg"]
            for term in space.terms
            if term.cause == self.cause and _everywhere(term)
        ]
        if gain <= 0.0 or len(present) >= MOST_ELEMENTS:
            return None
        step = np.log(LENGTHS[1] / LENGTHS[0])
        log_length, _ = golden_maximum(
            lambda x: float(space.gains(signals.presliding(np.exp(x), start)[:, None])[0]),
            np.log(length) - step,
            np.log(length) + step,
        )
        shape = {"length_deg": float(np.exp(log_length)), "start_state": start}
        columns = self.columns(signals, space.around, shape)
        proposal = space.propose(self.cause, shape, columns, parameters=2, log_grid=np.log(2.0))
        if not space.has(self.cause):
            return proposal
        # What may follow: play, play that varies with the place, another element.
        further = [self._play(space, order) for order in (0, *PLACE_ORDERS)]
        apart = all(
            other == 0.0 or abs(np.log(shape["length_deg"] / other)) > np.log(APART)
            for other in present
        )
        if apart:
            further.append(proposal)
        further.sort(key=lambda p: -p.bic_gain)
        return next((p for p in further if p.bic_gain > 0.0 and self._pulls_back(space, p)), None)

    def _pulls_back(self, space: Space, proposal: Proposal) -> bool:
        """With this term all elements have one sign, as springs have.

        Elements of unlike signs would only be a difference of two that are alike.
        """
        after = space.coefficients_with(proposal)
        elements = [float(proposal.coefficients[0])] if _everywhere(proposal) else []
        at = space.base.shape[1]
        for term in space.terms:
            if term.cause == self.cause and _everywhere(term):
                elements.append(float(after[at]))
            at += term.columns.shape[1]
        return not elements or min(elements) * max(elements) > 0.0

    def _play(self, space: Space, order: int) -> Proposal:
        shape = {"length_deg": 0.0, "order": order}
        columns = self.columns(space.signals, space.around, shape)
        log_grid = float(np.log(len(PLACE_ORDERS))) if order else 0.0
        return space.propose(self.cause, shape, columns, log_grid=log_grid)

    def columns(self, signals: Signals, around: Surroundings, shape: dict[str, Any]) -> Array:
        if shape["length_deg"] == 0.0:
            return _play_columns(signals, shape["order"])
        return signals.presliding(shape["length_deg"], shape["start_state"])[:, None]

    def report(
        self, space: Space, terms: Sequence[tuple[Proposal, Array, Array]]
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
                self._length_std(space, terms[int(np.argmax(weights))]) if terms else None,
            ),
        }
        if len(terms) > 1:
            parameters["element_lengths_deg"] = quantity(lengths)
            parameters["element_amplitudes_arcsec"] = quantity([float(c[0]) for _, c, _ in terms])
        return parameters | _place_parameters(lines), effects

    def _length_std(self, space: Space, term: tuple[Proposal, Array, Array]) -> float | None:
        """From the curvature: the column's derivative by ln L, all else projected out."""
        proposal, coefficients, _ = term
        length = proposal.shape["length_deg"]
        if length == 0.0:
            return None
        start, signals, step = proposal.shape["start_state"], space.signals, 0.02
        derivative = (
            coefficients[0]
            * (
                signals.presliding(length * np.exp(step), start)
                - signals.presliding(length * np.exp(-step), start)
            )
            / (2.0 * step)
        )
        x, _ = space.projected(derivative[:, None])
        information = float(x[:, 0] @ x[:, 0])
        return length * float(np.sqrt(space.variance / information)) if information > 0 else None


def _everywhere(term: Proposal) -> bool:
    """The term is the same at every place."""
    return not term.shape.get("order")


def _play_columns(signals: Signals, order: int) -> Array:
    if order == 0:
        return signals.direction[:, None]
    return signals.direction[:, None] * line_columns(signals.theta, order)


def _place_lines(
    terms: Sequence[tuple[Proposal, Array, Array]],
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
