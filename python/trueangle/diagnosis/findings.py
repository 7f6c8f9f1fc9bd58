"""Findings of the terms that were chosen: parameters, gain, rivals, status."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..effects import EFFECTS, Effect
from ..effects.ambiguity import Ambiguity
from ..effects.effect import ScatterFinding, telling_apart
from ..effects.missing_order import MissingOrder
from ..effects.scale_error import ScaleError
from ..estimation.quantity import Parameters, Quantity, quantity
from ..estimation.regression import Regression
from ..runs.checks.fault import DataFault
from ..support.deadline import current_deadline
from .candidates import Candidate, candidate_extensions, propose_candidates
from .confirmation import CONFIRMED, NOT_CONFIRMED, confirmation_status
from .finding import Finding
from .formerrors import with_form_errors
from .gain import Gain, measure_gain
from .gates import gated_findings
from .goodness import Unexplained
from .identifiability import ambiguity_of_cause, open_origins, with_open_origins
from .penalty import NEW_CAUSE, finding_groups, regression_without
from .selection import is_flexible
from .unnamed import is_named

#: Rivals reported for each finding.
RIVALS = 3

#: Findings, in the order found, for which rivals are tried.
RIVALLED = 4

#: Share of the evidence of a finding by which what another one leaves may differ, and be the same.
SAME = 3e-4

#: Columns whose causes are no ramp in angle, where they make one in these runs.
RECORDED = {"torque", "temperature", "current", "coupled"}

#: Why a finding of an account that was ended early is not confirmed.
NOT_HELD_OUT = "the account was ended before its gain on the readings held out was measured"


def findings_of(
    regression: Regression, spots: list[Ambiguity], with_gain: bool, unexplained: Unexplained
) -> tuple[list[Finding], list[Ambiguity], list[int]]:
    """Findings of the chosen terms; those in doubt become entries of what is not told.

    Also given are the indices of the terms of findings that are not confirmed, but for those
    that are one column with another finding: together the two explain what they do.
    """
    spots = list(spots)
    groups = finding_groups(regression.terms)
    named = []
    origins: dict[int, list[Ambiguity]] = {}
    for group in groups:
        if not is_named(regression.terms[group[0]]):
            continue
        doubt = ambiguity_of_cause(regression.terms[group[0]], regression, spots)
        evidence = sum(regression.terms[k].bic_gain for k in group)
        if doubt is None:
            named.append(group)
            # What sets it apart from the common form was seen after all.
            cause = regression.terms[group[0]].cause
            spots = [spot for spot in spots if not (spot.common and spot.hides(cause))]
            origins[group[0]] = [
                replace(_in_doubt(spot, regression, group), estimates={})
                for spot in open_origins(regression.terms[group[0]], regression, spots)
            ]
            spots = with_open_origins(spots, origins[group[0]], evidence)
            continue
        spots = [spot for spot in spots if spot != doubt]
        spots.append(replace(_in_doubt(doubt, regression, group), evidence=evidence))
    gains: Sequence[Gain | None] = [None] * len(named)
    if with_gain and named:
        gains = measure_gain(regression, named) or gains
    fitted = regression.fitted()
    widened = with_form_errors(regression)
    findings: list[Finding] = []
    for group, gain in zip(named, gains, strict=True):
        terms = [(*fitted[k], widened.robust_covariance(k)) for k in group]
        cause = terms[0][0].cause
        parameters, effects = EFFECTS[cause].report(widened, terms)
        if origins[group[0]]:
            parameters["explanations"] = _explanations(parameters, cause, origins[group[0]])
        rivals = (
            _rivals(regression, group)
            if len(findings) < RIVALLED and not current_deadline().over
            else []
        )
        if equal := _equals(cause, rivals, spots):
            evidence = sum(regression.terms[k].bic_gain for k in group)
            spots.append(replace(_in_doubt(equal, regression, group), evidence=evidence))
            continue
        weight = {
            "bic_gain": float(sum(t.bic_gain for t, _, _ in terms)),
            "deviance": float(sum(t.deviance for t, _, _ in terms)),
            "parameters": float(sum(t.parameters for t, _, _ in terms)),
            "log_grid": float(sum(t.log_grid for t, _, _ in terms)),
        }
        status, reason = confirmation_status(cause, gain, regression, group, unexplained)
        if with_gain and gain is None and status == CONFIRMED:
            status, reason = NOT_CONFIRMED, NOT_HELD_OUT
        findings.append(
            Finding(
                cause,
                parameters,
                weight,
                gain,
                rivals,
                effects,
                status,
                reason,
                tuple(group),
            )
        )
    findings, alike, shared = gated_findings(regression, findings)
    doubtful = [k for f in findings if not f.confirmed for k in f.group if k not in shared]
    return findings, spots + alike, doubtful


def reconsidered_findings(
    regression: Regression, findings: Sequence[Finding], unexplained: Unexplained
) -> list[Finding]:
    """Findings once it is known that something is unexplained."""
    found = []
    for finding in findings:
        if finding.confirmed and finding.group:
            status, reason = confirmation_status(
                finding.cause, finding.gain, regression, finding.group, unexplained
            )
            finding = replace(finding, status=status, reason=reason)
        found.append(finding)
    return found


def _explanations(parameters: Parameters, cause: str, origins: Sequence[Ambiguity]) -> Quantity:
    """What is known to make such an error, and the causes that these runs do not rule out."""
    known = parameters["explanations"].value if "explanations" in parameters else []
    others = [
        f"{other}: {EFFECTS[other].sentence} Not ruled out, as {spot.because}"
        for spot in origins
        for other in spot.causes
        if other != cause
    ]
    return quantity([*(known if isinstance(known, list) else []), *others])


def _alternatives(
    regression: Regression, group: Sequence[int], causes: Sequence[str]
) -> dict[str, tuple[Parameters, tuple[Effect, ...]]]:
    """Every cause that may be the one, alone in place of a finding: parameters and effects."""
    rest = regression_without(regression, group, settled=True)
    found = {}
    for cause in causes if not current_deadline().over else ():
        effect = EFFECTS[cause]
        extension = propose_candidates(effect, rest)
        if extension is None or extension.bic_gain <= 0.0:
            continue
        fitted = rest.with_terms([*rest.terms, extension])
        k = len(fitted.terms) - 1
        parameters, effects = effect.report(fitted, [(*fitted.fitted()[k], fitted.covariance(k))])
        found[cause] = parameters, tuple(effects)
    return found


def _in_doubt(doubt: Ambiguity, regression: Regression, group: Sequence[int]) -> Ambiguity:
    """A doubt of what is seen, with what each of its causes would amount to."""
    found = _alternatives(regression, group, doubt.causes)
    # Not lines: one that another hides behind is no property of the joint.
    told = (c for c in found if EFFECTS[c].acts_on_runs or is_flexible(EFFECTS[c]))
    return replace(
        doubt,
        supported=True,
        estimates={cause: found[cause][0] for cause in told},
        hypotheses={cause: effects for cause, (_, effects) in found.items()},
    )


def _rivals(regression: Regression, group: Sequence[int]) -> list[tuple[str, float]]:
    """The best other causes in place of a finding, and how much less they explain."""
    cause = regression.terms[group[0]].cause
    rest = regression_without(regression, group)
    own = rest.bic - regression.bic
    others = [name for name in EFFECTS if name != cause]

    def best_of(candidates: Sequence[Candidate]) -> list[Candidate]:
        found: dict[str, Candidate] = {}
        for candidate in sorted(candidates, key=lambda candidate: -candidate[2]):
            if candidate[0].deviance > 0.0:
                found.setdefault(candidate[0].cause, candidate)
        return [*found.values()][:RIVALS]

    def least(candidates: Sequence[Candidate]) -> float:
        best = best_of(candidates)
        return best[-1][2] if len(best) == RIVALS else 0.0

    tried = candidate_extensions(rest, others, least)
    # A special case that is not named itself is no simpler form either.
    hidden = (EFFECTS[name].imitate(rest) for name in others if not _is_form(cause, name))
    tried += [(found, rest, found.bic_gain) for found in hidden if found is not None]
    best = best_of(tried)
    gaps = [(candidate[0].cause, _gap(regression, own, candidate)) for candidate in best]
    return sorted(gaps, key=lambda item: item[1])


def _gap(regression: Regression, own: float, candidate: Candidate) -> float:
    """How much less a candidate explains once all else is fitted beside it, as beside a finding.

    Without either cause readings are clipped, and the noise is larger, than with one: what a
    candidate gains there is less than the finding that is one column with it has gained. One that
    leaves the same with as many parameters is that column: how far each was searched for is no
    reason to name one.
    """
    extension, start, gain = candidate
    if current_deadline().over:
        return own - gain
    settled = start.with_terms([*start.terms, extension])
    gap = own - (gain - extension.bic_gain + start.bic - settled.bic)
    apart = abs(settled.deviance - regression.deviance)
    freedom = [sum(term.parameters for term in each.terms) for each in (settled, regression)]
    is_same = apart < SAME * abs(own) and freedom[0] == freedom[1]
    return min(gap, 0.0) if is_same else gap


def _equals(
    cause: str, rivals: Sequence[tuple[str, float]], spots: Sequence[Ambiguity]
) -> Ambiguity | None:
    """That other causes explain as much as one, where they do; none strongly less.

    What contains it or is contained in it is the same cause in another form, and explains for it
    where noise that follows a misfit makes the simpler form the better one; what takes up
    anything is no cause; a line is what is seen, whatever makes it, and so is a ramp among those
    that share its form for the design alone (``spots``). What follows a load or a temperature
    that was recorded is not seen to follow the angle: in motion under others it is no ramp. A step
    so near an end of its run that the run's own zero explains as much is no step.
    """
    effect = EFFECTS[cause]
    if cause == MissingOrder.kind:
        return None
    shared = {other for spot in spots if spot.common == cause for other in spot.causes}
    if cause == ScaleError.kind:
        shared |= {other for other, _ in rivals if not RECORDED & {*EFFECTS[other].needs}}
    if is_flexible(effect):
        steps = effect.draws_zeros
        equal = [
            other
            for other, gap in rivals
            if steps and gap < NEW_CAUSE and effect in EFFECTS[other].confused_with
        ]
        return _alike(effect, equal) if equal else None
    forms = {other for other, _ in rivals if _is_form(cause, other)}
    own = min([0.0, *(gap for other, gap in rivals if other in forms)])
    equal = [
        other
        for other, gap in rivals
        if gap - own < NEW_CAUSE and other not in forms | shared and not is_flexible(EFFECTS[other])
    ]
    return _alike(effect, equal) if equal else None


def _alike(effect: type[Effect], equal: Sequence[str]) -> Ambiguity:
    """That these explain as much as this."""
    return Ambiguity(
        (effect.kind, *equal),
        "they explain what these readings show alike",
        telling_apart(effect, EFFECTS[equal[0]]) or effect.measure,
        supported=True,
        factor=effect.factor,
    )


def _is_form(cause: str, other: str) -> bool:
    """One of two causes contains the other one."""
    one, two = EFFECTS[cause], EFFECTS[other]
    return one in two.contains or two in one.contains


def scatter_finding(item: ScatterFinding, unexplained: Unexplained) -> Finding:
    """Finding of a cause of the scatter."""
    evidence = {"bic_gain": item.bic_gain}
    status, reason = confirmation_status(item.cause, None, None, (), unexplained)
    if item.doubt:
        status, reason = NOT_CONFIRMED, item.doubt
    rivals = [*item.rivals]
    return Finding(
        item.cause, item.parameters, evidence, None, rivals, item.effects, status, reason
    )


def equal_scatter(item: ScatterFinding) -> Ambiguity | None:
    """That other causes of the scatter explain as much as one, where they do."""
    equal = [(other, gap) for other, gap in item.rivals if gap < NEW_CAUSE]
    if not equal:
        return None
    less = ", ".join(f"{other} {gap:.1f} less" for other, gap in equal)
    return replace(
        _alike(EFFECTS[item.cause], [other for other, _ in equal]),
        because=f"they explain the scatter of these readings alike (BIC: {less} than {item.cause})",
        evidence=item.bic_gain,
        estimates={item.cause: item.parameters, **item.alternatives},
    )


def scatter_doubt(item: ScatterFinding, fault: DataFault | None = None) -> Ambiguity:
    """Scatter about a mean that is itself in doubt, or of readings that a fault has spoilt."""
    because, measure = (
        "the error that the readings show has no certain cause yet, so what scatters about it "
        "has none either",
        "the measurements named above, then diagnose again",
    )
    if fault is not None:
        because = f"{fault.fault}: the readings that it names scatter whatever the sensor does"
        measure = f"{fault.mend}; then diagnose again"
    return Ambiguity((item.cause,), because, measure, True, item.bic_gain)
