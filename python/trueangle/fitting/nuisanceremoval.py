"""Nuisances fitted jointly with the pattern and taken out of the runs.

What remains is fitted as usual: the pattern is that of one joint fit (Frisch and Waugh).
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import replace
from typing import Final

import numpy as np

from ..errors import ArgumentError
from ..joint.shafts import ShaftOrders, shaft_cycles
from ..runs.run import CalibrationRun
from ..support.arrays import Array
from .nuisance import KINDS, Nuisance
from .nuisancechoice import (
    FoldRows,
    best_spline,
    choose_nuisance_groups,
    error_inflation,
    reference_lines_help,
    solve_with_groups,
)
from .nuisancecolumns import looked_at_stride, nuisance_columns, time_spline

#: Orders of each shaft that are fitted jointly while nuisances are searched.
_LIKELY: Final = tuple(range(1, 9))

_MISSING: Final = {
    "ramp": "nuisance 'ramp' needs travel",
    "direction": "nuisance 'direction' needs runs that reverse: one in a single direction "
    "has it in its zero",
    "velocity": "nuisance 'velocity' needs time or velocity in every run, and runs that change "
    "their speed: one at a single speed has it in its zero",
    "drift": "nuisance 'drift' needs time in every run (at most 24 runs)",
}


def orders_beside_nuisance(
    runs: Sequence[CalibrationRun],
    gear_ratio: float | None,
    fixed_member: str,
    shafts: Mapping[str, float] | None,
) -> list[ShaftOrders]:
    """Orders fitted jointly while nuisances are searched, before any orders are chosen.

    Those that come at least half a cycle over the travel: lower ones are a ramp there.
    """
    travel = max(float(np.ptp(run.unwrapped_reference)) for run in runs) / runs[0].period
    cycles = shaft_cycles(gear_ratio, fixed_member) | dict(shafts or {})
    return [
        ShaftOrders(name, float(f), orders)
        for name, f in cycles.items()
        if (orders := tuple(k for k in _LIKELY if k * f * travel >= 0.5))
    ]


def take_out_nuisance_beside(
    runs: Sequence[CalibrationRun],
    kinds: tuple[str, ...] | None,
    wanted: Sequence[ShaftOrders],
    likely: Sequence[ShaftOrders],
    argument: str,
    reference_orders: Sequence[float] = (),
) -> tuple[list[CalibrationRun], Nuisance]:
    """`take_out_nuisance` for the wanted orders, the kinds chosen jointly with the likely ones too.

    The residual of an order that is not in the model is no ramp, though a ramp lowers it.
    """
    if kinds is not None:
        return take_out_nuisance(runs, kinds, wanted, argument, reference_orders)
    both = {s.name: s for s in likely}
    for shaft in wanted:
        more = both[shaft.name].orders if shaft.name in both else ()
        both[shaft.name] = shaft._replace(orders=tuple(sorted({*shaft.orders, *more})))
    _, first = take_out_nuisance(runs, None, list(both.values()), argument, reference_orders)
    chosen = tuple(kind for kind in first.kinds if kind in KINDS)
    cleaned, taken = take_out_nuisance(runs, chosen, wanted, argument, reference_orders)
    return cleaned, replace(taken, shares=first.shares, unseparated=first.unseparated)


def take_out_nuisance(
    runs: Sequence[CalibrationRun],
    kinds: tuple[str, ...] | None,
    shafts: Sequence[ShaftOrders],
    argument: str,
    reference_orders: Sequence[float] = (),
) -> tuple[list[CalibrationRun], Nuisance]:
    """The runs without their nuisances, which are fitted jointly with these orders.

    With ``kinds`` None they are chosen by the error of held-out segments.
    """
    stride = looked_at_stride(runs)
    orders = [k * s.cycles_per_turn for s in shafts for k in s.orders]
    rows = nuisance_columns(runs, orders, argument, stride, kinds, reference_orders)
    forced = [_lines_of_reference(rows)] if reference_orders else []
    shares: list[tuple[str, float]] = []
    unseparated: list[str] = []
    if kinds is None:
        chosen, shares, unseparated = choose_nuisance_groups(rows, forced)
    else:
        missing = [k for k in kinds if not any(name.startswith(k) for name in rows.groups)]
        if missing:
            raise ArgumentError(_MISSING[missing[0]])
        named = [name for name in rows.groups if name in kinds]
        chosen = [*forced, *named]
        if "drift" in kinds:
            chosen.append(best_spline(rows, chosen))
    if not chosen:
        return list(runs), Nuisance(unseparated=tuple(unseparated))
    found = solve_with_groups(rows, chosen)
    nuisance = Nuisance(
        kinds=tuple(name.rstrip("0123456789") for name in chosen),
        slope=float(found["ramp"][0]) if "ramp" in found else 0.0,
        half_width=float(found["direction"][0]) if "direction" in found else 0.0,
        delay=float(found["velocity"][0]) if "velocity" in found else 0.0,
        intervals=next((int(n[5:]) for n in chosen if n.startswith("drift")), 0),
        reference=tuple(
            (float(k), *found["reference"][2 * i : 2 * i + 2].tolist())
            for i, k in enumerate(reference_orders)
        )
        if "reference" in found
        else (),
        turned=_one_amplitude(found["turned"], reference_orders, len(runs))
        if "turned" in found
        else (),
        shares=tuple(shares),
        unseparated=tuple(unseparated),
        inflation=tuple(error_inflation(rows, chosen)),
    )
    drifts = next((found[n] for n in chosen if n.startswith("drift")), None)
    return [_without(run, i, nuisance, drifts) for i, run in enumerate(runs)], nuisance


def _lines_of_reference(rows: FoldRows) -> str:
    """Whether the lines of the reference are the same in every run, or are new in each.

    The other group leaves the rows.
    """
    name = "turned" if "turned" in rows.groups and reference_lines_help(rows) else "reference"
    rows.groups.pop("reference" if name == "turned" else "turned", None)
    return name


def _one_amplitude(
    found: Array, orders: Sequence[float], runs: int
) -> tuple[tuple[float, float, tuple[float, ...]], ...]:
    """``(order, amplitude, phases)`` of ``A, B`` of every run: the mean amplitude for all."""
    a, b = np.moveaxis(found.reshape(runs, len(orders), 2), 2, 0)
    phases, sizes = np.arctan2(a, b), np.hypot(a, b).mean(axis=0)
    return tuple(
        (float(order), float(sizes[i]), tuple(phases[:, i].tolist()))
        for i, order in enumerate(orders)
    )


def _without(
    run: CalibrationRun, index: int, nuisance: Nuisance, drifts: Array | None
) -> CalibrationRun:
    error = nuisance.predict(run)
    for order, a, b in nuisance.reference:
        x = 2.0 * np.pi * order / run.period * run.reference
        error += a * np.cos(x) + b * np.sin(x)
    for order, amplitude, phases in nuisance.turned:
        x = 2.0 * np.pi * order / run.period * run.reference
        error += amplitude * np.sin(x + phases[index])
    if drifts is not None and run.time is not None:
        width = nuisance.intervals + 2
        mine = drifts[index * width : (index + 1) * width]
        error += time_spline(run.time, run.time, nuisance.intervals) @ mine
    return replace(run, indicated=run.indicated - error)
