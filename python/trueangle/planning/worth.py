"""What designs of further runs are worth: questions opened, answers and the evidence they add."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..estimation.regression import Regression
from .evidence import ExpectedEvidence
from .questions import Question

#: Chance of a strong difference of evidence that is wanted.
WANTED = 0.95

#: Standard deviations of evidence beyond which a design is not better: a tenth of the readings
#: has a third of them, which names a cause almost surely.
ENOUGH = 10.0

#: Standard deviations that count as hardly any.
HARDLY = 0.01

#: Factor of the evidence below which two designs are alike, and the plainer one is taken.
ALIKE = 1.5

#: Such factors of evidence at most: of the causes in question, and of the least of all.
MOST_EVIDENCE = round(2.0 * math.log(ENOUGH) / math.log(ALIKE))


@dataclass(frozen=True, order=True)
class Worth:
    """What runs tell, the most important first.

    ``clear`` counts, below zero, what could not be named though it may be taken for a cause in
    question: then neither is.
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


#: What is told before anything is tried.
NOTHING = Worth(0, 0, False, -1_000, -1_000, 0, 0.0)


def barely(reached: tuple[int, int, bool, int]) -> Worth:
    """The least that reaches so much."""
    return Worth(*reached, NOTHING.evidence, NOTHING.plain, NOTHING.seconds)


@dataclass(frozen=True)
class Answer:
    """What runs say of one question: whether it is told, and by which evidence."""

    told: bool
    bic: float | None
    chance: float | None


def is_strong_answer(evidence: Sequence[ExpectedEvidence]) -> bool:
    """Whether every cause is expected to win; of one without a form the design decides."""
    return min((e.chance for e in evidence), default=1.0) >= WANTED


def run_is_foretold(regression: Regression) -> bool:
    """Whether the zero and lines of any run follow from the others: what is held out needs that.

    On average over a run they are foretold no worse than one reading tells them.
    """
    grams = [regression.base[a:b].T @ regression.base[a:b] for a, b in regression.bounds]
    every = np.sum(grams, axis=0)
    for (start, stop), gram in zip(regression.bounds, grams, strict=True):
        others = every - gram
        others += 1e-9 * np.trace(every) * np.eye(len(every))
        if np.trace(np.linalg.solve(others, gram)) > stop - start:
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
