"""Choose the causes: forward by evidence, flexible ones last, then backward."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from .candidates import CANDIDATES, FLEXIBLE, SEPARATE
from .space import Proposal, Space

__all__ = [
    "NEW_CAUSE",
    "RUN_FACTORS",
    "cause_terms",
    "finding_groups",
    "misfit",
    "proposals",
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


def select(space: Space, known: Sequence[Proposal] = ()) -> Space:
    """The space with the causes that its readings support.

    Forward selection with every candidate; where that takes a flexible cause (which can
    imitate any effect of a run) or, over a part of a turn, a bump, further paths take
    those only after the specific ones had their say, without and with a zero of each
    run's own (or with what acts on whole runs beside an error that repeats at the same
    angle). All are pruned backward; the best by BIC is kept. Terms ``known`` from the
    same readings with other weights are a start that needs no further path.
    """
    if known:
        return _made_specific(_pruned(_forward(space.with_terms(known), list(CANDIDATES))))
    direct = _pruned(_forward(space, list(CANDIDATES)))
    found = {term.cause for term in direct.terms}
    # Over a part of a turn a bump, too, can stand for several lines at once: lines first.
    travel = space.signals.run_turns().max()
    if not found & {*FLEXIBLE, *(["local_defect"] if travel < WHOLE_TURN else [])}:
        return direct
    specific = [cause for cause in CANDIDATES if cause not in (*FLEXIBLE, "local_defect")]
    starts = [_forward(space, RUN_FACTORS)]
    beyond = space.without_repeats()
    if beyond is not space:
        # What acts on whole runs shows best beside an unknown pattern that repeats.
        settled = _forward(_forward(beyond, RUN_FACTORS), ("zero_slip",))
        starts.append(space.with_terms(settled.terms))
    elif found & {*FLEXIBLE}:
        slip = CANDIDATES["zero_slip"].propose(space)
        if slip is not None and slip.bic_gain > NEW_CAUSE:
            starts.append(space.with_terms([slip]))
    paths = [_pruned(_forward(_forward(s, specific), list(CANDIDATES))) for s in starts]
    return _made_specific(min([direct, *paths], key=total_price))


def _made_specific(space: Space) -> Space:
    """With a specific cause in place of a flexible one where that explains more."""
    for term in [term for term in space.terms if term.cause in FLEXIBLE]:
        rest = space.with_terms(t for t in space.terms if t.cause != term.cause)
        tried = [
            start.with_terms([*start.terms, proposal])
            for proposal, start, gain in proposals(rest, RUN_FACTORS)
            if total_price(rest) - gain < total_price(space)
        ]
        best = min(tried, key=total_price, default=space)
        if total_price(best) < total_price(space):
            space = _pruned(_forward(best, list(CANDIDATES)))
    return space


def total_price(space: Space) -> float:
    """BIC with the price of every cause: lower is better."""
    return space.bic + _price(space.terms, misfit(space))


def misfit(space: Space) -> float:
    """Deviance that the causes found may leave because their forms are not exact."""
    return FORM * max(space.start - space.deviance, 0.0)


def _price(terms: Sequence[Proposal], left: float) -> float:
    """Of causes beyond that of their parameters; their forms may leave ``left``."""
    causes = len(finding_groups(terms))
    # A cause that contains another one spends a second form on the same error.
    forms = causes + len({term.cause for term in terms if CANDIDATES[term.cause].family})
    return NEW_CAUSE * causes + left * max(forms - 1, 0)


def finding_groups(terms: Sequence[Proposal]) -> list[list[int]]:
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


def cause_terms(space: Space, group: Sequence[int], settled: bool = False) -> Space:
    """The space without the terms ``group``; ``settled`` keeps its correlation of the noise."""
    terms = [t for k, t in enumerate(space.terms) if k not in group]
    return space.with_terms(terms, space.whiten.rho if settled else None)


def proposals(space: Space, causes: Sequence[str]) -> list[tuple[Proposal, Space, float]]:
    """What every cause proposes: the extension, the space it extends, its net BIC gain.

    A cause that contains chosen ones as special cases takes their place.
    """
    found = []
    for cause in causes:
        candidate = CANDIDATES[cause]
        if any(space.has(contained) for contained in candidate.family):
            start = space.with_terms(t for t in space.terms if t.cause not in candidate.family)
            price = total_price(start) - total_price(space)
        else:
            start, price = space, 0.0
        key = (cause, *((t.cause, repr(t.shape)) for t in start.terms))
        if key not in space.memory:
            space.memory[key] = candidate.propose(start)
        proposal = space.memory[key]
        if proposal is not None:
            found.append((proposal, start, proposal.bic_gain - price))
    return found


def _forward(space: Space, causes: Sequence[str]) -> Space:
    while len(space.terms) < MOST_TERMS and not space.is_explained:
        best: tuple[float, Space, Proposal] | None = None
        for proposal, start, gain in proposals(space, causes):
            left = misfit(start)
            after = _price([*start.terms, proposal], left + FORM * proposal.deviance)
            score = gain - (after - _price(start.terms, left))
            if score > 0.0 and (best is None or score > best[0] + 1e-6):
                best = (score, start, proposal)
        if best is None:
            return space
        _, start, proposal = best
        space = start.with_terms([*start.terms, proposal])
    return space


def _pruned(space: Space) -> Space:
    """Without the terms that the others have made superfluous."""
    while space.terms:
        least = min(range(len(space.terms)), key=lambda k: _worth(space, k))
        without = cause_terms(space, [least])
        if total_price(without) > total_price(space):
            break
        space = without
    space = _plainest(space)
    terms = [replace(term, deviance=_lost(space, k)) for k, term in enumerate(space.terms)]
    return space.with_terms(terms)


def _plainest(space: Space) -> Space:
    """With a special case in place of a cause that contains it, where that does as well.

    What was chosen since may have explained what once spoke for the wider one.
    """
    for cause in {term.cause for term in space.terms if CANDIDATES[term.cause].family}:
        rest = space.with_terms(term for term in space.terms if term.cause != cause)
        plain = _forward(rest, CANDIDATES[cause].family)
        if total_price(plain) < total_price(space):
            space = plain
    return space


def _worth(space: Space, k: int) -> float:
    """Deviance that dropping term ``k`` would cost, less the price it would save."""
    term = space.terms[k]
    alone = any(group == [k] for group in finding_groups(space.terms))
    price = term.parameters * term.log_n + 2.0 * term.log_grid
    return _lost(space, k) - price - (NEW_CAUSE if alone else 0.0)


def _lost(space: Space, k: int) -> float:
    """Deviance that term ``k`` saves beside all the others (Wald, or by fitting without)."""
    term = space.terms[k]
    if term.run_effect is not None:
        return cause_terms(space, [k]).deviance - space.deviance
    _, coefficients = space.fitted()[k]
    spread = space.covariance(k) / space.variance
    return space.n * float(
        np.log1p(coefficients @ np.linalg.pinv(spread) @ coefficients / space.rss)
    )
