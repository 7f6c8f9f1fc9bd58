"""Numbers and words of a page: each number with its place in the content, titles, sentences."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

from ..support.display_units import ErrorUnit

FIGURE_TITLES: Final = {
    "errors": "Measured error of every run, and the model",
    "measured-simulated": "Measured error and what the simulation expects",
    "error-left": "Residual of held-out runs without each cause (log scale)",
    "spectrum": "Size of every order",
    "phases": "Phase and size of every order, run by run",
    "before-after": "Held-out runs before and after correction",
    "factors": "Function of each factor",
}

#: Conditions of a run: their key in the content, name and unit.
_CONDITIONS: Final = (
    ("speed_deg_s", "speed", "deg/s"),
    ("temperature_C", "temperature", "°C"),
    ("torque_Nm", "torque", "Nm"),
    ("mount_deg", "mount", "deg"),
)
#: Digits of the largest of a column.
_PLAIN: Final = ErrorUnit("", 1.0)


#: Shown where there is no number.
_NONE: Final = "\u2013"

#: The sign of negative numbers.
MINUS: Final = "\u2212"

#: Digits of a single error, and of the smallest in a column of them.
_DIGITS, _LEAST_DIGITS = 4, 3

#: Lines of a list in a cell at most; of a longer one this many are shown.
_MOST_LINES, _SHOWN_LINES = 12, 6


def figure_title(name: str, modelled: bool) -> str:
    """The title above a figure.

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
    # Reduction, in percent, from which a correction is worth having.
    return "gain" if low >= 1.0 else "no-gain"


def as_sentence(text: str) -> str:
    """A remark as a sentence.

    Examples
    --------
    >>> as_sentence("verified at 36 positions")
    'Verified at 36 positions.'
    """
    text = text.strip().replace("+-", "±")
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
    """Signals that the residual is plotted against."""
    return [name.removeprefix("residual-") for name in figures if name.startswith("residual-")]


def conditions(runs: list[dict[str, Any]]) -> list[dict[str, Any]]:
    """Columns of the conditions that any run has, each with the decimals it needs."""
    known = []
    for key, name, unit in _CONDITIONS:
        values = [abs(run[key]) for run in runs if run[key] is not None]
        if values:
            digits = _PLAIN.decimals(max(values), 3)
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
    """Paths in the content of the same number of every entry.

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
    # Orders that are not retained in the table of evidence.
    return sorted({i for i, row in enumerate(rows) if row["retained"]} | set(others[:20]))


def gain_paths(findings: list[dict[str, Any]]) -> list[str]:
    """Paths in the content of the residual after each finding."""
    every = enumerate(findings)
    return [f"diagnosis.findings.{i}.gain.rms_after_arcsec" for i, f in every if f["gain"]]


def lookup(content: Any, path: str) -> Any:
    """The value at ``path``: keys and list indices joined by dots.

    Examples
    --------
    >>> lookup({"runs": [{"readings": 36}]}, "runs.0.readings")
    36
    """
    for key in path.split("."):
        content = content[int(key)] if isinstance(content, list) else content[key]
    return content


def formatted_number(value: float | None, digits: int) -> str:
    r"""A number as the page shows it; a dash for none.

    Examples
    --------
    >>> formatted_number(-0.004, 2), formatted_number(None, 2)
    ('0.00', '\u2013')
    """
    if value is None:
        return _NONE
    text = f"{value:.{digits}f}"
    return text.lstrip("-") if float(text) == 0.0 else text.replace("-", MINUS)


def shortened_list(lines: Sequence[str]) -> list[str]:
    """A list as a cell of a table shows it; a page is no place for hundreds of them.

    Examples
    --------
    >>> shortened_list([str(n) for n in range(100)])[-2:]
    ['5', 'and 94 more']
    """
    if len(lines) <= _MOST_LINES:
        return list(lines)
    return [*lines[:_SHOWN_LINES], f"and {len(lines) - _SHOWN_LINES} more"]


class Numbers:
    """Writes values of the content: errors in the unit of the page, other numbers as they are.

    Parameters
    ----------
    content : dict
        Every number of the page; errors in arcsec.
    """

    def __init__(self, content: dict[str, Any]) -> None:
        from markupsafe import Markup

        self._content = content
        shown = content["errors_in"]
        #: Unit of the errors.
        self.unit = ErrorUnit(shown["unit"], shown["per_arcsec"])
        self._mark = Markup('<span data-path="{}"{}>{}</span>')

    def plain(self, path: str, digits: int = 2, unit: str = "") -> Any:
        """A number that is no error."""
        return self._span(path, _PLAIN, digits, unit)

    def error(
        self, path: str, decimals: int | None = None, digits: int = _DIGITS, unit: bool = False
    ) -> Any:
        """An error to ``decimals``, or to ``digits`` significant digits."""
        value = lookup(self._content, path)
        if decimals is None:
            decimals = 0 if value is None else self.unit.decimals(value, digits)
        return self._span(path, self.unit, decimals, self.unit.name if unit else "")

    def measured(self, path: str, std: str, of: str, error: bool = True) -> Any:
        """``path`` or ``std`` (``of`` names which) to the decimals that ``std`` leaves."""
        unit = self.unit if error else _PLAIN
        value, spread = lookup(self._content, path), lookup(self._content, std)
        if spread is not None and math.isfinite(spread) and spread > 0.0:
            decimals = unit.decimals(spread)
        elif not error and value is not None and float(value).is_integer():
            decimals = 0  # an order
        else:
            decimals = 0 if value is None else unit.decimals(value, _DIGITS)
        return self._span(of, unit, decimals, "")

    def column(self, paths: Sequence[str]) -> int:
        """Decimals of a column of errors: its smallest keeps three digits."""
        values = [lookup(self._content, path) for path in paths]
        known = [abs(v) for v in values if v]
        return self.unit.decimals(min(known), _LEAST_DIGITS) if known else 0

    def listed(
        self, values: Sequence[float], stds: Sequence[float] | None, of: int, error: bool = True
    ) -> str:
        """Numbers of one parameter (``of`` 0) or their standard deviations (1)."""
        unit = self.unit if error else _PLAIN
        known = [None] * len(values) if stds is None else stds
        pairs = (
            (f"{v:g}", "-") if not error and float(v).is_integer() else unit.pair(v, std)
            for v, std in zip(values, known, strict=True)
        )
        shown = [pair[of] for pair in pairs]
        if set(shown) == {"-"}:
            return _NONE
        texts = shortened_list([text.replace("-", MINUS) for text in shown])
        # A stack is read next to that of the deviations; without them it is a list.
        return ("\n" if stds else ", ").join(texts)

    def named(self, unit: str) -> str:
        """A unit of the content as the page names it: arcsec/Nm becomes deg/Nm."""
        return unit.replace("arcsec", self.unit.name)

    def _span(self, path: str, of: ErrorUnit, digits: int, unit: str) -> Any:
        value = lookup(self._content, path)
        text = formatted_number(None if value is None else value * of.per_arcsec, digits)
        from markupsafe import Markup

        # Of most pages every number is as the content has it.
        per = "" if of.per_arcsec == 1.0 else Markup(f' data-per="{of.per_arcsec!r}"')
        span = self._mark.format(path, per, text)
        return span + (f"\u00a0{unit}" if unit and text != _NONE else "")
