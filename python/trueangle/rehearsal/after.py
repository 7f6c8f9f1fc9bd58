"""`plan_after`: the runs that decide what a diagnosis could not, planned and rehearsed."""

from __future__ import annotations

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Any, Unpack

import numpy as np

from ..diagnosis import Diagnosis, diagnose
from ..effects import EFFECTS
from ..errors import ArgumentError
from ..planning.evidence import Hypothesis, ReadingNoise
from ..planning.limits import Limits
from ..planning.nextruns import NextRuns, RivalEvidence
from ..planning.worth import WANTED
from ..runs.run import CalibrationRun
from ..runs.source import ReadingOptions
from ..simulation.simulation import Simulation, simulate, simulate_along
from ..support.argumentkinds import of_type, told_kinds
from ..support.deadline import Deadline, current_deadline, under_deadline, with_deadline
from ..support.suggestions import check_choice
from .trial import trial_outcome

#: Simulated diagnoses of every cause in question, where not given.
SEEDS = 10

#: Seconds that a plan may take, where not given.
WITHIN = 10.0

#: What is reported where there was no time for them.
UNTRIED = "not rehearsed: the time limit was reached; give a longer one (`within=60`) to count how "
UNTRIED += "often the true cause is named"

#: Factor of the readings where simulated diagnoses do not name the cause often enough.
MORE = 1.5


@told_kinds
def plan_after(
    runs: Any,
    sim: Simulation,
    *,
    between: Iterable[str] | None = None,
    limits: Limits | None = None,
    seeds: int = SEEDS,
    seed: int = 0,
    within: float | None = WITHIN,
    progress: str = "none",
    **reading: Unpack[ReadingOptions],
) -> NextRuns:
    """Plan the runs to measure next, so that rival causes are distinguished.

    The runs are diagnosed. Of the further runs that limits allow those are taken whose expected
    evidence between the causes in question is greatest, by what the one leaves that the other
    cannot imitate, under the correlated noise found (`trueangle.planning.evidence`)

    ::

        T_{A|B} = min_b |W(s_A - Xβ - Z_B b)|² / (σ² (1 - ρ²))

    with as few readings as possible. Then every cause in turn is assumed to be the true one, all
    runs are simulated and diagnosed, and the plan counts how often it is named.

    Parameters
    ----------
    runs : CalibrationRun, path, table, or iterable of them
        As `trueangle.diagnose` takes them.
    sim : Simulation
        The assumed model.
    between : iterable of str, optional
        Causes to be distinguished; by default those that the readings show without deciding between
        them, else all that these runs could not have shown.
    limits : Limits, optional
        What a run may be (`trueangle.planning.load_limits`). By default one turn or the arc
        measured so far, 1 to 60 deg/s, the loads, temperatures and mounts measured; where no such
        run decides, a little beyond, which the plan states (``beyond``).
    seeds : int
        Simulated diagnoses of every cause; 0 for none.
    seed : int
    within : float, optional
        Seconds that it may take; None for any time. When they are up, the plan so far is given.
    progress : {"none", "auto", "text", "json"}
        On stderr, after the first second.
    **reading
        ``signals``, ``period``, ``by`` ... of files and tables, as in `trueangle.read_runs`.

    Returns
    -------
    NextRuns

    Raises
    ------
    ArgumentError
        A cause that there is none of, fewer than one, or too few readings for a diagnosis.

    Notes
    -----
    One to ten seconds, most of them for simulated diagnoses.
    Source: Atkinson and Fedorov (1975), The design of experiments for discriminating between two
    rival models.

    Examples
    --------
    >>> from trueangle import diagnose, simulate
    >>> from trueangle.simulation import Backlash, RunDesign, Simulation
    >>> sim = Simulation(sigma_arcsec=1.0, runs=(RunDesign(reversals=(0.5,)),))
    >>> runs = simulate(sim.with_effects([Backlash(3.0)]))
    >>> plan = plan_after(runs, sim, between=["backlash", "latency"], seeds=2)
    >>> plan.runs[0].speed_deg_s, plan.between[0].told
    (60.0, True)
    """
    of_type("sim", sim, Simulation, "a trueangle.Simulation (trueangle.load_simulation reads one)")
    names = None if between is None else list(dict.fromkeys(between))
    if names is not None and not names:
        raise ArgumentError("no causes to distinguish: name two, or omit `between=` for all")
    for name in names or ():
        check_choice("between", name, EFFECTS)
    for name, value, least in (("seeds", seeds, 0), ("seed", seed, 0)):
        if not isinstance(value, int) or value < least:
            raise ArgumentError(f"{name} must be a whole number from {least}, got {value!r}")
    with with_deadline(within, progress) as at:
        at.at("diagnosis", 0, 1)
        found = diagnose(runs, sim, **reading)
        plan = found.plan(limits, between=names)
        if not seeds or not any(entry.seen for entry in plan.between) or not plan.runs:
            return plan
        most = (limits or Limits.of_runs(found.runs)).samples
        return _rehearsed(plan, found, sim, most, seeds, seed)


