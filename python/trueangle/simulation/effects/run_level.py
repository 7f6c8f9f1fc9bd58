"""Effects of the run: a new zero, a drift, a wrong ratio, a missed count."""

from __future__ import annotations

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ...joint.pattern import ARCSEC_PER_RAD
from ...joint.signals import Signals
from .effect import Array, Effect, Surroundings

__all__ = ["DriftWithinRun", "MissedCounts", "ScaleError", "ZeroSlip"]


@dataclass(frozen=True)
class ZeroSlip(Effect):
    r"""A new zero in every run: :math:`\varepsilon = u_j,\ u_j \sim N(0, s^2)`.

    Parameters
    ----------
    standard_deviation_arcsec : float
        s.
    """

    standard_deviation_arcsec: float

    kind: ClassVar[str] = "zero_slip"
    sentence: ClassVar[str] = (
        "A mount, coupling or turn counter settles anew before each run: every run has its own "
        "zero, which no other factor of the run explains."
    )
    factor: ClassVar[str] = "run"
    confounded_with: ClassVar[dict[str, str]] = {
        "backlash": "both directions inside each run",
        "latency": "two speeds inside each run",
        "thermal_drift": "several runs at each temperature, in random order",
        "torsional_compliance": "several runs at each load, in random order",
    }
    measure: ClassVar[str] = "repeat the run several times under equal conditions"
    transfers: ClassVar[bool] = False
    correctable: ClassVar[bool] = False

    def signal(self, signals: Signals, around: Surroundings, rng: np.random.Generator) -> Array:
        return self.standard_deviation_arcsec * rng.standard_normal(signals.runs)[signals.run]


@dataclass(frozen=True)
class DriftWithinRun(Effect):
    r"""Ramp and random walk in time, new in every run.

    Parameters
    ----------
    arcsec_per_s : float
        Standard deviation of the ramp's rate over runs.
    wander_arcsec : float
        Standard deviation of the random walk at the end of a run.
    """

    arcsec_per_s: float = 0.0
    wander_arcsec: float = 0.0

    kind: ClassVar[str] = "drift_within_run"
    sentence: ClassVar[str] = (
        "The set-up settles, warms up or creeps while a run lasts: the error follows the clock "
        "and not the angle, differently in every run."
    )
    factor: ClassVar[str] = "time"
    confounded_with: ClassVar[dict[str, str]] = {
        "scale_error": "reverse inside a run: a drift keeps its sign in time, a ratio in angle",
        "missing_order": "several turns, or an out-and-back sweep, in each run",
        "thermal_drift": "heat twice and return, temperatures in random order",
    }
    measure: ClassVar[str] = "sweep out and back, or several turns, in each run, with time stamps"
    transfers: ClassVar[bool] = False
    correctable: ClassVar[bool] = False

    def signal(self, signals: Signals, around: Surroundings, rng: np.random.Generator) -> Array:
        out = np.zeros(len(signals))
        for start, stop in signals.run_bounds():
            clock = signals.clock[start:stop]
            out[start:stop] = self.arcsec_per_s * rng.standard_normal() * clock
            steps = np.sqrt(np.maximum(np.diff(clock, prepend=clock[0]), 0.0))
            walk = np.cumsum(steps * rng.standard_normal(steps.size))
            span = np.sqrt(max(float(clock[-1] - clock[0]), 1e-300))
            out[start:stop] += self.wander_arcsec * walk / span
        return out


@dataclass(frozen=True)
class ScaleError(Effect):
    r"""Ramp in angle: :math:`\varepsilon = s\,\theta` with the unwrapped angle.

    Parameters
    ----------
    relative_error : float
        s, such as 1e-5 for a ratio of 100.001 taken as 100.
    """

    relative_error: float

    kind: ClassVar[str] = "scale_error"
    sentence: ClassVar[str] = (
        "The ratio or the count of the scale is not what the reading is computed with: the "
        "error grows in proportion to the angle turned."
    )
    confounded_with: ClassVar[dict[str, str]] = {
        "drift_within_run": "reverse inside a run, or runs in both directions",
        "missing_order": "more than one turn in a run",
    }
    measure: ClassVar[str] = "turn several turns in both directions"

    def signal(self, signals: Signals, around: Surroundings, rng: np.random.Generator) -> Array:
        return self.relative_error * ARCSEC_PER_RAD * signals.theta


@dataclass(frozen=True)
class MissedCounts(Effect):
    """A step that stays until the end of its run.

    Parameters
    ----------
    step_arcsec : float
    run : int
        Index of the run, from 0.
    row : int
        First row after the step, from 0.
    """

    step_arcsec: float
    run: int
    row: int

    kind: ClassVar[str] = "missed_counts"
    sentence: ClassVar[str] = (
        "Counts or whole periods were lost at one moment: from there to the end of the run "
        "every reading is off by the same step."
    )
    factor: ClassVar[str] = "time"
    confounded_with: ClassVar[dict[str, str]] = {
        "zero_slip": "longer runs: the step has to fall inside one",
    }
    measure: ClassVar[str] = "more readings before and after in one run, closing at the start angle"
    transfers: ClassVar[bool] = False
    correctable: ClassVar[bool] = False

    def signal(self, signals: Signals, around: Surroundings, rng: np.random.Generator) -> Array:
        after = (signals.run == self.run) & (signals.row >= self.row)
        return np.asarray(self.step_arcsec * after)
