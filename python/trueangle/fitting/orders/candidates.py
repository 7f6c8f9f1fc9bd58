"""Candidate orders of a selection, and how much false alarm each may use up."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final

import numpy as np

from ...errors import ArgumentError
from ...joint.gear import COMMON_RATIOS, HIGHEST_LOW_ORDER, gear_orders
from ...joint.shafts import limited_orders
from ...runs.aliasing import POSITION_TOLERANCE, Positions, distinct_positions, position_coherence
from ...runs.run import CalibrationRun
from ...support.arrays import Array

#: Low orders looked at when no gear is declared and the angles are free.
HIGHEST_FREE_ORDER: Final = 100

#: Harmonics of a declared shaft that are looked at.
SHAFT_HARMONICS: Final = (1, 2, 3, 4)

#: Orders scanned beyond the low ones where the angles are free.
HIGHEST_SCANNED: Final = 450


#: Orders of a shaft that errors are known to have, and how likely each is; what is fitted in any
#: case is certain but for rounding.
LIKELY: Final = 0.25

#: Side bands of a reference order: modulation by its eccentricity and tilt.
_SIDE_BANDS: Final = (-2, -1, 1, 2)


def declared_cycles(gear_ratio: float | None, shafts: Mapping[str, float] | None) -> list[float]:
    """Cycles per output turn of all shafts that were declared."""
    return [*(shafts or {}).values(), *(() if gear_ratio is None else (gear_ratio,))]


def are_whole(orders: Iterable[float]) -> bool:
    """Whether all orders are whole."""
    return all(float(k).is_integer() for k in orders)


@dataclass(frozen=True)
class Candidates:
    """Orders to look at.

    Attributes
    ----------
    orders : tuple of float
        All of them, ascending.
    main : frozenset of float
        Those looked at closely; the others are scanned.
    reference : tuple of float
        Orders of the reference itself, side bands included.
    carriers : tuple of float
        The reference orders as they were declared.
    gear_ratio : float or None
    fixed_member : str
    highest : int
        Nyquist limit of the positions for orders that are not named.
    effective : Positions
        The positions as a grid even where small shifts of the zero blur it.
    unresolved : mapping of float to float
        Orders of the gear that are not candidates, because over this travel they are hardly
        distinguishable from a low order, which represents both.
    shafts : mapping of str to float
        Further shafts that were declared, and their cycles per output turn.
    local : frozenset of float
        Of ``reference``: orders that a short single pass cannot distinguish from drift in time.
    """

    orders: tuple[float, ...]
    main: frozenset[float]
    reference: tuple[float, ...]
    carriers: tuple[float, ...]
    gear_ratio: float | None
    fixed_member: str
    highest: int
    effective: Positions
    unresolved: Mapping[float, float] = field(default_factory=dict)
    shafts: Mapping[str, float] = field(default_factory=dict)
    local: frozenset[float] = frozenset()

    @property
    def highest_alias(self) -> int:
        """Highest order listed as an alias: 4 motor turns' worth, at least 400."""
        ratio = max(COMMON_RATIOS) if self.gear_ratio is None else abs(self.gear_ratio)
        # Aliases are listed at least up to this order.
        return max(404, math.ceil(4.0 * ratio) + 4)

    @property
    def whole(self) -> bool:
        """Whether all orders are whole."""
        return are_whole(self.orders)

    @property
    def closed(self) -> bool:
        """Whether all shafts that were declared are back where they were after a turn."""
        return are_whole(declared_cycles(self.gear_ratio, self.shafts))

    @property
    def main_indices(self) -> list[int]:
        """Indices of the orders looked at closely."""
        return [i for i, k in enumerate(self.orders) if k in self.main]

    def probabilities(self) -> list[float]:
        """Of each order before any reading: one in five sets has an order without a known cause.

        Causes are known for orders 1, 2 and 4 of the output (eccentricity, tilt and the sensor's
        quadrature) and of the declared shafts.
        """
        cycles = declared_cycles(self.gear_ratio, self.shafts)
        return prior_probabilities(self.orders, cycles, self.reference)


def prior_probabilities(
    orders: Sequence[float], cycles: Sequence[float], fitted: Iterable[float] = ()
) -> list[float]:
    """Of each order, given the shafts' cycles per turn; those ``fitted`` are certain.

    Orders without a known cause are the likelier the lower they are among those of a shaft, as
    ``1 / k``: an error may have any scale. A wave generator turns once more than the motor.
    """
    turning = [t for f in map(abs, cycles) for t in (f, f + 1.0)]
    chances = {k: 1.0 / min([k, *(k / f for f in turning if k % f == 0.0)]) for k in orders}
    share = 0.2 / max(sum(chances.values()), 1.0)
    unknown = {k: min(LIKELY, share * chance) for k, chance in chances.items()}
    # Orders of a shaft that errors are known to have.
    reasons = {k * f for k in (1, 2, 4) for f in (1.0, *map(abs, cycles))}
    certain = set(fitted)
    # What is fitted in any case is certain but for rounding.
    return [1.0 - 1e-9 if k in certain else LIKELY if k in reasons else unknown[k] for k in orders]


