"""Signals of runs, joined: angle, direction, travel, speed, load, temperature of every reading."""

from __future__ import annotations

import itertools
import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..runs.aliasing import count_positions
from ..runs.run import CalibrationRun
from ..support.angles import unwrapped
from ..support.arrays import Array, median
from ..support.signals import coupled_joint
from .lattice import CLOSES, UniformGrid, lattice_step, sensor_lattice, uniform_grid

#: Readings that make a line, and a parabola.
LINE, PARABOLA = 2, 3


def direction_at_turns(angle: Array, clock: Array, direction: Array) -> Array:
    """Directions of the steps, corrected for readings taken after the turning point.

    The step that leads to the reading farthest out may hold the turning point: the joint then moves
    the other way already. Of the two lines that the readings before and after it make in time,

    ::

        θ₋(t), θ₊(t),

    it belongs to the one that predicts its angle.

    ``angle`` is unwrapped, ``clock`` holds times, or places in the record where none were recorded,
    and ``direction`` is that of the step that led to each reading.

    Examples
    --------
    >>> clock = np.arange(7.0)
    >>> angle = 10.0 - 4.0 * np.abs(clock - 2.8)
    >>> steps = np.sign(np.diff(angle, prepend=-np.inf))
    >>> steps.tolist()
    [1.0, 1.0, 1.0, 1.0, -1.0, -1.0, -1.0]
    >>> direction_at_turns(angle, clock, steps).tolist()
    [1.0, 1.0, 1.0, -1.0, -1.0, -1.0, -1.0]
    """
    found = direction.copy()
    edges = _edges(direction)
    for begin, turn, end in zip(edges[:-2], edges[1:-1], edges[2:], strict=True):
        k = turn - 1
        if k - begin < LINE or end - turn < LINE:
            continue
        before = _at(clock[k], clock[k - LINE : k], angle[k - LINE : k])
        after = _at(clock[k], clock[turn : turn + LINE], angle[turn : turn + LINE])
        # Share of the one line's error below which the other one's must be to claim the reading:
        # where both are similar the joint may have stopped there, and the direction stays.
        if abs(angle[k] - after) < 0.5 * abs(angle[k] - before):
            found[k] = direction[turn]
    return found


def velocity_at_turns(angle: Array, time: Array, direction: Array, velocity: Array) -> Array:
    """Velocities by central differences, corrected next to turning points.

    A difference of angles across the turning point is no speed: the last reading before it and the
    first one after it have the slope of the parabola through the readings on their own side.

    Examples
    --------
    >>> time = np.arange(8.0)
    >>> angle = 10.0 - 4.0 * np.abs(time - 3.4)
    >>> velocity = np.gradient(angle, time)
    >>> direction = np.where(time < 3.4, 1.0, -1.0)
    >>> velocity_at_turns(angle, time, direction, velocity).round(9).tolist()
    [4.0, 4.0, 4.0, 4.0, -4.0, -4.0, -4.0, -4.0]
    """
    found = velocity.copy()
    for begin, end in itertools.pairwise(_edges(direction)):
        if end - begin < PARABOLA:
            continue
        if begin > 0:
            found[begin] = _slope(time[begin : begin + PARABOLA], angle[begin : begin + PARABOLA])
        if end < angle.size:
            last = slice(end - 1, end - PARABOLA - 1 if end > PARABOLA else None, -1)
            found[end - 1] = _slope(time[last], angle[last])
    return found


def _edges(direction: Array) -> list[int]:
    cuts = np.flatnonzero(np.diff(direction)) + 1
    return [0, *cuts.tolist(), direction.size]


def _at(when: float, time: Array, angle: Array) -> float:
    """The line through two readings at another time; through the nearer where they are one."""
    apart = float(time[1] - time[0])
    slope = float(angle[1] - angle[0]) / apart if apart != 0.0 else 0.0
    return float(angle[0]) + slope * (when - float(time[0]))


def _slope(time: Array, angle: Array) -> float:
    """Slope at the first of three readings of the parabola through them."""
    a, b = float(time[1] - time[0]), float(time[2] - time[0])
    if a == 0.0 or b in (0.0, a):
        return float(angle[2] - angle[0]) / b if b != 0.0 else 0.0
    first, second = float(angle[1] - angle[0]) / a, float(angle[2] - angle[0]) / b
    return first + (first - second) * a / (b - a)


Index = NDArray[np.int64]


