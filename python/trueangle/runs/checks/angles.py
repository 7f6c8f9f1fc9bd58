"""Faults of the two angles: unit, sign, ratio, wrap, which is which."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from ...support.angles import wrap
from ...support.arrays import Array, median, quantile
from ...support.layout import counted
from ...support.roles import turned_code
from .fault import DataFault
from .record import Record
from .rows import ROUNDING, USUAL

#: Travel (degrees) from which on a ratio of the channels means anything, and how far from 1
#: it may be: errors of several degrees over a short travel are still errors. A periodic error
#: changes the slope over n turns by 1 / n^2 of that, and what drifts by less than the last.
LEAST_TRAVEL, AGREES, DRIFTS = 5.0, 0.15, 0.004

#: Degrees between readings beyond which nobody knows which way the joint went.
COARSE = 90.0

#: Ratios by which angles in one unit differ from those in another.
UNITS = {
    ("radians", "degrees"): 180.0 / math.pi,
    ("turns", "degrees"): 360.0,
    ("turns", "radians"): 2.0 * math.pi,
}

#: Denominators of gear ratios that are offered, round ones first, and how near one must be.
DENOMINATORS = (1, 2, 3, 4, 5, 10, 6, 7, 8, 9, 11, 12, 13)

#: Units that angles may be in among degrees, and share by which the travel of a run may differ.
OTHER_UNITS = {"radians": 180.0 / math.pi, "turns": 360.0}
UNIT_SPREAD = 0.35
#: Logarithm of the odds that rows in another unit are none.
_BY_CHANCE = math.log(1e3)
#: Part of the greatest angle up to which others may be in radians among degrees.
OTHER_UNIT = math.pi / 180.0 * (1.0 + UNIT_SPREAD)


#: Departure of steps, in shares of one, that count as equal.
EVEN = 1e-3

#: Roughness of steps, in shares of a step, that is none.
EXACT = 1e-6

#: Degrees of a jump of the reference against the joint, at least.
LEAST_JUMP = 20.0


#: Part of an error, all but a line, that a straight one may have.
STRAIGHT = 0.03

#: Readings that a line is laid through, and its rounds.
LOOKED_AT, _ROUNDS = 4096, 20

#: Blocks of a run that are compared.
BLOCKS = 8


def angle_ratio(records: list[Record]) -> float | None:
    """Indicated per reference travel: the median slope of the runs; None without travel."""
    slopes = [slope for record in records if (slope := _slope(record)) is not None]
    return float(median(slopes)) if slopes else None


def told_ratio(records: list[Record]) -> tuple[float | None, str]:
    """The ratio of indicated to reference, and what it suggests."""
    ratio = angle_ratio(records)
    if ratio is None and any(float(np.ptp(record.reference)) > LEAST_TRAVEL for record in records):
        return None, f"readings more than {COARSE:g} deg apart do not show it; read more densely"
    wrong = next(wrong_ratio(records), None) is not None
    if ratio is not None and abs(ratio - 1.0) >= AGREES and not wrong:
        return ratio, "no straight line: an error of the joint over this travel"
    return ratio, ratio_suggestion(ratio, 0.0 if wrong else AGREES)


def ratio_suggestion(ratio: float | None, agrees: float = AGREES) -> str:
    """What a ratio of indicated to reference suggests; nearer to 1 than ``agrees`` it is 1.

    Examples
    --------
    >>> ratio_suggestion(1.0002)
    'no gear between the two columns'
    >>> ratio_suggestion(7.3)
    'a gear of ratio 73/10 between the two that is not reduced'
    """
    if ratio is None:
        return "the joint hardly moved"
    if abs(ratio - 1.0) < agrees:
        return "no gear between the two columns"
    if abs(ratio + 1.0) < AGREES:
        return "the indicated angle has the opposite sign"
    from fractions import Fraction  # loads decimal: for joints that are wrong only

    size = abs(ratio)
    sign = ", counted the other way" if ratio < 0.0 else ""
    one, two = ("indicated", "reference")[:: 1 if size < 1.0 else -1]
    for (unit, of), factor in UNITS.items():
        if min(abs(size * factor - 1.0), abs(size / factor - 1.0)) < 0.01:
            return f"{one}: {unit} in a column of {of}, or {two}: {of} in a column of {unit}{sign}"
    for denominator in DENOMINATORS:
        best = Fraction(round(size * denominator), denominator)
        if best != 1 and abs(float(best) - size) < 2e-3 * size:
            return f"a gear of ratio {best} between the two that is not reduced{sign}"
    # Wheels that differ by a tooth, as those of a harmonic drive with one or the other held.
    departure = abs(size - 1.0)
    teeth = round(1.0 / departure) if departure > DRIFTS else 0
    # How near the whole number of teeth must be of wheels that differ by one, in shares of it.
    if teeth > max(DENOMINATORS) and abs(teeth * departure - 1.0) < 0.01:
        best = Fraction(teeth + (1 if size > 1.0 else -1), teeth)
        return f"a gear of ratio {best} between the two that is not reduced{sign}"
    return f"the indicated angle moves {size:.4g} times as far as the reference{sign}"


def wrong_ratio(records: list[Record]) -> Iterator[DataFault]:
    """A sign, unit or gear ratio that is not the output's."""
    turned: dict[str, list[tuple[str, float]]] = {}
    code = turned_code(next((r.columns for r in records if "indicated" in r.columns), {}))
    for record in records:
        slope = _straight(record)
        if slope is None or abs(slope - 1.0) < bending(_turns(record)):
            continue
        kind = "wrong_sign" if abs(slope + 1.0) < AGREES else "wrong_gear_ratio"
        turned.setdefault(kind, []).append((record.label, slope))
    for kind, found in turned.items():
        labels = [label for label, _ in found]
        value = float(median([slope for _, slope in found]))
        which = "all runs" if len(found) == len(records) else f"run {', '.join(labels[:4])}"
        says = "falls where the reference rises"
        mend = f"give {code} to change the sign of one of the two columns"
        if kind != "wrong_sign":
            says = (
                f"moves {value:.6g} times as far as the reference: {ratio_suggestion(value, 0.0)}"
            )
            mend = f"divide the indicated angle by {value:.6g}, or give the right unit"
        yield DataFault.of(kind, labels, (), f"in {which} the indicated angle {says}", mend)


