"""Select the causes: forward by evidence, flexible ones last, then backward."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..effects import EFFECTS, Effect
from ..effects.effect import ALWAYS
from ..effects.local_defect import LocalDefect
from ..effects.missing_order import MissingOrder
from ..effects.zero_slip import ZeroSlip
from ..estimation.regression import BEYOND_SHOWN, Extension, Regression
from ..support.deadline import current_deadline
from .candidates import Candidate, CandidateScores, candidate_extensions, propose_candidates
from .formerrors import beside_form_errors, share_beside_form_errors
from .goodness import estimate_noise
from .penalty import (
    NEW_CAUSE,
    deviance_lost,
    finding_groups,
    form_misfit,
    forms_before,
    net_deviance_lost,
    penalty_of,
    regression_without,
    total_penalty,
)
from .remainder import remainder_of

#: Terms at most.
MOST_TERMS = 14

#: Times the gain of a step that the further ones may bring on average. Gains fall but where
#: causes show together only: of 240 walks 1 in 100 rose by more than 2.6, none of them to
#: another account.
RISING = 4.0


def acts_on_runs() -> list[str]:
    """Specific causes that act on whole runs: direction, speed, load, temperature, mount."""
    return [cause for cause, effect in EFFECTS.items() if effect.acts_on_runs]


def is_flexible(effect: type[Effect]) -> bool:
    """It can imitate a specific cause, on any travel; chosen after those were tried."""
    return effect.flexible_below == ALWAYS


def select_causes(regression: Regression, known: Sequence[Extension] = ()) -> Regression:
    """The regression with the causes that its readings support, priced by the noise found.

    Terms ``known`` from the same readings with other weights are a start that needs no further
    path.
    """
    if known:
        known_too = _pruned(_forward(regression.with_terms(known), list(EFFECTS)))
        return _priced_with_noise(_made_specific(known_too))
    ahead = _specific_first(regression)
    direct = _pruned(_forward(regression, list(EFFECTS)))
    direct = min([*ahead, direct], key=total_penalty)
    noisy = _under_its_noise(direct)
    if noisy is not direct:
        # Once something else was chosen, a correlation absorbs what a law would explain.
        direct = _by_other_paths(regression, direct)
        noisy = _under_its_noise(direct)
        regression = regression.with_terms((), noisy.whiten.rho)
        direct = min(noisy, _pruned(_forward(regression, list(EFFECTS))), key=total_penalty)
    if current_deadline().over:
        return direct
    return _priced_with_noise(_by_other_paths(regression, _with_lines_for_bumps(direct)))


def select_again(regression: Regression, causes: Sequence[str], goal: float = np.inf) -> Regression:
    """With the best of some causes in addition to the terms, less what they make superfluous.

    As it is where these cannot come down to a penalty of ``goal``.
    """
    return _pruned(_forward(regression, causes, goal))


def _specific_first(regression: Regression) -> list[Regression]:
    """Over a part of a turn: the choice by a path that takes flexible causes last; else none.

    There a bump can imitate several lines, and a drift, whose search takes longest, most else.
    """
    if regression.signals.run_turns().max() >= LocalDefect.flexible_below:
        return []
    specific = [cause for cause, effect in EFFECTS.items() if not effect.flexible_below]
    start = _beside_repeats(regression)
    if start is regression:
        start = _forward(regression, acts_on_runs())
    return [_in_form(_pruned(_forward(_forward(start, specific), list(EFFECTS))))]


def _in_form(regression: Regression) -> Regression:
    """With the forms that causes of whole runs have given all that was chosen since."""
    for term in regression.terms:
        effect = EFFECTS[term.cause]
        alone = sum(other.cause == term.cause for other in regression.terms) == 1
        if not (effect.acts_on_runs and alone):
            continue
        rest = regression.with_terms(t for t in regression.terms if t.cause != term.cause)
        again = propose_candidates(effect, rest)
        if again is not None and again.shape != term.shape:
            other = rest.with_terms([*rest.terms, again])
            regression = min(regression, other, key=total_penalty)
    return regression


def _beside_repeats(regression: Regression) -> Regression:
    """With what acts on whole runs, fitted jointly with an unknown pattern that repeats."""
    beyond = regression.without_repeats()
    if beyond is regression:
        return regression
    settled = _forward(_forward(beyond, acts_on_runs()), (ZeroSlip.kind,))
    return regression.with_terms(settled.terms)


def _priced_with_noise(regression: Regression) -> Regression:
    """Causes that the noise's own correlation does not pay for are dropped.

    It is estimated jointly with a flexible pattern. The correlation used in selection, with drift
    removed, is too low for noise that is correlated over many readings, and run means then look
    significant. A drift in time competes with correlation alone.
    """
    return _without_misfits(_under_its_noise(regression))


def _under_its_noise(regression: Regression) -> Regression:
    """Under the correlation by restricted likelihood, where that explains more; else itself.

    Under too low a correlation a path finds causes in noise. This is tested at the end of the
    first path, before the slow others, and for an account that was ended early, too.
    """
    noise = estimate_noise(remainder_of(regression))
    tried = [regression]
    # Correlations nearer to each other are one.
    if noise.correlation > regression.whiten.rho + 0.02:
        tried.append(_pruned(regression.with_terms(regression.terms, noise.correlation)))
    plain = [t for t in regression.terms if not _takes_up(t)]
    if len(plain) < len(regression.terms):
        rest = regression.with_terms(plain)
        noise = estimate_noise(remainder_of(rest))
        # Each run's own mean is fitted too, so a larger correlation is possible as well: by two
        # standard errors, but less than 1.
        trials = [noise.correlation + k * noise.std for k in range(3)]
        tried += [_pruned(rest.with_terms(plain, rho)) for rho in trials if 0.0 < rho < 0.999]
    return min(tried, key=total_penalty)


def _takes_up(term: Extension) -> bool:
    """Whether it can follow correlated noise: random in every run, or flexible."""
    return term.run_effect is not None or is_flexible(EFFECTS[term.cause])


def _by_other_paths(regression: Regression, direct: Regression) -> Regression:
    """The best of a first choice among all causes and of choices by other paths.

    Where forward selection with every candidate takes a flexible cause (which can
    imitate any effect of a run) or, over a part of a turn, a bump, further paths take
    those only after the specific ones were tried, without and with a separate zero of each
    run (or with what acts on whole runs, fitted jointly with an error that repeats at the same
    angle, or with the lines of shafts that the joint declares). All are pruned
    backward; the best by BIC is kept.
    """
    if current_deadline().over:
        return direct
    # The causes chosen jointly with a flexible one that was dropped since count, too.
    grown = _forward(regression, list(EFFECTS))
    found = {term.cause for term in (*direct.terms, *grown.terms)}
    # Over a part of a turn a bump, too, can imitate several lines at once: lines first.
    travel = regression.signals.run_turns().max()
    if not any(travel < EFFECTS[cause].flexible_below for cause in found):
        return direct
    specific = [cause for cause, effect in EFFECTS.items() if not effect.flexible_below]
    goal = total_penalty(direct)
    starts = [_forward(regression, acts_on_runs(), goal)]
    settled = _beside_repeats(regression)
    if settled is not regression:
        starts.append(settled)
    elif any(is_flexible(EFFECTS[cause]) for cause in found):
        slip = ZeroSlip.propose(regression)
        if slip is not None and slip.bic_gain > NEW_CAUSE:
            starts.append(regression.with_terms([slip]))
    declared = _with_declared_lines(regression)
    if declared is not regression:
        starts.append(declared)
    paths = [_pruned(_forward(_forward(s, specific, goal), list(EFFECTS))) for s in starts]
    if declared is not regression:
        # With the declared lines fitted, a drift does not imitate other slow curves.
        flexible = [cause for cause, effect in EFFECTS.items() if is_flexible(effect)]
        paths.append(_pruned(_forward(_forward(declared, flexible), list(EFFECTS))))
    return _made_specific(min([direct, *paths], key=total_penalty))


def _with_lines_for_bumps(regression: Regression) -> Regression:
    """With lines in place of bumps where lines explain more: a wide bump imitates several.

    One after the other each line saves less than a bump that imitates all of them at once.
    """
    plain = [term for term in regression.terms if term.cause != LocalDefect.kind]
    if len(plain) == len(regression.terms):
        return regression
    lines = _forward(regression.with_terms(plain), [MissingOrder.kind])
    if len(lines.terms) < len(plain) + 2:
        return regression
    tried = _pruned(_forward(_pruned(lines), list(EFFECTS)))
    return min(regression, tried, key=total_penalty)


def _with_declared_lines(regression: Regression) -> Regression:
    """With the lines of the shafts that the joint declares, before a drift may take them.

    A random walk fitted jointly does not explain them; those without evidence are pruned.
    """
    joint = regression.around.joint
    known = {shaft.name for shaft in joint.declared}
    if not known:
        return regression
    orders = [joint.output_order(name, k) for name, k in joint.gear_orders() if name in known]
    return regression.with_terms([MissingOrder.at(regression, order) for order in orders])


def _made_specific(regression: Regression) -> Regression:
    """With a specific cause in place of a flexible one where that explains more.

    What the form of a law leaves, the flexible one explains in its place: this counts in the
    evidence, and no additional allowance for it is charged.
    """
    for term in [t for t in regression.terms if is_flexible(EFFECTS[t.cause])]:
        left = form_misfit(regression)

        def price(account: Regression, left: float = left) -> float:
            return account.bic + penalty_of(account.terms, left, forms_before(account))

        rest = regression.with_terms(t for t in regression.terms if t.cause != term.cause)
        tried = [
            start.with_terms([*start.terms, extension])
            for extension, start, gain in candidate_extensions(rest, acts_on_runs())
            if price(rest) - gain < price(regression)
        ]
        best = min(tried, key=price, default=regression)
        if price(best) < price(regression):
            regression = _pruned(_forward(best, list(EFFECTS)))
    return regression


def _forward(regression: Regression, causes: Sequence[str], goal: float = np.inf) -> Regression:
    """With the best cause added, again and again, as long as the evidence increases.

    Where these alone cannot come down to a penalty of ``goal``, the walk ends early.
    """

    def build() -> Regression | None:
        grown = _grown(regression, causes, goal)
        # Not itself: what holds itself is not let go of.
        return None if grown is regression else grown

    grown = regression.cache.of_fit(("forward", goal, *causes), build)
    return regression if grown is None else grown


def _grown(regression: Regression, causes: Sequence[str], goal: float) -> Regression:
    found: list[Candidate] = []
    while len(regression.terms) < MOST_TERMS and not regression.is_explained:
        scores = CandidateScores()
        found = candidate_extensions(regression, causes, scores.least, found)
        best = scores.best(found)
        # A step that was not finished chose among some only: it chose nothing.
        if best is None or current_deadline().over:
            return regression
        score, (extension, start, _) = best
        reach = RISING * (MOST_TERMS - len(regression.terms)) * score
        if total_penalty(regression) - reach > goal:
            return regression
        regression = start.with_terms([*start.terms, extension])
    return regression


def _without_misfits(regression: Regression) -> Regression:
    """Without causes that form errors of the others explain as well, the weakest first.

    They may have been chosen when the others were not known, or not in their form.
    """
    while not current_deadline().over:
        groups = finding_groups(regression.terms)
        if len(groups) < 2:
            return regression
        told = []
        for group in groups:
            rest = regression_without(regression, group, settled=True)
            beside = beside_form_errors(rest, {regression.terms[group[0]].cause})
            if beside is not rest:
                saved = deviance_lost(regression, group)
                share = share_beside_form_errors(rest, beside, [regression.terms[k] for k in group])
                told.append((net_deviance_lost(regression, group) - (1.0 - share) * saved, group))
        if not told or min(told)[0] > 0.0:
            return regression
        regression = _pruned(regression_without(regression, min(told)[1]))
    return regression


def _pruned(regression: Regression) -> Regression:
    """Without the terms that the others have made superfluous."""
    while regression.terms and not current_deadline().over:
        # Terms larger than all that the readings show only take each other off again.
        beyond = [[k] for k in range(len(regression.terms)) if _is_beyond_shown(regression, k)]
        least = min(
            beyond or _droppable(regression), key=lambda g: net_deviance_lost(regression, g)
        )
        without = regression_without(regression, least)
        if not beyond and total_penalty(without) > total_penalty(regression):
            break
        regression = without
    regression = _plainest(regression)
    terms = [
        replace(term, deviance=deviance_lost(regression, [k]))
        for k, term in enumerate(regression.terms)
    ]
    return regression.with_evidence(terms)


def _is_beyond_shown(regression: Regression, k: int) -> bool:
    """The term is larger than the readings show at all."""
    term, coefficients = regression.fitted()[k]
    if term.run_effect is None:
        size = float(np.std(term.columns @ coefficients))
    else:
        power = float(np.mean(np.sum(term.run_effect.columns**2, axis=1)))
        size = float(np.sqrt(max(term.run_effect.ratio, 0.0) * power * regression.variance))
    return size > BEYOND_SHOWN * regression.readings.scatter


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


def _droppable(regression: Regression) -> list[list[int]]:
    """What may be dropped at once: a term, or all of a cause.

    Each element of a cause may justify its parameters, but the whole cause not its form.
    """
    whole = [group for group in finding_groups(regression.terms) if len(group) > 1]
    return [[k] for k in range(len(regression.terms))] + whole
