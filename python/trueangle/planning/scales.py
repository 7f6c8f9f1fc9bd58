"""Designs of further runs weighed, added to earlier runs or by themselves."""

from __future__ import annotations

from collections.abc import Collection, Iterator, Sequence
from dataclasses import replace

import numpy as np

from ..effects import EFFECTS
from ..effects.ambiguity import Ambiguity
from ..effects.blindspots import blind_spots
from ..effects.effect import telling_apart
from ..estimation.regression import Regression
from ..joint.signals import Signals, join_runs
from ..simulation.designs import RunDesign
from ..simulation.simulation import Simulation
from ..support.deadline import current_deadline
from .evidence import (
    ExpectedEvidence,
    Hypothesis,
    ReadingNoise,
    deviance_left,
    evidence_between,
    is_doubted,
)
from .limits import Limits
from .nextruns import plainest_run, run_choices, run_seconds
from .worth import (
    ALIKE,
    MOST_EVIDENCE,
    NOTHING,
    Answer,
    Question,
    Worth,
    is_strong_answer,
    question_of,
    run_is_foretold,
    worth_of_evidence,
)

#: Assumed error of a cause that the readings do not show, in standard deviations of a reading.
UNSEEN = 3.0

#: Questions up to which rivals are searched although the readings show none of them.
SEARCHED = 3

#: Standard deviations from which on readings show a cause, and the parts of which a diagnosis
#: holds out one at a time.
SHOWN, PARTS = 3.0, 5


#: Earlier readings that are looked at, at most: of more, evenly spaced ones.
MOST_READINGS = 2000


