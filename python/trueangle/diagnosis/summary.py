"""The diagnosis as readable text."""

from __future__ import annotations

from collections.abc import Callable, Iterator

from ..effects.ambiguity import Ambiguity
from ..effects.missing_order import MissingOrder
from ..support.display_units import ErrorsIn, ErrorUnit, error_unit, sine_of_rms
from ..support.layout import laid_out
from ..support.layout import wrapped_lines as _wrapped
from .beliefs import Belief
from .diagnosisdata import DiagnosisData
from .finding import brief_finding, finding_lines, named_quantity, parameter_unit
from .goodness.evidence import Evidence
from .goodness.scatter import AGAINST_STATED

#: Share by which the noise must differ from what the simulation states to be reported first.
MATERIAL = 0.1

#: What adds an entry to a text: how far its further lines are set in, and the first one.
Entry = tuple[str, int, int]


def diagnosis_summary(
    diagnosis: DiagnosisData, errors_in: ErrorsIn = "auto", verbose: bool = False
) -> str:
    """The account of a diagnosis: what is wrong, why, the evidence, the gain, what is open.

    ``verbose`` also reports in full the causes not in question that these readings cannot show.
    """
    d = diagnosis.discrepancy
    unit = error_unit(errors_in, sine_of_rms(d.rms))
    n = unit.number
    lines = [
        *_headline(diagnosis, unit),
        *_wrapped(diagnosis.simulated.summary() if diagnosis.simulated else "", 0),
        f"Measured minus simulated: rms {unit.text(d.rms)}, peak-to-peak "
        f"{n(d.peak_to_peak)}, max abs {n(d.max_abs)} ({diagnosis.readings} readings).",
        f"Noise of one reading: {unit.text(diagnosis.noise)}"
        + (
            f", correlation between neighbours {diagnosis.correlation:.2f}."
            if diagnosis.correlation
            else "."
        ),
    ]
    if diagnosis.structure:
        shares = [f"{cause} {100.0 * s:.0f} %" for cause, s in diagnosis.structure.items()]
        lines += _wrapped(f"Variance explained by each alone: {', '.join(shares[:6])}.", 2)
    if diagnosis.readings_used < diagnosis.readings:
        used = f"{diagnosis.readings_used} of the readings were used: spread evenly, and none"
        lines += _wrapped(f"{used} at a turning point, where the direction is not known.", 0)
    for k, finding in enumerate(diagnosis.findings, 1):
        lines += ["", *finding_lines(f"{k}. ", finding, unit)]
    wrong = [belief for belief in diagnosis.beliefs if belief.verdict != "confirmed"]
    if wrong:
        lines += ["", "Wrong in the simulation:"]
        for belief in wrong:
            lines += _wrapped(f"- {_belief(belief, unit)}", 2)
    g = diagnosis.gain
    together = (
        f"All together: rms {n(g['rms_before_arcsec'])} -> {unit.text(g['rms_after_arcsec'])}, "
        f"peak-to-peak {n(g['peak_to_peak_before_arcsec'])} -> "
        f"{n(g['peak_to_peak_after_arcsec'])}, max abs {n(g['max_abs_before_arcsec'])} -> "
        f"{n(g['max_abs_after_arcsec'])} (in the readings that were fitted)."
    )
    lines += ["", *_wrapped(together, 2)]
    if diagnosis.torque is not None:
        lines.append("")
        for text in diagnosis.torque.lines():
            lines += _wrapped(text, 2)
    open_still = [*_ambiguity_entries(diagnosis, verbose, lambda spot: _if_it_is(spot, unit))]
    if diagnosis.next_runs is not None and diagnosis.next_runs.runs:
        lines += ["", *diagnosis.next_runs.summary().splitlines()]
    lines += [""] if open_still else []
    for text, indent, first in open_still:
        lines += _wrapped(text, indent, first)
    return laid_out(lines)


def _if_it_is(spot: Ambiguity, unit: ErrorUnit) -> Iterator[str]:
    """What each of the causes in question would amount to."""
    for cause, parameters in spot.estimates.items():
        known = {name: q for name, q in parameters.items() if q.value is not None}
        shown = ", ".join(" ".join(named_quantity(name, q, unit)) for name, q in known.items())
        yield f"If {cause}: {shown}."


