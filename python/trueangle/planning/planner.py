"""`next_runs`: those within limits that are expected to tell rival causes apart."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

from ..effects.ambiguity import Ambiguity
from ..joint.signals import Signals
from ..simulation.designs import RunDesign
from ..simulation.simulation import Simulation
from ..support.blas import one_blas_thread
from ..support.deadline import with_deadline
from .evidence import ReadingNoise
from .further import run_seconds
from .limits import Limits
from .nextruns import NextRuns, RivalEvidence
from .scales import DesignScales
from .search import RunSearch

#: Readings whose diagnosis may take as much work by default as a plan may.
WORK = 20_000


def next_runs(
    earlier: Signals | None,
    believed: Simulation,
    spots: Sequence[Ambiguity],
    noise: ReadingNoise,
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
    noise : ReadingNoise
    limits : Limits, optional
        Without them those of the earlier runs (`Limits.of`), and where these tell nothing a
        little beyond (`Limits.wider`).

    Notes
    -----
    One choice after the other is changed to the best there is (speed, motion, load, temperature,
    mount, current, then the levels between), run after run, until all is told or nothing more is.
    Readings are then lowered to the fewest that do, and runs are looked for that need half of
    those, as long as there are any. Half a second to some seconds; after as much work
    as two diagnoses where no time is given, the best so far is the answer, and ``notes`` say so.
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
    """The best runs within limits, beside the earlier ones or by themselves."""
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
        yield f"no run {'found so far' if over else 'within the limits'} tells any of these causes"
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
