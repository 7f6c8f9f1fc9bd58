"""Which causes this design of runs can separate, and which origins stay open, before any name."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from ..effects import EFFECTS
from ..effects.ambiguity import Ambiguity
from ..effects.blindspots import blind_spot_place
from ..estimation.regression import Extension, Regression
from .candidates import propose_candidates
from .penalty import finding_groups, regression_without

#: Factors in the order in which they cast doubt on what another cause explains.
DOUBTS = ("grid", "mount", "torque", "velocity")


def ambiguity_of_cause(
    extension: Extension, regression: Regression, spots: Sequence[Ambiguity]
) -> Ambiguity | None:
    """The reason not to name a supported cause, or None.

    Where all that it may be have one form, and it is that, only its origin is open
    (`open_origins`): what is detected has a size, and is named.
    """
    cause, effect = extension.cause, EFFECTS[extension.cause]
    for spot in spots:
        if effect.is_doubted and spot.hides(cause) and not effect.told(extension, regression):
            return spot
    found = [doubt for doubt in _doubts(extension, regression, spots) if doubt.common != cause]
    return min(found, key=lambda spot: blind_spot_place(DOUBTS, spot), default=None)


def open_origins(
    extension: Extension, regression: Regression, spots: Sequence[Ambiguity]
) -> list[Ambiguity]:
    """What else may make an error of this form, in the order of `DOUBTS`."""
    cause = extension.cause
    shared = (spot for spot in spots if spot.common == cause and cause in spot.causes)
    # What is supported already is reported with another finding.
    found = [spot for spot in shared if not spot.supported]
    for doubt in _doubts(extension, regression, spots):
        if doubt.common == cause and doubt not in found:
            found.append(doubt)
    return sorted(found, key=lambda spot: blind_spot_place(DOUBTS, spot))


def with_open_origins(
    spots: Sequence[Ambiguity], origins: Sequence[Ambiguity], evidence: float
) -> list[Ambiguity]:
    """Blind spots, and those that leave only the origin of a cause open."""

    def is_told(spot: Ambiguity) -> bool:
        return any(set(spot.causes) <= set(of.causes) for of in origins)

    kept = [spot for spot in spots if not is_told(spot)]
    return kept + [replace(spot, supported=True, evidence=evidence) for spot in origins]


def _doubts(
    extension: Extension, regression: Regression, spots: Sequence[Ambiguity]
) -> Iterator[Ambiguity]:
    doubts = (effect.doubt(extension, regression, spots) for effect in EFFECTS.values())
    yield from (doubt for doubt in doubts if doubt is not None)


def in_common_form(regression: Regression, spots: Sequence[Ambiguity]) -> Regression:
    """The regression with the common form in place of causes that are not separated.

    A reversal error may be play or a spring, a ramp the ratio's or a clock's: which of them is
    open, but not that it is there, nor its size for motion like this.
    """
    for cause in [regression.terms[g[0]].cause for g in finding_groups(regression.terms)]:
        group = [k for k, term in enumerate(regression.terms) if term.cause == cause]
        spot = ambiguity_of_cause(regression.terms[group[0]], regression, spots) if group else None
        if spot is None or not spot.common or spot.common == cause:
            continue
        rest = regression_without(regression, group, settled=True)
        common = propose_candidates(EFFECTS[spot.common], rest)
        if common is not None and common.bic_gain > 0.0:
            regression = rest.with_terms([*rest.terms, common])
    return regression
