"""The next runs: those within limits that are expected to tell rival causes apart."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import MISSING, dataclass, field, fields, replace
from pathlib import Path
from typing import Any

import numpy as np

from ..effects import EFFECTS
from ..effects.blindness import Blindness
from ..effects.blindspots import blind_spots
from ..estimation.regression import Regression
from ..joint.signals import Signals, join_runs
from ..simulation.designs import RunDesign
from ..simulation.simulation import Simulation
from ..support.blas import one_blas_thread
from ..support.deadline import pace
from ..support.plainresult import PlainResult, counted
from .evidence import Evidence, Hypothesis, Noise, evidence_between, is_doubted
from .further import base_of, choices, seconds_of
from .hypotheses import Question, question_of
from .limits import Limits

__all__ = ["NextRuns", "RivalEvidence", "next_runs", "plain_run"]

#: Chance of a strong difference of evidence that is wanted.
WANTED = 0.95

#: Runs in a row that open nothing, after which no further one is tried; by themselves the first
#: open nothing, whatever they are.
IN_VAIN = 3

#: Error of a cause of which nothing is seen, in standard deviations of a reading.
UNSEEN = 3.0

#: Questions up to which rivals are searched for though nothing is seen of them.
SEARCHED = 3

#: Standard deviations of evidence beyond which a design is not better: a tenth of the readings
#: has a third of them, which names a cause almost surely.
ENOUGH = 10.0

#: Passes over all choices of a run: the last one rarely changes anything.
PASSES = 3

#: Numbers of readings that are tried, as shares of the most.
SHARES = (0.1, 0.15, 0.2, 0.25, 0.33, 0.5, 0.67, 1.0)

#: Numbers of readings for which a design is looked for, likewise.
LEAN = (0.1, 0.3, 1.0)

#: Readings of a run at least.
LEAST = 24

#: Earlier readings that are looked at, at most: of more, one of every so many.
MOST_READINGS = 2000


@dataclass(frozen=True)
class RivalEvidence:
    """What the next runs are expected to say of causes.

    Attributes
    ----------
    causes : tuple of str
    seen : bool
        One of them is; otherwise each is taken to be three times as large as the noise.
    told : bool
        With these runs the design tells them, and the chance is as wanted.
    expected_bic : float or None
        The least expected difference of BIC, of any cause over any other.
    chance_named : float or None
        Of the true one: by simulated diagnoses where they were made (``trials``), else that of
        a strong difference (6) of BIC under normal noise.
    trials : int
    """

    causes: tuple[str, ...]
    seen: bool
    told: bool
    expected_bic: float | None
    chance_named: float | None
    trials: int = 0

    def to_dict(self) -> dict[str, Any]:
        """The entry of ``between``."""
        return {**vars(self), "causes": list(self.causes)}


@dataclass(frozen=True)
class NextRuns(PlainResult):
    """What to measure next.

    Attributes
    ----------
    runs : tuple of RunDesign
        None where no run within the limits tells anything more.
    between : tuple of RivalEvidence
        First what these runs are for, then what else they would tell.
    alone : bool
        To be diagnosed by themselves: the earlier runs did not record what tells.
    beyond : tuple of str
        What these runs need beyond all that was seen.
    seconds : float
        What the runs take, without what is done between them.
    simulation : Simulation
        What is believed, with these runs: ready to be simulated.
    notes : tuple of str
    hypotheses : tuple
        Of every entry of ``between`` that was asked, what each of its causes would be.
    """

    runs: tuple[RunDesign, ...]
    between: tuple[RivalEvidence, ...]
    alone: bool
    beyond: tuple[str, ...]
    seconds: float
    simulation: Simulation
    notes: tuple[str, ...] = ()
    hypotheses: tuple[tuple[Hypothesis, ...], ...] = field(default=(), repr=False)

    def with_readings(self, samples: Sequence[int]) -> NextRuns:
        """The same runs with other numbers of readings."""
        designs = tuple(
            replace(design, samples=n) for design, n in zip(self.runs, samples, strict=True)
        )
        return replace(self, runs=designs, simulation=replace(self.simulation, runs=designs))

    @property
    def readings(self) -> int:
        """Of all runs."""
        return sum(design.samples for design in self.runs)

    def to_dict(self) -> dict[str, Any]:
        """The object that ``trueangle plan`` prints as JSON."""
        return {
            "runs": [plain_run(design) for design in self.runs],
            "between": [entry.to_dict() for entry in self.between],
            "readings": self.readings,
            "seconds": self.seconds,
            "alone": self.alone,
            "beyond": list(self.beyond),
            "notes": list(self.notes),
        }

    def save(self, path: str | Path) -> None:
        """Write the simulation with these runs as TOML, ready for ``trueangle simulate``."""
        self.simulation.save(path)

    def summary(self) -> str:
        """What to do at the rig, and what it would tell."""
        from .summary import next_summary

        return next_summary(self)

    def _brief(self) -> str:
        told = [cause for entry in self.between if entry.told for cause in entry.causes]
        runs = f"{counted(self.runs, 'run')}, {counted(self.readings, 'reading')}"
        return f"{runs}, {self.seconds:.3g} s: {', '.join(dict.fromkeys(told)) or 'nothing told'}"


def plain_run(design: RunDesign) -> dict[str, Any]:
    """A ``[[run]]`` table of a simulation file; what is as usual is left out."""
    table = {}
    for f in fields(design):
        value = getattr(design, f.name)
        always = f.name in ("label", "speed_deg_s", "samples")
        if always or f.default is MISSING or value != f.default:
            table[f.name] = list(value) if isinstance(value, tuple) else value
    return table


def next_runs(
    earlier: Signals | None,
    believed: Simulation,
    spots: Sequence[Blindness],
    noise: Noise,
    limits: Limits | None = None,
) -> NextRuns:
    """The runs within limits that are expected to tell most of what is open.

    Parameters
    ----------
    earlier : Signals or None
        Of the runs measured so far.
    believed : Simulation
        With all that is confirmed.
    spots : sequence of Blindness
        What to tell: where something is seen in some of them, those; else all.
    noise : Noise
    limits : Limits, optional
        Without them those of the earlier runs (`Limits.of`), and where these tell nothing a
        little beyond (`Limits.wider`).

    Notes
    -----
    One choice after the other is changed to the best there is (speed, motion, load, temperature,
    mount, current), run after run, until all is told or nothing more is; readings are then
    lowered to the fewest that do. Half a second to some seconds.
    """
    with one_blas_thread():
        return _next_runs(earlier, believed, spots, noise, limits)


def _next_runs(
    earlier: Signals | None,
    believed: Simulation,
    spots: Sequence[Blindness],
    noise: Noise,
    limits: Limits | None,
) -> NextRuns:
    seen = [spot for spot in spots if spot.supported]
    asked = tuple(seen or spots)
    others = tuple(spot for spot in spots if spot not in asked)
    if limits is not None:
        return _Search(earlier, believed, asked, noise, limits).found(others, limits)
    within = Limits() if earlier is None else Limits.of(earlier)
    found = _Search(earlier, believed, asked, noise, within).found(others, within)
    if all(entry.told for entry in found.between[: len(asked)]):
        return found
    wider = within.wider()
    further = _Search(earlier, believed, asked, noise, wider).found(others, within)
    return further if _told(further) > _told(found) else found


def _told(plan: NextRuns) -> int:
    return sum(entry.told for entry in plan.between)


@dataclass(frozen=True, order=True)
class _Score:
    """What runs tell, the most important first."""

    opened: int
    told: int
    foretold: bool
    evidence: int
    plain: int
    seconds: float

    @property
    def worth(self) -> tuple[int, int, bool, int]:
        """What a further run must add to."""
        return self.opened, self.told, self.foretold, self.evidence


#: What is told before anything is tried.
NOTHING = _Score(0, 0, False, -1_000, 0, 0.0)


class _Search:
    """Runs that are tried for a set of questions."""

    def __init__(
        self,
        earlier: Signals | None,
        believed: Simulation,
        asked: Sequence[Blindness],
        noise: Noise,
        limits: Limits,
    ) -> None:
        self.earlier = None if earlier is None else _thinned(earlier)
        self.believed, self.noise, self.limits = believed, noise, limits
        self.around = believed.whole_surroundings
        rich = self._signals([_rich(limits)], None)
        rms = UNSEEN * noise.sigma
        self.questions = [question_of(spot, rich, self.around, rms) for spot in asked]

    def found(self, others: Sequence[Blindness], seen: Limits) -> NextRuns:
        """The best runs, beside the earlier ones or by themselves."""
        best = self._leanest(self.earlier)
        alone = False
        if self.earlier is not None and not best[1].told and self._lacks:
            apart = self._leanest(None)
            if not apart[1].opened:
                apart = self._repeated(apart)
            if apart[1] > best[1] and apart[1].opened:
                best, alone = apart, True
        designs, score = best
        if score.opened == 0:
            designs = []
        designs = self._fewest(designs, score, None if alone else self.earlier)
        start = None if alone else self.earlier
        return NextRuns(
            tuple(designs),
            tuple(self._entries(designs, others, start)),
            alone and bool(designs),
            tuple(_beyond(designs, seen)),
            sum(map(seconds_of, designs)),
            replace(self.believed, runs=tuple(designs), source=None),
            tuple(self._notes(designs)),
            tuple(question.hypotheses for question in self.questions),
        )

    def _leanest(self, start: Signals | None) -> tuple[list[RunDesign], _Score]:
        """The best runs of few readings, or of more where these do not tell what is seen."""
        whole, best = self.limits, (list[RunDesign](), NOTHING)
        for share in LEAN if all(question.seen for question in self.questions) else (1.0,):
            samples = max(round(share * whole.samples), LEAST)
            self.limits = replace(whole, samples=min(samples, whole.samples))
            best = self._runs(start)
            if best[1].told == len(self.questions):
                break
        self.limits = whole
        return best

    @property
    def needs_current(self) -> bool:
        """A cause in question follows the motor's current."""
        return any("current" in EFFECTS[c].needs for q in self.questions for c in q.causes)

    @property
    def _lacks(self) -> bool:
        return self.earlier is not None and _lacks(self.earlier, self.questions)

    def _repeated(self, found: tuple[list[RunDesign], _Score]) -> tuple[list[RunDesign], _Score]:
        """The first run several times: levels that need runs of their own are told so."""
        for count in range(2, self.limits.runs + 1 if found[0] else 0):
            again = [replace(found[0][0], label=f"next-{k + 1}") for k in range(count)]
            score = self._score(again, 0, None)
            if score.opened:
                return again, score
        return found

    def _notes(self, designs: Sequence[RunDesign]) -> Iterator[str]:
        if not designs:
            yield "no run within the limits tells any of these causes"
        if pace().over:
            yield "the search was ended early"

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
        """Noise at these readings, beside what is believed."""
        whites = np.random.default_rng(0).standard_normal(len(signals)) * self.noise.sigma
        return Regression.of(signals, whites, self.around, rho=self.noise.correlation)

    @property
    def _searches(self) -> bool:
        """Whether rivals take the form that imitates best: of many questions that is too slow."""
        return len(self.questions) <= SEARCHED or any(q.seen for q in self.questions)

    def _open(self, question: Question, regression: Regression, spots: Sequence[Blindness]) -> bool:
        """Whether nothing in the design of the readings hides one of the causes."""
        if any(spot.hides(cause) for spot in spots for cause in question.causes):
            return False
        return not (
            self._searches
            and any(
                is_doubted(regression, one, spots)
                for one in (*question.hypotheses, *question.draws)
            )
        )

    def _evidence(self, question: Question, regression: Regression) -> list[Evidence]:
        rivals = question.hypotheses
        return evidence_between(regression, rivals, self.noise, self._searches)

    def _score(self, designs: Sequence[RunDesign], changes: int, start: Signals | None) -> _Score:
        regression = self._readings(self._signals(designs, start))
        spots = blind_spots(regression)
        opened = told = 0
        total = 0.0
        for question in self.questions:
            is_open = self._open(question, regression, spots)
            evidence = self._evidence(question, regression)
            total += _gradient(evidence, question)
            opened += is_open
            told += is_open and _is_strong(evidence)
        # Of two designs that differ by less than half of the evidence the plainer one is taken.
        halves = round(total / (np.log(1.5) * len(self.questions)))
        seconds = -sum(map(seconds_of, designs))
        return _Score(opened, told, _foretold(regression), halves, -changes, seconds)

    def _runs(self, start: Signals | None) -> tuple[list[RunDesign], _Score]:
        """Run after run, until all is told, nothing is gained, or there are enough."""
        designs: list[RunDesign] = []
        best = NOTHING
        kept: list[RunDesign] = []
        while len(designs) < self.limits.runs and not pace().over:
            design, score = self._run(designs, start)
            designs.append(design)
            if score.worth > best.worth or not kept:
                best, kept = score, [*designs]
            # Zeros of the runs' own are told by several at once: one that opens nothing may help.
            done = best.told == len(self.questions) and (best.foretold or start is not None)
            if done or len(designs) - len(kept) == IN_VAIN:
                break
        return kept, best

    def _run(self, before: Sequence[RunDesign], start: Signals | None) -> tuple[RunDesign, _Score]:
        """The best further run: one choice after the other."""
        design = base_of(self.limits, f"next-{len(before) + 1}")
        if self.needs_current and (start is None or start.current is not None):
            low, _ = self.limits.current_A
            design = replace(design, current_A=low)  # told where every run recorded it
        kinds = [*choices(self.limits, self.needs_current)]
        taken = [0] * len(kinds)
        best = self._score([*before, design], 0, start)
        for _ in range(PASSES):
            before_pass = best
            for k, options in enumerate(kinds):
                picked = design, taken[k]
                for j, option in enumerate(options):
                    if j == taken[k] or pace().over:
                        continue
                    other = replace(design, **option)
                    changes = sum(t > 0 for t in (*taken[:k], j, *taken[k + 1 :]))
                    score = self._score([*before, other], changes, start)
                    if score > best:
                        best, picked = score, (other, j)
                design, taken[k] = picked
            if best == before_pass:
                break
        return design, best

    def _fewest(
        self, designs: list[RunDesign], score: _Score, start: Signals | None
    ) -> list[RunDesign]:
        """The runs with the fewest readings that tell as much."""
        if not score.told or not all(question.seen for question in self.questions):
            return designs
        for share in SHARES:
            fewer = [
                replace(design, samples=max(round(share * design.samples), LEAST))
                for design in designs
            ]
            found = self._score(fewer, 0, start)
            if (found.opened, found.told) >= (score.opened, score.told):
                return fewer
        return designs

    def _entries(
        self, designs: Sequence[RunDesign], others: Sequence[Blindness], start: Signals | None
    ) -> Iterator[RivalEvidence]:
        """What the runs say of every question, and of what nobody asked."""
        if start is None and not designs:
            return
        regression = self._readings(self._signals(designs, start))
        spots = blind_spots(regression)
        for question in self.questions:
            evidence = self._evidence(question, regression)
            is_open = self._open(question, regression, spots)
            is_told = is_open and _is_strong(evidence)
            chance = min((e.chance for e in evidence), default=None)
            if chance is not None and not is_open:
                chance = 0.0
            bic = min((e.bic for e in evidence), default=None)
            yield RivalEvidence(question.causes, question.seen, is_told, bic, chance)
        for spot in others:
            if not any(other.hides(cause) for other in spots for cause in spot.causes):
                yield RivalEvidence(spot.causes, False, True, None, None)


