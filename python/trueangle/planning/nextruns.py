"""The next runs: those within limits that are expected to tell rival causes apart."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import MISSING, dataclass, field, fields, replace
from pathlib import Path
from typing import Any

from ..effects.blindness import Blindness
from ..joint.signals import Signals
from ..simulation.designs import RunDesign
from ..simulation.simulation import Simulation
from ..support.blas import one_blas_thread
from ..support.plainresult import PlainResult, counted
from .evidence import Hypothesis, Noise
from .further import seconds_of
from .limits import Limits
from .search import Search
from .worth import Scales

__all__ = ["NextRuns", "RivalEvidence", "next_runs", "plain_run"]


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
    mount, current, then the levels between), run after run, until all is told or nothing more is.
    Readings are then lowered to the fewest that do, and runs are looked for that need half of
    those, as long as there are any. Half a second to some seconds.
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

    def found(within: Limits, known: Limits) -> NextRuns:
        scales = Scales(earlier, believed, asked, noise, within)
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


def _found(scales: Scales, limits: Limits, others: Sequence[Blindness], seen: Limits) -> NextRuns:
    """The best runs within limits, beside the earlier ones or by themselves."""
    search, earlier, alone = Search(scales, limits), scales.earlier, False
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
        sum(map(seconds_of, designs)),
        replace(scales.believed, runs=tuple(designs), source=None),
        tuple(_notes(designs, scales.over)),
        tuple(question.hypotheses for question in scales.questions),
    )


def _entries(
    scales: Scales,
    designs: Sequence[RunDesign],
    others: Sequence[Blindness],
    start: Signals | None,
) -> Iterator[RivalEvidence]:
    """What the runs say of every question, and of what nobody asked."""
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
        yield "no run within the limits tells any of these causes"
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
