"""The error along a simulator's log subtracted from measured runs, by time or by angle."""

from __future__ import annotations

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ...errors import ArgumentError
from ...support.angles import ARCSEC_PER_TURN
from ...support.arrays import Array
from ...support.layout import counted, wrapped_lines
from ...support.plainresult import ShownResult, plain_fields
from ..files import runs_of
from ..run import CalibrationRun
from .clocks import estimated_clocks
from .stream import LEAST, Stream

#: Multiple of the typical step in angle above which a step is a gap.
GAP = 5.0


@dataclass(frozen=True)
class _MeanCurve:
    """Means of neighbouring readings over increasing angles."""

    angle: Array
    error: Array
    is_turn: bool
    step: float

    def at(self, angle: Array) -> tuple[Array, NDArray[np.bool_]]:
        where = np.mod(angle, 360.0) if self.is_turn else angle
        period = 360.0 if self.is_turn else None
        value = np.interp(where, self.angle, self.error, period=period)
        x = self.angle
        if self.is_turn:
            x = np.concatenate([[x[-1] - 360.0], x, [x[0] + 360.0]])
        after = np.clip(np.searchsorted(x, where), 1, x.size - 1)
        known = (x[after] - x[after - 1] <= GAP * self.step) | (where == x[after])
        known &= (where >= x[0] - self.step) & (where <= x[-1] + self.step)
        return value, known


@dataclass(frozen=True)
class TravelledError:
    """The error of a log over its angle.

    Parameters
    ----------
    angle, error : ndarray
        Degrees, the angle without jumps at a turn.
    direction : ndarray
        -1 or 1 of every reading; 0 before the first motion.
    """

    angle: Array
    error: Array
    direction: Array

    @property
    def has_both(self) -> bool:
        """The log moved both ways."""
        return bool((self.direction > 0).any() and (self.direction < 0).any())

    @property
    def step(self) -> float:
        """Typical distance of two readings."""
        steps = np.abs(np.diff(self.angle))
        return float(np.median(steps[steps > 0.0])) if (steps > 0.0).any() else 0.0

    def at(self, angle: Array, direction: Array) -> tuple[Array, NDArray[np.bool_]]:
        """Error at angles of a travel, and which of them the log covers.

        Over the log's whole travel where that holds these angles, else modulo a turn.
        """
        angle = angle + self._turns(angle)
        low, high = float(self.angle.min()) - self.step, float(self.angle.max()) + self.step
        is_outside = bool(angle.min() < low or angle.max() > high)
        # Part of a turn that may be missing in a log of a whole turn.
        is_turn = is_outside and high - low >= 0.98 * 360.0
        curves = self._curves(is_turn)
        error = np.zeros(angle.size)
        known = np.zeros(angle.size, dtype=bool)
        for sign in (-1, 1):
            rows = direction < 0 if sign < 0 else direction >= 0
            curve = curves.get(sign, next(iter(curves.values())))
            error[rows], known[rows] = curve.at(angle[rows])
        return error, known

    @property
    def std(self) -> float:
        """Scatter of the log's own readings about the curve, degrees: passes that differ."""
        error, _ = self.at(self.angle, self.direction)
        return float(np.std(self.error - error))

    def _turns(self, angle: Array) -> float:
        """Whole turns, in degrees, that bring angles to those of the log."""
        own, other = (0.5 * float(x.min() + x.max()) for x in (self.angle, angle))
        return 360.0 * round((own - other) / 360.0)

    def _curves(self, is_turn: bool) -> Mapping[int, _MeanCurve]:
        found = {}
        for sign in (-1, 1):
            rows = self.direction < 0 if sign < 0 else self.direction >= 0
            if rows.any():
                found[sign] = self._curve(rows, is_turn)
        return found

    def _curve(self, rows: NDArray[np.bool_], is_turn: bool) -> _MeanCurve:
        angle = np.mod(self.angle[rows], 360.0) if is_turn else self.angle[rows]
        step = self.step or 1.0
        bins, place, count = np.unique(
            np.floor(angle / step), return_inverse=True, return_counts=True
        )
        mean = np.bincount(place, angle, bins.size) / count
        error = np.bincount(place, self.error[rows], bins.size) / count
        return _MeanCurve(mean, error, is_turn, step)


#: How a log may be brought to the readings.
BY = ("time", "angle")
#: rms difference of two motions, relative to their rms, from which on they are not the same.
SAME_MOTION = 0.05
#: Share of a run's readings that the log must cover in time.
COVERED = 0.5


