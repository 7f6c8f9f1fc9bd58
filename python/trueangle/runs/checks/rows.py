"""Rows that do not fit the other readings: repeated ones, outliers, steps that stay."""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from typing import Final

import numpy as np

from ...support.angles import wrap
from ...support.arrays import Array, distinct, median, quantile
from ...support.display_units import brief_number
from ...support.layout import counted
from ..outliers import WILD, outlying, robust_scale
from ..run import CalibrationRun
from .fault import REPEATS, DataFault
from .record import LEAST_READINGS, Record, records_of
from .still import stale_fault, stuck_readings

#: Readings on either side of a step that show whether it stays.
_BESIDE: Final = 7

#: Most jumps of a run that count as events; more are a property of the run.
_FEW: Final = 4

#: Steps of the reference, in usual ones, up to which a change of the error is no gap.
USUAL: Final = 3.0

#: Jumps up to this are rounding of angles, degrees.
ROUNDING: Final = 1e-9

#: Of more readings every second, third ... is looked at.
_LOOKED_AT: Final = 8192


def missed_counts(records: Iterable[Record]) -> Iterator[DataFault]:
    """Jumps of the error that stay, and are of no place of the joint.

    Of places read before and after, the error is off by all jumps between. Where these are too few,
    an error of the place is no steeper than the angle itself, but at a sensor's own wrap.
    """
    for record in records:
        apart = 1 + len(record) // _LOOKED_AT
        angles = record.reference[::apart], record.indicated[::apart]
        some = Record(record.label, *angles)
        reference, indicated = some.unwrapped
        error = some.run.centred_error
        # By their rows, with their sizes and what a pattern may change by meanwhile.
        found: dict[int, tuple[float, float]] = {}
        stride = 1
        # What takes several readings is a jump between every second, fourth ... of them.
        while len(some) >= 4 * _BESIDE * stride:
            for step, size, travel in _jumps(*(x[::stride] for x in (reference, indicated, error))):
                rows = slice(step * stride, (step + 1) * stride + 1)
                row = rows.start + _largest(error[rows], size)
                if all(abs(row - other) > _BESIDE * stride for other in found):
                    found[row] = size, travel
            stride *= 2
        for row in sorted(found):
            lost = _lost(reference, error, found, row)
            if lost is None:
                continue
            rows = slice((row - 1) * apart, row * apart + 1)
            k = rows.start + _largest((record.indicated - record.reference)[rows], lost)
            yield record.fault(
                "missed_counts",
                [k],
                f"the error of {record.name} jumps by {brief_number(lost)} deg at reading "
                f"{k + 1} and stays there: steps or counts were lost",
                "give the readings from there another run label, or measure again",
            )


def without_old_samples(runs: Sequence[CalibrationRun]) -> tuple[list[CalibrationRun], list[str]]:
    """Runs without readings that repeat the one before while the joint moves; what was omitted."""
    kept, told = [], []
    for run, record in zip(runs, records_of(runs), strict=True):
        if old := [f for f in stuck_readings([record]) if f.fault == "stale_samples"]:
            run = run.part(np.delete(np.arange(len(run)), [r - 1 for f in old for r in f.rows]))
            told += [f"{fault.says}; they are omitted" for fault in old]
        kept.append(run)
    return kept, told


def parted(runs: Sequence[CalibrationRun]) -> tuple[list[CalibrationRun], list[str]]:
    """Runs without old samples, in parts before and after every loss of counts, and what was done.

    From a loss on all is off by one more unknown, as from one run to the next.
    """
    kept, told = without_old_samples(runs)
    parts = []
    for run, record in zip(kept, records_of(kept), strict=True):
        faults = list(missed_counts([record]))
        told += [f"{f.says}; the readings from there have a separate zero" for f in faults]
        starts = [fault.rows[0] - 1 for fault in faults]
        parts.append(run.part(slice(starts[0])) if faults else run)
        for a, b in pairwise([*starts, len(run)]):
            parts.append(
                run.part(slice(a, b), label=f"{record.label} from reading {a + 1}", left_out=0)
            )
    return parts, told