def mixed_units(records: list[Record]) -> Iterator[DataFault]:
    """Runs, or readings of one, whose angles are in another unit than the others."""
    sizes = np.array([float(np.abs(record.reference).max(initial=0.0)) for record in records])
    travel = np.array([float(np.ptp(record.reference)) for record in records])
    whole, largest = float(travel.max(initial=0.0)), float(sizes.max(initial=0.0))
    found = set[int]()
    for unit, factor in OTHER_UNITS.items():
        small = [
            k
            for k in np.flatnonzero(sizes * factor <= largest * (1.0 + UNIT_SPREAD)).tolist()
            if whole > 30.0
            and len(records[k]) >= BLOCKS
            and abs(travel[k] * factor / whole - 1.0) < UNIT_SPREAD
            and not _scatters_as(records, k, factor)
        ]
        found.update(small)
        if small:
            labels = [records[k].label for k in small]
            yield DataFault.of(
                "mixed_units",
                labels,
                (),
                f"run {', '.join(labels[:4])} looks like {unit} among degrees: its angles cover "
                f"{float(median(travel[small])):.3g} where other runs cover {whole:.4g}",
                "multiply its angles by " + ("360" if unit == "turns" else "180/pi"),
            )
    for k, record in enumerate(records):
        for role in ("reference", "indicated") if k not in found else ():
            yield from _rows_in_other_units(record, role)


def _scatters_as(records: list[Record], k: int, factor: float) -> bool:
    """Whether a run of less travel is one: its two angles go together, with the others' noise."""
    travel, moved = np.ptp(records[k].reference), np.ptp(records[k].indicated)
    noise = [_roughness(record.run.centred_error, record.time) for record in records]
    usual = float(median([x for i, x in enumerate(noise) if i != k] or [0.0]))
    alike = abs(moved - travel) <= AGREES * travel
    return bool(alike and noise[k] * math.sqrt(factor) > max(usual, ROUNDING))


def usual_step(angle: Array) -> float:
    """Steps up to which readings go on from each other, degrees.

    0 where no rows are in another unit: there are no jumps, no order, or too few rows whose angles
    are, converted, within those of the others.
    """
    steps = np.abs(wrap(np.diff(angle), 360.0))
    if angle.size < 4 * BLOCKS or not steps.min() <= LEAST_JUMP < steps.max():
        return 0.0
    # Steps of the rows in the larger unit: in the other they are nothing beside them.
    limit = USUAL * float(quantile(steps[steps <= LEAST_JUMP], 0.9))
    size = np.abs(angle)
    most = 2 * np.count_nonzero(size <= size.max() * OTHER_UNIT)
    is_enough = (
        limit > 0.0 and most * math.log(180.0 / limit) > math.log(angle.size) + 1.0 + _BY_CHANCE
    )
    return limit if is_enough and np.count_nonzero(steps > limit) <= 0.5 * steps.size else 0.0


