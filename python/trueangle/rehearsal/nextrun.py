"""The one further run that lets a diagnosis tell the most causes."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import MISSING, dataclass, fields, replace
from typing import Any

import numpy as np

from ..diagnosis.identifiability import blind_spots
from ..effects import EFFECTS
from ..effects.blindness import Blindness
from ..estimation.regression import Regression
from ..joint.signals import join_runs
from ..simulation.designs import RunDesign
from ..simulation.simulation import Simulation, simulate
from ..support.deadline import pace
from ..support.plainresult import Shown
from .trial import measured_signals
from .visibility import size_range

__all__ = ["NextRun", "blind_causes", "next_run"]

#: Changes that a further run may combine, at most.
MOST_CHANGES = 4


@dataclass(frozen=True)
class NextRun(Shown):
    """One further run, and the causes that it opens.

    Attributes
    ----------
    design : RunDesign
    changes : tuple of str
        What is different from the runs there are.
    opens : tuple of str
        Causes of which the design of the runs, not their noise, says nothing without it.
    """

    design: RunDesign
    changes: tuple[str, ...]
    opens: tuple[str, ...]

    def to_dict(self) -> dict[str, Any]:
        """The object ``next_run``; ``run`` as a ``[[run]]`` table of a simulation file."""
        table = {
            f.name: list(v) if isinstance(v := getattr(self.design, f.name), tuple) else v
            for f in fields(self.design)
            if f.default is MISSING or getattr(self.design, f.name) != f.default
        }
        return {"run": table, "changes": list(self.changes), "opens": list(self.opens)}


def blind_causes(sim: Simulation) -> dict[str, Blindness]:
    """Causes that a diagnosis of readings of these runs does not name, and why."""
    signals = join_runs(simulate(replace(sim, effects=()), 0))
    noise = np.random.default_rng(0).standard_normal(len(signals)) * sim.sigma_arcsec
    found: dict[str, Blindness] = {}
    for spot in blind_spots(Regression.of(signals, noise, sim.surroundings)):
        for cause in spot.causes:
            if EFFECTS[cause].is_doubted and spot.hides(cause):
                found.setdefault(cause, spot)
    return found


def next_run(sim: Simulation, closed: Collection[str], seed: int) -> NextRun | None:
    """The further run that opens the most of the causes ``closed``, with the fewest changes.

    Changes of the last run are tried alone and then together, always the best one first. None
    where no single run opens any.
    """
    base = replace(sim.runs[-1], label="further")
    best, chosen = NextRun(base, (), ()), base
    while len(best.changes) < MOST_CHANGES:
        found = best
        for text, changes in _changes(sim):
            if text in best.changes or pace().over:
                continue
            design = replace(chosen, **changes)
            opens = _opened(sim, design, closed, seed)
            if len(opens) > len(found.opens):
                found = NextRun(design, (*best.changes, text), opens)
        if found is best:
            break
        best, chosen = found, found.design
    return best if best.opens else None


def _opened(
    sim: Simulation, design: RunDesign, closed: Collection[str], seed: int
) -> tuple[str, ...]:
    more = replace(sim, runs=(*sim.runs, design))
    blind = blind_causes(more)
    signals = measured_signals(more)
    return tuple(
        cause
        for cause in closed
        if cause not in blind and size_range(more, signals, cause, seed) is not None
    )


def _changes(sim: Simulation) -> Iterator[tuple[str, dict[str, Any]]]:
    """What one further run can have that the others lack."""
    runs = sim.runs
    samples = max(run.samples for run in runs)
    speeds = [run.speed_deg_s for run in runs]
    if not any(run.reversals for run in runs):
        yield "out and back in one run", {"reversals": (0.5,)}
    yield (
        "several reversals, read in steps of 0.25 deg",
        {"turns": 0.25 * max(samples, 400) / 360.0, "samples": max(samples, 400)}
        | {"reversals": (0.25, 0.5, 0.75)},
    )
    fast = 4.0 * max(speeds) if max(speeds) else 30.0
    yield f"at {fast:g} deg/s", {"speed_deg_s": fast, "speed_end_deg_s": None}
    if min(speeds) > 0.0:
        slow = min(speeds) / 4.0
        yield f"at {slow:g} deg/s", {"speed_deg_s": slow, "speed_end_deg_s": None}
        yield "coasting to a quarter of its speed", {"speed_end_deg_s": runs[-1].speed_deg_s / 4.0}
    warm = max(run.temperature_C for run in runs)
    yield f"at {warm + 15:g} C", {"temperature_C": warm + 15.0, "temperature_end_C": None}
    yield (
        f"warming up to {warm + 15:g} C and back in angle",
        {
            "temperature_end_C": warm + 15.0,
            "reversals": (0.5,),
        },
    )
    load = max((abs(run.torque_Nm) + abs(run.gravity_Nm) for run in runs), default=0.0) or 10.0
    for torque in (load, -load, 2.0 * load):
        yield f"under {torque:g} Nm", {"torque_Nm": torque}
    yield f"lifting {load:g} Nm against gravity", {"torque_Nm": 0.0, "gravity_Nm": load}
    mounts = {run.mount_deg for run in runs}
    for mount in (130.0, 250.0):
        if mount not in mounts:
            yield f"with the reference turned by {mount:g} deg", {"mount_deg": mount}
            break
    yield (
        "at free angles over three turns, three times as many readings",
        {
            "spacing": "jittered",
            "turns": 3.0,
            "samples": 3 * samples,
        },
    )
