"""Offset and rate of two clocks, from a motion that both streams saw."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from ...errors import ArgumentError
from ...support.arrays import Array
from .stream import Stream

#: Points of the grid on which the coarse offset is searched, at most.
_GRID = 1 << 20
#: Offsets fit equally well up to this multiple of the least misfit, and this much more.
_AS_WELL = 1.5
_TIE = 1e-3
#: Variation of the velocity, as a share of its rms, below which it counts as one speed.
_ONE_SPEED = 0.02
#: Orders of the joint that are fitted, so that they are not confounded with the clock.
_ORDERS = (1, 2, 3, 4)
#: Linear rounds of refinement, and the change of a time (s) below which they have converged.
_ROUNDS, _SETTLED = 8, 1e-9
#: Standard errors above which a rate is used without a prior; the prior of two quartzes, in ppm.
_SIGNIFICANT = 5.0
_QUARTZ = 100.0


@dataclass(frozen=True)
class Clocks:
    """How the clock of one stream runs against that of the other.

    ::

        t_B = t_A + offset + 10⁻⁶ rate · (t_A - t₀)

    with ``t₀`` the first reading of A; standard errors in ``offset_std``, ``rate_std``
    (None where it was declared or the motion does not determine it), that of a time on the other
    clock, root mean square over the log, in ``timing_std``, and the covariance of offset and rate
    in ``shared``.
    """

    start: float
    offset: float
    rate: float = 0.0
    offset_std: float | None = None
    rate_std: float | None = None
    timing_std: float = 0.0
    shared: float = 0.0
    notes: tuple[str, ...] = ()

    def to_other(self, time: Array) -> Array:
        """Times of clock A on clock B."""
        return np.asarray(time + self.offset + 1e-6 * self.rate * (time - self.start))


def estimated_clocks(
    indicated: Stream, reference: Stream, offset: float | None, rate: float | None
) -> Clocks:
    """Offset and rate from the motion, except those that are declared.

    Raises
    ------
    ArgumentError
        The streams share no time and the motion does not determine the offset.
    """
    start = float(indicated.time[0])
    notes = []
    if offset is None:
        own = indicated.time + 1e-6 * (rate or 0.0) * (indicated.time - start)
        coarse, others = _coarse(replace(indicated, time=own), reference)
        if others:
            listed = ", ".join(f"{other:.6g}" for other in others[:4])
            notes.append(
                f"the motion repeats itself: offsets of {listed} s fit about as well; the one "
                "with most readings in common is taken; declare it (`offset_s=`) where it is known"
            )
        if others is None:
            notes.append(
                "one speed only: the offset of the clocks cannot be determined and is taken as "
                f"{coarse:g} s; declare it (`offset_s=`) or log a motion that stops or reverses"
            )
            return Clocks(start, coarse, rate or 0.0, notes=tuple(notes))
    else:
        coarse = offset
    clocks = Clocks(start, coarse, rate or 0.0)
    wanted = [name for name, given in (("offset", offset), ("rate", rate)) if given is None]
    if not wanted:
        return clocks
    clocks = _refined(indicated, reference, clocks, wanted)
    if clocks.rate_std is None and rate is None:
        notes.append("the rate of the clocks cannot be determined from this motion; taken as equal")
    if offset is None:
        notes.append(
            "the offset includes any constant delay between the two channels: no log can separate "
            "them. A diagnosis finds delays that vary with speed"
        )
    return replace(clocks, notes=tuple(notes))


def _coarse(indicated: Stream, reference: Stream) -> tuple[float, list[float] | None]:
    """The offset at which the velocities agree best, and others at which they do as well.

    None instead of others where the motion does not determine an offset.
    """
    step = max(indicated.step, reference.step)
    longest = max(np.ptp(indicated.time), np.ptp(reference.time))
    step = max(step, float(longest) / _GRID)
    curves = []
    for stream in (indicated, reference):
        grid = np.arange(stream.time[0], stream.time[-1], step)
        if grid.size < 8:
            raise ArgumentError("too few readings to align two clocks; record 8 in each log")
        curves.append(np.diff(stream.at(grid, cubic=False)[0]) / step)
    a, b = curves
    size = math.sqrt(float(np.mean(b**2)))
    shared = min(indicated.time[-1], reference.time[-1]) - max(indicated.time[0], reference.time[0])
    if float(np.std(b)) < _ONE_SPEED * size or float(np.std(a)) < _ONE_SPEED * size:
        if shared <= 0.0:
            raise ArgumentError(
                "the two logs share no time, and motion at one speed does not determine the "
                "offset of their clocks; declare it (`offset_s=`)"
            )
        return 0.0, None
    # Part of the motion in what overlaps that differs, at every lag: rests agree at any.
    n = 1 << (a.size + b.size - 1).bit_length()
    transform = [np.fft.rfft(x, n) for x in (a, b, a**2, b**2, np.ones_like(a), np.ones_like(b))]
    fa, fb, faa, fbb, one_a, one_b = transform

    def correlation(first: NDArray[np.complex128], second: NDArray[np.complex128]) -> Array:
        return np.asarray(np.fft.irfft(np.conj(first) * second, n))

    count = correlation(one_a, one_b)
    power = correlation(faa, one_b) + correlation(one_a, fbb)
    total = power - 2.0 * correlation(fa, fb)
    # Share of the shorter stream that must overlap.
    enough = (count > 0.25 * min(a.size, b.size)) & (power > _ONE_SPEED * float(power.max()))
    cost = np.where(enough, total / np.where(enough, power, 1.0), np.inf)
    shift = np.roll(cost, n // 2)
    least = np.flatnonzero((shift < np.roll(shift, 1)) & (shift <= np.roll(shift, -1)))
    limit = _AS_WELL * float(shift.min()) + _TIE
    alike = least[shift[least] <= limit]
    best = int(alike[np.argmax(np.roll(count, n // 2)[alike])])
    # Sample i of A is at sample i + lag of B.
    start = float(reference.time[0] - indicated.time[0])
    offsets = [start + (int(place) - n // 2) * step for place in alike if place != best]
    return start + (best - n // 2) * step, offsets


def _refined(indicated: Stream, reference: Stream, clocks: Clocks, wanted: list[str]) -> Clocks:
    """Least squares over the readings of A, jointly with a zero, a ramp and the lowest orders."""
    if "rate" in wanted:
        found = _solved(indicated, reference, clocks, wanted)
        if found is not None and found.rate_std is not None:
            time = indicated.time - clocks.start
            # No prior is applied to a rate that is highly significant.
            is_sure = abs(found.rate) > _SIGNIFICANT * found.rate_std
            return found if is_sure else _as_quartzes(found, time)
    if "offset" not in wanted:
        return clocks
    only = _solved(indicated, reference, clocks, ["offset"])
    return clocks if only is None else only


def _as_quartzes(found: Clocks, time: Array) -> Clocks:
    """Offset and rate where two clocks run as two quartzes do: T is the variance of their rates.

    The estimate c of covariance C, its row r that of the rate, becomes

    ::

        c - C_r rate / (C_rr + T),    C - C_r C_r' / (C_rr + T)

    If the rates were assumed equal, the standard error of the offset would be too small.
    """
    std = found.rate_std
    assert std is not None
    joint = np.array([[(found.offset_std or 0.0) ** 2, found.shared], [found.shared, std**2]])
    spread = std**2 + _QUARTZ**2
    offset, rate = np.array([found.offset, found.rate]) - joint[1] * found.rate / spread
    covariance = joint - np.outer(joint[1], joint[1]) / spread
    timed = np.column_stack([np.ones_like(time), 1e-6 * time])
    timing = float(np.mean(np.einsum("ij,jk,ik->i", timed, covariance, timed)))
    return replace(
        found,
        offset=float(offset),
        rate=float(rate),
        offset_std=None if found.offset_std is None else math.sqrt(max(covariance[0, 0], 0.0)),
        rate_std=math.sqrt(covariance[1, 1]),
        shared=float(covariance[0, 1]),
        timing_std=math.sqrt(max(timing, 0.0)),
    )


def _solved(
    indicated: Stream, reference: Stream, clocks: Clocks, wanted: list[str]
) -> Clocks | None:
    offset, rate = clocks.offset, clocks.rate
    std: dict[str, float] = {}
    t = indicated.time - clocks.start
    for _ in range(_ROUNDS):
        there = indicated.time + offset + 1e-6 * rate * t
        inside = reference.covers(there)
        if np.count_nonzero(inside) < 16:
            return None
        angle, velocity = reference.at(there[inside])
        error = indicated.angle[inside] - angle
        turn = np.radians(angle)
        nuisance = [np.ones_like(angle), angle - angle.mean()]
        if np.ptp(angle) > 300.0:
            nuisance += [f(k * turn) for k in _ORDERS for f in (np.cos, np.sin)]
        columns = {"offset": velocity, "rate": 1e-6 * t[inside] * velocity}
        design = np.column_stack([columns[name] for name in wanted] + nuisance)
        scale = np.sqrt(np.mean(design**2, axis=0))
        if not (scale > 0.0).all():
            return None
        u, s, vt = np.linalg.svd(design / scale, full_matrices=False)
        if s[-1] < 1e-6 * s[0]:
            return None
        weight = np.ones(error.size)
        solution = vt.T @ ((u.T @ error) / s)
        rest = error - (design / scale) @ solution
        spread = 1.4826 * float(np.median(np.abs(rest)))
        if spread > 0.0:  # outliers do not move a clock
            weight = np.minimum(1.0, 3.0 * spread / np.maximum(np.abs(rest), 1e-300))
            root = np.sqrt(weight)
            u, s, vt = np.linalg.svd(design / scale * root[:, None], full_matrices=False)
            solution = vt.T @ ((u.T @ (error * root)) / s)
            rest = error - (design / scale) @ solution
        covariance = (vt.T / s**2) @ vt * float(np.mean(weight * rest**2)) * _inflation(rest)
        change = solution / scale
        for j, name in enumerate(wanted):
            std[name] = math.sqrt(float(covariance[j, j])) / float(scale[j])
        moved, faster = (
            float(change[wanted.index(name)]) if name in wanted else 0.0
            for name in ("offset", "rate")
        )
        offset, rate = offset + moved, rate + faster
        if np.abs(moved + 1e-6 * faster * t).max() < _SETTLED:
            break
    timed = (
        np.column_stack([np.ones_like(t) if name == "offset" else 1e-6 * t for name in wanted])
        / scale[: len(wanted)]
    )
    inner = covariance[: len(wanted), : len(wanted)]
    timing = math.sqrt(max(float(np.mean(np.einsum("ij,jk,ik->i", timed, inner, timed))), 0.0))
    return replace(
        clocks,
        offset=float(offset),
        rate=float(rate),
        offset_std=std.get("offset"),
        rate_std=std.get("rate"),
        timing_std=timing,
        shared=float(inner[0, 1] / (scale[0] * scale[1])) if len(wanted) == 2 else 0.0,
    )


def _inflation(rest: Array) -> float:
    """Factor on the variance for correlated neighbours (first-order autoregression)."""
    power = float(rest @ rest)
    if power <= 0.0:
        return 1.0
    alike = min(max(float(rest[1:] @ rest[:-1]) / power, 0.0), 0.99)
    return (1.0 + alike) / (1.0 - alike)