#: Sign changes that are taken as they are, however short the run.
REVERSALS_TRUSTED = 10


@dataclass(frozen=True, eq=False)
class Signals:
    """Readings of several runs, one after the other, as plain arrays.

    Attributes
    ----------
    theta : ndarray, shape (n,)
        True output angle, radians, unwrapped within each run.
    run, row : ndarray of int, shape (n,)
        Index of the run and of the row within it.
    direction : ndarray
        -1 or +1; 0 where nothing ever moved.
    travel : ndarray
        Degrees moved since the last reversal (or since the start of the run).
    segment : ndarray of int
        Segment of one direction that the reading belongs to.
    segment_direction, segment_length : ndarray, shape (segments,)
        Direction and whole length (degrees) of every segment.
    segment_first : ndarray of bool
        The segment opens its run.
    clock : ndarray
        Seconds since the start of the run, or the row number without time.
    velocity, time, temperature, torque, mount, current : ndarray or None
        Degrees per second, s, Celsius, Nm, radians, A; None where not every run recorded it.
    coupled : mapping of str to ndarray
        Indicated angles of other joints by their names, degrees, unwrapped within each run; of
        those that every run recorded.
    count : float
        Arcsec of one count, where the indicated angles lie on a lattice of the sensor's; else 0.
    table : int
        Positions of a turn, where the readings are a table of equal steps; else 0.
    labels : tuple of str
        Names of the runs.
    """

    theta: Array
    run: Index
    row: Index
    direction: Array
    travel: Array
    segment: Index
    segment_direction: Array
    segment_length: Array
    segment_first: NDArray[np.bool_]
    clock: Array
    velocity: Array | None
    time: Array | None
    temperature: Array | None
    torque: Array | None
    mount: Array | None
    labels: tuple[str, ...]
    current: Array | None = None
    coupled: Mapping[str, Array] = field(default_factory=dict)
    count: float = 0.0
    table: int = 0

    def __len__(self) -> int:
        return int(self.theta.size)

    @property
    def runs(self) -> int:
        """Number of runs."""
        return len(self.labels)

    @property
    def degrees(self) -> Array:
        """True output angle in degrees."""
        return np.degrees(self.theta)

    @property
    def turns_per_s(self) -> Array:
        """Signed output speed in turns per second (zeros where unknown)."""
        return np.zeros_like(self.theta) if self.velocity is None else self.velocity / 360.0

    @cached_property
    def grid(self) -> UniformGrid | None:
        """Equal steps of a turn on which the design put the readings, or None."""
        return UniformGrid(self.table) if self.table else None

    @cached_property
    def places(self) -> int:
        """Distinct places of a turn: orders above half as many are not identifiable alone."""
        return count_positions(self.theta / (2.0 * np.pi))

    @cached_property
    def even_rate(self) -> float:
        """Equal steps in a turn that all runs keep to, each from its own start; 0 for none.

        There, a line whose phase is new in every run has the same values as one whose order is
        higher or lower by this rate, whether the steps close after a turn or not.
        """
        runs = (self.theta[a:b] / (2.0 * np.pi) for a, b in self.run_bounds())
        step = lattice_step(np.concatenate([run - run[0] for run in runs]))
        return 1.0 / step if step else 0.0

    def take(self, rows: NDArray[np.bool_] | Index) -> Signals:
        """The readings ``rows``; runs keep their index and segments their history."""
        changes = {
            name: getattr(self, name)[rows]
            for name in ("theta", "run", "row", "direction", "travel", "segment", "clock")
        }
        for name in RECORDED:
            values = getattr(self, name)
            changes[name] = None if values is None else values[rows]
        changes["coupled"] = {joint: angle[rows] for joint, angle in self.coupled.items()}
        return replace(self, **changes)

    def followed_by(self, later: Signals) -> Signals:
        """These readings and those of later runs; what one of both lacks is None."""
        changes: dict[str, Any] = {
            name: np.concatenate([getattr(self, name), getattr(later, name)])
            for name in (
                *("theta", "row", "direction", "travel", "clock"),
                *("segment_direction", "segment_length", "segment_first"),
            )
        }
        for name in RECORDED:
            changes[name] = _all([getattr(self, name), getattr(later, name)])
        both = self.coupled.keys() & later.coupled.keys()
        changes["coupled"] = {
            joint: np.concatenate([self.coupled[joint], later.coupled[joint]]) for joint in both
        }
        return replace(
            self,
            **changes,
            run=np.concatenate([self.run, later.run + self.runs]),
            segment=np.concatenate([self.segment, later.segment + self.segment_direction.size]),
            table=_common_table(self, later),
            labels=(*self.labels, *later.labels),
        )

    def run_bounds(self) -> list[tuple[int, int]]:
        """First and one-past-last reading of every run that has readings, in order."""
        if not len(self):
            return []
        cuts = np.flatnonzero(np.diff(self.run)) + 1
        edges = [0, *cuts.tolist(), len(self)]
        return list(itertools.pairwise(edges))

    def run_turns(self) -> Array:
        """Output turns between the ends of every run's travel, in order."""
        covered = [np.ptp(self.theta[start:stop]) for start, stop in self.run_bounds()]
        return np.array(covered) / (2.0 * np.pi)

    def presliding(self, length_deg: float, start_state: float) -> Array:
        """State z of a presliding spring of transition length L, in [-1, 1].

        ::

            z(s) = d - (d - z₀) e^(-s/L)

        with travel s since the reversal and state z_0 there. A run starts at
        ``start_state * d``: 0 relaxed, 1 after a run-in in the same direction.
        """
        decay = np.exp(-np.minimum(self.segment_length / length_deg, 700.0))
        start = np.zeros(self.segment_direction.size)
        state = 0.0
        for k, (d, keep, first) in enumerate(
            zip(
                self.segment_direction.tolist(),
                decay.tolist(),
                self.segment_first.tolist(),
                strict=True,
            )
        ):
            if first:
                state = start_state * d
            start[k] = state
            state = d - (d - state) * keep
        d = self.segment_direction[self.segment]
        return np.asarray(
            d - (d - start[self.segment]) * np.exp(-np.minimum(self.travel / length_deg, 700.0))
        )

    def play(self, half_width_deg: float, start_state: float = 1.0) -> Array:
        """Position of the angle within a play of that half width, in [-1, 1].

        It goes from one side to the other over twice the half width after each reversal; a run
        starts at ``start_state * d``: 0 in the middle, 1 at the side of its direction.
        """
        state, start = 0.0, np.zeros(self.segment_direction.size)
        stretches = zip(
            self.segment_direction.tolist(),
            (self.segment_length / half_width_deg).tolist(),
            self.segment_first.tolist(),
            strict=True,
        )
        for k, (d, crossed, first) in enumerate(stretches):
            start[k] = state = start_state * d if first else state
            state = d * min(d * state + crossed, 1.0)
        d = self.segment_direction[self.segment]
        reached = d * start[self.segment] + self.travel / half_width_deg
        return np.asarray(d * np.minimum(reached, 1.0))


