"""What a rehearsal found."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from ..planning.nextruns import NextRuns
from ..support.plainresult import PlainResult, Shown, counted, result_picture
from .detection import Chance, binomial_interval
from .visibility import Range

if TYPE_CHECKING:
    from matplotlib.figure import Figure

    from .trial import TrialOutcome

#: Shares of the trials that are told.
SHARES = (0.5, 0.95)


@dataclass(frozen=True)
class RehearsedCause(Shown):
    """From which size on one cause would be named.

    Attributes
    ----------
    cause, size_name : str
    tried : dict of float to (int, int)
        Named and all trials by size, from the least visible on.
    named_50, named_95 : float or None
        Size from which on it is named in that share of the trials; None where the sizes tried
        do not bracket it.
    intervals : dict of float to (float or None, float or None)
        95 % interval of each, the less visible end first; None where it is open to that side.
    told : dict of str to int
        Trials by what the diagnosis said: ``named``, ``not_confirmed``, ``not_told_apart``,
        ``taken_for_another``, ``unexplained``, ``nothing``.
    confused_with : dict of str to int
        Causes it was taken for or not told from, with the number of trials, most often first.
    beside : dict of str to int
        Causes that were confirmed beside it and were not there.
    blind_because, measure : str or None
        Why the design cannot tell it, and what would; None where it can.
    grows : bool
        It shows the more the larger its size.
    """

    cause: str
    size_name: str
    tried: dict[float, tuple[int, int]]
    named_50: float | None
    named_95: float | None
    intervals: dict[float, tuple[float | None, float | None]]
    told: dict[str, int]
    confused_with: dict[str, int]
    beside: dict[str, int]
    blind_because: str | None = None
    measure: str | None = None
    grows: bool = True
    curve: tuple[tuple[float, float], ...] = field(default=(), repr=False)

    @property
    def trials(self) -> int:
        """How often it was hidden."""
        return sum(count for _, count in self.tried.values())

    @property
    def ever_named(self) -> bool:
        """It was named once at least."""
        return any(named for named, _ in self.tried.values())

    def to_dict(self) -> dict[str, Any]:
        """The entry of ``causes``."""
        return {
            "cause": self.cause,
            "size_name": self.size_name,
            "named_50": self.named_50,
            "named_50_interval": [*self.intervals.get(SHARES[0], (None, None))],
            "named_95": self.named_95,
            "named_95_interval": [*self.intervals.get(SHARES[1], (None, None))],
            "confused_with": list(self.confused_with),
            "blind_because": self.blind_because,
            "measure": self.measure,
            "trials": self.trials,
            "told": self.told,
            "beside": self.beside,
            "tried": [
                {
                    "size": size,
                    "named": named,
                    "trials": count,
                    "interval": [*binomial_interval(named, count)],
                }
                for size, (named, count) in self.tried.items()
            ],
        }


def rehearsed_cause(
    cause: str,
    size_name: str,
    sizes: Range | None,
    answers: list[tuple[int, TrialOutcome]],
    blind_because: str | None,
    measure: str | None,
) -> RehearsedCause:
    """Put the answers of the trials of one cause together."""
    counts: dict[int, tuple[int, int]] = {}
    for step, outcome in answers:
        named, count = counts.get(step, (0, 0))
        counts[step] = named + (outcome.is_named), count + 1
    thresholds: list[float | None] = [None, None]
    intervals: dict[float, tuple[float | None, float | None]] = {}
    curve: list[tuple[float, float]] = []
    if sizes is not None and counts and sizes.highest > 0:
        chance = Chance(counts)
        for k, share in enumerate(SHARES):
            found = chance.threshold(share)
            of = [None if s is None else sizes.size(s) for s in (found.step, found.low, found.high)]
            thresholds[k], intervals[share] = of[0], (of[1], of[2])
        curve = chance.curve(sizes.size)
    instead = Counter(c for _, outcome in answers for c in outcome.instead)
    beside = Counter(c for _, outcome in answers for c in outcome.beside)
    if any(named for named, _ in counts.values()):
        blind_because = measure = None
    return RehearsedCause(
        cause,
        size_name,
        {} if sizes is None else {sizes.size(k): counts[k] for k in sorted(counts)},
        thresholds[0],
        thresholds[1],
        intervals,
        dict(Counter(outcome.verdict for _, outcome in answers).most_common()),
        dict(sorted(instead.items(), key=lambda item: (-item[1], item[0]))),
        dict(sorted(beside.items(), key=lambda item: (-item[1], item[0]))),
        blind_because,
        measure,
        sizes is None or sizes.grows,
        tuple(curve),
    )


@dataclass(frozen=True)
class Rehearsal(PlainResult):
    """What `trueangle.rehearse` found.

    Attributes
    ----------
    causes : list of RehearsedCause
    next_runs : NextRuns or None
        The further runs that tell most of what these cannot; None where none tell any.
    readings, runs : int
    noise : float
        Arcsec.
    seed, seeds : int
        Of the random numbers; trials of a cause at most.
    trials : int
        Diagnoses that were made and counted.
    complete : bool
        False where time was up or Ctrl-C pressed before all trials were made.
    notes : list of str
    """

    causes: list[RehearsedCause]
    next_runs: NextRuns | None
    readings: int
    runs: int
    noise: float
    seed: int
    seeds: int
    trials: int
    complete: bool = True
    notes: list[str] = field(default_factory=list)

    def __getitem__(self, cause: str) -> RehearsedCause:
        """What was found of one cause."""
        for found in self.causes:
            if found.cause == cause:
                return found
        raise KeyError(cause)

    def to_dict(self) -> dict[str, Any]:
        """The object that ``trueangle rehearse`` prints as JSON."""
        return {
            "causes": [cause.to_dict() for cause in self.causes],
            "next_run": None if self.next_runs is None else self.next_runs.to_dict(),
            "readings": self.readings,
            "runs": self.runs,
            "noise_arcsec": self.noise,
            "seed": self.seed,
            "seeds": self.seeds,
            "trials": self.trials,
            "complete": self.complete,
            "notes": self.notes,
        }

    def _brief(self) -> str:
        named = sum(cause.named_50 is not None for cause in self.causes)
        ended = "" if self.complete else ", incomplete"
        return f"{named} of {counted(self.causes, 'cause')} named, {self.trials} trials{ended}"

    def summary(self) -> str:
        """A readable account (`trueangle.rehearsal.summary.rehearsal_summary`)."""
        from .summary import rehearsal_summary

        return rehearsal_summary(self)

    def plot(self) -> Figure:
        """Detection against size, a small picture for every cause (needs ``trueangle[plot]``)."""
        figure: Figure = result_picture(self)
        return figure
