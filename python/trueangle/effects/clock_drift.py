"""Reference and joint on clocks that run apart: a ramp in time, in proportion to speed."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np

from ..estimation.extension import Extension
from ..estimation.regression import Regression
from ..joint.pattern import JointPattern
from ..joint.signals import Signals
from .ambiguity import OWN_OF_VELOCITY, Ambiguity, share_left
from .drift_within_run import DriftWithinRun
from .effect import Effect
from .latency import UNTIMED, Latency
from .scale_error import ScaleError
from .search import Array

#: By how much its BIC must beat that of a ramp in angle to be distinguished from one in runs whose
#: design does not promise to: "very strong" on the scale of Kass and Raftery.
TOLD = 10.0


@dataclass(frozen=True)
class ClockDrift(Effect):
    """Clocks that differ by a share: ``ε = v t r``.

    Parameters
    ----------
    ppm : float
        r in parts per million: the joint's stamps run ahead where it is positive.
    """

    ppm: float

    kind: ClassVar[str] = "clock_drift"
    sentence: ClassVar[str] = (
        "The clocks of reference and joint drift apart: the delay grows during a "
        "run. The error is proportional to time and speed, and zero at rest."
    )
    needs: ClassVar[tuple[str, ...]] = ("time",)
    factor: ClassVar[str] = "velocity"
    form_of: ClassVar[tuple[str, ...]] = ("speed", "run_time")
    confused_with: ClassVar[Mapping[type[Effect], str]] = {
        Latency: "longer runs: a delay is the same at their end",
        ScaleError: "out and back in one run, with a stop in between",
        DriftWithinRun: "two speeds, and a stop: the error is constant at rest",
    }
    measure: ClassVar[str] = "out and back in one run at two speeds, with a stop in between"
    acts_on_runs: ClassVar[bool] = True
    not_at_run_time: ClassVar[str] = "the clocks differ, not the joint; record both on one clock"

    def signal(self, signals: Signals, around: JointPattern, rng: np.random.Generator) -> Array:
        return self.ppm * self.columns(signals, around, {})[:, 0]

    @classmethod
    def propose(cls, regression: Regression) -> Extension | None:
        signals = regression.signals
        if signals.velocity is None or signals.time is None or regression.has(cls.kind):
            return None
        return regression.propose(cls.kind, {}, cls.columns(signals, regression.around, {}))

    @classmethod
    def columns(cls, signals: Signals, around: JointPattern, shape: dict[str, Any]) -> Array:
        speed = signals.turns_per_s * 360.0
        # Arcsec that one degree per second makes of a second's millionth.
        return np.asarray((3.6e-3 * speed * signals.clock)[:, None])

    @classmethod
    def blind_spots(cls, regression: Regression, found: Sequence[Ambiguity]) -> Iterator[Ambiguity]:
        signals = regression.signals
        if signals.velocity is None or signals.time is None:
            yield cls.blind(UNTIMED)
            return
        column = cls.columns(signals, regression.belief, {})
        ramps = (signals.theta[:, None], signals.velocity[:, None], signals.clock[:, None])
        if share_left(regression, column, *ramps) < OWN_OF_VELOCITY:
            yield cls.blind(
                "each run has one speed and at most one reversal: a ramp in time times speed is "
                "a ramp in angle",
                ScaleError,
                common=ScaleError,
            )

    @classmethod
    def told(cls, extension: Extension, regression: Regression) -> bool:
        """Whether the error depends on the speeds of the runs, which a ramp in angle does not."""
        return cls.beats(ScaleError, regression, TOLD)