def _headline(diagnosis: DiagnosisData, unit: ErrorUnit) -> list[str]:
    """What a reader must know first: faults, what is not understood, what is found or wrong."""
    lines: list[str] = []
    for note in diagnosis.notes:
        lines += _wrapped(f"{note}.", 2)
    for fault in diagnosis.data_faults:
        lines += _wrapped(f"Fault of the data, {fault}.", 2)
    rest = diagnosis.unexplained
    if rest is not None and rest.found:
        lines += _wrapped(
            f"NOT UNDERSTOOD: at least {unit.text(rest.rms)} rms ({100.0 * rest.share:.0f} % of "
            "the residual variance) is not noise and has no known cause.",
            2,
        )
        for item in rest.firing[:3]:
            lines += _wrapped(f"- {unit.spoken(item.says)} (p {_chance(item.p)})", 4, 2)
    confirmed = [brief_finding(f, unit) for f in diagnosis.findings if f.confirmed]
    doubtful = [brief_finding(f, unit) for f in diagnosis.findings if not f.confirmed]
    wrong = [belief for belief in diagnosis.beliefs if belief.verdict != "confirmed"]
    if confirmed:
        lines += _wrapped(f"Confirmed: {', '.join(confirmed)}.", 2)
    if diagnosis.torque is not None:
        lacking = [f.summary() for f in diagnosis.torque.findings if f.confirmed]
        if lacking:
            lines += _wrapped(f"Confirmed in the drive's torque: {'; '.join(lacking)}.", 2)
    for factor in diagnosis.factors:
        if not factor.named_by:
            lines += _wrapped(f"Follows {factor.sentence(unit)}.", 2)
    if doubtful:
        lines += _wrapped(f"Not confirmed: {', '.join(doubtful)}.", 2)
    if wrong:
        told = "; ".join(f"{b.what} {b.verdict.replace('_', ' ')}" for b in wrong[:4])
        lines += _wrapped(f"Wrong in the simulation: {told}.", 2)
    for spot in diagnosis.not_identifiable:
        if spot.supported and not spot.common:
            lines += _wrapped(f"Detected, not distinguished: {_seen(spot, unit)}.", 2)
    noise = [] if rest is None else [item for item in rest.noise_firing if _is_material(item)]
    if lines:
        for item in noise:
            if item.test == AGAINST_STATED:
                lines += _wrapped(f"{unit.spoken(item.says[0].upper() + item.says[1:])}.", 2)
    elif noise:
        lines = ["No pattern beyond the simulation, but the noise differs:"]
        for item in noise:
            lines += _wrapped(f"- {unit.spoken(item.says)} (p {_chance(item.p)})", 4, 2)
    else:
        lines = ["Nothing beyond the simulation: no test is significant."]
    return [*lines, ""]


def _is_material(item: Evidence) -> bool:
    """Whether the noise differs by more than a few percent from the stated one."""
    return item.test != AGAINST_STATED or abs(item.statistic - 1.0) > MATERIAL


def _seen(spot: Ambiguity, unit: ErrorUnit) -> str:
    """Causes of which one is detected, each with the size that it would have."""
    sizes = []
    for cause in spot.causes:
        first = next(
            (
                " ".join(named_quantity(name, q, unit))
                for name, q in spot.estimates.get(cause, {}).items()
                if isinstance(q.value, float)
            ),
            "",
        )
        sizes.append(f"{cause}{f' ({first})' if first else ''}")
    return " or ".join(sizes)


def _belief(belief: Belief, unit: ErrorUnit) -> str:
    measured, believed, std = belief.measured, belief.believed, belief.std
    text = f"{belief.what}: {belief.verdict.replace('_', ' ')}; "
    parts = [
        f"{shown.replace('_', ' ')} {' +- '.join(of.pair(measured[name], std[name]))}, "
        f"assumed {of.number(value)}"
        for name, value in believed.items()
        for shown, of in [parameter_unit(name, unit)]
    ]
    text += "; ".join(parts)
    gain = belief.gain
    if gain is not None:
        text += f"; held out, rms {unit.number(gain.before[0])} -> {unit.text(gain.after[0])}"
    return text


def _chance(p: float) -> str:
    return "below 1e-12" if p < 1e-12 else f"{p:.1g}"


def _ambiguity_matters(spot: Ambiguity, diagnosis: DiagnosisData) -> bool:
    """Whether something is detected, or one of the causes is assumed or was found."""
    asked = {effect.kind for effect in diagnosis.extended.effects}
    asked |= {belief.what for belief in diagnosis.beliefs}
    asked |= {finding.cause for finding in diagnosis.findings}
    # A line alone is no reason to list all causes that may make one.
    return spot.supported or bool(set(spot.causes) & (asked - {MissingOrder.kind}))


def _ambiguity_entries(
    diagnosis: DiagnosisData, verbose: bool, sizes: Callable[[Ambiguity], Iterator[str]]
) -> Iterator[Entry]:
    """Entries on what cannot be determined, what is detected first.

    Causes neither in question nor detected are named in one line, unless ``verbose``.
    ``sizes`` gives what each cause of a blind spot would amount to.
    """
    plan = diagnosis.next_runs
    planned = {entry.causes for entry in (plan.between if plan and plan.runs else ()) if entry.told}
    spots = sorted(diagnosis.not_identifiable, key=lambda spot: not spot.supported)
    shown = [spot for spot in spots if verbose or _ambiguity_matters(spot, diagnosis)]
    if shown:
        yield "What these readings cannot distinguish:", 0, 0
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
            f"Not detectable in these runs{again}: {names} (why: `verbose=True`).",
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
    return f"{names} ({'one of them' if len(spot.causes) > 1 else 'something'} is detected)"
