"""Zero slip, drift within a run, scale error."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any, ClassVar

import numpy as np

from ...simulation.effects import Effect, Surroundings
from ...simulation.effects.run_level import DriftWithinRun, ScaleError, ZeroSlip
from ...simulation.pattern import ARCSEC_PER_RAD
from ...simulation.signals import Signals
from ..space import Proposal, Space
from .candidate import Array, Candidate, Parameters, quantity

__all__ = ["DriftCandidate", "ScaleCandidate", "ZeroSlipCandidate"]

#: Terms of a random walk's expansion over one run.
WALK_TERMS = 8


class ZeroSlipCandidate(Candidate):
    """Run effect: a constant."""

    cause: ClassVar[str] = "zero_slip"

    def propose(self, space: Space) -> Proposal | None:
        if space.signals.runs < 2 or space.has(self.cause):
            return None
        return space.propose_run_effect(self.cause, {}, np.ones((space.n, 1)))

    def columns(self, signals: Signals, around: Surroundings, shape: dict[str, Any]) -> Array:
        return np.zeros((len(signals), 0))

    def report(
        self, space: Space, terms: Sequence[tuple[Proposal, Array, Array]]
    ) -> tuple[Parameters, list[Effect]]:
        effect = terms[0][0].run_effect
        assert effect is not None
        size = float(np.sqrt(effect.ratio * space.variance))
        std = size / np.sqrt(2.0 * max(space.signals.runs - 1, 1))
        return {"standard_deviation_arcsec": quantity(size, std)}, [ZeroSlip(size)]


class DriftCandidate(Candidate):
    """Run effect: a ramp or a random walk in time, from the start or about the mean."""

    cause: ClassVar[str] = "drift_within_run"

    def propose(self, space: Space) -> Proposal | None:
        if space.has(self.cause):
            return None
        kinds = ("ramp", "walk", "centred ramp", "centred walk")
        proposals = [
            space.propose_run_effect(
                self.cause,
                {"form": kind},
                self._shapes(space, kind),
                log_grid=float(np.log(len(kinds))),
            )
            for kind in kinds
        ]
        return max(proposals, key=lambda p: p.bic_gain)

    @staticmethod
    def _shapes(space: Space, kind: str) -> Array:
        """Ramp from 0 to 1, or the terms of a random walk that ends at variance 1."""
        u = np.zeros(space.n)
        for start, stop in space.bounds:
            clock = space.signals.clock[start:stop]
            u[start:stop] = (clock - clock[0]) / max(float(clock[-1] - clock[0]), 1e-300)
        k = np.arange(1, WALK_TERMS + 1)
        if kind == "ramp":
            return u[:, None]
        if kind == "centred ramp":
            return u[:, None] - 0.5
        if kind == "walk":
            sines = np.sin(np.pi * np.outer(u, k - 0.5))
            return np.asarray(np.sqrt(2.0) * sines / (np.pi * (k - 0.5)))
        return np.asarray(np.sqrt(2.0) * np.cos(np.pi * np.outer(u, k)) / (np.pi * k))

    def columns(self, signals: Signals, around: Surroundings, shape: dict[str, Any]) -> Array:
        return np.zeros((len(signals), 0))

    def report(
        self, space: Space, terms: Sequence[tuple[Proposal, Array, Array]]
    ) -> tuple[Parameters, list[Effect]]:
        proposal = terms[0][0]
        assert proposal.run_effect is not None
        size = float(np.sqrt(proposal.run_effect.ratio * space.variance))
        clock = space.signals.clock
        spans = [float(clock[stop - 1] - clock[start]) for start, stop in space.bounds]
        rate = size / max(float(np.mean(spans)), 1e-300)
        share = 1.0 / np.sqrt(2.0 * max(space.signals.runs, 1))
        parameters = {
            "arcsec_per_s": quantity(rate, rate * share),
            "arcsec_per_run": quantity(size, size * share),
            "form": quantity(proposal.shape["form"].replace("centred ", "")),
        }
        if space.signals.time is None:
            parameters["arcsec_per_s"] = quantity(None)
        walk = "walk" in proposal.shape["form"]
        effect = DriftWithinRun(0.0, size) if walk else DriftWithinRun(rate, 0.0)
        return parameters, [effect]


class ScaleCandidate(Candidate):
    """Regressor: the unwrapped angle, from its own zero or from each run's start."""

    cause: ClassVar[str] = "scale_error"

    def propose(self, space: Space) -> Proposal | None:
        if space.has(self.cause):
            return None
        proposals = [
            space.propose(
                self.cause,
                shape,
                self.columns(space.signals, space.around, shape),
                log_grid=float(np.log(2.0)),
            )
            for shape in ({"from": "zero"}, {"from": "start"})
        ]
        return max(proposals, key=lambda p: p.bic_gain)

    def columns(self, signals: Signals, around: Surroundings, shape: dict[str, Any]) -> Array:
        angle = signals.theta
        if shape["from"] == "start":
            angle = angle.copy()
            for start, stop in signals.run_bounds():
                angle[start:stop] -= angle[start]
        return (ARCSEC_PER_RAD * angle)[:, None]

    def report(
        self, space: Space, terms: Sequence[tuple[Proposal, Array, Array]]
    ) -> tuple[Parameters, list[Effect]]:
        _, (scale,), covariance = terms[0]
        std = float(np.sqrt(covariance[0, 0]))
        return {"relative_error": quantity(scale, std)}, [ScaleError(float(scale))]
