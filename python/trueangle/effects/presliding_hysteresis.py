"""Friction that winds the gear up over a length after each reversal."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Self

import numpy as np

from ..estimation.extension import Extension
from ..estimation.quantity import quantity
from ..estimation.regression import Regression
from ..joint.pattern import JointPattern
from ..joint.signals import Signals
from ..model.term import Term
from ..model.terms.travel import PreslidingHysteresisTerm
from ..support.angles import from_arcsec
from ..support.deadline import current_deadline
from .ambiguity import OWN_OF_VELOCITY, Ambiguity, share_left
from .backlash import ONE_WAY, Backlash, goes_both_ways
from .departures import spring_transitions
from .drawing import Drawing
from .effect import Effect, Reported
from .latency import TWO_SPEEDS, Latency
from .search import Array, Fitted, golden_maximum, is_of_one_sign, seen_beside, tangent_covariance

_AFTER_REVERSAL = (
    "record the first 10 to 30 deg after each reversal in steps of 0.3 deg or less, "
    "with several reversal points"
)

#: Share of a presliding transition's power that plain backlash must leave: it is short by
#: nature.
OWN_OF_TRANSITION = 1e-3

#: By how much a transition's BIC must beat that of two branches alone to be detected in readings
#: whose design does not promise to show one: "very strong" on the scale of Kass and Raftery.
TOLD = 10.0

#: Elements of a Maxwell-slip model at most, and the ratio of lengths that keeps them apart.
MOST_ELEMENTS = 3
APART = 2.5

#: Transition lengths searched, degrees.
LENGTHS = np.geomspace(0.15, 60.0, 15)

#: Times that a length is refined at most, each under the noise that the last one left.
ROUNDS = 3


@dataclass(frozen=True)
class PreslidingHysteresis(Effect):
    """Reversal error with a transition length L (Dahl): ``ε = h z(s)``.

    ::

        z(s) = d - (d - z₀) e^(-s/L)

    for travel s since the reversal, z_0 being the state there.

    Parameters
    ----------
    amplitude_arcsec : float
        h: half of the reversal error far from the reversal.
    length_deg : float
        L: travel in which it builds up.
    start_state : float
        Share of the wind-up that is there when a run starts: 0 relaxed, 1 run in.
    """

    amplitude_arcsec: float
    length_deg: float
    start_state: float = 0.0

    kind: ClassVar[str] = PreslidingHysteresisTerm.kind
    sentence: ClassVar[str] = (
        "Friction winds up the elastic parts after each reversal: the error moves from one "
        "branch to the other over a transition length, and depends on where it reversed."
    )
    factor: ClassVar[str] = "direction"
    form_of: ClassVar[tuple[str, ...]] = ("direction", "reversal_time")
    measure: ClassVar[str] = _AFTER_REVERSAL
    confused_with: ClassVar[Mapping[type[Effect], str]] = {
        Backlash: _AFTER_REVERSAL,
        Latency: TWO_SPEEDS,
    }
    contains: ClassVar[tuple[type[Effect], ...]] = (Backlash,)
    acts_on_runs: ClassVar[bool] = True
    located: ClassVar[bool] = True

    def signal(self, signals: Signals, around: JointPattern, rng: np.random.Generator) -> Array:
        return self.amplitude_arcsec * signals.presliding(self.length_deg, self.start_state)

    @classmethod
    def drawn(cls, size: float, of: Drawing) -> Self | None:
        return cls(size, of.between(2.0, 6.0))

    @classmethod
    def propose(cls, regression: Regression) -> Extension | None:
        signals = regression.signals
        # What builds up from the start of runs that all go one way may be anything slow.
        if not goes_both_ways(signals):
            return None
        best: tuple[float, float, float] | None = None
        for start in (0.0, 1.0):
            columns = regression.cache.of_motion(
                f"presliding {start}",
                None,
                lambda start=start: np.column_stack(  # type: ignore[misc]
                    [signals.presliding(length, start) for length in LENGTHS]
                ),
            )
            gains = regression.gains(columns)
            k = int(np.argmax(gains))
            if best is None or gains[k] > best[0] + 1e-9:
                best = (float(gains[k]), float(LENGTHS[k]), start)
        assert best is not None
        gain, length, start = best
        present = [t.shape["length_deg"] for t in regression.terms if t.cause == cls.kind]
        if gain <= 0.0 or len(present) >= MOST_ELEMENTS:
            return None
        step = np.log(LENGTHS[1] / LENGTHS[0])
        log_length = float(np.log(length))
        shape = {"length_deg": length, "start_state": start}
        seen: Regression | None = regression
        if regression.is_dominated(gain, 2, float(np.log(2.0))):
            seen = None
        for _ in range(ROUNDS):
            if seen is None or current_deadline().over:
                break
            log_length = cls._refined(seen, log_length, step, start)
            shape = {"length_deg": float(np.exp(log_length)), "start_state": start}
            columns = cls.columns(signals, regression.around, shape)
            seen = seen_beside(regression, regression.propose(cls.kind, shape, columns))
        columns = cls.columns(signals, regression.around, shape)
        extension = regression.propose(cls.kind, shape, columns, parameters=2, log_grid=np.log(2.0))
        if not regression.has(cls.kind):
            # Friction winds up in the direction of travel; the other way the reference has play.
            return extension if extension.coefficients[0] > 0.0 else None
        # What may follow: play, another element.
        further = [] if 0.0 in present else [cls._play(regression)]
        apart = all(
            other == 0.0 or abs(np.log(shape["length_deg"] / other)) > np.log(APART)
            for other in present
        )
        if apart:
            further.append(extension)
        further.sort(key=lambda p: -p.bic_gain)
        alike = (p for p in further if p.bic_gain > 0.0 and is_of_one_sign(regression, p))
        return next(alike, None)

    @staticmethod
    def _refined(regression: Regression, log_length: float, step: float, start: float) -> float:
        """Logarithm of the length within a step that explains most."""
        signals = regression.signals
        found, _ = golden_maximum(
            lambda x: float(regression.gains(signals.presliding(np.exp(x), start)[:, None])[0]),
            log_length - step,
            log_length + step,
        )
        return float(found)

    @classmethod
    def _play(cls, regression: Regression) -> Extension:
        shape = {"length_deg": 0.0}
        columns = cls.columns(regression.signals, regression.around, shape)
        return regression.propose(cls.kind, shape, columns)

    @classmethod
    def columns(cls, signals: Signals, around: JointPattern, shape: dict[str, Any]) -> Array:
        if shape["length_deg"] == 0.0:
            return signals.direction[:, None]
        return signals.presliding(shape["length_deg"], shape["start_state"])[:, None]

    @classmethod
    def bends(cls, signals: Signals, terms: Sequence[tuple[Extension, Array]]) -> Array:
        size = sum(float(np.sum(coefficients)) for _, coefficients in terms)
        signal = np.sum([term.columns @ coefficients for term, coefficients in terms], axis=0)
        # Other lengths, and the same amplitude far from the reversal.
        return np.asarray(size * spring_transitions(signals) - signal[:, None])

    @classmethod
    def report(cls, regression: Regression, terms: Sequence[Fitted]) -> Reported:
        total = sum(float(c[0]) for _, c, _ in terms)
        weights = np.array([abs(float(c[0])) for _, c, _ in terms])
        lengths = np.array([t.shape["length_deg"] for t, _, _ in terms])
        length = float(weights @ lengths / weights.sum())
        effects: list[Effect] = [
            PreslidingHysteresis(float(c[0]), t.shape["length_deg"], t.shape["start_state"])
            if t.shape["length_deg"] > 0.0
            else Backlash(float(c[0]))
            for t, c, _ in terms
        ]
        std, length_std = cls._errors(regression, terms)
        parameters = {
            "amplitude_arcsec": quantity(total, std),
            "length_deg": quantity(length, length_std),
        }
        if len(terms) > 1:
            parameters["element_lengths_deg"] = quantity(lengths)
            parameters["element_amplitudes_arcsec"] = quantity([float(c[0]) for _, c, _ in terms])
        return parameters, effects

    @classmethod
    def _errors(cls, regression: Regression, terms: Sequence[Fitted]) -> tuple[float, float | None]:
        """Of the whole amplitude, and of the length of the strongest element."""
        signals, step = regression.signals, 0.02
        columns, slopes, curved = [], [], []
        for k, (extension, (amplitude,), _) in enumerate(terms):
            length = extension.shape["length_deg"]
            columns.append(cls.columns(signals, regression.around, extension.shape))
            if length > 0.0:
                start = extension.shape["start_state"]
                longer, shorter = (
                    signals.presliding(length * (1.0 + s), start) for s in (step, -step)
                )
                slopes.append(amplitude * (longer - shorter)[:, None] / (2.0 * step * length))
                curved.append(k)
        covariance = tangent_covariance(regression, terms, np.hstack(columns + slopes))
        n = len(terms)
        strongest = int(np.argmax([abs(float(c[0])) for _, c, _ in terms]))
        length_std = None
        if strongest in curved:
            at = n + curved.index(strongest)
            # Not known by more than was searched, where readings lie too far apart to show it.
            length_std = min(float(np.sqrt(covariance[at, at])), float(LENGTHS[-1]))
        return float(np.sqrt(covariance[:n, :n].sum())), length_std

    @classmethod
    def blind_spots(cls, regression: Regression, found: Sequence[Ambiguity]) -> Iterator[Ambiguity]:
        signals = regression.signals
        direction = signals.direction[:, None]
        both, speed = bool(np.ptp(signals.direction) > 0.0), signals.velocity
        one = speed is None or share_left(regression, speed[:, None], direction) < OWN_OF_VELOCITY
        if both and one:
            # Play is distinguished from a delay where velocity is known (`Latency.blind_spots`).
            others = (Backlash, Latency) if speed is None else (Latency,)
            why = "velocity is unknown" if speed is None else "one speed"
            yield cls.blind(
                f"{why}: a delay looks like a reversal error, and one that builds up "
                "where the joint gathers speed",
                *others,
                first=False,
                factor="velocity",
            )
        if not goes_both_ways(signals):
            yield cls.blind(ONE_WAY)
            return
        transitions = np.column_stack(
            [signals.presliding(length, 1.0) for length in (1.0, 3.0, 10.0)]
        )
        if share_left(regression, transitions, direction) < OWN_OF_TRANSITION:
            yield cls.blind(
                "no reversal inside a run is followed closely: a wound-up spring and play give "
                "the same two branches",
                Backlash,
                common=Backlash,
            )

    @classmethod
    def told(cls, extension: Extension, regression: Regression) -> bool:
        """Whether the transition itself is significant, as after a start from a relaxed joint."""
        return cls.beats(Backlash, regression, TOLD)

    def to_terms(self, period: float, shafts: Mapping[str, float]) -> tuple[Term, ...]:
        amplitude = from_arcsec(self.amplitude_arcsec, period)
        length = self.length_deg * (period / 360.0)
        return (PreslidingHysteresisTerm(amplitude, length, self.start_state),)
