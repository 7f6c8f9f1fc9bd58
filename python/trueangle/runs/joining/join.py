"""An indicated and a reference log with separate clocks, joined in time."""

from __future__ import annotations

import math
from collections.abc import Mapping
from os import PathLike
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...errors import ArgumentError, FileError
from ...formats.columns import signed_name
from ...support.angles import ARCSEC_PER_TURN
from ...support.argumentkinds import told_kinds
from ...support.arrays import Array
from ...support.roles import checked_count_turn, role_code, wanted_columns
from ...support.signals import FIELDS
from ..readings import FileReadings, read_readings
from ..run import CalibrationRun
from .clocks import Clocks, estimated_clocks
from .result import Gap, Joined
from .stream import LEAST, Stream


@told_kinds
def join(
    a: str | PathLike[str],
    b: str | PathLike[str],
    *,
    offset_s: float | None = None,
    rate_ppm: float | None = None,
    max_gap_s: float | None = None,
    counts_per_turn: float | None = None,
    counts_per_turn_reference: float | None = None,
    signals: Mapping[str, Any] | None = None,
    topic: str | None = None,
) -> Joined:
    r"""Calibration runs from an indicated and a reference log, each with its own time stamps.

    ::

        θ(t_i) = ref(t_i + offset + rate · (t_i - t₀))

    at every indicated reading, by lines or cubics through the readings of the reference,
    whichever predicts held-out ones better. Gaps are not interpolated. In a log of changes only
    (EPICS monitors and the like) the value is constant over a pause.

    Parameters
    ----------
    a, b : path
        Logs of any format, in either order: one with ``indicated_*``, the other with
        ``reference_*``, both with ``time_s`` (or another unit of time).
    offset_s, rate_ppm : float, optional
        Of the reference's clock against the indicated one, where it is known (0 and 0 for
        one clock); else estimated from the motion, if it determines them. A rate that is not
        clearly significant gets the prior of two quartzes, 0 +- 100 ppm.
    max_gap_s : float, optional
        Longest pause of the reference that is interpolated over (default: five times its
        typical step, and longer where the motion in as long a time is a line).
    counts_per_turn, counts_per_turn_reference, signals, topic
        As in `trueangle.read_runs`; ``signals={"a": {...}, "b": {...}}`` names columns of
        one log only, ``topic="/joints,/laser"`` the topics of A and of B.

    Returns
    -------
    Joined

    Raises
    ------
    FileError
        A log without time or angle.
    ArgumentError
        No common time, or too few readings.

    Notes
    -----
    A constant delay between the channels and an offset of the clocks are one thing to any
    motion: it is in ``offset_s``. Cost: a sort and a transform of each log.

    Examples
    --------
    >>> import tempfile, pathlib
    >>> folder = pathlib.Path(tempfile.mkdtemp())
    >>> t = np.arange(0.0, 20.0, 0.01)
    >>> theta = 90.0 * np.sin(0.7 * t)
    >>> for name, angle, shift in (("reference", theta, 5.0), ("indicated", theta, 0.0)):
    ...     rows = [f"{s},{x}" for s, x in zip((t + shift).tolist(), angle.tolist())]
    ...     text = "\n".join([f"time_s,{name}_deg", *rows])
    ...     _ = (folder / f"{name}.csv").write_text(text)
    >>> found = join(folder / "indicated.csv", folder / "reference.csv")
    >>> round(found.offset_s, 6)
    5.0
    """
    for name, value in (("offset_s", offset_s), ("rate_ppm", rate_ppm), ("max_gap_s", max_gap_s)):
        if value is not None and not math.isfinite(value):
            raise ArgumentError(f"{name} must be finite, got {value!r}")
    if max_gap_s is not None and max_gap_s <= 0.0:
        raise ArgumentError(f"max_gap_s must be positive, got {max_gap_s!r}")
    counts = (
        checked_count_turn(counts_per_turn, "counts_per_turn"),
        checked_count_turn(counts_per_turn_reference, "counts_per_turn_reference"),
    )
    first, second = _assigned((a, b), signals, topic)
    indicated = _Log.read(first, "indicated", counts[0])
    reference = _Log.read(second, "reference", counts[1])
    said = Stream.of(indicated.time, indicated.angle)
    true = Stream.of(reference.time, reference.angle)
    clocks = estimated_clocks(said, true, offset_s, rate_ppm)
    return _joined(indicated, reference, said, true, clocks, max_gap_s)


class _Log(NamedTuple):
    """Readings of one log: times, angles in degrees, and what else is in it."""

    table: FileReadings
    time: Array
    angle: Array
    signals: dict[str, Array]
    labels: NDArray[Any] | None

    @classmethod
    def read(cls, table: FileReadings, role: str, counts: float | None) -> _Log:
        roles = table.roles
        if "time" not in roles:
            raise table.error(
                "no column time_s: joining needs the time of every reading; name it with "
                + role_code("time")
            )
        column = roles[role]._replace(unit=roles[role].unit or table.format.unit)
        angle = table.values(column, 360.0, counts)
        time = roles["time"].values(table.raw(roles["time"]), 360.0)
        known = np.isfinite(time) & np.isfinite(angle)
        if np.count_nonzero(known) < LEAST:
            raise table.error(f"fewer than {LEAST} readings; record longer", column.name)
        signals = {
            name: found.values(table.raw(found), 360.0)[known]
            for name, found in roles.items()
            if name in _EXTRA and not (found.unit or "").startswith("count")
        }
        labels = table.columns[roles["run"].name][known] if "run" in roles else None
        return cls(table, time[known], angle[known], signals, labels)


