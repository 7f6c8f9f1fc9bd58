"""Penalties of groups of causes, the deviance lost without them, the scatter that forms leave."""

from __future__ import annotations

import math
from collections.abc import Sequence

import numpy as np

from ..effects import EFFECTS
from ..effects.missing_order import MissingOrder
from ..estimation.linear import wald_statistic
from ..estimation.regression import Extension, Regression
from .formerrors import FORM

#: Evidence (in units of BIC) that a new cause must bring beyond its penalty: 6 is what
#: Kass and Raftery call strong, odds of 20 to 1.
NEW_CAUSE = 6.0


def total_penalty(regression: Regression) -> float:
    """BIC with the penalty of every cause: lower is better."""
    return regression.bic + penalty_of(regression.terms)


def misfit_of_scatter(start: Regression, chosen: Regression) -> float:
    """Deviance that the causes found may leave because their forms are not exact.

    `FORM` of the energy by which the readings' scatter has become smaller: correlated noise absorbs
    a part of what is not yet explained, and hides it from a likelihood. A count of teeth has no
    form to be inexact.
    """
    exact = [term for term in chosen.terms if EFFECTS[term.cause].has_exact_form]
    without = start.with_terms(exact) if exact else start
    before, after = (float(np.var(one.left_within_runs)) for one in (without, chosen))
    return chosen.n * math.log1p(FORM * max(before / max(after, 1e-300) - 1.0, 0.0))


def penalty_of(terms: Sequence[Extension]) -> float:
    """Of causes beyond that of their parameters."""
    # A line of a declared shaft is expected, and its order is declared.
    declared = sum(term.cause == MissingOrder.kind and not term.log_grid for term in terms)
    effects = [EFFECTS[term.cause] for term in terms]
    separate = [effect for effect in effects if effect.is_separate]
    # As many findings as `finding_groups` makes.
    return NEW_CAUSE * (len(separate) + len({*effects} - {*separate}) - declared)


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


def regression_without(
    regression: Regression, group: Sequence[int], settled: bool = False
) -> Regression:
    """Without the terms ``group``; ``settled`` keeps the correlation of the noise."""
    terms = [t for k, t in enumerate(regression.terms) if k not in group]
    return regression.with_terms(terms, regression.whiten.rho if settled else None)


def net_deviance_lost(regression: Regression, group: Sequence[int]) -> float:
    """Deviance that dropping the terms ``group`` would cost, less the penalties it would save."""
    terms = regression.terms
    kept = [term for k, term in enumerate(terms) if k not in group]
    own = sum(terms[k].parameters * terms[k].log_n + 2.0 * terms[k].log_grid for k in group)
    return deviance_lost(regression, group) - own - (penalty_of(terms) - penalty_of(kept))


def deviance_lost(regression: Regression, group: Sequence[int]) -> float:
    """Deviance that the terms ``group`` save beyond all others (Wald, or by a fit without them)."""
    if any(regression.terms[k].run_effect is not None for k in group):
        without: float = regression.cache.of_fit(
            ("lost", *group), lambda: regression_without(regression, group).deviance
        )
        return without - regression.deviance
    columns = np.concatenate([regression.place(k) for k in group])
    coefficients = regression.coefficients[columns]
    spread = regression.unscaled_covariance[np.ix_(columns, columns)]
    return regression.n * math.log1p(wald_statistic(coefficients, spread) / regression.rss)