def _effective_positions(positions: Positions) -> Positions:
    """Positions as a grid even where small shifts of the zero blur it.

    Unnamed orders are looked for only below the Nyquist limit of that grid.
    """
    if positions.divisions is not None:
        return positions
    once = CalibrationRun(positions.turns, positions.turns, period=1.0)
    for widening in (10.0, 100.0):
        blurred = distinct_positions(once, widening * POSITION_TOLERANCE)
        if blurred.divisions is not None and len(blurred) < len(positions):
            return blurred
    return positions


def choose_candidates(
    positions: Positions,
    candidates: Iterable[float] | None,
    gear_ratio: float | None,
    fixed_member: str,
    reference_orders: Sequence[float],
    travelled: Array | None = None,
    shafts: Mapping[str, float] | None = None,
    held_from: float = 0.0,
) -> Candidates:
    """Candidates as requested, or low orders, the gear's own and a scan.

    ``travelled`` are angles of the readings in turns, whole turns kept: they show how far an
    order that is not whole can be distinguished from its neighbours. Undeclared orders below
    ``held_from`` are fitted jointly and not kept.

    Raises
    ------
    ArgumentError
        Orders that are not positive and finite.
    """
    gear = [] if gear_ratio is None else [float(m) for m in gear_orders(gear_ratio, fixed_member)]
    gear += [k * float(f) for f in (shafts or {}).values() for k in SHAFT_HARMONICS]
    effective = _effective_positions(positions)
    highest = effective.highest_order
    if effective.divisions is None:
        highest = min(highest, math.floor((len(positions) - 1) / (2.0 * positions.span)))
    carriers = tuple(_checked(reference_orders, "reference_orders"))
    reference = sorted(
        {k + s for k in carriers for s in (0, *_SIDE_BANDS) if k + s > max(_SIDE_BANDS)}
        | set(carriers)
    )
    scanned: list[float] = []
    unresolved: dict[float, float] = {}
    if candidates is not None:
        main = _checked(candidates, "candidates")
    else:
        unresolved = _unresolved(gear, min(HIGHEST_LOW_ORDER, highest), travelled)
        told = [m for m in gear if m not in unresolved]
        # A gear none of whose orders can be determined does not narrow the search.
        limit = HIGHEST_LOW_ORDER if told else HIGHEST_FREE_ORDER
        main = [float(k) for k in range(1, min(limit, highest) + 1)]
        for m in told:
            if m not in main and _apart(positions, m, main):
                main.append(m)
        if positions.span == 1.0:
            top = min(HIGHEST_SCANNED, highest)
            scanned = [float(k) for k in range(1, top + 1) if float(k) not in main]
    local: list[float] = []
    if candidates is None and held_from > 0.0:
        local = [k for k in main if k < held_from and k not in gear]
        main, scanned = [k for k in main if k not in local], []
        reference = sorted({*reference, *local})
    orders = sorted({*main, *scanned, *reference})
    tidy = tuple(int(k) if k.is_integer() else k for k in orders)
    return Candidates(
        orders=tidy,
        main=frozenset({*main, *reference}),
        reference=tuple(reference),
        carriers=carriers,
        gear_ratio=gear_ratio,
        fixed_member=fixed_member,
        highest=highest,
        effective=effective,
        unresolved=unresolved,
        shafts=dict(shafts or {}),
        local=frozenset(local),
    )


def _unresolved(gear: Sequence[float], low: int, travelled: Array | None) -> dict[float, float]:
    """Orders of the gear that the travel hardly separates from a low order, and that order."""
    found: dict[float, float] = {}
    if travelled is None:
        return found
    for m in gear:
        nearest = min(max(round(m), 0), low)
        alike = abs(np.exp(2j * math.pi * (m - nearest) * travelled).mean())
        # Coherence from which two orders are hardly separated: they come half a cycle apart over
        # the travel. Fitted jointly they nearly cancel, and differ again where nothing was read.
        if not m.is_integer() and alike > 2.0 / math.pi:
            found[m] = float(nearest)
    return found


def _apart(positions: Positions, order: float, others: Sequence[float]) -> bool:
    """Whether the positions distinguish ``order`` from the constant and from all of ``others``."""
    # Coherence from which two orders are one at the positions, whatever the noise.
    return bool(position_coherence(positions, order, [0.0, *others]).max() < 1.0 - 1e-9)


def _checked(orders: Iterable[float], name: str) -> list[float]:
    found = []
    for k in limited_orders(orders, name):
        value = float(k)
        if not (math.isfinite(value) and value > 0.0):
            raise ArgumentError(f"{name} must be positive orders, got {k!r}")
        found.append(value)
    return sorted(set(found))
