"""Gear lines that grow with torque."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from ..estimation.extension import Extension
from ..estimation.regression import Regression
from ..joint.pattern import JointPattern, line_columns, line_sum
from ..joint.signals import Signals
from ..model.term import Term, line_values
from ..model.terms.load import LoadDependentGearErrorTerm
from .ambiguity import OWN_OF_VELOCITY, OWN_POWER, Ambiguity, share_left
from .drawing import Drawing
from .effect import Effect, Reported, Spots
from .factor import FactorEffect
from .missing_order import MissingOrder
from .search import Array, Fitted, is_gear_order, known_orders, line_quantities
from .thermal_drift import ThermalDrift
from .torsional_compliance import TorsionalCompliance, torque_of, unloaded


@dataclass(frozen=True)
class LoadDependentGearError(FactorEffect):
    """Gear lines that grow with torque l (signed or absolute).

    ::

        ε = l Σ_m C_m sin(mθ + φ_m)

    Parameters
    ----------
    lines_per_Nm : list of [output order, arcsec per Nm, phase_deg]
    torque : {"signed", "absolute"}
        Whether l is the torque or its absolute value.
    """

    lines_per_Nm: tuple[tuple[float, float, float], ...]
    torque: str = "signed"

    kind: ClassVar[str] = LoadDependentGearErrorTerm.kind
    size_name: ClassVar[str] = "lines_per_Nm"
    sentence: ClassVar[str] = (
        "Load presses the teeth of the gear into each other: its lines (motor and wave "
        "generator orders) grow with torque."
    )
    needs: ClassVar[tuple[str, ...]] = ("torque",)
    factor: ClassVar[str] = "torque"
    form_of: ClassVar[tuple[str, ...]] = ("load_place",)
    of_motion: ClassVar[bool] = True
    measure: ClassVar[str] = "repeat the runs at a second load, densely enough for the gear's lines"
    confused_with: ClassVar[Mapping[type[Effect], str]] = {
        ThermalDrift: "change load and temperature independently",
        MissingOrder: "a second load",
    }
    changes_lines: ClassVar[bool] = True

    def signal(self, signals: Signals, around: JointPattern, rng: np.random.Generator) -> Array:
        torque = torque_of(signals)
        if self.torque == "absolute":
            torque = np.abs(torque)
        return np.asarray(torque * line_sum(signals.theta, self.lines_per_Nm))

    @classmethod
    def drawn(cls, size: float, of: Drawing) -> Self | None:
        order = of.carrier()
        if order is None:
            _, _, order = of.free_line()
        return cls(((order, size, of.phase()),))

    @classmethod
    def scale(cls, signals: Signals, kind: str) -> Array | None:
        if signals.torque is None:
            return None
        return np.abs(signals.torque) if kind == "absolute" else signals.torque

    @classmethod
    def shapes(cls, regression: Regression) -> list[dict[str, Any]]:
        torque = regression.signals.torque
        if torque is None or not torque.any() or cls._is_lines(regression):
            return []
        both_signs = torque.min() < 0.0 < torque.max()
        return [
            {"what": "line", "order": float(m), "kind": kind}
            for m in known_orders(regression.around)
            if is_gear_order(regression.around, m)
            for kind in (("signed", "absolute") if both_signs else ("signed",))
        ]

    @classmethod
    def alternatives(
        cls, regression: Regression, shape: dict[str, Any], shapes: list[dict[str, Any]]
    ) -> int:
        """The lobes pass the teeth twice a turn: these two lines grow with load first."""
        joint = regression.around.joint
        mesh = [joint.output_order(shaft, 2) for shaft in joint.shafts if shaft != "output"]
        likely = sum(other["order"] in mesh for other in shapes)
        return likely if shape["order"] in mesh else len(shapes)

    @classmethod
    def report(cls, regression: Regression, terms: Sequence[Fitted]) -> Reported:
        lines = cls.line_rows(terms)
        effects: list[Effect] = []
        for kind in ("signed", "absolute"):
            chosen = tuple(
                line[:3]
                for line, (extension, _, _) in zip(lines, terms, strict=True)
                if extension.shape["kind"] == kind
            )
            if chosen:
                effects.append(LoadDependentGearError(chosen, kind))
        return line_quantities(lines, "amplitudes_arcsec_per_Nm"), effects

    @classmethod
    def blind_spots(cls, regression: Regression, found: Sequence[Ambiguity]) -> Iterator[Ambiguity]:
        signals = regression.signals
        if signals.temperature is not None and signals.torque is not None:
            warm = (signals.temperature - signals.temperature.mean())[:, None]
            load = np.abs(signals.torque)[:, None]
            told = any(ThermalDrift.kind in spot.causes for spot in found)
            if not told and share_left(regression, warm, load) < OWN_OF_VELOCITY:
                yield cls.blind(
                    "temperature and load change together",
                    ThermalDrift,
                    TorsionalCompliance,
                    first=False,
                    factor=ThermalDrift.factor,
                )
        because = unloaded(signals)
        if because:
            yield cls.blind(because)
            return
        if cls._is_lines(regression):
            yield cls.blind(
                "one load: gear lines that grow with it are only other lines, or sidebands"
            )

    @classmethod
    def _is_lines(cls, regression: Regression) -> bool:
        """All runs have one load: a gear line that grows with it is another line, or sidebands."""
        signals = regression.signals
        gear = [m for m in regression.lines.orders[regression.lines.plausible] if m > 40.0][:2]
        if not gear:
            return False

        def build() -> bool:
            m = float(gear[-1])
            beside = np.hstack([line_columns(signals.theta, m + k) for k in (-1, 0, 1)])
            loaded = torque_of(signals)[:, None] * line_columns(signals.theta, m)
            return share_left(regression, loaded, beside) < OWN_POWER

        return bool(regression.of_pattern(f"{cls.kind} as lines", None, build))

    @classmethod
    def doubt(cls, extension: Extension, regression: Regression, spots: Spots) -> Ambiguity | None:
        if extension.cause != MissingOrder.kind or unloaded(regression.signals):
            return None
        if is_gear_order(regression.belief, float(extension.shape["output_order"])):
            for spot in spots:
                if spot.causes == (cls.kind,):
                    return MissingOrder.also_from(cls, spot)
        return None

    def to_terms(self, period: float, shafts: Mapping[str, float]) -> tuple[Term, ...]:
        lines = line_values(self.lines_per_Nm, period)
        return (LoadDependentGearErrorTerm(**lines, torque=self.torque),)
