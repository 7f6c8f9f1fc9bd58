"""Segments of roughly steady motion, cut from running logs, and their readings as one list."""

from __future__ import annotations

import itertools
import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from typing import Final

import numpy as np
from numpy.typing import NDArray

from ..errors import FileError, NoModelError
from ..support.arrays import Array
from .recording import Recording
from .splines import Knots

#: A segment shorter than this does not show a pattern (turns, readings).
_SHORTEST: Final = (0.8, 48)


#: Readings per knot of the finest grid, at least.
PER_KNOT: Final = 6


@dataclass(frozen=True)
class Segment:
    """Readings of one segment: time in seconds, reading in radians without jumps."""

    time: Array
    angle: Array
    recording: Recording
    rows: slice

    @property
    def turns(self) -> float:
        """Turns travelled."""
        return float(abs(self.angle[-1] - self.angle[0]) / (2.0 * math.pi))

    @property
    def direction(self) -> int:
        """Sign of the travel."""
        return 1 if self.angle[-1] >= self.angle[0] else -1

    @property
    def speed(self) -> float:
        """Mean speed in turns per second, positive."""
        return self.turns / float(self.time[-1] - self.time[0])

    def turn_speed(self) -> Array:
        """Speed of every reading in turns per second, averaged over one turn around it.

        The reading's own error is the same one turn later, so it does not enter.
        """
        t, x = self.time, np.abs(self.angle - self.angle[0])
        x = np.maximum.accumulate(x)
        turn = 2.0 * math.pi
        last = float(x[-1])
        if last <= 1.25 * turn:
            return np.full(t.size, self.speed)
        at = np.linspace(0.0, last - turn, min(4000, max(8, int(16 * last / turn))))
        # Where readings do not change, the mean of their times is as good as any.
        left, right = np.interp(at, x, t), np.interp(at + turn, x, t)
        if not (right > left).all():  # of angles so large that rounding takes a turn
            raise _fault(
                self.recording,
                f"its angles are counted up to {last / turn:.3g} turns, "
                "where a turn takes no time; check their unit, and that they are angles",
            )
        speed = np.log(1.0 / (right - left))
        middle = 0.5 * (left + right)
        result = np.interp(t, middle, speed)
        for outside, edge in ((t < middle[0], 0), (t > middle[-1], -1)):
            near = slice(0, 16) if edge == 0 else slice(-16, None)
            slope = np.polyfit(middle[near] - middle[edge], speed[near], 1)[0]
            result[outside] = speed[edge] + slope * (t[outside] - middle[edge])
        return np.asarray(np.exp(result))


