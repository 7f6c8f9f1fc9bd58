"""The diagnosis as readable text."""

from __future__ import annotations

import textwrap
from typing import TYPE_CHECKING, Any

from ..effects.blindness import Blindness
from ..regression.estimate import Quantity
from .beliefs import Belief
from .levels import LevelGain

if TYPE_CHECKING:
    from .findings import Diagnosis, Finding

__all__ = ["headline", "render"]

WIDTH = 88


def render(diagnosis: Diagnosis) -> str:
    """The account of a diagnosis: what is wrong, why, the evidence, the gain, what is open."""
    d = diagnosis.discrepancy
    lines = [
        *headline(diagnosis),
        *_wrapped(diagnosis.simulated.summary() if diagnosis.simulated else "", 0),
        f"Measured minus simulated: rms {d.rms:.2f} arcsec, peak-to-peak "
        f"{d.peak_to_peak:.2f}, max abs {d.max_abs:.2f} ({diagnosis.readings} readings).",
        f"Noise of one reading: {diagnosis.noise:.2f} arcsec"
        + (
            f", correlated by {diagnosis.correlation:.2f} from one to the next."
            if diagnosis.correlation
            else "."
        ),
    ]
    if diagnosis.structure:
        shares = [f"{cause} {100.0 * s:.0f} %" for cause, s in diagnosis.structure.items()]
        lines += _wrapped(f"Each alone would explain: {', '.join(shares[:6])}.", 0)
    if diagnosis.readings_used < diagnosis.readings:
        lines.append(f"{diagnosis.readings_used} of the readings, spread evenly, were used.")
    for k, finding in enumerate(diagnosis.findings, 1):
        lines += ["", *_finding(k, finding)]
    wrong = [belief for belief in diagnosis.beliefs if belief.verdict != "confirmed"]
    if wrong:
        lines += ["", "What the simulation claims and the readings do not show:"]
        for belief in wrong:
            lines += _wrapped(f"- {_belief(belief)}", 2)
    g = diagnosis.gain
    lines += [
        "",
        f"All together: rms {g['rms_before_arcsec']:.2f} -> {g['rms_after_arcsec']:.2f} arcsec, "
        f"peak-to-peak {g['peak_to_peak_before_arcsec']:.2f} -> "
        f"{g['peak_to_peak_after_arcsec']:.2f}, max abs {g['max_abs_before_arcsec']:.2f} -> "
        f"{g['max_abs_after_arcsec']:.2f} (in the readings that were fitted).",
    ]
    if diagnosis.not_identifiable:
        lines += ["", "What these readings cannot tell:"]
        for spot in sorted(diagnosis.not_identifiable, key=lambda spot: not spot.supported):
            head = ", ".join(spot.causes)
            if spot.supported:
                head += " (one of them is seen)" if len(spot.causes) > 1 else " (something is seen)"
            lines += _wrapped(f"- {head}: {spot.because}. To tell: {spot.measure}.", 2)
            for cause, parameters in spot.estimates.items():
                known = {name: q for name, q in parameters.items() if q.value is not None}
                shown = ", ".join(f"{name} {_quantity(q)}" for name, q in known.items())
                lines += _wrapped(f"If {cause}: {shown}.", 6, first=4)
    return "\n".join(lines)


def headline(diagnosis: Diagnosis) -> list[str]:
    """What a reader must know first: faults, what is not understood, what is seen or wrong."""
    lines: list[str] = []
    for note in diagnosis.notes:
        lines += _wrapped(f"{note}.", 2)
    for fault in diagnosis.data_faults:
        lines += _wrapped(f"Fault of the data, {fault}.", 2)
    rest = diagnosis.unexplained
    if rest is not None and rest.found:
        lines += _wrapped(
            f"NOT UNDERSTOOD: at least {rest.rms:.2f} arcsec rms ({100.0 * rest.share:.0f} % of "
            "the variance that is left) is no noise and has no name.",
            2,
        )
        for item in rest.firing[:3]:
            lines += _wrapped(f"- {item.says} (p {_chance(item.p)})", 4, 2)
    confirmed = [finding.cause for finding in diagnosis.findings if finding.confirmed]
    doubtful = [finding.cause for finding in diagnosis.findings if not finding.confirmed]
    wrong = [belief for belief in diagnosis.beliefs if belief.verdict != "confirmed"]
    if confirmed:
        lines += _wrapped(f"Confirmed: {', '.join(confirmed)}.", 2)
    if doubtful:
        lines += _wrapped(f"Listed and not confirmed: {', '.join(doubtful)}.", 2)
    if wrong:
        told = "; ".join(f"{b.what} {b.verdict.replace('_', ' ')}" for b in wrong[:4])
        lines += _wrapped(f"Wrong in the simulation: {told}.", 2)
    for spot in diagnosis.not_identifiable:
        if spot.supported:
            lines += _wrapped(f"Seen, and not told apart: {_seen(spot)}.", 2)
    if not lines:
        lines = ["Nothing beyond the simulation: no test of the readings fires."]
    return [*lines, ""]


