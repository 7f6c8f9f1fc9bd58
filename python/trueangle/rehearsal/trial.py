"""One trial: an effect hidden in simulated readings, and their diagnosis."""

from __future__ import annotations

import zlib
from dataclasses import dataclass, replace

import numpy as np

from ..diagnosis import Diagnosis, diagnose
from ..effects import EFFECTS, Effect
from ..effects.drawing import Drawing
from ..errors import TrueAngleError
from ..joint.signals import Signals, join_runs
from ..simulation.simulation import Simulation, simulate

#: Answers of a diagnosis for a hidden cause: it is confirmed; it is listed and not confirmed;
#: it is one of several that are not distinguished; another cause is named instead; something is
#: unexplained; nothing is found. A diagnosis that failed is a defect; one that was ended is no
#: answer.
NAMED, LISTED, UNTOLD, OTHER, UNEXPLAINED, NOTHING = (
    "named",
    "not_confirmed",
    "not_told_apart",
    "taken_for_another",
    "unexplained",
    "nothing",
)
FAILED, ENDED = "failed", "ended"


@dataclass(frozen=True)
class Trial:
    """What is hidden: a cause, its size, and the number of its draw.

    Attributes
    ----------
    cause : str
    step : int
        The size, in steps of the search.
    size : float
    number : int
        Of the trial among those of its cause.
    """

    cause: str
    step: int
    size: float
    number: int


@dataclass(frozen=True)
class TrialOutcome:
    """Answer of a diagnosis for a hidden cause.

    Attributes
    ----------
    verdict : str
    instead : tuple of str
        Causes that were named in its place, or that it was not distinguished from.
    beside : tuple of str
        Causes that were named in addition to the true one, although they were not there.
    failure : str
        Why the diagnosis failed.
    """

    verdict: str
    instead: tuple[str, ...] = ()
    beside: tuple[str, ...] = ()
    failure: str = ""

    @property
    def is_named(self) -> bool:
        """The cause was named and confirmed."""
        return self.verdict == NAMED


def trial_rng(seed: int, cause: str, number: int) -> np.random.Generator:
    """Random numbers of a trial: the same on any worker, at any time."""
    return np.random.default_rng([seed, zlib.crc32(cause.encode()), number])


def measured_signals(sim: Simulation) -> Signals:
    """Signals at the readings of the simulation's own runs."""
    return join_runs(simulate(replace(sim, effects=()), 0))


def drawn_effect(cause: str, size: float, of: Drawing) -> Effect | None:
    """An effect of this cause and size; None where these runs cannot have it."""
    return EFFECTS[cause].drawn(size, of)


def run_trial(sim: Simulation, signals: Signals, trial: Trial, seed: int) -> TrialOutcome:
    """Hide the effect of a trial in readings of the simulation, diagnose them, and compare."""
    rng = trial_rng(seed, trial.cause, trial.number)
    effect = drawn_effect(trial.cause, trial.size, Drawing(signals, sim.surroundings, rng))
    if effect is None:
        return TrialOutcome(NOTHING)
    runs = simulate(sim.with_effects([effect]), rng)
    try:
        result = diagnose(runs, sim)
    except TrueAngleError:
        raise
    except Exception as failure:  # reported with the result: hours of other trials are not lost
        return TrialOutcome(FAILED, failure=f"{type(failure).__name__}: {failure}")
    return trial_outcome(result, trial.cause) if result.complete else TrialOutcome(ENDED)


def trial_outcome(result: Diagnosis, cause: str) -> TrialOutcome:
    """Answer of a diagnosis where ``cause`` alone is hidden."""
    confirmed = [finding.cause for finding in result.findings if finding.confirmed]
    refuted = [belief.what for belief in result.beliefs if belief.verdict != "confirmed"]
    others = tuple(dict.fromkeys(c for c in confirmed if c != cause))
    if cause in confirmed or cause in refuted:
        return TrialOutcome(NAMED, beside=others)
    if any(finding.cause == cause for finding in result.findings):
        return TrialOutcome(LISTED, others)
    seen = [spot for spot in result.not_identifiable if spot.supported]
    for spot in seen:
        if cause in spot.causes:
            return TrialOutcome(UNTOLD, tuple(c for c in spot.causes if c != cause))
    untold = [c for spot in seen for c in spot.causes]
    # A refuted line or effect of the simulation is another name for what is hidden.
    believed = [what for what in refuted if what in EFFECTS]
    instead = tuple(dict.fromkeys((*others, *untold, *believed)))
    if instead or refuted:
        return TrialOutcome(OTHER, instead)
    if result.unexplained is not None and result.unexplained.found:
        return TrialOutcome(UNEXPLAINED)
    return TrialOutcome(NOTHING)
