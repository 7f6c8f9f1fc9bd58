"""The indicated angle of a table that holds a sine and a cosine channel in its place."""

from __future__ import annotations

import math
from collections.abc import Iterable
from typing import Final

import numpy as np
from numpy.typing import NDArray

from .. import _core
from ..errors import FileError
from ..formats.columns import listed_columns
from ..support.angles import UNIT_PERIODS, circular_mean, wrap
from ..support.arrays import Array
from ..support.roles import LABELS, RoleColumn, role_code
from .angles import PERIOD
from .rawchannels import TRACKS, Channels
from .readings import FileReadings
from .run import CalibrationRun

#: The column that is made.
_MADE: Final = "angle of sine and cosine"


def with_channel_angle(
    table: FileReadings, periods: tuple[int, ...] | None, reference_counts: float | None
) -> tuple[FileReadings, Channels | None, NDArray[np.bool_] | None]:
    """The table with the angle of its channels as the indicated one, where that is wanted.

    Then their constants and which rows are dropouts.

    It is where ``periods`` in a turn are given, where the channels are named, and where no column
    holds an indicated angle. Offsets are taken out only where the curve does not go round zero
    (an unsigned converter); the sense is that in which the channels follow the reference.

    Raises
    ------
    FileError
        A channel is missing, or both draw no curve.
    """
    roles = table.roles
    pair = [roles.get(role) for role in TRACKS[: 2 * len(periods or (1,))]]
    asked = periods is not None or any(c is not None and c.is_asked for c in pair)
    has_angle = bool({"indicated", "error"} & roles.keys())
    named = "indicated" in roles and roles["indicated"].is_asked
    if None not in pair and not has_angle and "reference" not in roles:
        raise FileError(
            table.path,
            "no column reference_deg, and channels alone are calibrated without one: run "
            f"trueangle selfcal {table.path} --method channels -o MODEL",
            line=1,
        )
    if named or "reference" not in roles or (has_angle and not asked):
        return table, None, None
    if not asked and None in pair:
        return table, None, None
    for role, column in zip(TRACKS, pair, strict=False):
        if column is None:
            raise FileError(
                table.path,
                f"no column {role}: name the channel with {role_code(role, unit=None)}; "
                f"{listed_columns(list(table.columns))}",
                line=1,
            )
    from .checks.channelreadings import ChannelReadings  # a fit of an angle needs none of it

    reference = roles["reference"]
    unit = reference.unit or table.format.unit or "deg"
    period = UNIT_PERIODS.get(unit, PERIOD)
    true = table.values(reference._replace(unit=unit), period, reference_counts)
    values = [table.raw(column) for column in pair if column is not None]
    present = np.isfinite([true, *values]).all(axis=0)
    dropouts = np.zeros(true.size, dtype=bool)
    tracks = []
    for i, count in enumerate(periods or (1,)):
        readings = ChannelReadings.of(*(v[present] for v in values[2 * i : 2 * i + 2]))
        if readings.problem:
            raise FileError(table.path, f"{'second track: ' * i}{readings.problem}", line=1)
        y, x = readings.middle
        track = Channels(offset_sine=y, offset_cosine=x, periods_per_turn=count, period=period)
        tracks.append(track)
        dropouts[present] |= readings.dropouts
    present &= ~dropouts
    channels, (sine, cosine) = tracks[0], values[:2]
    counted = _periods(channels, sine[present], cosine[present], true[present])
    if counted != channels.periods_per_turn:
        raise table.error(
            f"the channels go through {counted} periods in a turn of the reference, not "
            f"{channels.periods_per_turn}: give --periods-per-turn {counted}",
            roles["sine"].name,
        )
    angle, channels = following(channels, sine, cosine, true)
    for track in tracks[1:]:
        channels = channels.replace(second=following(track, values[2], values[3], true)[1])
    made = RoleColumn("indicated", _MADE, next(u for u, p in UNIT_PERIODS.items() if p == period))
    kept = {role: column for role, column in roles.items() if role != "error"}
    columns = {**table.columns, _MADE: angle}
    return table._replace(roles={**kept, "indicated": made}, columns=columns), channels, dropouts


