"""Exchange causes of an account, one for another or for none, while that explains more.

Forward and backward steps make one change at a time. The gain of a cause in addition to others,
and which readings are outliers, may differ once another cause is replaced. Of two overlapping
causes the first was chosen while it explained both: over a part of a turn orders 6 and 7 for 5.
"""

from __future__ import annotations

import itertools

from ..effects import EFFECTS
from ..estimation.regression import Regression
from ..support.deadline import current_deadline
from .candidates import propose_candidates
from .overlap import finding_overlaps
from .penalty import finding_groups, regression_without, total_penalty
from .selection import is_flexible, select_again

#: Exchanges at most; findings up to which others are tried in the place of each: of more, which are
#: implausible together, that would take as long as the whole choice; and the partial correlation
#: from which on two are exchanged together: one could explain half of what the other does.
MOST_EXCHANGES, LOOKED_AT, OVERLAP = 9, 2, 0.5

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
    return regression


def _better(regression: Regression) -> Regression | None:
    limit = total_penalty(regression) - BETTER
    reshaped = _reshaped(regression)
    if total_penalty(reshaped) < limit:
        return reshaped
    groups = finding_groups(regression.terms)
    groups.sort(key=lambda group: sum(regression.terms[k].bic_gain for k in group))
    overlaps = [pair for pair in finding_overlaps(regression, groups) if pair[2] > OVERLAP]
    # One finding, then two that overlap, those that do so most first.
    taken = [[group] for group in groups]
    taken += [[groups[i], groups[j]] for i, j, _ in sorted(overlaps, key=lambda pair: -pair[2])]
    for one, *two in taken:
        rest = regression_without(regression, [*one, *itertools.chain(*two)])
        for other in (rest, _reshaped(rest)):
            if total_penalty(other) < limit:
                return other
        own = regression.terms[one[0]].cause
        if len(groups) > LOOKED_AT and not (two or EFFECTS[own].flexible_below):
            continue
        # A flexible cause explains more than any law, and is none.
        others = [name for name, effect in EFFECTS.items() if not is_flexible(effect)]
        tried = select_again(rest, [name for name in others if two or name != own], limit)
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
