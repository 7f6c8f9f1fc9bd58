"""The choice of orders itself: candidates, evidence, and what is known about the joint."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Literal, TypeAlias

import numpy as np

from ...errors import ArgumentError
from ...joint.shafts import limited_orders
from ...runs.aliasing import distinct_positions
from ...runs.run import CalibrationRun
from ...runs.travel import held_orders, over_turns
from ...support.arrays import Array
from ...support.blas import one_blas_thread
from ...support.suggestions import check_choice
from ..argument import AnyArgument, choose_argument, run_at_indicated
from .candidates import are_whole, choose_candidates, declared_cycles
from .result import OrderSelection
from .selection import EvidenceSelection

if TYPE_CHECKING:
    from ..summed import SummedReadings

Method: TypeAlias = Literal["evidence", "paper"]


@one_blas_thread()
def selected_orders(
    found: Sequence[CalibrationRun],
    candidates: Iterable[float] | None = None,
    gear_ratio: float | None = None,
    fixed_member: str = "circular_spline",
    method: Method = "evidence",
    *,
    argument: AnyArgument = "auto",
    shafts: Mapping[str, float] | None = None,
    nuisance: str | Iterable[str] = "none",
    reference_orders: Iterable[float] = (),
    tolerance: float | None = None,
    summed: SummedReadings | None = None,
) -> OrderSelection:
    """As `trueangle.select_orders`; with ``summed`` of all readings of which the runs are some."""
    check_choice("method", method, ("evidence", "paper"))
    kept = [run for run in map(_without_zero_weights, found) if run is not None]
    if not kept:
        raise ArgumentError("all readings have weight 0; give positive weights")
    said: tuple[str, ...] = ()
    lines = tuple(map(float, limited_orders(reference_orders, "reference_orders")))
    kinds: tuple[str, ...] | None = ()
    if nuisance != "none":
        from ..nuisance import asked_nuisance

        kinds = asked_nuisance(nuisance)
    if kinds != () or (lines and len(kept) > 1):
        from ..nuisanceremoval import orders_beside_nuisance, take_out_nuisance

        likely = orders_beside_nuisance(kept, gear_ratio, fixed_member, shafts)
        angle = "indicated" if argument == "indicated" else "reference"
        cleaned, taken = take_out_nuisance(
            kept, kinds, likely, angle, lines if len(kept) > 1 else ()
        )
        if lines and not taken.turned:
            # Lines that are the same in every run stay, to be fitted and named.
            cleaned, taken = take_out_nuisance(kept, kinds, likely, angle)
        kept, said = cleaned, tuple(taken.sentences(kept[0].period))
    choice = choose_argument(kept, argument)
    if choice.argument == "indicated":
        kept = [run_at_indicated(run) for run in kept]
    # The ends of the travel are those of all readings.
    ends = [] if summed is None else [CalibrationRun(summed.ends, summed.ends, kept[0].period)]
    positions = distinct_positions([*kept, *ends], tolerance)
    held_from = held_orders(kept, declared_cycles(gear_ratio, shafts))
    chosen = choose_candidates(
        positions,
        candidates,
        gear_ratio,
        fixed_member,
        lines,
        _travelled(kept, gear_ratio, shafts),
        shafts,
        held_from,
    )
    if method == "paper":
        from .paper import select_by_paper

        selection = select_by_paper(kept, positions, chosen)
    else:
        selection = EvidenceSelection(kept, positions, chosen, summed).result()
    notes = (*filter(None, (choice.note,)), *said, *selection.notes)
    return replace(selection, argument=choice.argument, notes=notes, shafts=dict(shafts or {}))


def _without_zero_weights(run: CalibrationRun) -> CalibrationRun | None:
    if run.weights is None or (run.weights > 0.0).all():
        return run
    keep = run.weights > 0.0
    return run.part(keep) if keep.any() else None


def _travelled(
    runs: Sequence[CalibrationRun],
    gear_ratio: float | None,
    shafts: Mapping[str, float] | None,
) -> Array | None:
    """Angles of the readings in turns, whole turns kept; None where every order is whole."""
    if are_whole(declared_cycles(gear_ratio, shafts)):
        return None
    turns = np.concatenate([over_turns(run).reference for run in runs]) / runs[0].period
    # Angles examined to determine whether a gear's orders are resolved over the travel.
    return np.asarray(turns[:: max(1, turns.size // 4096)])
