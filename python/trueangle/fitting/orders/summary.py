"""Rendering of a selection of orders as text."""

from __future__ import annotations

import math
import textwrap
from collections.abc import Sequence
from typing import TYPE_CHECKING

from ...support.angles import arcsec
from ...support.display_units import ErrorsIn, ErrorUnit, error_unit

if TYPE_CHECKING:
    from .table import OrderRow, OrderSelection

__all__ = ["summarise"]

#: Rejected orders listed beside the retained ones, the strongest first.
_REJECTED = 8
_WIDTH = 96


def summarise(selection: OrderSelection, errors_in: ErrorsIn = "auto") -> str:
    """Table of the orders, the reasons and the notes; see `OrderSelection.summary`."""
    period = selection.period
    noise = arcsec(selection.noise.standard_deviation, period)
    before, after = (arcsec(v, period) for v in selection.holdout_rms)
    sizes = [before, *(arcsec(row.amplitude, period) for row in selection.table)]
    unit = error_unit(errors_in, max(filter(math.isfinite, sizes), default=0.0), period)
    noise_std = noise / math.sqrt(2.0 * max(1.0, selection.noise.degrees_of_freedom))
    runs = f"{selection.runs} run{'s' if selection.runs != 1 else ''}"
    lines = [
        f"Orders of the angle error ({selection.method})",
        f"  {selection.samples} readings in {runs}, {selection.positions.describe()}",
        f"  noise of one reading  {unit.number(noise, noise_std)} {unit.name}, "
        f"from {_source(selection)}",
        f"  held-out rms          {unit.number(before)} -> {unit.number(after)} {unit.name} "
        f"({selection.holdout})",
    ]
    retained = [row for row in selection.table if row.retained]
    others = [row for row in selection.table if not row.retained and row.verdict != "alias"]
    others.sort(key=lambda row: row.log10_false_alarm)
    shown = sorted([*retained, *others[:_REJECTED]], key=lambda row: row.order)
    if shown:
        lines += ["", _HEADER, _units(unit), *(_line(row, period, unit) for row in shown)]
    hidden = len(selection.table) - len(shown)
    if hidden:
        lines.append(f"  ... and {hidden} weaker orders, not retained")
    lines.append("")
    if not retained:
        lines.append(f"NO ORDER RETAINED: {selection.reason}")
    lines += _explanations(retained)
    for row in selection.table:
        if row.doubtful or row.verdict == "reference":
            text = row.reason if row.doubtful else f"{row.order:g}: {row.reason}"
            lines += textwrap.wrap(f"! {text}", _WIDTH, subsequent_indent="  ")
    for note in selection.notes:
        lines += textwrap.wrap(f"note: {note}", _WIDTH, subsequent_indent="  ")
    return "\n".join(lines).rstrip()


_HEADER = (
    "  order   amplitude        +-   phase     +-  spread  false alarm  held-out gain  verdict"
)


def _units(unit: ErrorUnit) -> str:
    """Units of the first columns."""
    return f"        {unit.name:>11} {unit.name:>9}     deg    deg     deg"


def _line(row: OrderRow, period: float, unit: ErrorUnit) -> str:
    size, std = unit.pair(arcsec(row.amplitude, period), arcsec(row.standard_error, period))
    chance = f"{10.0**row.log10_false_alarm:.3g}"
    if -math.inf < row.log10_false_alarm < -3:
        chance = f"1e{math.floor(row.log10_false_alarm):d}"
    spread = f"{row.phase_spread_deg:6.0f}" if math.isfinite(row.phase_spread_deg) else "     -"
    return (
        f"  {row.order:>5g} {size:>11} {std:>9} {row.phase_deg % 360.0:7.1f} "
        f"{row.phase_error_deg:6.1f}  {spread} {chance:>12} {100.0 * row.holdout_gain:12.3g} %"
        f"  {row.verdict}"
    )


def _explanations(rows: Sequence[OrderRow]) -> list[str]:
    """What each retained order may be by itself; aliases are told with what they hinder."""
    lines = []
    for row in rows:
        names = [e.name for e in row.explanations if e.order == row.order and not e.assumed]
        if names:
            text = f"{row.order:g}: {'; or '.join(names)}"
            lines += textwrap.wrap(text, _WIDTH, initial_indent="  ", subsequent_indent="     ")
    return ["What they may be:", *lines, ""] if lines else []


def _source(selection: OrderSelection) -> str:
    noise = selection.noise
    what = {
        "repeats": "repeats at the same positions",
        "residual": "the residual of all candidates",
        "model": "the residual of the retained orders",
    }[noise.source]
    return f"{what} ({noise.degrees_of_freedom} degrees of freedom)"
