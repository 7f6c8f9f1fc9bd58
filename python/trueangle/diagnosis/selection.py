"""Choose the causes: forward by evidence, flexible ones last, then backward."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..effects import EFFECTS, Effect
from ..effects.effect import ALWAYS
from ..effects.missing_order import MissingOrder
from ..effects.zero_slip import ZeroSlip
from ..regression.regression import Extension, Regression

__all__ = [
    "NEW_CAUSE",
    "cause_terms",
    "extensions",
    "finding_groups",
    "is_flexible",
    "misfit",
    "on_runs",
    "propose",
    "select",
    "total_penalty",
]

#: Evidence (in units of BIC) that a new cause must bring beyond its penalty: 6 is what
#: Kass and Raftery call strong, odds of 20 to 1.
NEW_CAUSE = 6.0

#: Share of the deviance explained so far that a further cause, or a form of its own for one,
#: must bring as well: a form known to 3 % leaves 0.1 % of its energy, and no cause.
FORM = 1e-3

#: Terms at most.
MOST_TERMS = 14


def on_runs() -> list[str]:
    """Specific causes that act on whole runs: direction, speed, load, temperature, mount."""
    return [cause for cause, effect in EFFECTS.items() if effect.acts_on_runs]


def is_flexible(effect: type[Effect]) -> bool:
    """It can imitate a specific cause, whatever the travel; chosen after those had a say."""
    return effect.flexible_below == ALWAYS


def select(regression: Regression, known: Sequence[Extension] = ()) -> Regression:
    """The regression with the causes that its readings support.

    Forward selection with every candidate; where that takes a flexible cause (which can
    imitate any effect of a run) or, over a part of a turn, a bump, further paths take
    those only after the specific ones had their say, without and with a zero of each
    run's own (or with what acts on whole runs beside an error that repeats at the same
    angle, or with the lines of shafts that the joint declares). All are pruned
    backward; the best by BIC is kept. Terms ``known`` from the same readings with other
    weights are a start that needs no further path.
    """
    if known:
        return _made_specific(_pruned(_forward(regression.with_terms(known), list(EFFECTS))))
    direct = _pruned(_forward(regression, list(EFFECTS)))
    found = {term.cause for term in direct.terms}
    # Over a part of a turn a bump, too, can stand for several lines at once: lines first.
    travel = regression.signals.run_turns().max()
    if not any(travel < EFFECTS[cause].flexible_below for cause in found):
        return direct
    specific = [cause for cause, effect in EFFECTS.items() if not effect.flexible_below]
    starts = [_forward(regression, on_runs())]
    beyond = regression.without_repeats()
    if beyond is not regression:
        # What acts on whole runs shows best beside an unknown pattern that repeats.
        settled = _forward(_forward(beyond, on_runs()), (ZeroSlip.kind,))
        starts.append(regression.with_terms(settled.terms))
    elif any(is_flexible(EFFECTS[cause]) for cause in found):
        slip = ZeroSlip.propose(regression)
        if slip is not None and slip.bic_gain > NEW_CAUSE:
            starts.append(regression.with_terms([slip]))
    declared = _with_declared_lines(regression)
    if declared is not regression:
        starts.append(declared)
    paths = [_pruned(_forward(_forward(s, specific), list(EFFECTS))) for s in starts]
    return _made_specific(min([direct, *paths], key=total_penalty))


def _with_declared_lines(regression: Regression) -> Regression:
    """With the lines of the shafts that the joint declares, before a wander may take them.

    What a random walk is fitted beside it leaves alone; those without evidence are pruned.
    """
    joint = regression.around.joint
    known = {shaft.name for shaft in joint.declared}
    if not known:
        return regression
    orders = [joint.output_order(name, k) for name, k in joint.gear_orders() if name in known]
    return regression.with_terms([MissingOrder.at(regression, order) for order in orders])


def _made_specific(regression: Regression) -> Regression:
    """With a specific cause in place of a flexible one where that explains more."""
    for term in [t for t in regression.terms if is_flexible(EFFECTS[t.cause])]:
        rest = regression.with_terms(t for t in regression.terms if t.cause != term.cause)
        tried = [
            start.with_terms([*start.terms, extension])
            for extension, start, gain in extensions(rest, on_runs())
            if total_penalty(rest) - gain < total_penalty(regression)
        ]
        best = min(tried, key=total_penalty, default=regression)
        if total_penalty(best) < total_penalty(regression):
            regression = _pruned(_forward(best, list(EFFECTS)))
    return regression


def total_penalty(regression: Regression) -> float:
    """BIC with the penalty of every cause: lower is better."""
    return regression.bic + _penalty(regression.terms, misfit(regression))


def misfit(regression: Regression) -> float:
    """Deviance that the causes found may leave because their forms are not exact."""
    return FORM * max(regression.start - regression.deviance, 0.0)


def _penalty(terms: Sequence[Extension], left: float) -> float:
    """Of causes beyond that of their parameters; their forms may leave ``left``."""
    causes = len(finding_groups(terms))
    # A cause that contains another one spends a second form on the same error.
    forms = causes + len({term.cause for term in terms if EFFECTS[term.cause].contains})
    return NEW_CAUSE * causes + left * max(forms - 1, 0)


def finding_groups(terms: Sequence[Extension]) -> list[list[int]]:
    """Indices of the terms that make one finding together, in the order found."""
    groups: list[list[int]] = []
    place: dict[str, int] = {}
    for k, term in enumerate(terms):
        if EFFECTS[term.cause].is_separate or term.cause not in place:
            place[term.cause] = len(groups)
            groups.append([k])
        else:
            groups[place[term.cause]].append(k)
    return groups


def cause_terms(regression: Regression, group: Sequence[int], settled: bool = False) -> Regression:
    """Without the terms ``group``; ``settled`` keeps the correlation of the noise."""
    terms = [t for k, t in enumerate(regression.terms) if k not in group]
    return regression.with_terms(terms, regression.whiten.rho if settled else None)


def propose(effect: type[Effect], regression: Regression) -> Extension | None:
    """What a cause proposes; nothing where a wider one that contains it is chosen already."""
    if any(effect in EFFECTS[term.cause].contains for term in regression.terms):
        return None
    return effect.propose(regression)


def extensions(
    regression: Regression, causes: Sequence[str]
) -> list[tuple[Extension, Regression, float]]:
    """What every cause proposes: the extension, what it extends, its net BIC gain.

    A cause that contains chosen ones as special cases takes their place.
    """
    found = []
    for cause in causes:
        effect = EFFECTS[cause]
        contained = {special.kind for special in effect.contains}
        if any(term.cause in contained for term in regression.terms):
            start = regression.with_terms(t for t in regression.terms if t.cause not in contained)
            penalty = total_penalty(start) - total_penalty(regression)
        else:
            start, penalty = regression, 0.0
        key = (cause, *((t.cause, repr(t.shape)) for t in start.terms))
        if key not in regression.memory:
            regression.memory[key] = propose(effect, start)
        extension = regression.memory[key]
        if extension is not None:
            found.append((extension, start, extension.bic_gain - penalty))
    return found


def _forward(regression: Regression, causes: Sequence[str]) -> Regression:
    while len(regression.terms) < MOST_TERMS and not regression.is_explained:
        best: tuple[float, Regression, Extension] | None = None
        for extension, start, gain in extensions(regression, causes):
            left = misfit(start)
            after = _penalty([*start.terms, extension], left + FORM * extension.deviance)
            score = gain - (after - _penalty(start.terms, left))
            if score > 0.0 and (best is None or score > best[0] + 1e-6):
                best = (score, start, extension)
        if best is None:
            return regression
        _, start, extension = best
        regression = start.with_terms([*start.terms, extension])
    return regression


def _pruned(regression: Regression) -> Regression:
    """Without the terms that the others have made superfluous."""
    while regression.terms:
        least = min(range(len(regression.terms)), key=lambda k: _net_loss(regression, k))
        without = cause_terms(regression, [least])
        if total_penalty(without) > total_penalty(regression):
            break
        regression = without
    regression = _plainest(regression)
    terms = [
        replace(term, deviance=_lost(regression, k)) for k, term in enumerate(regression.terms)
    ]
    return regression.with_terms(terms)


def _plainest(regression: Regression) -> Regression:
    """With a special case in place of a cause that contains it, where that does as well.

    What was chosen since may have explained what once spoke for the wider one.
    """
    for cause in {term.cause for term in regression.terms if EFFECTS[term.cause].contains}:
        rest = regression.with_terms(term for term in regression.terms if term.cause != cause)
        plain = _forward(rest, [special.kind for special in EFFECTS[cause].contains])
        if total_penalty(plain) < total_penalty(regression):
            regression = plain
    return regression


def _net_loss(regression: Regression, k: int) -> float:
    """Deviance that dropping term ``k`` would cost, less the penalty it would save."""
    term = regression.terms[k]
    alone = any(group == [k] for group in finding_groups(regression.terms))
    penalty = term.parameters * term.log_n + 2.0 * term.log_grid
    return _lost(regression, k) - penalty - (NEW_CAUSE if alone else 0.0)


def _lost(regression: Regression, k: int) -> float:
    """Deviance that term ``k`` saves beside all the others (Wald, or by fitting without)."""
    term = regression.terms[k]
    if term.run_effect is not None:
        return cause_terms(regression, [k]).deviance - regression.deviance
    _, coefficients = regression.fitted()[k]
    spread = regression.covariance(k) / regression.variance
    return regression.n * float(
        np.log1p(coefficients @ np.linalg.pinv(spread) @ coefficients / regression.rss)
    )