class DesignScales:
    """Weighs designs for a set of questions, added to earlier runs or by themselves.

    Parameters
    ----------
    earlier : Signals or None
    believed : Simulation
    asked : sequence of Blindness
    noise : ReadingNoise
    limits : Limits
        Within which the causes are to show.
    """

    def __init__(
        self,
        earlier: Signals | None,
        believed: Simulation,
        asked: Sequence[Ambiguity],
        noise: ReadingNoise,
        limits: Limits,
    ) -> None:
        self.earlier = None if earlier is None else _thinned(earlier)
        self.believed, self.noise = believed, noise
        self.around = believed.whole_surroundings
        rich = self._signals([_rich(limits)], None)
        rms = UNSEEN * noise.sigma
        questions = [question_of(spot, rich, self.around, rms) for spot in asked]
        self.questions = [
            self._possible(question, spot.hypotheses)
            for question, spot in zip(questions, asked, strict=True)
        ]
        self._known: dict[tuple[tuple[RunDesign, ...], bool], Worth] = {}
        self.afresh()

    def afresh(self) -> None:
        """Begin a separate search: as many designs may be weighed again."""
        # Most designs whose evidence is computed: some ten seconds.
        self._left = 250

    @property
    def over(self) -> bool:
        """As many designs were weighed as a search may take, or its time is up."""
        return self._left <= 0 or current_deadline().over

    @property
    def all_seen(self) -> bool:
        """Every question is about something that the earlier readings show."""
        return all(question.seen for question in self.questions)

    @property
    def needs_current(self) -> bool:
        """A cause in question follows the motor's current."""
        return any("current" in EFFECTS[c].needs for q in self.questions for c in q.causes)

    @property
    def lack(self) -> bool:
        """The earlier runs did not all record a column that these causes need."""
        if self.earlier is None:
            return False
        causes = [cause for question in self.questions for cause in question.causes]
        needs = {"velocity", "time"}.union(*(EFFECTS[cause].needs for cause in causes))
        return any(getattr(self.earlier, name) is None for name in needs)

    def _possible(self, question: Question, estimated: Collection[str]) -> Question:
        """Without causes whose own estimate is too small to be what the readings show."""
        if self.earlier is None or not estimated:
            return question
        regression = self._readings(self.earlier)

        def is_seen(one: Hypothesis) -> bool:
            error = one.errors(regression.signals, self.around)[0]
            return deviance_left(regression, error, self.noise) >= SHOWN**2

        kept = tuple(h for h in question.hypotheses if h.cause not in estimated or is_seen(h))
        return replace(question, hypotheses=kept) if kept else question

    def weighed(
        self,
        designs: Sequence[RunDesign],
        start: Signals | None,
        changes: int = 0,
        least: Worth = NOTHING,
    ) -> Worth:
        """What designs decide, added to earlier runs if there are any.

        ``changes`` are those from the plainest run. The evidence of designs that
        cannot exceed ``least`` in any case is not computed. One design in six has been weighed
        before.
        """
        key = (*designs,), start is None
        if key in self._known:
            self._left -= 1
            return replace(self._known[key], plain=-changes)
        regression = self._readings(self._signals(designs, start))
        spots = blind_spots(regression)
        shown = sum(not self._hidden(question, spots) for question in self.questions)
        clear = -sum(len(self._unclear(question, spots)) for question in self.questions)
        seconds = -sum(map(run_seconds, designs))
        foretold = run_is_foretold(regression)
        most = Worth(shown, shown, foretold, clear, MOST_EVIDENCE, -changes, seconds)
        if most > least:
            are_open = [self._open(question, regression, spots) for question in self.questions]
            most = replace(most, opened=sum(are_open), told=sum(are_open))
        if most <= least:
            return replace(NOTHING, opened=most.opened, plain=-changes, seconds=seconds)
        self._left -= 1
        told, total = 0, 0.0
        for question, is_open in zip(self.questions, are_open, strict=True):
            evidence = self._evidence(question, regression)
            total += worth_of_evidence(evidence, question)
            told += is_open and is_strong_answer(evidence)
        halves = round(total / (np.log(ALIKE) * len(self.questions)))
        worth = replace(most, told=told, evidence=halves)
        self._known[key] = worth
        return worth

    def answers(self, designs: Sequence[RunDesign], start: Signals | None) -> Iterator[Answer]:
        """Evidence of designs for each question."""
        regression, spots = self._at(designs, start)
        for question in self.questions:
            evidence = self._evidence(question, regression)
            is_open = self._open(question, regression, spots)
            chance = min((e.chance for e in evidence), default=None)
            if chance is not None and not is_open:
                chance = 0.0
            bic = min((e.bic for e in evidence), default=None)
            yield Answer(is_open and is_strong_answer(evidence), bic, chance)

    def blind(self, designs: Sequence[RunDesign], start: Signals | None) -> list[Ambiguity]:
        """What these runs cannot show."""
        return self._at(designs, start)[1]

    def repeated(self, designs: Sequence[RunDesign], start: Signals | None) -> bool:
        """Whether held-out runs will confirm every cause: the other runs must show it as well.

        A diagnosis holds out a fifth of the runs at a time. A cause that only these show is not
        estimated from the others, and the held-out readings contradict it; likewise a form that
        only a single run off the grid determines. If the runs are diagnosed by themselves, one
        speed after the other is held out as well.
        """
        regression, _ = self._at(designs, start)
        runs = len(regression.bounds)
        if runs == 1:
            return True  # segments of it are held out
        if start is None:
            speeds = {design.speed_deg_s for design in designs}
            parts = [[d for d in designs if d.speed_deg_s != speed] for speed in speeds]
            if any(self._hidden_by("velocity", part, None) for part in parts if part):
                return False
        elif self._hidden_by("grid", designs[:-1], start):
            return False
        for question in self.questions:
            for one in question.hypotheses:
                if not EFFECTS[one.cause].transfers:
                    continue
                error = one.errors(regression.signals, self.around)[0]
                x, _ = regression.projected(error[:, None])
                powers = [float(np.sum(x[a:b] ** 2)) for a, b in regression.bounds]
                first = np.argsort(powers)[::-1][: -(-runs // PARTS)]
                kept = ~np.isin(
                    regression.signals.run,
                    regression.signals.run[[regression.bounds[k][0] for k in first]],
                )
                if deviance_left(regression.of_rows(kept), error[kept], self.noise) < SHOWN**2:
                    return False
        return True

    def _hidden_by(self, factor: str, designs: Sequence[RunDesign], start: Signals | None) -> bool:
        """Whether this factor of the runs hides a cause in question."""
        causes = {cause for question in self.questions for cause in question.causes}
        spots = [spot for spot in self.blind(designs, start) if spot.factor == factor]
        return any(spot.hides(cause) for spot in spots for cause in causes)

    def _at(
        self, designs: Sequence[RunDesign], start: Signals | None
    ) -> tuple[Regression, list[Ambiguity]]:
        regression = self._readings(self._signals(designs, start))
        return regression, blind_spots(regression)

    def _signals(self, designs: Sequence[RunDesign], start: Signals | None) -> Signals:
        rng = np.random.default_rng(0)
        runs = [
            design.measure(rng, design.label or "", self.believed.pattern) for design in designs
        ]
        if not runs:
            assert start is not None
            return start
        signals = join_runs(runs)
        return signals if start is None else start.followed_by(signals)

    def _readings(self, signals: Signals) -> Regression:
        """Noise at these readings, with the assumed model fitted jointly."""
        whites = np.random.default_rng(0).standard_normal(len(signals)) * self.noise.sigma
        return Regression.of(signals, whites, self.around, rho=self.noise.correlation)

    @property
    def _searches(self) -> bool:
        """Whether rivals take the form that imitates best: of many questions that is too slow."""
        return len(self.questions) <= SEARCHED or any(q.seen for q in self.questions)

    def _open(self, question: Question, regression: Regression, spots: Sequence[Ambiguity]) -> bool:
        """Whether nothing in the design of the readings hides one of the causes."""
        if self._hidden(question, spots):
            return False
        return not (
            self._searches
            and any(
                is_doubted(regression, one, spots)
                for one in (*question.hypotheses, *question.draws)
            )
        )

    @staticmethod
    def _hidden(question: Question, spots: Sequence[Ambiguity]) -> bool:
        """Whether the design of the readings hides one of the causes completely."""
        return any(spot.hides(cause) for spot in spots for cause in question.causes)

    def _unclear(self, question: Question, spots: Sequence[Ambiguity]) -> set[str]:
        """Effects on whole runs that may be confused with a cause in question.

        What cannot act at all, as a spring without a load, is confused with nothing.
        """
        shared = [spot for spot in spots if len(spot.causes) > 1]
        hidden = {cause for spot in shared for cause in spot.causes if spot.hides(cause)}
        return {
            other
            for cause in question.causes
            for other in hidden - {*question.causes}
            if EFFECTS[other].acts_on_runs and telling_apart(EFFECTS[cause], EFFECTS[other])
        }

    def _evidence(self, question: Question, regression: Regression) -> list[ExpectedEvidence]:
        return evidence_between(regression, question.hypotheses, self.noise, self._searches)


def _thinned(signals: Signals) -> Signals:
    return signals.take(np.arange(0, len(signals), -(-len(signals) // MOST_READINGS)))


def _rich(limits: Limits) -> RunDesign:
    """A run in which all varies that limits allow."""
    design = plainest_run(limits, "rich")
    for options in run_choices(limits):
        design = replace(design, **options[-1])
    return replace(
        design,
        turns=2.0 * limits.span_deg / 360.0,
        start_deg=limits.arc_deg[0],
        reversals=(0.4, 0.6),
        speed_deg_s=limits.speed_deg_s[1],
        speed_end_deg_s=None,
        samples=max(limits.samples, 200),
    )
