"""Where measured and simulated errors disagree, first as numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from ..joint.signals import Signals
from ..runs.run import CalibrationRun
from ..support.angles import circular_mean, wrap
from ..support.arrays import Array
from ..support.plainresult import ShownResult


@dataclass(frozen=True)
class Discrepancy(ShownResult):
    """Measured minus simulated, about the common zero, arcsec.

    Attributes
    ----------
    rms, peak_to_peak, max_abs : float
    closure : float or None
        Mean difference of readings of the same place at the end and the start of a turn.
    zero_spread : float
        Standard deviation of the runs' means.
    """

    rms: float
    peak_to_peak: float
    max_abs: float
    closure: float | None
    zero_spread: float


def unfolded_error(runs: Sequence[CalibrationRun]) -> Array:
    """Indicated minus reference of all runs in arcsec, without jumps of a turn."""
    period = runs[0].period
    difference = np.concatenate([run.indicated - run.reference for run in runs])
    zero = circular_mean(difference, period)
    return (zero + wrap(difference - zero, period)) * (1_296_000.0 / period)


def discrepancy_of(signals: Signals, residual: Array) -> Discrepancy:
    """Numbers of ``residual`` (measured minus simulated, arcsec)."""
    centred = residual - residual.mean()
    means = [float(residual[a:b].mean()) for a, b in signals.run_bounds()]
    gaps = []
    for start, stop in signals.run_bounds():
        theta, e = signals.theta[start:stop], residual[start:stop]
        late = np.flatnonzero(np.abs(np.abs(theta - theta[0]) - 2.0 * np.pi) < 0.05)
        if late.size:
            gaps.append(float(e[late].mean() - e[0]))
    return Discrepancy(
        float(np.sqrt(np.mean(centred**2))),
        float(np.ptp(residual)),
        float(np.abs(centred).max()),
        float(np.mean(gaps)) if gaps else None,
        float(np.std(means, ddof=1)) if len(means) > 1 else 0.0,
    )
