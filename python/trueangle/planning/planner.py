"""`next_runs`: the search for runs within limits that are expected to separate rival causes."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Any, TypeAlias

from ..effects.ambiguity import Ambiguity
from ..joint.signals import Signals
from ..simulation.designs import RunDesign
from ..simulation.simulation import Simulation
from ..support.blas import one_blas_thread
from ..support.deadline import with_deadline
from .evidence import ReadingNoise
from .limits import Limits
from .nextruns import (
    NextRuns,
    RivalEvidence,
    count_of_changes,
    dialled_number,
    plainest_run,
    run_amounts,
    run_choices,
    run_seconds,
)
from .scales import DesignScales
from .worth import NOTHING, Worth, barely

#: Readings whose diagnosis may take as much work by default as a plan may.
WORK = 20_000


#: Fewest readings of a run: a held-out run of 12 gives its zero and lines so coarsely that one
#: diagnosis in ten does not confirm what it finds.
LEAST = 18

#: Factor within which the fewest readings are found, and that by which they are lowered before
#: other runs are tried.
NEAR, _FEWER = 1.1, 0.5

_Designs: TypeAlias = "list[RunDesign]"

#: What a run may be of one kind, as fields that change.
_Options: TypeAlias = "list[dict[str, Any]]"


def next_runs(
    earlier: Signals | None,
    believed: Simulation,
    spots: Sequence[Ambiguity],
    noise: ReadingNoise,
    limits: Limits | None = None,
) -> NextRuns:
    """The runs within limits that are expected to decide most of the open questions.

    Parameters
    ----------
    earlier : Signals or None
        Of the runs measured so far.
    believed : Simulation
        With all that is confirmed.
    spots : sequence of Blindness
        What to distinguish: those that the readings show something of, if any; else all.
    noise : ReadingNoise
    limits : Limits, optional
        Without them those of the earlier runs (`Limits.of`), and where these do not decide, a
        little beyond (`Limits.wider`).

    Notes
    -----
    One choice after the other is changed to the best there is (speed, motion, load, temperature,
    mount, current, then the levels between), run after run, until all is distinguished or nothing
    more is. Readings are then reduced to the fewest that suffice, and runs that need half of those
    are searched as long as there are any. Half a second to some seconds; after as much work as two
    diagnoses where no time is given, the best so far is the answer, and ``notes`` state it.
    """
    with with_deadline() as at, at.bounded(WORK), one_blas_thread():
        return _next_runs(earlier, believed, spots, noise, limits)


def _next_runs(
    earlier: Signals | None,
    believed: Simulation,
    spots: Sequence[Ambiguity],
    noise: ReadingNoise,
    limits: Limits | None,
) -> NextRuns:
    seen = [spot for spot in spots if spot.supported]
    asked = tuple(seen or spots)
    others = tuple(spot for spot in spots if spot not in asked)

    def found(within: Limits, known: Limits) -> NextRuns:
        scales = DesignScales(earlier, believed, asked, noise, within)
        return _found(scales, within, others, known)

    if limits is not None:
        return found(limits, limits)
    within = Limits() if earlier is None else Limits.of(earlier)
    near = found(within, within)
    if all(entry.told for entry in near.between[: len(asked)]):
        return near
    further = found(within.wider(), within)
    return further if _told(further) > _told(near) else near


def _told(plan: NextRuns) -> int:
    return sum(entry.told for entry in plan.between)


def _found(
    scales: DesignScales, limits: Limits, others: Sequence[Ambiguity], seen: Limits
) -> NextRuns:
    """The best runs within limits, added to the earlier ones or by themselves."""
    search, earlier, alone = RunSearch(scales, limits), scales.earlier, False
    designs, worth = search.best(earlier)
    if not worth.told and scales.lack:
        apart = search.best(None)
        if not apart[1].opened:
            apart = search.repeated(*apart)
        if apart[1] > worth and apart[1].opened:
            (designs, worth), alone, earlier = apart, True, None
    if worth.opened == 0:
        designs = []
    return NextRuns(
        tuple(designs),
        tuple(_entries(scales, designs, others, earlier)),
        alone and bool(designs),
        tuple(_beyond(designs, seen)),
        sum(map(run_seconds, designs)),
        replace(scales.believed, runs=tuple(designs), source=None),
        tuple(_notes(designs, scales.over)),
        tuple(question.hypotheses for question in scales.questions),
    )


def _entries(
    scales: DesignScales,
    designs: Sequence[RunDesign],
    others: Sequence[Ambiguity],
    start: Signals | None,
) -> Iterator[RivalEvidence]:
    """Evidence of the runs for every question, and for causes that were not in question."""
    if start is None and not designs:
        return
    answers = scales.answers(designs, start)
    for question, answer in zip(scales.questions, answers, strict=True):
        yield RivalEvidence(question.causes, question.seen, answer.told, answer.bic, answer.chance)
    blind = scales.blind(designs, start)
    for spot in others:
        if not any(other.hides(cause) for other in blind for cause in spot.causes):
            yield RivalEvidence(spot.causes, False, True, None, None)


def _notes(designs: Sequence[RunDesign], over: bool) -> Iterator[str]:
    if not designs:
        yield f"no run {'found so far' if over else 'within the limits'} distinguishes these causes"
    if over:
        yield "the search was ended early"


def _beyond(designs: Sequence[RunDesign], seen: Limits) -> Iterator[str]:
    """What runs need beyond limits."""
    for name, unit, (low, high) in (
        ("temperature_C", "C", seen.temperature_C),
        ("temperature_end_C", "C", seen.temperature_C),
        ("torque_Nm", "Nm", seen.torque_Nm),
        ("gravity_Nm", "Nm against gravity", (0.0, seen.gravity_Nm)),
        ("current_A", "A", seen.current_A),
        ("mount_deg", "deg of the reference on its mount", (0.0, 0.0)),
    ):
        values = {getattr(design, name) for design in designs} - {None}
        if name == "mount_deg":
            outside = sorted(values - set(seen.mount_deg))
        else:
            outside = sorted(v for v in values if not low <= v <= high)
        yield from (f"{value:g} {unit}" for value in outside)


@dataclass(frozen=True)
class RunSearch:
    """Runs within limits that distinguish most, with as few readings as possible.

    Attributes
    ----------
    scales : Scales
    limits : Limits
    """

    scales: DesignScales
    limits: Limits

    def best(self, start: Signals | None) -> tuple[_Designs, Worth]:
        """The best runs, added to earlier ones or by themselves."""
        self.scales.afresh()
        designs, worth = self._built(start)
        designs, worth = self._without_idle(designs, worth, start)
        if worth.told and self.scales.all_seen:
            designs, worth = self._lean(designs, worth, start)
        if worth.told and not self.scales.repeated(designs, start):
            designs, worth = self._shared_out(designs, worth, start)
        return designs, worth

    def repeated(self, designs: _Designs, worth: Worth) -> tuple[_Designs, Worth]:
        """The first run repeated: this determines levels that vary from run to run."""
        for count in range(2, self.limits.runs + 1 if designs else 0):
            again = [replace(designs[0], label=_label(k)) for k in range(count)]
            found = self.scales.weighed(again, None)
            if found.opened:
                return again, found
        return designs, worth

    def _built(self, start: Signals | None) -> tuple[_Designs, Worth]:
        """Run after run, until all is distinguished, nothing is gained, or there are enough."""
        designs: _Designs = []
        kept: _Designs = []
        best = NOTHING
        while len(designs) < self.limits.runs and not self.scales.over:
            design = plainest_run(self.limits, _label(len(designs)))
            if self.scales.needs_current and (start is None or start.current is not None):
                low, _ = self.limits.current_A
                design = replace(design, current_A=low)  # usable if every run recorded it
            designs, worth = self._improved([*designs, design], len(designs), start)
            if worth.gained > best.gained or not kept:
                best, kept = worth, [*designs]
            # Separate zeros of the runs are determined by several at once: one that decides nothing
            # may help.
            done = self._tells_all(best) and (best.foretold or start is not None)
            # Runs in a row that open nothing, after which no further one is tried; by themselves
            # the first open nothing, whatever they are.
            if done or len(designs) - len(kept) == 3:
                break
        return kept, best

    def _tells_all(self, worth: Worth) -> bool:
        return worth.told == len(self.scales.questions)

    def _improved(self, designs: _Designs, k: int, start: Signals | None) -> tuple[_Designs, Worth]:
        """Run k changed to the best there is: choices, and levels where these do not decide all."""
        kinds = [*run_choices(self.limits, self.scales.needs_current, designs[k].samples)]
        best = self.scales.weighed(designs, start, count_of_changes(designs[k], kinds))
        # Passes over all choices of a run: the last one rarely changes anything.
        for _ in range(3):
            before = best
            for options in kinds:
                designs, best = self._picked(designs, k, start, best, options, kinds)
            if best == before:
                break
        # Steps of a level (speed, temperature, load ...), as shares of its range.
        for step in () if self._tells_all(best) else (0.25, 0.1):
            for name, at in [*run_amounts(designs[k], self.limits)]:
                options = [{name: at(step)}, {name: at(-step)}]
                designs, best = self._picked(designs, k, start, best, options, kinds)
        return designs, best

    def _picked(
        self,
        designs: _Designs,
        k: int,
        start: Signals | None,
        best: Worth,
        options: _Options,
        kinds: Sequence[_Options],
    ) -> tuple[_Designs, Worth]:
        """The best of some changes of run k, and of none."""
        picked = designs
        for option in options:
            design = replace(designs[k], **option)
            if design == designs[k] or self.scales.over:
                continue
            tried = [*designs[:k], design, *designs[k + 1 :]]
            worth = self.scales.weighed(tried, start, count_of_changes(design, kinds), best)
            if worth > best:
                best, picked = worth, tried
        return picked, best

    def _without_idle(
        self, designs: _Designs, worth: Worth, start: Signals | None
    ) -> tuple[_Designs, Worth]:
        """The runs without those that add nothing to the later ones."""
        for design in designs[:-1]:
            fewer = [other for other in designs if other is not design]
            found = self.scales.weighed(fewer, start, 0, barely(worth.reached))
            if found.reached >= worth.reached and worth.told:
                designs, worth = fewer, found
        return [replace(d, label=_label(k)) for k, d in enumerate(designs)], worth

    def _lean(
        self, designs: _Designs, worth: Worth, start: Signals | None
    ) -> tuple[_Designs, Worth]:
        """The runs with the fewest readings that decide as much, or others that need even fewer."""
        goal = worth.reached
        designs, worth = self._fewest(designs, worth, goal, start)
        while not self.scales.over:
            tried = _with_readings(designs, _FEWER)
            if tried == designs:
                break
            found = NOTHING
            for k in range(len(tried)):
                tried, found = self._improved(tried, k, start)
            if found.reached < goal:
                break
            tried, found = self._without_idle(tried, found, start)
            designs, worth = self._fewest(tried, found, goal, start)
        return designs, worth

    def _shared_out(
        self, designs: _Designs, worth: Worth, start: Signals | None
    ) -> tuple[_Designs, Worth]:
        """The same readings in enough different runs for held-out ones to confirm the causes."""
        for times in range(1, self.limits.runs // len(designs) + 1):
            again = [one for one in _with_readings(designs, 1.0 / times) for _ in range(times)]
            again = [replace(one, label=_label(k)) for k, one in enumerate(again)]
            for tried in (again, _at_more_speeds(again)):
                if not self.scales.repeated(tried, start):
                    continue
                found = self.scales.weighed(tried, start, 0, barely(worth.reached))
                if found.reached >= worth.reached:
                    return tried, found
        return designs, worth

    def _fewest(
        self,
        designs: _Designs,
        worth: Worth,
        goal: tuple[int, int, bool, int],
        start: Signals | None,
    ) -> tuple[_Designs, Worth]:
        """The same runs with the fewest readings that reach the goal."""
        least, most = LEAST / max(design.samples for design in designs), 1.0
        share = least
        while most / least > NEAR and not self.scales.over:
            fewer = _with_readings(designs, share)
            found = self.scales.weighed(fewer, start, 0, barely(goal))
            if found.reached >= goal:
                best, worth, most = fewer, found, share
            else:
                least = share
            share = math.sqrt(least * most)
        return (designs if most == 1.0 else best), worth


def _with_readings(designs: _Designs, share: float) -> _Designs:
    """Runs with this share of their readings."""
    return [
        replace(d, samples=min(max(round(share * d.samples), LEAST), d.samples)) for d in designs
    ]


def _at_more_speeds(designs: _Designs) -> _Designs:
    """Every other run between the slowest and the fastest."""
    speeds = [design.speed_deg_s for design in designs]
    between = dialled_number(math.sqrt(min(speeds) * max(speeds)))
    return [
        replace(design, speed_deg_s=between) if k % 2 and design.speed_end_deg_s is None else design
        for k, design in enumerate(designs)
    ]


def _label(k: int) -> str:
    return f"next-{k + 1}"
