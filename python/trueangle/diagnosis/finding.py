"""One cause that the readings support, its quantities with their units, and its words."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import Any

from ..effects import EFFECTS, Effect
from ..effects.effect import title_of
from ..estimation.quantity import Parameters, Quantity
from ..support.display_units import ErrorUnit, error_unit, sine_of_rms
from ..support.layout import run_name, wrapped_lines
from ..support.plainresult import ShownResult, plain_fields
from .confirmation import CONFIRMED
from .gain import Gain
from .levels import LevelGain

#: Difference of BIC below which two fit equally well: nothing worth more than a bare mention.
ALIKE = 2.0

#: Numbers that are no errors, which `ErrorUnit.pair` rounds as well.
_PLAIN = ErrorUnit("", 1.0)

#: Parameters that give the size of a finding: the first that it has counts. With each, its factor
#: and its unit where that is not the unit of errors.
_SIZED: dict[str, tuple[float, str]] = {
    **{
        f"{name}_arcsec": (1.0, "")
        for name in ("amplitude", "half_width", "height", "step", "standard_deviation")
    },
    "amplitudes": (1.0, ""),
    "arcsec_per_run": (1.0, ""),
    "zero_arcsec_per_K": (1.0, "arcsec per K"),
    "delay_s": (1e3, "ms"),
    "sigma_s": (1e3, "ms"),
    "relative_error": (1e6, "ppm"),
    "ppm": (1.0, "ppm"),
    "cutoff_hz": (1.0, "Hz"),
    "fraction": (100.0, "% of the readings"),
    "arcsec_per_Nm": (1.0, "arcsec per Nm"),
    "gear_ratio": (1.0, "to 1"),
}

#: Place or object of a finding, by its parameters.
_PLACES = {
    "order": ", order {}",
    "carrier": " of order {}",
    "frequency_hz": " of {} Hz",
    "place_deg": " at {} deg",
    "cosine": " over the turn",
    "per_deg_s": " with the speed",
    "per_Nm": " with the load",
}


@dataclass(frozen=True)
class Finding(ShownResult):
    """One cause that the readings support.

    Attributes
    ----------
    cause : str
        Of the vocabulary of causes.
    parameters : dict of str to Quantity
        ``.value`` and ``.std`` by the names of the contract.
    evidence : dict
        ``bic_gain``, ``deviance`` (2 ln of the likelihood ratio), ``parameters``,
        ``log_grid``.
    gain : Gain or None
        On held-out runs; None for causes of the scatter.
    rivals : list of (str, float)
        Other causes and how much less each explains in its place (BIC); tried for the
        first four findings.
    effects : list of Effect
        What extends the simulation, where it is confirmed.
    status : str
        "confirmed", or "not_confirmed" where its gain on held-out data does not exclude
        zero: listed, and kept out of the extended simulation and of corrections.
    reason : str
        Why it is not confirmed.
    group : tuple of int
        Its terms in the regression.
    """

    cause: str
    parameters: Parameters
    evidence: dict[str, float]
    gain: Gain | None
    rivals: list[tuple[str, float]]
    effects: list[Effect] = field(repr=False, default_factory=list)
    status: str = CONFIRMED
    reason: str = ""
    group: tuple[int, ...] = field(repr=False, default=())

    @property
    def confirmed(self) -> bool:
        """Fit to extend the simulation and to correct."""
        return self.status == CONFIRMED

    def _brief(self) -> str:
        sizes = [f"{name} {q.value:.4g}" for name, q in self.parameters.items() if _is_number(q)]
        return ", ".join([self.cause, *sizes[:2], self.status])

    def summary(self) -> str:
        """The finding as readable text."""
        rms = 0.0 if self.gain is None else self.gain.before[0]
        return "\n".join(finding_lines("", self, error_unit("auto", sine_of_rms(rms))))

    @property
    def sentence(self) -> str:
        """The physics in one sentence."""
        return EFFECTS[self.cause].sentence

    def to_dict(self) -> dict[str, Any]:
        """The entry of ``findings``."""
        return {
            **plain_fields(self, "cause status status_reason=reason parameters evidence gain"),
            "rivals": [{"cause": cause, "bic_gap": gap} for cause, gap in self.rivals],
            "physics": self.sentence,
            "correctable": self.cause not in EFFECTS or not EFFECTS[self.cause].not_at_run_time,
        }


def _is_number(quantity: Quantity) -> bool:
    return isinstance(quantity.value, int | float)


def finding_lines(
    number: str, finding: Finding, unit: ErrorUnit, before: Sequence[Finding] = ()
) -> list[str]:
    """A finding as readable text behind its number, without what those ``before`` have stated."""
    n = unit.number
    title = title_of(finding.cause)
    head = number + finding.cause + f": {title}" * (title != finding.cause.replace("_", " "))
    head += "" if finding.confirmed else f" (NOT CONFIRMED: {unit.spoken(finding.reason)})"
    lines = wrapped_lines(head, 3)
    if finding.cause not in {other.cause for other in before}:
        lines += wrapped_lines(finding.sentence, 3, first=3)
    origins = [f.parameters["explanations"] for f in before if "explanations" in f.parameters]
    stated = {text for origin in origins for text in origin.value}
    for name, entry in finding.parameters.items():
        if name == "explanations":
            for text in entry.value:
                short, colon, _ = text.partition(":")
                text = f"{short} (see above)" if colon and text in stated else text
                lines += wrapped_lines(f"may be: {text}", 7, first=5)
        elif name != "output_order" or entry.value != finding.parameters["order"].value:
            lines += wrapped_lines(": ".join(named_quantity(name, entry, unit)), 7, first=5)
    text = f"Evidence: BIC better by {finding.evidence['bic_gain']:.0f} than without it"
    if finding.rivals:
        text += "; in its place " + ", ".join(_rival(*rival) for rival in finding.rivals)
    lines += wrapped_lines(text + ".", 5, first=3)
    gain = finding.gain
    if gain is not None:
        text = (
            f"Gain on held-out data, {gain.holdout}: rms {n(gain.before[0])} -> "
            f"{unit.text(gain.after[0])}, peak-to-peak {n(gain.before[1])} -> "
            f"{n(gain.after[1])}, max abs {n(gain.before[2])} -> {n(gain.after[2])}"
        )
        if gain.reducible_share is not None and gain.interval is not None:
            text += f"; it removes {_share(gain.reducible_share, gain.interval)}"
        if gain.control_share is not None:
            text += f"; control with shuffled labels: {100.0 * max(gain.control_share, 0.0):.0f} %"
        if gain.note:
            text += f"; {gain.note}"
        lines += wrapped_lines(text + ".", 5, first=3)
        if gain.by_level is not None:
            lines += wrapped_lines(_by_level(gain.by_level, unit), 5, first=3)
    return lines


def _rival(cause: str, gap: float) -> str:
    """Another cause in the place of a finding, by the difference of their BIC."""
    if abs(gap) < ALIKE:
        return f"{cause} fits as well"
    return f"{cause} fits {'worse' if gap > 0.0 else 'better'} by {abs(gap):.0f}"


def _share(share: float, interval: tuple[float, float]) -> str:
    """What is removed of the variance beyond the noise, with its 95 % interval."""
    share, low, high = (100.0 * part for part in (share, *interval))
    return f"{share:.0f} % of the variance beyond the noise (95 %: {low:.0f} to {high:.0f} %)"


def _by_level(gain: LevelGain, unit: ErrorUnit) -> str:
    levels = ", ".join(f"{value:.4g}" for value in gain.held_out or gain.levels)
    text = f"Gain with each {gain.factor} held out in turn ({levels} {gain.unit}): "
    if gain.reducible_share is not None and gain.interval is not None:
        text += f"rms {unit.number(gain.rms_before or 0.0)} -> {unit.text(gain.rms_after or 0.0)}"
        text += f"; it removes {_share(gain.reducible_share, gain.interval)}; "
    return f"{text}{gain.note}."


def parameter_unit(name: str, unit: ErrorUnit) -> tuple[str, ErrorUnit]:
    """What a parameter is called in ``unit``, and the unit that it is shown in."""
    # The amplitudes of several lines, whose name states no unit.
    name = "amplitudes_arcsec" if name == "amplitudes" else name
    stem = name.removesuffix("_arcsec")
    return (name, _PLAIN) if stem == name else (f"{stem}_{unit.name}", unit)


def named_quantity(name: str, entry: Quantity, unit: ErrorUnit) -> tuple[str, str]:
    """Name and value of a parameter, an error in ``unit``."""
    shown, of = parameter_unit(name, unit)
    value, std = entry.value, entry.std
    if name.startswith("row"):
        # Files count rows from 0, texts readings from 1.
        shown, value = name.replace("row", "reading"), _from_one(value)
    if name == "half_width_arcsec" and isinstance(value, float):
        full = of.number(2.0 * abs(value), None if std is None else 2.0 * std)
        return shown, f"{_number(abs(value), std, of)} (full width {full})"
    if isinstance(value, list):
        stds = std if isinstance(std, list) else [None] * len(value)
        text = ", ".join(_number(*item, of) for item in zip(value[:12], stds, strict=False))
        return shown, text + (f" and {len(value) - 12} more" if len(value) > 12 else "")
    return shown, _number(value, std, of)


def _from_one(value: Any) -> Any:
    """Places counted from 1, alone, in a list, or behind the label of a run."""
    if isinstance(value, list):
        return [*map(_from_one, value)]
    return value + 1 if isinstance(value, int | float) else value


def _number(value: Any, std: Any, of: ErrorUnit) -> str:
    if isinstance(std, float) and isinstance(value, int | float):
        pair = of.pair(float(value), std)
        return " +- ".join(pair) if pair[1] != "-" else pair[0]
    if isinstance(value, float) and not (of is _PLAIN and value.is_integer()):
        return of.number(value)
    text = f"{value:.0f}" if isinstance(value, float) else str(value)
    return f"{value[1]} of {run_name(value[0])}" if isinstance(value, list) else text


def brief_finding(finding: Finding, unit: ErrorUnit) -> str:
    """A finding by its cause, its line, and its size with its standard error."""
    known = {name: quantity.value for name, quantity in finding.parameters.items()}
    shaft = known.get("shaft")
    name = title_of(finding.cause)
    name += f" of the {shaft.replace('_', ' ')}" if shaft else ""
    for parameter, words in _PLACES.items():
        if isinstance(known.get(parameter), int | float):
            std = finding.parameters[parameter].std
            at = _number(known[parameter], std, _PLAIN) if std else f"{known[parameter]:.5g}"
            name += words.format(at)
    for parameter, (factor, word) in _SIZED.items():
        found = known.get(parameter)
        numbers = found if isinstance(found, list) else [found]
        sizes = [float(x) for x in numbers if isinstance(x, int | float)]
        if not sizes or len(sizes) < len(numbers):
            continue
        std = finding.parameters[parameter].std
        stds = std if isinstance(std, list) else [std] * len(sizes)
        late = "joint" if sizes[0] > 0.0 else "reference"
        if parameter in ("half_width_arcsec", "delay_s"):  # whose sign is a direction
            sizes = [abs(size) for size in sizes]
        shown = [*map((ErrorUnit(word, factor) if word else unit).text, sizes[:3], stds)]
        if parameter == "half_width_arcsec":
            full = unit.number(2.0 * sizes[0], 2.0 * std if std else None)
            shown = [f"half width {shown[0]}", f"full {full}"]
        if parameter == "delay_s":
            shown.append(f"the {late} is late")
        return f"{name} ({', '.join(shown)}{' ...' * (len(sizes) > 3)})"
    if finding.gain is None:
        return name
    before, after = finding.gain.before[0], finding.gain.after[0]
    return f"{name} ({unit.text(max(before**2 - after**2, 0.0) ** 0.5)} rms)"
