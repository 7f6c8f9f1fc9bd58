"""Zero slip, drift within a run, scale error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any, ClassVar

import numpy as np

from ...simulation.effects import Effect, Surroundings
from ...simulation.effects.run_level import DriftWithinRun, ScaleError, ZeroSlip
from ...simulation.pattern import ARCSEC_PER_RAD
from ...simulation.signals import Signals
from ..space import Proposal, Space
from .candidate import Array, Candidate, Parameters, quantity

__all__ = ["DriftCandidate", "ScaleCandidate", "ZeroSlipCandidate"]

#: Half periods over one run that make up a wander.
WANDER_TERMS = 24

#: Time constant of settling, in shares of the run.
SETTLING = 0.4

#: Forms of a drift: from the start of the run, or about its mean.
FORMS = (
    "ramp",
    "settling",
    "walk",
    "flicker",
    "centred ramp",
    "centred walk",
    "centred flicker",
)

#: Of these as many are unlike each other: a slope, a bend, a finer wander.
UNLIKE_FORMS = 3.0


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
    """Run effect: a ramp, settling, a random walk or 1/f wander in time."""

    cause: ClassVar[str] = "drift_within_run"

    def propose(self, space: Space) -> Proposal | None:
        if space.has(self.cause):
            return None
        proposals = [self._proposal(space, form) for form in FORMS]
        best = max(proposals, key=lambda p: p.bic_gain)
        if best.bic_gain <= 0.0:
            return best
        # An error that comes back at the same place on the next pass in that direction is
        # no wander in time, nor is a new zero.
        beyond = space.without_repeats(by_direction=True)
        if beyond is space:
            return best
        if space.signals.runs > 1 and not space.has("zero_slip"):
            zero = beyond.propose_run_effect("zero_slip", {}, np.ones((space.n, 1)))
            beyond = beyond.with_terms([*beyond.terms, zero])
        deviance = self._proposal(beyond, best.shape["form"]).deviance
        return replace(best, deviance=min(best.deviance, deviance))

    def _proposal(self, space: Space, form: str) -> Proposal:
        columns = space.remembered(form, None, partial(self._shapes, space, form))
        log_grid = float(np.log(UNLIKE_FORMS))
        return space.propose_run_effect(self.cause, {"form": form}, columns, log_grid)

    @staticmethod
    def _shapes(space: Space, form: str) -> Array:
        """Columns of a drift, scaled so that it ends at variance 1 or about that."""
        u = np.zeros(space.n)
        for start, stop in space.bounds:
            clock = space.signals.clock[start:stop]
            u[start:stop] = (clock - clock[0]) / max(float(clock[-1] - clock[0]), 1e-300)
        k = np.arange(1, WANDER_TERMS + 1)
        if form == "ramp":
            return u[:, None]
        if form == "centred ramp":
            return u[:, None] - 0.5
        if form == "settling":
            return (1.0 - np.exp(-u / SETTLING))[:, None]
        if form == "walk":
            sines = np.sin(np.pi * np.outer(u, k - 0.5))
            return np.asarray(np.sqrt(2.0) * sines / (np.pi * (k - 0.5)))
        cosines = np.cos(np.pi * np.outer(u, k))
        if form == "centred walk":
            return np.asarray(np.sqrt(2.0) * cosines / (np.pi * k))
        if form == "flicker":
            cosines = cosines - 1.0
        return np.asarray(cosines / np.sqrt(k * np.log(WANDER_TERMS)))

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
        ramp = "ramp" in proposal.shape["form"]
        effect = DriftWithinRun(rate, 0.0) if ramp else DriftWithinRun(0.0, size)
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
