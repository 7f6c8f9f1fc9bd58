"""The diagnosis as readable text."""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator
from typing import Any

from ..effects.ambiguity import Ambiguity
from ..effects.effect import title_of
from ..effects.missing_order import MissingOrder
from ..support.display_units import ErrorsIn, ErrorUnit, brief_number, error_unit, sine_of_rms
from ..support.layout import counted, laid_out
from ..support.layout import wrapped_lines as _wrapped
from .beliefs import Belief
from .diagnosisdata import DiagnosisData
from .finding import Finding, brief_finding, finding_lines, named_quantity, parameter_unit
from .goodness.evidence import Evidence
from .goodness.scatter import AGAINST_STATED

#: Share by which the noise must differ from what the simulation states to be reported first.
MATERIAL = 0.1

#: Causes not confirmed that are listed, strongest first.
LISTED = 3

#: What adds an entry to a text: how far its further lines are set in, and the first one.
Entry = tuple[str, int, int]


def diagnosis_summary(
    diagnosis: DiagnosisData, errors_in: ErrorsIn = "auto", verbose: bool = False
) -> str:
    """The account of a diagnosis: what is wrong, why, the evidence, the gain, what is open.

    ``verbose`` also reports in full the causes not in question that these readings cannot show.
    """
    unit = error_unit(errors_in, sine_of_rms(diagnosis.discrepancy.rms))
    lines = [
        *_headline(diagnosis, unit),
        *_wrapped(diagnosis.simulated.summary() if diagnosis.simulated else "", 0),
        *(line for entry in _sizes(diagnosis, unit) for line in _wrapped(*entry)),
    ]
    sure = sum(finding.confirmed for finding in diagnosis.findings)
    shown = diagnosis.findings if verbose else diagnosis.findings[: sure + LISTED]
    for k, finding in enumerate(shown):
        lines += ["", *finding_lines(f"{k + 1}. ", finding, unit, shown[:k])]
    if diagnosis.wrong:
        lines += ["", "Wrong in the simulation:"]
        for belief in diagnosis.wrong:
            lines += _wrapped(f"- {_belief(belief, unit)}", 2)
    if diagnosis.torque is not None:
        lines += ["", *(part for text in diagnosis.torque.lines() for part in _wrapped(text, 2))]
    open_still = [*_ambiguity_entries(diagnosis, verbose, unit)]
    if diagnosis.next_runs is not None and diagnosis.next_runs.runs:
        lines += ["", *diagnosis.next_runs.summary().splitlines()]
    lines += [""] if open_still else []
    lines += [part for entry in open_still for part in _wrapped(*entry)]
    return laid_out(lines)


def _if_it_is(spot: Ambiguity, unit: ErrorUnit) -> Iterator[str]:
    """What each of the causes in question would amount to."""
    for cause, parameters in spot.estimates.items():
        known = {name: q for name, q in parameters.items() if q.value is not None}
        shown = ", ".join(" ".join(named_quantity(name, q, unit)) for name, q in known.items())
        yield f"If {cause}: {shown}."


def _sizes(diagnosis: DiagnosisData, unit: ErrorUnit) -> Iterator[Entry]:
    """The error without and with what was found, and the noise of one reading."""
    d, g, n = diagnosis.discrepancy, diagnosis.gain, unit.number
    used = counted(diagnosis.readings, "reading")
    if diagnosis.readings_used < diagnosis.readings:
        used += f"; {diagnosis.readings_used} used, evenly spaced, without turning points"
    whole = f"rms {unit.text(d.rms)}, peak-to-peak {n(d.peak_to_peak)}, max abs {n(d.max_abs)}"
    yield f"Measured minus simulated: {whole} ({used}).", 2, 0
    if any(f.confirmed for f in diagnosis.findings) or diagnosis.extended.effects:
        left = f"rms {unit.text(g['rms_after_arcsec'])}, peak-to-peak "
        left += f"{n(g['peak_to_peak_after_arcsec'])}, max abs {n(g['max_abs_after_arcsec'])}"
        yield f"Measured minus the extended simulation: {left}.", 2, 0
    text = f"Noise of one reading: {unit.text(diagnosis.noise)}"
    if diagnosis.extended.sigma_arcsec:
        text += f" ({unit.number(diagnosis.extended.sigma_arcsec)} in the simulation)"
    if diagnosis.correlation:
        text += f", correlation between neighbours {diagnosis.correlation:.2f}"
    yield f"{text}.", 2, 0


