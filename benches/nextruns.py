"""What a planned run costs: readings until the true one of two rivals is named, and seconds.

Against the plain rule of adding to the last run the change that opens most (another speed, warmer,
loaded ...), for every pair of causes that confound each other, that three plain runs do not tell
and that a further one can. Of either run the fewest readings are counted with which a diagnosis of
all runs names the true one in 95 % of seeds, whichever of the two it is.

Run: python benches/nextruns.py [--times] [--seeds N] [PAIR ...], a pair as cause,cause; all take
half an hour. `--times` takes the times alone.
"""

from __future__ import annotations

import statistics
from argparse import ArgumentParser
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from time import perf_counter, process_time
from typing import Any

import numpy as np

import trueangle as ta
from trueangle.effects import EFFECTS, Effect
from trueangle.effects.blindspots import blind_spots
from trueangle.estimation.regression import Regression
from trueangle.joint.signals import Signals, join_runs
from trueangle.planning import Limits
from trueangle.planning.worth import effect_of_size
from trueangle.rehearsal.trial import trial_outcome
from trueangle.simulation import Harmonic, Joint, RunDesign, Simulation, simulate

SIM = Simulation(
    Joint(50.0, "circular_spline", "motor"),
    (Harmonic("output", 1, 14.0, 243.0), Harmonic("motor", 2, 10.0, 248.0)),
    sigma_arcsec=1.0,
    runs=tuple(RunDesign(f"{k}", samples=120, start_deg=37.0 * k) for k in range(3)),
)

#: The rig: a little of everything.
LIMITS = Limits(
    temperature_C=(20.0, 35.0),
    torque_Nm=(-10.0, 10.0),
    gravity_Nm=10.0,
    mount_deg=(0.0, 130.0, 250.0),
    current_A=(-3.0, 3.0),
    samples=360,
    runs=6,
)

#: Error of the true one in a run that shows it, in standard deviations of a reading.
SIZE = 4.0

#: Share of the seeds of each count that may fail.
FAILURES = 0.05

#: Readings that are tried: 8 to 720, by a factor of the square root of 2.
LADDER = [round(8.0 * 2.0 ** (0.5 * k)) for k in range(14)]

Designs = Sequence[RunDesign]


def pairs() -> list[tuple[str, str]]:
    """Causes of which one is declared to be taken for the other."""
    return sorted(
        {(rival.kind, cause) for cause, effect in EFFECTS.items() for rival in effect.confused_with}
    )


def blind(designs: Designs) -> set[str]:
    """Causes that readings of these runs hide."""
    signals = signals_of(designs)
    noise = np.random.default_rng(0).standard_normal(len(signals)) * SIM.sigma_arcsec
    spots = blind_spots(Regression.of(signals, noise, SIM.surroundings))
    return {cause for spot in spots for cause in spot.causes if spot.hides(cause)}


def signals_of(designs: Designs) -> Signals:
    """Signals at the readings of these runs."""
    return join_runs(simulate(SIM, 0, designs))


def plain_rule(pair: tuple[str, str]) -> Designs:
    """The further run that opens most of both causes with the fewest changes; none opens none."""
    chosen, changes, best = replace(SIM.runs[-1], label="further"), 0, 0
    while changes < 4:
        found, most = chosen, best
        for change in plain_changes():
            design = replace(chosen, **change)
            hidden = blind([*SIM.runs, design])
            rich = signals_of([*SIM.runs, design])
            opens = [c for c in pair if c not in hidden and can_be(c, rich)]
            if len(opens) > most:
                found, most = design, len(opens)
        if most == best:
            break
        chosen, best, changes = found, most, changes + 1
    return [chosen] if best else []


def plain_changes() -> Iterator[dict[str, Any]]:
    """What one further run can have that the others lack."""
    yield {"reversals": (0.5,)}
    yield {"turns": 0.25 * 400 / 360.0, "samples": 400, "reversals": (0.25, 0.5, 0.75)}
    yield {"speed_deg_s": 20.0}
    yield {"speed_deg_s": 1.25}
    yield {"speed_end_deg_s": 1.25}
    yield {"temperature_C": 35.0}
    yield {"temperature_end_C": 35.0, "reversals": (0.5,)}
    for torque in (10.0, -10.0, 20.0):
        yield {"torque_Nm": torque}
    yield {"torque_Nm": 0.0, "gravity_Nm": 10.0}
    yield {"mount_deg": 130.0}
    yield {"spacing": "jittered", "turns": 3.0, "samples": 360}


def can_be(cause: str, rich: Signals) -> bool:
    """Whether readings of these runs can have this cause."""
    return effect_of_size(cause, SIZE, rich, SIM.surroundings) is not None


