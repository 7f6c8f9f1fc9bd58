"""The diagnosis as plain values, and what these runs cannot show."""

from __future__ import annotations

import re
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any, Final

from ..effects.effect import title_of
from ..plots.orderlines import likely_aliases
from ..plots.simulatedcurves import finding_names
from ..runs.checks.record import records_of
from ..runs.checks.result import REPEATABILITY, extent_of, extent_verdicts
from ..runs.run import CalibrationRun
from ..support.display_units import ErrorUnit
from .wording import shortened_list

if TYPE_CHECKING:
    from ..diagnosis import Diagnosis
    from ..fitting.orders.select import OrderSelection

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


#: Parameters that the name of a finding states already.
_NAMED: Final = ("shaft", "order", "carrier")

#: Aliases and orders reported.
_MOST_ALIASES, _MOST_FOLDED = 3, 4


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
        finding["parameters"] = _parameters(finding["parameters"], ":" in name)
        known = [q for q in finding["parameters"] if q["std"] is not None]
        sizes = [q for q in known if q["unit"].startswith("arcsec")]
        finding["sized"] = bool(sizes)
        # The parameter that gives its size: one that has a unit.
        found = sizes or [q for q in known if q["unit"]]
        finding["size"] = found[0]["index"] if found else None
        gain = finding["gain"]
        if gain is not None:
            share, interval = gain["reducible_share"], gain["reducible_share_interval"]
            gain["reducible_percent"] = None if share is None else 100.0 * share
            low, high = (None, None) if interval is None else (100.0 * x for x in interval)
            gain["reducible_low_percent"], gain["reducible_high_percent"] = low, high
    for spot in content["not_identifiable"]:
        # The size of each uncertain cause, as findings are listed.
        spot["options"] = [
            {
                "name": title_of(cause),
                "parameters": _parameters(spot.get("estimates", {}).get(cause, {}), False),
            }
            for cause in spot["causes"]
        ]
    for factor, entry in zip(diagnosis.factors, content["factors"], strict=True):
        entry["followed"], entry["status"] = factor.followed, factor.status
    # Who reads a page has no result whose methods could be called.
    content["steps"] = re.sub(r" \(`[^`]*`\)", "", "; ".join(diagnosis.next_steps))
    content["extended"] = diagnosis.extended.text()
    plan = diagnosis.next_runs
    content["next"] = plan.summary() if plan is not None and plan.runs else ""
    return content


def _parameters(entries: dict[str, Any], named: bool) -> list[dict[str, Any]]:
    return [_parameter(i, *entry, named=named) for i, entry in enumerate(entries.items())]


def _parameter(index: int, name: str, entry: dict[str, Any], named: bool) -> dict[str, Any]:
    value, std = entry["value"], entry["std"]
    value = abs(value) if name == "half_width_arcsec" else value  # its sign is a direction
    number = isinstance(value, int | float) and not isinstance(value, bool)
    unit = next((u for u in _UNITS if name.endswith(f"_{u}")), "")
    # The amplitudes of several lines, whose name states no unit.
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
        # What belongs together, a run and a row of it, is on one line.
        return "\n".join(shortened_list([" row ".join(map(_text, item)) for item in value]))
    if isinstance(value, list):
        return "; ".join(_text(item) for item in value)
    return f"{value:.4g}" if isinstance(value, float) else str(value)


def unknown_content(
    runs: Sequence[CalibrationRun],
    selection: OrderSelection | None,
    diagnosis: dict[str, Any] | None,
) -> list[dict[str, str]]:
    """``{what, because, measure}``: from the diagnosis where there is one.

    A diagnosis works out itself what the conditions of the runs leave open, but for repeatability;
    without one it is what `trueangle.check` finds.
    """
    cannot = extent_verdicts(extent_of(records_of(runs)))[1]
    if diagnosis is None:
        return _folded(selection) + cannot
    found = [
        _entry(
            " or ".join(title_of(cause) for cause in entry["causes"])
            + (" (something is detected)" if entry["supported"] else ""),
            "; ".join([entry["because"], *_estimates(entry)]),
            entry["measure"],
        )
        for entry in sorted(diagnosis["not_identifiable"], key=lambda e: not e["supported"])
    ]
    return (
        found + _folded(selection) + [entry for entry in cannot if entry["what"] == REPEATABILITY]
    )


def _estimates(entry: dict[str, Any]) -> list[str]:
    """The size of each uncertain cause, where something is found."""
    return [
        f"if {title_of(cause)}: "
        + ", ".join(
            _estimate(name, q["value"], q["std"])
            for name, q in parameters.items()
            if isinstance(q["value"], float) and isinstance(q["std"], float)
        )
        for cause, parameters in entry.get("estimates", {}).items()
    ]


def _estimate(name: str, value: float, std: float) -> str:
    """Sizes with their unit behind each number, as `ErrorUnit.spoken` finds them."""
    stem = name.removesuffix("_arcsec")
    unit = "" if stem == name and name != "amplitudes" else " arcsec"
    shown, spread = ErrorUnit("", 1.0).pair(abs(value) if stem == "half_width" else value, std)
    return f"{stem.replace('_', ' ')} {shown}{unit} +- {spread}{unit}"


def _folded(selection: OrderSelection | None) -> list[dict[str, str]]:
    """Retained orders that these positions cannot distinguish from others."""
    if selection is None:
        return []
    folded = [row for row in selection.table if row.retained and row.aliases]
    if not folded:
        return []
    told = [
        f"order {row.order:g} is really "
        + " or ".join(f"{m:g}" for m in likely_aliases(row)[:_MOST_ALIASES])
        for row in sorted(folded, key=lambda row: -row.amplitude)
    ]
    more = f", and {len(told) - _MOST_FOLDED} more orders" if len(told) > _MOST_FOLDED else ""
    return [
        _entry(
            f"whether {', '.join(told[:_MOST_FOLDED])}{more}",
            "at these positions they are one and the same column of numbers",
            "repeat a run with the positions shifted as the command trueangle plan proposes",
        )
    ]


def _entry(what: str, because: str, measure: str) -> dict[str, str]:
    return {"what": what, "because": because, "measure": measure}