def join_runs(runs: Sequence[CalibrationRun]) -> Signals:
    """Signals of ``runs``; a quantity that some run lacks is None for all."""
    parts = [_travel(run) for run in runs]
    theta = np.concatenate([run.unwrapped_reference * (2.0 * math.pi / run.period) for run in runs])
    count, table = sensor_lattice(runs, theta)
    offset = np.cumsum([0, *(part[3].size for part in parts[:-1])])
    return Signals(
        theta=theta,
        run=np.repeat(np.arange(len(runs)), [len(run) for run in runs]),
        row=np.concatenate([np.arange(len(run)) for run in runs]),
        direction=np.concatenate([part[0] for part in parts]),
        travel=np.concatenate([part[1] for part in parts]),
        segment=np.concatenate([part[2] + o for part, o in zip(parts, offset, strict=True)]),
        segment_direction=np.concatenate([part[3] for part in parts]),
        segment_length=np.concatenate([part[4] for part in parts]),
        segment_first=np.concatenate([np.arange(part[3].size) == 0 for part in parts]),
        clock=np.concatenate([_clock(run) for run in runs]),
        **{
            name: _all([read(run, part[0]) for run, part in zip(runs, parts, strict=True)])
            for name, read in RECORDED.items()
        },
        coupled=_coupled(runs),
        count=count,
        table=table,
        labels=tuple(run.label or str(j + 1) for j, run in enumerate(runs)),
    )


def _common_table(first: Signals, later: Signals) -> int:
    """Positions of a turn on which all readings lie; 0 if later ones lie between them."""
    grid = uniform_grid(np.concatenate([first.theta, later.theta]))
    if grid is not None or first.table != later.table:
        return 0 if grid is None else grid.positions
    one, other = (np.mean(np.exp(1j * first.table * each.theta)) for each in (first, later))
    beside = float(np.angle(one * np.conj(other))) / (2.0 * np.pi)
    return first.table if abs(beside) < CLOSES else 0


