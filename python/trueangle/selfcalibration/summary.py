"""A self-calibration as text."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from ..support.display_units import ErrorsIn, ErrorUnit, error_unit
from ..support.layout import laid_out, wrapped

if TYPE_CHECKING:
    from .result import OrderEstimate, SelfCalibration

__all__ = ["listed", "ranges", "selfcal_summary"]


def listed(orders: Sequence[float]) -> str:
    """What is blind, in words: orders, or the zero."""
    return f"orders {ranges(orders)}" if any(orders) else "zero"


def selfcal_summary(result: SelfCalibration, errors_in: ErrorsIn = "auto") -> str:
    """Numbers, what they are numbers of, what is blind, tests, notes."""
    sizes = [result.noise_arcsec, *(o.amplitude for o in (*result.orders, *result.sums))]
    period = result.model.period
    unit = error_unit(errors_in, max(filter(math.isfinite, sizes), default=0.0), period)
    lines = [
        f"calibrated without a reference ({result.method}): {result.readings} readings, "
        f"{result.turns:.1f} turns, noise {unit.text(result.noise_arcsec)}",
    ]
    if result.orders:
        lines += ["", *_table(result.orders, unit)]
    if result.sums:
        lines += ["", "not the encoder's alone:", *_table(result.sums, unit)]
    lines += ["", "cannot be identified"]
    for blind in result.blind:
        lines += wrapped(f"{listed(blind.orders)}: {blind.because}", 4, 2)
        lines += wrapped(f"to see it: {blind.measure}", 6, 4)
    if result.held_out:
        lines += ["", "held out"]
        for test in result.held_out.values():
            verb = "predict" if test.fitted_on.endswith("s") else "predicts"
            agree = "agree" if test.p > 0.001 else "DISAGREE"
            lines.append(
                f"  {test.fitted_on} {verb} {test.judged_on}: {unit.number(test.rms_before)} -> "
                f"{unit.number(test.rms_after)} {unit.name} rms, they {agree} (p = {test.p:.2g})"
            )
    lines += [f"note: {note}" for note in result.notes]
    return laid_out(lines)


def _table(orders: tuple[OrderEstimate, ...], unit: ErrorUnit) -> list[str]:
    names = {o.of for o in orders} != {"the encoder"}
    lines = [
        f"   order  {f'amplitude/{unit.name}':>16}      +-  phase/deg  retained  factor"
        + ("  of" if names else "")
    ]
    for o in orders:
        size, std = unit.pair(o.amplitude, o.std)
        lines.append(
            f"{o.order:8g} {size:>17} {std:>7} {o.phase_deg:10.2f} {o.retained:9.3f} "
            f"{o.std_factor:7.2f}" + (f"  {o.of}" if names else "")
        )
    return lines


def ranges(orders: Sequence[float]) -> str:
    """Orders in words: ``1-4, 8``.

    Examples
    --------
    >>> ranges([1, 2, 3, 4, 8, 7.3])
    '1-4, 7.3, 8'
    """
    parts: list[str] = []
    run: list[float] = []
    for order in [*sorted(orders), math.inf]:
        if run and (order != run[-1] + 1.0):
            parts.append(
                f"{run[0]:g}-{run[-1]:g}" if len(run) > 2 else ", ".join(f"{k:g}" for k in run)
            )
            run = []
        run.append(order)
    return ", ".join(parts)
