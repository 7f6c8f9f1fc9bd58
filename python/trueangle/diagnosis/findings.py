"""Findings of the terms that were chosen: parameters, gain, rivals, status."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from ..effects import EFFECTS
from ..effects.ambiguity import Ambiguity
from ..effects.effect import Effect, ScatterFinding
from ..estimation.quantity import Parameters, Quantity, quantity
from ..estimation.regression import Regression
from ..runs.checks.fault import DataFault
from ..support.arrays import Array
from ..support.deadline import current_deadline
from .confirmation import CONFIRMED, NOT_CONFIRMED, confirmation_status
from .correctable import measure_more
from .finding import Finding
from .formerrors import with_form_errors
from .gain import Gain, measure_gain
from .gates import gated_findings
from .goodness import Unexplained
from .identifiability import ambiguity_of_cause, open_origins, with_open_origins
from .penalty import NEW_CAUSE, finding_groups
from .rivals import alike_causes, ambiguity_in_doubt, dependence, equal_causes, rivals_of
from .unseenorders import with_unseen_orders

#: Findings, in the order found, for which rivals are tried.
RIVALLED = 4

#: Why a finding of an account that was ended early is not confirmed.
NOT_HELD_OUT = "the diagnosis ended before its gain on held-out readings was measured"


def findings_of(
    regression: Regression, spots: list[Ambiguity], with_gain: bool, unexplained: Unexplained
) -> tuple[list[Finding], list[Ambiguity], list[int]]:
    """Findings of the chosen terms; uncertain ones become entries of ``not_identifiable``.

    Also given are the indices of the terms of findings that are not confirmed, but for those
    that are one column with another finding: together the two explain what they do.
    """
    spots = list(spots)
    groups = finding_groups(regression.terms)
    named = []
    origins: dict[int, list[Ambiguity]] = {}
    for group in groups:
        doubt = ambiguity_of_cause(regression.terms[group[0]], regression, spots)
        evidence = sum(regression.terms[k].bic_gain for k in group)
        if doubt is None:
            named.append(group)
            # What distinguishes it from the common form was detected after all.
            cause = regression.terms[group[0]].cause
            spots = [spot for spot in spots if not (spot.common and spot.hides(cause))]
            origins[group[0]] = [
                replace(ambiguity_in_doubt(spot, regression, group), estimates={})
                for spot in open_origins(regression.terms[group[0]], regression, spots)
            ]
            spots = with_open_origins(spots, origins[group[0]], evidence)
            continue
        spots = [spot for spot in spots if spot != doubt]
        spots.append(replace(ambiguity_in_doubt(doubt, regression, group), evidence=evidence))
    gains: Sequence[Gain | None] = [None] * len(named)
    if with_gain and named:
        gains = measure_gain(regression, named) or gains
    widened = with_unseen_orders(with_form_errors(regression))
    findings: list[Finding] = []
    exchanged: list[tuple[list[int], Ambiguity]] = []
    for group, gain in zip(named, gains, strict=True):
        terms = [regression.terms[k] for k in group]
        cause = terms[0].cause
        parameters, effects = _reported(regression, widened, group, origins[group[0]])
        rivals = (
            rivals_of(regression, group)
            if len(findings) < RIVALLED and not current_deadline().over
            else []
        )
        if equal := equal_causes(cause, rivals, spots):
            evidence = sum(regression.terms[k].bic_gain for k in group)
            spots.append(replace(ambiguity_in_doubt(equal, regression, group), evidence=evidence))
            exchanged.append((group, equal))
            continue
        weight = {
            "bic_gain": float(sum(t.bic_gain for t in terms)),
            "deviance": float(sum(t.deviance for t in terms)),
            "parameters": float(sum(t.parameters for t in terms)),
            "log_grid": float(sum(t.log_grid for t in terms)),
        }
        status, reason = confirmation_status(cause, gain, regression, group, unexplained)
        if with_gain and gain is None and status == CONFIRMED:
            status, reason = NOT_CONFIRMED, NOT_HELD_OUT
        findings.append(
            Finding(cause, parameters, weight, gain, rivals, effects, status, reason, tuple(group))
        )
    beside = [_beside_doubts(regression, finding, exchanged) for finding in findings]
    changed = zip(findings, beside, strict=True)
    # Together with what is in doubt they explain what they do.
    dependent = {k for before, after in changed if after is not before for k in after.group}
    findings, alike, shared = gated_findings(regression, beside)
    shared |= dependent
    doubtful = [k for f in findings if not f.confirmed for k in f.group if k not in shared]
    return findings, spots + alike, doubtful


def remeasured_findings(
    less: Regression,
    kept: Sequence[int],
    findings: Sequence[Finding],
    columns: Array,
    covariance: Array,
) -> list[Finding]:
    """Confirmed findings with the parameters of readings less free functions of factors.

    Parameters
    ----------
    less : Regression
        With some of the terms that the findings are of.
    kept : sequence of int
        Which of them.
    findings : sequence of Finding
    columns, covariance : ndarray
        Of the free functions.
    """
    less = with_form_errors(less)
    shift = less.back @ (less.q.T @ less.whiten(columns))
    before = 0.0 if less.form_errors is None else less.form_errors
    less = replace(less, form_errors=before + shift @ covariance @ shift.T)
    found = list(findings)
    for k, finding in enumerate(findings):
        if finding.confirmed and finding.group and {*finding.group} <= {*kept}:
            group = [kept.index(term) for term in finding.group]
            parameters, effects = _reported(less, less, group, [])
            sizes = {name: size for name, size in parameters.items() if size.std is not None}
            found[k] = replace(finding, parameters=finding.parameters | sizes, effects=effects)
    return found


def _reported(
    regression: Regression, errors: Regression, group: Sequence[int], doubts: list[Ambiguity]
) -> tuple[Parameters, list[Effect]]:
    """Parameters and effects of a finding, with the errors of a regression."""
    fitted = regression.fitted()
    terms = [(*fitted[k], errors.robust_covariance(k)) for k in group]
    cause = terms[0][0].cause
    parameters, effects = EFFECTS[cause].report(errors, terms)
    parameters |= EFFECTS[cause].form_limits(regression, terms)
    if doubts:
        parameters["explanations"] = _explanations(parameters, cause, doubts)
    return parameters, effects


def _beside_doubts(
    regression: Regression, finding: Finding, exchanged: Sequence[tuple[Sequence[int], Ambiguity]]
) -> Finding:
    """A finding once it is known which others may be something else."""
    for group, doubt in exchanged if finding.confirmed else ():
        if reason := dependence(regression, group, doubt, finding.group):
            return replace(finding, status=NOT_CONFIRMED, reason=reason)
    return finding


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
        alike_causes(EFFECTS[item.cause], [other for other, _ in equal]),
        because=f"they explain the scatter of these readings equally well (BIC: {less} than "
        f"{item.cause})",
        evidence=item.bic_gain,
        estimates={item.cause: item.parameters, **item.alternatives},
    )


def scatter_doubt(item: ScatterFinding, fault: DataFault | None = None) -> Ambiguity:
    """Ambiguity of scatter about an uncertain mean, or of readings that a fault made unusable."""
    because = "the error itself has no certain cause yet, so its scatter has none either"
    if fault is not None:
        because = f"{fault.fault}: the faulty readings cause the scatter"
    measure = measure_more() if fault is None else f"{fault.mend}; then diagnose again"
    return Ambiguity((item.cause,), because, measure, True, item.bic_gain)
