"""Choose the causes: forward by evidence, flexible ones last, then backward."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from ..regression.regression import Extension, Regression
from .candidates import CANDIDATES, FLEXIBLE, SEPARATE

__all__ = [
    "NEW_CAUSE",
    "RUN_FACTORS",
    "cause_terms",
    "extensions",
    "finding_groups",
    "misfit",
    "select",
]

#: Evidence (in units of BIC) that a new cause must bring beyond its price: 6 is what
#: Kass and Raftery call strong, odds of 20 to 1.
NEW_CAUSE = 6.0

#: Share of the deviance explained so far that a further cause, or a form of its own for one,
#: must bring as well: a form known to 3 % leaves 0.1 % of its energy, and no cause.
FORM = 1e-3

#: Specific causes that act on whole runs: direction, speed, load, temperature, mount.
RUN_FACTORS = (
    "backlash",
    "latency",
    "torsional_compliance",
    "scale_error",
    "thermal_drift",
    "stiffening_compliance",
    "presliding_hysteresis",
    "reference_error",
)

#: Travel (turns) from which on lines and bumps differ for certain.
WHOLE_TURN = 0.9

#: Terms at most.
MOST_TERMS = 14


def select(regression: Regression, known: Sequence[Extension] = ()) -> Regression:
    """The regression with the causes that its readings support.

    Forward selection with every candidate; where that takes a flexible cause (which can
    imitate any effect of a run) or, over a part of a turn, a bump, further paths take
    those only after the specific ones had their say, without and with a zero of each
    run's own (or with what acts on whole runs beside an error that repeats at the same
    angle). All are pruned backward; the best by BIC is kept. Terms ``known`` from the
    same readings with other weights are a start that needs no further path.
    """
    if known:
        return _made_specific(_pruned(_forward(regression.with_terms(known), list(CANDIDATES))))
    direct = _pruned(_forward(regression, list(CANDIDATES)))
    found = {term.cause for term in direct.terms}
    # Over a part of a turn a bump, too, can stand for several lines at once: lines first.
    travel = regression.signals.run_turns().max()
    if not found & {*FLEXIBLE, *(["local_defect"] if travel < WHOLE_TURN else [])}:
        return direct
    specific = [cause for cause in CANDIDATES if cause not in (*FLEXIBLE, "local_defect")]
    starts = [_forward(regression, RUN_FACTORS)]
    beyond = regression.without_repeats()
    if beyond is not regression:
        # What acts on whole runs shows best beside an unknown pattern that repeats.
        settled = _forward(_forward(beyond, RUN_FACTORS), ("zero_slip",))
        starts.append(regression.with_terms(settled.terms))
    elif found & {*FLEXIBLE}:
        slip = CANDIDATES["zero_slip"].propose(regression)
        if slip is not None and slip.bic_gain > NEW_CAUSE:
            starts.append(regression.with_terms([slip]))
    paths = [_pruned(_forward(_forward(s, specific), list(CANDIDATES))) for s in starts]
    return _made_specific(min([direct, *paths], key=total_price))


def _made_specific(regression: Regression) -> Regression:
    """With a specific cause in place of a flexible one where that explains more."""
    for term in [term for term in regression.terms if term.cause in FLEXIBLE]:
        rest = regression.with_terms(t for t in regression.terms if t.cause != term.cause)
        tried = [
            start.with_terms([*start.terms, extension])
            for extension, start, gain in extensions(rest, RUN_FACTORS)
            if total_price(rest) - gain < total_price(regression)
        ]
        best = min(tried, key=total_price, default=regression)
        if total_price(best) < total_price(regression):
            regression = _pruned(_forward(best, list(CANDIDATES)))
    return regression


def total_price(regression: Regression) -> float:
    """BIC with the price of every cause: lower is better."""
    return regression.bic + _price(regression.terms, misfit(regression))


def misfit(regression: Regression) -> float:
    """Deviance that the causes found may leave because their forms are not exact."""
    return FORM * max(regression.start - regression.deviance, 0.0)


def _price(terms: Sequence[Extension], left: float) -> float:
    """Of causes beyond that of their parameters; their forms may leave ``left``."""
    causes = len(finding_groups(terms))
    # A cause that contains another one spends a second form on the same error.
    forms = causes + len({term.cause for term in terms if CANDIDATES[term.cause].family})
    return NEW_CAUSE * causes + left * max(forms - 1, 0)


def finding_groups(terms: Sequence[Extension]) -> list[list[int]]:
    """Indices of the terms that make one finding together, in the order found."""
    groups: list[list[int]] = []
    place: dict[str, int] = {}
    for k, term in enumerate(terms):
        if term.cause in SEPARATE or term.cause not in place:
            place[term.cause] = len(groups)
            groups.append([k])
        else:
            groups[place[term.cause]].append(k)
    return groups


def cause_terms(regression: Regression, group: Sequence[int], settled: bool = False) -> Regression:
    """Without the terms ``group``; ``settled`` keeps the correlation of the noise."""
    terms = [t for k, t in enumerate(regression.terms) if k not in group]
    return regression.with_terms(terms, regression.whiten.rho if settled else None)


def extensions(
    regression: Regression, causes: Sequence[str]
) -> list[tuple[Extension, Regression, float]]:
    """What every cause proposes: the extension, the regression it extends, its net BIC gain.

    A cause that contains chosen ones as special cases takes their place.
    """
    found = []
    for cause in causes:
        candidate = CANDIDATES[cause]
        if any(regression.has(contained) for contained in candidate.family):
            start = regression.with_terms(
                t for t in regression.terms if t.cause not in candidate.family
            )
            price = total_price(start) - total_price(regression)
        else:
            start, price = regression, 0.0
        key = (cause, *((t.cause, repr(t.shape)) for t in start.terms))
        if key not in regression.memory:
            regression.memory[key] = candidate.propose(start)
        extension = regression.memory[key]
        if extension is not None:
            found.append((extension, start, extension.bic_gain - price))
    return found


def _forward(regression: Regression, causes: Sequence[str]) -> Regression:
    while len(regression.terms) < MOST_TERMS and not regression.is_explained:
        best: tuple[float, Regression, Extension] | None = None
        for extension, start, gain in extensions(regression, causes):
            left = misfit(start)
            after = _price([*start.terms, extension], left + FORM * extension.deviance)
            score = gain - (after - _price(start.terms, left))
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
        least = min(range(len(regression.terms)), key=lambda k: _worth(regression, k))
        without = cause_terms(regression, [least])
        if total_price(without) > total_price(regression):
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
    for cause in {term.cause for term in regression.terms if CANDIDATES[term.cause].family}:
        rest = regression.with_terms(term for term in regression.terms if term.cause != cause)
        plain = _forward(rest, CANDIDATES[cause].family)
        if total_price(plain) < total_price(regression):
            regression = plain
    return regression


def _worth(regression: Regression, k: int) -> float:
    """Deviance that dropping term ``k`` would cost, less the price it would save."""
    term = regression.terms[k]
    alone = any(group == [k] for group in finding_groups(regression.terms))
    price = term.parameters * term.log_n + 2.0 * term.log_grid
    return _lost(regression, k) - price - (NEW_CAUSE if alone else 0.0)


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
