"""The information in further runs: open questions, answers, evidence."""

from __future__ import annotations

import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from ..effects import EFFECTS, Effect
from ..effects.ambiguity import Ambiguity
from ..effects.drawing import Drawing
from ..estimation.linear import pseudo_inverse
from ..estimation.regression import Regression
from ..joint.pattern import JointPattern
from ..joint.signals import Signals
from .evidence import ExpectedEvidence, Hypothesis

#: Wanted probability of a strong difference of evidence.
WANTED = 0.95

#: Standard deviations of evidence beyond which a design is not better: a tenth of the readings
#: has a third of them, which names a cause almost surely.
ENOUGH = 10.0

#: Standard deviations that count as hardly any.
HARDLY = 0.01

#: Factor of the evidence below which two designs are equal, and the plainer one is taken.
ALIKE = 1.5

#: Such factors of evidence at most: of the causes in question, and of the least of all.
MOST_EVIDENCE = round(2.0 * math.log(ENOUGH) / math.log(ALIKE))

#: Rounds in which the size of an effect is brought to that of the noise, and how near.
_ROUNDS, _NEAR = 12, 0.02


#: Draws of an effect before a cause counts as one that such a joint cannot have.
_TRIES = 4


@dataclass(frozen=True)
class Question:
    """Causes to be distinguished, or one cause from none, each with its assumed form.

    Attributes
    ----------
    causes : tuple of str
    hypotheses : tuple of Hypothesis
        Of those that readings of this joint can contain in this size.
    seen : bool
        The readings show something that one of them explains: the hypotheses are estimates of it.
    draws : tuple of Hypothesis
        Further random forms of causes without an estimate: another place, frequency, order.
    """

    causes: tuple[str, ...]
    hypotheses: tuple[Hypothesis, ...]
    seen: bool
    draws: tuple[Hypothesis, ...] = ()


def question_of(spot: Ambiguity, rich: Signals, around: JointPattern, rms: float) -> Question:
    """The question of an entry of ``not_identifiable``.

    Parameters
    ----------
    spot : Blindness
    rich : Signals
        Of a run in which every cause shows that limits allow to show.
    around : JointPattern
    rms : float
        Of the error of a cause that has no estimate, arcsec over ``rich``.
    """
    known: Mapping[str, Sequence[Effect]] = spot.hypotheses
    if known and not all(cause in known for cause in spot.causes):
        errors = [Hypothesis(c, tuple(e)).errors(rich, around)[0] for c, e in known.items()]
        rms = max(float(np.sqrt(np.mean(error**2))) for error in errors) or rms
    found, draws = [], []
    for cause in spot.causes:
        effects = tuple(known.get(cause, ())) or _alike(cause, known, around)
        if any(special.kind in spot.causes for special in EFFECTS[cause].contains):
            effects = ()  # its estimate is the special case, where the runs do not separate them
        if not effects:
            # Draws of a cause that has no estimate: the runs must find it whatever its form.
            made = [effect_of_size(cause, rms, rich, around, k * _TRIES) for k in range(4)]
            drawn = [Hypothesis(cause, (one,)) for one in made if one is not None]
            effects = drawn[0].effects if drawn else ()
            draws += drawn[1:]
        if effects:
            found.append(Hypothesis(cause, effects))
    # Share of the wanted size below which a cause of bounded size is too small to explain what the
    # readings show.
    large = {
        one.cause for one in found if one.cause in known or _rms(one, rich, around) > 0.5 * rms
    }
    if large:  # the others cannot be it, as the argument's error of a joint with small lines
        found, draws = ([one for one in some if one.cause in large] for some in (found, draws))
    return Question(spot.causes, tuple(found), spot.supported, tuple(draws))


def _rms(one: Hypothesis, rich: Signals, around: JointPattern) -> float:
    """Of its error over these readings, without the mean."""
    return float(np.std(one.errors(rich, around)[0]))


