"""A fleet as text: the units that need attention, then what all share."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..support.angles import arcsec
from ..support.display_units import ErrorsIn, ErrorUnit, error_unit
from ..support.layout import laid_out
from ..support.plainresult import counted

if TYPE_CHECKING:
    from .result import Fleet

__all__ = ["fleet_summary"]

_TESTED = (
    "  p: chance that a sound unit is as far from the other units or, where it moved, has changed "
    "as much; reported below the limit, which one fleet of sound units in a hundred passes"
)

#: Units that are fine of which the sizes are listed.
_LISTED = 12


def fleet_summary(fleet: Fleet, errors_in: ErrorsIn = "auto") -> str:
    """See `Fleet.summary`."""
    scale = arcsec(1.0, fleet.period)
    largest = scale * max((unit.peak_to_peak for unit in fleet.units), default=0.0)
    shown = error_unit(errors_in, largest, fleet.period)
    odd = [unit for unit in fleet.units if unit.verdict != "fine"]
    verb = "needs" if len(odd) <= 1 else "need"
    lines = [f"{counted(fleet.units, 'unit')}; {len(odd) or 'none'} {verb} attention", ""]
    width = max([4, *(len(unit.unit) for unit in fleet.units)])
    told = [unit for unit in fleet.units if unit.because]
    for unit in told:
        lines.append(f"  {unit.unit:<{width}}  {unit.verdict:<11}  {shown.spoken(unit.because)}")
    if told:
        lines.append("")
    lines += [
        f"  {'unit':<{width}}  verdict      peak-to-peak      left        p    limit",
        f"  {'':<{width}}  {'':<11}  {shown.name:>12} {shown.name:>9}",
    ]
    listed = fleet.units[: len(odd) + _LISTED]
    for unit in listed:
        sizes = (shown.number(scale * v) for v in (unit.peak_to_peak, unit.left))
        size, left = sizes
        lines.append(
            f"  {unit.unit:<{width}}  {unit.verdict:<11}  {size:>12} {left:>9}  {unit.p:7.2g} "
            f"{unit.limit:8.2g}"
        )
    if len(listed) < len(fleet.units):
        lines.append(f"  and {len(fleet.units) - len(listed)} that are fine")
    lines += ["", _TESTED, "", *_orders(fleet, shown, scale), "", _tolerance(fleet, shown, scale)]
    lines += _calendar(fleet, shown, scale, width)
    if fleet.notes:
        lines += ["", *(f"  [{i}] {note}" for i, note in enumerate(fleet.notes, 1))]
    return laid_out(lines)


def _orders(fleet: Fleet, shown: ErrorUnit, scale: float) -> list[str]:
    shared = "the mean of the units" if fleet.aligned else "none: the units share no direction"
    lines = [f"  common pattern: {shared}", "   order      common  between units  repeatability"]
    for common, between in zip(fleet.common, fleet.between, strict=True):
        again = (
            "-" if between.repeatability is None else shown.number(scale * between.repeatability)
        )
        lines.append(
            f"  {common.order:6g}  {shown.number(scale * common.amplitude):>10}  "
            f"{shown.number(scale * between.std):>13}  {again:>13}"
        )
    return [*lines, f"  (standard deviations of cosine and sine, {shown.name})"]


def _tolerance(fleet: Fleet, shown: ErrorUnit, scale: float) -> str:
    bound = fleet.tolerance
    if bound.method == "none":
        return "  tolerance limits need two units at least"
    how = (
        "by ranks, whatever the distribution"
        if bound.method == "wilks"
        else f"for normal logarithms, factor {bound.factor:.4g}"
    )
    return (
        f"  {100 * bound.share:g} % of units stay below {shown.text(scale * bound.peak_to_peak)} "
        f"peak-to-peak and {shown.text(scale * bound.left)} left after correction, with "
        f"{100 * bound.confidence:g} % confidence ({how})"
    )


def _calendar(fleet: Fleet, shown: ErrorUnit, scale: float, width: int) -> list[str]:
    """When the units are due, the first first; those far off in one line."""
    due = sorted(
        (row for row in fleet.history if row.next_calibration is not None),
        key=lambda row: row.next_calibration or "",
    )
    if not due:
        return []
    lines = ["", "  next calibration (a drift at its 95 % bound reaches the permitted error)"]
    for row in due:
        if not row.extrapolated:
            bound = shown.text(scale * (row.bound or 0.0))
            lines.append(
                f"  {row.unit:<{width}}  {row.next_calibration}  changed by {bound} at most until "
                f"{row.when[:10]}"
            )
    far = [row for row in due if row.extrapolated]
    if far:
        lines.append(
            f"  {counted(far, 'unit')} from {far[0].next_calibration} ({far[0].unit}) on: "
            "extrapolated beyond twice the time seen"
        )
    return lines
