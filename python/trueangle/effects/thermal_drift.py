"""Zero and line amplitudes that follow the temperature."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ..estimation.extension import Extension
from ..estimation.quantity import Parameters, quantity
from ..estimation.regression import Regression
from ..joint.pattern import JointPattern, line_sum
from ..joint.signals import Signals
from ..model.term import Term, line_values
from ..model.terms.place import ThermalDriftTerm
from ..support.angles import from_arcsec
from .ambiguity import LEAST_KELVIN, Ambiguity
from .backlash import Backlash
from .effect import Effect, Reported
from .factor import FactorEffect
from .search import Array, Fitted, known_orders, line_quantities
from .torsional_compliance import TorsionalCompliance

#: Temperature at which the simulation's lines hold, degrees Celsius.
REFERENCE_C = 20.0


@dataclass(frozen=True)
class ThermalDrift(FactorEffect):
    """Error that grows with ``ΔT = T - T₀``.

    ::

        ε = ΔT [k₀ + k_p p(θ) + Σ_m C_m sin(mθ + φ_m)]

    Parameters
    ----------
    zero_arcsec_per_K : float
        k_0.
    pattern_per_K : float
        k_p: relative growth of the whole pattern (field strength).
    lines_per_K : list of [output order, arcsec per kelvin, phase_deg]
    reference_C : float
        T_0, where the simulation's lines hold.
    """

    zero_arcsec_per_K: float = 0.0
    pattern_per_K: float = 0.0
    lines_per_K: tuple[tuple[float, float, float], ...] = ()
    reference_C: float = 20.0

    kind: ClassVar[str] = ThermalDriftTerm.kind
    sentence: ClassVar[str] = (
        "Mounts expand and the magnet weakens with temperature: the zero and the lines of the "
        "encoder or the gear change in proportion to the temperature."
    )
    needs: ClassVar[tuple[str, ...]] = ("temperature",)
    factor: ClassVar[str] = "temperature"
    form_of: ClassVar[tuple[str, ...]] = ("temperature", "temperature_place")
    measure: ClassVar[str] = (
        "repeat the runs at a second temperature at least 10 K away, logging the sensor's own"
    )
    confused_with: ClassVar[Mapping[type[Effect], str]] = {
        Backlash: "both directions at each temperature",
        TorsionalCompliance: "change load and temperature independently",
    }
    acts_on_runs: ClassVar[bool] = True
    changes_lines: ClassVar[bool] = True

    def signal(self, signals: Signals, around: JointPattern, rng: np.random.Generator) -> Array:
        if signals.temperature is None:
            return np.zeros(len(signals))
        per_kelvin = self.zero_arcsec_per_K + line_sum(signals.theta, self.lines_per_K)
        if self.pattern_per_K:
            per_kelvin = per_kelvin + self.pattern_per_K * around.pattern.value(signals.theta)
        return np.asarray((signals.temperature - self.reference_C) * per_kelvin)

    @classmethod
    def scale(cls, signals: Signals, kind: str) -> Array | None:
        return None if signals.temperature is None else signals.temperature - REFERENCE_C

    @classmethod
    def shapes(cls, regression: Regression) -> list[dict[str, Any]]:
        temperature = regression.signals.temperature
        if temperature is None or np.ptp(temperature) == 0.0:
            return []
        pattern = regression.around.pattern
        shapes: list[dict[str, Any]] = [{"what": "zero"}]
        if pattern.orders.size:
            shapes.append({"what": "pattern"})
        shapes += [{"what": "line", "order": float(m)} for m in known_orders(regression.around)]
        return shapes

    @classmethod
    def report(cls, regression: Regression, terms: Sequence[Fitted]) -> Reported:
        lines = cls.line_rows(terms)
        zero, pattern = cls.single(terms, "zero"), cls.single(terms, "pattern")
        parameters: Parameters = {}
        if zero:
            parameters["zero_arcsec_per_K"] = quantity(*zero)
        if pattern:
            parameters["pattern_per_K"] = quantity(*pattern)
        if lines:
            parameters |= line_quantities(lines, "amplitudes_arcsec_per_K")
        effect = ThermalDrift(
            zero[0] if zero else 0.0,
            pattern[0] if pattern else 0.0,
            tuple((m, c, p) for m, c, p, *_ in lines),
            REFERENCE_C,
        )
        return parameters, [effect]

    @classmethod
    def blind_spots(cls, regression: Regression, found: Sequence[Ambiguity]) -> Iterator[Ambiguity]:
        temperature = regression.signals.temperature
        if temperature is None:
            yield cls.blind("no temperature was recorded")
        elif np.ptp(temperature) < LEAST_KELVIN:
            yield cls.blind(f"the temperature varies by less than {LEAST_KELVIN:g} K")

    @classmethod
    def told(cls, extension: Extension, regression: Regression) -> bool:
        """Whether a line changes with the temperature, which no zero of a run does."""
        return any(t.cause == cls.kind and t.shape["what"] != "zero" for t in regression.terms)

    def to_terms(self, period: float, shafts: Mapping[str, float]) -> tuple[Term, ...]:
        return (
            ThermalDriftTerm(
                from_arcsec(self.zero_arcsec_per_K, period),
                self.pattern_per_K,
                **line_values(self.lines_per_K, period),
                reference_C=self.reference_C,
            ),
        )
