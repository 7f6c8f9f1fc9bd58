"""What a selection means, in words: reasons per order, notes, verified positions."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import Final

import numpy as np

from ...estimation.evidence import EvidenceEstimate
from ...joint.gear import (
    HIGHEST_LOW_ORDER,
    explain_as_harmonic,
    explain_by_shafts,
    explain_order,
    wanted_orders,
)
from ...runs.aliasing import (
    Positions,
    closure_errors,
    distinct_positions,
    energy_near_nyquist,
    fold,
)
from ...runs.run import CalibrationRun, as_runs
from ...runs.travel import is_swept_once
from ...support.angles import arcsec
from ...support.display_units import brief_number, rms_text
from .candidates import Candidates, choose_candidates
from .result import OrderSelection
from .table import FIRST, OrderRow

_VERDICTS: Final = {
    "noise": "is not significant",
    "negligible": "is significant, but too small to change any reading",
    "too steep": "with it several true angles give one reading: it "
    "can be corrected with `argument='indicated'` only",
    "rounding": "may be made by the sensor's rounding to whole steps, which at evenly spaced "
    "positions is the same each time: read at other positions, too",
    "shared": "is in the model, but over this travel it looks like other orders: only their sum is "
    "known; a whole turn separates them",
    "in time": "looks like a vibration or an electrical line in time: one fixed frequency explains "
    "it better than the angle",
    "small": "has no prominent amplitude",
    "phase varies": "varies in phase from run to run",
    "too long": "cannot be distinguished from drift in time over so short a travel, passed once "
    "(fitted jointly, not kept): run it there and back, or fit the orders that you know: "
    "`ta.fit(runs, orders=[1, 2])`",
    "alias": "cannot be distinguished from retained orders at these positions",
}


def verdict_reason(verdict: str) -> str:
    """Why an order of this verdict is not retained, as the end of a sentence."""
    return _VERDICTS[verdict]


def row_with_verdict(
    row: OrderRow, candidates: Candidates, positions: Positions, retained: Mapping[float, float]
) -> OrderRow:
    """The row with its explanations and the reason of its verdict.

    ``retained`` are the amplitudes of the retained orders.
    """
    ratio, member = candidates.gear_ratio, candidates.fixed_member
    if row.order in candidates.local:
        return replace(row, verdict="too long", reason=_VERDICTS["too long"])
    if row.verdict == "reference":
        return replace(row, reason=_reference_reason(row.order, candidates.carriers))
    if not row.retained:
        return replace(row, reason=_VERDICTS[row.verdict])
    explanations = (
        *explain_order(row.order, row.aliases, ratio, member),
        *explain_by_shafts(row.order, candidates.shafts),
        *explain_as_harmonic(row.order, retained),
    )
    reason = "repeats its phase, with a prominent amplitude"
    if math.isfinite(row.probability):
        reason = f"is there with a probability of {brief_number(100.0 * row.probability)} %"
    rivals = [str(e) for e in explanations if e.order != row.order]
    named = {e.order for e in explanations}
    low = _seen_at(row.order, candidates)
    if low is not None and not rivals:
        reason += f", and these positions distinguish it from {low}"
    # Where the readings only hint at a high order, the low one is a rival too.
    rivals += [f"{m:g}" for m in row.aliases if m in candidates.main and m not in named]
    if rivals:
        reason = (
            f"{row.order:g} may be {' or '.join(rivals)}; these positions cannot distinguish them. "
            f"Measure {_measure(positions, ratio, member)}"
        )
    return replace(row, explanations=explanations, reason=reason, doubtful=bool(rivals))


def _seen_at(order: float, candidates: Candidates) -> int | None:
    """The low order that one grid of the positions would show instead, if any."""
    divisions = candidates.effective.divisions
    if divisions is None or not float(order).is_integer():
        return None
    low = fold(int(order), divisions)[0]
    return low if low != order else None


def _reference_reason(order: float, carriers: Sequence[float]) -> str:
    if order in carriers:
        return "the reference's own, as declared"
    carrier = min(carriers, key=lambda c: abs(order - c))
    return f"the reference's own: side band {order - carrier:+g} of its order {carrier:g}"


def _measure(positions: Positions, ratio: float | None, member: str) -> str:
    """What to measure to separate aliases."""
    if positions.divisions is None:
        return "over more of the turn, or at more positions"
    offset = _separating_offset(positions.divisions, ratio, member)
    where = (
        f"again with the reference turned by {offset:.4g} deg on its mount"
        if offset
        else ("at free angles between these positions")
    )
    return f"{where} (`ta.plan_mounts(...)`)"


@lru_cache(maxsize=32)
def _separating_offset(divisions: int, ratio: float | None, member: str) -> float | None:
    """Offset of a second mount that serves the declared gear, or ratio 100."""
    from ...planning.plan import plan_mounts

    try:
        plan = plan_mounts(ratio or 100.0, divisions, 2, fixed_member=member)
    except ValueError:
        return None
    return plan.mount_offsets_deg[1]


def is_one_sweep(runs: Sequence[CalibrationRun]) -> bool:
    """Whether every place was passed once: drift in time is a function of the angle."""
    return len(runs) == 1 and is_swept_once(runs[0])


def not_noise(runs: Sequence[CalibrationRun], estimate: EvidenceEstimate) -> list[str]:
    """What is neither orders nor noise of readings, where it is most of what the orders leave.

    A millionth of the error is rounding, of which an estimate knows no more.
    """
    # Noise of a reading is white, or correlated over the next ones.
    noise, error = float(estimate.noise[:2].sum()), estimate.runs[0].error
    left = [read.error - estimate.curve(read.theta)[0] for read in estimate.runs]
    taken = float(np.var(np.concatenate([part - part.mean() for part in left]))) - noise
    if taken <= max(noise, 1e-12 * float(np.var(error))):
        return []
    if is_one_sweep(runs):
        why = "taken as drift: one sweep cannot distinguish it from a function of the angle; "
        why += "sweep back as well, and fit both runs"
    else:
        by = f": runs differ in order {', '.join(f'{k:g}' for k in estimate.differing[:6])}"
        by *= bool(estimate.differing)
        why = f"which is not noise of single readings{by}. Run diagnose for its cause"
    return [f"{rms_text(math.sqrt(taken), runs[0].period)}, {why}"]


def selection_notes(
    selection: OrderSelection, candidates: Candidates, runs: Sequence[CalibrationRun]
) -> tuple[str, ...]:
    """What a user must know before trusting the orders."""
    positions = selection.positions
    notes = []
    closure = closure_errors(runs)
    if closure.size:
        worst = arcsec(float(np.abs(closure).max()), selection.period)
        notes.append(f"after whole turns the error has changed by up to {worst:.3g} arcsec")
    if selection.estimate is not None:
        notes += [f"{FIRST[1]}{text}" for text in not_noise(runs, selection.estimate)]
    retained = [row for row in selection.table if row.retained]
    aliased = [row for row in retained if row.aliases]
    grid = positions.divisions is not None and len(positions.offsets) == 1
    if grid and retained:
        share = energy_near_nyquist(
            [row.order for row in retained],
            [row.amplitude for row in retained],
            positions.highest_order,
        )
        # Share of the energy in the upper half of the orders from which under-sampling is reported.
        if share > 0.25:
            notes.append(
                f"{100.0 * share:.0f} % of the energy lies in the upper half of the orders that "
                "these positions resolve: there are probably higher orders that alias to them"
            )
    if aliased:
        notes.append(_sentence(positions, candidates))
    orders = len(selection.table)
    independent = round(positions.span * max((row.order for row in selection.table), default=0)) + 1
    if retained and independent < orders:
        notes.append(
            f"over {360.0 * positions.span:.0f} deg of travel only about {independent} of "
            f"{orders} orders can be separated. The curve is valid within this travel; "
            "a full turn would show which orders are real"
        )
    if candidates.local:
        notes.append(
            f"over this travel, passed once, orders below {max(candidates.local) + 1.0:g} cannot "
            "be distinguished from drift in time: what is slow is fitted jointly and not kept in "
            "the model"
        )
    if candidates.unresolved:
        pairs = [f"{m:g} from {k:g}" for m, k in candidates.unresolved.items()]
        needed = 0.5 / min(abs(m - k) for m, k in candidates.unresolved.items())
        notes.append(
            f"over this travel the gear's orders {', '.join(pairs)} cannot be separated: the "
            f"low order represents both, within this travel only; {needed:.3g} turns separate them"
        )
    if candidates.gear_ratio is not None and not candidates.whole:
        notes.append(
            f"gear ratio {candidates.gear_ratio:g} is not whole: the error is not periodic in "
            "one output turn"
        )
    return tuple(notes)


@dataclass(frozen=True)
class VerifiedPositions:
    """Where a model fitted to some readings is verified.

    Attributes
    ----------
    count : int
        Distinct positions modulo a turn.
    between : bool
        Whether the readings also speak for the angles in between.
    sentence : str
    """

    count: int
    between: bool
    sentence: str


def verified_positions(
    runs: CalibrationRun | Iterable[CalibrationRun],
    gear_ratio: float | None = None,
    fixed_member: str = "circular_spline",
) -> VerifiedPositions:
    """At which positions the readings can verify a model, and whether also in between.

    In between is verified where the positions are no grid, or a grid (or union of grids)
    that separates the low orders and all orders of the gear; without a
    declared gear the orders of the common ratios are taken.

    Examples
    --------
    >>> run = CalibrationRun(np.arange(36) * 10.0, np.arange(36) * 10.0, period=360.0)
    >>> verified_positions(run, gear_ratio=100).between
    False
    """
    found = as_runs(runs)
    positions = distinct_positions(found)
    candidates = choose_candidates(positions, None, gear_ratio, fixed_member, ())
    return VerifiedPositions(
        len(positions), _between(positions, candidates), _sentence(positions, candidates)
    )


def _between(positions: Positions, candidates: Candidates) -> bool:
    """Whether the readings distinguish the low orders from those of the gear."""
    if len(positions.offsets) != 1 and not positions.has_alias(candidates.highest_alias):
        return True
    grid = candidates.effective
    if grid.divisions is None:
        return False
    if grid.divisions > 2 * candidates.highest_alias:
        return True
    if candidates.gear_ratio is None or not candidates.whole:
        return False
    from ...planning.noisefactors import mount_noise_factors

    low = min(HIGHEST_LOW_ORDER, grid.highest_order)
    orders = wanted_orders(candidates.gear_ratio, candidates.fixed_member, low)
    if any(m % 1.0 for m in orders):  # the candidates left those of the gear out
        return False
    offsets = 360.0 * np.asarray(grid.offsets)
    worst = float(mount_noise_factors(grid.divisions, offsets, orders).max())
    # Largest noise factor with which mounts count as separating orders.
    return worst <= 5.0


def _sentence(positions: Positions, candidates: Candidates) -> str:
    where = positions.describe()
    if _between(positions, candidates):
        return f"verified at {where}, and between them for the orders that they resolve"
    return f"verified only at {where}: a higher order may add error between them, not measured"
