"""Rehearse a diagnosis before the rig is booked, at sizes chosen where least is known."""

from __future__ import annotations

from collections.abc import Collection, Iterable, Mapping
from dataclasses import dataclass, field, fields, replace
from typing import Any

import numpy as np

from ..effects import EFFECTS
from ..effects.ambiguity import Ambiguity
from ..errors import ArgumentError
from ..joint.signals import Signals
from ..planning.evidence import ReadingNoise
from ..planning.nextruns import NextRuns
from ..planning.planner import next_runs
from ..simulation.simulation import SIMULATION, Simulation
from ..support.argumentkinds import of_type, told_kinds
from ..support.deadline import Deadline, with_deadline
from ..support.layout import counted
from ..support.suggestions import check_choice
from .detection import Chance, SizeRange, blind_causes, size_range
from .result import Rehearsal, RehearsedCause, rehearsed_cause
from .trial import FAILED, Trial, TrialOutcome, measured_signals
from .workers import LocalTrials, Workers, usable_cores

#: Trials of a cause where not given.
SEEDS = 20


#: Note of every rehearsal.
FORMS = (
    "the effects hidden have the library's own forms; real ones are never exact, so count on "
    "larger sizes than these"
)

#: Trials of a round while the sizes are bracketed, and steps up and down between two rounds.
_BRACKETING, _STEP_UP, _STEP_DOWN = 2, 8, 6


@told_kinds
def rehearse(
    sim: Simulation,
    *,
    causes: Iterable[str] | None = None,
    seeds: int = SEEDS,
    seed: int = 0,
    within: float | None = None,
    workers: int | None = None,
    progress: str = "none",
) -> Rehearsal:
    """Estimate which causes a diagnosis of these runs would name, and from which size on.

    Every cause in turn is hidden in readings simulated with the joint, the noise and the runs of
    ``sim`` and diagnosed against ``sim``. It counts as named where a confirmed finding (or, where
    the simulation claims it already, a refuted assumed model) has its name. The probability of that

    ::

        P = (1 - λ) / (1 + exp(-(x - μ)/w))

    against the logarithm x of size gives the sizes named in 50 and in 95 % of the trials.

    Parameters
    ----------
    sim : Simulation
        With the runs that are planned and the noise that is expected.
    causes : iterable of str, optional
        Of the vocabulary; all where not given.
    seeds : int
        Trials of a cause at most, each with noise, angles and all parameters but the size
        sampled again.
    seed : int
        Equal seeds give equal results, with any number of workers, where all trials are made.
    within : float, optional
        Seconds that it may take; the result until then is returned and marked as incomplete.
    workers : int, optional
        Processes side by side, one thread each; every core where not given. 1 works in this one.
    progress : {"none", "auto", "text", "json"}
        On stderr, after the first second.

    Returns
    -------
    Rehearsal

    Raises
    ------
    ArgumentError
        No run or no noise in the simulation; an unknown cause; a number out of range.
    WorkerError
        A process has ended, for want of memory as a rule.

    Notes
    -----
    Sizes are searched in steps of a quarter of an octave: first up by a factor of 4 and down by
    2.8, two trials each, from where a perfect knowledge of the form would gain a deviance of 40;
    then four at a time where the estimated probability is 30, 75 and 95 % (twice). The
    thresholds are medians of the weight that the trials give to mu, w and lambda, with 95 %
    intervals; one beyond the sizes tried is not given. It costs the trials: one diagnosis each,
    about a second for 2000 readings, ``seeds`` for every cause.

    Examples
    --------
    >>> from trueangle.simulation import RunDesign, Simulation
    >>> sim = Simulation(sigma_arcsec=1.0, runs=(RunDesign(label="one way", samples=100),))
    >>> result = rehearse(sim, causes=["thermal_drift"], seeds=4)
    >>> result["thermal_drift"].named_50 is None, result["thermal_drift"].trials
    (True, 0)
    >>> print(result["thermal_drift"].blind_because)
    the temperature varies by less than 2 K
    """
    of_type("sim", sim, Simulation, SIMULATION)
    names = _checked(sim, causes, seeds, seed, workers)
    with with_deadline(within, progress) as at:
        signals = measured_signals(sim)
        blind = blind_causes(sim, signals)
        searches = {}
        for k, cause in enumerate(names):
            at.at("sizing effects", k, len(names))
            sizes = size_range(sim, signals, cause, seed)
            searches[cause] = SizeSearch.of(cause, sizes, blind.get(cause), seeds)
        closed = [cause for cause in names if searches[cause].is_blind]
        # Share of the time given for the search for further runs.
        with at.part(0.2):
            further = _opening(sim, signals, closed, blind)
        _ask(sim, signals, list(searches.values()), seed, workers or usable_cores(), at)
        found = [search.result() for search in searches.values()]
        return Rehearsal(
            found,
            _still(further, found),
            len(signals),
            signals.runs,
            sim.sigma_arcsec,
            seed,
            seeds,
            sum(cause.trials for cause in found),
            all(search.done for search in searches.values()),
            [*_notes(searches.values(), at), FORMS],
        )


