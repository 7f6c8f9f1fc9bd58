"""Proposals of further causes, and the best of them."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from typing import TypeAlias

from ..effects import EFFECTS, Effect
from ..estimation.cache import CachedProposal
from ..estimation.regression import Extension, Regression
from ..support.deadline import current_deadline
from .formerrors import told_from_form_errors
from .penalty import (
    deviance_before_forms,
    deviance_of_form_errors,
    form_misfit,
    forms_before,
    penalty_of,
    total_penalty,
)

#: An extension, what it extends, and its net BIC gain.
Candidate: TypeAlias = tuple[Extension, Regression, float]

#: Time for the gain and the rivals of chosen causes, in shares of the time for the choice.
AFTER_CHOICE = 0.7


def propose_candidates(effect: type[Effect], regression: Regression) -> Extension | None:
    """What a cause proposes; nothing where a wider one that contains it is chosen already."""
    if any(effect in EFFECTS[term.cause].contains for term in regression.terms):
        return None
    return effect.propose(regression)


def candidate_extensions(
    regression: Regression,
    causes: Sequence[str],
    least: Callable[[list[Candidate]], float] | None = None,
    before: Sequence[Candidate] = (),
) -> list[Candidate]:
    """What every cause proposes: the extension, what it extends, its net BIC gain.

    A cause that contains chosen ones as special cases takes their place. Those left when the
    time is up are not tried (`trueangle.support.deadline`). ``least`` is the gain that matters,
    given the candidates found so far. The search of a candidate ends once it must stay below
    ``least``; the strongest ones ``before`` are therefore tried first.
    """
    found: list[Candidate] = []
    places: list[int] = []
    at = current_deadline()
    beside = f" ({len(regression.terms)} chosen so far)" if regression.terms else ""
    gains = {extension.cause: extension.bic_gain for extension, _, _ in before}
    for tried, cause in enumerate(sorted(causes, key=lambda cause: -gains.get(cause, 0.0))):
        then = AFTER_CHOICE * at.seconds if beside else 0.0
        at.at(f"trying causes{beside}", tried, len(causes), then)
        if at.over:
            break
        contained = {special.kind for special in EFFECTS[cause].contains}
        if any(term.cause in contained for term in regression.terms):
            start = regression.with_terms(t for t in regression.terms if t.cause not in contained)
            penalty = total_penalty(start) - total_penalty(regression)
        else:
            start, penalty = regression, 0.0
        # Alone every cause is searched as far as it can be: that is reported.
        wanted = max(least(found) + penalty, 0.0) if start.terms and least is not None else 0.0
        extension = candidates_above(start, cause, wanted)
        if at.over:
            break  # a search that was cut short is no evidence about its cause
        if extension is not None:
            found.append((extension, start, extension.bic_gain - penalty))
            places.append(causes.index(cause))
    # What is as good comes in the order of the causes.
    return [found[k] for k in sorted(range(len(found)), key=places.__getitem__)]


def candidates_above(regression: Regression, cause: str, least: float = 0.0) -> Extension | None:
    """What a cause proposes, searched only as far as candidates above ``least`` require.

    None where the time is up and it has not been searched yet.
    """
    beside: tuple[tuple[str, str], ...] = regression.cache.of_fit(
        "shapes", lambda: tuple((term.cause, repr(term.shape)) for term in regression.terms)
    )
    key = (cause, beside)
    kept = regression.cache.proposed(key, least)
    if kept is None and current_deadline().over:
        return None
    if kept is None:
        kept = CachedProposal(
            propose_candidates(EFFECTS[cause], regression.with_least(least)), least
        )
        if not current_deadline().over:
            regression.cache.propose(key, kept)
    return kept.extension


class CandidateScores:
    """Scores of candidates of one step, and the best one of them."""

    def __init__(self) -> None:
        #: By identity, each with its extension: one that is gone leaves its identity to others.
        self.told: dict[int, tuple[Extension, float]] = {}
        self.seen = 0
        self.leading = 0.0

    def score(self, candidate: Candidate) -> float:
        """Net gain less what a cause costs beyond its parameters."""
        extension, start, gain = candidate
        explained = deviance_before_forms(start) - start.deviance
        if not EFFECTS[extension.cause].has_exact_form:
            explained += extension.deviance
        before = forms_before(start)
        left = deviance_of_form_errors(explained, start.n)
        after = penalty_of([*start.terms, extension], left, before)
        paid: float = start.cache.of_fit(
            "penalty", lambda: penalty_of(start.terms, form_misfit(start), before)
        )
        return gain - (after - paid)

    def told_score(self, candidate: Candidate) -> float:
        """Score less what form errors of the causes found explain as well."""
        extension, start, _ = candidate
        if id(extension) not in self.told:
            less = extension.deviance - told_from_form_errors(start, extension).deviance
            self.told[id(extension)] = extension, less
        return self.score(candidate) - self.told[id(extension)][1]

    def best(self, candidates: Sequence[Candidate]) -> tuple[float, Candidate] | None:
        """The best candidate with its score, where one is above zero.

        Form errors only lower a score: candidates that score below the best one are not tested.
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
        """Net gain that a further candidate needs to be the best; updated after each new one."""
        for candidate in candidates[self.seen :]:
            if self.score(candidate) > self.leading:
                self.leading = max(self.leading, self.told_score(candidate))
        self.seen = len(candidates)
        return self.leading