def _alike(
    cause: str, known: Mapping[str, Sequence[Effect]], around: JointPattern
) -> tuple[Effect, ...]:
    """The error of another cause that is estimated from this one, where it has such a form."""
    for effects in known.values():
        made = tuple(EFFECTS[cause].alike(effect, around) for effect in effects)
        if made and None not in made:
            return tuple(effect for effect in made if effect is not None)
    return ()


def effect_of_size(
    cause: str, rms: float, signals: Signals, around: JointPattern, first: int = 0
) -> Effect | None:
    """An effect of this cause whose error has this rms; None where the runs cannot have it.

    ``first`` is the number of its draw, of all but its size.
    """
    effect = EFFECTS[cause]
    most = math.log(effect.size_most)
    for number in range(first, first + _TRIES):
        log_size, one = min(0.0, most), None
        for _ in range(_ROUNDS):
            size = math.exp(log_size if effect.size_grows else -log_size)
            one = effect.drawn(size, Drawing(signals, around, np.random.default_rng(number)))
            if one is None:
                break
            error = one.signal(signals, around, np.random.default_rng(0))
            found = float(np.sqrt(np.mean((error - error.mean()) ** 2)))
            if found == 0.0:
                one = None
                break
            move = max(min(math.log(rms / found), 8.0), -8.0)
            if abs(move) < _NEAR or log_size + move > most:
                break
            log_size += move
        if one is not None:
            return one
    return None


@dataclass(frozen=True, order=True)
class Worth:
    """What runs decide, the most important first.

    ``clear`` counts, as a negative number, causes that cannot be named and may be confused with one
    in question: that one is then not named either.
    """

    opened: int
    told: int
    foretold: bool
    clear: int
    evidence: int
    plain: int
    seconds: float

    @property
    def gained(self) -> tuple[int, int, bool, int, int]:
        """What a further run must add to."""
        return self.opened, self.told, self.foretold, self.clear, self.evidence

    @property
    def reached(self) -> tuple[int, int, bool, int]:
        """What fewer readings must not lose."""
        return self.opened, self.told, self.foretold, self.clear


#: Result before anything is tried.
NOTHING = Worth(0, 0, False, -1_000, -1_000, 0, 0.0)


def barely(reached: tuple[int, int, bool, int]) -> Worth:
    """The least that reaches so much."""
    return Worth(*reached, NOTHING.evidence, NOTHING.plain, NOTHING.seconds)


@dataclass(frozen=True)
class Answer:
    """Evidence of runs for one question, and whether it decides."""

    told: bool
    bic: float | None
    chance: float | None


def is_strong_answer(evidence: Sequence[ExpectedEvidence]) -> bool:
    """Whether every cause is expected to win; of one without a form the design decides."""
    return min((e.chance for e in evidence), default=1.0) >= WANTED


def run_is_foretold(regression: Regression) -> bool:
    """Whether the zero and lines of any run follow from the others: holding out needs that.

    On average over a run they are predicted at least as well as one reading gives them.
    """
    grams = [regression.base[a:b].T @ regression.base[a:b] for a, b in regression.bounds]
    every = np.sum(grams, axis=0)
    for (start, stop), gram in zip(regression.bounds, grams, strict=True):
        others = every - gram
        others += 1e-9 * np.trace(every) * np.eye(len(every))
        if np.trace(pseudo_inverse(others) @ gram) > stop - start:
            return False
    return True


def worth_of_evidence(evidence: Sequence[ExpectedEvidence], question: Question) -> float:
    """What grows with the evidence: of the causes in question, and of the least of all."""
    logs = {(e.cause, e.rival): _log(e) for e in evidence}
    asked = [log for (_, rival), log in logs.items() if rival in ("", *question.causes)]
    return float(np.mean(asked)) + min(logs.values()) if logs else 0.0


def _log(evidence: ExpectedEvidence) -> float:
    """Logarithm of the deviations; below none, of what the deviance is of the first of them."""
    first = HARDLY * min(max(evidence.deviance, HARDLY**2), 1.0) ** 0.5
    return float(np.log(min(max(evidence.deviations, first), ENOUGH)))