def _seen(spot: Blindness) -> str:
    """Causes of which one is seen, each with the size that it would have."""
    sizes = []
    for cause in spot.causes:
        first = next(
            (
                f" {name} {_quantity(q)}"
                for name, q in spot.estimates.get(cause, {}).items()
                if isinstance(q.value, float)
            ),
            "",
        )
        sizes.append(f"{cause}{' (' + first.strip() + ')' if first else ''}")
    return " or ".join(sizes)


def _belief(belief: Belief) -> str:
    measured, believed, std = belief.measured, belief.believed, belief.std
    text = f"{belief.what}: {belief.verdict.replace('_', ' ')}; "
    parts = [
        f"{name.replace('_', ' ')} {measured[name]:.4g} +- {std[name]:.2g}, believed {value:.4g}"
        for name, value in believed.items()
    ]
    text += "; ".join(parts)
    gain = belief.gain
    if gain is not None:
        text += f"; held out, rms {gain.before[0]:.2f} -> {gain.after[0]:.2f} arcsec"
    return text


def _chance(p: float) -> str:
    return "below 1e-12" if p < 1e-12 else f"{p:.1g}"


def _finding(number: int, finding: Finding) -> list[str]:
    lines = [f"{number}. {finding.cause}"]
    if not finding.confirmed:
        lines[0] += f" (NOT CONFIRMED: {finding.reason})"
        lines = _wrapped(lines[0], 3)
    lines += _wrapped(finding.sentence, 3, first=3)
    for name, entry in finding.parameters.items():
        lines += _wrapped(f"{name}: {_quantity(entry)}", 7, first=5)
    text = f"Evidence: BIC better by {finding.evidence['bic_gain']:.1f}"
    if finding.rivals:
        text += "; in its place " + ", ".join(
            f"{cause} would explain {gap:.1f} less" for cause, gap in finding.rivals
        )
    lines += _wrapped(text + ".", 5, first=3)
    gain = finding.gain
    if gain is not None:
        text = (
            f"Gain on held-out data, {gain.holdout}: rms {gain.before[0]:.2f} -> "
            f"{gain.after[0]:.2f} arcsec, peak-to-peak {gain.before[1]:.2f} -> "
            f"{gain.after[1]:.2f}, max abs {gain.before[2]:.2f} -> {gain.after[2]:.2f}"
        )
        if gain.reducible_share is not None and gain.interval is not None:
            text += (
                f"; reducible share {gain.reducible_share:.2f} "
                f"({gain.interval[0]:.2f} to {gain.interval[1]:.2f})"
            )
        if gain.control_share is not None:
            text += f"; with shuffled labels {gain.control_share:.2f}"
        if gain.note:
            text += f"; {gain.note}"
        lines += _wrapped(text + ".", 5, first=3)
        if gain.by_level is not None:
            lines += _wrapped(_by_level(gain.by_level), 5, first=3)
    return lines


def _by_level(gain: LevelGain) -> str:
    levels = ", ".join(f"{value:.4g}" for value in gain.held_out or gain.levels)
    if gain.reducible_share is None or gain.interval is None:
        return f"Gain by {gain.factor} ({levels} {gain.unit}): {gain.note}."
    return (
        f"Gain with each {gain.factor} left out in turn ({levels} {gain.unit}): rms "
        f"{gain.rms_before:.2f} -> {gain.rms_after:.2f} arcsec; reducible share "
        f"{gain.reducible_share:.2f} ({gain.interval[0]:.2f} to {gain.interval[1]:.2f}); "
        f"{gain.note}."
    )


def _quantity(entry: Quantity) -> str:
    value, std = entry.value, entry.std
    if isinstance(value, list):
        shown = ", ".join(_number(item) for item in value[:12])
        if len(value) > 12:
            shown += f" and {len(value) - 12} more"
        if isinstance(std, list):
            shown += " +- " + ", ".join(_number(item) for item in std[:12])
        return shown
    if isinstance(std, float):
        return f"{_number(value)} +- {_number(std)}"
    return _number(value)


def _number(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def _wrapped(text: str, indent: int, first: int = 0) -> list[str]:
    return textwrap.wrap(text, WIDTH, initial_indent=" " * first, subsequent_indent=" " * indent)
