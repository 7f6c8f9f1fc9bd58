"""Latency and filter lag."""

from __future__ import annotations

from collections.abc import Sequence
from functools import partial
from typing import Any, ClassVar

import numpy as np
from numpy.typing import NDArray

from ...joint.pattern import Pattern, Surroundings
from ...joint.signals import Signals
from ...regression.regression import Extension, Regression
from ...simulation.effects import Effect
from ...simulation.effects.motion import FilterLag, Latency
from .candidate import Array, Candidate, Parameters, golden_maximum, quantity

__all__ = ["FilterLagCandidate", "LatencyCandidate"]

#: Cutoffs searched, in multiples of the highest frequency at which a line passes.
CUTOFFS = np.geomspace(0.2, 3000.0, 12)

#: The coarse search must promise some of what a new cause needs to be worth refining.
REFINED_FROM = 3.0

#: Damping ratios of a second-order loop.
DAMPING = (0.4, 0.7, 1.1)


class LatencyCandidate(Candidate):
    """Regressor: minus velocity, with the pattern's slope."""

    cause: ClassVar[str] = "latency"

    def propose(self, regression: Regression) -> Extension | None:
        if regression.signals.velocity is None or regression.has(self.cause):
            return None
        columns = regression.remembered(
            self.cause, None, lambda: self.columns(regression.signals, regression.around, {})
        )
        return regression.propose(self.cause, {}, columns)

    def columns(self, signals: Signals, around: Surroundings, shape: dict[str, Any]) -> Array:
        return Latency.regressors(signals, around)

    def report(
        self, regression: Regression, terms: Sequence[tuple[Extension, Array, Array]]
    ) -> tuple[Parameters, list[Effect]]:
        _, (delay,), covariance = terms[0]
        std = float(np.sqrt(covariance[0, 0]))
        return {"delay_s": quantity(delay, std)}, [Latency(float(delay))]


class FilterLagCandidate(Candidate):
    """The pattern through a low-pass, less the pattern; its cutoff is searched.

    First order, or a loop of second order whose damping is searched as well.
    """

    cause: ClassVar[str] = "filter_lag"
    located: ClassVar[bool] = True

    def propose(self, regression: Regression) -> Extension | None:
        signals, pattern = regression.signals, regression.around.pattern
        if signals.velocity is None or pattern.orders.size == 0 or regression.has(self.cause):
            return None
        top = float(pattern.orders.max() * np.abs(signals.turns_per_s).max())
        if top == 0.0:
            return None
        waves, frequency = regression.remembered(
            "waves",
            None,
            lambda: (
                _waves(pattern, signals.theta),
                pattern.orders * signals.turns_per_s[:, None],
            ),
        )

        def gain(cutoff: float, damping: float | None) -> float:
            column = _lagged(waves, frequency, cutoff, damping)
            return float(regression.fixed_gains(column[:, None])[0])

        cutoffs = top * CUTOFFS

        def grid(damping: float | None) -> Array:
            columns = regression.remembered(
                f"lagged {damping}",
                None,
                lambda: np.column_stack(
                    [_lagged(waves, frequency, float(c), damping) for c in cutoffs]
                ),
            )
            return regression.fixed_gains(columns)

        grids: dict[float | None, Array] = {None: grid(None)}
        if not regression.hopeless(float(grids[None].max()), 1, REFINED_FROM):
            grids |= {damping: grid(damping) for damping in DAMPING}
        step = float(np.log(CUTOFFS[1] / CUTOFFS[0]))
        best: Extension | None = None
        for order in (1, 2):
            if order == 2 and len(grids) == 1:
                break
            damping = None if order == 1 else max(DAMPING, key=lambda d: float(grids[d].max()))
            cutoff = float(cutoffs[int(np.argmax(grids[damping]))])
            deviance = float(grids[damping].max())
            if deviance <= 0.0:
                continue
            for width in (step, 0.3 * step) if len(grids) > 1 else ():
                f = partial(gain, damping=damping)
                x, deviance = golden_maximum(
                    lambda x, f=f: f(float(np.exp(x))),  # type: ignore[misc]
                    np.log(cutoff) - width,
                    np.log(cutoff) + width,
                    10,
                )
                cutoff = float(np.exp(x))
                if damping is None:
                    break
                damping, deviance = golden_maximum(
                    partial(gain, cutoff), 0.7 * damping, 1.4 * damping, 8
                )
            shape = {"cutoff_hz": cutoff, "damping": damping}
            extension = regression.propose(
                self.cause,
                shape,
                _lagged(waves, frequency, cutoff, damping)[:, None],
                parameters=order,
                deviance=deviance,
            )
            if best is None or extension.bic_gain > best.bic_gain:
                best = extension
        return best

    def columns(self, signals: Signals, around: Surroundings, shape: dict[str, Any]) -> Array:
        waves = _waves(around.pattern, signals.theta)
        frequency = around.pattern.orders * signals.turns_per_s[:, None]
        return _lagged(waves, frequency, shape["cutoff_hz"], shape["damping"])[:, None]

    def report(
        self, regression: Regression, terms: Sequence[tuple[Extension, Array, Array]]
    ) -> tuple[Parameters, list[Effect]]:
        extension = terms[0][0]
        cutoff, damping = extension.shape["cutoff_hz"], extension.shape["damping"]
        waves = _waves(regression.around.pattern, regression.signals.theta)
        frequency = regression.around.pattern.orders * regression.signals.turns_per_s[:, None]
        step = 0.01

        def slope(cutoff_step: float, damping_step: float) -> Array:
            up, down = (
                _lagged(
                    waves,
                    frequency,
                    cutoff * float(np.exp(sign * cutoff_step)),
                    None if damping is None else damping * float(np.exp(sign * damping_step)),
                )
                for sign in (1.0, -1.0)
            )
            return np.asarray((up - down) / (2.0 * step))

        slopes = [slope(step, 0.0)] if damping is None else [slope(step, 0.0), slope(0.0, step)]
        others = regression.with_terms(term for term in regression.terms if term is not extension)
        x, _ = others.projected(np.column_stack(slopes))
        covariance = regression.variance * np.linalg.pinv(x.T @ x)
        # Far below the cutoff both delay by 1/(2 pi f_c) and 2 zeta/(2 pi f_n).
        delay = np.array([1.0] if damping is None else [1.0, -1.0])
        equivalent = cutoff if damping is None else cutoff / (2.0 * damping)
        relative = float(np.sqrt(delay @ covariance @ delay))
        parameters = {"cutoff_hz": quantity(equivalent, equivalent * relative)}
        if damping is not None:
            std = np.sqrt(np.diag(covariance))
            parameters["natural_frequency_hz"] = quantity(cutoff, cutoff * std[0])
            parameters["damping"] = quantity(damping, damping * std[1])
        return parameters, [FilterLag(equivalent)]


def _waves(pattern: Pattern, theta: Array) -> NDArray[np.complex128]:
    """Complex lines of a pattern, shape (n, k): their real parts add up to it."""
    amplitudes = pattern.cosine - 1j * pattern.sine
    return np.asarray(amplitudes * np.exp(1j * theta[:, None] * pattern.orders))


def _lagged(
    waves: NDArray[np.complex128], frequency: Array, cutoff: float, damping: float | None
) -> Array:
    """Change of the pattern by a low-pass of first or second order."""
    w = frequency / cutoff
    if damping is None:
        change = -1j * w / (1.0 + 1j * w)
    else:
        change = (w**2 - 2j * damping * w) / (1.0 - w**2 + 2j * damping * w)
    return np.asarray((waves * change).real.sum(axis=1))