def _ask(
    sim: Simulation, signals: Any, searches: list[SizeSearch], seed: int, workers: int, at: Deadline
) -> None:
    """Make the trials of all searches, round by round, until all are done or time is up."""
    trials = [trial for search in searches for trial in search.next_round()]
    if not trials or at.over:
        return
    by_cause = {search.cause: search for search in searches}
    count = min(workers, len(trials))
    asking = LocalTrials(sim, signals, seed) if count == 1 else Workers(sim, seed, count)
    total = sum(search.seeds for search in searches if not search.done)
    made = 0
    try:
        for trial in trials:
            asking.add(trial)
        at.at("diagnoses", 0, total, bound="at most")
        for trial, outcome in asking.answers():
            made += 1
            search = by_cause[trial.cause]
            for further in search.answered(trial, outcome):
                asking.add(further)
            total -= (search.seeds - len(search.answers)) if search.done else 0
            at.at("diagnoses", made, max(total, made), bound="at most")
    finally:
        asking.close()


def _checked(
    sim: Simulation, causes: Iterable[str] | None, seeds: int, seed: int, workers: int | None
) -> list[str]:
    """The causes to hide; refuses what cannot be rehearsed."""
    if not sim.runs:
        raise ArgumentError(
            "the simulation designs no run: add a [[run]] table for every run that is planned"
        )
    if sim.sigma_arcsec <= 0.0:
        raise ArgumentError(
            "the simulation has no noise: state what is expected of one reading, [noise] "
            "sigma_arcsec, as every size is found against it"
        )
    for name, value, least in (("seeds", seeds, 1), ("seed", seed, 0), ("workers", workers, 1)):
        if value is not None and (not isinstance(value, int) or value < least):
            raise ArgumentError(f"{name} must be a whole number from {least}, got {value!r}")
    names = list(EFFECTS) if causes is None else list(dict.fromkeys(causes))
    if not names:
        raise ArgumentError("no cause to hide: name one at least, or omit `causes=` for all")
    for name in names:
        check_choice("causes", name, EFFECTS)
    return names


def _opening(
    sim: Simulation, signals: Signals, closed: Collection[str], blind: Mapping[str, Ambiguity]
) -> NextRuns | None:
    """The further runs that decide what these cannot; None where there are none."""
    asked: dict[str, Ambiguity] = {}
    for cause in closed:
        spot = blind.get(cause) or Ambiguity((cause,), "", "")
        causes = tuple(other for other in spot.causes if other in closed)
        asked.setdefault(repr(causes), replace(spot, causes=causes))
    if not asked:
        return None
    found = next_runs(signals, sim, [*asked.values()], ReadingNoise(sim.sigma_arcsec))
    return found if found.runs else None


def _still(further: NextRuns | None, found: Collection[RehearsedCause]) -> NextRuns | None:
    """The further runs, without causes that were named after all."""
    if further is None:
        return None
    named = {cause.cause for cause in found if cause.ever_named}
    between = tuple(entry for entry in further.between if not named.issuperset(entry.causes))
    if not any(entry.told for entry in between):
        return None
    return replace(further, between=between)


def _notes(searches: Collection[SizeSearch], at: Deadline) -> list[str]:
    notes = []
    left = [search.cause for search in searches if not search.done]
    if left:
        none = [search.cause for search in searches if not search.done and not search.answers]
        text = f"INCOMPLETE: {at.why} before all trials of {counted(left, 'cause')} were made"
        notes.append(text + (f"; not tried at all: {', '.join(none)}" if none else ""))
    failed = [o for search in searches for _, o in search.answers if o.verdict == FAILED]
    if failed:
        notes.append(
            f"{counted(failed, 'diagnosis', 'diagnoses')} failed ({failed[0].failure}) and "
            f"{'counts' if len(failed) == 1 else 'count'} as not named: this is a defect of "
            "trueangle"
        )
    return notes


