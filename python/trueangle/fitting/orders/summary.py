"""A selection of orders as text and as plain values."""

from __future__ import annotations

import math
from typing import Any, Final

from ...estimation.evidence import CORRELATION_TIMES
from ...support.angles import arcsec
from ...support.display_units import ErrorsIn, ErrorUnit, error_unit, rounded_phase, sine_of_rms
from ...support.layout import counted, laid_out, order_ranges, wrapped_lines
from ...support.plainresult import finite_or_none, plain_fields
from .table import FIRST, IN_MODEL, UNDETERMINED, OrderRow, OrderTable


def selection_summary(selection: OrderTable, errors_in: ErrorsIn = "auto") -> str:
    """Table of the orders, the reasons and the notes; see `OrderSelection.summary`."""
    period = selection.period
    noise = arcsec(selection.noise.standard_deviation, period)
    before, after = (arcsec(v, period) for v in selection.holdout_rms)
    unit = selection_error_unit(selection, errors_in)
    noise_std = noise / math.sqrt(2.0 * max(1.0, selection.noise.degrees_of_freedom))
    retained = [row for row in selection.table if row.verdict in IN_MODEL]
    head = [f"NO ORDER RETAINED: {selection.reason}."]
    if retained:
        sizes = f"{unit.number(before)} -> {unit.text(after)} rms{', no lower' * (after >= before)}"
        head = [f"{counted(retained, 'order')} retained: held-out error {sizes} "]
        head[0] += f"({selection.holdout}); next: `ta.fit(...)`."
    read = f"{counted(selection.samples, 'reading')} in {counted(selection.runs, 'run')}"
    notes = [note for note in selection.notes if note.startswith(FIRST)]
    doubts = [f"Order {row.reason}" for row in selection.table if row.doubtful]
    head += [f"{text}." for text in doubts + notes]
    # What is not determined is the answer.
    lines = sorted(head, key=lambda line: not line.startswith(UNDETERMINED))
    lines.append(f"  {read}, {selection.positions.describe()}")
    if selection.table:
        size = f"{unit.number(noise, noise_std)} {unit.name}"
        lines.append(f"  noise of one reading  {size}{_source(selection, unit)}")
    others = [row for row in selection.table if row not in retained and row.verdict != "alias"]
    others.sort(key=lambda row: row.log10_false_alarm)
    # Rejected orders listed in addition to the retained ones, the strongest first.
    shown = sorted([*retained, *others[:8]], key=lambda row: row.order)
    if shown:
        lines += ["", _HEADER, _units(unit), *(_line(row, period, unit) for row in shown)]
    hidden = len(selection.table) - len(shown)
    if hidden:
        lines.append(f"  ... and {counted(hidden, 'weaker order')}, not retained")
    if shown:
        lines += wrapped_lines(_LEGEND, 2, 2)
        reasons = {row.verdict: row.reason for row in shown if row.verdict not in _PLAIN}
        for verdict, reason in reasons.items():
            if reason not in selection.reason:
                lines += wrapped_lines(f"{verdict}: {reason}", 2, 2)
    lines += ["", *_explanations(selection)]
    for row in selection.table:
        if row.verdict == "reference":
            lines += wrapped_lines(f"! {row.order:g}: {row.reason}", 2)
    for note in (note for note in selection.notes if note not in notes):
        lines += wrapped_lines(f"note: {note}", 2)
    return laid_out(lines).rstrip()


def selection_error_unit(selection: OrderTable, errors_in: ErrorsIn = "auto") -> ErrorUnit:
    """One unit for tables and plots of a selection, by the rms before correction."""
    before = arcsec(selection.holdout_rms[0], selection.period)
    return error_unit(errors_in, sine_of_rms(before), selection.period)


#: Verdicts whose name is the reason, and that of which each row has a line.
_PLAIN: Final = ("retained", "noise", "negligible", "reference")

_COLUMNS: Final = "  {:>5} {:>9} {:>7} {:>7} {:>5} {:>6} {:>11} {:>8}  {}"
_HEADER: Final = _COLUMNS.format(
    "order", "amplitude", "+-", "phase", "+-", "range", "probability", "held out", "verdict"
)

