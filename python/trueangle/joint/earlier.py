"""Signals as they were a time before: what a reading that is old was taken of."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from .signals import Signals


def earlier_signals(signals: Signals, delay_s: float) -> Signals:
    """The signals with angle, direction and speed of a time ``τ`` before each reading.

    ::

        θ(t - τ) ≈ θ(t) - vτ

    Where the readings of a run are closer together than the delay, the angle is interpolated in
    their own record instead, which allows the joint to accelerate meanwhile.

    The signals need a velocity; ``delay_s`` is τ, negative for a time after.

    Examples
    --------
    >>> from trueangle.joint.signals import join_runs
    >>> from trueangle.simulation import RunDesign, Simulation, simulate
    >>> design = RunDesign(samples=100, speed_deg_s=10.0)
    >>> signals = join_runs(simulate(Simulation(runs=(design,))))
    >>> moved = signals.degrees - earlier_signals(signals, 0.02).degrees
    >>> float(moved.min().round(6)), float(moved.max().round(6))
    (0.2, 0.2)
    """
    theta = signals.theta - 2.0 * np.pi * signals.turns_per_s * delay_s
    velocity = signals.velocity
    held = np.arange(len(signals))
    if signals.time is not None and velocity is not None:
        velocity = velocity.copy()
        for start, stop in signals.run_bounds():
            time = signals.time[start:stop]
            steps = np.diff(time)
            if steps.size == 0 or not 0.0 < float(np.median(steps)) <= abs(delay_s):
                continue
            then = time - delay_s
            known = (then >= time[0]) & (then <= time[-1])
            for values, source in ((theta, signals.theta), (velocity, signals.velocity)):
                assert source is not None
                part = values[start:stop]
                part[known] = np.interp(then[known], time, source[start:stop])
            last = np.searchsorted(time, then, side="right") - 1
            held[start:stop] = start + np.clip(last, 0, stop - start - 1)
    return replace(
        signals,
        theta=theta,
        velocity=velocity,
        direction=signals.direction[held],
        travel=signals.travel[held],
        segment=signals.segment[held],
    )
