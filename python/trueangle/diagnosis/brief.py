"""A finding in a few words: its cause, of which line it is, and how large."""

from __future__ import annotations

from ..support.display_units import ErrorUnit, significant
from .finding import Finding

#: Parameters that say how large a finding is, the first that it has; by how much it is multiplied,
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
    "gear_ratio": (1.0, "is the ratio"),
}

#: Where or of what a finding is, by the parameters that say so.
_PLACES = {
    "order": "order {:g}",
    "carrier": "of order {:g}",
    "frequency_hz": "{:.5g} Hz",
    "place_deg": "at {:.4g} deg",
}


def brief_finding(finding: Finding, unit: ErrorUnit) -> str:
    """A finding by its cause, of which line it is, and how large."""
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
        shown = [significant(factor * x, 4) if word else unit.number(x) for x in sizes[:4]]
        more = " ..." if len(sizes) > len(shown) else ""
        return f"{name} ({', '.join(shown)}{more} {word or unit.name})"
    return name