#: Signals that go along with the readings.
_EXTRA = ("temperature", "torque", "current", "velocity", "mount", "shift", "motor")


def _assigned(
    paths: tuple[Any, Any], signals: Mapping[str, Any] | None, topic: str | None
) -> tuple[FileReadings, FileReadings]:
    """The log that holds the indicated angle, and the one that holds the reference."""
    shared = dict(signals or {})
    own = [dict(shared.pop(name, None) or {}) for name in ("a", "b")]
    named = (topic or "").split(",")
    topics = [named[0] or None, named[-1] or None]
    tables = [
        read_readings(path, given, name)
        for path, given, name in zip(paths, own, topics, strict=True)
    ]
    wanted_columns(shared)
    used: set[str] = set()
    for i, table in enumerate(tables):
        fitting = {role: wanted for role, wanted in shared.items() if _has(table, wanted)}
        used |= fitting.keys()
        if fitting:
            tables[i] = read_readings(paths[i], {**fitting, **own[i]}, topics[i])
    for role in shared.keys() - used:  # raises, and suggests similar names
        signed_name(tables[0].path, list(tables[0].columns), _name(shared[role]))
    for one, other in (tables, tables[::-1]):
        if "indicated" in one.roles and "reference" in other.roles:
            return one, other
    have = "; ".join(f"{table.path}: {', '.join(table.columns)}" for table in tables)
    raise ArgumentError(
        "one log must hold indicated_deg (_rad, _turn, _count), the other reference_deg; name "
        'others with `signals={"a": {"indicated": ("NAME", "UNIT")}, "b": {"reference": '
        '("NAME", "UNIT")}}`; '
        f"their columns are {have}"
    )


def _name(wanted: Any) -> str:
    return wanted if isinstance(wanted, str) else str(wanted[0])


def _has(table: FileReadings, wanted: Any) -> bool:
    try:
        signed_name(table.path, list(table.columns), _name(wanted))
    except FileError:
        return False
    return True


def _joined(
    indicated: _Log,
    reference: _Log,
    said: Stream,
    true: Stream,
    clocks: Clocks,
    longest: float | None,
) -> Joined:
    there = clocks.to_other(indicated.time)
    inside = true.covers(there, longest)
    gaps = [
        Gap(float(start), float(end), int(np.count_nonzero((there > start) & (there < end))))
        for start, end in true.gaps(longest)
    ]
    if np.count_nonzero(inside) < LEAST:
        raise ArgumentError(
            f"{np.count_nonzero(inside)} readings have a reference at their time: the logs last "
            f"{indicated.time[0]:g} to {indicated.time[-1]:g} s and {reference.time[0]:g} to "
            f"{reference.time[-1]:g} s, offset {clocks.offset:g} s; declare the offset "
            "(`offset_s=`)"
        )
    angle, velocity = true.at(there)
    runs = []
    for label, rows in _groups(indicated.labels, inside):
        order = rows[np.argsort(indicated.time[rows], kind="stable")]
        signals = {name: values[order] for name, values in indicated.signals.items()}
        for name, values in reference.signals.items():
            signals.setdefault(name, np.interp(there[order], reference.time, values))
        signals = {name: v for name, v in signals.items() if np.isfinite(v).all()}
        fields: dict[str, Any] = {k: v for k, v in signals.items() if k in FIELDS}
        runs.append(
            CalibrationRun(
                angle[order],
                indicated.angle[order],
                period=360.0,
                time=indicated.time[order],
                label=label,
                signals={k: v for k, v in signals.items() if k not in FIELDS},
                source=indicated.table.source,
                indicated_sign=indicated.table.roles["indicated"].sign,
                **fields,
            )
        )
    speed = math.sqrt(float(np.mean(velocity[inside] ** 2)))
    step = true.resolution if true.is_on_change else 0.0
    std = math.hypot(true.interpolation_std, clocks.timing_std * speed, step)
    on_change = [name for name, s in (("indicated", said), ("reference", true)) if s.is_on_change]
    return Joined(
        runs,
        clocks.offset,
        clocks.rate,
        clocks.offset_std,
        clocks.rate_std,
        std * ARCSEC_PER_TURN / 360.0,
        tuple(gaps),
        int(inside.size - np.count_nonzero(inside)),
        tuple(on_change),
        clocks.notes,
    )


def _groups(
    labels: NDArray[Any] | None, inside: NDArray[np.bool_]
) -> list[tuple[str | None, NDArray[np.intp]]]:
    rows = np.flatnonzero(inside)
    if labels is None:
        return [(None, rows)]
    names = dict.fromkeys(labels[rows].tolist())
    return [(str(name), rows[labels[rows] == name]) for name in names]
