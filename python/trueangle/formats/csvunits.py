"""Units of columns: a line of them under the names, and the preamble of TwinCAT's exports."""

from __future__ import annotations

import re
from collections.abc import Sequence

#: A name at the head of a time column of TwinCAT's exports, before the names it is for.
SCOPE = "Name"
#: What a line of units holds: units in brackets, or short words without digits.
_UNIT = r"[\[(].*[\])]|[^\d\s]{0,8}(?:/[^\d\s]{1,4}\d?)?|-"
# Compiled where a line asks for it: that takes longer than to read a small file.
_KNOWN_UNITS = (
    r"[\[(]?(deg(rees?)?|rad(ians?)?|turns?|rev(olutions?)?|counts?|arcsec|arcmin|[°\u2032\u2033\"']|"
    r"m?s|us|µs|ns|sec(onds?)?|volts?|m?v|m?a|[mc]?nm|n·?m|°?c|k|rpm|(deg|rad|turn|°)/s)[\])]?"
)
_BRACKETED = r"[\[(][^\])]*[\])]\s*$"


def units_of(cells: Sequence[str], width: int) -> list[str] | None:
    """Units of a line of units under so many names, or None for another line."""
    if abs(len(cells) - width) > 1 or not any(
        re.fullmatch(_KNOWN_UNITS, cell, re.IGNORECASE) for cell in cells
    ):
        return None
    if not all(re.fullmatch(_UNIT, cell) for cell in cells):
        return None
    return [cell.strip("[]() ") for cell in cells]


def names_with_units(names: list[str], between: Sequence[Sequence[str]]) -> list[str]:
    """Names with the units in brackets that lines between them and the readings state."""
    if names[0] == SCOPE and len(names) > 1:
        return _scope_names(names, {cells[0]: cells for cells in between}.get("Unit", ()))
    for cells in between:
        units = units_of(cells, len(names))
        if units is not None:
            names = [
                f"{name} [{unit}]" if unit and not re.search(_BRACKETED, name) else name
                for name, unit in zip(names, units, strict=False)
            ] + names[len(units) :]
    return names


def _scope_names(cells: Sequence[str], units: Sequence[str]) -> list[str]:
    """Names of TwinCAT's exports: a time column before each group of channels."""
    names, times = [], 0
    for i, cell in enumerate(cells):
        if cell == SCOPE:
            times += 1
            names.append("time [ms]" if times == 1 else f"time {times} [ms]")
        else:
            unit = units[i].partition(" ")[0] if i < len(units) else ""
            known = unit if unit not in ("", "(None)") else ""
            names.append(f"{cell} [{known}]" if known else cell)
    return names
