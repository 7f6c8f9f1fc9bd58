"""What the pictures of a diagnosis show: measured against simulated, what is left, gains."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from ..angles import ARCSEC_PER_TURN, circular_mean, wrap
from ..runs import CalibrationRun
from .curves import Points, degrees, label_of

if TYPE_CHECKING:
    from ..diagnosis import Diagnosis
    from ..simulation import Simulation

__all__ = ["GainBar", "gain_bars", "left_after_causes", "simulated_points"]


@dataclass(frozen=True)
class GainBar:
    """Share of the reducible error that a cause takes away on held-out runs, percent."""

    cause: str
    share: float
    low: float
    high: float


def simulated_points(
    runs: Sequence[CalibrationRun], sim: Simulation
) -> list[tuple[Points, Points]]:
    """Measured and simulated error of every run about one common zero, arcsec."""
    factor = ARCSEC_PER_TURN / runs[0].period
    expected = [sim.predict(run) for run in runs]
    zero = circular_mean(
        np.concatenate(
            [r.indicated - r.reference - e / factor for r, e in zip(runs, expected, strict=True)]
        ),
        runs[0].period,
    )
    found = []
    for number, (run, simulated) in enumerate(zip(runs, expected, strict=True)):
        measured = factor * wrap(run.indicated - run.reference - zero, run.period)
        x, label = degrees(run), label_of(run, number)
        found.append((Points(label, x, measured), Points(label, x, simulated)))
    return found


def left_after_causes(
    diagnosis: Diagnosis, runs: Sequence[CalibrationRun], sim: Simulation
) -> list[tuple[str, float]]:
    """Rms of measured less simulated error: as it is, then with each finding added.

    The extended simulations are run as they are, nothing is fitted again; errors drawn
    anew in each run (a slipped zero) stay.
    """
    steps, effects = [("simulation as it is", sim)], []
    for finding in diagnosis.findings:
        if finding.confirmed:
            effects += finding.effects
        steps.append((f"+ {finding.cause.replace('_', ' ')}", sim.with_effects(effects)))
    found = []
    for name, extended in steps:
        left = np.concatenate([m.y - s.y for m, s in simulated_points(runs, extended)])
        found.append((name, float(np.std(left))))
    return found


def gain_bars(diagnosis: Diagnosis) -> list[GainBar]:
    """Findings whose gain carries over to new runs."""
    return [
        GainBar(
            finding.cause.replace("_", " "),
            100.0 * gain.reducible_share,
            100.0 * gain.interval[0],
            100.0 * gain.interval[1],
        )
        for finding in diagnosis.findings
        if (gain := finding.gain) is not None
        and gain.reducible_share is not None
        and gain.interval is not None
    ]
