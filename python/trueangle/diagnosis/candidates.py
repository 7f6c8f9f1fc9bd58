"""What causes propose beside those found, and which of it is the best."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeAlias

from ..effects import Effect
from ..estimation.regression import Extension, Regression
from ..support.deadline import pace
from .forms import told_from_forms
from .penalty import before_forms, left_by_forms, misfit, penalty_of, total_penalty
from .unnamed import effect_of

__all__ = ["Candidate", "Scores", "extensions", "propose"]

#: An extension, what it extends, and its net BIC gain.
Candidate: TypeAlias = tuple[Extension, Regression, float]

#: Time that what is said of chosen causes takes (gain, rivals), in shares of that of the choice.
AFTER_CHOICE = 0.7


def propose(effect: type[Effect], regression: Regression) -> Extension | None:
    """What a cause proposes; nothing where a wider one that contains it is chosen already."""
    if any(effect in effect_of(term.cause).contains for term in regression.terms):
        return None
    return effect.propose(regression)


def extensions(
    regression: Regression,
    causes: Sequence[str],
    least: Callable[[list[Candidate]], float] | None = None,
) -> list[Candidate]:
    """What every cause proposes: the extension, what it extends, its net BIC gain.

    A cause that contains chosen ones as special cases takes their place. Those left when the
    time is up are not tried (`trueangle.support.deadline`). Of candidates that stay below
    ``least``, the gain that matters beside those found so far, only as much is searched as tells
    that; the strongest beside other terms are therefore tried first.
    """
    found: list[Candidate] = []
    proposed_by: list[str] = []
    at = pace()
    beside = f" beside {len(regression.terms)}" if regression.terms else ""
    memory = regression.memory
    order = list(causes)
    if regression.terms and least is not None:
        order.sort(key=lambda cause: -memory.get(("gain", cause), 0.0))
    for tried, cause in enumerate(order):
        then = AFTER_CHOICE * at.seconds if beside else 0.0
        at.at(f"trying causes{beside}", tried, len(causes), then)
        if at.over:
            break
        effect = effect_of(cause)
        contained = {special.kind for special in effect.contains}
        if any(term.cause in contained for term in regression.terms):
            start = regression.with_terms(t for t in regression.terms if t.cause not in contained)
            penalty = total_penalty(start) - total_penalty(regression)
        else:
            start, penalty = regression, 0.0
        key = (cause, *((t.cause, repr(t.shape)) for t in start.terms))
        # Alone every cause is told as well as it can be: that is reported.
        wanted = max(least(found) + penalty, 0.0) if start.terms and least is not None else 0.0
        if key not in memory or memory["least", key] > wanted:
            start.least = wanted
            found_now = propose(effect, start)
            start.least = 0.0
            if at.over:
                break  # a search that was cut short says nothing of its cause
            memory[key], memory["least", key] = found_now, wanted
        extension = memory[key]
        if extension is not None:
            memory["gain", cause] = extension.bic_gain
            found.append((extension, start, extension.bic_gain - penalty))
            proposed_by.append(cause)
    # What is as good comes in the order of the causes.
    by_place = sorted(range(len(found)), key=lambda k: causes.index(proposed_by[k]))
    return [found[k] for k in by_place]


class Scores:
    """Scores of candidates of one step, and the best one of them."""

    def __init__(self) -> None:
        self.told: dict[int, float] = {}
        self.seen = 0
        self.leading = 0.0

    def score(self, candidate: Candidate) -> float:
        """Net gain less what a cause costs beyond its parameters."""
        extension, start, gain = candidate
        explained = before_forms(start) - start.deviance
        if not effect_of(extension.cause).has_exact_form:
            explained += extension.deviance
        after = penalty_of([*start.terms, extension], left_by_forms(explained, start.n))
        return gain - (after - penalty_of(start.terms, misfit(start)))

    def told_score(self, candidate: Candidate) -> float:
        """Score once what bends of the causes found explain as well is taken off."""
        extension, start, _ = candidate
        if id(extension) not in self.told:
            less = extension.deviance - told_from_forms(start, extension).deviance
            self.told[id(extension)] = less
        return self.score(candidate) - self.told[id(extension)]

    def best(self, candidates: Sequence[Candidate]) -> tuple[float, Candidate] | None:
        """The best candidate with its score, where one is above zero.

        What is taken off only lowers a score: those behind the best one need not be asked.
        """
        best: tuple[float, Candidate] | None = None
        scored = [(self.score(candidate), candidate) for candidate in candidates]
        for score, candidate in sorted(scored, key=lambda item: -item[0]):
            if score <= (0.0 if best is None else best[0] + 1e-6):
                break
            told = self.told_score(candidate)
            if told > (0.0 if best is None else best[0] + 1e-6):
                best = told, candidate
        return best

    def least(self, candidates: Sequence[Candidate]) -> float:
        """Net gain that a further candidate needs to be the best; asked after each new one."""
        for candidate in candidates[self.seen :]:
            if self.score(candidate) > self.leading:
                self.leading = max(self.leading, self.told_score(candidate))
        self.seen = len(candidates)
        return self.leading
