"""Orders worth keeping of a fleet: what stands above the noise of its units together."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from ..errors import NoOrderError
from ..joint.joint import Joint
from ..joint.shafts import ShaftOrders, resolve_orders
from ..runs.run import CalibrationRun
from ..support.distributions import chi_squared_tail
from .calibration import Calibration, CalibrationSums, normal_matrix, output_orders

#: Units by which orders are chosen: of the first so many.
SAMPLE: Final = 32

#: Orders of the output that are looked at, at most, readings for each, and orders kept at most.
_HIGHEST: Final = 110
_READINGS_EACH: Final = 6
MOST_KEPT: Final = 24

#: Orders that stay whether they stand out or not: eccentricity and tilt, where damage shows.
_ALWAYS: Final = (1, 2)

#: Chance that an order is kept by noise alone, all candidates together.
_LEVEL: Final = 0.01

#: Least eigenvalue of the normal matrix, its columns scaled, with which orders are told apart.
_TOLD: Final = 1e-3


def candidate_orders(
    runs: Sequence[CalibrationRun], gear_ratio: float | None, fixed_member: str, shafts: object
) -> list[ShaftOrders]:
    """Orders of the output as the readings allow, and the lines that the gear is known to leave."""
    fewest = min(_distinct(run) for run in runs)
    highest = max(1, min(_HIGHEST, fewest // _READINGS_EACH))
    wanted: dict[str, list[float]] = {"output": list(range(1, highest + 1))}
    if gear_ratio is not None:
        for shaft, order in Joint(gear_ratio, fixed_member).gear_orders():
            wanted.setdefault(shaft, []).append(order)
    named = dict(shafts) if isinstance(shafts, dict) else {}
    for name in named:
        wanted[name] = [1, 2, 3, 4]
    found = resolve_orders(wanted, gear_ratio, fixed_member, named)
    seen = {float(k) for s in found if s.name == "output" for k in s.orders}
    kept = []
    for one in found:
        turns = one.cycles_per_turn
        own = [k for k in one.orders if one.name == "output" or k * turns not in seen]
        seen |= {k * turns for k in own}
        if own:
            kept.append(one._replace(orders=tuple(own)))
    return kept


def _distinct(run: CalibrationRun) -> int:
    """Places within a turn, to a ten-thousandth of it."""
    return int(np.unique(np.round(np.mod(run.reference, run.period) / run.period, 4)).size)


def worth_keeping(
    units: Sequence[Sequence[CalibrationRun]], shafts: Sequence[ShaftOrders]
) -> list[ShaftOrders]:
    """The candidates whose coefficients are more than the noise of all units together makes them.

    ::

        Σ_u ν_u log(1 + b_u' S_u⁻¹ b_u / ν_u) ~ χ²_2n

    for an order that no unit has, with the noise in S of each unit's own ν degrees of freedom
    (Fisher's sum of the logarithms of F's chances); 1 % for all candidates together (Bonferroni),
    the strongest 24.

    Raises
    ------
    NoOrderError
        The readings of no unit tell the lowest orders apart.
    """
    shafts = _told_apart(units, shafts)
    orders = output_orders(shafts)
    period = units[0][0].period
    periodic = bool((orders == np.round(orders)).all())
    statistic, freedom = np.zeros(orders.size), 0.0
    for runs in units:
        sums = CalibrationSums()
        for run in runs:
            sums.add(run, orders, periodic)
        found = Calibration.of("", sums, period)
        if found is None:
            continue
        pairs = found.coefficients.reshape(-1, 2)
        inverse = np.linalg.inv(found.blocks())
        noise = max(found.squares / found.freedom, 1e-300)
        squares = np.einsum("ki,kij,kj->k", pairs, inverse, pairs) / noise
        statistic += found.freedom * np.log1p(squares / found.freedom)
        freedom += 2.0
    if freedom == 0.0:
        raise NoOrderError("the readings of no unit tell orders 1 and 2 apart: read more places")
    chance = np.array([chi_squared_tail(float(x), freedom) for x in statistic])
    rank = np.argsort(np.argsort(-statistic))
    kept = (chance * orders.size <= _LEVEL) & (rank < MOST_KEPT)
    found_shafts, i = [], 0
    for shaft in shafts:
        own = [
            k
            for j, k in enumerate(shaft.orders)
            if kept[i + j] or (shaft.name == "output" and k in _ALWAYS)
        ]
        i += len(shaft.orders)
        if own:
            found_shafts.append(shaft._replace(orders=tuple(own)))
    return found_shafts


def _told_apart(
    units: Sequence[Sequence[CalibrationRun]], shafts: Sequence[ShaftOrders]
) -> list[ShaftOrders]:
    """As many of the output's lowest orders as the places of the first unit tell apart."""
    run = units[0][0]
    for highest in sorted(
        {k for s in shafts if s.name == "output" for k in s.orders}, reverse=True
    ):
        part = [
            s._replace(orders=tuple(k for k in s.orders if s.name != "output" or k <= highest))
            for s in shafts
        ]
        own = output_orders(part)
        if len(run) <= 2 * own.size + 1:
            continue
        products = normal_matrix(run.reference, own, run.period)
        if float(np.linalg.eigvalsh(products)[0]) * 2.0 / len(run) >= _TOLD:
            return [s for s in part if s.orders]
    return [s._replace(orders=s.orders[:1]) for s in shafts if s.name == "output"]
