"""Structure without a name, in lines and modulators: it competes with the causes that have one.

A discrepancy that is allowed to be unexplained (Kennedy and O'Hagan 2001). Three kinds are
offered: a pattern of the angle times something that was measured (direction, speed, load,
temperature and their products with direction), a pattern that every run draws anew, and a line
in time that every run draws anew. What they take is not named; it is left to `unexplained`.
"""

from __future__ import annotations

from typing import Any, ClassVar

import numpy as np

from ..effects import EFFECTS, Effect
from ..effects.time_periodic import FREQUENCY_DRIFT, TimePeriodic
from ..estimation.extension import Extension
from ..estimation.regression import Regression
from ..joint.lines import line_columns
from ..joint.pattern import JointPattern
from ..joint.signals import Signals
from ..support.arrays import Array
from .goodness.periodogram import periodogram

#: Spread, in shares of its size, from which on a channel counts as changing.
CHANGES = 0.05

#: Orders of bands of the lowest orders that are offered together.
BANDS = (4, 8)

#: Orders of a pattern that every run draws anew.
OWN_ORDERS = (4, 10)

#: Channels in addition to the direction.
CHANNELS = ("speed", "temperature", "torque", "load")

#: False-alarm probability of a line in time from which on it is offered.
LINE = 1e-4

#: Best lines of the quick search that are scored exactly.
PEAKS = 3


def modulators(signals: Signals) -> dict[str, tuple[float, float]]:
    """What a pattern of the angle may be multiplied with: mean and spread by name."""
    found: dict[str, tuple[float, float]] = {}
    direction = signals.direction
    both = bool(np.ptp(direction[direction != 0.0]) > 0.0) if direction.any() else False
    if both:
        found["direction"] = (0.0, 1.0)
    for name in CHANNELS:
        values = _channel(signals, name)
        if values is None:
            continue
        spread = float(np.std(values))
        if spread <= CHANGES * float(np.abs(values).max(initial=0.0)) or spread == 0.0:
            continue
        found[name] = (float(values.mean()), spread)
        if both:
            found[f"direction {name}"] = found[name]
    return found


def _channel(signals: Signals, name: str) -> Array | None:
    if name == "speed":
        return None if signals.velocity is None else np.abs(signals.velocity)
    if name == "load":
        return None if signals.torque is None else np.abs(signals.torque)
    return signals.temperature if name == "temperature" else signals.torque


def modulator(signals: Signals, name: str, mean: float, spread: float) -> Array | None:
    """The modulator at readings, in units of its spread where it was found."""
    if name == "direction":
        return signals.direction
    values = _channel(signals, name.removeprefix("direction "))
    if values is None:
        return None
    g = (values - mean) / spread
    return g * signals.direction if name.startswith("direction") else g


class UnnamedPattern(Effect):
    """A modulator times lines of the angle, or alone."""

    sentence: ClassVar[str] = "A pattern of the angle that follows something else, without a name."
    is_separate: ClassVar[bool] = True

    @classmethod
    def propose(cls, regression: Regression) -> Extension | None:
        """The modulator and orders with the most evidence."""
        signals = regression.signals
        known = regression.cache.of_motion("modulators", None, lambda: modulators(signals))
        if not known:
            return None
        orders = regression.lines.orders
        wave = regression.lines.values
        trials: list[tuple[float, dict[str, Any]]] = []
        r = regression.left_within_runs * (~regression.outlying)
        for name, (mean, spread) in known.items():
            g = modulator(signals, name, mean, spread)
            assert g is not None
            by = {"by": name, "mean": mean, "spread": spread}
            moment = ((g * r).astype(np.float32) @ wave).astype(np.float64)
            power = float(g @ g) * regression.variance
            saved = 2.0 * (moment[0::2] ** 2 + moment[1::2] ** 2) / power
            for k in np.argsort(saved)[::-1][:PEAKS]:
                trials.append((float(saved[k]), {**by, "orders": [float(orders[k])]}))
            for band in BANDS:
                low = [float(m) for m in range(1, band + 1)]
                trials.append((float(saved[:band].sum()), {**by, "orders": low}))
            if " " in name:
                trials.append((float((g @ r) ** 2) / power, {**by, "orders": []}))
        trials.sort(key=lambda t: -(t[0] - 2.0 * len(t[1]["orders"]) * regression.log_n))
        best: Extension | None = None
        for _, shape in trials[:PEAKS]:
            columns = cls.columns(signals, regression.around, shape)
            count = len(known) * (orders.size if len(shape["orders"]) == 1 else 2.0)
            extension = regression.propose(
                UNNAMED_PATTERN, shape, columns, log_grid=float(np.log(count))
            )
            if best is None or extension.bic_gain > best.bic_gain:
                best = extension
        return best

    @classmethod
    def columns(cls, signals: Signals, around: JointPattern, shape: dict[str, Any]) -> Array:
        """The modulator times cosine and sine of every order."""
        g = modulator(signals, shape["by"], shape["mean"], shape["spread"])
        if g is None:
            return np.zeros((len(signals), max(2 * len(shape["orders"]), 1)))
        if not shape["orders"]:
            return np.asarray(g[:, None])
        return np.hstack([g[:, None] * line_columns(signals.theta, m) for m in shape["orders"]])


