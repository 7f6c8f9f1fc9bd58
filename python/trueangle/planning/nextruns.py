"""The next runs as a result: what to measure, and the evidence expected of the rivals."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import MISSING, dataclass, field, fields, replace
from functools import partial
from itertools import groupby, pairwise
from pathlib import Path
from typing import Any

import numpy as np

from ..simulation.designs import RunDesign
from ..simulation.simulation import Simulation
from ..support.layout import counted, laid_out
from ..support.plainresult import PlainResult, plain_fields
from .evidence import Hypothesis
from .limits import Limits

#: Steps in which readings follow a reversal closely, deg.
CLOSE = 0.25

#: Seconds that a reading at rest takes.
AT_REST = 1.0


def plainest_run(limits: Limits, label: str) -> RunDesign:
    """The plainest run that limits allow: one way over the arc at the middle of the speeds."""
    slow, fast = limits.speed_deg_s
    return RunDesign(
        label=label,
        speed_deg_s=dialled_number(np.sqrt(slow * fast)),
        samples=limits.samples,
        start_deg=limits.arc_deg[0],
        turns=limits.span_deg / 360.0,
        temperature_C=limits.temperature_C[0],
        torque_Nm=min(max(0.0, limits.torque_Nm[0]), limits.torque_Nm[1]),
        mount_deg=limits.mount_deg[0],
    )


def run_choices(
    limits: Limits, with_current: bool = True, samples: int | None = None
) -> Iterator[list[dict[str, Any]]]:
    """For each kind of choice all that limits allow, as fields of `RunDesign` that it changes.

    ``samples`` are the readings of the run where they are fewer than limits allow.
    """
    yield [*_motions(limits, limits.samples if samples is None else samples)]
    slow, fast = limits.speed_deg_s
    middle = dialled_number(np.sqrt(slow * fast))
    speeds = dict.fromkeys((fast, middle, slow))
    coasting = [{"speed_deg_s": fast, "speed_end_deg_s": max(fast / 4.0, slow)}]
    yield [
        *({"speed_deg_s": v, "speed_end_deg_s": None} for v in speeds),
        *(coasting if slow < fast else ()),
    ]
    cold, warm = limits.temperature_C
    if cold < warm:
        levels = [(cold, None), (warm, None), (cold, warm)]
        yield [{"temperature_C": a, "temperature_end_C": b} for a, b in levels]
    low, high = limits.torque_Nm
    loads = dict.fromkeys((min(max(0.0, low), high), low, high))
    weights = dict.fromkeys((0.0, limits.gravity_Nm))
    if len(loads) > 1 or len(weights) > 1:
        yield [
            *({"torque_Nm": load, "gravity_Nm": 0.0} for load in loads),
            *({"torque_Nm": 0.0, "gravity_Nm": g} for g in weights if g > 0.0),
        ]
    if len(limits.mount_deg) > 1:
        yield [{"mount_deg": mount} for mount in limits.mount_deg]
    if with_current and limits.current_A[0] < limits.current_A[1]:
        yield [{"current_A": amperes} for amperes in limits.current_A]


def count_of_changes(design: RunDesign, kinds: Sequence[Sequence[dict[str, Any]]]) -> int:
    """In how many of these kinds a run is not as plain as it could be."""
    return sum(
        any(getattr(design, name) != value for name, value in options[0].items())
        for options in kinds
    )


def run_amounts(
    design: RunDesign, limits: Limits
) -> Iterator[tuple[str, Callable[[float], float]]]:
    """What of a run is a matter of degree: its field, and what a step leads to.

    A step of 1 leads over the whole range, of speeds in their logarithm, and never beyond limits.
    """
    low, high = limits.speed_deg_s
    ranges = {
        "speed_deg_s": (low, high),
        "speed_end_deg_s": (low, high),
        "temperature_C": limits.temperature_C,
        "temperature_end_C": limits.temperature_C,
        "torque_Nm": limits.torque_Nm,
        "gravity_Nm": (0.0, limits.gravity_Nm),
        "current_A": limits.current_A,
    }
    for name, (least, most) in ranges.items():
        now = getattr(design, name)
        if now is None or least == most or (name == "gravity_Nm" and design.torque_Nm):
            continue
        if name.startswith("speed"):
            yield name, partial(_faster, now, least, most)
        else:
            yield name, partial(_higher, now, least, most)


def _faster(now: float, least: float, most: float, step: float) -> float:
    return min(max(dialled_number(now * (most / least) ** step), least), most)


def _higher(now: float, least: float, most: float, step: float) -> float:
    return min(max(dialled_number(now + (most - least) * step), least), most)


def _motions(limits: Limits, samples: int) -> Iterator[dict[str, Any]]:
    """Ways over the arc: one way, out and back, back and forth, close to reversals."""
    span, (start, stop) = limits.span_deg, limits.arc_deg
    plain = {"spacing": "jittered", "reversals": ()}
    for direction, begin in ((1, start), (-1, stop)):
        over = {**plain, "direction": direction, "start_deg": begin}
        yield {**over, "turns": span / 360.0}
        if limits.reversals:
            yield {**over, "turns": 2.0 * span / 360.0, "reversals": (0.5,)}
    if limits.reversals:
        thirds = {**plain, "direction": 1, "start_deg": start, "turns": 2.0 * span / 360.0}
        # Three segments of different length: two thirds out, a third back, two thirds out again.
        yield {**thirds, "turns": 5.0 / 3.0 * span / 360.0, "reversals": (0.4, 0.6)}
        yield {**thirds, "turns": 4.0 * span / 360.0, "reversals": (0.25, 0.5, 0.75)}
        leg = min(CLOSE * samples / 4.0, span)
        middle = round(0.5 * (start + stop) - leg / 2.0, 3)
        close = {"start_deg": middle, "turns": 4.0 * leg / 360.0, "reversals": (0.25, 0.5, 0.75)}
        yield {**thirds, **close}


def run_seconds(design: RunDesign) -> float:
    """How long a run takes, without what is done before it."""
    if design.speed_deg_s == 0.0:
        return AT_REST * design.samples
    travel, end = 360.0 * design.turns, design.speed_end_deg_s
    if end is None or end == design.speed_deg_s:
        return travel / design.speed_deg_s
    return float(np.log(design.speed_deg_s / end) / design.decay_per_s)


def run_steps(design: RunDesign) -> Iterator[str]:
    """A run in the words of who measures it, step by step."""
    span, sign = 360.0 * design.turns, design.direction
    edges = [0.0, *design.reversals, 1.0]
    at, places = design.start_deg, [design.start_deg]
    for leg, (a, b) in enumerate(pairwise(edges)):
        at += sign * (-1) ** leg * span * (b - a)
        places.append(at)
    way = " to ".join(f"{place:.4g}" for place in places)
    speed = f"{design.speed_deg_s:g} deg/s"
    if design.speed_end_deg_s is not None:
        speed = f"coasting from {speed} to {design.speed_end_deg_s:g}"
    yield f"move {way} deg at {speed} ({run_seconds(design):.0f} s)"
    free = {"jittered": "once at a random angle in each equal step", "uniform": "at equal steps"}
    yield f"read {design.samples} times, {free.get(design.spacing, design.spacing)}"
    if design.temperature_end_C is not None:
        yield f"warm from {design.temperature_C:g} to {design.temperature_end_C:g} C meanwhile"
    else:
        yield f"at {design.temperature_C:g} C"
    if design.torque_Nm:
        yield f"under a constant load of {design.torque_Nm:g} Nm"
    if design.gravity_Nm:
        yield f"lifting a weight: {design.gravity_Nm:g} Nm where it is level"
    if design.mount_deg:
        yield f"the reference turned on its mount to {design.mount_deg:g} deg"
    if design.current_A is not None:
        yield f"the motor's current held at {design.current_A:g} A"


def dialled_number(value: float) -> float:
    """A number that can be dialled in: two digits."""
    return float(f"{value:.2g}")


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
        notes = [f"  note: {note}" for note in self.notes]
        lines = [] if self.runs else [*notes]
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
        return laid_out([*lines, *(notes if self.runs else ())])

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
