"""Designs of runs that were measured: so that a simulation repeats them."""

from __future__ import annotations

import numpy as np

from ..estimation.linear import least_squares
from ..joint.signals import Signals, join_runs
from ..runs.run import CalibrationRun
from ..support.arrays import Array
from .designs import RunDesign


def design_of(run: CalibrationRun) -> RunDesign:
    """The design of a simulated run like a measured one.

    Parameters
    ----------
    run : CalibrationRun

    Returns
    -------
    RunDesign
        Its label, readings, travel with its reversals, speed (the median one; 5 deg/s without
        time), load (constant and of a weight), temperature from start to end, mount, current and
        the ways of other joints.

    Notes
    -----
    Costs a sort of the readings. Changes of speed within the run are not kept.

    Examples
    --------
    >>> from trueangle.simulation import RunDesign, Simulation, simulate
    >>> design = RunDesign(samples=400, reversals=(0.5,), speed_deg_s=20.0, torque_Nm=3.0)
    >>> (run,) = simulate(Simulation(runs=(design,)))
    >>> found = design_of(run)
    >>> found.samples, found.direction, round(found.speed_deg_s, 6), round(found.turns, 1)
    (400, 1, 20.0, 1.0)
    """
    signals = join_runs([run])
    direction, lengths = _ways(signals)
    # The last reading of a design is one step before its end.
    lengths[-1] += lengths.sum() / max(len(run) - 1, 1)
    whole = max(float(lengths.sum()), 1e-9)
    speed = None if signals.velocity is None else np.abs(signals.velocity)
    moving = np.zeros(0) if speed is None else speed[speed > 0.0]
    steps = np.abs(np.diff(signals.degrees))
    # Share of a step by which steps differ at most where they are equal.
    is_even = bool(steps.size and np.ptp(steps) <= 0.01 * float(np.median(steps)))
    torque, gravity, at = _load(signals)
    first, last = _ends(signals.temperature)
    current, shift = run.signals.get("current"), run.signals.get("shift")
    degree = 360.0 / run.period
    return RunDesign(
        label=run.label,
        direction=direction,
        speed_deg_s=5.0 if speed is None else float(np.median(moving)) if moving.size else 0.0,
        samples=len(run),
        spacing="uniform" if is_even else "jittered",
        start_deg=float(signals.degrees[0]),
        turns=whole / 360.0,
        reversals=tuple((np.cumsum(lengths)[:-1] / whole).tolist()),
        torque_Nm=torque,
        gravity_Nm=gravity,
        gravity_deg=at,
        temperature_C=20.0 if first is None else first,
        temperature_end_C=last,
        mount_deg=0.0 if run.mount is None else float(run.mount.mean()) * degree,
        current_A=None if current is None else float(current.mean()),
        shift_deg=None if shift is None else float(shift.mean()) * degree,
        coupled=tuple(
            (joint, tuple(_way(signals, angle, lengths)))
            for joint, angle in signals.coupled.items()
        ),
    )


def _ways(signals: Signals) -> tuple[int, Array]:
    """Direction of the first segment, and the length of each segment, degrees."""
    kept: list[tuple[float, float]] = []
    ways = zip(signals.segment_direction.tolist(), signals.segment_length.tolist(), strict=True)
    for direction, length in ways:
        if kept and (length <= 0.0 or direction == kept[-1][0]):
            kept[-1] = kept[-1][0], kept[-1][1] + length
        else:
            kept.append((direction, length))
    return (-1 if kept[0][0] < 0.0 else 1), np.array([length for _, length in kept])


def _load(signals: Signals) -> tuple[float, float, float]:
    """Constant torque, and amplitude and angle of a weight's."""
    torque = signals.torque
    if torque is None:
        return 0.0, 0.0, 0.0
    mean = float(torque.mean())
    power = float(np.var(torque))
    if power <= 1e-18 * max(mean * mean, 1e-300):
        return mean, 0.0, 0.0
    columns = np.column_stack([np.ones(len(signals)), np.sin(signals.theta), np.cos(signals.theta)])
    level, a, b = least_squares(columns, torque)
    left = torque - columns @ np.array([level, a, b])
    # Share of the torque's variance from which on it is that of a weight.
    if float(np.var(left)) > 0.5 * power:
        return mean, 0.0, 0.0
    return float(level), float(np.hypot(a, b)), float(np.degrees(np.arctan2(-b, a)))


def _ends(temperature: Array | None) -> tuple[float | None, float | None]:
    """Temperature at the start and at the end, along a line; one where it does not change."""
    if temperature is None:
        return None, None
    if np.ptp(temperature) == 0.0:
        return float(temperature[0]), None
    share = np.linspace(-0.5, 0.5, temperature.size)
    level = float(temperature.mean())
    slope = float(share @ (temperature - level) / max(float(share @ share), 1e-300))
    return level - 0.5 * slope, level + 0.5 * slope


def _way(signals: Signals, angle: Array, lengths: Array) -> list[float]:
    """Angles of another joint at even shares of this one's travel."""
    begun = np.concatenate([[0.0], np.cumsum(lengths)])
    segment = np.minimum(signals.segment, len(lengths) - 1)
    travel = np.maximum.accumulate(begun[segment] + signals.travel)
    # Places at which the way of another joint is kept.
    places = np.linspace(0.0, float(begun[-1]), 65)
    return [float(x) for x in np.interp(places, travel, angle)]