class UnnamedLine(Effect):
    """A pattern, or a line in time, that every run draws anew."""

    sentence: ClassVar[str] = "Structure that every run draws anew, without a name."
    transfers: ClassVar[bool] = False
    is_separate: ClassVar[bool] = True
    flexible_below: ClassVar[float] = np.inf

    @classmethod
    def propose(cls, regression: Regression) -> Extension | None:
        """Low orders of the angle in single runs, or a significant line in time."""
        if regression.signals.runs < 2:
            return None
        trials = [cls._own_orders(regression, top) for top in OWN_ORDERS]
        line = cls._line_in_time(regression)
        if line is not None:
            trials.append(line)
        return max(trials, key=lambda t: t.bic_gain)

    @staticmethod
    def _own_orders(regression: Regression, top: int) -> Extension:
        """Orders of the angle in single runs, beyond those of all runs, which have names."""
        theta = regression.signals.theta
        columns = np.hstack([line_columns(theta, m) for m in range(1, top + 1)])
        return regression.jointly_with(columns).propose_run_effect(
            UNNAMED_LINE, {"orders": top}, columns / np.sqrt(top), float(np.log(3.0))
        )

    @staticmethod
    def _line_in_time(regression: Regression) -> Extension | None:
        """A significant line, unless one with a name is close to it."""
        signals = regression.signals
        left = regression.left_within_runs
        left = left * ~regression.outlying
        rho = regression.whiten.rho
        found = periodogram(left, signals.clock, regression.bounds, correlation=rho)
        if found is None or found.p > LINE:
            return None
        if any(is_line_of(term, found.peak) for term in regression.terms):
            return None
        x = 2.0 * np.pi * found.peak * signals.clock
        return regression.propose_run_effect(
            UNNAMED_LINE,
            {"frequency": found.peak},
            np.column_stack([np.cos(x), np.sin(x)]),
            float(np.log(max(found.frequency.size, 2))),
        )


UNNAMED_PATTERN, UNNAMED_LINE = "unnamed pattern", "unnamed line"

# Given after the classes were made: a kind in the class would join the vocabulary.
UnnamedPattern.kind = UNNAMED_PATTERN
UnnamedLine.kind = UNNAMED_LINE

#: Structure without a name, as selection takes it.
UNNAMED: dict[str, type[Effect]] = {UNNAMED_PATTERN: UnnamedPattern, UNNAMED_LINE: UnnamedLine}


def effect_or_unnamed(cause: str) -> type[Effect]:
    """The effect of a cause, or the structure without a name."""
    return EFFECTS[cause] if cause in EFFECTS else UNNAMED[cause]


def is_named(term: Extension) -> bool:
    """The term is one of the vocabulary."""
    return term.cause in EFFECTS


def is_line_in_time(term: Extension) -> bool:
    """The term is a line in time that has a name."""
    return term.cause == TimePeriodic.kind


def is_line_of(term: Extension, frequency: float) -> bool:
    """The term is a line in time whose frequencies drift about as far as this one."""
    if not is_line_in_time(term):
        return False
    own = np.asarray(term.shape["frequency_hz"], dtype=np.float64)
    return bool(
        own.min() * (1.0 - FREQUENCY_DRIFT) <= frequency <= own.max() * (1.0 + FREQUENCY_DRIFT)
    )
