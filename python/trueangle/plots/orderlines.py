"""What pictures of a spectrum show: size, interval and threshold of every order; draws nothing."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING, Final

import numpy as np

from ..fitting.orders.result import OrderSelection
from ..fitting.orders.table import IN_MODEL, OrderRow
from ..support.angles import ARCSEC_PER_TURN
from ..support.display_units import ErrorUnit, significant_digits
from .curves import CONFIDENCE

if TYPE_CHECKING:
    from ..fitting.result import FitResult

#: Orders stated in words.
_TOLD: Final = 6


@dataclass(frozen=True)
class OrderLine:
    """One order: amplitude, half width of its 95 % interval and threshold in arcsec; 0 for none.

    ``row`` is its evidence, where the orders were selected.
    """

    order: float
    amplitude: float
    half: float = 0.0
    limit: float = 0.0
    kept: bool = True
    row: OrderRow | None = None

    @property
    def aliases(self) -> tuple[float, ...]:
        """Orders that it may be as well (`likely_aliases`)."""
        return () if self.row is None or not self.row.aliases else likely_aliases(self.row)


def order_lines(result: OrderSelection | FitResult) -> list[OrderLine]:
    """All candidates of a selection, that of a fit too, or the orders of a fit; ascending.

    Orders that the travel does not separate have no size and are omitted.
    """
    selection = result if isinstance(result, OrderSelection) else result.selection
    if selection is not None:
        factor = ARCSEC_PER_TURN / selection.period
        needed = np.array([row.needed for row in selection.table])
        limits = np.nan_to_num(factor * needed, posinf=0.0)
        return [
            OrderLine(
                float(row.order),
                factor * row.amplitude,
                limit=float(limit),
                kept=row.verdict in IN_MODEL,
                row=row,
            )
            for row, limit in zip(selection.table, limits, strict=True)
            if math.isfinite(row.amplitude)
        ]
    assert not isinstance(result, OrderSelection)
    factor = ARCSEC_PER_TURN / result.model.period
    half = np.zeros(len(result.orders))
    if result.model.covariance is not None:
        half = CONFIDENCE * factor * result.amplitude_std
    return [
        OrderLine(float(result.orders[i]), factor * float(result.amplitudes[i]), float(half[i]))
        for i in np.argsort(result.orders)
    ]


def seen_sizes(lines: Sequence[OrderLine]) -> tuple[float, float]:
    """Least amplitude of a logarithmic axis and the greatest of what it has to show, arcsec."""
    kept = [line for line in lines if line.kept] or list(lines)
    seen = [size for line in lines if (size := line.limit) > 0.0]
    seen += [line.amplitude for line in kept if line.amplitude > 0.0]
    # Least amplitude of the logarithmic axis, as part of the smallest that must be visible.
    low = 0.4 * min(seen, default=1.0)
    return low, max([*(line.amplitude + line.half for line in lines), *seen, low])


def largest_orders_text(lines: Sequence[OrderLine], unit: ErrorUnit) -> str:
    """The largest orders kept with their amplitudes, and how many more there are."""
    kept = sorted((line for line in lines if line.kept), key=lambda line: -line.amplitude)
    told = [
        f"{line.order:g} ({significant_digits(unit.per_arcsec * line.amplitude, 3)} {unit.name})"
        for line in kept[:_TOLD]
    ]
    more = f" and {len(kept) - _TOLD} smaller ones" if len(kept) > _TOLD else ""
    return (", ".join(told) or "none") + more


def likely_aliases(row: OrderRow) -> tuple[float, ...]:
    """Aliases of an order, those that are known lines of the joint alone where there are any."""
    # Of several gears one line may be explained in several ways.
    known = dict.fromkeys(e.order for e in row.explanations if e.order != row.order)
    return tuple(known) or row.aliases
