"""What a check of data found: faults, what was moved and measured, what such data can show."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any

import numpy as np

from ...support.arrays import Array, distinct, median, quantile
from ...support.layout import counted, laid_out, wrapped_lines
from ...support.plainresult import PlainResult, plain_fields
from ..outliers import FEWEST
from .angles import BLOCKS
from .fault import DataFault
from .record import FEW, LEAST_READINGS, Record

#: Levels are apart by so much at least: Nm, kelvin, degrees; of speeds a share of the fastest.
_LEAST_GAP = {"torque": 0.05, "temperature": 1.0, "mount": 0.5, "speed": 0.05}
#: What one run or two cannot show.
REPEATABILITY = "differences between runs"

_SIGNALS = ("torque", "temperature", "mount")

#: Share of the widest gap within which readings are of one place, and of a turn that all such
#: gaps together may have.
_WITHIN_PLACE = 0.01
#: Degrees of step beyond which an angle is not followed from reading to reading.
_FOLLOWED = 90.0


@dataclass(frozen=True)
class Extent:
    """The design of the runs as the readings show it.

    Attributes
    ----------
    readings, runs : int
    span_deg : float
        Width of the places visited, at most 360.
    turns : float
        Largest travel of a run between its ends.
    directions : tuple of int
        Of -1 and +1 those that were travelled.
    speeds, loads, temperatures, mounts : tuple of float
        Levels, also within a run: deg/s, Nm, Celsius, degrees; empty where not recorded. Of a
        signal that goes from one to another without a gap both ends.
    timed : bool
    swept : tuple of str
        Of torque, temperature and mount those that go so within a run.
    """

    readings: int
    runs: int
    span_deg: float
    turns: float
    directions: tuple[int, ...]
    speeds: tuple[float, ...]
    loads: tuple[float, ...]
    temperatures: tuple[float, ...]
    mounts: tuple[float, ...]
    timed: bool
    swept: tuple[str, ...] = ()


def extent_of(records: list[Record]) -> Extent:
    """Extent of some records."""
    places = np.concatenate([np.mod(record.reference, 360.0) for record in records])
    travels, directions = [], set[int]()
    for record in records:
        reference, _ = record.unwrapped
        travels.append(float(np.ptp(reference)) / 360.0)
        steps = np.diff(reference)
        least = 0.25 * float(quantile(np.abs(steps), 0.9)) if steps.size else 0.0
        moving = np.sign(steps[np.abs(steps) > least])
        directions |= {sign for sign in (-1, 1) if (moving == sign).sum() > 0.05 * moving.size}
    loads, temperatures, mounts = found = [_signal_levels(records, name) for name in _SIGNALS]
    return Extent(
        sum(len(record) for record in records),
        len(records),
        _span(places),
        max(travels, default=0.0),
        tuple(sorted(directions)),
        _levels_of(list(_usual_speeds(records)), "speed"),
        loads[0],
        temperatures[0],
        mounts[0],
        all(record.time is not None for record in records),
        tuple(name for name, (_, swept) in zip(_SIGNALS, found, strict=True) if swept),
    )


def extent_verdicts(extent: Extent) -> tuple[list[str], list[dict[str, str]]]:
    """What such data can determine; what they cannot, why, and which measurement would."""
    can = ["the periodic error at the places visited"]
    cannot: list[dict[str, str]] = []

    def no(what: str, because: str, measure: str) -> None:
        cannot.append({"what": what, "because": because, "measure": measure})

    if extent.readings < FEWEST * extent.runs:
        no("single outliers", counted(extent.readings, "reading"), f"{FEWEST} or more in a run")
    if extent.span_deg >= 350.0:
        can.append("integer orders of a whole turn")
    else:
        no(
            "orders apart from each other over a whole turn",
            f"{extent.span_deg:.0f} deg of travel",
            "a whole turn, or a correction for this travel alone",
        )
    if len(extent.directions) == 2:
        can.append("reversal error")
    else:
        no("reversal error", "one direction of travel", "runs in both directions")
    if not extent.timed:
        no("delay, drift and lines in time", "no time stamps", "log time_s")
    elif len(extent.speeds) > 1:
        can.append("delay and filters (several speeds)")
    else:
        no(
            "a delay, separately from play and from a zero offset",
            "one speed",
            "runs at a second speed, 3 times as high",
        )
    for name, what, levels, measure in (
        ("torque", "compliance", extent.loads, "runs at several loads, torque_Nm logged"),
        (
            "temperature",
            "thermal drift",
            extent.temperatures,
            "runs at several temperatures, temperature_C logged",
        ),
        (
            "mount of the reference",
            "the reference's own error apart from the joint's",
            extent.mounts,
            "runs with the reference turned on its mount, mount_deg logged",
        ),
    ):
        if len(levels) > 1:
            can.append(what)
        else:
            no(what, f"{'one' if levels else 'no'} {name}", measure)
    if extent.runs > 2:
        can.append("how far the zero and the pattern repeat from run to run")
    else:
        no(REPEATABILITY, counted(extent.runs, "run"), "more runs")
    # An order and the zeros are fitted, with one reading to spare.
    return can * (extent.readings > extent.runs + 2), cannot


def _usual_speeds(records: list[Record]) -> Iterator[float]:
    """Speed of each run in either direction, the median of its blocks, where time runs.

    A pause is in one block, and a step over which a clock is set back in none.
    """
    for record in records:
        if record.velocity is not None:
            yield float(median(np.abs(record.velocity)))
        elif record.time is not None:
            steps = np.stack([np.abs(np.diff(record.unwrapped[0])), np.diff(record.time)])
            steps = steps[:, steps[1] > 0.0]
            at = distinct(np.linspace(0.0, steps.shape[1], BLOCKS, endpoint=False).astype(int))
            if steps.size:
                far, long = np.add.reduceat(steps, at, axis=1)
                yield float(median(far / long))


def _signal_levels(records: list[Record], name: str) -> tuple[tuple[float, ...], bool]:
    """Levels of a signal over all runs, and whether one run goes through all between two of them.

    One run may hold several.
    """
    found, swept = list[float](), False
    for values in (getattr(record, name) for record in records):
        groups = [] if values is None else _groups(values, name)
        # Single readings apart from the others are noise, not a level.
        for group in [own for own in groups if own.size >= LEAST_READINGS] or groups:
            inside = values[(values >= group[0]) & (values <= group[-1])]
            if np.ptp(_medians(inside, BLOCKS)) > _LEAST_GAP[name]:
                ends, swept = _medians(inside, inside.size // LEAST_READINGS), True
                found += [float(ends.min()), float(ends.max())]
            else:
                found.append(float(np.mean(group)))
    return _levels_of(found, name), swept


def _medians(values: Array, blocks: int) -> Array:
    """Medians of blocks of consecutive readings, in which single ones do not show."""
    parts = np.array_split(values, min(blocks, values.size))
    return np.array([median(part) for part in parts])


def _levels_of(values: list[float], kind: str) -> tuple[float, ...]:
    """Means of groups of values."""
    return tuple(float(f"{np.mean(group):.4g}") for group in _groups(np.array(values), kind))


def _groups(values: Array, kind: str) -> list[Array]:
    """Values that are closer together than the gaps between groups."""
    if not values.size:
        return []
    ordered = np.sort(values)
    least = _LEAST_GAP[kind] * (float(ordered[-1]) if kind == "speed" else 1.0)
    gap = max(0.1 * float(np.ptp(ordered)), least)
    return np.split(ordered, np.flatnonzero(np.diff(ordered) > gap) + 1)


def _span(places: Array) -> float:
    """360 less the widest gap between places."""
    ordered = np.sort(places)
    if ordered.size < 2:
        return 0.0
    gaps = np.diff(np.append(ordered, ordered[0] + 360.0))
    widest = float(gaps.max())
    # A place is left by a little from one reading to the next: that is no step.
    within = gaps < _WITHIN_PLACE * widest
    if gaps[within].sum() < _WITHIN_PLACE * 360.0:
        gaps = gaps[~within]
    if gaps.size < 2:  # all readings are of one place
        return 360.0 - widest
    # Evenly spaced places leave no gap but their step.
    return 360.0 if widest < 3.0 * float(median(gaps[gaps > 0.0])) else 360.0 - widest


@dataclass(frozen=True)
class Check(PlainResult):
    """Whether data are fit to be used, before any model.

    Attributes
    ----------
    data_faults : tuple of DataFault
    ratio : float or None
        Travel of the indicated angle per travel of the reference.
    suggests : str
        What that ratio suggests.
    extent : Extent
        Span, turns, directions, speeds, loads, temperatures and mounts.
    can : tuple of str
        What can be known from such data.
    cannot : tuple of dict
        ``what`` cannot, ``because``, and what to ``measure``.
    columns : mapping of role to (name, unit)
        The columns of files that were understood; empty for runs.
    """

    data_faults: tuple[DataFault, ...]
    ratio: float | None
    suggests: str
    extent: Extent
    can: tuple[str, ...]
    cannot: tuple[dict[str, str], ...]
    columns: Mapping[str, tuple[str, str | None]] = field(default_factory=dict)

    @property
    def usable(self) -> bool:
        """No fault forbids to use the data as they are."""
        return not any(fault.unusable for fault in self.data_faults)

    def to_dict(self) -> dict[str, Any]:
        """What ``trueangle check`` prints as JSON."""
        moved = "directions speeds loads temperatures mounts"
        columns = [
            {"role": r, "name": name, "unit": unit} for r, (name, unit) in self.columns.items()
        ]
        return {
            **plain_fields(self, "data_faults usable ratio ratio_suggests=suggests"),
            **plain_fields(self.extent, f"readings runs span_deg turns {moved} swept"),
            "columns": columns,
            **plain_fields(self, "can cannot"),
        }

    def _brief(self) -> str:
        fit = "usable" if self.usable else "not usable"
        found = ", ".join(fault.fault for fault in self.data_faults) or "no fault"
        return (
            f"{self.extent.readings} readings in {counted(self.extent.runs, 'run')}, {fit}: {found}"
        )

    def summary(self) -> str:
        """The check as readable text: faults first."""
        e = self.extent
        found = counted(self.data_faults, "fault")
        use = "fit accepts the data" if self.usable else "the data must not be used as they are"
        lines = [f"{found}; {use}: see the remedy."]
        if not self.data_faults:
            then = "next: `ta.fit(...)` or `ta.diagnose(...)`"
            few = f"few readings to search for orders ({e.readings}): take {FEW} or more"
            lines = [f"No fault found in the data; {few if e.readings < FEW else then}."]
        for fault in self.data_faults:
            lines += wrapped_lines(f"{fault.fault}: {fault.says}.", 2)
            lines += wrapped_lines(f"Remedy: {fault.mend}.", 4, 2)
        if self.columns:
            told = [
                f"{role} is '{name}'" + (f" in {unit}" if unit else "") + _reversed(role, name)
                for role, (name, unit) in self.columns.items()
            ]
            lines += ["", *wrapped_lines(f"Columns: {'; '.join(told)}.", 2)]
        levels = [
            ("At rest", "One direction", "Both directions")[len(e.directions)],
            _levels("speeds", e.speeds, "deg/s"),
            _levels("loads", e.loads, "Nm", "torque" in e.swept),
            _levels("temperatures", e.temperatures, "C", "temperature" in e.swept),
            _levels("mounts", e.mounts, "deg", "mount" in e.swept),
        ]
        ratio = "unknown" if self.ratio is None else f"{self.ratio:.6g}"
        lines += [
            "",
            f"{e.readings} readings in {e.runs} run{'s' * (e.runs != 1)}, {e.span_deg:.4g} deg "
            f"covered, longest run {e.turns:.4g} turns.",
            f"Indicated per reference: {ratio} ({self.suggests}).",
            "; ".join(filter(None, levels)) + ".",
            "",
        ]
        lines += wrapped_lines(f"Identifiable: {'; '.join(self.can) or 'nothing'}.", 2)
        lines += ["Not identifiable, and what would show it:"] if self.cannot else []
        for entry in self.cannot:
            text = f"- {entry['what']} ({entry['because']}): {entry['measure']}"
            lines += wrapped_lines(text, 4, 2)
        return laid_out(lines)


def _reversed(role: str, name: str) -> str:
    """What a minus before the joint's own column means."""
    is_reversed = role == "indicated" and name.startswith("-")
    return " (a reversed sensor: models keep indicated_sign -1)" if is_reversed else ""


def _levels(name: str, values: tuple[float, ...], unit: str, swept: bool = False) -> str:
    told = ", ".join(f"{value:g}" for value in values)
    return f"{name}: {told} {unit}{', also between them within a run' * swept}" if told else ""
