"""Which sizes are tried next: first a bracket, then where the chance is least known.

Only what is known of the cause itself decides, in rounds, so that the sizes do not depend on who
else is at work.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field, fields

import numpy as np

from ..effects import EFFECTS
from ..effects.ambiguity import Ambiguity
from .cause import RehearsedCause, rehearsed_cause
from .detection import Chance
from .trial import Trial, TrialOutcome
from .visibility import SizeRange

#: Trials of a round while the sizes are bracketed, and steps up and down between two rounds.
BRACKETING, STEP_UP, STEP_DOWN = 2, 8, 6

#: Chances at which a later round tries.
AIMS = (0.3, 0.75, 0.95, 0.95)

#: Trials at the largest size after which a cause that is never named is given up.
GIVEN_UP = 4


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
        return [start] * min(BRACKETING, left)
    named = sum(n for n, _ in tried.values())
    if named == 0:
        top = max(tried)
        if top >= highest and tried[top][1] >= min(GIVEN_UP, seeds):
            return []
        return [min(top + STEP_UP, highest)] * min(BRACKETING, left)
    if all(n == count for n, count in tried.values()) and min(tried) > lowest:
        return [max(min(tried) - STEP_DOWN, lowest)] * min(BRACKETING, left)
    chance = Chance(tried)
    steps = []
    for aim in AIMS[:left]:
        step = chance.quantile(aim, 0.5)
        steps.append(
            highest if not np.isfinite(step) else int(np.clip(round(step), lowest, highest))
        )
    return steps


@dataclass
class SizeSearch:
    """The sizes of one cause, the trials made and those of the round at work."""

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
        """The search of a cause; one that the design cannot tell is tried large, to make sure."""
        if spot is None or sizes is None:
            return cls(cause, sizes, spot, seeds, done=sizes is None)
        top = min(sizes.highest, 2 * STEP_UP)
        return cls(cause, SizeRange(sizes.first, sizes.lowest, top, sizes.grows), spot, seeds, top)

    @property
    def is_blind(self) -> bool:
        """The design of the runs cannot tell it."""
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
        """Take an answer; the next round where it was the last of its own."""
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
            because = "these runs of this joint show nothing of it, however large it is"
            measure = effect.measure or None
        name = effect.size_name or fields(effect)[0].name  # type: ignore[arg-type]
        return rehearsed_cause(self.cause, name, self.sizes, self.answers, because, measure)