_LEGEND: Final = (
    "range: of the phase over the runs; gain: share of the mean square error that the order "
    "removes from readings not fitted"
)


def _units(unit: ErrorUnit) -> str:
    """Units of the first columns."""
    named = ("", unit.name, unit.name, "deg", "deg", "deg", "", "gain, %", "")
    return _COLUMNS.format(*named).rstrip()


def _line(row: OrderRow, period: float, unit: ErrorUnit) -> str:
    size, std = unit.pair(arcsec(row.amplitude, period), arcsec(row.standard_error, period))
    chance = f"{row.probability:.3f}" if math.isfinite(row.probability) else "-"
    spread = f"{row.phase_spread_deg:.0f}" if math.isfinite(row.phase_spread_deg) else "-"
    phase, phase_std = rounded_phase(row.phase_deg, row.phase_error_deg)
    gain = f"{100.0 * row.holdout_gain:z.1f}"
    order = f"{row.order:g}"
    return _COLUMNS.format(order, size, std, phase, phase_std, spread, chance, gain, row.verdict)


def _explanations(selection: OrderTable) -> list[str]:
    """Possible causes of each retained order; its aliases are reported separately."""
    known = {
        row.order: [e.name for e in row.explanations if e.order == row.order and not e.assumed]
        for row in selection.table
        if row.retained
    }
    told = [f"{order:g}: {'; or '.join(names)}" for order, names in known.items() if names]
    if unknown := [order for order, names in known.items() if not names]:
        gear = "" if selection.gear_ratio else "; with a gear, state its ratio: `gear_ratio=R`"
        told.append(f"{order_ranges(unknown)}: no known cause{gear}")
    lines = [line for text in told for line in wrapped_lines(text, 5, 2)]
    return ["What they may be:", *lines, ""] if lines else []


def _source(selection: OrderTable, unit: ErrorUnit) -> str:
    """How the noise was estimated, or its parts in a reading."""
    noise = selection.noise
    if selection.estimate is not None:
        white, *drifts = (arcsec(math.sqrt(v), selection.period) for v in selection.estimate.within)
        longest = max(len(run.theta) for run in selection.estimate.runs)
        # Least share of the noise's standard deviation from which a part of it is reported.
        least = 0.2 * arcsec(noise.standard_deviation, selection.period)
        parts = [
            f"{unit.text(size)} correlated over {min(length, longest):g} readings"
            for size, length in zip(drifts, CORRELATION_TIMES, strict=True)
            if size > least
        ]
        return f": {', '.join([f'white {unit.text(white)}', *parts])}" if parts else ", white"
    repeats = "repeats at the same positions"
    what = repeats if noise.source == "repeats" else "the residual of all candidates"
    return f", from {what} ({counted(noise.degrees_of_freedom, 'degree')} of freedom)"


def plain_selection(selection: OrderTable) -> dict[str, Any]:
    """The selection with angles in arcsec; what is not a number becomes None."""
    scale = arcsec(1.0, selection.period)
    before, after = selection.holdout_rms
    return {
        "distinct_positions": len(selection.positions),
        "positions": selection.positions.describe(),
        **plain_fields(selection, "samples runs method argument"),
        "noise_arcsec": finite_or_none(scale * selection.noise.standard_deviation),
        "noise_source": selection.noise.source,
        "holdout": selection.holdout,
        "holdout_rms_before_arcsec": finite_or_none(scale * before),
        "holdout_rms_after_arcsec": finite_or_none(scale * after),
        **plain_fields(selection, "reason notes"),
        "orders": [_row(row, scale) for row in selection.table],
    }


def _row(row: OrderRow, scale: float) -> dict[str, Any]:
    phase = "phase_std_deg=phase_error_deg phase_spread_deg"
    return {
        **plain_fields(row, "order retained verdict probability"),
        "amplitude_arcsec": finite_or_none(scale * row.amplitude),
        "phase_deg": finite_or_none(row.phase_deg % 360.0),
        "std_arcsec": finite_or_none(scale * row.standard_error),
        **plain_fields(row, f"{phase} log10_false_alarm holdout_gain aliases"),
        "explanations": [str(e) for e in row.explanations],
        "reason": row.reason,
    }