def _rows_in_other_units(record: Record, role: str) -> Iterator[DataFault]:
    """Rows of a column that go on from the others in another unit, and not in its own."""
    angle = getattr(record, role)
    limit = usual_step(angle)
    if limit == 0.0:
        return
    for unit, factor in OTHER_UNITS.items():
        other = _in_unit(angle, factor, limit)
        if _are_others(other, np.where(other, factor, 1.0) * angle, limit):
            rows = np.flatnonzero(other)
            yield record.fault(
                "mixed_units",
                rows,
                f"the {role} angle of {record.name} looks like {unit} among degrees in "
                f"{counted(rows, 'reading')} (first: {record.number(rows[0])})",
                "convert them, or give them another file",
            )
            return


def _are_others(other: NDArray[np.bool_], angle: Array, limit: float) -> bool:
    """Whether rows that are converted go on from the others, and move, by no chance.

    Of angles at random ``2 limit / 360`` do so; against that stands that any parts were looked at.
    """
    parts = int(np.count_nonzero(np.diff(other)))
    steps = np.abs(wrap(np.diff(angle), 360.0))[other[1:] | other[:-1]]
    moves = np.count_nonzero((steps <= limit) & (steps >= limit / USUAL**2))
    told = (moves - np.count_nonzero(steps > limit)) * math.log(180.0 / limit)
    return bool(parts and told > parts * (math.log(other.size / parts) + 1.0) + _BY_CHANCE)


def _in_unit(angle: Array, factor: float, limit: float) -> NDArray[np.bool_]:
    """Which parts between jumps are taken for another unit, so that least is left of jumps.

    A change of the unit, and a jump that is left, count 1 and 2; the least of all ways is found.
    """
    both = np.stack([angle, angle * factor])
    apart = np.abs(wrap(both[None, :, 1:] - both[:, None, :-1], 360.0)) > limit
    jumps = np.flatnonzero(apart[0, 0])
    starts = np.concatenate([[0], jumps + 1])
    cost = 2 * apart + (1 - np.eye(2, dtype=int))[:, :, None]
    within = np.append(np.where(apart[0, 0], 0, cost[1, 1]), 0)
    inside = np.add.reduceat(within, starts).tolist()
    (least, other), ways = (0, inside[0]), []
    for ((aa, ab), (ba, bb)), more in zip(
        np.moveaxis(cost[:, :, jumps], -1, 0).tolist(), inside[1:], strict=True
    ):
        ways.append((other + ba < least + aa, other + bb < least + ab))
        least, other = min(least + aa, other + ba), min(least + ab, other + bb) + more
    states = [other < least]
    for way in reversed(ways):
        states.append(way[states[-1]])
    return np.repeat(states[::-1], np.diff([*starts, angle.size]))


def wrapped_reference(records: list[Record]) -> Iterator[DataFault]:
    """A reference that wraps at something else than a turn."""
    for record in records:
        if len(record) < BLOCKS:
            continue
        reference, indicated = np.diff(record.reference), np.diff(record.indicated)
        ahead = indicated - 360.0 * np.round(indicated / 360.0)
        slip = reference - ahead
        slip -= 360.0 * np.round(slip / 360.0)
        spread = 1.4826 * float(median(np.abs(slip - median(slip))))
        typical = float(median(np.abs(ahead)))
        jumps = np.flatnonzero(np.abs(slip) > max(20.0 * spread, 10.0 * typical, LEAST_JUMP))
        # One outlier is no wrap: readings follow each.
        alone = np.diff([0, *jumps + 1, len(record)]) < 2
        jumps = jumps[~(alone[:-1] | alone[1:])]
        if jumps.size == 0:
            continue
        # A wrap falls from one end of the range to the other.
        low, high = float(record.reference.min()), float(record.reference.max())
        ends = np.minimum(record.reference[jumps], record.reference[jumps + 1])
        tops = np.maximum(record.reference[jumps], record.reference[jumps + 1])
        near = 0.02 * (high - low) + 5.0 * typical
        at_ends = (ends - low < near) & (high - tops < near)
        if not at_ends.all() or not _stays(record, jumps, slip[jumps]):
            continue
        period = float(median(np.abs(reference - ahead)[jumps]))
        yield record.fault(
            "wrapped_reference",
            jumps + 1,
            f"the reference of {record.name} wraps after {period:.4g} deg, which is not "
            "a turn: one number means several places",
            "log the reference over a whole turn, or unwrap it before",
        )


