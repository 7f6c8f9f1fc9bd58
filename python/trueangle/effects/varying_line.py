"""A line whose amplitude or phase follows speed or load, and that no narrower cause explains."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar, Self

import numpy as np

from ..estimation.extension import Extension
from ..estimation.quantity import quantity
from ..estimation.regression import Regression
from ..joint.pattern import JointPattern, line_columns, line_sum
from ..joint.signals import Signals
from ..model.term import Term, line_values
from ..model.terms.motion import VaryingLineTerm
from .ambiguity import Ambiguity
from .channel_skew import ChannelSkew, skewed_order
from .drawing import Drawing
from .effect import ALWAYS, Effect, Reported, Spots
from .filter_lag import FilterLag
from .load_dependent_gear_error import LoadDependentGearError
from .search import Array, Fitted, grid_ambiguity, is_gear_order, line_parameters
from .shapes import best_shape

#: Lines at most, and the number of broad causes that the prior counts for every narrow one.
MOST_LINES = 2
BROAD = 8.0

#: Turns from which on whole orders are separated; periods that a line needs over less, and
#: periods by which orders must differ there.
WHOLE_TURN, RESOLVED, UNRESOLVED = 0.9, 1.0, 0.5


@dataclass(frozen=True)
class VaryingLine(Effect):
    """A line times a factor: ``ε = x C sin(mθ + φ)``.

    Parameters
    ----------
    order : float
        m, of the output.
    follows : {"speed", "velocity", "torque"}
        x: the absolute or the signed speed in deg/s, or the torque in Nm.
    amplitude_arcsec : float
        C, per unit of x.
    phase_deg : float
    """

    order: float
    follows: str
    amplitude_arcsec: float
    phase_deg: float = 0.0

    kind: ClassVar[str] = VaryingLineTerm.kind
    size_name: ClassVar[str] = "amplitude_arcsec"
    sentence: ClassVar[str] = (
        "A line of a shaft grows, shrinks or turns with speed or load, in a form that no "
        "narrower cause has."
    )
    factor: ClassVar[str] = "velocity"
    form_of: ClassVar[tuple[str, ...]] = (
        "speed_place",
        "temperature_place",
        "load_place",
        "run_place",
    )
    confused_with: ClassVar[Mapping[type[Effect], str]] = {
        FilterLag: "three speeds: a filter's lines change with speed, and all of them",
        ChannelSkew: "angles dense enough for twice the sensor's order",
        LoadDependentGearError: "three loads of both signs",
    }
    of_motion: ClassVar[bool] = True
    measure: ClassVar[str] = "three speeds and three loads, at free angles"
    flexible_below: ClassVar[float] = ALWAYS
    changes_lines: ClassVar[bool] = True
    located: ClassVar[bool] = True

    def signal(self, signals: Signals, around: JointPattern, rng: np.random.Generator) -> Array:
        scale = _scale(signals, self.follows)
        if scale is None:
            return np.zeros(len(signals))
        return scale * line_sum(
            signals.theta, ((self.order, self.amplitude_arcsec, self.phase_deg),)
        )

    @classmethod
    def drawn(cls, size: float, of: Drawing) -> Self | None:
        order = of.carrier()
        if order is None:
            _, _, order = of.free_line()
        return cls(order, "speed", size, of.phase())

    @classmethod
    def propose(cls, regression: Regression) -> Extension | None:
        signals, around = regression.signals, regression.around
        if sum(term.cause == cls.kind for term in regression.terms) >= MOST_LINES:
            return None
        orders = _resolved(regression)
        shapes: list[dict[str, Any]] = []
        for follows in ("speed", "velocity", "torque"):
            scale = _scale(signals, follows)
            if scale is None or np.ptp(scale) == 0.0:
                continue
            shapes += [
                {"order": float(m), "follows": follows}
                for m in orders
                if not (follows == "velocity" and m == skewed_order(around.joint))
                and not (follows == "torque" and (m == 1.0 or is_gear_order(around, float(m))))
            ]
        log_grid = float(np.log(BROAD * max(len(shapes), 1)))
        best = best_shape(cls, regression, shapes, [log_grid] * len(shapes))
        if best is None:
            return None
        if best.bic_gain < regression.least:
            return best
        # The variation is judged by what it saves beyond the constant line, which comes first.
        steady = regression.jointly_with(line_columns(signals.theta, best.shape["order"]))
        beyond = steady.gain(best.columns)[0]
        return replace(best, deviance=min(best.deviance, beyond))

    @classmethod
    def columns(cls, signals: Signals, around: JointPattern, shape: dict[str, Any]) -> Array:
        scale = _scale(signals, shape["follows"])
        assert scale is not None
        return scale[:, None] * line_columns(signals.theta, shape["order"])

    @classmethod
    def doubt(cls, extension: Extension, regression: Regression, spots: Spots) -> Ambiguity | None:
        return grid_ambiguity(regression, spots) if extension.cause == cls.kind else None

    @classmethod
    def report(cls, regression: Regression, terms: Sequence[Fitted]) -> Reported:
        rows = [(t.shape["order"], t.shape["follows"], *line_parameters(c, v)) for t, c, v in terms]
        orders, follows, amplitudes, phases, stds, phase_stds = zip(*rows, strict=True)
        parameters = {
            "order": quantity(orders[0] if len(rows) == 1 else orders),
            "factor": quantity(follows[0] if len(rows) == 1 else follows),
            "coefficients": quantity(amplitudes, stds),
            "phases_deg": quantity(phases, phase_stds),
        }
        return parameters, [VaryingLine(*row[:4]) for row in rows]

    def to_terms(self, period: float, shafts: Mapping[str, float]) -> tuple[Term, ...]:
        per_unit = 1.0 if self.follows == "torque" else 360.0 / period
        lines = ((self.order, self.amplitude_arcsec * per_unit, self.phase_deg),)
        return (VaryingLineTerm(follows=self.follows, **line_values(lines, period)),)


def _resolved(regression: Regression) -> Array:
    """Orders that are lines over the travel, without those close to a fast shaft's own.

    Over less of a period a line times the speed is the speed itself.
    """
    lines = regression.lines
    travel = float(regression.signals.run_turns().max())
    orders = lines.orders[lines.plausible]
    if travel >= WHOLE_TURN:
        return np.asarray(orders)
    joint = regression.around.joint
    names = [joint.name_order(float(m)) for m in orders]
    own = np.array([m for m, n in zip(orders, names, strict=True) if n and n[0] != "output"])
    near = np.abs(orders[:, None] - own[None, :]) * travel < UNRESOLVED
    kept = (orders * travel > RESOLVED) & ((orders[:, None] == own).any(axis=1) | ~near.any(axis=1))
    return np.asarray(orders[kept])


def _scale(signals: Signals, follows: str) -> Array | None:
    if follows == "torque":
        return signals.torque
    if signals.velocity is None:
        return None
    return np.abs(signals.velocity) if follows == "speed" else signals.velocity
