"""What a rehearsal found of one cause."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import Any

from ..support.plainresult import ShownResult
from .detection import Chance, binomial_interval
from .trial import TrialOutcome
from .visibility import SizeRange

#: Shares of the trials that are told.
SHARES = (0.5, 0.95)


@dataclass(frozen=True)
class RehearsedCause(ShownResult):
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
    sizes: SizeRange | None,
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
