"""What a rehearsal found, of one cause and of all, and its words."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from ..planning.nextruns import NextRuns
from ..support.layout import counted, laid_out, wrapped_lines
from ..support.plainresult import PlainResult, ShownResult, plain_fields, result_picture
from .detection import Chance, SizeRange, binomial_interval
from .trial import TrialOutcome

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Names of causes listed of those it is confused with.
MOST = 3

#: Of what is not bracketed.
OPEN = (
    "Sizes from which on a cause is named in 50 % and 95 % of the trials, with 95 % intervals; "
    "? where the sizes tried do not bracket them:"
)

#: Shares of the trials that are reported.
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
        Trials by the answer of the diagnosis: ``named``, ``not_confirmed``, ``not_told_apart``,
        ``taken_for_another``, ``unexplained``, ``nothing``.
    confused_with : dict of str to int
        Causes it was confused with or not distinguished from, with the number of trials, most often
        first.
    beside : dict of str to int
        Causes that were confirmed in addition and were not there.
    blind_because, measure : str or None
        Why the design cannot show it, and what would; None where it can.
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
        ends = [list(self.intervals.get(share, (None, None))) for share in SHARES]
        tried = [
            {"size": size, "named": n, "trials": of, "interval": list(binomial_interval(n, of))}
            for size, (n, of) in self.tried.items()
        ]
        return {
            **plain_fields(self, "cause size_name named_50"),
            "named_50_interval": ends[0],
            "named_95": self.named_95,
            "named_95_interval": ends[1],
            "confused_with": list(self.confused_with),
            **plain_fields(self, "blind_because measure trials told beside"),
            "tried": tried,
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


@dataclass(frozen=True)
class Rehearsal(PlainResult):
    """What `trueangle.rehearse` found.

    Attributes
    ----------
    causes : list of RehearsedCause
    next_runs : NextRuns or None
        The further runs that decide most of what these cannot; None where none do.
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
        numbers = "readings runs noise_arcsec=noise seed seeds trials"
        return plain_fields(self, f"causes next_run=next_runs {numbers} complete notes")

    def _brief(self) -> str:
        named = sum(cause.named_50 is not None for cause in self.causes)
        ended = "" if self.complete else ", incomplete"
        causes, trials = counted(self.causes, "cause"), counted(self.trials, "trial")
        return f"{named} of {causes} named, {trials}{ended}"

    def summary(self) -> str:
        """The table of sizes, what is never named and why, and the runs that would help most."""
        lines: list[str] = []
        for note in self.notes:
            if note.startswith("INCOMPLETE"):
                lines += [*wrapped_lines(f"{note}.", 2), ""]
        tried = [cause for cause in self.causes if cause.ever_named]
        text = f"{len(tried)} of {counted(self.causes, 'cause')} named in these runs. "
        text += f"{counted(self.runs, 'run')}, {counted(self.readings, 'reading')}, noise "
        text += f"{self.noise:g} arcsec; {counted(self.trials, 'diagnosis', 'diagnoses')}, at most "
        lines += wrapped_lines(f"{text}{self.seeds} of a cause, seed {self.seed}.", 2)
        if tried:
            lines += ["", *wrapped_lines(OPEN, 2)]
            for cause in tried:
                lines += wrapped_lines(f"- {_found(cause)}", 2)
        never = [cause for cause in self.causes if not cause.ever_named]
        if never:
            lines += ["", "Not named in these runs:"]
            for cause in never:
                lines += wrapped_lines(f"- {_never(cause)}", 2)
        lines += ["", *self._next()]
        for note in self.notes:
            if not note.startswith("INCOMPLETE"):
                lines += wrapped_lines(f"Note: {note}.", 2)
        return laid_out(lines)

    def _next(self) -> list[str]:
        if self.next_runs is not None:
            return [*self.next_runs.summary().splitlines(), ""]
        if all(cause.ever_named for cause in self.causes):
            return []
        return ["No further run was found that identifies another cause."]

    def plot(self) -> Figure:
        """Detection against size, a small picture for every cause (needs ``trueangle[plot]``)."""
        figure: Figure = result_picture(self)
        return figure


def _found(cause: RehearsedCause) -> str:
    """The sizes from which on a cause is named, and what it is taken for else."""
    half, most = (_size(cause, share) for share in (0.5, 0.95))
    sizes = f"{half} in 50 %, {most} in 95 %, of {cause.trials}"
    if len(cause.tried) == 1:
        sizes = half
    instead = ", ".join([*cause.confused_with][:MOST]) or _else(cause)
    return f"{cause.cause}, {cause.size_name}: {sizes}{'; else ' if instead else ''}{instead}"


def _size(cause: RehearsedCause, share: float) -> str:
    """A threshold with its interval; where it is not bracketed, what is known."""
    value = cause.named_50 if share == 0.5 else cause.named_95
    low, high = cause.intervals.get(share, (None, None))
    sizes = [*cause.tried]
    if len(sizes) == 1:
        named, count = cause.tried[sizes[0]]
        return f"{named} of {count}"
    if value is not None:
        return f"{value:.3g} ({_end(low)} to {_end(high)})"
    named, count = cause.tried[sizes[0]]
    if named > share * count:
        return f"{'below' if cause.grows else 'above'} {sizes[0]:.3g}"
    named, count = cause.tried[sizes[-1]]
    return f"? ({named} of {count} at {sizes[-1]:.3g})"


def _end(size: float | None) -> str:
    return "?" if size is None else f"{size:.3g}"


def _else(cause: RehearsedCause) -> str:
    """The other answers of the diagnosis."""
    other = ", ".join(verdict for verdict in cause.told if verdict != "named")
    return other.replace("told_apart", "distinguished").replace("_", " ")


def _never(cause: RehearsedCause) -> str:
    text = cause.cause
    if cause.blind_because:
        text += f": {cause.blind_because}"
    elif not cause.trials:
        text += ": not tried"
    if cause.trials:
        largest = [*cause.tried][-1]
        times = counted(cause.trials, "time")
        text += f" (hidden {times}, up to {cause.size_name} {largest:.3g}"
        instead = ", ".join([*cause.confused_with][:MOST])
        text += f"; confused with {instead})" if instead else f"; reported: {_else(cause)})"
    if cause.measure:
        text += f". To find out: {cause.measure}"
    return text + "."
