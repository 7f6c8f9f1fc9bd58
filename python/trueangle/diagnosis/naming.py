"""Names of the chosen causes, jointly with the factors that the error follows."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace

import numpy as np

from ..effects import EFFECTS, Curve
from ..effects.ambiguity import Ambiguity
from ..estimation.regression import Regression
from ..support.arrays import Array
from ..support.deadline import current_deadline
from .factors.factor import Factor
from .factors.group import TOGETHER
from .factors.statement import account_rows, stated_factors
from .finding import Finding
from .findings import findings_of, reconsidered_findings, remeasured_findings
from .goodness.unexplained import Unexplained
from .holdout import rebuilt_term
from .penalty import regression_without, total_penalty
from .remainder import free_paths, unexplained_remainder
from .selection import select_again
from .unseenorders import arc_note

#: Share of the work that the names may take, with all before them.
FOR_FINDINGS = 0.92


@dataclass(frozen=True)
class NamedCauses:
    """Causes chosen, each as a finding, and the factors that the readings follow.

    Attributes
    ----------
    chosen : Regression
    rest : Unexplained
        What they leave.
    findings : list of Finding
    spots : list of Ambiguity
    factors : list of Factor
    lost : list of int
        Terms of findings whose form is not better than the free function of its factors.
    moved : set of float
        Lines of the simulation whose change is a part of what the readings follow.
    """

    chosen: Regression
    rest: Unexplained
    findings: list[Finding]
    spots: list[Ambiguity]
    factors: list[Factor]
    lost: list[int]
    moved: set[float]

    @property
    def curves(self) -> list[Curve]:
        """The curves that represent factors without a fitting name in a simulation."""
        return [c for factor in self.factors if not factor.named_by for c in factor.effects]

    def less_factors(self, sigma: float | None) -> Unexplained:
        """What they leave beyond the factors without a name: what these explain is explained.

        Two that act together are not: no curve of a simulation holds them.
        """
        alone = [f for f in self.factors if not f.named_by and f.factor not in TOGETHER]
        explained = [f.fitted for f in alone if f.fitted is not None]
        if not explained:
            return self.rest
        terms = range(len(self.chosen.terms))
        less, _ = beyond_factors(self.chosen, np.sum(explained, axis=0), terms)
        return unexplained_remainder(less, sigma, self.chosen)

    @property
    def unnamed(self) -> float:
        """Variance of what the readings follow and no name fits."""
        return sum(factor.rms**2 for factor in self.factors if not factor.named_by)


def beyond_factors(
    chosen: Regression, function: Array, terms: Iterable[int]
) -> tuple[Regression, list[int]]:
    """Readings less what factors explain, by some of the terms, and which of them.

    A path in time that only followed what the factors explain is none of them.
    """
    kept, rows = list(terms), np.zeros(chosen.n, dtype=bool)
    rows[account_rows(chosen)] = True
    part = chosen.of_rows(rows)
    less = part.of_readings(part.readings.less(function))
    less = less.with_terms(rebuilt_term(chosen.terms[k], rows) for k in kept)
    for k in reversed(free_paths(less)):
        other = regression_without(less, [k], settled=True)
        if total_penalty(other) < total_penalty(less):
            less = other
            del kept[k]
    return less, kept


def named_causes(
    chosen: Regression,
    spots: list[Ambiguity],
    gain: bool,
    sigma: float | None,
) -> NamedCauses:
    """Names of causes that were chosen, by their forms.

    Where a form is worse than a free function, the causes are chosen once more, factor by factor:
    those names count if each of them holds and less is left without one.

    Parameters
    ----------
    chosen : Regression
    spots : list of Ambiguity
    gain : bool
        Measure what findings gain.
    sigma : float or None
        Noise that the simulation states, arcsec.
    """
    found = _named(chosen, spots, gain, sigma)
    decided = [spot for spot in found.spots if is_decided_by_factors(spot, found.factors)]
    # The factors were found under a noise of their own: what is noise may stand for their forms.
    noise = [k for k, t in enumerate(chosen.terms) if EFFECTS[t.cause].describes_noise(t)]
    taken = noise if any(not factor.named_by for factor in found.factors) else []
    if not (found.lost or decided or taken) or current_deadline().over:
        return found
    alike = {cause for spot in decided for cause in spot.causes}
    doubted = [k for k, term in enumerate(chosen.terms) if term.cause in alike]
    again = chosen_by_factor(chosen, [*found.lost, *doubted], taken, found.factors)
    if again is None:
        return found
    open_spots = [spot for spot in spots if not any({*spot.causes} <= {*t.causes} for t in decided)]
    other = _named(again, open_spots, gain, sigma)
    return other if not other.lost and other.unnamed < found.unnamed else found


def is_decided_by_factors(spot: Ambiguity, factors: Sequence[Factor]) -> bool:
    """Whether only one of the causes that a design does not separate is a form of a factor.

    A zero of each run and a drift with the temperature may have the same columns in a few runs;
    of more, the evidence decides for the one that needs fewer of them. A factor that is not
    distinguished from another decides nothing.
    """
    unnamed = [f for f in factors if not (f.named_by or f.not_distinguished_from)]
    forms = {cause for factor in unnamed for cause in _forms_of(spot, factor)}
    return spot.supported and len(forms) == 1


def _is_either(spot: Ambiguity, factor: Factor) -> bool:
    """Every cause that runs do not distinguish may be what a factor is, and more than it.

    Functions of the factor alone predict the same for other runs, whichever it is.
    """
    alone = not factor.not_distinguished_from and all(
        EFFECTS[cause].form_of == (factor.factor,) for cause in spot.causes
    )
    return not alone and len(_forms_of(spot, factor)) == len(spot.causes)


def _forms_of(spot: Ambiguity, factor: Factor) -> list[str]:
    """Causes that are forms of a factor, or of one that these runs do not distinguish from it."""
    known = {factor.factor, *factor.not_distinguished_from}
    return [cause for cause in spot.causes if known & {*EFFECTS[cause].form_of}]


def chosen_by_factor(
    regression: Regression,
    lost: Sequence[int],
    noise: Sequence[int],
    factors: Sequence[Factor],
) -> Regression | None:
    """The causes without some terms, and for each factor without a name those that are forms of it.

    The strongest factor comes first: each factor that one form took is named.
    Terms of the noise come after the forms of the place: over a part of a turn a walk in time may
    stand for a ramp and two orders.
    """
    rest = regression_without(regression, [*lost, *noise], settled=True)
    found = rest
    in_time = {"run", "run_time"}
    asked = [factor.factor for factor in factors if not factor.named_by]
    forms = [
        [kind for kind, effect in EFFECTS.items() if factor in effect.form_of[:1]]
        for factor in sorted(asked, key=lambda factor: factor in in_time)
    ]
    # Before steps and zeros of the runs, which imitate noise that drifts.
    forms.insert(sum(f not in in_time for f in asked), [regression.terms[k].cause for k in noise])
    for causes in filter(None, forms):
        found = select_again(found, causes)
    return None if len(found.terms) <= len(rest.terms) else found


def _less_left(factors: Sequence[Factor], error: Array) -> list[Factor]:
    """Without curves that only cancel one another or the zeros of these runs, largest first."""
    kept = list(factors)
    while curves := [f for f in kept if f.effects and not f.named_by]:
        fitted = [f.fitted for f in curves if f.fitted is not None]
        if np.var(error - np.sum(fitted, axis=0)) < np.var(error):
            break
        most = max(curves, key=lambda factor: factor.rms)
        kept = [factor for factor in kept if factor is not most]
    return kept


def _named(
    chosen: Regression, spots: list[Ambiguity], gain: bool, sigma: float | None
) -> NamedCauses:
    at = current_deadline()
    rest = unexplained_remainder(chosen, sigma)
    with at.part(FOR_FINDINGS):
        findings, spots, doubtful = findings_of(chosen, spots, gain, rest)
    if doubtful and not rest.found and not at.cut:
        # What is not confirmed explains nothing; the others may well without it.
        others = regression_without(chosen, doubtful, settled=True)
        rest = unexplained_remainder(others, sigma)
        if rest.found:
            findings = reconsidered_findings(chosen, findings, rest)
    held, factors, moved, beyond = stated_factors(chosen, findings)
    # Causes that are not distinguished, or were not tried, predict different errors in other
    # runs: no curve represents them.
    seen = [spot for spot in spots if spot.supported]
    kept = [f for f in factors if not (at.cut or any(_is_either(spot, f) for spot in seen))]
    kept = _less_left(kept, chosen.readings.residual[account_rows(chosen)])
    factors = [f if any(f is other for other in kept) else replace(f, effects=()) for f in factors]
    both = zip(findings, held, strict=True)
    lost = [k for one, other in both if one.confirmed and not other.confirmed for k in one.group]
    # A function that may be another factor's is no ground for narrower errors, and over an arc
    # sizes are of a mixture over all low orders (`with_unseen_orders`).
    is_open = any(f.not_distinguished_from for f in factors if not f.named_by)
    if beyond is not None and not (is_open or arc_note(chosen)):
        function, columns, covariance = beyond
        sure = {k for finding in held if finding.confirmed for k in finding.group}
        effects = [(k, term, EFFECTS[term.cause]) for k, term in enumerate(chosen.terms)]
        also = {k for k, t, e in effects if not e.form_of or e.describes_noise(t)}
        less, places = beyond_factors(chosen, function, sorted(sure | also))
        held = remeasured_findings(less, places, held, columns, covariance)
    return NamedCauses(chosen, rest, held, spots, factors, lost, moved)