def _is_strong(evidence: Sequence[Evidence]) -> bool:
    """Whether every cause is expected to win; of one without a form the design decides."""
    return min((e.chance for e in evidence), default=1.0) >= WANTED


def _foretold(regression: Regression) -> bool:
    """Whether the zero and lines of any run follow from the others: what is held out needs that.

    On average over a run they are foretold no worse than one reading tells them.
    """
    grams = [regression.base[a:b].T @ regression.base[a:b] for a, b in regression.bounds]
    every = np.sum(grams, axis=0)
    for (start, stop), gram in zip(regression.bounds, grams, strict=True):
        others = every - gram
        others += 1e-9 * np.trace(every) * np.eye(len(every))
        if np.trace(np.linalg.solve(others, gram)) > stop - start:
            return False
    return True


def _gradient(evidence: Sequence[Evidence], question: Question) -> float:
    """What grows with the evidence: of the causes in question, and of the least of all."""
    logs = {
        (e.cause, e.rival): float(np.log(min(max(e.deviations, 1e-2), ENOUGH))) for e in evidence
    }
    asked = [log for (_, rival), log in logs.items() if rival in ("", *question.causes)]
    return float(np.mean(asked)) + min(logs.values()) if logs else 0.0


def _lacks(signals: Signals, questions: Sequence[Question]) -> bool:
    """A column that these causes need was not recorded in every run."""
    causes = [cause for question in questions for cause in question.causes]
    needs = {"velocity", "time"}.union(*(EFFECTS[cause].needs for cause in causes))
    return any(getattr(signals, name) is None for name in needs)


def _thinned(signals: Signals) -> Signals:
    if len(signals) <= MOST_READINGS:
        return signals
    return signals.take(np.arange(0, len(signals), -(-len(signals) // MOST_READINGS)))


def _rich(limits: Limits) -> RunDesign:
    """A run in which all varies that limits allow."""
    design = base_of(limits, "rich")
    for options in choices(limits):
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
