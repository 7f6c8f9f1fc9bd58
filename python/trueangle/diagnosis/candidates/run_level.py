"""Zero slip, drift within a run, scale error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial
from typing import Any, ClassVar

import numpy as np

from ...joint.pattern import ARCSEC_PER_RAD, Surroundings
from ...joint.signals import Signals
from ...regression.regression import Extension, Regression
from ...simulation.effects import Effect
from ...simulation.effects.run_level import DriftWithinRun, ScaleError, ZeroSlip
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

    def propose(self, regression: Regression) -> Extension | None:
        if regression.signals.runs < 2 or regression.has(self.cause):
            return None
        return regression.propose_run_effect(self.cause, {}, np.ones((regression.n, 1)))

    def columns(self, signals: Signals, around: Surroundings, shape: dict[str, Any]) -> Array:
        return np.zeros((len(signals), 0))

    def report(
        self, regression: Regression, terms: Sequence[tuple[Extension, Array, Array]]
    ) -> tuple[Parameters, list[Effect]]:
        effect = terms[0][0].run_effect
        assert effect is not None
        size = float(np.sqrt(effect.ratio * regression.variance))
        std = size / np.sqrt(2.0 * max(regression.signals.runs - 1, 1))
        return {"standard_deviation_arcsec": quantity(size, std)}, [ZeroSlip(size)]


class DriftCandidate(Candidate):
    """Run effect: a ramp, settling, a random walk or 1/f wander in time."""

    cause: ClassVar[str] = "drift_within_run"

    def propose(self, regression: Regression) -> Extension | None:
        if regression.has(self.cause):
            return None
        extensions = [self._proposal(regression, form) for form in FORMS]
        best = max(extensions, key=lambda p: p.bic_gain)
        if best.bic_gain <= 0.0:
            return best
        # An error that comes back at the same place on the next pass in that direction is
        # no wander in time, nor is a new zero.
        beyond = regression.without_repeats(by_direction=True)
        if beyond is regression:
            return best
        if regression.signals.runs > 1 and not regression.has("zero_slip"):
            zero = beyond.propose_run_effect("zero_slip", {}, np.ones((regression.n, 1)))
            beyond = beyond.with_terms([*beyond.terms, zero])
        deviance = self._proposal(beyond, best.shape["form"]).deviance
        return replace(best, deviance=min(best.deviance, deviance))

    def _proposal(self, regression: Regression, form: str) -> Extension:
        columns = regression.remembered(form, None, partial(self._shapes, regression, form))
        log_grid = float(np.log(UNLIKE_FORMS))
        return regression.propose_run_effect(self.cause, {"form": form}, columns, log_grid)

    @staticmethod
    def _shapes(regression: Regression, form: str) -> Array:
        """Columns of a drift, scaled so that it ends at variance 1 or about that."""
        u = np.zeros(regression.n)
        for start, stop in regression.bounds:
            clock = regression.signals.clock[start:stop]
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
        self, regression: Regression, terms: Sequence[tuple[Extension, Array, Array]]
    ) -> tuple[Parameters, list[Effect]]:
        extension = terms[0][0]
        assert extension.run_effect is not None
        size = float(np.sqrt(extension.run_effect.ratio * regression.variance))
        clock = regression.signals.clock
        spans = [float(clock[stop - 1] - clock[start]) for start, stop in regression.bounds]
        rate = size / max(float(np.mean(spans)), 1e-300)
        share = 1.0 / np.sqrt(2.0 * max(regression.signals.runs, 1))
        parameters = {
            "arcsec_per_s": quantity(rate, rate * share),
            "arcsec_per_run": quantity(size, size * share),
            "form": quantity(extension.shape["form"].replace("centred ", "")),
        }
        if regression.signals.time is None:
            parameters["arcsec_per_s"] = quantity(None)
        ramp = "ramp" in extension.shape["form"]
        effect = DriftWithinRun(rate, 0.0) if ramp else DriftWithinRun(0.0, size)
        return parameters, [effect]


class ScaleCandidate(Candidate):
    """Regressor: the unwrapped angle, from its own zero or from each run's start."""

    cause: ClassVar[str] = "scale_error"

    def propose(self, regression: Regression) -> Extension | None:
        if regression.has(self.cause):
            return None
        extensions = [
            regression.propose(
                self.cause,
                shape,
                self.columns(regression.signals, regression.around, shape),
                log_grid=float(np.log(2.0)),
            )
            for shape in ({"from": "zero"}, {"from": "start"})
        ]
        return max(extensions, key=lambda p: p.bic_gain)

    def columns(self, signals: Signals, around: Surroundings, shape: dict[str, Any]) -> Array:
        angle = signals.theta
        if shape["from"] == "start":
            angle = angle.copy()
            for start, stop in signals.run_bounds():
                angle[start:stop] -= angle[start]
        return (ARCSEC_PER_RAD * angle)[:, None]

    def report(
        self, regression: Regression, terms: Sequence[tuple[Extension, Array, Array]]
    ) -> tuple[Parameters, list[Effect]]:
        _, (scale,), covariance = terms[0]
        std = float(np.sqrt(covariance[0, 0]))
        return {"relative_error": quantity(scale, std)}, [ScaleError(float(scale))]
