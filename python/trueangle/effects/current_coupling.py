"""The field of the motor's current in a magnetic sensor."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ..estimation.quantity import Parameters, quantity
from ..estimation.regression import Regression
from ..joint.pattern import JointPattern, line_sum
from ..joint.signals import Signals
from ..model.term import Term, line_values
from ..model.terms.load import CurrentCouplingTerm
from ..support.angles import from_arcsec
from .ambiguity import OWN_OF_VELOCITY, Ambiguity, share_left
from .effect import Effect, Reported
from .factor import FactorEffect
from .load_dependent_gear_error import LoadDependentGearError
from .search import Array, Fitted, known_orders, line_quantities
from .thermal_drift import ThermalDrift
from .torsional_compliance import TorsionalCompliance


@dataclass(frozen=True)
class CurrentCoupling(FactorEffect):
    """Error in proportion to the motor's current: ``ε = i [a₀ + g(θ)]``.

    Parameters
    ----------
    arcsec_per_A : float
        a_0.
    lines_per_A : list of [output order, arcsec per ampere, phase_deg]
        g.
    """

    arcsec_per_A: float = 0.0
    lines_per_A: tuple[tuple[float, float, float], ...] = ()

    kind: ClassVar[str] = CurrentCouplingTerm.kind
    sentence: ClassVar[str] = (
        "The field of the motor's current reaches the magnetic sensor: the error follows the "
        "current, with its sign, at rest as well."
    )
    needs: ClassVar[tuple[str, ...]] = ("current",)
    factor: ClassVar[str] = "torque"
    form_of: ClassVar[tuple[str, ...]] = ("current",)
    confused_with: ClassVar[Mapping[type[Effect], str]] = {
        TorsionalCompliance: "lock the output, or drive current without torque (d axis)",
        ThermalDrift: "change current and temperature independently",
        LoadDependentGearError: "lock the output, or drive current without torque (d axis)",
    }
    measure: ClassVar[str] = (
        "log the motor's current; hold a load with the brake and change the current"
    )
    acts_on_runs: ClassVar[bool] = True
    changes_lines: ClassVar[bool] = True

    def signal(self, signals: Signals, around: JointPattern, rng: np.random.Generator) -> Array:
        if signals.current is None:
            return np.zeros(len(signals))
        per_ampere = self.arcsec_per_A + line_sum(signals.theta, self.lines_per_A)
        return np.asarray(signals.current * per_ampere)

    @classmethod
    def scale(cls, signals: Signals, kind: str) -> Array | None:
        return signals.current

    @classmethod
    def shapes(cls, regression: Regression) -> list[dict[str, Any]]:
        current = regression.signals.current
        if current is None or np.ptp(current) == 0.0:
            return []
        joint = regression.around.joint
        # Fields add to the sensor's own: its order and the neighbours of it.
        sensor = joint.shafts.get("motor", 1.0) if joint.encoder_side == "motor" else 1.0
        poles = joint.pole_pairs * sensor
        orders = {*known_orders(regression.around), poles, poles + sensor, abs(poles - sensor)}
        lines = [{"what": "line", "order": m} for m in sorted(orders) if m > 0.0]
        return [{"what": "zero"}, *lines]

    @classmethod
    def report(cls, regression: Regression, terms: Sequence[Fitted]) -> Reported:
        zero, lines = cls.single(terms, "zero"), cls.line_rows(terms)
        parameters: Parameters = {}
        if zero:
            parameters["arcsec_per_A"] = quantity(*zero)
        if lines:
            parameters |= line_quantities(lines, "amplitudes_arcsec_per_A")
        effect = CurrentCoupling(
            zero[0] if zero else 0.0, tuple((m, c, p) for m, c, p, *_ in lines)
        )
        return parameters, [effect]

    @classmethod
    def blind_spots(cls, regression: Regression, found: Sequence[Ambiguity]) -> Iterator[Ambiguity]:
        signals = regression.signals
        if signals.current is None or not signals.current.any():
            yield cls.blind("no current of the motor was recorded")
            return
        current = signals.current[:, None]
        torque = current * 0.0 if signals.torque is None else signals.torque[:, None]
        if share_left(regression, current, torque) < OWN_OF_VELOCITY:
            yield cls.blind(
                "the current follows the torque: the field of one and the twist of the other "
                "give the same readings",
                TorsionalCompliance,
            )

    def to_terms(self, period: float, shafts: Mapping[str, float]) -> tuple[Term, ...]:
        lines = line_values(self.lines_per_A, period)
        return (CurrentCouplingTerm(from_arcsec(self.arcsec_per_A, period), **lines),)
