"""The rehearsal as readable text."""

from __future__ import annotations

from typing import TYPE_CHECKING

from ..support.layout import laid_out, wrapped

if TYPE_CHECKING:
    from .result import Rehearsal, RehearsedCause

#: Names of causes listed of those it is confused with.
MOST = 3


#: Of what is not bracketed.
OPEN = "Sizes with their 95 % intervals; ? where the sizes tried do not bracket them."


def rehearsal_summary(rehearsal: Rehearsal) -> str:
    """The table of sizes, what is not seen and why, and the runs that would help most."""
    lines: list[str] = []
    for note in rehearsal.notes:
        if note.startswith("INCOMPLETE"):
            lines += [*wrapped(f"{note}.", 2), ""]
    lines += wrapped(
        f"{rehearsal.runs} runs, {rehearsal.readings} readings, noise {rehearsal.noise:g} arcsec; "
        f"{rehearsal.trials} diagnoses, at most {rehearsal.seeds} of a cause, seed "
        f"{rehearsal.seed}.",
        2,
    )
    tried = [cause for cause in rehearsal.causes if cause.ever_named]
    if tried:
        lines += ["", *_table(tried), "", OPEN]
    never = [cause for cause in rehearsal.causes if not cause.ever_named]
    if never:
        lines += ["", "Not named in these runs:"]
        for cause in never:
            lines += wrapped(f"- {_never(cause)}", 2)
    lines += ["", *_next(rehearsal)]
    for note in rehearsal.notes:
        if not note.startswith("INCOMPLETE"):
            lines += wrapped(f"Note: {note}.", 2)
    return laid_out(lines)


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
        text += f" (hidden {cause.trials} times, up to {cause.size_name} {largest:.3g}"
        instead = ", ".join([*cause.confused_with][:MOST])
        text += f"; taken for {instead})" if instead else f"; reported: {_else(cause)})"
    if cause.measure:
        text += f". To find out: {cause.measure}"
    return text + "."


def _next(rehearsal: Rehearsal) -> list[str]:
    if rehearsal.next_runs is not None:
        return [*rehearsal.next_runs.summary().splitlines(), ""]
    if all(cause.ever_named for cause in rehearsal.causes):
        return []
    return ["No further run was found that tells another cause."]
