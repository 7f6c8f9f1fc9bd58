"""The diagnosis as plain values."""

from __future__ import annotations

from typing import TYPE_CHECKING, Any, Final

from ..plots.simulatedcurves import finding_names
from .numbers import shortened_list

if TYPE_CHECKING:
    from ..diagnosis import Diagnosis

#: Units by the end of a parameter's name, the longer ones first.
_UNITS: Final = {
    "arcsec_per_Nm3": "arcsec/Nm³",
    "arcsec_per_Nm": "arcsec/Nm",
    "arcsec_per_K": "arcsec/K",
    "arcsec_per_s": "arcsec/s",
    "per_Nm": "1/Nm",
    "per_kelvin": "1/K",
    "arcsec": "arcsec",
    "deg": "deg",
    "hz": "Hz",
    "s": "s",
}


#: Parameters that the name of a finding says already.
_NAMED: Final = ("shaft", "order", "carrier")


def diagnosis_content(diagnosis: Diagnosis) -> dict[str, Any]:
    """`Diagnosis.to_dict` with the sentences of its findings, and the next run.

    Parameters are listed; a value that is no single number is given as ``text``.
    """
    content = diagnosis.to_dict()
    content["findings_count"] = sum(finding.confirmed for finding in diagnosis.findings)
    content["nothing"] = diagnosis.is_enough and not any(
        spot.supported for spot in diagnosis.not_identifiable
    )
    for name, finding in zip(finding_names(diagnosis), content["findings"], strict=True):
        finding["name"] = name
        finding["sentence"] = finding.pop("physics")
        finding["parameters"] = [
            _parameter(i, parameter, entry, named=":" in name)
            for i, (parameter, entry) in enumerate(finding["parameters"].items())
        ]
        known = [q for q in finding["parameters"] if q["std"] is not None]
        sizes = [q for q in known if q["unit"].startswith("arcsec")]
        finding["sized"] = bool(sizes)
        # The parameter that says how large it is: one that has a unit.
        found = sizes or [q for q in known if q["unit"]]
        finding["size"] = found[0]["index"] if found else None
        gain = finding["gain"]
        if gain is not None:
            share, interval = gain["reducible_share"], gain["reducible_share_interval"]
            gain["reducible_percent"] = None if share is None else 100.0 * share
            low, high = (None, None) if interval is None else (100.0 * x for x in interval)
            gain["reducible_low_percent"], gain["reducible_high_percent"] = low, high
    for spot in content["not_identifiable"]:
        # What each cause in doubt would amount to, as findings are listed.
        spot["options"] = [
            {
                "name": cause.replace("_", " "),
                "parameters": [
                    _parameter(i, parameter, entry, named=False)
                    for i, (parameter, entry) in enumerate(
                        spot.get("estimates", {}).get(cause, {}).items()
                    )
                ],
            }
            for cause in spot["causes"]
        ]
    content["extended"] = diagnosis.extended.text()
    plan = diagnosis.next_runs
    content["next"] = plan.summary() if plan is not None and plan.runs else ""
    return content


def _parameter(index: int, name: str, entry: dict[str, Any], named: bool) -> dict[str, Any]:
    value, std = entry["value"], entry["std"]
    number = isinstance(value, int | float) and not isinstance(value, bool)
    unit = next((u for u in _UNITS if name.endswith(f"_{u}")), "")
    # The amplitudes of several lines, whose name says no unit.
    unit = "arcsec" if name == "amplitudes" else unit
    return {
        "index": index,
        "name": name.removesuffix(f"_{unit}").replace("_", " "),
        "in_name": named and name in _NAMED,
        "unit": _UNITS.get(unit, ""),
        "value": value if number else None,
        "std": std if number and isinstance(std, int | float) else None,
        "numbers": _numbers(value),
        "stds": _numbers(std),
        "text": "" if number else _text(value),
    }


def _numbers(value: Any) -> list[float] | None:
    """A list of numbers, which the page writes in its own unit."""
    if isinstance(value, list) and value and all(isinstance(v, float) for v in value):
        return value
    return None


def _text(value: Any) -> str:
    if isinstance(value, list) and any(isinstance(item, list | tuple) for item in value):
        # What belongs together, a run and a row of it, stands on one line.
        return "\n".join(shortened_list([" row ".join(map(_text, item)) for item in value]))
    if isinstance(value, list):
        return "; ".join(_text(item) for item in value)
    return f"{value:.4g}" if isinstance(value, float) else str(value)
