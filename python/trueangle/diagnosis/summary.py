"""The diagnosis as readable text."""

from __future__ import annotations

from collections.abc import Iterator
from typing import TYPE_CHECKING, Any

from ..effects import EFFECTS
from ..effects.blindness import Blindness
from ..estimation.estimate import Quantity
from ..support.display_units import ErrorsIn, ErrorUnit, error_unit, sine_of_rms
from ..support.layout import laid_out
from ..support.layout import wrapped as _wrapped
from .beliefs import Belief
from .brief import brief_finding
from .goodness.evidence import Evidence
from .goodness.scatter import AGAINST_STATED
from .levels import LevelGain
from .untold import ambiguity_entries

if TYPE_CHECKING:
    from .finding import Finding
    from .findings import Diagnosis

#: Share by which the noise must differ from what the simulation states to be told first.
MATERIAL = 0.1

#: Difference of BIC below which two fit equally well: nothing worth more than a bare mention.
ALIKE = 2.0

#: The negative control of a finding, by the factor that it follows.
_SHUFFLED = {
    "direction": "directions exchanged at random between runs",
    "velocity": "speeds turned round at random",
    "temperature": "temperatures exchanged between runs",
    "torque": "loads exchanged between runs",
    "mount": "mounts exchanged between runs",
    "coupled": "motions of the other joint moved in time and turned round at random",
}

#: Numbers that are no errors, which `ErrorUnit.pair` rounds as well.
_PLAIN = ErrorUnit("", 1.0)


def diagnosis_summary(
    diagnosis: Diagnosis, errors_in: ErrorsIn = "auto", verbose: bool = False
) -> str:
    """The account of a diagnosis: what is wrong, why, the evidence, the gain, what is open.

    ``verbose`` tells in full what the readings could not have shown, and nobody asked.
    """
    d = diagnosis.discrepancy
    unit = error_unit(errors_in, sine_of_rms(d.rms))
    n = unit.number
    lines = [
        *diagnosis_headline(diagnosis, unit),
        *_wrapped(diagnosis.simulated.summary() if diagnosis.simulated else "", 0),
        f"Measured minus simulated: rms {unit.text(d.rms)}, peak-to-peak "
        f"{n(d.peak_to_peak)}, max abs {n(d.max_abs)} ({diagnosis.readings} readings).",
        f"Noise of one reading: {unit.text(diagnosis.noise)}"
        + (
            f", correlated by {diagnosis.correlation:.2f} from one to the next."
            if diagnosis.correlation
            else "."
        ),
    ]
    if diagnosis.structure:
        shares = [f"{cause} {100.0 * s:.0f} %" for cause, s in diagnosis.structure.items()]
        lines += _wrapped(f"Of the variance each alone accounts for: {', '.join(shares[:6])}.", 2)
    if diagnosis.readings_used < diagnosis.readings:
        used = f"{diagnosis.readings_used} of the readings were used: spread evenly, and none"
        lines += _wrapped(f"{used} at a turning point, where the direction is not known.", 0)
    for k, finding in enumerate(diagnosis.findings, 1):
        lines += ["", *_finding(f"{k}. ", finding, unit)]
    wrong = [belief for belief in diagnosis.beliefs if belief.verdict != "confirmed"]
    if wrong:
        lines += ["", "What the simulation claims and the readings do not show:"]
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
    open_still = [*ambiguity_entries(diagnosis, verbose, lambda spot: _if_it_is(spot, unit))]
    if diagnosis.next_runs is not None and diagnosis.next_runs.runs:
        lines += ["", *diagnosis.next_runs.summary().splitlines()]
    lines += [""] if open_still else []
    for text, indent, first in open_still:
        lines += _wrapped(text, indent, first)
    return laid_out(lines)


def _if_it_is(spot: Blindness, unit: ErrorUnit) -> Iterator[str]:
    """What each of the causes in question would amount to."""
    for cause, parameters in spot.estimates.items():
        known = {name: q for name, q in parameters.items() if q.value is not None}
        shown = ", ".join(" ".join(_named(name, q, unit)) for name, q in known.items())
        yield f"If {cause}: {shown}."