def _headline(diagnosis: DiagnosisData, unit: ErrorUnit) -> list[str]:
    """What a reader must know first: what is found, how large it is, and what to do."""
    entries = [*_found(diagnosis, unit)]
    rest = diagnosis.unexplained
    noise = () if rest is None or entries else rest.noise_firing
    others = [item for item in noise if item.test != AGAINST_STATED]
    if others or any(abs(item.statistic - 1.0) > MATERIAL for item in noise):
        entries = [("No pattern beyond the simulation, but the noise differs.", 0, 0)]
        entries += _items(others, unit)
    elif not entries:
        entries.append(("Nothing beyond the simulation: no test is significant.", 0, 0))
    steps = "; ".join(diagnosis.next_steps)
    if diagnosis.is_enough and not steps:
        least = brief_number(diagnosis.detectable * unit.per_arcsec)
        steps = f"nothing to correct: an order above about {least} {unit.name} would be found"
    if steps:
        entries.append((f"What to do: {steps}.", 2, 0))
    return [*(line for entry in entries for line in _wrapped(*entry)), ""]


def _items(evidence: Iterable[Evidence], unit: ErrorUnit) -> Iterator[Entry]:
    for item in evidence:
        p = "below 1e-12" if item.p < 1e-12 else f"{item.p:.1g}"
        yield f"- {unit.spoken(item.says)} (p {p})", 4, 2


def _found(diagnosis: DiagnosisData, unit: ErrorUnit) -> Iterator[Entry]:
    """Faults of the data, what is not understood, what is found or wrong."""
    notes = [(f"{note}.", 2, 0) for note in diagnosis.notes]
    if notes and not diagnosis.complete:  # all that follows depends on it
        yield notes.pop(0)
    yield from ((f"Fault of the data, {fault}.", 2, 0) for fault in diagnosis.data_faults)
    if any(fault.unusable for fault in diagnosis.data_faults):
        return  # what such angles seem to follow is nothing
    rest, unknown = diagnosis.unexplained, list[Entry]()
    if rest is not None and rest.found:
        unknown = [(f"NOT UNDERSTOOD: {unit.text(rest.rms)} rms or more has no known cause.", 2, 0)]
        unknown += _items(rest.firing[:3], unit)
        before, after = (diagnosis.gain[f"rms_{when}_arcsec"] for when in ("before", "after"))
        if rest.rms**2 >= before**2 - after**2:  # what is larger than all that is found comes first
            yield from unknown
            unknown = []
    sure = "Confirmed" if diagnosis.complete else "Found so far"
    named = [brief_finding(f, unit) for f in diagnosis.findings if f.confirmed]
    if named:
        yield f"{sure}: {_by_cause(named)}.", 2, 0
    shared = [spot for spot in diagnosis.not_identifiable if spot.supported and spot.common]
    other = ((s.common, title_of(c)) for s in shared for c in s.causes if c != s.common)
    for common, each in _grouped(other).items():
        also = f"{title_of(common)} may also be {' or '.join(dict.fromkeys(each))}"
        yield f"{also.capitalize()}: these runs do not distinguish them.", 2, 0
    lacking = () if diagnosis.torque is None else diagnosis.torque.findings
    torque = "; ".join(f.summary() for f in lacking if f.confirmed)
    if torque:
        yield f"{sure} in the drive's torque: {torque}.", 2, 0
    nameless = [factor for factor in diagnosis.factors if not factor.named_by]
    followed = _grouped(((f.followed, f.status), f.size(unit)) for f in nameless)
    for (what, status), each in followed.items():
        yield f"The error follows {what}: {'; '.join(each)}. {status}.", 2, 0
    doubtful = [finding for finding in diagnosis.findings if not finding.confirmed]
    doubted = _grouped((unit.spoken(f.reason), brief_finding(f, unit)) for f in doubtful[:LISTED])
    for reason, each in doubted.items():
        yield f"Not confirmed: {_by_cause(each)}{f': {reason}' if reason else ''}.", 2, 0
    if len(doubtful) > LISTED:
        yield f"Not confirmed: {len(doubtful) - LISTED} more (`verbose=True`).", 2, 0
    wrong = "; ".join(f"{b.what} {b.verdict.replace('_', ' ')}" for b in diagnosis.wrong[:4])
    if wrong:
        yield f"Wrong in the simulation: {wrong}.", 2, 0
    spots = {_seen(spot, unit): spot for spot in reversed(diagnosis.in_question)}
    keys = ((len(s.causes) > 1, re.split(r"; |\. | \(", s.because)[0]) for s in spots.values())
    for (several, why), each in _grouped(zip(keys, spots, strict=True)).items():
        detected = "not distinguished" if several else "not confirmed"
        yield f"Detected, {detected}: {'; '.join(each)}: {why}.", 2, 0
    yield from unknown
    yield from notes


