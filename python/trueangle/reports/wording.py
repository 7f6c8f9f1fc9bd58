"""Words that the template of a page asks for: titles, sentences, lists, conditions, gains."""

from __future__ import annotations

from typing import Any, Final

from ..support.display_units import ErrorUnit

FIGURE_TITLES: Final = {
    "errors": "Measured error of every run, and the model",
    "measured-simulated": "Measured error and what the simulation expects",
    "error-left": "What is left of held-out runs without each cause (log scale)",
    "spectrum": "Size of every order",
    "phases": "Phase and size of every order, run by run",
    "before-after": "Held-out runs before and after correction",
    "factors": "Function of each factor",
}

#: Conditions of a run: where they stand, their name and unit.
_CONDITIONS: Final = (
    ("speed_deg_s", "speed", "deg/s"),
    ("temperature_C", "temperature", "°C"),
    ("torque_Nm", "torque", "Nm"),
    ("mount_deg", "mount", "deg"),
)
#: Digits of the largest of a column.
_CONDITION_DIGITS: Final = 3
_PLAIN: Final = ErrorUnit("", 1.0)

#: Orders that are not retained in the table of evidence.
_OTHERS: Final = 20

#: Reduction, in percent, from which a correction is worth having.
_WORTH: Final = 1.0


def figure_title(name: str, modelled: bool) -> str:
    """What stands above a figure.

    Examples
    --------
    >>> figure_title("errors", modelled=False)
    'Measured error of every run'
    """
    title = FIGURE_TITLES[name]
    return title if modelled else title.removesuffix(", and the model")


def gain_verdict(content: dict[str, Any]) -> str:
    """``"gain"``, ``"no-gain"``, ``"unchecked"`` or ``"no-model"``."""
    if content["model"] is None:
        return "no-model"
    gain = content["gain"]
    if gain is None:
        return "unchecked"
    low = gain["reduction_low_percent"]
    low = gain["reduction_percent"] if low is None else low
    return "gain" if low >= _WORTH else "no-gain"


def as_sentence(text: str) -> str:
    """A remark as a sentence.

    Examples
    --------
    >>> as_sentence("verified at 36 positions")
    'Verified at 36 positions.'
    """
    text = text.strip()
    return f"{text[:1].upper()}{text[1:]}{'' if text.endswith(('.', '!', '?')) else '.'}"


def joined_list(items: list[Any]) -> str:
    """Items as a list in a sentence.

    Examples
    --------
    >>> joined_list([1, 2, 3])
    '1, 2 and 3'
    """
    texts = [f"{item:g}" if isinstance(item, float) else str(item) for item in items]
    return texts[0] if len(texts) == 1 else f"{', '.join(texts[:-1])} and {texts[-1]}"


def residual_signals(figures: dict[str, Any]) -> list[str]:
    """Signals that the residual is drawn against."""
    return [name.removeprefix("residual-") for name in figures if name.startswith("residual-")]


def conditions(runs: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Columns of the conditions that any run has, each with the decimals it needs."""
    known = []
    for key, name, unit in _CONDITIONS:
        values = [abs(run[key]) for run in runs if run[key] is not None]
        if values:
            digits = _PLAIN.decimals(max(values), _CONDITION_DIGITS)
            known.append({"key": key, "name": name, "unit": unit, "digits": digits})
    return known


def by_kind(faults: list[dict[str, Any]]) -> list[tuple[dict[str, Any], list[str]]]:
    """The first fault of every kind, with the runs that have it too.

    Examples
    --------
    >>> a, b = {"fault": "x", "runs": ["1"]}, {"fault": "x", "runs": ["2", "3"]}
    >>> by_kind([a, b])
    [({'fault': 'x', 'runs': ['1']}, ['2', '3'])]
    """
    found: dict[str, tuple[dict[str, Any], list[str]]] = {}
    for fault in faults:
        _, others = found.setdefault(fault["fault"], (fault, []))
        others += [run for run in fault["runs"] if run not in found[fault["fault"]][0]["runs"]]
    return list(found.values())


def entry_paths(pattern: str, entries: list[Any]) -> list[str]:
    """Where the same number of every entry stands in the content.

    Examples
    --------
    >>> entry_paths("runs.{}.rms", ["a", "b"])
    ['runs.0.rms', 'runs.1.rms']
    """
    return [pattern.format(i) for i in range(len(entries))]


def listed_orders(rows: list[dict[str, Any]]) -> list[int]:
    """Which orders a table lists: those retained, and of the others the largest.

    Examples
    --------
    >>> rows = [{"retained": k == 3, "amplitude_arcsec": float(k)} for k in range(100)]
    >>> listed_orders(rows)[:3], len(listed_orders(rows))
    ([3, 80, 81], 21)
    """
    others = [i for i, row in enumerate(rows) if not row["retained"]]
    others.sort(key=lambda i: -(rows[i]["amplitude_arcsec"] or 0.0))
    return sorted({i for i, row in enumerate(rows) if row["retained"]} | set(others[:_OTHERS]))


def gain_paths(findings: list[dict[str, Any]]) -> list[str]:
    """Where what is left after each finding stands."""
    every = enumerate(findings)
    return [f"diagnosis.findings.{i}.gain.rms_after_arcsec" for i, f in every if f["gain"]]