@dataclass(frozen=True)
class MeasuredMinusSimulated(ShownResult):
    """Measured runs minus the error in a simulator's log.

    Attributes
    ----------
    runs : list of CalibrationRun
        ``indicated`` is lowered by the simulated error: the remainder is for a diagnosis.
    source : str
        The log.
    by : tuple of str
        "time" or "angle", for each run.
    left_out : int
        Readings that the log does not cover.
    offsets_s : tuple of float
        Seconds from the clock of every run to that of the log; 0 where it is joined by angle.
    std_arcsec : float
        Standard deviation that the joining adds to an error.
    notes : tuple of str
    logs : list of CalibrationRun
        Motion of every run, from the log.
    """

    runs: list[CalibrationRun]
    source: str
    by: tuple[str, ...]
    left_out: int
    offsets_s: tuple[float, ...]
    std_arcsec: float
    notes: tuple[str, ...]
    logs: list[CalibrationRun] = field(repr=False, compare=False, default_factory=list)

    @property
    def noise_arcsec(self) -> float:
        """Standard deviation of white noise that the log's own encoder has.

        By the second differences of its error in the order of its readings, those apart at
        which play turns over.
        """
        bends = [np.abs(np.diff(_error(log), 2)) for log in _each_once(self.logs)]
        if not bends:
            return 0.0
        every = np.concatenate(bends)
        # Multiple of the median of second differences, 6 standard deviations, that noise does not
        # reach.
        usual = every[every <= (6.0 / 0.6745) * np.median(every)]
        rms = math.sqrt(float(np.mean(usual**2)) / 6.0)
        return rms * ARCSEC_PER_TURN / 360.0

    def to_dict(self) -> dict[str, Any]:
        """Plain values."""
        return plain_fields(self, "source joined_by=by left_out offsets_s std_arcsec notes")

    def summary(self) -> str:
        """How the log was joined, in a line and its notes."""
        how = " and ".join(dict.fromkeys(self.by))
        text = (
            f"Simulated: {self.source}, joined by {how}; joining adds {self.std_arcsec:.2g} arcsec"
        )
        if self.left_out:
            verb = "is" if self.left_out == 1 else "are"
            silent = counted(self.left_out, "reading")
            text += f"; {silent} without a simulated value {verb} omitted"
        return "\n".join(wrapped_lines(". ".join([text, *self.notes]) + "."))


class _Expected(NamedTuple):
    """The simulated error at the readings of a run, degrees, where the log covers them."""

    by: str
    error: Array
    known: NDArray[np.bool_]
    std: float
    offset: float = 0.0
    note: str = ""


def minus_simulated(
    runs: CalibrationRun | Iterable[CalibrationRun],
    simulated: Any,
    *,
    by: str | None = None,
    **reading: Any,
) -> MeasuredMinusSimulated:
    """Measured runs minus a simulator's log of the same joint.

    ::

        r_i' = r_i - ε_sim(t_i)    or    r_i' = r_i - ε_sim(θ_i, sgn θ̇_i)

    Parameters
    ----------
    runs : CalibrationRun or iterable of CalibrationRun
    simulated : path, table or iterable of CalibrationRun
        The log, as `trueangle.runs.files.runs_of` takes it: ``reference`` is the simulator's
        true output angle, ``indicated`` that of the simulated encoder (or command). One run for
        all measured runs, or runs of the same labels.
    by : {"time", "angle"}, optional
        By default by time where both have one and the motions are the same, else by angle.
    **reading
        ``signals``, ``counts_per_turn`` ... of the log, as in `trueangle.read_runs`.

    Returns
    -------
    MeasuredMinusSimulated

    Raises
    ------
    ArgumentError
        Runs without a counterpart, no time, or nothing in common.
    FileError
        As `trueangle.read_runs`, for the log.

    Notes
    -----
    In time by lines or cubics through the log's own readings, exact at equal times; an offset
    of the clocks is estimated where the motion determines it. By angle over the whole travel if
    that holds the measured one, else modulo a turn, for each direction that the log has; there
    the log must count its angle from the same place. Cost: a sort of each run.

    Examples
    --------
    >>> theta = np.arange(0.0, 360.0)
    >>> run = CalibrationRun(theta, theta + 0.3, period=360.0)
    >>> log = {"reference_deg": theta, "indicated_deg": theta + 0.1}
    >>> left = minus_simulated(run, log)
    >>> left.by, round(float(left.runs[0].error.mean()), 9)
    (('angle',), 0.2)
    """
    if by is not None and by not in BY:
        raise ArgumentError(f"by must be {' or '.join(BY)}, got {by!r}")
    measured = runs_of(runs, {})
    logs = runs_of(simulated, reading, "simulated", "simulated")
    source = logs[0].source.file if logs and logs[0].source else "simulated runs"
    logs = _counterparts(measured, logs, source)
    found, kept = [], []
    for run, log in zip(measured, logs, strict=True):
        expected = _expected(run, log, by, source)
        if np.count_nonzero(expected.known) < LEAST:
            raise ArgumentError(
                f"{source} has no value for {np.count_nonzero(~expected.known)} of the {len(run)} "
                f"readings of run {run.label or '1'}: its {expected.by} is another"
            )
        kept.append(_lowered(run, expected))
        found.append(expected)
    return MeasuredMinusSimulated(
        kept,
        source,
        tuple(part.by for part in found),
        sum(int(np.count_nonzero(~part.known)) for part in found),
        tuple(part.offset for part in found),
        math.sqrt(float(np.mean([part.std**2 for part in found]))) * ARCSEC_PER_TURN / 360.0,
        tuple(dict.fromkeys(part.note for part in found if part.note)),
        logs,
    )


