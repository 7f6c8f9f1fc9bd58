"""The next runs as a result: what to measure, and the evidence expected of the rivals."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import MISSING, dataclass, field, fields, replace
from itertools import groupby
from pathlib import Path
from typing import Any

from ..simulation.designs import RunDesign
from ..simulation.simulation import Simulation
from ..support.layout import counted, laid_out
from ..support.plainresult import PlainResult, plain_fields
from .evidence import Hypothesis
from .further import run_steps


@dataclass(frozen=True)
class RivalEvidence:
    """Expected evidence of the next runs for rival causes.

    Attributes
    ----------
    causes : tuple of str
    seen : bool
        The readings show that one of them is present; otherwise each is assumed to be three times
        as large as the noise.
    told : bool
        The design of these runs distinguishes them, with the probability wanted.
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
        Empty where no run within the limits distinguishes anything more.
    between : tuple of RivalEvidence
        First what these runs are for, then what else they would distinguish.
    alone : bool
        To be diagnosed by themselves: the earlier runs lack a column that is needed.
    beyond : tuple of str
        What these runs need beyond all that was measured so far.
    seconds : float
        Time of the runs, without the work between them.
    simulation : Simulation
        The assumed model, with these runs: ready to be simulated.
    notes : tuple of str
    hypotheses : tuple
        The assumed form and size of each cause in question, by entry of ``between``.
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
        found = plain_fields(self, "between readings seconds alone beyond notes")
        return {"runs": [_plain_run(design) for design in self.runs], **found}

    def save(self, path: str | Path) -> None:
        """Write the simulation with these runs as TOML, ready for ``trueangle simulate``."""
        self.simulation.save(path)

    def summary(self) -> str:
        """What to do at the rig, and what it would show."""
        lines = []
        if self.runs:
            lines.append(
                f"Next: {counted(self.runs, 'run')} of {self.readings} readings in all, "
                f"{_spoken_time(self.seconds)} of motion"
                + (
                    "; diagnose them alone"
                    if self.alone
                    else "; diagnose them with the earlier runs"
                )
            )
            for steps, same in groupby(self.runs, lambda design: [*run_steps(design)]):
                labels = [str(design.label) for design in same]
                times = f" to {labels[-1]}, {len(labels)} times the same" if len(labels) > 1 else ""
                lines.append(f"  {labels[0]}{times}")
                lines += [f"    - {step}" for step in steps]
        shown: list[str] = []
        for entry in self.between:
            if entry.told and not entry.seen and len(entry.causes) == 1:
                shown += entry.causes
                continue
            kind = "shows" if len(entry.causes) == 1 else "distinguishes"
            kind = kind if entry.told else "not distinguished:"
            text = f"  {kind} {(' from ' if entry.told else ' or ').join(entry.causes)}"
            if entry.seen and entry.expected_bic is not None and entry.chance_named is not None:
                by = f" ({entry.trials} simulated)" if entry.trials else ""
                text += f": expected BIC gain {entry.expected_bic:.0f}, true cause named in "
                text += f"{100.0 * entry.chance_named:.0f} % of the cases{by}"
            if text not in lines:  # two lines of the pattern may give the same text
                lines.append(text)
        if shown:
            lines.append(f"  shows {', '.join(dict.fromkeys(shown))}")
        if self.beyond:
            lines.append(f"  conditions not measured so far: {', '.join(self.beyond)}")
        lines += [f"  note: {note}" for note in self.notes]
        return laid_out(lines)

    def _brief(self) -> str:
        told = [cause for entry in self.between if entry.told for cause in entry.causes]
        runs = f"{counted(self.runs, 'run')}, {counted(self.readings, 'reading')}"
        listed = ", ".join(dict.fromkeys(told))
        return f"{runs}, {self.seconds:.3g} s: {listed or 'nothing distinguished'}"


def _plain_run(design: RunDesign) -> dict[str, Any]:
    """A ``[[run]]`` table of a simulation file; what is as usual is omitted."""
    table = {}
    for f in fields(design):
        value = getattr(design, f.name)
        always = f.name in ("label", "speed_deg_s", "samples")
        if always or f.default is MISSING or value != f.default:
            table[f.name] = list(value) if isinstance(value, tuple) else value
    return table


def _spoken_time(seconds: float) -> str:
    """Seconds or minutes."""
    return f"{seconds:.0f} s" if seconds < 120.0 else f"{seconds / 60.0:.0f} min"