def _all(parts: Sequence[Array | None]) -> Array | None:
    present = [part for part in parts if part is not None]
    return np.concatenate(present) if len(present) == len(parts) else None


def _clock(run: CalibrationRun) -> Array:
    if run.time is None or run.time[-1] == run.time[0]:
        return np.arange(len(run), dtype=np.float64)
    return np.asarray(run.time - run.time[0])


def _velocity(run: CalibrationRun, direction: Array) -> Array | None:
    speed = run.speed
    if speed is None:
        return None
    if run.velocity is None and run.time is not None:
        speed = velocity_at_turns(run.unwrapped_reference, run.time, direction, speed)
    return np.asarray(speed * (360.0 / run.period))


def _coupled(runs: Sequence[CalibrationRun]) -> dict[str, Array]:
    """Angles of the other joints that every run recorded, in degrees."""
    return {
        joint: np.concatenate(
            [unwrapped(run.signals[name], run.period) * (360.0 / run.period) for run in runs]
        )
        for name in runs[0].signals
        if (joint := coupled_joint(name)) and all(name in run.signals for run in runs)
    }


def _mount(run: CalibrationRun, direction: Array) -> Array | None:
    return None if run.mount is None else run.mount * (2.0 * math.pi / run.period)


#: How each signal that runs may record is read from one of them and its direction of travel.
RECORDED: dict[str, Callable[[CalibrationRun, Array], Array | None]] = {
    "velocity": _velocity,
    "time": lambda run, _: run.time,
    "temperature": lambda run, _: run.temperature,
    "torque": lambda run, _: run.torque,
    "mount": _mount,
    "current": lambda run, _: run.signals.get("current"),
}


def _travel(run: CalibrationRun) -> tuple[Array, Array, Index, Array, Array]:
    """Direction, travel, segment of every reading; direction and length of every segment."""
    angle = run.unwrapped_reference * (360.0 / run.period)
    direction = run.direction
    steps = np.diff(angle)
    if not direction.any() and steps.any():
        # At rest at every reading: the direction is that of the approach.
        sign = np.sign(np.concatenate([steps[:1], steps]))
        last = np.maximum.accumulate(
            np.where(sign != 0.0, np.arange(sign.size), np.flatnonzero(sign)[0])
        )
        direction = sign[last]
    # Of more sign changes between neighbouring steps the direction is read with a dead zone: a
    # reference at rest flickers by a count, a moving one does not; ten are taken as they are.
    if np.count_nonzero(np.diff(direction)) > max(0.05 * len(run), REVERSALS_TRUSTED):
        direction = _dead_zone_direction(angle)
    elif run.velocity is None and "direction" not in run.signals:
        direction = direction_at_turns(angle, _clock(run), direction)
    cuts = np.flatnonzero(np.diff(direction)) + 1
    edges = np.concatenate([[0], cuts, [len(run)]])
    segment = np.repeat(np.arange(edges.size - 1), np.diff(edges))
    # A segment starts at the turning point: the farther of the readings on both sides.
    before, after = angle[np.maximum(edges[:-1] - 1, 0)], angle[edges[:-1]]
    old = np.concatenate([direction[:1], direction[edges[:-2]]])
    origin = np.where((after - before) * old > 0.0, after, before)
    end = np.concatenate([origin[1:], angle[-1:]])
    return (
        direction,
        np.abs(angle - origin[segment]),
        segment,
        direction[edges[:-1]],
        np.abs(end - origin),
    )


def _dead_zone_direction(angle: Array) -> Array:
    """Direction of travel that ignores steps back below three typical steps."""
    steps = np.abs(np.diff(angle))
    zone = 3.0 * float(median(steps[steps > 0.0])) if steps.any() else 0.0
    direction = np.zeros(angle.size)
    extreme, sign, since = angle[0], 0.0, 0
    for k, x in enumerate(angle.tolist()):
        if sign == 0.0:
            if abs(x - extreme) > zone:
                sign = math.copysign(1.0, x - extreme)
                direction[: k + 1] = sign
                extreme, since = x, k
        elif (x - extreme) * sign >= 0.0:
            extreme, since = x, k
        elif abs(x - extreme) > zone:
            sign = -sign
            direction[since + 1 :] = sign
            extreme, since = x, k
        direction[k] = sign
    return direction