def ripple_lead(stretch: Segment, speed: Array) -> Array:
    """Lead of the ripple of order 1 over that of a shaft at constant speed, phase.

    A rotor of friction ``f(ω)`` answers the torque ``T e^(ikθ)`` by
    ``-T / (k² ω²) e^(i(kθ + φ/k))`` with
    ``φ = (f'ω - 3ω̇)/ω²``, to first order in the deceleration.
    """
    if stretch.turns < 6.0:
        return np.zeros(speed.size)
    step = max(1, speed.size // 2000)
    t = stretch.time[::step]
    omega = 2.0 * math.pi * speed[::step]
    middle, half = 0.5 * (t[0] + t[-1]), 0.5 * (t[-1] - t[0])
    x = (t - middle) / half
    degree = int(min(6.0, stretch.turns // 5.0))
    logarithm = np.polynomial.Polynomial.fit(x, np.log(omega), degree, domain=[-1.0, 1.0])
    rate = logarithm.deriv()(x) / half * omega
    # Friction that grows with speed, by how the deceleration does.
    spread = omega - omega.mean()
    law = float(spread @ spread)
    damping = max(0.0, -float(spread @ rate) / law) if law > 0.0 else 0.0
    lead = (damping * omega - 3.0 * rate) / omega**2
    # One value for some neighbours, so that their sines are taken once.
    return np.repeat(stretch.direction * lead, step)[: speed.size]


def cut_stretches(recordings: Iterable[Recording]) -> list[Segment]:
    """Segments of motion in one direction, neither slow nor reversing.

    Raises
    ------
    FileError, NoModelError
        No time stamps, too few readings or turns, motion that is too fast for the rate
        of readings: each states what to record.
    """
    found: list[Segment] = []
    recordings = list(recordings)
    for recording in recordings:
        found += _cut(recording)
    turns = sum(s.turns for s in found)
    # Turns in all without which motion and pattern cannot be separated.
    if not found or turns < 1.99:
        held = f"{turns:.2g} turn{'' if abs(turns - 1.0) < 0.05 else 's'}" if found else "no turn"
        raise NoModelError(
            f"{recordings[0].named}: {held} of steady motion: what happened once may be the "
            "motion as well as the encoder; record at least 10 turns in one direction"
        )
    if sum(s.time.size for s in found) < 200:
        raise NoModelError(
            f"{recordings[0].named}: only {sum(s.time.size for s in found)} readings in motion; "
            "record at least 10 turns with 100 readings each"
        )
    return found


def _cut(recording: Recording) -> list[Segment]:
    if recording.indicated is None:
        raise _fault(
            recording, "no column indicated_deg (or _rad, _turn, _count): the reading is needed"
        )
    if recording.time is None:
        raise _fault(
            recording,
            "no column time_s: record a time stamp in seconds with every reading, taken where "
            "the reading is latched",
        )
    time, angle = recording.time, recording.indicated
    if time.size < 2:
        return []
    back = np.flatnonzero(np.diff(time) < 0.0)
    if back.size:
        raise _fault(
            recording,
            f"time runs backwards at {time[back[0] + 1]:g} s; sort the rows or give the part "
            "another run label",
        )
    if time[-1] <= time[0]:
        raise _fault(recording, "all time stamps are equal: record one with every reading")
    angle = _unwrapped(recording, time, angle)
    steps = np.diff(time)
    usual = float(np.median(steps[steps > 0.0]))
    pauses = np.flatnonzero(steps > max(20.0 * usual, 1e-9))
    edges = [0, *(int(p) + 1 for p in pauses), time.size]
    pieces = [(a, b) for a, b in itertools.pairwise(edges) if b - a >= _SHORTEST[1]]
    moving = [_moving(time[a:b], angle[a:b], a) for a, b in pieces]
    speeds = np.concatenate([np.zeros(0), *(np.abs(v) for _, v in moving)])
    if speeds.size == 0:
        return []
    # Motion slower than this share of the median speed is omitted, as are reversals.
    slow = 0.2 * float(np.median(speeds))
    found = []
    for (_, b), (starts, speed) in zip(pieces, moving, strict=True):
        state = np.where(np.abs(speed) > slow, np.sign(speed), 0.0)
        change = np.concatenate([[0], np.flatnonzero(np.diff(state)) + 1, [state.size]])
        for i, j in itertools.pairwise(change):
            if state[i] == 0.0:
                continue
            rows = slice(int(starts[i]), int(starts[j]) if j < state.size else b)
            stretch = Segment(time[rows], angle[rows], recording, rows)
            if rows.stop - rows.start >= _SHORTEST[1] and stretch.turns >= _SHORTEST[0]:
                found.append(stretch)
    return found


def _moving(time: Array, angle: Array, offset: int) -> tuple[NDArray[np.int64], Array]:
    """Starts of equal pieces of a log and the speed of each in radians per second."""
    size = max(12, time.size // 400)
    starts = np.arange(0, max(time.size - size // 2, 1), size)
    ends = np.append(starts[1:], time.size)
    half = np.maximum((ends - starts) // 3, 1)
    speed = np.empty(starts.size)
    for i, (a, b, h) in enumerate(zip(starts, ends, half, strict=True)):
        dt = time[b - h : b].mean() - time[a : a + h].mean()
        speed[i] = (angle[b - h : b].mean() - angle[a : a + h].mean()) / dt if dt > 0.0 else 0.0
    return starts + offset, speed


def _unwrapped(recording: Recording, time: Array, angle: Array) -> Array:
    turn = 2.0 * math.pi
    if angle.max() - angle.min() > 1.02 * turn:
        # Counted over turns already.
        return np.asarray(angle - turn * math.floor(angle[0] / turn))
    steps = np.diff(angle) / turn
    steps -= np.round(steps)
    usual = float(np.median(np.abs(steps)))
    # An outlier steps out and back; motion that is too fast does so all the time.
    # Steps between readings beyond this part of a turn may as well go the other way round.
    often = float(np.mean(np.abs(steps) > 0.4))
    if usual > 0.25 or often > 0.002:
        rate = 1.0 / float(np.median(np.diff(time)[np.diff(time) > 0.0]))
        raise _fault(
            recording,
            f"steps of {max(usual, 0.4):.2g} turn between readings at {rate:.3g} Hz cannot be "
            f"distinguished from motion the other way: read at least {4.0 * rate:.3g} times a "
            "second or turn slower",
        )
    return np.asarray(np.unwrap(angle, period=turn))


def _fault(recording: Recording, problem: str) -> Exception:
    if recording.file:
        return FileError(
            recording.file, f"run {recording.label}: {problem}" if recording.label else problem
        )
    return NoModelError(f"{recording.named}: {problem}")


class SegmentReadings:
    """Readings of all segments in one list, with what does not change from fit to fit."""

    def __init__(self, stretches: Sequence[Segment]) -> None:
        self.stretches = list(stretches)
        self.size = sum(s.time.size for s in stretches)
        self.stretch = np.repeat(np.arange(len(stretches)), [s.time.size for s in stretches])
        self.time = np.concatenate([s.time for s in stretches])
        self.angle = np.concatenate([s.angle for s in stretches])
        speeds = [s.turn_speed() for s in stretches]
        self.speed = np.concatenate(speeds)
        self.mean_speed = float(np.exp(np.mean(np.log(self.speed))))
        #: How ripple of constant torque grows where the shaft is slow.
        self.ripple = (self.mean_speed / self.speed) ** 2
        self.lead = np.concatenate(
            [ripple_lead(s, v) for s, v in zip(self.stretches, speeds, strict=True)]
        )
        #: Smooth trends that a segment may follow at no cost: one for every few turns.
        # Polynomials of degree 2 to 8 suffice for a coasting shaft; each needs turns, so that none
        # comes near an order.
        self.trends = tuple(min(7, int(s.turns / 5.0)) for s in self.stretches)
        self.extra: Array | None = None  # further columns of motion, (r, n)
        self.extra_names: tuple[str, ...] = ()

    def knots(self, intervals: int) -> Knots:
        """A grid of about ``intervals``; those of each segment are a multiple of a power of 2."""
        spans = [float(s.time[-1] - s.time[0]) for s in self.stretches]
        fewest = min(self.size // PER_KNOT, intervals)
        levels = max(0, math.floor(math.log2(max(fewest / (4 * len(spans)), 1.0))))
        unit = 2**levels
        spacing = max(max(spans) / unit, sum(spans) / max(fewest, 4)) if unit == 1 else 0.0
        if unit > 1:
            spacing = max(sum(spans) / fewest, max(spans) / (unit * 64))
        count = tuple(max(unit, unit * math.ceil(span / (spacing * unit))) for span in spans)
        spacing = max(span / n for span, n in zip(spans, count, strict=True))
        starts = tuple(
            # Knots that are longer than their segment are centred on it.
            0.5 * (float(s.time[0]) + float(s.time[-1]) - n * spacing)
            for s, n in zip(self.stretches, count, strict=True)
        )
        return Knots(starts, count, spacing * (1.0 + 1e-9))

    def first_spline(self, knots: Knots) -> Array:
        """Coefficients near the readings themselves: their values at the knots."""
        at = knots.greville()
        parts = []
        for g, stretch in enumerate(self.stretches):
            here = at[knots.first[g] : knots.first[g + 1]]
            value = np.interp(here, stretch.time, stretch.angle)
            for outside, edge in ((here < stretch.time[0], 0), (here > stretch.time[-1], -1)):
                rate = 2.0 * math.pi * stretch.speed * stretch.direction
                value[outside] = stretch.angle[edge] + rate * (here[outside] - stretch.time[edge])
            parts.append(value)
        return np.concatenate(parts)