def _stays(record: Record, jumps: NDArray[np.intp], slip: Array) -> bool:
    """Whether the angles stay apart by each jump; a joint that follows a command catches up."""
    apart = record.reference - record.indicated
    bounds = [0, *(jumps + 1).tolist(), len(record)]
    levels = []
    for a, b in itertools.pairwise(bounds):
        part = apart[a:b] - apart[a]
        levels.append(apart[a] + float(median(part - 360.0 * np.round(part / 360.0))))
    off = np.diff(levels) - slip
    off -= 360.0 * np.round(off / 360.0)
    # Part of a jump by which the angles may close up again: their error, and none of the jump.
    return bool((np.abs(off) <= 0.3 * np.abs(slip)).all())


#: Tests of the angles, after whose faults nothing may be fitted.
UNUSABLE_ANGLES = (mixed_units, wrapped_reference, wrong_ratio)


def swapped_channels(records: list[Record]) -> Iterator[DataFault]:
    """A reference that is much noisier than the joint under test."""
    ratios = []
    for record in records:
        # An angle and an error cannot be exchanged.
        if len(record) < 30 or "error" in record.columns:
            continue
        reference, indicated = record.unwrapped
        own, other = (_roughness(x, record.time) for x in (reference, indicated))
        steps = np.abs(np.diff(indicated))
        typical = float(median(steps))
        least = EXACT * typical
        # Readings taken at even counts of the joint do not show its noise.
        even = float(np.mean(np.abs(steps - typical) <= EVEN * typical)) > 0.5
        if own > least and not even:
            ratios.append(own / max(other, least, 1e-300))
    # Noise of the reference against that of the joint from which on the two may be swapped.
    if ratios and float(median(ratios)) > 10.0:
        yield DataFault.of(
            "swapped_channels",
            [record.label for record in records],
            (),
            f"the reference scatters {min(float(median(ratios)), 1e6):.3g} times as much as "
            "the joint that it is to judge: the two columns may be swapped",
            "exchange the columns, or go on where the reference really is the noisier one",
        )


def _roughness(x: Array, time: Array | None) -> float:
    """Typical distance of a reading from the line between its neighbours in time."""
    t = np.arange(x.size, dtype=np.float64) if time is None else time
    before, after = t[1:-1] - t[:-2], t[2:] - t[1:-1]
    whole = before + after
    even = whole > 0.0
    line = (x[:-2] * after + x[2:] * before)[even] / whole[even]
    if not even.any():
        return 0.0
    # Nine of ten: of an encoder that counts evenly more than half are exactly on the line.
    off = np.abs(x[1:-1][even] - line)
    return float(off[off <= quantile(off, 0.9)].mean())


def _straight(record: Record) -> float | None:
    """Slope of a line that all but few readings lie on; None where the error is no such line.

    An error of the joint is curved. Over part of a turn it has a mean slope too, but a line of
    least absolute deviations leaves more than 3 % of its size.
    """
    slope = _slope(record)
    if slope is None:
        return None
    apart = 1 + (len(record) - 1) // LOOKED_AT
    x, y = (angle[::apart] - float(median(angle)) for angle in record.unwrapped)
    basis = np.column_stack([np.ones_like(x), x])
    line, rest = np.array([0.0, slope]), y - slope * x
    for _ in range(_ROUNDS):
        weight = 1.0 / np.maximum(np.abs(rest), max(EXACT * float(np.ptp(y)), 1e-300))
        line = np.linalg.solve((weight * basis.T) @ basis, (weight * basis.T) @ y)
        rest = y - basis @ line
    error = y - x
    size = float(median(np.abs(error - median(error))))
    return float(line[1]) if float(median(np.abs(rest))) < STRAIGHT * size else None


def _turns(record: Record) -> float:
    return float(np.ptp(record.unwrapped[0])) / 360.0


def bending(turns: float) -> float:
    """How far from 1 an error of the joint may bring the slope over this many turns."""
    return max(AGREES / max(turns, 1.0) ** 2, DRIFTS)


def _slope(record: Record) -> float | None:
    """Travel of the indicated angle per travel of the reference; None without travel."""
    reference, indicated = record.unwrapped
    if len(record) < 4 or np.ptp(reference) < LEAST_TRAVEL:
        return None
    steps = np.abs(np.diff(reference))
    if float(quantile(steps, 0.9)) > COARSE:
        return None  # too coarse to determine the direction
    x = reference - reference.mean()
    return float(x @ (indicated - indicated.mean()) / (x @ x))
