"""Play: a constant reversal error, and how it varies with the place."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any, ClassVar

import numpy as np

from ..estimation.extension import Extension
from ..estimation.quantity import quantity
from ..estimation.regression import Regression
from ..joint.pattern import JointPattern, line_sum
from ..joint.signals import Signals
from ..model.term import Term, line_values
from ..model.terms.travel import BacklashTerm
from ..support.angles import ARCSEC_PER_DEG, from_arcsec
from .ambiguity import Ambiguity
from .effect import Effect, Reported
from .search import Array, Fitted

#: Half width in standard deviations of the noise from which on the crossing of a play is looked
#: for; steps until the half width and the travel over which it is crossed agree.
SEEN, SETTLING = 0.5, 5

#: Evidence of a crossing from which on it is distinguished from a sharp step: "very strong" on the
#: scale of Kass and Raftery.
TOLD = 10.0


ONE_WAY = "all runs go in one direction: a constant reversal error is part of the zero"


@dataclass(frozen=True)
class Backlash(Effect):
    """Constant reversal error: ``ε = b d``, d = direction of travel.

    Parameters
    ----------
    half_width_arcsec : float
        b: half of forward minus reverse, on average over a turn.
    lines : list of [output order, arcsec, phase_deg]
        How b varies with the place (a separate cause: a pattern of the direction).
    turns_first : {"", "indicated", "reference"}
        The side that crosses the play while the other one rests: the indicated angle (b > 0:
        the reference rests, and the error changes meanwhile), or the reference (b < 0: the error
        changes over a travel of 2 b). Neither: between two readings.
    start_state : float
        Where in the play a run starts, where the reference turns first: 0 in its middle, 1 at the
        side of its direction.
    """

    half_width_arcsec: float
    lines: tuple[tuple[float, float, float], ...] = ()
    turns_first: str = ""
    start_state: float = 1.0

    kind: ClassVar[str] = BacklashTerm.kind
    sentence: ClassVar[str] = (
        "Play in the gear, a coupling or a key: the output lags by a constant angle "
        "whose sign is the direction of travel, at any speed, load and place."
    )
    factor: ClassVar[str] = "direction"
    form_of: ClassVar[tuple[str, ...]] = ("direction", "reversal_time")
    measure: ClassVar[str] = "approach every position from both directions, within each run"
    acts_on_runs: ClassVar[bool] = True

    def signal(self, signals: Signals, around: JointPattern, rng: np.random.Generator) -> Array:
        width = self.half_width_arcsec + line_sum(signals.theta, self.lines)
        shape = {
            "turns_first": self.turns_first,
            "half_width_arcsec": abs(self.half_width_arcsec),
            "start_state": self.start_state,
        }
        return np.asarray(width * self.columns(signals, around, shape)[:, 0])

    @classmethod
    def propose(cls, regression: Regression) -> Extension | None:
        if regression.has(cls.kind):
            return None
        signals, around = regression.signals, regression.around
        sharp = regression.propose(cls.kind, {}, cls.columns(signals, around, {}))
        # By the plain mean of either direction: whitened, the steps between neighbours count most,
        # and a crossing has none.
        about = signals.direction - signals.direction.mean()
        power = float(about @ about)
        mean = float(about @ regression.left) / power if power > 0.0 else 0.0
        first = "reference" if mean < 0.0 else "indicated"
        noise = np.sqrt(regression.variance)
        if abs(mean) < SEEN * noise or not _shows_crossing(signals, first, mean):
            return sharp
        best = sharp
        for start_state in (1.0, 0.0) if first == "reference" else (1.0,):
            width = abs(mean)
            # The size of the play is the travel that crosses it: no further parameter.
            for _ in range(SETTLING if first == "reference" else 1):
                shape = {
                    "turns_first": first,
                    "half_width_arcsec": width,
                    "start_state": start_state,
                }
                found = regression.propose(cls.kind, shape, cls.columns(signals, around, shape))
                if found.coefficients[0] * mean <= 0.0:
                    break
                best = found if found.deviance > best.deviance else best
                width = abs(float(found.coefficients[0]))
        # Of three forms one was chosen.
        if best is sharp or best.deviance - sharp.deviance < 2.0 * np.log(3.0):
            return sharp
        return replace(best, log_grid=float(np.log(3.0)))

    @classmethod
    def columns(cls, signals: Signals, around: JointPattern, shape: dict[str, Any]) -> Array:
        first, width = shape.get("turns_first", ""), shape.get("half_width_arcsec", 0.0)
        if first == "reference" and width > 0.0:
            return signals.play(width / ARCSEC_PER_DEG, shape.get("start_state", 1.0))[:, None]
        if first == "indicated":
            return _crossing_at_rest(signals)[:, None]
        return signals.direction[:, None]

    @classmethod
    def told(cls, extension: Extension, regression: Regression) -> bool:
        """Whether the crossing itself is detected: a delay has none."""
        if not extension.shape:
            return False
        rest = regression.with_terms(
            [t for t in regression.terms if t.cause != cls.kind], regression.whiten.rho
        )
        sharp = rest.propose(cls.kind, {}, regression.signals.direction[:, None])
        return rest.bic - sharp.bic_gain - regression.bic > TOLD

    @classmethod
    def report(cls, regression: Regression, terms: Sequence[Fitted]) -> Reported:
        extension, (width,), covariance = terms[0]
        std = float(np.sqrt(covariance[0, 0]))
        parameters = {"half_width_arcsec": quantity(width, std)}
        first = extension.shape.get("turns_first", "")
        if first:
            parameters["turns_first"] = quantity(first)
        start = float(extension.shape.get("start_state", 1.0))
        return parameters, [Backlash(float(width), turns_first=first, start_state=start)]

    @classmethod
    def blind_spots(cls, regression: Regression, found: Sequence[Ambiguity]) -> Iterator[Ambiguity]:
        if not goes_both_ways(regression.signals):
            yield cls.blind(ONE_WAY)

    def to_terms(self, period: float, shafts: Mapping[str, float]) -> tuple[Term, ...]:
        width = from_arcsec(self.half_width_arcsec, period)
        return (BacklashTerm(width, **line_values(self.lines, period)),)


def _shows_crossing(signals: Signals, first: str, width: float) -> bool:
    """Whether readings lie where one side has turned and the other is still at rest."""
    if first == "indicated":
        return bool((_crossing_at_rest(signals) != signals.direction).any())
    play = signals.play(abs(float(width)) / ARCSEC_PER_DEG)
    return bool((np.abs(play) < 1.0).any())


def _crossing_at_rest(signals: Signals) -> Array:
    """The direction, changing linearly while the reference is at rest between two movements."""
    crossing = signals.direction.copy()
    for start, stop in signals.run_bounds():
        # Radians by which an angle at rest may change: rounding.
        moved = np.abs(np.diff(signals.theta[start:stop])) > 1e-9
        moving = np.flatnonzero(np.concatenate([moved[:1], moved[1:] | moved[:-1], moved[-1:]]))
        if moving.size == 0:
            continue
        clock, direction = signals.clock[start:stop], signals.direction[start:stop]
        apart = np.flatnonzero(np.diff(moving) > 1)
        for last, following in zip(moving[apart], moving[apart + 1], strict=True):
            # The last reading before, and the first one after, are still at the reversal.
            ends = direction[[max(last - 1, 0), min(following + 1, stop - start - 1)]]
            if ends[0] != ends[1]:
                inside = slice(start + last, start + following + 1)
                at = clock[[last, following]]
                crossing[inside] = np.interp(signals.clock[inside], at, ends)
    return crossing


def goes_both_ways(signals: Signals) -> bool:
    """The joint moved in both directions."""
    moving = signals.direction[signals.direction != 0.0]
    return moving.size > 0 and bool(np.ptp(moving) > 0.0)
