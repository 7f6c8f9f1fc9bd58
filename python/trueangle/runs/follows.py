"""Does the indicated angle follow the reference? Wrong units and signs found out."""

from __future__ import annotations

import math
import warnings
from collections.abc import Iterator, Sequence
from dataclasses import replace
from itertools import permutations

import numpy as np

import trueangle._core as _core

from ..errors import ArgumentError, UnitWarning
from ..support.angles import wrap
from ..support.arrays import quantile
from ..support.roles import role_code, turned_code
from .checks.angles import (
    COARSE,
    LEAST_JUMP,
    LOOKED_AT,
    OTHER_UNIT,
    STRAIGHT,
    UNUSABLE_ANGLES,
    angle_ratio,
    bending,
    mixed_units,
    ratio_suggestion,
    usual_step,
)
from .checks.fault import DataFault
from .checks.record import Record, records_of
from .run import CalibrationRun

#: Readings looked at; a mistake of unit shows in any few.
_SAMPLE = 1000

#: Resultant length (1 = all differences equal, 0 = spread over the turn). Errors of a
#: whole 60 deg standard deviation still give 0.58.
_FOLLOWS = 0.5

#: A remedy is only named when it makes the differences agree this well.
_REMEDIED = 0.95

#: How near a measured ratio is to that of two units.
_NEAR = 0.01


#: Radians beyond which a reference may as well be degrees: ten turns.
_MANY_TURNS = 10.0
_MANY = 2.0 * math.pi * _MANY_TURNS


#: How far beyond the spread of the errors a line may go that half of them are near.
_LINE = 1.0 + 2.0 * STRAIGHT

#: Orders that are fitted in degrees and in radians; degrees are reported where they leave less
#: than this share of the power that radians leave.
_HIGHEST, _LEFT = 3, 0.25

_TURNS = {"degrees": 360.0, "radians": 2.0 * math.pi, "turns": 1.0}


def check_follows(run: CalibrationRun) -> None:
    """Raise when ``indicated - reference`` is spread over the whole turn.

    Raises
    ------
    ArgumentError
        States what the indicated angle looks like instead: another unit, the other sign.

    Warns
    -----
    UnitWarning
        Angles whose error repeats with 360, and not with 2 pi.
    """
    if run.period == _TURNS["radians"] and run.reference[run.reference.argmax()] > _MANY:
        _warn_of_degrees(_some_of(run))
    for says, remedy in _unrelated(run, _of(run)):
        raise ArgumentError(f"{says}: {remedy}")


def unrelated_angles(records: list[Record]) -> Iterator[DataFault]:
    """Records whose two angles no fit takes."""
    for record in records:
        for found in _unrelated(record.run, f" of {record.name}"):
            yield record.fault("unrelated_angles", (), *found)


def _unrelated(run: CalibrationRun, which: str) -> Iterator[tuple[str, str]]:
    """That the indicated angle does not follow the reference, and the remedy."""
    some = _some_of(run)
    if len(some) < 4 or _core.resultant(some.indicated, some.reference, run.period) >= _FOLLOWS:
        return
    ratio = _ratio(run)
    # By the travel where readings are dense enough to follow it; else, where steps of more
    # than half a turn hide it, by what would make the differences agree.
    found = (
        text
        for text, factor in _remedies(run).items()
        if (
            abs(factor * ratio - 1.0) < _NEAR
            if ratio is not None
            else _core.resultant(factor * some.indicated, some.reference, run.period) > _REMEDIED
        )
    )
    says = (
        f"the indicated angle{which} does not follow the reference "
        "(their differences are spread over the whole turn)"
    )
    yield says, next(found, None) or _moves(ratio)


