"""What a diagnosis holds, what follows from it, and the runs that would settle what is open."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

from ..effects import EFFECTS
from ..effects.ambiguity import Ambiguity
from ..effects.effect import title_of
from ..estimation.regression import ROUNDING
from ..joint.signals import join_runs
from ..runs.checks.fault import DataFault
from ..simulation.measured import design_of
from ..simulation.simulation import Simulation
from ..support.layout import counted
from ..support.plainresult import json_text, plain_fields
from .beliefs import Belief
from .correctable import PLANNED, Correctable, measure_more
from .discrepancy import Discrepancy
from .factors.factor import Factor
from .finding import Finding
from .goodness import Unexplained
from .torque import TorqueAccount

if TYPE_CHECKING:
    from ..planning.limits import Limits
    from ..planning.nextruns import NextRuns
    from ..runs.joining import MeasuredMinusSimulated
    from ..runs.run import CalibrationRun


@dataclass(frozen=True)
class DiagnosisData(Correctable):
    """What a `Diagnosis` holds."""

    discrepancy: Discrepancy
    structure: dict[str, float]
    noise: float
    findings: list[Finding]
    not_identifiable: list[Ambiguity]
    extended: Simulation
    gain: dict[str, float]
    readings: int
    readings_used: int
    correlation: float
    unexplained: Unexplained | None = None
    unexplained_before: Unexplained | None = None
    beliefs: list[Belief] = field(default_factory=list)
    data_faults: list[DataFault] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    complete: bool = True
    simulated: MeasuredMinusSimulated | None = None
    runs: list[CalibrationRun] = field(repr=False, compare=False, default_factory=list)
    torque: TorqueAccount | None = None
    factors: list[Factor] = field(default_factory=list)

    @property
    def is_enough(self) -> bool:
        """The simulation is enough: no finding, nothing unexplained, every assumption confirmed.

        False where the account was ended early.
        """
        return (
            self.complete
            and not self.findings
            and not (self.unexplained is not None and self.unexplained.found)
            and not self.wrong
        )

    @property
    def detectable(self) -> float:
        """Amplitude from which an order shows in these readings, arcsec.

        Its deviance n A²/(2 σ²) is then 4 ln n: the price of two coefficients (Schwarz), and of
        the choice among n/2 orders. Of correlated readings n is the number of independent ones.
        """
        n = max(self.readings_used * (1.0 - self.correlation) / (1.0 + self.correlation), 2.0)
        return self.noise * math.sqrt(8.0 * math.log(n) / n)

    @property
    def wrong(self) -> list[Belief]:
        """What the simulation assumes and the readings do not confirm."""
        return [belief for belief in self.beliefs if belief.verdict != "confirmed"]

    def simulation(self) -> Simulation:
        """`extended`, with the noise of the readings and designs of their runs.

        Both are added where the simulation states none, so that `trueangle.simulate` repeats
        the measurement. What an extended simulation is written as.

        Examples
        --------
        >>> import trueangle as ta
        >>> from trueangle.simulation import RunDesign, Simulation
        >>> measured = ta.simulate(Simulation(sigma_arcsec=2.0), runs=[RunDesign(samples=900)])
        >>> found = ta.diagnose(measured, Simulation()).simulation()
        >>> round(found.sigma_arcsec), len(ta.simulate(found)[0])
        (2, 900)
        """
        extended = self.extended
        return replace(
            extended,
            sigma_arcsec=extended.sigma_arcsec or self.noise,
            runs=extended.runs or tuple(design_of(run) for run in self.runs),
        )

    def plan(
        self, limits: Limits | None = None, *, between: Sequence[str] | None = None
    ) -> NextRuns:
        """The runs that would settle what is open (`trueangle.planning.planner.next_runs`).

        Parameters
        ----------
        limits : Limits, optional
            What a run may be; by default much as those there are.
        between : sequence of str, optional
            Causes to be separated in place of what is open.

        Returns
        -------
        NextRuns
            Not rehearsed: `trueangle.plan_after` does that.

        Examples
        --------
        >>> from trueangle import diagnose, simulate
        >>> from trueangle.simulation import Backlash, RunDesign, Simulation
        >>> sim = Simulation(sigma_arcsec=1.0, runs=(RunDesign(reversals=(0.5,)),))
        >>> plan = diagnose(simulate(sim.with_effects([Backlash(3.0)])), sim).plan()
        >>> plan.runs[0].speed_deg_s, plan.between[0].causes
        (60.0, ('backlash', 'latency'))
        """
        # Most accounts leave nothing open, and need no plan.
        from ..planning.evidence import ReadingNoise
        from ..planning.planner import next_runs

        noise = ReadingNoise(max(self.noise, ROUNDING), self.correlation)
        signals = join_runs(self.runs if self.simulated is None else self.simulated.runs)
        believed, spots = self._without_open(), self.not_identifiable
        if between is not None:
            believed, spots = self._between(tuple(between))
        return next_runs(signals, believed, spots, noise, limits)

    @cached_property
    def next_runs(self) -> NextRuns | None:
        """The runs that separate detected causes not yet distinguished, as `plan` gives by default.

        None where there are none, or the account was ended early.
        """
        is_open = any(spot.supported and spot.hypotheses for spot in self.not_identifiable)
        return self.plan() if is_open and self.complete and self.runs else None

    @property
    def planned(self) -> set[tuple[str, ...]]:
        """The causes that `next_runs` distinguish."""
        plan = self.next_runs
        return {
            entry.causes for entry in (plan.between if plan and plan.runs else ()) if entry.told
        }

    @property
    def in_question(self) -> list[Ambiguity]:
        """Causes in question: one is detected, none is named."""
        return [spot for spot in self.not_identifiable if spot.supported and not spot.common]

    @property
    def next_steps(self) -> list[str]:
        """What to do: about the data, with what is confirmed, about what is open."""
        more = [] if self.complete else ["allow more time (`within=300`)"]
        if more or self.data_faults:
            return [*(fault.mend for fault in self.data_faults), *more, "diagnose again"]
        steps = []
        sure = [finding for finding in self.findings if finding.confirmed]
        curves = [curve for factor in self.factors for curve in factor.effects]
        added = [*(effect for finding in sure for effect in finding.effects), *curves]
        if self.simulated is None and any(not effect.not_at_run_time for effect in added):
            steps.append("write the correction model (`diagnosis.correction()`)")
        elif added or self.wrong:
            steps.append("write the extended simulation (`diagnosis.simulation()`)")
        lasting = {title_of(f.cause): EFFECTS[f.cause].not_at_run_time for f in sure}
        steps += [f"{cause} cannot be corrected ({why})" for cause, why in lasting.items() if why]
        asked: dict[str, dict[str, None]] = {}
        for spot in self.not_identifiable:
            is_planned = spot.supported and spot.causes in self.planned
            if is_planned or spot in self.in_question:
                asked.setdefault(PLANNED if is_planned else spot.measure, {})[
                    _question(spot.causes)
                ] = None
        steps += [f"{', '.join(questions)}: {measure}" for measure, questions in asked.items()]
        unexplained = self.unexplained is not None and self.unexplained.found
        doubtful = unexplained or len(sure) < len(self.findings)
        if doubtful and not self.planned and measure_more() not in asked:
            steps.append(measure_more(self.runs))
        return steps

    def _without_open(self) -> Simulation:
        """The extended simulation without what may be due to another cause."""
        asked = [
            (effect.kind, getattr(effect, "order", None))
            for spot in self.not_identifiable
            for effects in spot.hypotheses.values()
            for effect in effects
        ]
        kept = (
            effect
            for effect in self.extended.effects
            if (effect.kind, getattr(effect, "order", None)) not in asked
        )
        return replace(self.extended, effects=tuple(kept))

    def _between(self, causes: tuple[str, ...]) -> tuple[Simulation, list[Ambiguity]]:
        """The assumed model without these causes, and the question which of them it is."""
        for spot in self.not_identifiable:
            if spot.supported and set(causes) <= set(spot.causes):
                return self._without_open(), [replace(spot, causes=causes)]
        known = {f.cause: tuple(f.effects) for f in self.findings if f.cause in causes}
        known = {cause: effects for cause, effects in known.items() if effects}
        taken = [effect for effects in known.values() for effect in effects]
        kept = tuple(effect for effect in self.extended.effects if effect not in taken)
        asked = Ambiguity(causes, "", "", bool(known), hypotheses=known)
        return replace(self.extended, effects=kept), [asked]

    def to_dict(self, extended_simulation: str | None = None) -> dict[str, Any]:
        """The object that ``trueangle diagnose`` prints as JSON."""
        sizes = ("rms", "peak_to_peak", "max_abs", "closure", "zero_spread")
        noise = "noise_arcsec=noise noise_correlation=correlation"
        found = "factors findings beliefs data_faults gain complete notes not_identifiable"
        return {
            "simulation": {f"{size}_arcsec": getattr(self.discrepancy, size) for size in sizes},
            **plain_fields(self, f"structure {noise} readings readings_used"),
            "unexplained": self._unexplained(),
            **plain_fields(self, found),
            "extended_simulation": extended_simulation,
            **({} if self.simulated is None else {"simulated": self.simulated.to_dict()}),
            **({} if self.torque is None else {"torque": self.torque.to_dict()}),
        }

    def _unexplained(self) -> dict[str, Any]:
        if self.unexplained is None:
            return {"found": False, "rms_arcsec": 0.0, "share": 0.0, "evidence": [], "before": None}
        before = self.unexplained_before
        return {
            **self.unexplained.to_dict(),
            "before": None if before is None else before.to_dict(),
        }

    def to_json(self, extended_simulation: str | None = None) -> str:
        """`to_dict` as JSON text."""
        return json_text(self.to_dict(extended_simulation), indent=2)

    def _brief(self) -> str:
        sure = [finding.cause for finding in self.findings if finding.confirmed]
        parts = [] if self.complete else ["incomplete"]
        parts.append(f"{len(sure)} of {counted(self.findings, 'finding')} confirmed")
        if self.unexplained is not None and self.unexplained.found:
            parts.append("more is unexplained")
        parts.append(f"noise {self.noise:.3g} arcsec of {self.readings} readings")
        return ", ".join(parts) + (f": {', '.join(sure)}" if sure else "")


def _question(causes: Sequence[str]) -> str:
    """What a measurement is for: which of the causes it is, or whether it is this one."""
    *others, last = map(title_of, causes)
    return f"to distinguish {', '.join(others)} and {last}" if others else f"to confirm {last}"
