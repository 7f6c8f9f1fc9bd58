"""A new zero in every run."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from ..estimation.extension import Extension
from ..estimation.quantity import quantity
from ..estimation.regression import Regression
from ..joint.pattern import JointPattern
from ..joint.signals import Signals
from ..support.arrays import distinct
from .ambiguity import RUNS_PER_LEVEL, Ambiguity
from .backlash import Backlash, goes_both_ways
from .current_coupling import CurrentCoupling
from .effect import ALWAYS, Effect, Reported
from .latency import Latency
from .missed_counts import MissedCounts
from .presliding_hysteresis import PreslidingHysteresis
from .search import Array, Fitted
from .thermal_drift import ThermalDrift
from .torsional_compliance import TorsionalCompliance


@dataclass(frozen=True)
class ZeroSlip(Effect):
    """A new zero in every run: ``ε = u_j, u_j ~ N(0, s²)``.

    Parameters
    ----------
    standard_deviation_arcsec : float
        s.
    """

    standard_deviation_arcsec: float

    kind: ClassVar[str] = "zero_slip"
    sentence: ClassVar[str] = (
        "A mount, coupling or turn counter settles again before each run: every run has its own "
        "zero, which no other factor of the run explains."
    )
    factor: ClassVar[str] = "run"
    form_of: ClassVar[tuple[str, ...]] = ("run",)
    measure: ClassVar[str] = "repeat the run several times under equal conditions"
    transfers: ClassVar[bool] = False
    confused_with: ClassVar[Mapping[type[Effect], str]] = {
        Backlash: "reverse inside a run: both directions between two zeros",
        Latency: "two speeds or both directions inside one run",
        TorsionalCompliance: "several runs at each load, in random order",
        ThermalDrift: "several runs at each temperature, in random order",
        CurrentCoupling: "several runs at each current, in random order",
        PreslidingHysteresis: "reverse inside a run: both directions between two zeros",
        MissedCounts: "longer runs: the step has to fall inside one",
    }
    flexible_below: ClassVar[float] = ALWAYS
    draws_zeros: ClassVar[bool] = True
    has_exact_form: ClassVar[bool] = True
    not_at_run_time: ClassVar[str] = (
        "the zero of a run is unknown until it is referenced; set the zero in every run"
    )

    def signal(self, signals: Signals, around: JointPattern, rng: np.random.Generator) -> Array:
        return self.standard_deviation_arcsec * rng.standard_normal(signals.runs)[signals.run]

    @classmethod
    def propose(cls, regression: Regression) -> Extension | None:
        if regression.signals.runs < 2 or regression.has(cls.kind):
            return None
        return regression.propose_run_effect(cls.kind, {}, np.ones((regression.n, 1)))

    @classmethod
    def imitate(cls, regression: Regression) -> Extension | None:
        """A zero of one run's own: of few runs the spread of all is hardly a number."""
        if regression.signals.runs < 2 or regression.has(cls.kind):
            return None
        run = regression.signals.run
        grid = float(np.log(regression.signals.runs))
        own = (
            regression.propose(cls.kind, {}, (run == k).astype(np.float64)[:, None], log_grid=grid)
            for k in distinct(run)
        )
        return max(own, key=lambda found: found.deviance)

    @classmethod
    def report(cls, regression: Regression, terms: Sequence[Fitted]) -> Reported:
        effect = terms[0][0].run_effect
        assert effect is not None
        size = float(np.sqrt(effect.ratio * regression.variance))
        std = size / np.sqrt(2.0 * max(regression.signals.runs - 1, 1))
        return {"standard_deviation_arcsec": quantity(size, std)}, [ZeroSlip(size)]

    @classmethod
    def blind_spots(cls, regression: Regression, found: Sequence[Ambiguity]) -> Iterator[Ambiguity]:
        signals, bounds = regression.signals, regression.bounds
        if goes_both_ways(signals):
            of_run = [float(np.mean(signals.direction[a:b])) for a, b in bounds]
            fewest = min(sum(d > 0 for d in of_run), sum(d < 0 for d in of_run))
            if all(abs(d) == 1.0 for d in of_run) and fewest < RUNS_PER_LEVEL:
                yield cls.blind(
                    f"each run goes in one direction and only {fewest} in one of them: the "
                    "difference may be the runs' own zeros",
                    Backlash,
                    first=False,
                    factor=Backlash.factor,
                )
        temperature = signals.temperature
        if temperature is not None and not any(ThermalDrift.kind in s.causes for s in found):
            levels: list[float] = []
            for mean in sorted(float(temperature[a:b].mean()) for a, b in bounds):
                # Kelvin from the coldest run of a level on from which a run is at the next one.
                if not levels or mean >= levels[-1] + 1.0:
                    levels.append(mean)
            if signals.runs < len(levels) + RUNS_PER_LEVEL - 1:
                yield cls.blind(
                    "too few runs per temperature: the difference may be the runs' own zeros",
                    ThermalDrift,
                    first=False,
                    factor=ThermalDrift.factor,
                )
        current = signals.current
        if (
            signals.runs == 2
            and current is not None
            and all(np.ptp(current[a:b]) == 0.0 for a, b in bounds)
            and not any(CurrentCoupling.kind in s.causes for s in found)
        ):
            yield cls.blind(
                "a current in each of two runs: the difference may be the runs' own zeros",
                CurrentCoupling,
                first=False,
                factor=CurrentCoupling.factor,
            )
        if signals.runs < 2:
            yield cls.blind("one run: a zero has no spread")