def _rehearsed(
    plan: NextRuns, found: Diagnosis, stated: Simulation, most: int, seeds: int, seed: int
) -> NextRuns:
    """The plan with as many readings as name the causes in simulated diagnoses."""
    trial = _FurtherTrials(
        found.runs, stated, ReadingNoise(found.noise, found.correlation), seeds, seed
    )
    while True:
        full = all(design.samples >= most for design in plan.runs)
        entries = tuple(
            trial.counted(plan, k, entry, to_the_end=full) for k, entry in enumerate(plan.between)
        )
        plan = replace(plan, between=entries)
        failed = [bool(e.trials) and (e.chance_named or 0.0) < WANTED for e in entries]
        if not any(failed) or full or current_deadline().over:
            untried = any(e.seen and e.told and not e.trials for e in entries)
            # What trials name too rarely is not distinguished, whatever evidence was expected.
            told = (
                replace(e, told=False) if short else e
                for e, short in zip(entries, failed, strict=True)
            )
            notes = (*plan.notes, UNTRIED) if untried else plan.notes
            return replace(plan, between=tuple(told), notes=notes)
        plan = plan.with_readings(
            [min(math.ceil(MORE * design.samples), most) for design in plan.runs]
        )


@dataclass(frozen=True)
class _FurtherTrials:
    """Simulated diagnoses of earlier runs and planned ones together."""

    earlier: Sequence[CalibrationRun]
    stated: Simulation
    noise: ReadingNoise
    seeds: int
    seed: int

    def counted(
        self, plan: NextRuns, index: int, entry: RivalEvidence, to_the_end: bool
    ) -> RivalEvidence:
        """How often each cause is named where it is the true one; the least of them.

        Not ``to_the_end``: only until it is clear that one is not named often enough.
        """
        if not entry.seen or not entry.told:
            return entry
        shares, trials = [], 0
        for place, hypothesis in enumerate(plan.hypotheses[index]):
            named = made = 0
            for number in range(self.seeds):
                current_deadline().at("simulated diagnoses", number, self.seeds)
                rng = np.random.default_rng([self.seed, index, place, number])
                answer = None if current_deadline().over else self.names(plan, hypothesis, rng)
                if answer is None:
                    break
                named, made = named + answer, made + 1
                if not to_the_end and made - named > (1.0 - WANTED) * self.seeds:
                    return replace(entry, chance_named=named / made, trials=trials + made)
            if not made:
                return replace(entry, trials=0)
            shares.append(named / made)
            trials += made
        return replace(entry, chance_named=min(shares), trials=trials) if shares else entry

    def names(
        self, plan: NextRuns, hypothesis: Hypothesis, rng: np.random.Generator
    ) -> bool | None:
        """Whether one simulated diagnosis names the cause; None where it was ended."""
        believed = plan.simulation.with_effects(hypothesis.effects)
        truth = replace(believed, sigma_arcsec=self.noise.sigma)
        motion = simulate(Simulation(), rng, plan.runs)
        if not plan.alone:
            motion = [*self.earlier, *motion]
        runs = simulate_along(truth, motion, rng, self.noise.correlation)
        at = current_deadline()
        left = None if at.within is None else max(at.within - at.seconds, 1e-3)
        with under_deadline(Deadline(left)) as own:  # its parts share the remaining time
            found = diagnose(runs, self.stated)
        at.stopped = at.stopped or own.stopped
        return trial_outcome(found, hypothesis.cause).is_named if found.complete else None