def diagnosis_headline(diagnosis: Diagnosis, unit: ErrorUnit) -> list[str]:
    """What a reader must know first: faults, what is not understood, what is seen or wrong."""
    lines: list[str] = []
    for note in diagnosis.notes:
        lines += _wrapped(f"{note}.", 2)
    for fault in diagnosis.data_faults:
        lines += _wrapped(f"Fault of the data, {fault}.", 2)
    rest = diagnosis.unexplained
    if rest is not None and rest.found:
        lines += _wrapped(
            f"NOT UNDERSTOOD: at least {unit.text(rest.rms)} rms ({100.0 * rest.share:.0f} % of "
            "the variance that is left) is not noise and has no name.",
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
    if doubtful:
        lines += _wrapped(f"Listed and not confirmed: {', '.join(doubtful)}.", 2)
    if wrong:
        told = "; ".join(f"{b.what} {b.verdict.replace('_', ' ')}" for b in wrong[:4])
        lines += _wrapped(f"Wrong in the simulation: {told}.", 2)
    for spot in diagnosis.not_identifiable:
        if spot.supported and not spot.common:
            lines += _wrapped(f"Seen, and not distinguished: {_seen(spot, unit)}.", 2)
    noise = [] if rest is None else [item for item in rest.noise_firing if _is_material(item)]
    if lines:
        for item in noise:
            if item.test == AGAINST_STATED:
                lines += _wrapped(f"{item.says[0].upper()}{item.says[1:]}.", 2)
    elif noise:
        lines = ["No pattern beyond the simulation, but its noise is another:"]
        for item in noise:
            lines += _wrapped(f"- {unit.spoken(item.says)} (p {_chance(item.p)})", 4, 2)
    else:
        lines = ["Nothing beyond the simulation: no test of the readings fires."]
    return [*lines, ""]


def _is_material(item: Evidence) -> bool:
    """Whether what a test says of the noise is more than a few percent of the stated one."""
    return item.test != AGAINST_STATED or abs(item.statistic - 1.0) > MATERIAL


def _seen(spot: Blindness, unit: ErrorUnit) -> str:
    """Causes of which one is seen, each with the size that it would have."""
    sizes = []
    for cause in spot.causes:
        first = next(
            (
                " ".join(_named(name, q, unit))
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
        f"believed {of.number(value)}"
        for name, value in believed.items()
        for shown, of in [_unit_of(name, unit)]
    ]
    text += "; ".join(parts)
    gain = belief.gain
    if gain is not None:
        text += f"; held out, rms {unit.number(gain.before[0])} -> {unit.text(gain.after[0])}"
    return text


def _chance(p: float) -> str:
    return "below 1e-12" if p < 1e-12 else f"{p:.1g}"


def finding_text(finding: Finding) -> str:
    """One finding by itself."""
    rms = 0.0 if finding.gain is None else finding.gain.before[0]
    return "\n".join(_finding("", finding, error_unit("auto", sine_of_rms(rms))))


def _finding(number: str, finding: Finding, unit: ErrorUnit) -> list[str]:
    n = unit.number
    lines = [number + finding.cause]
    if not finding.confirmed:
        lines[0] += f" (NOT CONFIRMED: {unit.spoken(finding.reason)})"
        lines = _wrapped(lines[0], 3)
    lines += _wrapped(finding.sentence, 3, first=3)
    for name, entry in finding.parameters.items():
        lines += _wrapped(": ".join(_named(name, entry, unit)), 7, first=5)
    text = f"Evidence: BIC better by {finding.evidence['bic_gain']:.1f} than without it"
    if finding.rivals:
        text += "; in its place " + ", ".join(_rival(*rival) for rival in finding.rivals)
    lines += _wrapped(text + ".", 5, first=3)
    gain = finding.gain
    if gain is not None:
        text = (
            f"Gain on held-out data, {gain.holdout}: rms {n(gain.before[0])} -> "
            f"{unit.text(gain.after[0])}, peak-to-peak {n(gain.before[1])} -> "
            f"{n(gain.after[1])}, max abs {n(gain.before[2])} -> {n(gain.after[2])}"
        )
        if gain.reducible_share is not None and gain.interval is not None:
            text += (
                f"; reducible share {gain.reducible_share:.2f} "
                f"({gain.interval[0]:.2f} to {gain.interval[1]:.2f})"
            )
        if gain.control_share is not None:
            control = _SHUFFLED.get(EFFECTS[finding.cause].factor, "runs turned to other angles")
            text += f" (control: {gain.control_share:.2f} with {control})"
        if gain.note:
            text += f"; {gain.note}"
        lines += _wrapped(text + ".", 5, first=3)
        if gain.by_level is not None:
            lines += _wrapped(_by_level(gain.by_level, unit), 5, first=3)
    return lines


def _rival(cause: str, gap: float) -> str:
    """Another cause in the place of a finding, by the difference of their BIC."""
    if abs(gap) < ALIKE:
        return f"{cause} fits as well"
    return f"{cause} fits {'worse' if gap > 0.0 else 'better'} by {abs(gap):.1f}"


def _by_level(gain: LevelGain, unit: ErrorUnit) -> str:
    levels = ", ".join(f"{value:.4g}" for value in gain.held_out or gain.levels)
    if gain.reducible_share is None or gain.interval is None:
        return f"Gain by {gain.factor} ({levels} {gain.unit}): {gain.note}."
    return (
        f"Gain with each {gain.factor} left out in turn ({levels} {gain.unit}): rms "
        f"{unit.number(gain.rms_before or 0.0)} -> {unit.text(gain.rms_after or 0.0)}; "
        "reducible share "
        f"{gain.reducible_share:.2f} ({gain.interval[0]:.2f} to {gain.interval[1]:.2f}); "
        f"{gain.note}."
    )


def _unit_of(name: str, unit: ErrorUnit) -> tuple[str, ErrorUnit]:
    """What a parameter is called in ``unit``, and the unit that it is shown in."""
    # The amplitudes of several lines, whose name says no unit.
    name = "amplitudes_arcsec" if name == "amplitudes" else name
    stem = name.removesuffix("_arcsec")
    return (name, _PLAIN) if stem == name else (f"{stem}_{unit.name}", unit)


def _named(name: str, entry: Quantity, unit: ErrorUnit) -> tuple[str, str]:
    """Name and value of a parameter, an error in ``unit``."""
    shown, of = _unit_of(name, unit)
    value, std = entry.value, entry.std
    if isinstance(value, list):
        text = ", ".join(_number(item, of) for item in value[:12])
        if len(value) > 12:
            text += f" and {len(value) - 12} more"
        if isinstance(std, list):
            text += " +- " + ", ".join(_number(item, of) for item in std[:12])
        return shown, text
    if isinstance(std, float) and isinstance(value, int | float):
        pair = of.pair(float(value), std)
        return shown, " +- ".join(pair) if pair[1] != "-" else pair[0]
    return shown, _number(value, of)


def _number(value: Any, of: ErrorUnit) -> str:
    if isinstance(value, float) and not (of is _PLAIN and value.is_integer()):
        return of.number(value)
    return f"{value:.0f}" if isinstance(value, float) else str(value)