def _largest(error: Array, size: float) -> int:
    """First reading after the largest change of an error in the sense of ``size``."""
    return 1 + int(np.argmax(wrap(np.diff(error), 360.0) * np.sign(size)))


def _jumps(reference: Array, indicated: Array, error: Array) -> Iterator[tuple[int, float, float]]:
    """Reading before each jump, its size in degrees, and what the pattern may change by there.

    A change of the error from one reading to the next is a jump where it is more than 8 robust
    standard deviations off the median of the changes around it, and twice as far as all but a few
    others, in one motion in one direction. It stays where the 7 readings after it are off those
    before it by as much.
    """
    steps, changes = np.diff(reference), wrap(np.diff(error), 360.0)
    around = np.pad(changes, _BESIDE // 2, mode="reflect")
    usual = median(np.lib.stride_tricks.sliding_window_view(around, _BESIDE), axis=1)
    off = changes - usual
    size = np.abs(off)
    limit = max(WILD * max(robust_scale(off), float(quantile(size, 0.8))), ROUNDING)
    # What rounds jumps from count to count: a few jumps are larger than all others.
    limit = max(limit, 2.0 * float(np.partition(size, -_FEW - 1)[-_FEW - 1]))
    far = np.flatnonzero(size > limit)
    pace = _pace(steps)
    for k in far[(far >= _BESIDE) & (far < size.size - _BESIDE)].tolist():
        before, after = slice(k - _BESIDE, k), slice(k + 1, k + 1 + _BESIDE)
        way = steps[before.start : after.stop] * np.sign(steps[before].sum())
        onward = way.min() >= 0.0 and way[-_BESIDE:].any() and way[_BESIDE] <= USUAL * pace
        ends = np.stack([reference[k : k + 2], indicated[k : k + 2]])
        over = np.ptp(np.floor(ends / 360.0), axis=1) > 0.0
        at_turn = np.abs(wrap(ends, 360.0)).min(axis=1) <= max(USUAL * way[_BESIDE], limit)
        alone = max(size[before].max(), size[after].max()) <= 0.5 * size[k]
        rise = float(median(error[after]) - median(error[k - _BESIDE + 1 : k + 1]))
        stays = 0.5 < wrap(rise - _BESIDE * usual[k], 360.0) / off[k] < 1.5
        if onward and alone and stays:
            yield k, float(off[k]), np.inf if (over & at_turn).any() else float(way[_BESIDE])


def _pace(steps: Array) -> float:
    """Usual step of a reference that moves."""
    moved = np.abs(steps[steps != 0.0])
    return float(median(moved)) if moved.size else 0.0


def _lost(
    reference: Array, error: Array, jumps: dict[int, tuple[float, float]], row: int
) -> float | None:
    """By how much the error changes there for good; None where it changes with the place."""
    place = np.mod(reference, 360.0)
    old, new = np.arange(row - _BESIDE), np.arange(row + _BESIDE, place.size)
    order = old[np.argsort(place[old], kind="stable")]
    ring = np.concatenate([place[order[-1:]] - 360.0, place[order], place[order[:1]] + 360.0])
    ends = np.concatenate([order[-1:], order, order[:1]])
    right = np.clip(np.searchsorted(ring, place[new]), 1, ring.size - 1)
    nearest = np.where(place[new] - ring[right - 1] < ring[right] - place[new], right - 1, right)
    lost = np.zeros_like(error)
    for other, (amount, _) in jumps.items():
        lost[other:] += amount
    size, travel = jumps[row]
    then = ends[nearest]
    gone = lost[new] - lost[then]
    near = np.abs(ring[nearest] - place[new]) <= USUAL * _pace(np.diff(reference))
    # Jumps that are reversed at the same place do not count.
    again = near & (np.abs(gone) > 0.5 * abs(size))
    # A motion over one turn comes back to a few places only.
    if again.sum() < (_BESIDE if np.isinf(travel) else USUAL) and abs(size) <= travel:
        return None
    if not again.any():
        return size
    apart = wrap((error[new] - error[then] - gone)[again], 360.0)
    return size + float(median(apart)) if median(np.abs(apart)) <= 0.5 * abs(size) else None


def outliers(records: Iterable[Record], faults: Iterable[DataFault]) -> Iterator[DataFault]:
    """Rows that are outliers, of runs that no other fault explains, and repeated samples."""
    unsure = {label for fault in faults if fault.fault not in REPEATS for label in fault.runs}
    for record in records:
        if record.label in unsure or len(record) < 2:
            continue
        far, distance = outlying(record.run)
        good = np.arange(len(record))
        good[far] = 0
        before = np.maximum.accumulate(good)[far]
        for name, angle in (("indicated", record.indicated), ("reference", record.reference)):
            held = (before < far) & (angle[far] == angle[before])
            if held.any():
                yield stale_fault(record, name, far[held].tolist())
            far, before, distance = far[~held], before[~held], distance[~held]
        if far.size:
            named = [f"reading {record.number(int(k))}" for k in far[:3]] + ["..."] * (far.size > 3)
            size = f"{'up to ' * (far.size > 1)}{brief_number(float(distance.max()))} deg"
            yield record.fault(
                "outliers",
                far,
                f"{counted(far, 'reading')} of {record.name} {'are' if far.size > 1 else 'is'} far "
                f"off the neighbours in angle, by {size}: {', '.join(named)}",
                "check these readings; `fit` and `diagnose` reject them",
            )


def duplicate_runs(records: list[Record]) -> Iterator[DataFault]:
    """Runs whose readings are equal to the last digit."""
    if len(records) < 2:
        return
    import hashlib

    same: dict[bytes, list[str]] = {}
    for record in records:
        if len(record) >= LEAST_READINGS and np.ptp(record.indicated) > 0.0:
            data = np.concatenate([record.reference, record.indicated]).tobytes()
            same.setdefault(hashlib.sha256(data).digest(), []).append(record.label)
    for labels in same.values():
        if len(labels) > 1:
            says = f"runs {', '.join(labels[:-1])} and {labels[-1]} hold the same readings, to the "
            says += "last digit: noise and repeatability would come out too good"
            others = " ".join(f"--run '!{label}'" for label in labels[1:])
            mend = f"read only the first of them: add {others}"
            yield DataFault.of("duplicate_runs", labels, (), says, mend)


def duplicate_rows(records: list[Record]) -> Iterator[DataFault]:
    """Rows with one time stamp and the same readings; without times, readings that repeat others.

    A reference that repeats with another indicated angle was measured again; readings that also
    agree there may come from a coarse resolution.
    """
    for record in records:
        columns = [record.indicated, record.reference, record.time]
        table = np.stack([column for column in columns if column is not None])
        if distinct(table[-1]).size == len(record):
            continue
        order = np.lexsort(table)
        same = np.diff(table[:, order]) == 0.0
        again = same.all(axis=0)
        rows = np.sort(order[1:][again])
        if record.time is not None and rows.size:
            yield record.fault(
                "duplicate_rows",
                rows,
                f"{record.name} has {counted(rows, 'reading')} twice, with the same time stamp "
                f"(first: {rows[0] + 1})",
                "drop the second of each",
            )
        elif rows.size >= LEAST_READINGS and np.array_equal(again, same[-1]):
            yield record.fault(
                "duplicate_rows",
                rows,
                f"{rows.size} of {len(record)} readings of {record.name} repeat others to the last "
                f"digit (first: {rows[0] + 1}): uncertainties would come out too small",
                "drop the copies",
            )
