"""A model in words: in one line, and its summary."""

from __future__ import annotations

import math

from ..support.angles import arcsec, unit_name
from ..support.display_units import error_unit, sine_of_rms
from ..support.layout import laid_out, wrapped_lines
from .errormodel import ErrorModel

#: Lines that a summary lists before it says how many more there are.
_LISTED = 40

#: Names that one line lists, and their letters.
_NAMED, _LETTERS = 4, 24


def model_line(model: ErrorModel) -> str:
    """What the model is, in one line of a screen."""
    lines = len(model.orders)
    parts = [
        f"{lines} {'order' if lines == 1 else 'orders'}"
        + (f" of {_listed([shaft.name for shaft in model.shafts])}" if model.shafts else ""),
        f"period {model.period:g}",
        f"argument {model.argument}",
    ]
    if model.terms:
        parts.append(f"with {_listed([term.kind for term in model.terms])}")
    return f"<HarmonicModel: {', '.join(parts)}>"


def model_summary(model: ErrorModel) -> str:
    """The harmonics by shaft and order, in arcseconds, and what is known of the fit."""
    period, unit = model.period, unit_name(model.period)
    rms = math.sqrt(0.5 * float(model.amplitudes @ model.amplitudes))
    shown = error_unit("auto", sine_of_rms(arcsec(rms, period)))
    lines = [
        *wrapped_lines(model_line(model)[1:-1], 2),
        f"constant {model.constant:.6g} {unit}, {arcsec(model.constant, period):.6g} arcsec",
        f"{'shaft':16s} {'order':>10s} {f'amplitude, {shown.name}':>18s} {'phase, deg':>11s}",
    ]
    rows = [
        f"{shaft.name:16.16s} {k:10d} {shown.number(arcsec(c, period)):>18} "
        f"{math.degrees(p) % 360.0:11.2f}"
        for shaft in model.shafts
        for k, c, p in zip(shaft.orders, shaft.amplitudes, shaft.phases, strict=True)
    ]
    lines += rows[:_LISTED]
    if len(rows) > _LISTED:
        lines.append(f"... and {len(rows) - _LISTED} more")
    if model.fit is not None:
        start, stop = model.fit.span
        lines.append(
            f"fitted to {model.fit.samples} readings of {model.fit.runs} runs "
            f"between {start:.6g} and {stop:.6g} {unit}"
        )
    return laid_out(lines)


def _listed(names: list[str]) -> str:
    more = f" and {len(names) - _NAMED} more" if len(names) > _NAMED else ""
    return ", ".join(name[:_LETTERS] for name in names[:_NAMED]) + more
