"""Penalties of groups of causes, the misfit of their forms, the deviance lost without them."""

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
    left, before = form_misfit(regression), forms_before(regression)
    return regression.bic + penalty_of(regression.terms, left, before)


def forms_before(regression: Regression) -> int:
    """Causes with a form that are in the readings themselves: a delay that was subtracted."""
    return int(regression.readings.beside is not None)


def form_misfit(regression: Regression) -> float:
    """Deviance that the causes found may leave because their forms are not exact.

    A step of the zero has no form that could be inexact, however far apart zeros are, and neither
    has a share that counts of teeth make: what such terms explain is not counted.
    """
    return deviance_of_form_errors(
        deviance_before_forms(regression) - regression.deviance, regression.n
    )


def deviance_before_forms(regression: Regression) -> float:
    """Deviance before any cause with a form was added."""
    effects = [(term, EFFECTS[term.cause]) for term in regression.terms]
    formless = [term for term, e in effects if e.draws_zeros or e.has_exact_form]
    if not formless:
        return float(regression.start)
    found: float = regression.cache.of_fit(
        "before forms", lambda: regression.with_terms(formless).deviance
    )
    return min(float(regression.start), found)


def misfit_of_scatter(start: Regression, chosen: Regression) -> float:
    """As `form_misfit`, by how much smaller the readings' scatter has become.

    Correlated noise absorbs a part of what is not yet explained, and hides it from a likelihood.
    """
    exact = [term for term in chosen.terms if EFFECTS[term.cause].has_exact_form]
    without = start.with_terms(exact) if exact else start
    before, after = (float(np.var(one.left_within_runs)) for one in (without, chosen))
    return deviance_of_form_errors(
        chosen.n * math.log(max(before / max(after, 1e-300), 1.0)), chosen.n
    )


def deviance_of_form_errors(deviance: float, readings: int) -> float:
    """Deviance of a share of the energy that a deviance represents.

    n readings of noise 1 with an error of energy n E give a deviance of
    ``n ln(1 + E)``; `FORM` of that energy one of ``n ln(1 + FORM E)``.
    """
    energy = np.expm1(min(max(deviance, 0.0) / readings, 500.0))
    return float(readings * np.log1p(FORM * energy))


def penalty_of(terms: Sequence[Extension], left: float, before: int = 0) -> float:
    """Of causes beyond that of their parameters; their forms may leave ``left``.

    ``before`` counts those with a form that are no terms.
    """
    # A line of a declared shaft is expected, and its order is declared.
    declared = sum(term.cause == MissingOrder.kind and not term.log_grid for term in terms)
    effects = [EFFECTS[term.cause] for term in terms]
    separate = [effect for effect in effects if effect.is_separate]
    # As many findings as `finding_groups` makes.
    causes = len(separate) + len({*effects} - {*separate}) - declared
    # A cause that contains another one spends a second form on the same error.
    forms = causes + len({effect for effect in effects if effect.contains})
    return NEW_CAUSE * causes + left * max(before + forms - 1, 0)


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
    left, before = form_misfit(regression), forms_before(regression)
    kept = [term for k, term in enumerate(terms) if k not in group]
    own = sum(terms[k].parameters * terms[k].log_n + 2.0 * terms[k].log_grid for k in group)
    return (
        deviance_lost(regression, group)
        - own
        - (penalty_of(terms, left, before) - penalty_of(kept, left, before))
    )


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