def next_sizes(
    tried: Mapping[int, tuple[int, int]], lowest: int, highest: int, seeds: int, start: int = 0
) -> list[int]:
    """Steps of the next round; none when all is done.

    Parameters
    ----------
    tried : mapping of int to (int, int)
        Named and all trials by step.
    lowest, highest : int
        Range of the steps.
    seeds : int
        Trials of the cause at most.
    start : int
        The first step.
    """
    left = seeds - sum(count for _, count in tried.values())
    if left <= 0:
        return []
    if not tried:
        return [start] * min(_BRACKETING, left)
    named = sum(n for n, _ in tried.values())
    if named == 0:
        top = max(tried)
        # Trials at the largest size after which a cause that is never named is given up.
        if top >= highest and tried[top][1] >= min(4, seeds):
            return []
        return [min(top + _STEP_UP, highest)] * min(_BRACKETING, left)
    if all(n == count for n, count in tried.values()) and min(tried) > lowest:
        return [max(min(tried) - _STEP_DOWN, lowest)] * min(_BRACKETING, left)
    chance = Chance(tried)
    steps = []
    # Probabilities at which a later round tries.
    for aim in (0.3, 0.75, 0.95, 0.95)[:left]:
        step = chance.quantile(aim, 0.5)
        steps.append(
            highest if not np.isfinite(step) else int(np.clip(round(step), lowest, highest))
        )
    return steps


@dataclass
class SizeSearch:
    """The sizes of one cause, the trials made and those of the round at work.

    Only results of the same cause decide, in rounds, so that the sizes do not depend on the other
    workers.
    """

    cause: str
    sizes: SizeRange | None
    spot: Ambiguity | None
    seeds: int
    start: int = 0
    answers: list[tuple[int, TrialOutcome]] = field(default_factory=list)
    round: dict[int, tuple[int, TrialOutcome | None]] = field(default_factory=dict)
    done: bool = False

    @classmethod
    def of(
        cls, cause: str, sizes: SizeRange | None, spot: Ambiguity | None, seeds: int
    ) -> SizeSearch:
        """The search of a cause; one that the design cannot show is tried large, to make sure."""
        if spot is None or sizes is None:
            return cls(cause, sizes, spot, seeds, done=sizes is None)
        top = min(sizes.highest, 2 * _STEP_UP)
        return cls(cause, SizeRange(sizes.first, sizes.lowest, top, sizes.grows), spot, seeds, top)

    @property
    def is_blind(self) -> bool:
        """The design of the runs cannot show it."""
        return self.sizes is None or self.spot is not None

    def next_round(self) -> list[Trial]:
        """The trials of the next round; none where all are made."""
        if self.sizes is None:
            return []
        tried: dict[int, tuple[int, int]] = {}
        for step, outcome in self.answers:
            named, count = tried.get(step, (0, 0))
            tried[step] = named + outcome.is_named, count + 1
        low, high = self.sizes.lowest, self.sizes.highest
        steps = next_sizes(tried, low, high, self.seeds, self.start)
        self.done = not steps
        first = len(self.answers)
        self.round = {first + k: (step, None) for k, step in enumerate(steps)}
        return [Trial(self.cause, s, self.sizes.size(s), n) for n, (s, _) in self.round.items()]

    def answered(self, trial: Trial, outcome: TrialOutcome) -> list[Trial]:
        """Record an answer; return the next round if it was the last of its round."""
        self.round[trial.number] = trial.step, outcome
        if any(answer is None for _, answer in self.round.values()):
            return []
        self.answers += [(step, answer) for step, answer in self.round.values() if answer]
        return self.next_round()

    def result(self) -> RehearsedCause:
        """What is known: rounds that were not finished do not count."""
        effect = EFFECTS[self.cause]
        because = measure = None
        if self.spot is not None:
            because, measure = self.spot.because, self.spot.measure
        elif self.sizes is None:
            because = "these runs do not show it, at any size"
            measure = effect.measure or None
        name = effect.size_name or fields(effect)[0].name  # type: ignore[arg-type]
        return rehearsed_cause(self.cause, name, self.sizes, self.answers, because, measure)
