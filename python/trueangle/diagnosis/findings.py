"""Findings, and the diagnosis that holds them."""

from __future__ import annotations

import json
import math
from collections.abc import Iterable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property
from typing import TYPE_CHECKING, Any

from ..effects import EFFECTS, Effect
from ..effects.blindness import Blindness
from ..errors import ArgumentError, NoModelError
from ..estimation.estimate import Parameters, Quantity
from ..estimation.regression import ROUNDING
from ..joint.signals import join_runs
from ..model.model import HarmonicModel
from ..planning.evidence import ReadingNoise
from ..planning.limits import Limits
from ..planning.nextruns import NextRuns
from ..planning.planner import next_runs
from ..runs.checks import DataFault
from ..runs.joining import MeasuredMinusSimulated
from ..simulation.measured import design_of
from ..simulation.simulation import Simulation
from ..support.display_units import ErrorsIn
from ..support.drawn import drawn
from ..support.oftype import of_type
from ..support.plainresult import PlainResult, Shown, counted
from .beliefs import Belief
from .confirmation import CONFIRMED
from .correction import extend_model
from .discrepancy import Discrepancy
from .gain import Gain
from .goodness import Unexplained
from .torque import TorqueAccount

if TYPE_CHECKING:
    from matplotlib.axes import Axes

    from ..fitting.argument import AnyArgument
    from ..runs.run import CalibrationRun

__all__ = ["Diagnosis", "Finding"]


@dataclass(frozen=True)
class Finding(Shown):
    """One cause that the readings support.

    Attributes
    ----------
    cause : str
        Of the vocabulary of causes.
    parameters : dict of str to Quantity
        ``.value`` and ``.std`` by the names of the contract.
    evidence : dict
        ``bic_gain``, ``deviance`` (2 ln of the likelihood ratio), ``parameters``,
        ``log_grid``.
    gain : Gain or None
        On held-out runs; None for causes of the scatter.
    rivals : list of (str, float)
        Other causes and how much less each explains in its place (BIC); tried for the
        first four findings.
    effects : list of Effect
        What extends the simulation, where it is confirmed.
    status : str
        "confirmed", or "not_confirmed" where its gain on held-out data does not exclude
        zero: listed, and kept out of the extended simulation and of corrections.
    reason : str
        Why it is not confirmed.
    group : tuple of int
        Its terms in the regression.
    """

    cause: str
    parameters: Parameters
    evidence: dict[str, float]
    gain: Gain | None
    rivals: list[tuple[str, float]]
    effects: list[Effect] = field(repr=False, default_factory=list)
    status: str = CONFIRMED
    reason: str = ""
    group: tuple[int, ...] = field(repr=False, default=())

    @property
    def confirmed(self) -> bool:
        """Fit to extend the simulation and to correct."""
        return self.status == CONFIRMED

    def _brief(self) -> str:
        sizes = [f"{name} {q.value:.4g}" for name, q in self.parameters.items() if _is_number(q)]
        return ", ".join([self.cause, *sizes[:2], self.status])

    def summary(self) -> str:
        """The finding as readable text."""
        from .summary import finding_text

        return finding_text(self)

    @property
    def sentence(self) -> str:
        """The physics in one sentence."""
        return EFFECTS[self.cause].sentence

    def to_dict(self) -> dict[str, Any]:
        """The entry of ``findings``."""
        return {
            "cause": self.cause,
            "status": self.status,
            "status_reason": self.reason,
            "parameters": {name: q.to_dict() for name, q in self.parameters.items()},
            "evidence": self.evidence,
            "gain": None if self.gain is None else self.gain.to_dict(),
            "rivals": [{"cause": cause, "bic_gap": gap} for cause, gap in self.rivals],
            "physics": self.sentence,
            "correctable": self.cause not in EFFECTS or not EFFECTS[self.cause].not_at_run_time,
        }


