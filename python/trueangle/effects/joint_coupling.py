"""A share of another joint's angle, as wrists whose joints are driven through each other have."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, ClassVar, Self, TypeAlias

import numpy as np

from ..estimation.extension import Extension
from ..estimation.quantity import quantity
from ..estimation.regression import Regression
from ..joint.pattern import JointPattern
from ..joint.signals import Signals
from ..model.term import Term
from ..model.terms.place import JointCouplingTerm
from ..support.angles import ARCSEC_PER_DEG
from .ambiguity import OWN_POWER, Ambiguity, share_left
from .drawing import Drawing
from .effect import Effect, Reported
from .scale_error import ScaleError
from .search import Array, Fitted
from .shapes import best_shape


class _OfOthers(Effect):
    """Follows the motion of other joints: here, as a parameter of the effect is a factor too."""

    factor: ClassVar[str] = "coupled"


@dataclass(frozen=True)
class JointCoupling(_OfOthers):
    """Share of another joint's indicated angle: ``ε = c θ_j``.

    Parameters
    ----------
    joint : str
        The other joint, j.
    factor : float
        c, degrees per degree.
    """

    joint: str
    factor: float = field()  # type: ignore[assignment, misc]  # the class keeps its own

    kind: ClassVar[str] = JointCouplingTerm.kind
    size_name: ClassVar[str] = "factor"
    sentence: ClassVar[str] = (
        "The joint is driven through another one, as in a wrist: a share of the angle that the "
        "other one turns is in its reading."
    )
    needs: ClassVar[tuple[str, ...]] = ("coupled",)
    confused_with: ClassVar[Mapping[type[Effect], str]] = {
        ScaleError: "turn one joint while the other is at rest",
    }
    measure: ClassVar[str] = (
        "log the angle of the other joint, and turn it apart from this one, or alone"
    )
    acts_on_runs: ClassVar[bool] = True
    # A ratio of counts of teeth: of 16 degrees nothing is left that could hide another cause.
    has_exact_form: ClassVar[bool] = True
    is_separate: ClassVar[bool] = True

    def signal(self, signals: Signals, around: JointPattern, rng: np.random.Generator) -> Array:
        angle = signals.coupled.get(self.joint)
        if angle is None:
            return np.zeros(len(signals))
        return np.asarray(self.factor * ARCSEC_PER_DEG * angle)

    @classmethod
    def drawn(cls, size: float, of: Drawing) -> Self | None:
        moved = [joint for joint, angle in of.signals.coupled.items() if np.ptp(angle) > 0.0]
        return cls(str(of.rng.choice(moved)), size) if moved else None

    @classmethod
    def propose(cls, regression: Regression) -> Extension | None:
        taken = {t.shape["joint"] for t in regression.terms if t.cause == cls.kind}
        hidden = _hidden(regression)
        shapes = [{"joint": joint} for joint in hidden if joint not in taken and not hidden[joint]]
        grid = float(np.log(max(len(shapes), 1)))
        return best_shape(cls, regression, shapes, [grid] * len(shapes))

    @classmethod
    def imitate(cls, regression: Regression) -> Extension | None:
        """The share that a ramp of the joint's own would be."""
        ramps = [j for j, why in _hidden(regression).items() if why and ScaleError in why]
        shapes = [{"joint": joint} for joint in ramps]
        return best_shape(cls, regression, shapes, [float(np.log(max(len(ramps), 1)))] * len(ramps))

    @classmethod
    def columns(cls, signals: Signals, around: JointPattern, shape: dict[str, Any]) -> Array:
        return ARCSEC_PER_DEG * signals.coupled[shape["joint"]][:, None]

    @classmethod
    def report(cls, regression: Regression, terms: Sequence[Fitted]) -> Reported:
        found: list[Effect] = [
            JointCoupling(extension.shape["joint"], float(value))
            for extension, (value,), _ in terms
        ]
        extension, (value,), covariance = terms[0]
        parameters = {
            "joint": quantity(extension.shape["joint"]),
            "factor": quantity(float(value), float(np.sqrt(covariance[0, 0]))),
        }
        return parameters, found

    @classmethod
    def blind_spots(cls, regression: Regression, found: Sequence[Ambiguity]) -> Iterator[Ambiguity]:
        for because, *others in filter(None, _hidden(regression).values()):
            yield cls.blind(because, *others)

    def to_terms(self, period: float, shafts: Mapping[str, float]) -> tuple[Term, ...]:
        return (JointCouplingTerm(self.joint, self.factor),)


#: Why a share is hidden, and the other effects that have the same regressor.
_Hidden: TypeAlias = tuple[str, *tuple[type[Effect], ...]]


def _hidden(regression: Regression) -> dict[str, _Hidden | None]:
    """Of every other joint, why the readings cannot show a share of its angle, or None."""
    joints = regression.signals.coupled
    if not joints:
        return {}
    found: dict[str, _Hidden | None] = regression.of_pattern(
        f"hidden {JointCoupling.kind}",
        (*joints,),
        lambda: {joint: _hidden_by(regression, joint) for joint in joints},
    )
    return found


def _hidden_by(regression: Regression, joint: str) -> _Hidden | None:
    """Why the readings cannot show a share of this joint's angle, or None where they can."""
    signals = regression.signals
    own = _about_means(signals, signals.coupled[joint])
    if not own.any():
        return (f"joint {joint} is at rest in every run: its share is in the zeros of the runs",)
    angle = np.degrees(signals.theta)
    motion = np.column_stack([angle, _about_means(signals, angle)])
    if share_left(regression, own[:, None], motion) < OWN_POWER:
        return (
            f"joint {joint} moves in proportion to this joint: a share of its angle and a ramp in "
            "this one's own give the same readings",
            ScaleError,
        )
    others = {j: _about_means(signals, a) for j, a in signals.coupled.items() if j != joint}
    for other, angle in others.items():
        if share_left(regression, own[:, None], motion, angle[:, None]) < OWN_POWER:
            return (
                f"joints {joint} and {other} move in proportion: a share of either is the same",
            )
    rest = np.column_stack([*others.values()]) if others else np.zeros((len(signals), 0))
    if share_left(regression, own[:, None], motion, rest) < OWN_POWER:
        return (f"the motion of joint {joint} is made up of those of {', '.join(others)}",)
    return None


def _about_means(signals: Signals, angle: Array) -> Array:
    """The angle less its mean over each run, whose zero is free."""
    centred = angle.copy()
    for start, stop in signals.run_bounds():
        centred[start:stop] -= angle[start:stop].mean()
    # The residual of a joint at rest is rounding.
    return np.where(np.abs(centred) > 1e-12 * np.abs(angle).max(initial=0.0), centred, 0.0)
