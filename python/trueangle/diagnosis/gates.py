"""Gates that a finding passes before it is confirmed, from its computed values.

A law that does not carry over to other levels is not, nor a size near zero, nor a ratio that is one
of several, nor two causes that are one column.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from ..effects import EFFECTS
from ..effects.ambiguity import Ambiguity
from ..effects.wrong_gear_ratio import WrongGearRatio
from ..estimation.regression import Regression
from .confirmation import NOT_CONFIRMED
from .finding import Finding
from .overlap import finding_overlaps

#: Share of what can be subtracted at a held-out level above which more is removed than left.
MORE_THAN_LEFT = 0.5

#: Correlation of what two causes add to all others from which on they are one column.
ALIKE = 0.95

#: Confirmed causes of one joint, lines counted once, beyond which they are implausible together.
MANY = 3

#: What causes that follow a factor have in common.
FOLLOWED = {
    "direction": "the direction of travel",
    "velocity": "the speed",
    "temperature": "the temperature",
    "torque": "the torque",
    "mount": "the reference's mount",
    "time": "the time",
    "run": "the run",
}


def not_carried(finding: Finding) -> str:
    """A law that does not carry over to a level of its factor that was held out.

    Nothing is gained there for certain, or more is left than taken: another law.
    """
    by_level = None if finding.gain is None else finding.gain.by_level
    if by_level is None or by_level.interval is None or by_level.factor == "mount":
        return ""
    low, high = by_level.interval
    if low > 0.0 and (by_level.reducible_share or 0.0) > MORE_THAN_LEFT:
        return ""
    noun = {"velocity": "speed", "torque": "load"}.get(by_level.factor, by_level.factor)
    return (
        f"its fitted form does not carry over to a {noun} that was held out "
        f"(share {by_level.reducible_share:.2f}, {low:.2f} to {high:.2f})"
    )


def not_told_from_zero(finding: Finding) -> str:
    """A size within two standard errors of zero."""
    name = EFFECTS[finding.cause].size_name
    if name not in finding.parameters:
        name = next(iter(finding.parameters), "")
    size = finding.parameters.get(name)
    if size is None or size.std is None or isinstance(size.value, str):
        return ""
    values, stds = (np.abs(np.atleast_1d(np.asarray(x, float))) for x in (size.value, size.std))
    if not values.size or values.size != stds.size or not (stds > 0.0).all():
        return ""
    z = float((values / stds).max())
    return f"its {name} is {z:.1f} standard errors from zero" if z < 2.0 else ""


def not_the_only_ratio(finding: Finding) -> str:
    """A ratio that is one of several with the same lines at these positions.

    The nearest to the assumed one is the likeliest, but the readings do not show it, and
    between the positions each has other lines.
    """
    aliases = finding.parameters.get("aliases")
    if finding.cause != WrongGearRatio.kind or aliases is None:
        return ""
    values = np.atleast_1d(np.asarray(aliases.value, dtype=np.float64))
    told = ", ".join(f"{value:.6g}" for value in values)
    return (
        f"at these positions {told} would give the same readings; this one is only the nearest "
        "to the assumed value"
    )


def gated_findings(
    regression: Regression, findings: Sequence[Finding]
) -> tuple[list[Finding], list[Ambiguity], set[int]]:
    """Findings as the gates leave them, the pairs that are not separated, and their terms."""
    found = []
    for finding in findings:
        gates = (not_carried, not_told_from_zero, not_the_only_ratio) if finding.confirmed else ()
        reason = next((said for gate in gates if (said := gate(finding))), "")
        found.append(replace(finding, status=NOT_CONFIRMED, reason=reason) if reason else finding)
    spots: list[Ambiguity] = []
    shared: set[int] = set()
    for i, j, correlation in alike_columns(regression, found):
        shared.update(found[i].group, found[j].group)
        causes = (found[i].cause, found[j].cause)
        because = f"in these runs they are one column (correlation {correlation:.3f})"
        spots.append(Ambiguity(causes, because, EFFECTS[causes[0]].measure, supported=True))
        for k, other in ((i, causes[1]), (j, causes[0])):
            reason = f"{because.removeprefix('in these runs they are ')} with {other}"
            found[k] = replace(found[k], status=NOT_CONFIRMED, reason=f"it is {reason}")
    return found, spots, shared


def alike_columns(
    regression: Regression, findings: Sequence[Finding]
) -> Iterator[tuple[int, int, float]]:
    """Pairs of confirmed findings that add nearly one column to all else; their correlation.

    Of what each explains, given the terms of all others (`trueangle.diagnosis.overlap`).
    """
    confirmed = [k for k, finding in enumerate(findings) if finding.confirmed]
    for i, j, found in finding_overlaps(regression, [findings[k].group for k in confirmed]):
        if found > ALIKE:
            yield confirmed[i], confirmed[j], found


def many_causes(findings: Sequence[Finding]) -> str:
    """What to think of more confirmed causes than one joint is likely to have; or nothing."""
    causes = list(dict.fromkeys(f.cause for f in findings if f.confirmed))
    if len(causes) <= MANY:
        return ""
    factors = [EFFECTS[cause].factor for cause in causes]
    common = max(FOLLOWED, key=factors.count)
    shared = [c for c, factor in zip(causes, factors, strict=True) if factor == common]
    text = f"{len(causes)} causes at once are unlikely; one unknown cause may explain several"
    if len(shared) > 1:
        text += f"; {', '.join(shared)} all follow {FOLLOWED[common]}"
    return text