def _periods(channels: Channels, sine: Array, cosine: Array, reference: Array) -> int:
    """Periods in a turn of the reference; those stated where the readings are too far apart."""
    stated = channels.periods_per_turn
    phase = stated / channels.period * channels.angle(sine, cosine)
    moved = wrap(np.diff(reference) / channels.period, 1.0)
    steps = np.nan_to_num(wrap(np.diff(phase), 1.0))
    travel = float(np.abs(moved).sum())
    # Up to this part of a period from reading to reading its periods are counted.
    if travel < 1.0 / stated or np.abs(steps).max(initial=0.0) > 0.3:
        return stated
    counted = abs(float(np.sign(moved) @ steps)) / travel
    return round(counted) if abs(counted - round(counted)) < 0.05 else stated


def following(
    channels: Channels, sine: Array, cosine: Array, reference: Array
) -> tuple[Array, Channels]:
    """The angle of channels in the turns of a reference, and the channels in its sense."""
    period = channels.period / channels.periods_per_turn
    turn = 2.0 * math.pi / period
    angle = channels.angle(sine, cosine)
    known = np.isfinite(angle) & np.isfinite(reference)

    def agreement(sign: float) -> float:
        off = (sign * angle[known] - reference[known]) * turn
        return abs(complex(np.exp(1j * off).mean()))

    if agreement(-1.0) > agreement(1.0):
        channels = channels.replace(direction=-channels.direction)
        angle = -angle
    if channels.periods_per_turn == 1:
        return angle, channels
    zero = circular_mean(angle[known] - reference[known], period)
    return reference + zero + wrap(angle - reference - zero, period), channels


def common_channels(runs: Iterable[CalibrationRun]) -> Channels | None:
    """The channels that all indicated angles were made from; None without."""
    found = {run.channels for run in runs}
    return found.pop() if len(found) == 1 else None


def demodulated(table: FileReadings) -> tuple[FileReadings, float | None]:
    """A row for each period of the excitation, and the phase of the channels against it, degrees.

    Other columns are those of the reading in the middle of the period. A table without excitation
    is as it was.

    Raises
    ------
    FileError
        An empty cell; no periods of four readings and more.
    """
    roles = table.roles
    if not {"sine", "cosine", "excitation"} <= roles.keys():
        return table, None
    columns = [roles[role] for role in ("excitation", "sine", "cosine")]
    carrier, sine, cosine = values = [table.raw(column) for column in columns]
    for column, channel in zip(columns, values, strict=True):
        if not np.isfinite(channel).all():
            row = int(np.flatnonzero(~np.isfinite(channel))[0])
            problem = "a period of the excitation needs all its readings, and this cell is empty"
            raise table.error(problem, column.name, row)
    changes = np.zeros(values[0].size, dtype=bool)
    for role in LABELS:
        if role in roles:
            label = table.columns[roles[role].name]
            changes[1:] |= label[1:] != label[:-1]
    phase, rows, channels = None, [], []
    for part in np.split(np.arange(changes.size), np.flatnonzero(changes)):
        found = _core.demodulate(carrier[part], sine[part], cosine[part], phase)
        if found is None:
            raise FileError(
                table.path,
                f"column {columns[0].name!r} has no periods of 4 readings and more, as an "
                "excitation has: sample it faster, or leave its role out",
                line=1,
            )
        starts, phase = found[0].astype(np.intp), found[3]
        rows.append(part[(starts[:-1] + starts[1:] - 1) // 2])
        channels.append(np.array(found[1:3]))
    middle = np.concatenate(rows)
    kept = {name: column[middle] for name, column in table.columns.items()}
    names = [column.name for column in columns[1:]]
    kept |= dict(zip(names, np.hstack(channels), strict=True))
    others = {role: column for role, column in roles.items() if role != "excitation"}
    return table._replace(columns=kept, roles=others), math.degrees(phase or 0.0)
