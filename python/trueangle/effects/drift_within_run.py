"""Ramps and drift in time, new in every run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import ClassVar, Self

import numpy as np

import trueangle._core as _core

from ..estimation.extension import Extension
from ..estimation.quantity import quantity
from ..estimation.regression import Regression
from ..estimation.whitening import drift_basis
from ..joint.pattern import JointPattern
from ..joint.signals import Signals
from ..support.layout import counted
from .ambiguity import OWN_OF_VELOCITY, RUNS_PER_LEVEL, Ambiguity, share_left
from .backlash import Backlash
from .drawing import Drawing
from .effect import ALWAYS, Effect, Reported, Spots
from .latency import Latency
from .missing_order import MissingOrder
from .presliding_hysteresis import PreslidingHysteresis
from .scale_error import ScaleError
from .search import Array, Fitted
from .thermal_drift import ThermalDrift
from .zero_slip import ZeroSlip

#: Half periods over one run that make up a drift: at first, and at most.
DRIFT_TERMS, MOST_TERMS = 24, 96

#: Power of the last of them, in variances of one reading, from which on more are needed.
SEEN = 0.5

#: Evidence, with a ramp in the model, from which on a drift is more than a ramp: "very strong" on
#: the scale of Kass and Raftery.
TOLD = 10.0

#: Time constants of settling, in shares of the mean run.
SETTLING = {"early settling": 0.12, "settling": 0.4}

#: Half periods over a run that a slow curve has.
BENT = 3

#: Forms of a drift: from the start of the run, or about its mean.
FORMS = (
    "ramp",
    "settling",
    "early settling",
    "bend",
    "walk",
    "flicker",
    "centred ramp",
    "centred bend",
    "centred walk",
    "centred flicker",
)

#: Forms of which every path is one: they describe the noise (Kennedy and O'Hagan 2001).
FREE = ("walk", "flicker", "centred walk", "centred flicker")

#: Number of them that differ in form: a slope, a relaxation, a curve, a free path.
UNLIKE_FORMS = 4.0


@dataclass(frozen=True)
class DriftWithinRun(Effect):
    """Ramp and random walk in time, new in every run.

    Parameters
    ----------
    arcsec_per_s : float
        Standard deviation of the ramp's rate over runs.
    wander_arcsec : float
        Standard deviation of the random walk at the end of a run.
    """

    arcsec_per_s: float = 0.0
    wander_arcsec: float = 0.0

    kind: ClassVar[str] = "drift_within_run"
    sentence: ClassVar[str] = (
        "The set-up settles, warms up or creeps during a run: the error follows time "
        "and not angle, differently in every run. It is a ramp, one relaxation or a "
        "slow curve; a free path in time describes the noise."
    )
    factor: ClassVar[str] = "time"
    form_of: ClassVar[tuple[str, ...]] = ("run_time",)
    measure: ClassVar[str] = "sweep out and back, or several turns, in each run, with time stamps"
    transfers: ClassVar[bool] = False
    confused_with: ClassVar[Mapping[type[Effect], str]] = {
        ScaleError: "reverse inside a run: a drift keeps its sign in time, a ratio in angle",
        MissingOrder: "several turns, or an out-and-back sweep, in each run",
        ThermalDrift: "heat twice and return, temperatures in random order",
    }
    flexible_below: ClassVar[float] = ALWAYS
    draws_zeros: ClassVar[bool] = True
    not_at_run_time: ClassVar[str] = (
        "no signal shows the drift; log the temperature and look for its part"
    )

    def signal(self, signals: Signals, around: JointPattern, rng: np.random.Generator) -> Array:
        out = np.zeros(len(signals))
        for start, stop in signals.run_bounds():
            clock = signals.clock[start:stop]
            out[start:stop] = self.arcsec_per_s * rng.standard_normal() * clock
            steps = np.sqrt(np.maximum(np.diff(clock, prepend=clock[0]), 0.0))
            walk = np.cumsum(steps * rng.standard_normal(steps.size))
            span = np.sqrt(max(float(clock[-1] - clock[0]), 1e-300))
            out[start:stop] += self.wander_arcsec * walk / span
        return out

    @classmethod
    def drawn(cls, size: float, of: Drawing) -> Self | None:
        # A free path is no cause, and is not to be found as one.
        return cls(arcsec_per_s=size)

    @classmethod
    def propose(cls, regression: Regression) -> Extension | None:
        if regression.has(cls.kind):
            return None
        signals = regression.signals
        if signals.time is None and signals.runs == 1 and np.ptp(signals.segment) == 0:
            return None  # one pass without times: the order of the rows is that of the angles
        extensions = [cls._proposal(regression, form) for form in FORMS]
        best = max(extensions, key=lambda p: p.bic_gain)
        if regression.is_dominated(best.deviance, 1, best.log_grid):
            return best
        best = cls._finer(regression, best)
        if best.bic_gain <= regression.least:
            return best
        # An error that comes back at the same place on the next pass in that direction is
        # no drift in time, nor is a new zero.
        beyond = regression.without_repeats(by_direction=True)
        if beyond is regression:
            return best
        if regression.signals.runs > 1 and not regression.has(ZeroSlip.kind):
            zero = beyond.propose_run_effect(ZeroSlip.kind, {}, np.ones((regression.n, 1)))
            beyond = beyond.with_terms([*beyond.terms, zero])
        deviance = cls._proposal(beyond, **best.shape).deviance
        return replace(best, deviance=min(best.deviance, deviance))

    @classmethod
    def _finer(cls, regression: Regression, best: Extension) -> Extension:
        """With as many half periods as are above the noise: where they end, an edge is left.

        Tested under white noise, since correlated noise explains finer parts. A single run is
        tested under the noise found: there a drift that is too fine explains lines in angle.
        """
        form, terms = best.shape["form"], int(best.shape["terms"])
        if best.bic_gain <= 0.0 or form not in FREE:
            return best
        one = regression.signals.runs < 2
        white = regression if one else regression.with_terms(regression.terms, 0.0)
        at = cls._proposal(white, form, terms)
        while terms < MOST_TERMS:
            assert at.run_effect is not None
            last = at.run_effect.columns[:, -1]
            power = at.run_effect.ratio * float(last @ last) / regression.signals.runs
            finer = cls._proposal(white, form, 2 * terms) if power > SEEN else at
            if finer.deviance <= at.deviance:
                break
            at, terms = finer, 2 * terms
        return best if terms == best.shape["terms"] else cls._proposal(regression, form, terms)

    @classmethod
    def _proposal(cls, regression: Regression, form: str, terms: int = DRIFT_TERMS) -> Extension:
        columns = regression.cache.of_motion(
            f"{form} {terms}",
            None,
            lambda: np.asfortranarray(cls._shapes(regression, form, terms)),
        )
        log_grid = float(np.log(UNLIKE_FORMS))
        shape = {"form": form, "terms": terms}
        return regression.propose_run_effect(cls.kind, shape, columns, log_grid)

    @staticmethod
    def _mean_span(regression: Regression) -> float:
        """Of a run's clock."""
        clock = regression.signals.clock
        spans = [float(clock[stop - 1] - clock[start]) for start, stop in regression.bounds]
        return max(float(np.mean(spans)), 1e-300)

    @classmethod
    def _shapes(cls, regression: Regression, form: str, terms: int) -> Array:
        """Columns of a drift, scaled so that it ends at variance 1 or about that.

        A ramp and a relaxation have one rate and one time constant in runs of any span, where
        the time is recorded; a curve and a free path end where the run does.
        """
        timed, mean = regression.signals.time is not None, cls._mean_span(regression)
        u, passed = np.zeros(regression.n), np.zeros(regression.n)
        for start, stop in regression.bounds:
            clock = regression.signals.clock[start:stop]
            span = max(float(clock[-1] - clock[0]), 1e-300)
            u[start:stop] = (clock - clock[0]) / span
            passed[start:stop] = u[start:stop] * (span / mean if timed else 1.0)
        k = np.arange(1, terms + 1, dtype=np.float64)
        if form == "ramp":
            return passed[:, None]
        if form == "centred ramp":
            middle = [np.full(b - a, 0.5 * passed[b - 1]) for a, b in regression.bounds]
            return np.asarray(passed - np.concatenate(middle))[:, None]
        if form in SETTLING:
            return np.asarray(1.0 - np.exp(-passed / SETTLING[form]))[:, None]
        if form.endswith("bend"):
            waves = _core.line_columns(np.pi * u, k[:BENT])[:, 0::2] / k[:BENT]
            return np.asarray(waves if form.startswith("centred") else waves - 1.0 / k[:BENT])
        if form == "walk":
            sines = _core.line_columns(np.pi * u, k - 0.5)[:, 1::2]
            return np.asarray(sines * (np.sqrt(2.0) / (np.pi * (k - 0.5))))
        cosines = _core.line_columns(np.pi * u, k)[:, 0::2]
        if form == "centred walk":
            return np.asarray(np.sqrt(2.0) * cosines / (np.pi * k))
        if form == "flicker":
            cosines = cosines - 1.0
        return np.asarray(cosines / np.sqrt(k * np.log(DRIFT_TERMS)))

    @classmethod
    def report(cls, regression: Regression, terms: Sequence[Fitted]) -> Reported:
        extension = terms[0][0]
        assert extension.run_effect is not None
        size = float(np.sqrt(extension.run_effect.ratio * regression.variance))
        rate = size / cls._mean_span(regression)
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

    @classmethod
    def blind_spots(cls, regression: Regression, found: Sequence[Ambiguity]) -> Iterator[Ambiguity]:
        signals = regression.signals
        clocks = (signals.clock[a:b] for a, b in regression.bounds)
        clock = np.concatenate([c / max(float(np.ptp(c)), 1e-300) for c in clocks])
        left = share_left(regression, signals.theta[:, None], clock[:, None])
        if left < OWN_OF_VELOCITY and np.ptp(signals.direction) == 0.0:
            because = "one direction: a ramp in angle is a ramp in time"
            yield cls.blind(because, ScaleError, first=False, common=ScaleError)

    @classmethod
    def describes_noise(cls, extension: Extension) -> bool:
        return extension.shape["form"] in FREE

    @classmethod
    def told(cls, extension: Extension, regression: Regression) -> bool:
        """Whether it is more than a ramp in angle, from which a ramp in time may not differ."""
        assert extension.run_effect is not None
        others = [term for term in regression.terms if term.cause != cls.kind]
        rest = regression.with_terms(others, regression.whiten.rho)
        ramp = ScaleError.propose(rest)
        if ramp is not None:
            rest = rest.with_terms([*others, ramp], regression.whiten.rho)
        columns = extension.run_effect.columns
        return rest.propose_run_effect(cls.kind, extension.shape, columns).bic_gain > TOLD

    @classmethod
    def doubt(cls, extension: Extension, regression: Regression, spots: Spots) -> Ambiguity | None:
        """A drift in time may be an error of reversal: few runs that reverse once."""
        signals = regression.signals
        if (
            extension.cause != cls.kind
            or signals.runs >= RUNS_PER_LEVEL
            or np.ptp(signals.direction) == 0.0
        ):
            return None
        left = power = 0.0
        for start, stop in regression.bounds:
            drift = drift_basis(signals.clock[start:stop])
            q, _ = np.linalg.qr(np.column_stack([np.ones(stop - start), drift]))
            direction = signals.direction[start:stop]
            power += float(np.sum((direction - direction.mean()) ** 2))
            left += float(np.sum((direction - q @ (q.T @ direction)) ** 2))
        if left > OWN_OF_VELOCITY * power:
            return None
        rest = regression.with_terms(t for t in regression.terms if t.cause != cls.kind)
        reversal = rest.propose(Backlash.kind, {}, signals.direction[:, None])
        if reversal.bic_gain <= 0.0:
            return None
        others = [
            Backlash,
            PreslidingHysteresis,
            *([] if signals.velocity is not None else [Latency]),
        ]
        spot = cls.blind(
            f"{counted(signals.runs, 'run')} that reverse about once: an error that depends on "
            "direction and one that depends on time give the same readings",
            *others,
        )
        return replace(
            spot,
            measure="reverse several times within each run, at places that differ from run to run, "
            "or repeat the runs",
        )
