"""A factor times a shape in angle: thermal drift and the effects of load."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from ...joint.pattern import Surroundings, line_columns
from ...joint.signals import Signals
from ...regression.regression import Extension, Regression
from ...simulation.effects import Effect
from ...simulation.effects.load import LoadDependentGearError, TorsionalCompliance
from ...simulation.effects.temperature import ThermalDrift
from .candidate import Array, Candidate, Parameters, line_parameters, quantity

__all__ = ["LoadDependentGearCandidate", "ThermalCandidate", "TorsionalCandidate"]

#: Temperature at which the simulation's lines hold, degrees Celsius.
REFERENCE_C = 20.0


class FactorCandidate(Candidate):
    """Base: tries every block ``factor * shape(theta)`` and proposes the best.

    Further blocks follow as further terms of the same cause.
    """

    def factor(self, signals: Signals, kind: str) -> Array | None:
        raise NotImplementedError

    def shapes(self, regression: Regression) -> list[dict[str, Any]]:
        raise NotImplementedError

    def alternatives(
        self, regression: Regression, shape: dict[str, Any], shapes: list[dict[str, Any]]
    ) -> int:
        """Shapes as likely as this one; half of the belief goes to the likeliest."""
        return 1 if shape["what"] == "zero" else len(shapes)

    def propose(self, regression: Regression) -> Extension | None:
        shapes = self.shapes(regression)
        log_grids = [np.log(2.0 * self.alternatives(regression, shape, shapes)) for shape in shapes]
        return self.best(regression, shapes, log_grids)

    def columns(self, signals: Signals, around: Surroundings, shape: dict[str, Any]) -> Array:
        factor = self.factor(signals, shape.get("kind", "signed"))
        assert factor is not None
        if shape["what"] == "zero":
            return factor[:, None]
        if shape["what"] == "pattern":
            return np.asarray((factor * around.pattern.value(signals.theta))[:, None])
        return factor[:, None] * line_columns(signals.theta, shape["order"])

    def lines(
        self, terms: Sequence[tuple[Extension, Array, Array]]
    ) -> list[tuple[float, float, float, float]]:
        """(order, amplitude, phase, std of the amplitude) of the line terms."""
        found = []
        for extension, coefficients, covariance in terms:
            if extension.shape["what"] == "line":
                amplitude, phase, std, _ = line_parameters(coefficients, covariance)
                found.append((float(extension.shape["order"]), amplitude, phase, std))
        return found

    def single(self, terms: Sequence[tuple[Extension, Array, Array]], what: str) -> Any:
        """Coefficient and standard deviation of the term ``what``, or None."""
        for extension, coefficients, covariance in terms:
            if extension.shape["what"] == what:
                return float(coefficients[0]), float(np.sqrt(covariance[0, 0]))
        return None


class ThermalCandidate(FactorCandidate):
    """Temperature times the zero, the pattern, or a line."""

    cause: ClassVar[str] = "thermal_drift"

    def factor(self, signals: Signals, kind: str) -> Array | None:
        return None if signals.temperature is None else signals.temperature - REFERENCE_C

    def shapes(self, regression: Regression) -> list[dict[str, Any]]:
        temperature = regression.signals.temperature
        if temperature is None or np.ptp(temperature) == 0.0:
            return []
        pattern = regression.around.pattern
        shapes: list[dict[str, Any]] = [{"what": "zero"}]
        if pattern.orders.size:
            shapes.append({"what": "pattern"})
        shapes += [{"what": "line", "order": float(m)} for m in known_orders(regression)]
        return shapes

    def report(
        self, regression: Regression, terms: Sequence[tuple[Extension, Array, Array]]
    ) -> tuple[Parameters, list[Effect]]:
        lines = self.lines(terms)
        zero, pattern = self.single(terms, "zero"), self.single(terms, "pattern")
        parameters: Parameters = {}
        if zero:
            parameters["zero_arcsec_per_K"] = quantity(*zero)
        if pattern:
            parameters["pattern_per_K"] = quantity(*pattern)
        if lines:
            parameters["orders"] = quantity([line[0] for line in lines])
            parameters["amplitudes_arcsec_per_K"] = quantity(
                [line[1] for line in lines], [line[3] for line in lines]
            )
            parameters["phases_deg"] = quantity([line[2] for line in lines])
        effect = ThermalDrift(
            zero[0] if zero else 0.0,
            pattern[0] if pattern else 0.0,
            tuple((m, c, p) for m, c, p, _ in lines),
            REFERENCE_C,
        )
        return parameters, [effect]


class TorsionalCandidate(FactorCandidate):
    """Torque, and torque times order 1 where the column holds the load of an arm."""

    cause: ClassVar[str] = "torsional_compliance"

    def factor(self, signals: Signals, kind: str) -> Array | None:
        return signals.torque

    def shapes(self, regression: Regression) -> list[dict[str, Any]]:
        torque = regression.signals.torque
        if torque is None or not torque.any() or regression.has("stiffening_compliance"):
            return []
        return [{"what": "zero"}, {"what": "line", "order": 1.0}]

    def report(
        self, regression: Regression, terms: Sequence[tuple[Extension, Array, Array]]
    ) -> tuple[Parameters, list[Effect]]:
        direct, lines = self.single(terms, "zero"), self.lines(terms)
        parameters: Parameters = {}
        if direct:
            parameters["arcsec_per_Nm"] = quantity(*direct)
        elif lines:
            parameters["arcsec_per_Nm"] = quantity(lines[0][1], lines[0][3])
        if lines:
            parameters["gravity_arcsec_per_Nm"] = quantity(lines[0][1], lines[0][3])
            parameters["gravity_phase_deg"] = quantity(lines[0][2])
        effect = TorsionalCompliance(
            direct[0] if direct else 0.0, tuple((m, c, p) for m, c, p, _ in lines)
        )
        return parameters, [effect]


class LoadDependentGearCandidate(FactorCandidate):
    """Torque, signed or absolute, times a line of the gear."""

    cause: ClassVar[str] = "load_dependent_gear_error"

    def factor(self, signals: Signals, kind: str) -> Array | None:
        if signals.torque is None:
            return None
        return np.abs(signals.torque) if kind == "absolute" else signals.torque

    def shapes(self, regression: Regression) -> list[dict[str, Any]]:
        torque = regression.signals.torque
        if torque is None or not torque.any():
            return []
        both_signs = torque.min() < 0.0 < torque.max()
        return [
            {"what": "line", "order": float(m), "kind": kind}
            for m in known_orders(regression)
            if _is_gear_order(regression, m)
            for kind in (("signed", "absolute") if both_signs else ("signed",))
        ]

    def alternatives(
        self, regression: Regression, shape: dict[str, Any], shapes: list[dict[str, Any]]
    ) -> int:
        """The lobes pass the teeth twice a turn: these two lines grow with load first."""
        joint = regression.around.joint
        mesh = [joint.output_order(shaft, 2) for shaft in joint.shafts if shaft != "output"]
        likely = sum(other["order"] in mesh for other in shapes)
        return likely if shape["order"] in mesh else len(shapes)

    def report(
        self, regression: Regression, terms: Sequence[tuple[Extension, Array, Array]]
    ) -> tuple[Parameters, list[Effect]]:
        lines = self.lines(terms)
        parameters = {
            "orders": quantity([line[0] for line in lines]),
            "amplitudes_arcsec_per_Nm": quantity(
                [line[1] for line in lines], [line[3] for line in lines]
            ),
            "phases_deg": quantity([line[2] for line in lines]),
        }
        effects: list[Effect] = []
        for kind in ("signed", "absolute"):
            chosen = tuple(
                line[:3]
                for line, (extension, _, _) in zip(lines, terms, strict=True)
                if extension.shape["kind"] == kind
            )
            if chosen:
                effects.append(LoadDependentGearError(chosen, kind))
        return parameters, effects


def known_orders(regression: Regression) -> list[float]:
    """Orders of the pattern and those that gears and encoders are known to have."""
    joint = regression.around.joint
    orders = {float(m) for m in regression.around.pattern.orders}
    orders |= {joint.output_order(shaft, k) for shaft, k in joint.gear_orders()}
    return sorted(orders)


def _is_gear_order(regression: Regression, order: float) -> bool:
    named = regression.around.joint.name_order(order)
    return named is not None and named[0] != "output"
