"""Sine and cosine read one after the other: an error in proportion to speed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from ..estimation.extension import Extension
from ..estimation.linear import pseudo_inverse
from ..estimation.quantity import quantity
from ..estimation.regression import Regression
from ..joint.joint import Joint
from ..joint.pattern import JointPattern, line_columns
from ..joint.signals import Signals
from ..model.term import Term
from ..model.terms.motion import ChannelSkewTerm
from ..support.angles import ARCSEC_PER_DEG
from .ambiguity import OWN_POWER, Ambiguity, share_left
from .drawing import Drawing
from .effect import Effect, Reported
from .filter_lag import FilterLag
from .latency import UNTIMED, Latency
from .missing_order import MissingOrder
from .search import Array, Fitted, golden_maximum, line_parameters

#: Radians to either side of the line's own phase within which that of both parts is looked for.
REACH = 0.5


@dataclass(frozen=True)
class ChannelSkew(Effect):
    """The cosine is read a time ``Δt`` before the sine.

    ::

        ε = (v Δt / 2) [1 + sin(mθ + φ)]

    with m twice the sensor's electrical periods in one turn of the output.

    Parameters
    ----------
    delay_s : float
        ``Δt``; negative where the sine is read first.
    order : float
        m.
    phase_deg : float
        Phase of the sensor's periods on the joint.
    """

    delay_s: float
    order: float
    phase_deg: float = 0.0

    kind: ClassVar[str] = ChannelSkewTerm.kind
    sentence: ClassVar[str] = (
        "The two channels of a sine and cosine sensor are read one after the other: a constant "
        "and twice the sensor's order, both in proportion to speed."
    )
    needs: ClassVar[tuple[str, ...]] = ("time",)
    factor: ClassVar[str] = "velocity"
    form_of: ClassVar[tuple[str, ...]] = ("speed", "speed_place")
    form_follows: ClassVar[bool] = True
    confused_with: ClassVar[Mapping[type[Effect], str]] = {
        Latency: "two speeds at angles dense enough for twice the sensor's order",
        MissingOrder: "both directions or two speeds",
        FilterLag: "three speeds: a filter's lines change with speed",
    }
    measure: ClassVar[str] = (
        "two speeds or both directions, at angles dense enough for twice the sensor's order"
    )

    def signal(self, signals: Signals, around: JointPattern, rng: np.random.Generator) -> Array:
        line = np.sin(self.order * signals.theta + np.radians(self.phase_deg))
        half = 0.5 * self.delay_s * ARCSEC_PER_DEG * 360.0 * signals.turns_per_s
        return np.asarray(half * (1.0 + line))

    @classmethod
    def drawn(cls, size: float, of: Drawing) -> Self | None:
        joint = of.around.joint
        side = "motor" if joint.encoder_side == "motor" and "motor" in joint.shafts else "output"
        order = joint.output_order(side, 2.0 * joint.pole_pairs)
        return cls(size, order, of.phase())

    @classmethod
    def propose(cls, regression: Regression) -> Extension | None:
        if regression.signals.velocity is None or regression.has(cls.kind):
            return None
        signals, around = regression.signals, regression.around
        pair = cls.columns(signals, around, {})
        free, coefficients = regression.gain(pair)
        if regression.is_pruned(free, 2) or _is_part_of_a_line(regression):
            return None
        phase = float(np.arctan2(*coefficients))

        def gain(turned: float) -> float:
            return regression.gain(cls.columns(signals, around, {"phase": turned}))[0]

        # The constant part is as large as the line; the data decide which of the two signs it has.
        # It also shifts the phase of a line that is fitted without it.
        tried = []
        for start in (phase, phase + np.pi):
            settled, _ = golden_maximum(gain, start - REACH, start + REACH)
            columns = cls.columns(signals, around, {"phase": settled})
            tried.append(regression.propose(cls.kind, {"phase": settled}, columns, parameters=2))
        best = max(tried, key=lambda extension: extension.bic_gain)
        return best if best.bic_gain > 0.0 else None

    @classmethod
    def columns(cls, signals: Signals, around: JointPattern, shape: dict[str, Any]) -> Array:
        """Column whose coefficient is the delay; without a phase the pair of the line alone."""
        half = 0.5 * ARCSEC_PER_DEG * 360.0 * signals.turns_per_s[:, None]
        line = line_columns(signals.theta, skewed_order(around.joint))
        if "phase" not in shape:
            return np.asarray(half * line)
        turned = line @ np.array([np.sin(shape["phase"]), np.cos(shape["phase"])])
        return np.asarray(half * (1.0 + turned[:, None]))

    @classmethod
    def report(cls, regression: Regression, terms: Sequence[Fitted]) -> Reported:
        extension, (delay,), covariance = terms[0]
        phase = float(np.degrees(extension.shape["phase"]) % 360.0)
        order = skewed_order(regression.around.joint)
        rest = regression.with_terms(t for t in regression.terms if t is not extension)
        pair = rest.projected(cls.columns(regression.signals, regression.around, {}))[0]
        spread = regression.variance * pseudo_inverse(pair.T @ pair)
        _, _, _, phase_std = line_parameters(
            abs(float(delay)) * np.array([np.sin(np.radians(phase)), np.cos(np.radians(phase))]),
            spread,
        )
        parameters = {
            "delay_s": quantity(delay, float(np.sqrt(covariance[0, 0]))),
            "phase_deg": quantity(phase, phase_std),
            "order": quantity(order),
        }
        return parameters, [ChannelSkew(float(delay), order, phase)]

    @classmethod
    def blind_spots(cls, regression: Regression, found: Sequence[Ambiguity]) -> Iterator[Ambiguity]:
        signals = regression.signals
        if signals.velocity is None:
            yield cls.blind(UNTIMED)
            return
        if _is_part_of_a_line(regression):
            yield cls.blind("one speed in one direction (or at rest): it is part of a line")

    def to_terms(self, period: float, shafts: Mapping[str, float]) -> tuple[Term, ...]:
        return (ChannelSkewTerm(self.delay_s, self.order, self.phase_deg),)


def _is_part_of_a_line(regression: Regression) -> bool:
    """The line times the velocity is not distinguished from the line."""
    signals = regression.signals
    assert signals.velocity is not None
    line = line_columns(signals.theta, skewed_order(regression.belief.joint))
    return bool(share_left(regression, signals.velocity[:, None] * line, line) < OWN_POWER)


def skewed_order(joint: Joint) -> float:
    """Twice the electrical periods of the sensor in one turn of the output."""
    cycles = joint.shafts.get("motor", 1.0) if joint.encoder_side == "motor" else 1.0
    return 2.0 * joint.pole_pairs * cycles
