"""Rivals of a finding: what else would explain its part, and what depends on which it is."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ..effects import EFFECTS, Effect
from ..effects.ambiguity import Ambiguity
from ..effects.effect import telling_apart
from ..effects.missing_order import MissingOrder
from ..effects.scale_error import ScaleError
from ..estimation.quantity import Parameters
from ..estimation.regression import Regression
from ..support.deadline import current_deadline
from .candidates import Candidate, candidate_extensions, propose_candidates
from .penalty import NEW_CAUSE, regression_without
from .selection import is_flexible

#: Rivals reported for each finding.
RIVALS = 3

#: Share of the evidence of a finding by which what another one leaves may differ, and be the same.
SAME = 3e-4

#: Columns whose causes are no ramp in angle, where they make one in these runs.
RECORDED = {"torque", "temperature", "current", "coupled"}

#: Standard errors by which the size of a cause changes if another one is exchanged.
MOVED = 4.0


def cause_alternatives(
    regression: Regression, group: Sequence[int], causes: Sequence[str]
) -> dict[str, tuple[Parameters, tuple[Effect, ...]]]:
    """Every cause that may be the one, alone in place of a finding: parameters and effects."""
    found = {}
    for cause, fitted in _accounts(regression, group, causes):
        k = len(fitted.terms) - 1
        terms = [(*fitted.fitted()[k], fitted.covariance(k))]
        parameters, effects = EFFECTS[cause].report(fitted, terms)
        found[cause] = parameters, tuple(effects)
    return found


def _accounts(
    regression: Regression, group: Sequence[int], causes: Sequence[str]
) -> Iterator[tuple[str, Regression]]:
    """The account with each of some causes in place of a finding, as its last term."""
    rest = regression_without(regression, group, settled=True)
    for cause in causes if not current_deadline().over else ():
        effect = EFFECTS[cause]
        extension = propose_candidates(effect, rest) or effect.imitate(rest)
        if extension is not None and extension.bic_gain > 0.0:
            yield cause, rest.with_terms([*rest.terms, extension])


def dependence(
    regression: Regression, group: Sequence[int], doubt: Ambiguity, other: Sequence[int]
) -> str:
    """Why a finding ``other`` is none if the causes of an ambiguity are exchanged; else empty.

    It may be only what one cause leaves, and another cause of the ambiguity may explain it.
    """
    cause, own = regression.terms[other[0]].cause, regression.terms[group[0]].cause
    kept = [k for k in range(len(regression.terms)) if k not in group]
    places = [kept.index(k) for k in other]
    either = " or ".join(doubt.causes)
    fitted = regression.fitted()
    for instead, account in _accounts(regression, group, [c for c in doubt.causes if c != own]):
        there = account.fitted()
        for k, place in zip(other, places, strict=True):
            spread = np.sqrt(np.diag(regression.covariance(k)))
            if (np.abs(there[place][1] - fitted[k][1]) > MOVED * spread).any():
                return f"its size depends on which of {either} is there"
        rest = regression_without(account, places)
        lost = rest.bic - account.bic
        for rival in {own, *doubt.causes} - {instead, cause}:
            extension = propose_candidates(EFFECTS[rival], rest)
            if extension is None or extension.deviance <= 0.0:
                continue
            gap = _gap(account, lost, (extension, rest, extension.bic_gain))
            if equal_causes(cause, [(rival, gap)], ()):
                return f"with {instead} in place of {own}, {rival} explains as much"
    return ""


def ambiguity_in_doubt(doubt: Ambiguity, regression: Regression, group: Sequence[int]) -> Ambiguity:
    """An ambiguity of what is detected, with the size that each of its causes would have."""
    found = cause_alternatives(regression, group, doubt.causes)
    # Not lines: one that another hides behind is no property of the joint.
    told = (c for c in found if EFFECTS[c].acts_on_runs or is_flexible(EFFECTS[c]))
    return replace(
        doubt,
        supported=True,
        estimates={cause: found[cause][0] for cause in told},
        hypotheses={cause: effects for cause, (_, effects) in found.items()},
    )


def rivals_of(regression: Regression, group: Sequence[int]) -> list[tuple[str, float]]:
    """The best other causes in place of a finding, and how much less they explain."""
    cause = regression.terms[group[0]].cause
    rest = regression_without(regression, group)
    own = rest.bic - regression.bic
    others = [name for name in EFFECTS if name != cause]

    def best_of(candidates: Sequence[Candidate]) -> list[Candidate]:
        found: dict[str, Candidate] = {}
        for candidate in sorted(candidates, key=lambda candidate: -candidate[2]):
            if candidate[0].deviance > 0.0:
                found.setdefault(candidate[0].cause, candidate)
        return [*found.values()][:RIVALS]

    def least(candidates: Sequence[Candidate]) -> float:
        best = best_of(candidates)
        return best[-1][2] if len(best) == RIVALS else 0.0

    tried = candidate_extensions(rest, others, least)
    # A special case that is not named itself is no simpler form either.
    hidden = (EFFECTS[name].imitate(rest) for name in others if not _is_form(cause, name))
    tried += [(found, rest, found.bic_gain) for found in hidden if found is not None]
    best = best_of(tried)
    gaps = [(candidate[0].cause, _gap(regression, own, candidate)) for candidate in best]
    return sorted(gaps, key=lambda item: item[1])


def _gap(regression: Regression, own: float, candidate: Candidate) -> float:
    """How much less a candidate explains once all else is fitted jointly with it.

    Without either cause readings are clipped, and the noise is larger, than with one: what a
    candidate gains there is less than the finding that is one column with it has gained. One that
    leaves the same with as many parameters is that column: how far each was searched for is no
    reason to name one.
    """
    extension, start, gain = candidate
    if current_deadline().over:
        return own - gain
    settled = start.with_terms([*start.terms, extension])
    gap = own - (gain - extension.bic_gain + start.bic - settled.bic)
    apart = abs(settled.deviance - regression.deviance)
    freedom = [sum(term.parameters for term in each.terms) for each in (settled, regression)]
    is_same = apart < SAME * abs(own) and freedom[0] == freedom[1]
    return min(gap, 0.0) if is_same else gap


def equal_causes(
    cause: str, rivals: Sequence[tuple[str, float]], spots: Sequence[Ambiguity]
) -> Ambiguity | None:
    """That other causes explain as much as one, where they do; none strongly less.

    What contains it or is contained in it is the same cause in another form, and explains for it
    where noise that follows a misfit makes the simpler form the better one; a flexible
    cause is none; a line is what is detected, from any origin, and so is a ramp among those that
    share its form only by the design (``spots``). What follows a recorded load or temperature
    is not known to follow the angle: in motion under others it is no ramp. A
    step so near an end of its run that the run's own zero explains as much is no step.
    """
    effect = EFFECTS[cause]
    if cause == MissingOrder.kind:
        return None
    shared = {other for spot in spots if spot.common == cause for other in spot.causes}
    if cause == ScaleError.kind:
        shared |= {other for other, _ in rivals if not RECORDED & {*EFFECTS[other].needs}}
    if is_flexible(effect):
        steps = effect.draws_zeros
        equal = [
            other
            for other, gap in rivals
            if steps and gap < NEW_CAUSE and effect in EFFECTS[other].confused_with
        ]
        return alike_causes(effect, equal) if equal else None
    forms = {other for other, _ in rivals if _is_form(cause, other)}
    own = min([0.0, *(gap for other, gap in rivals if other in forms)])
    equal = [
        other
        for other, gap in rivals
        if gap - own < NEW_CAUSE and other not in forms | shared and not is_flexible(EFFECTS[other])
    ]
    return alike_causes(effect, equal) if equal else None


def alike_causes(effect: type[Effect], equal: Sequence[str]) -> Ambiguity:
    """That these explain as much as this."""
    return Ambiguity(
        (effect.kind, *equal),
        "they explain these readings equally well",
        telling_apart(effect, EFFECTS[equal[0]]) or effect.measure,
        supported=True,
        factor=effect.factor,
    )


def _is_form(cause: str, other: str) -> bool:
    """One of two causes contains the other one."""
    one, two = EFFECTS[cause], EFFECTS[other]
    return one in two.contains or two in one.contains
