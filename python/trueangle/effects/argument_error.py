"""The pattern taken as a function of the wrong angle."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from ..estimation.extension import Extension
from ..estimation.regression import Regression
from ..joint.pattern import JointPattern
from ..joint.signals import Signals
from .drawing import Drawing
from .effect import Effect
from .missing_order import MissingOrder
from .search import Array
from .sidebands import Sidebands

#: How far from -1 the coefficient may be found.
ALLOWED = 0.5


@dataclass(frozen=True)
class ArgumentShift(Effect):
    """The pattern is a function of the indicated, not of the true angle.

    ::

        ε = -c [e - p(θ)],    e = p(θ + e) ≈ p + p p'

    Parameters
    ----------
    coefficient : float
        c: -1 (the pattern belongs to the indicated angle) or 0.
    """

    coefficient: float = -1.0

    kind: ClassVar[str] = "argument_error"
    size_most: ClassVar[float] = 1.0
    sentence: ClassVar[str] = (
        "The pattern was taken as a function of one angle and belongs to the other (indicated "
        "against true): it differs by the product of the pattern and its slope."
    )
    form_of: ClassVar[tuple[str, ...]] = ("place",)
    measure: ClassVar[str] = "free angles dense enough for the sums of the gear's orders"
    confused_with: ClassVar[Mapping[type[Effect], str]] = {
        MissingOrder: "free angles, with lines at the sums and differences of known orders",
        Sidebands: "free angles, with lines at the sums and differences of the known orders",
    }
    changes_lines: ClassVar[bool] = True

    def signal(self, signals: Signals, around: JointPattern, rng: np.random.Generator) -> Array:
        return np.asarray(self.coefficient * self.columns(signals, around, {})[:, 0])

    @classmethod
    def drawn(cls, size: float, of: Drawing) -> Self | None:
        if of.around.pattern.orders.size == 0:
            return None
        return cls(-1.0)  # the argument is one angle or the other: it has no other size

    @classmethod
    def propose(cls, regression: Regression) -> Extension | None:
        # Nothing is free in it: the evidence is that of c = -1 itself and no parameter is
        # paid for; c is fitted for the report only.
        if regression.around.pattern.orders.size == 0 or regression.has(cls.kind):
            return None
        columns = regression.of_pattern(
            cls.kind, None, lambda: cls.columns(regression.signals, regression.around, {})
        )
        deviance = float(regression.fixed_gains(-columns)[0])
        extension = regression.propose(cls.kind, {}, columns, parameters=0, deviance=deviance)
        # The pattern belongs to one angle or to the other: nothing lies beyond.
        return extension if abs(extension.coefficients[0] + 1.0) < ALLOWED else None

    @classmethod
    def columns(cls, signals: Signals, around: JointPattern, shape: dict[str, Any]) -> Array:
        """Column whose coefficient is c."""
        pattern = around.pattern
        change = pattern.indicated_value(signals.theta) - pattern.value(signals.theta)
        return np.asarray(-change[:, None])

    @property
    def changes_argument(self) -> bool:
        return self.coefficient != 0.0