def _grouped(pairs: Iterable[tuple[Any, str]]) -> dict[Any, list[str]]:
    """Texts by their keys, in the order of the first of each."""
    groups: dict[Any, list[str]] = {}
    for key, text in pairs:
        groups.setdefault(key, []).append(text)
    return groups


def _by_cause(named: Iterable[str]) -> str:
    """Findings in brief, those of one kind together: what they are once, then each size."""
    parts = (re.split(r" (?=[-\d(])", text, maxsplit=1) for text in named)
    sizes = _grouped((what, ", ".join(size)) for what, *size in parts)
    return "; ".join(f"{what} {', '.join(each)}".strip() for what, each in sizes.items())


def _seen(spot: Ambiguity, unit: ErrorUnit) -> str:
    """Causes in question, each with the size that it would have."""
    each = (Finding(cause, spot.estimates.get(cause, {}), {}, None, []) for cause in spot.causes)
    return " or ".join(brief_finding(finding, unit) for finding in each)


def _belief(belief: Belief, unit: ErrorUnit) -> str:
    text = f"{belief.what}: {belief.verdict.replace('_', ' ')}"
    for name, value in belief.believed.items():
        shown, of = parameter_unit(name, unit)
        what, _, its_unit = shown.partition("_")
        size = " +- ".join(of.pair(belief.measured[name], belief.std[name]))
        text += f"; {what} {size} {its_unit}".rstrip() + f", assumed {of.number(value)}"
    if belief.gain is None:
        return text
    before, after = belief.gain.before[0], belief.gain.after[0]
    return f"{text}; held-out rms {unit.number(before)} -> {unit.text(after)}"


def _ambiguity_matters(spot: Ambiguity, diagnosis: DiagnosisData) -> bool:
    """Whether something is detected, or one of the causes is assumed or was found."""
    asked = {effect.kind for effect in diagnosis.extended.effects}
    asked |= {belief.what for belief in diagnosis.beliefs}
    asked |= {finding.cause for finding in diagnosis.findings}
    # A line alone is no reason to list all causes that may make one.
    return spot.supported or bool(set(spot.causes) & (asked - {MissingOrder.kind}))


def _ambiguity_entries(diagnosis: DiagnosisData, verbose: bool, unit: ErrorUnit) -> Iterator[Entry]:
    """Entries on what cannot be determined, what is detected first.

    Causes neither in question nor detected are named in one line, unless ``verbose``.
    """
    planned = diagnosis.planned
    spots = sorted(diagnosis.not_identifiable, key=lambda spot: not spot.supported)
    shown = [spot for spot in spots if verbose or _ambiguity_matters(spot, diagnosis)]
    if shown:
        yield "What these readings cannot distinguish:", 0, 0
    for spot in shown:
        how = "" if spot.causes in planned and not verbose else f" To find out: {spot.measure}."
        yield f"- {_head(spot)}: {spot.because}.{how}", 2, 0
        yield from ((text, 6, 4) for text in _if_it_is(spot, unit))
    named = {finding.cause for finding in diagnosis.findings}
    named |= {cause for spot in shown for cause in spot.causes}
    rest = dict.fromkeys(cause for spot in spots if spot not in shown for cause in spot.causes)
    names = ", ".join(cause for cause in rest if cause not in named)
    if names:
        also = " also" if shown else ""
        yield f"These runs{also} cannot show, or not name: {names} (why: `verbose=True`).", 2, 0


def _head(spot: Ambiguity) -> str:
    names = ", ".join(spot.causes)
    if not spot.supported:
        return names
    if spot.common:
        others = ", ".join(cause for cause in spot.causes if cause != spot.common)
        return f"whether {spot.common} is due to {others}"
    return f"{names} ({'one of them' if len(spot.causes) > 1 else 'something'} is detected)"
