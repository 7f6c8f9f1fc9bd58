"""One cause that the readings support, its quantities with their units, and its words."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Any

from ..effects import EFFECTS, Effect
from ..estimation.quantity import Parameters, Quantity
from ..support.display_units import ErrorUnit, error_unit, sine_of_rms
from ..support.layout import wrapped_lines
from ..support.plainresult import ShownResult, plain_fields
from .confirmation import CONFIRMED
from .gain import Gain
from .levels import LevelGain

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

#: Parameters that give the size of a finding: the first that it has counts. With each, its factor
#: and its unit where that is not the unit of errors.
_SIZED: dict[str, tuple[float, str]] = {
    **{
        f"{name}_arcsec": (1.0, "")
        for name in ("amplitude", "half_width", "height", "step", "standard_deviation")
    },
    "amplitudes": (1.0, ""),
    "arcsec_per_run": (1.0, ""),
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
    "order": "order {:g}",
    "carrier": "of order {:g}",
    "frequency_hz": "{:.5g} Hz",
    "place_deg": "at {:.4g} deg",
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


def finding_lines(number: str, finding: Finding, unit: ErrorUnit) -> list[str]:
    """A finding as readable text behind its number."""
    n = unit.number
    lines = [number + finding.cause]
    if not finding.confirmed:
        lines[0] += f" (NOT CONFIRMED: {unit.spoken(finding.reason)})"
        lines = wrapped_lines(lines[0], 3)
    lines += wrapped_lines(finding.sentence, 3, first=3)
    for name, entry in finding.parameters.items():
        lines += wrapped_lines(": ".join(named_quantity(name, entry, unit)), 7, first=5)
    text = f"Evidence: BIC better by {finding.evidence['bic_gain']:.1f} than without it"
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
            text += (
                f"; reducible share {gain.reducible_share:.2f} "
                f"(95 % interval {gain.interval[0]:.2f} to {gain.interval[1]:.2f})"
            )
        if gain.control_share is not None:
            control = _SHUFFLED.get(EFFECTS[finding.cause].factor, "runs turned to other angles")
            text += f", control with {control} {gain.control_share:.2f}"
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
    return f"{cause} fits {'worse' if gap > 0.0 else 'better'} by {abs(gap):.1f}"


def _by_level(gain: LevelGain, unit: ErrorUnit) -> str:
    levels = ", ".join(f"{value:.4g}" for value in gain.held_out or gain.levels)
    if gain.reducible_share is None or gain.interval is None:
        return f"Gain by {gain.factor} ({levels} {gain.unit}): {gain.note}."
    return (
        f"Gain with each {gain.factor} held out in turn ({levels} {gain.unit}): rms "
        f"{unit.number(gain.rms_before or 0.0)} -> {unit.text(gain.rms_after or 0.0)}; "
        "reducible share "
        f"{gain.reducible_share:.2f} ({gain.interval[0]:.2f} to {gain.interval[1]:.2f}); "
        f"{gain.note}."
    )


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


def brief_finding(finding: Finding, unit: ErrorUnit) -> str:
    """A finding by its cause, of which line it is, and how large with its standard error."""
    known = {name: quantity.value for name, quantity in finding.parameters.items()}
    name = finding.cause
    if isinstance(known.get("shaft"), str):
        name += f" {known['shaft'].replace('_', ' ')}"
    for parameter, words in _PLACES.items():
        if isinstance(known.get(parameter), int | float):
            name += f" {words.format(known[parameter])}"
    for parameter, (factor, word) in _SIZED.items():
        found = known.get(parameter)
        numbers = found if isinstance(found, list) else [found]
        sizes = [float(x) for x in numbers if isinstance(x, int | float)]
        if not sizes or len(sizes) < len(numbers):
            continue
        std = finding.parameters[parameter].std
        stds = std if isinstance(std, list) else [std] * len(sizes)
        shown = map((ErrorUnit(word, factor) if word else unit).text, sizes[:4], stds)
        return f"{name} ({', '.join(shown)}{' ...' * (len(sizes) > 4)})"
    if finding.gain is None:
        return name
    before, after = finding.gain.before[0], finding.gain.after[0]
    return f"{name} ({unit.text(max(before**2 - after**2, 0.0) ** 0.5)} rms)"
