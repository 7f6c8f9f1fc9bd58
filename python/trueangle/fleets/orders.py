"""Orders worth keeping of a fleet: those that all units together support."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from ..errors import NoOrderError
from ..estimation.evidence import estimate_by_evidence
from ..fitting.orders.candidates import prior_probabilities
from ..fitting.orders.zerogroups import some_readings, zero_groups
from ..joint.joint import Joint
from ..joint.shafts import ShaftOrders, resolve_orders
from ..runs.run import CalibrationRun
from .calibration import normal_matrix, output_orders

#: Units by which orders are chosen: of the first so many.
SAMPLE: Final = 32

#: Orders of the output that are looked at, at most, and readings for each.
_HIGHEST: Final = 110
_READINGS_EACH: Final = 6

#: Orders that stay whether they stand out or not: eccentricity and tilt, where damage shows.
_ALWAYS: Final = (1, 2)

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
    """The candidates that units more probably share, or differ by, than not.

    The evidence of all units together decides (`trueangle.estimation.evidence`): what differs
    from unit to unit is what differs from run to run there. Orders 1 and 2 stay in any case.

    Raises
    ------
    NoOrderError
        The readings of no unit tell the lowest orders apart.
    """
    shafts = _told_apart(units, shafts)
    orders = output_orders(shafts)
    if all(sum(map(len, runs)) <= len(runs) + 2 * orders.size for runs in units):
        raise NoOrderError("the readings of no unit tell orders 1 and 2 apart: read more places")
    runs = [run for own in units for run in own]
    groups, _ = zero_groups(runs, whole=bool((orders == np.round(orders)).all()))
    looked = sorted(set(orders.tolist()))
    cycles = [shaft.cycles_per_turn for shaft in shafts]
    readings = [group.given() for group in some_readings(groups)]
    estimate = estimate_by_evidence(readings, looked, prior_probabilities(looked, cycles))
    present = set(estimate.present)
    found = []
    for shaft in shafts:
        kept = {*present, *_ALWAYS} if shaft.name == "output" else present
        own = [k for k in shaft.orders if k * shaft.cycles_per_turn in kept]
        if own:
            found.append(shaft._replace(orders=tuple(own)))
    return found


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