def check_usable(runs: Sequence[CalibrationRun]) -> None:
    """Raise where the angles of runs must not be used, by the tests of `trueangle.check`.

    Raises
    ------
    ArgumentError
        As `check_follows`; a fault that makes the angles unusable, with its remedy.

    Warns
    -----
    UnitWarning
        As `check_follows`.
    """
    strides = [1 + (run.reference.size - 1) // LOOKED_AT for run in runs]
    if _are_plain(runs, strides):
        return
    records = [
        replace(record, stride=stride)
        for record, stride in zip(records_of(map(_some_of, runs, strides)), strides, strict=True)
    ]
    _refuse(mixed_units(records))
    for run in runs:
        check_follows(run)
    for test in UNUSABLE_ANGLES:
        _refuse(test(records))


def _refuse(faults: Iterator[DataFault]) -> None:
    for fault in faults:
        raise ArgumentError(f"the data must not be used as they are: {fault}")


def _are_plain(runs: Sequence[CalibrationRun], strides: Sequence[int]) -> bool:
    """Whether bounds of the angles alone leave nothing to find to the tests of `check_usable`.

    Every ``stride``-th reading of a run is looked at. Never true of what a test would refuse. The
    test of the ratio needs a line of slope ``b`` that half of the errors are at most 3 % of their
    spread ``p`` off. Where no segment of the travel shorter than ``h`` holds half of the readings,
    ``|b| h <= 1.06 p``.
    """
    sizes = []
    for run, stride in zip(runs, strides, strict=True):
        step, long_steps, slip, spread, travel, half, size = _core.following(
            run.indicated, run.reference, run.period, stride, COARSE / 360.0
        )
        # Errors within a third of a turn have a resultant of at least `_FOLLOWS`.
        if slip > LEAST_JUMP / 360.0 or spread > 1.0 / 3.0:
            return False
        steps = -(-run.reference.size // stride) - 1
        bent = step + slip < 0.5 and _LINE * spread < half * bending(travel)
        # Where as many steps are coarse, the test of the ratio knows no travel.
        if not bent and long_steps < steps - int(0.9 * (steps - 1)):
            return False
        angles = (run.reference[::stride], run.indicated[::stride])
        scale = 360.0 / run.period
        if step > LEAST_JUMP / 360.0 and any(usual_step(scale * angle) for angle in angles):
            return False
        # Turns up to which a place within one is known to far more than is looked at.
        if size > (_MANY_TURNS if run.period == _TURNS["radians"] else 2.0**30):
            return False
        sizes.append(size)
    return len(sizes) == 1 or min(sizes) > max(sizes) * OTHER_UNIT


def _some_of(run: CalibrationRun, stride: int | None = None) -> CalibrationRun:
    """Every ``stride``-th reading; about `_SAMPLE` of them by default."""
    return run.part(slice(None, None, stride or max(len(run) // _SAMPLE, 1)))


def _of(run: CalibrationRun) -> str:
    return f" of run {run.label}" if run.label else ""


def _warn_of_degrees(run: CalibrationRun) -> None:
    """Warn where low orders of 360 explain the error, and those of 2 pi do not.

    A motor of some sixty turns to one of its output shows much the same: no error then.
    """
    left, reference, indicated = {}, run.reference, run.indicated
    for period in (_TURNS["radians"], _TURNS["degrees"]):
        error = wrap(indicated - reference, period)
        angle = np.outer(reference, np.arange(1, _HIGHEST + 1)) * (2.0 * math.pi / period)
        lines = np.column_stack([np.ones(angle.shape[0]), np.cos(angle), np.sin(angle)])
        if angle.shape[0] <= 2 * lines.shape[1]:
            return
        rest = error - lines @ np.linalg.lstsq(lines, error, rcond=None)[0]
        left[period] = float(rest @ rest)
    if left[_TURNS["degrees"]] < _LEFT * left[_TURNS["radians"]]:
        warnings.warn(
            f"the reference{_of(run)} goes to {float(reference.max()):.6g}, and its error repeats "
            "with 360: if these are degrees, give `period=360` (the default is 2*pi, radians)",
            UnitWarning,
            stacklevel=6,
        )


def _remedies(run: CalibrationRun) -> dict[str, float]:
    """What the indicated angle may be instead, with the factor that puts it right."""
    period, (name, _) = run.period, run.roles.get("indicated", ("NAME", None))
    found = {f"it runs backwards: change its sign with {turned_code(run.roles)}": -1.0}
    # A column is converted when it is read: its unit need not be that of the run, which
    # is only the likeliest.
    columns = sorted(_TURNS, key=lambda unit: not math.isclose(_TURNS[unit], period))
    for column, unit in permutations(columns, 2):
        code = role_code("indicated", name, "turn" if unit == "turns" else unit[:3])
        factor = _TURNS[column] / _TURNS[unit]
        found[f"it looks like {unit} in a column of {column}: give {code}"] = factor
    return found


def _ratio(run: CalibrationRun) -> float | None:
    """Travel of the indicated angle per travel of the reference, where readings show it."""
    (record,) = records_of([run])
    ratio = angle_ratio([record])
    if ratio is None or ratio == 0.0:
        return None
    reference, indicated = record.unwrapped
    # Step of the indicated angle (degrees) that may be a turn more or less.
    fast = float(quantile(np.abs(np.diff(indicated)), 0.9)) > 120.0
    agree = _core.resultant(indicated / ratio, reference, 360.0) > _REMEDIED
    return ratio if agree and not fast else None


def _moves(ratio: float | None) -> str:
    if ratio is None:
        return "check units, sign, gear ratio and that the rows belong together"
    return (
        f"it moves {ratio:.6g} times as far as the reference, which looks like "
        f"{ratio_suggestion(ratio, 0.0)}; unwrap it and divide it by {ratio:.6g}"
    )