def _counterparts(
    measured: Sequence[CalibrationRun], logs: Sequence[CalibrationRun], source: str
) -> list[CalibrationRun]:
    """The simulated run of every measured one."""
    if len(logs) == 1:
        return [logs[0]] * len(measured)
    by_label = {log.label: log for log in logs}
    missing = [run.label for run in measured if run.label not in by_label]
    labels = [log.label for log in logs]
    if missing or len(by_label) < len(logs):
        twice = next((label for label in labels if labels.count(label) > 1), None)
        why = f"none of them for run {missing[0]}" if missing else f"several of them called {twice}"
        raise ArgumentError(
            f"{source} has {len(logs)} runs ({', '.join(map(str, labels[:6]))}), {why}: give its "
            "runs the labels of the measured ones, or one run that holds all motion"
        )
    return [by_label[run.label] for run in measured]


def _lowered(run: CalibrationRun, expected: _Expected) -> CalibrationRun:
    """The run's readings that the log covers, less the error there."""
    rows = expected.known
    lowered = run.indicated[rows] - expected.error[rows] * (run.period / 360.0)
    return run.part(rows, indicated=lowered)


def _expected(run: CalibrationRun, log: CalibrationRun, by: str | None, source: str) -> _Expected:
    if by != "angle":
        if run.time is not None and log.time is not None:
            found = _in_time(run, log, is_asked=by == "time")
            if found is not None:
                return found
        elif by == "time":
            lacks = source if log.time is None else f"run {run.label or '1'}"
            raise ArgumentError(f"{lacks} has no time: give a column time_s, or join by angle")
    travelled = TravelledError(_degrees(log), _error(log), log.direction)
    error, known = travelled.at(_degrees(run), run.direction)
    note = ""
    if by is None and run.time is not None and log.time is not None:
        note = f"The motion of {source} is another than that of the readings"
    if not travelled.has_both and np.unique(run.direction).size > 1:
        note += (". " if note else "") + f"{source} moves in one direction only: its error is "
        note += "used for both"
    return _Expected("angle", error, known, travelled.std, note=note)


def _in_time(run: CalibrationRun, log: CalibrationRun, is_asked: bool) -> _Expected | None:
    """The log's error at the times of the run; None where the two moved otherwise."""
    assert run.time is not None
    assert log.time is not None
    own, other = Stream.of(run.time, _degrees(run)), Stream.of(log.time, _degrees(log))
    offset, apart = 0.0, _apart(own, other, 0.0)
    size = float(np.std(own.angle))
    if apart > 0.0:
        try:
            clocks = estimated_clocks(own, other, None, 0.0)
        except ArgumentError:
            clocks = None
        if clocks is not None and clocks.offset_std is not None:
            nearer = _apart(own, other, clocks.offset)
            # Factor by which another offset of the clocks must reduce the difference to be used.
            if 2.0 * nearer < apart:
                offset, apart = clocks.offset, nearer
    if apart > SAME_MOTION * size and not (is_asked and math.isfinite(apart)):
        if not is_asked:
            return None
        raise ArgumentError(
            "the log and the readings share no time: give the log the same clock, or join by angle"
        )
    error = Stream(*_each_time_once(log.time, _error(log)))
    there = run.time + offset
    known = error.covers(there)
    inside = np.clip(there, error.time[0], error.time[-1])
    exact = bool(np.isin(inside[known], error.time).all())
    note = f"The clock of the log is taken as shifted by {offset:.6g} s" if offset else ""
    std = 0.0 if exact else error.interpolation_std
    return _Expected("time", error.at(inside)[0], known, std, offset, note)


def _apart(own: Stream, other: Stream, offset: float) -> float:
    """How far two motions differ (rms, degrees) beyond a constant; infinite with no common time."""
    there = own.time + offset
    inside = other.covers(there)
    if np.count_nonzero(inside) < max(LEAST, COVERED * inside.size):
        return math.inf
    difference = own.angle[inside] - other.at(there[inside])[0]
    return float(np.sqrt(np.mean((difference - np.median(difference)) ** 2)))


def _each_once(logs: Sequence[CalibrationRun]) -> Iterable[CalibrationRun]:
    return {id(log): log for log in logs if len(log) >= LEAST}.values()


def _each_time_once(time: Array, values: Array) -> tuple[Array, Array]:
    stamps, first, count = np.unique(time, return_index=True, return_counts=True)
    return stamps, np.add.reduceat(values, first) / count


def _degrees(run: CalibrationRun) -> Array:
    return run.unwrapped_reference * (360.0 / run.period)


def _error(run: CalibrationRun) -> Array:
    return run.centred_error * (360.0 / run.period)