@dataclass(frozen=True)
class Diagnosis(PlainResult):
    """What `trueangle.diagnose` found.

    Attributes
    ----------
    discrepancy : Discrepancy
        Measured minus simulated before anything is added.
    structure : dict of str to float
        Share of its variance that each cause would explain alone, largest first; shares
        overlap, and a flexible cause explains much that is not its own.
    noise : float
        Scatter of one reading, arcsec: from repeats where there are any, else what the
        findings leave.
    findings : list of Finding
        In the order found; empty where the simulation is enough.
    not_identifiable : list of Blindness
        What this data cannot tell, and the measurement that would.
    extended : Simulation
        The simulation with every finding.
    gain : dict
        rms, peak-to-peak and max abs in arcsec, before and after all findings.
    readings, readings_used : int
    correlation : float
        Of the noise of neighbouring readings.
    unexplained : Unexplained or None
        What is left beyond the noise after all findings, by tests that need no name.
    unexplained_before : Unexplained or None
        The same tests before anything was added to the simulation.
    beliefs : list of Belief
        Verdicts on what the simulation already claims.
    data_faults : list of DataFault
        As `trueangle.check` tells them.
    notes : list of str
        What else must be known of the account.
    complete : bool
        False where it was ended early: by the time given, or by Ctrl-C.
    simulated : MeasuredMinusSimulated or None
        The log of another simulator that the simulation stands on.
    runs : list of CalibrationRun
        The readings, as given.
    torque : TorqueAccount or None
        What the drive's torque lacks, where the readings and the simulator's log have one.
    """

    discrepancy: Discrepancy
    structure: dict[str, float]
    noise: float
    findings: list[Finding]
    not_identifiable: list[Blindness]
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

    @property
    def is_enough(self) -> bool:
        """The simulation is enough: no finding, nothing unexplained, every belief confirmed.

        An account that was ended early does not tell.
        """
        return (
            self.complete
            and not self.findings
            and not (self.unexplained is not None and self.unexplained.found)
            and all(belief.verdict == "confirmed" for belief in self.beliefs)
        )

    def simulation(self) -> Simulation:
        """`extended`, with the noise of the readings and designs of their runs.

        Both stand where the simulation states none: `trueangle.simulate` repeats the
        measurement then. What an extended simulation is written as.

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
        """The runs that would tell what is open (`trueangle.planning.planner.next_runs`).

        Parameters
        ----------
        limits : Limits, optional
            What a run may be; by default much as those there are.
        between : sequence of str, optional
            Causes to be told apart in place of what is open.

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
        noise = ReadingNoise(max(self.noise, ROUNDING), self.correlation)
        signals = join_runs(self.runs if self.simulated is None else self.simulated.runs)
        believed, spots = self._without_open(), self.not_identifiable
        if between is not None:
            believed, spots = self._between(tuple(between))
        return next_runs(signals, believed, spots, noise, limits)

    @cached_property
    def next_runs(self) -> NextRuns | None:
        """The runs that would tell what is seen and not told, as `plan` has them by default.

        None where nothing is, or the account was ended early.
        """
        is_open = any(spot.supported and spot.hypotheses for spot in self.not_identifiable)
        return self.plan() if is_open and self.complete and self.runs else None

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

    def _between(self, causes: tuple[str, ...]) -> tuple[Simulation, list[Blindness]]:
        """What is believed without these causes, and the question which of them it is."""
        for spot in self.not_identifiable:
            if spot.supported and set(causes) <= set(spot.causes):
                return self._without_open(), [replace(spot, causes=causes)]
        known = {f.cause: tuple(f.effects) for f in self.findings if f.cause in causes}
        known = {cause: effects for cause, effects in known.items() if effects}
        taken = [effect for effects in known.values() for effect in effects]
        kept = tuple(effect for effect in self.extended.effects if effect not in taken)
        asked = Blindness(causes, "", "", bool(known), hypotheses=known)
        return replace(self.extended, effects=kept), [asked]

    def correction(
        self,
        model: HarmonicModel | None = None,
        runs: CalibrationRun | Iterable[CalibrationRun] | None = None,
        *,
        argument: AnyArgument = "auto",
    ) -> HarmonicModel:
        """The correction model of what was confirmed, fitted to the runs.

        Parameters
        ----------
        model : HarmonicModel, optional
            One to extend. Without it the lines that the simulation believes, as measured, and
            those of the findings are its orders, and other findings its terms.
        runs : CalibrationRun or iterable of them, optional
            In place of those that were diagnosed.
        argument : {"auto", "reference", "indicated"}
            As of `trueangle.fit`; by itself that of the model.

        Returns
        -------
        HarmonicModel
            See `trueangle.diagnosis.correction.extend_model`.

        Raises
        ------
        NoModelError
            Nothing was confirmed that a corrector can take off; says why and what to measure.
        NotInvertibleError
            The error is too steep for a model of the true angle.
        KindError
            What is given as model is none.
        ArgumentError
            Nothing to extend, and the diagnosis stands on the log of another simulator.

        Examples
        --------
        >>> from trueangle import diagnose, simulate
        >>> from trueangle.simulation import Backlash, RunDesign, Simulation
        >>> sim = Simulation(sigma_arcsec=1.0, runs=(RunDesign(reversals=(0.5,)),
        ...                                          RunDesign(reversals=(0.5,), speed_deg_s=30)))
        >>> model = diagnose(simulate(sim.with_effects([Backlash(36.0)])), sim).correction()
        >>> round(model.terms[0].half_width, 3)
        0.01
        """
        if model is None:
            self._check_correctable()
        else:
            of_type("model", model, HarmonicModel, "a trueangle.HarmonicModel, or left out")
        given = self.runs if runs is None else runs
        return extend_model(model, given, self.extended, argument)

    def sensor(self, *, without_any: bool = False) -> HarmonicModel:
        """What was confirmed as the model of a sensor: what a simulator's encoder lacks.

        Parameters
        ----------
        without_any : bool
            Give an empty model where nothing was confirmed.

        Returns
        -------
        HarmonicModel
            Its error stands on top of the log, where the diagnosis had one; else it is all of
            the joint's.

        Raises
        ------
        NoModelError
            Nothing was confirmed that a sensor can have.
        NotInvertibleError
            The error is too steep for a model of the true angle.
        """
        if without_any and not self._is_correctable:
            return HarmonicModel(())
        self._check_confirmed()
        runs = self.runs if self.simulated is None else self.simulated.runs
        return extend_model(None, runs, self.extended)

    def sensor_noise(self) -> float:
        """Standard deviation of the noise that a simulator's encoder lacks, radians.

        The noise of one reading, without what the log's own encoder has: that is in measured
        minus simulated, and stays in the simulator.
        """
        own = 0.0 if self.simulated is None else self.simulated.noise_arcsec
        lacking = math.sqrt(max(self.noise**2 - 2.0 * own**2, 0.0))
        return lacking * math.pi / 648_000.0

    def _check_correctable(self) -> None:
        """Raise where there is nothing that a model could be made of."""
        if self.simulated is not None:
            raise ArgumentError(
                "no correction model can hold what is known as a log only: give the model to extend"
            )
        self._check_confirmed()

    @property
    def _is_correctable(self) -> bool:
        """Something was confirmed that a model can hold."""
        effects = self.extended.effects
        return bool(self.extended.harmonics) or any(not e.not_at_run_time for e in effects)

    def _check_confirmed(self) -> None:
        """Raise where nothing was confirmed that a model can hold."""
        if self._is_correctable:
            return
        raise NoModelError(
            "no correction can be given: nothing was confirmed that a corrector can take off"
            + "".join(f"; {reason}" for reason in self._uncorrected())
        )

    def _uncorrected(self) -> Iterator[str]:
        """Why nothing can be taken off, and what to measure."""
        sure = [f for f in self.findings if f.confirmed]
        if sure:
            why = (f"{f.cause} ({EFFECTS[f.cause].not_at_run_time or 'no term'})" for f in sure)
            yield f"confirmed: {', '.join(why)}"
        if len(sure) < len(self.findings):
            why = (f"{f.cause} ({f.reason})" for f in self.findings if not f.confirmed)
            yield f"not confirmed: {', '.join(why)}"
        seen = [spot for spot in self.not_identifiable if spot.supported]
        told = {spot.measure: ", ".join(spot.causes) for spot in reversed(seen)}
        if told:
            yield from (f"to tell {causes} apart: {measure}" for measure, causes in told.items())
        else:
            yield (
                "measure more runs, in both directions and at two speeds, before it is diagnosed "
                "again"
            )

    def to_dict(self, extended_simulation: str | None = None) -> dict[str, Any]:
        """The object that ``trueangle diagnose`` prints as JSON."""
        return {
            "simulation": {
                "rms_arcsec": self.discrepancy.rms,
                "peak_to_peak_arcsec": self.discrepancy.peak_to_peak,
                "max_abs_arcsec": self.discrepancy.max_abs,
                "closure_arcsec": self.discrepancy.closure,
                "zero_spread_arcsec": self.discrepancy.zero_spread,
            },
            "structure": self.structure,
            "noise_arcsec": self.noise,
            "noise_correlation": self.correlation,
            "readings": self.readings,
            "readings_used": self.readings_used,
            "unexplained": self._unexplained(),
            "findings": [finding.to_dict() for finding in self.findings],
            "beliefs": [belief.to_dict() for belief in self.beliefs],
            "data_faults": [fault.to_dict() for fault in self.data_faults],
            "gain": self.gain,
            "complete": self.complete,
            "notes": self.notes,
            "not_identifiable": [spot.to_dict() for spot in self.not_identifiable],
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
        return json.dumps(self.to_dict(extended_simulation), indent=2, allow_nan=False)

    def _brief(self) -> str:
        sure = [finding.cause for finding in self.findings if finding.confirmed]
        parts = [] if self.complete else ["incomplete"]
        parts.append(f"{len(sure)} of {counted(self.findings, 'finding')} confirmed")
        if self.unexplained is not None and self.unexplained.found:
            parts.append("more is unexplained")
        parts.append(f"noise {self.noise:.3g} arcsec of {self.readings} readings")
        return ", ".join(parts) + (f": {', '.join(sure)}" if sure else "")

    def plot(self, ax: Axes | None = None) -> Axes:
        """Gain of every finding with its interval (needs ``trueangle[plot]``).

        `trueangle.plots.measured_and_simulated` and `trueangle.plots.error_left` show the
        readings themselves.
        """
        axes: Axes = drawn(self, ax)
        return axes

    def summary(self, errors_in: ErrorsIn = "auto", *, verbose: bool = False) -> str:
        """A readable account (`trueangle.diagnosis.summary.render`).

        Parameters
        ----------
        errors_in : {"auto", "arcsec", "deg", "mrad", "count"} or float
            Unit of the errors; by itself arcsec, or degrees where errors are that large. A
            number is the counts of a turn.
        verbose : bool
            Tell in full what the readings could not have shown and nobody asked.
        """
        from .summary import render

        return render(self, errors_in, verbose)


def _is_number(quantity: Quantity) -> bool:
    return isinstance(quantity.value, int | float)