def hidden(cause: str) -> Effect | None:
    """The true one: as large as is seen in runs in which everything varies."""
    varied = [
        replace(
            run,
            direction=(-1) ** k,
            reversals=(0.3, 0.6),
            speed_deg_s=(5.0, 30.0)[k % 2],
            gravity_Nm=5.0 * k,
            temperature_C=20.0 + 7.5 * k,
            mount_deg=LIMITS.mount_deg[k],
            current_A=2.0 * (k - 1),
        )
        for k, run in enumerate(SIM.runs)
    ]
    return effect_of_size(cause, SIZE, signals_of(varied), SIM.surroundings)


def needed(designs: Designs, truth: Effect, cause: str, seeds: int, alone: bool = False) -> float:
    """Fewest readings of the ladder with which the cause is named; infinite where none do."""
    for readings in LADDER if designs else ():
        if names(shared(designs, readings), truth, cause, seeds, alone):
            return float(readings)
    return float("inf")


def shared(designs: Designs, readings: int) -> Designs:
    """The same runs with so many readings in all."""
    edges = np.linspace(0, readings, len(designs) + 1).round().astype(int)
    counts = np.maximum(np.diff(edges), 2)
    return [replace(d, samples=int(n)) for d, n in zip(designs, counts, strict=True)]


def names(designs: Designs, truth: Effect, cause: str, seeds: int, alone: bool) -> bool:
    """Whether all but a twentieth of the diagnoses name the cause."""
    true, failed = SIM.with_effects([truth]), 0
    for seed in range(seeds):
        runs = simulate(true, seed, designs if alone else [*SIM.runs, *designs])
        failed += not trial_outcome(ta.diagnose(runs, SIM), cause).is_named
        if failed > FAILURES * seeds:
            return False
    return True


def compared(pair: tuple[str, str], seeds: int = 20) -> tuple[float, float] | None:
    """Readings by the plan and by the plain rule; None where no run is needed, or none helps."""
    truths = {cause: hidden(cause) for cause in pair}
    if not blind(SIM.runs) & {*pair} or None in truths.values():
        return None
    former, by_plan, by_rule = plain_rule(pair), 0.0, 0.0
    for cause, truth in truths.items():
        assert truth is not None
        found = ta.diagnose(simulate(SIM.with_effects([truth]), 1), SIM)
        plan = found.plan(LIMITS, between=pair)
        by_plan = max(by_plan, needed(plan.runs, truth, cause, seeds, plan.alone))
        by_rule = max(by_rule, needed(former, truth, cause, seeds))
        if by_plan == by_rule == float("inf"):
            return None
    return by_plan, by_rule


def times() -> None:
    """Median seconds of a plan of places and of next runs."""
    arcs = [((1, 2), 180.0), ((1, 2, 3, 4), 270.0), (range(1, 9), 300.0)]
    for orders, stop in arcs:
        taken = timed(lambda o=orders, s=stop: ta.plan_arc(0.0, s, o), 5)
        print(f"orders 1 to {len(orders)} on {stop:g} deg: {taken}")
    truth = SIM.with_effects([hidden("latency")])  # type: ignore[list-item]
    runs = simulate(truth, 1)
    for between in (None, ["backlash", "latency"], ["thermal_drift", "torsional_compliance"]):
        for seeds in (0, 10):
            taken = timed(
                lambda b=between, n=seeds: ta.plan_after(runs, SIM, between=b, seeds=n), 3
            )
            what = "what is open" if between is None else " or ".join(between)
            print(f"next runs, {what}, {seeds} seeds: {taken}")


def timed(work: Callable[[], object], rounds: int) -> str:
    """Median seconds of a call, and of them those of the processor."""
    taken = []
    for _ in range(rounds):
        begun = perf_counter(), process_time()
        work()
        taken.append((perf_counter() - begun[0], process_time() - begun[1]))
    clock, processor = (statistics.median(column) for column in zip(*taken, strict=True))
    return f"{clock:.2f} s, {processor:.2f} s of a processor"


def main() -> None:
    """Print the times, then a line for each pair and the median."""
    parser = ArgumentParser(description="readings and seconds of planned runs")
    parser.add_argument("pairs", nargs="*", metavar="PAIR")
    parser.add_argument("--times", action="store_true")
    parser.add_argument("--seeds", type=int, default=20)
    asked = parser.parse_args()
    times()
    ratios = []
    chosen = [tuple(pair.split(",")) for pair in asked.pairs] or pairs()
    for one, other in [] if asked.times else chosen:
        found = compared((one, other), asked.seeds)
        if found is None:
            continue
        ratios.append(found[0] / found[1])
        line = f"{found[0]:g} readings, {found[1]:g} by the plain rule"
        print(f"{one} or {other}: {line}", flush=True)
    if ratios:
        median, worst = statistics.median(ratios), max(ratios)
        print(
            f"{len(ratios)} pairs: {median:.2f} of the readings in the median, {worst:.2f} at most"
        )


if __name__ == "__main__":
    main()
