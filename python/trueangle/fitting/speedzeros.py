"""Do the zeros of the runs follow their speed? A delay that a fit takes for zeros."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Final

import numpy as np

from ..runs.run import CalibrationRun
from ..support.angles import circular_mean, wrap
from ..support.arrays import Array
from ..support.display_units import brief_number
from ..support.distributions import f_tail

#: Runs from which on a line through their zeros can fail.
_LEAST: Final = 3

#: Probability below which zeros that do not follow the speed would do so.
_LEVEL: Final = 1e-3


def zeros_follow_speed(
    runs: Sequence[CalibrationRun], zeros: Array, std: Array
) -> tuple[float, float] | None:
    """Delay (s) of the zeros behind the mean speeds of the runs, and its p-value.

    ::

        z_r = z - τ v_r,    F = τ² Σ (v_r - v̄)² / max(s², u²)

    with ``s²`` the variance of the zeros about the line and ``u`` their standard error. None of
    fewer than 3 timed runs, of one speed, and where the p-value is above 0.001.
    """
    moving = [run.time is not None and np.ptp(run.time) > 0.0 for run in runs]
    timed = np.array(moving) & np.isfinite(zeros)
    known = [run for run, is_timed in zip(runs, timed, strict=True) if is_timed]
    if len(known) < _LEAST:
        return None
    ends = [
        (run.unwrapped_reference[[0, -1]], run.time[[0, -1]])
        for run in known
        if run.time is not None
    ]
    speed = np.array([np.diff(angle)[0] / np.diff(time)[0] for angle, time in ends])
    period = known[0].period
    zero = wrap(zeros[timed] - circular_mean(zeros[timed], period), period)
    speed, zero = speed - speed.mean(), zero - zero.mean()
    energy, freedom = float(speed @ speed), len(known) - 2
    if energy == 0.0:
        return None
    slope = float(speed @ zero) / energy
    rest = zero - slope * speed
    noise = max(float(rest @ rest) / freedom, float(np.nanmean(std[timed] ** 2)), 1e-300)
    chance = f_tail(slope**2 * energy / noise, 1.0, float(freedom))
    return (-slope, chance) if chance < _LEVEL else None


def zeros_follow_speed_sentence(delay: float, chance: float) -> str:
    """A sentence on zeros that follow the speed."""
    return (
        f"the zeros of the runs follow their speed, as with a delay of {brief_number(1e3 * delay)} "
        f"ms (p = {chance:.1g}): the model has only their mean. Run diagnose, which separates a "
        "delay from a reversal error, and compare by rms, which includes the zero"
    )
