"""Latency and filter lag."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from ...simulation.effects import Effect, Surroundings
from ...simulation.effects.motion import FilterLag, Latency
from ...simulation.signals import Signals
from ..space import Proposal, Space
from .candidate import Array, Candidate, Parameters, golden_maximum, quantity

__all__ = ["FilterLagCandidate", "LatencyCandidate"]

#: Cutoffs searched, in multiples of the highest frequency at which a line passes.
CUTOFFS = np.geomspace(0.2, 3000.0, 18)

#: Damping ratios of a second-order loop; None is the first-order filter.
DAMPING = (None, 0.7)


class LatencyCandidate(Candidate):
    """Regressor: minus velocity, with the pattern's slope."""

    cause: ClassVar[str] = "latency"

    def propose(self, space: Space) -> Proposal | None:
        if space.signals.velocity is None:
            return None
        return space.propose(self.cause, {}, self.columns(space.signals, space.around, {}))

    def columns(self, signals: Signals, around: Surroundings, shape: dict[str, Any]) -> Array:
        return Latency.regressors(signals, around)

    def report(
        self, space: Space, terms: Sequence[tuple[Proposal, Array, Array]]
    ) -> tuple[Parameters, list[Effect]]:
        _, (delay,), covariance = terms[0]
        std = float(np.sqrt(covariance[0, 0]))
        return {"delay_s": quantity(delay, std)}, [Latency(float(delay))]


class FilterLagCandidate(Candidate):
    """The pattern through a low-pass, less the pattern; its cutoff is searched."""

    cause: ClassVar[str] = "filter_lag"
    located: ClassVar[bool] = True

    def propose(self, space: Space) -> Proposal | None:
        signals, pattern = space.signals, space.around.pattern
        if signals.velocity is None or pattern.orders.size == 0 or space.has(self.cause):
            return None
        top = float(pattern.orders.max() * np.abs(signals.turns_per_s).max())
        if top == 0.0:
            return None
        best: tuple[float, float, float | None] = (0.0, 0.0, None)
        for damping in DAMPING:
            shapes = [{"cutoff_hz": top * c, "damping": damping} for c in CUTOFFS]
            gains = space.fixed_gains(
                np.hstack([self.columns(signals, space.around, shape) for shape in shapes])
            )
            k = int(np.argmax(gains))
            if gains[k] > best[0] + 1e-9:
                best = (float(gains[k]), float(top * CUTOFFS[k]), damping)
        if best[0] <= 0.0:
            return None
        _, cutoff, damping = best

        def gain(log_cutoff: float) -> float:
            shape = {"cutoff_hz": float(np.exp(log_cutoff)), "damping": damping}
            return float(space.fixed_gains(self.columns(signals, space.around, shape))[0])

        step = np.log(CUTOFFS[1] / CUTOFFS[0])
        log_cutoff, deviance = golden_maximum(gain, np.log(cutoff) - step, np.log(cutoff) + step)
        shape = {"cutoff_hz": float(np.exp(log_cutoff)), "damping": damping}
        return space.propose(
            self.cause,
            shape,
            self.columns(signals, space.around, shape),
            parameters=1,
            log_grid=float(np.log(len(DAMPING))),
            deviance=deviance,
        )

    def columns(self, signals: Signals, around: Surroundings, shape: dict[str, Any]) -> Array:
        cutoff, damping = shape["cutoff_hz"], shape["damping"]

        def response(frequency: Array) -> Any:
            w = frequency / cutoff
            if damping is None:
                return 1.0 / (1.0 + 1j * w)
            return 1.0 / (1.0 - w**2 + 2j * damping * w)

        pattern = around.pattern
        seen = pattern.passed(signals.theta, signals.turns_per_s, response)
        return np.asarray((seen - pattern.value(signals.theta))[:, None])

    def report(
        self, space: Space, terms: Sequence[tuple[Proposal, Array, Array]]
    ) -> tuple[Parameters, list[Effect]]:
        proposal, (scale,), covariance = terms[0]
        cutoff = proposal.shape["cutoff_hz"]
        relative = float(np.sqrt(covariance[0, 0])) / max(abs(float(scale)), 1e-12)
        damping = proposal.shape["damping"]
        # Far below the cutoff both delay by 1/(2 pi f_c) and 2 zeta/(2 pi f_n).
        equivalent = cutoff if damping is None else cutoff / (2.0 * damping)
        parameters = {"cutoff_hz": quantity(equivalent, equivalent * relative)}
        if damping is not None:
            parameters["natural_frequency_hz"] = quantity(cutoff, cutoff * relative)
            parameters["damping"] = quantity(damping)
        return parameters, [FilterLag(equivalent)]
