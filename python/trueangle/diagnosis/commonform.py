"""What is seen under the name that claims no more: the form that its possible causes share."""

from __future__ import annotations

from collections.abc import Sequence

from ..effects import EFFECTS
from ..effects.blindness import Blindness
from ..estimation.regression import Regression
from .candidates import propose
from .identifiability import doubts_about
from .penalty import cause_terms, finding_groups

__all__ = ["in_common_form"]


def in_common_form(regression: Regression, spots: Sequence[Blindness]) -> Regression:
    """The regression with the common form in place of causes that are not told apart.

    A reversal error may be play or a spring, a ramp the ratio's or a clock's: which of them is
    open, but not that it is there, nor its size for motion like this.
    """
    for cause in [regression.terms[g[0]].cause for g in finding_groups(regression.terms)]:
        group = [k for k, term in enumerate(regression.terms) if term.cause == cause]
        spot = doubts_about(regression.terms[group[0]], regression, spots) if group else None
        if spot is None or not spot.common or spot.common == cause:
            continue
        rest = cause_terms(regression, group, settled=True)
        common = propose(EFFECTS[spot.common], rest)
        if common is not None and common.bic_gain > 0.0:
            regression = rest.with_terms([*rest.terms, common])
    return regression
