"""Numbers as the page shows them, each marked with where it stands in the content."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import Any, Final

from ..support.display_units import ErrorUnit

#: Stands where there is no number.
NONE: Final = "\u2013"

#: Stands before negative numbers.
MINUS: Final = "\u2212"

#: Digits of an error that stands alone, and of the smallest of a column of them.
_DIGITS, _LEAST_DIGITS = 4, 3

#: Lines of a list in a cell at most; of a longer one so many are shown.
_MOST_LINES, _SHOWN_LINES = 12, 6

#: What a number that is no error is rounded by.
_PLAIN: Final = ErrorUnit("", 1.0)


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
        return NONE
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
        """An error to so many decimals, or to so many digits."""
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
            return NONE
        texts = shortened_list([text.replace("-", MINUS) for text in shown])
        # A stack is read beside that of the deviations; without them it is a list.
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
        return span + (f"\u00a0{unit}" if unit and text != NONE else "")
