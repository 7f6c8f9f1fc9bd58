"""Exchange causes of an account, one for another or for none, while that explains more.

Forward and backward steps make one change at a time. The gain of a cause in addition to others,
and which readings are outliers, may differ once another cause is replaced. Of two overlapping
causes the first was chosen while it explained both: over a part of a turn orders 6 and 7 for 5.
"""

from __future__ import annotations

from ..effects import EFFECTS
from ..estimation.regression import Regression
from ..support.deadline import current_deadline
from .candidates import propose_candidates
from .overlap import finding_overlaps
from .penalty import finding_groups, regression_without, total_penalty
from .selection import is_flexible, select_again

#: Exchanges at most, and findings up to which others are tried in the place of each: of more, which
#: are implausible together, that would take as long as the whole choice.
MOST_EXCHANGES, LOOKED_AT = 3, 2

#: Pairs that are exchanged at most, and the partial correlation from which on a pair is tried: the
#: other could explain half of what one explains.
MOST_PAIRS, OVERLAP = 6, 0.5

#: Criterion by which another account must be better: nothing worth more than a bare mention.
BETTER = 2.0


def exchanged_causes(regression: Regression) -> Regression:
    """The account that no removal or replacement of a cause improves.

    Parameters
    ----------
    regression : Regression

    Returns
    -------
    Regression
        The same where nothing is better. The cost is that of the rivals which are reported of
        every finding, and these are kept for that.
    """
    for _ in range(MOST_EXCHANGES):
        better = None if current_deadline().over else _better(regression)
        if better is None:
            break
        regression = better
    for _ in range(MOST_PAIRS):
        better = _better_pair(regression)
        if better is None:
            return regression
        regression = better
    return regression


def _better_pair(regression: Regression) -> Regression | None:
    """With others in the place of two causes that overlap, those that do so most first."""
    limit = total_penalty(regression) - BETTER
    groups = finding_groups(regression.terms)
    pairs = [pair for pair in finding_overlaps(regression, groups) if pair[2] > OVERLAP]
    specific = [name for name, effect in EFFECTS.items() if not is_flexible(effect)]
    for i, j, _ in sorted(pairs, key=lambda pair: -pair[2]):
        if current_deadline().over:
            return None
        tried = select_again(regression_without(regression, [*groups[i], *groups[j]]), specific)
        if total_penalty(tried) < limit and not current_deadline().over:
            return tried
    return None


def _better(regression: Regression) -> Regression | None:
    limit = total_penalty(regression) - BETTER
    reshaped = _reshaped(regression)
    if total_penalty(reshaped) < limit:
        return reshaped
    groups = finding_groups(regression.terms)
    groups.sort(key=lambda group: sum(regression.terms[k].bic_gain for k in group))
    for group in groups:
        rest = regression_without(regression, group)
        if total_penalty(rest) < limit:
            return rest
        reshaped = _reshaped(rest)
        if reshaped is not rest and total_penalty(reshaped) < limit:
            return reshaped
        own = regression.terms[group[0]].cause
        if len(groups) > LOOKED_AT and not EFFECTS[own].flexible_below:
            continue
        # A flexible cause explains more than any law, and is none.
        others = [
            name for name, effect in EFFECTS.items() if not (name == own or is_flexible(effect))
        ]
        tried = select_again(rest, others, limit)
        if total_penalty(tried) < limit and not current_deadline().over:
            return tried
    return None


def _reshaped(regression: Regression) -> Regression:
    """With causes whose form depends on the other terms in the form that they have now.

    A cause chosen or dropped since may have explained a part of one: a delay explains the constant
    part of channels that are read one after the other, and their line then has another sign.
    """
    for term in regression.terms:
        if current_deadline().over or not EFFECTS[term.cause].form_follows:
            continue
        rest = regression.with_terms(other for other in regression.terms if other is not term)
        again = propose_candidates(EFFECTS[term.cause], rest)
        if again is not None and again.shape != term.shape:
            tried = rest.with_terms([*rest.terms, again])
            regression = min(regression, tried, key=total_penalty)
    return regression
