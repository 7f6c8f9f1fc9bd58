"""What a rehearsal found, and its words."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import TYPE_CHECKING, Any

from ..planning.nextruns import NextRuns
from ..support.layout import counted, laid_out, wrapped_lines
from ..support.plainresult import PlainResult, result_picture
from .cause import RehearsedCause

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Names of causes listed of those it is confused with.
MOST = 3

#: Of what is not bracketed.
OPEN = "Sizes with their 95 % intervals; ? where the sizes tried do not bracket them."


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
        causes, trials = counted(self.causes, "cause"), counted(self.trials, "trial")
        return f"{named} of {causes} named, {trials}{ended}"

    def summary(self) -> str:
        """The table of sizes, what is not seen and why, and the runs that would help most."""
        lines: list[str] = []
        for note in self.notes:
            if note.startswith("INCOMPLETE"):
                lines += [*wrapped_lines(f"{note}.", 2), ""]
        lines += wrapped_lines(
            f"{counted(self.runs, 'run')}, {counted(self.readings, 'reading')}, noise "
            f"{self.noise:g} arcsec; {counted(self.trials, 'diagnosis', 'diagnoses')}, at most "
            f"{self.seeds} of a cause, seed {self.seed}.",
            2,
        )
        tried = [cause for cause in self.causes if cause.ever_named]
        if tried:
            lines += ["", *_table(tried), "", OPEN]
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
        return ["No further run was found that tells another cause."]

    def plot(self) -> Figure:
        """Detection against size, a small picture for every cause (needs ``trueangle[plot]``)."""
        figure: Figure = result_picture(self)
        return figure


def _table(causes: list[RehearsedCause]) -> list[str]:
    """Sizes by cause, with intervals, trials, and what it is taken for below them."""
    rows = [("cause, size", "named in 50 %", "named in 95 %", "trials", "else")]
    for c in causes:
        rows.append(
            (
                f"{c.cause}, {c.size_name}",
                _size(c, 0.5),
                _size(c, 0.95),
                str(c.trials),
                ", ".join([*c.confused_with][:MOST]) or _else(c),
            )
        )
    widths = [max(len(row[k]) for row in rows) for k in range(4)]
    lines = []
    for row in rows:
        cells = [text.ljust(width) for text, width in zip(row, widths, strict=False)]
        lines.append("  ".join([*cells, row[4]]).rstrip())
    return lines


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
    """What a diagnosis says where it names nothing instead."""
    other = [verdict.replace("_", " ") for verdict in cause.told if verdict != "named"]
    return ", ".join(other)


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
        text += f"; taken for {instead})" if instead else f"; reported: {_else(cause)})"
    if cause.measure:
        text += f". To find out: {cause.measure}"
    return text + "."
