"""What the readings cannot tell, as text: in full where it matters to this account."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from ..effects.ambiguity import Ambiguity
from ..effects.missing_order import MissingOrder
from .diagnosisdata import DiagnosisData

#: What adds an entry to a text: how far its further lines are set in, and the first one.
Entry = tuple[str, int, int]


def ambiguity_matters(spot: Ambiguity, diagnosis: DiagnosisData) -> bool:
    """Something is seen, or one of the causes is believed or found beside it."""
    asked = {effect.kind for effect in diagnosis.extended.effects}
    asked |= {belief.what for belief in diagnosis.beliefs}
    asked |= {finding.cause for finding in diagnosis.findings}
    # A line beside it is no reason to speak of all that may make one.
    return spot.supported or bool(set(spot.causes) & (asked - {MissingOrder.kind}))


def ambiguity_entries(
    diagnosis: DiagnosisData, verbose: bool, sizes: Callable[[Ambiguity], Iterator[str]]
) -> Iterator[Entry]:
    """Entries on what cannot be told, what is seen first.

    What was not asked, and is not seen either, is named in one line, but where ``verbose``.
    ``sizes`` gives what each cause of a blind spot would amount to.
    """
    plan = diagnosis.next_runs
    planned = {entry.causes for entry in (plan.between if plan and plan.runs else ()) if entry.told}
    spots = sorted(diagnosis.not_identifiable, key=lambda spot: not spot.supported)
    shown = [spot for spot in spots if verbose or ambiguity_matters(spot, diagnosis)]
    if shown:
        yield "What these readings cannot tell:", 0, 0
    for spot in shown:
        how = "" if spot.causes in planned and not verbose else f" To find out: {spot.measure}."
        yield f"- {_head(spot)}: {spot.because}.{how}", 2, 0
        for text in sizes(spot):
            yield text, 6, 4
    named = {finding.cause for finding in diagnosis.findings}
    others = (cause for spot in spots if spot not in shown for cause in spot.causes)
    rest = [cause for cause in others if cause not in named]
    if rest:
        names = ", ".join(dict.fromkeys(rest))
        again = " either" if shown else ""
        yield (
            f"Not seen, and could not be in such runs{again}: {names} (why: `verbose=True`).",
            2,
            0,
        )


def _head(spot: Ambiguity) -> str:
    names = ", ".join(spot.causes)
    if not spot.supported:
        return names
    if spot.common:
        others = ", ".join(cause for cause in spot.causes if cause != spot.common)
        return f"whether {spot.common} is due to {others}"
    return f"{names} ({'one of them' if len(spot.causes) > 1 else 'something'} is seen)"
