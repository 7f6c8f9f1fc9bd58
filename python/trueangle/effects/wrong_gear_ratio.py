"""All lines of the geared shafts at another ratio than the simulation's."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from ..estimation.extension import Extension
from ..estimation.quantity import quantity
from ..estimation.regression import Regression
from ..joint.joint import Joint
from ..joint.pattern import JointPattern, Pattern, line_columns
from ..joint.shafts import shaft_cycles
from ..joint.signals import Signals
from .drawing import Drawing
from .effect import Effect, Reported
from .missing_order import MissingOrder
from .search import Array, Fitted
from .sidebands import Sidebands

#: Share of the power of the assumed lines that may be left at their own places.
ABSENT = 0.3

#: Share by which what ratios explain at even steps may differ: by rounding.
SAME = 1e-6


@dataclass(frozen=True)
class WrongGearRatio(Effect):
    """The geared lines are at the orders of another ratio.

    ::

        ε = p_r(θ) - p(θ)

    with ``p_r`` the simulation's pattern on a joint of ratio r.

    Parameters
    ----------
    gear_ratio : float
        r: motor turns per output turn as the readings have it.
    """

    gear_ratio: float

    kind: ClassVar[str] = "wrong_gear_ratio"
    size_name: ClassVar[str] = "gear_ratio_departure"
    size_most: ClassVar[float] = 1.0
    sentence: ClassVar[str] = (
        "The simulation uses another gear ratio than the joint has: all lines of the "
        "motor and the wave generator are at other orders."
    )
    form_of: ClassVar[tuple[str, ...]] = ("place",)
    confused_with: ClassVar[Mapping[type[Effect], str]] = {
        MissingOrder: "count the motor's turns in one turn of the output",
        Sidebands: "count the motor's turns in one turn of the output",
    }
    measure: ClassVar[str] = "free angles, dense enough for the orders of the gear"
    located: ClassVar[bool] = True
    changes_lines: ClassVar[bool] = True
    not_at_run_time: ClassVar[str] = "change the ratio in the simulation file, then fit again"

    def __post_init__(self) -> None:
        shaft_cycles(self.gear_ratio, "none")  # refuses what is no ratio

    def signal(self, signals: Signals, around: JointPattern, rng: np.random.Generator) -> Array:
        orders = _moved(around.joint, around.pattern, self.gear_ratio)
        pattern = Pattern(np.array(orders), around.pattern.cosine, around.pattern.sine)
        return pattern.value(signals.theta) - around.pattern.value(signals.theta)

    @classmethod
    def drawn(cls, size: float, of: Drawing) -> Self | None:
        ratio = of.around.joint.gear_ratio
        if ratio == 1.0 or of.carrier() is None:
            return None
        return cls(ratio + size * float(of.rng.choice([-1.0, 1.0])))

    @classmethod
    def propose(cls, regression: Regression) -> Extension | None:
        joint, pattern = regression.belief.joint, regression.belief.pattern
        geared = _geared(joint, pattern)
        # Lines of geared shafts that one ratio must explain at once: one alone is a missing order.
        if geared.size < 2 or regression.has(cls.kind) or cls._are_there(regression):
            return None
        gains = dict(zip(regression.lines.orders.tolist(), regression.line_gains(), strict=True))
        top = int(max(gains) / max(pattern.orders[geared] / joint.shafts["motor"]))
        whole = (math.copysign(r, joint.gear_ratio) for r in range(2, top + 1))
        ratios = [ratio for ratio in whole if ratio != joint.gear_ratio]

        def score(ratio: float) -> float:
            orders = np.array(_moved(joint, pattern, ratio))[geared]
            return float(sum(gains.get(float(m), 0.0) for m in orders))

        if not ratios:
            return None
        scores = np.array([score(ratio) for ratio in ratios])
        # At even steps several are the same numbers: the nearest to the assumed one is meant.
        alike = [ratios[k] for k in np.flatnonzero(scores > (1.0 - SAME) * scores.max())]
        ratio = min(alike, key=lambda ratio: abs(ratio - joint.gear_ratio))
        orders = np.array(_moved(joint, pattern, ratio))[geared]
        others = [other for other in alike if other != ratio]
        shape = {"gear_ratio": ratio, "orders": orders.tolist(), "alike": others}
        columns = cls.columns(regression.signals, regression.around, shape)
        log_grid = float(np.log(len(ratios)))
        return regression.propose(cls.kind, shape, columns, columns.shape[1] + 1, log_grid)

    @staticmethod
    def _are_there(regression: Regression) -> bool:
        """Whether the assumed lines are at their assumed orders."""
        pattern = regression.belief.pattern
        geared = _geared(regression.belief.joint, pattern)
        # Measured less simulated, so a line that is not there leaves its negative.
        change = regression.coefficients[1 : 1 + 2 * pattern.orders.size].reshape(-1, 2)[geared]
        believed = np.column_stack([pattern.cosine, pattern.sine])[geared]
        return float(((change + believed) ** 2).sum()) > ABSENT * float((believed**2).sum())

    @classmethod
    def columns(cls, signals: Signals, around: JointPattern, shape: dict[str, Any]) -> Array:
        return np.hstack([line_columns(signals.theta, m) for m in shape["orders"]])

    @classmethod
    def report(cls, regression: Regression, terms: Sequence[Fitted]) -> Reported:
        shape = terms[0][0].shape
        parameters = {
            "gear_ratio": quantity(shape["gear_ratio"]),
            "orders": quantity(shape["orders"]),
        }
        if shape["alike"]:
            parameters["aliases"] = quantity(shape["alike"])
        return parameters, [WrongGearRatio(shape["gear_ratio"])]


def _geared(joint: Joint, pattern: Pattern) -> np.ndarray[Any, np.dtype[np.int64]]:
    """Places of the lines of geared shafts in the pattern."""
    named = [joint.name_order(float(m)) for m in pattern.orders]
    return np.array([k for k, n in enumerate(named) if n and n[0] != "output"], dtype=np.int64)


def _moved(joint: Joint, pattern: Pattern, ratio: float) -> list[float]:
    """Orders of the pattern on a joint of another ratio."""
    cycles = shaft_cycles(ratio, joint.fixed_member)
    named = [joint.name_order(float(m)) for m in pattern.orders]
    return [
        name[1] * cycles[name[0]] if name and name[0] in cycles else float(m)
        for name, m in zip(named, pattern.orders, strict=True)
    ]
