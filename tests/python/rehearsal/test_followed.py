"""What a diagnosis cannot tell is told once the runs that it plans are measured: every entry.

A cause is hidden in runs of which the design cannot tell it, the plan is made from their diagnosis,
its runs are simulated with the same cause, and all are diagnosed. `make exam` asks every entry that
``not_identifiable`` can hold.
"""

from __future__ import annotations

import os
import zlib
from dataclasses import replace

import numpy as np
import pytest

import trueangle as ta
from trueangle.effects.argument_error import ArgumentShift
from trueangle.joint.signals import join_runs
from trueangle.planning import Limits
from trueangle.planning.worth import effect_of_size
from trueangle.rehearsal.trial import trial_outcome
from trueangle.simulation import Harmonic, Joint, RunDesign, Simulation, simulate, simulate_along

JOINT = Joint(50.0, "circular_spline", "motor")
LINES = (Harmonic("output", 1, 14.0, 243.0), Harmonic("motor", 2, 10.0, 248.0))
SIM = Simulation(JOINT, LINES, sigma_arcsec=1.0)

#: Lines of which the argument matters: 48 arcsec of the difference.
STEEP = (Harmonic("output", 1, 1000.0, 243.0), Harmonic("motor", 2, 100.0, 248.0))

#: Error of what is hidden, in standard deviations of a reading.
SIZE = 4.0

#: What a rig of this kind can do.
LIMITS = Limits(
    temperature_C=(20.0, 35.0),
    torque_Nm=(-10.0, 10.0),
    gravity_Nm=10.0,
    mount_deg=(0.0, 130.0, 250.0),
    current_A=(-3.0, 3.0),
    samples=360,
    runs=6,
)

#: Both directions, two speeds, loads, temperatures, three mounts: tells all but the current.
RICH = tuple(
    RunDesign(
        label=f"{k}",
        direction=1 if k % 2 else -1,
        speed_deg_s=(5.0, 30.0)[k % 2],
        samples=120,
        start_deg=37.0 * k,
        turns=1.3,
        reversals=(0.3, 0.6, 0.8),
        gravity_Nm=(-5.0, 2.0, 5.0)[k % 3],
        temperature_C=(20.0, 35.0)[k // 2 % 2],
        mount_deg=(0.0, 130.0, 250.0)[k // 3 % 3],
    )
    for k in range(9)
)


def runs(designs=RICH, **changes):
    return [replace(run, **changes) for run in designs]


ONE_WAY = runs(direction=1, reversals=())
CONSTANT = [replace(run, gravity_Nm=0.0, torque_Nm=5.0) for run in RICH]
GRID = runs(samples=36, spacing="uniform", turns=1.0, reversals=(), start_deg=0.0)

#: Runs, columns that they did not record, and causes, of every entry.
ENTRIES = {
    "one direction": (ONE_WAY, (), ("backlash",)),
    "one direction, hysteresis": (ONE_WAY, (), ("presliding_hysteresis",)),
    "one direction, pattern": (ONE_WAY, (), ("direction_dependent_pattern",)),
    "one direction, ramp": (
        runs(ONE_WAY, start_deg=0.0, spacing="uniform"),
        (),
        ("scale_error", "drift_within_run"),
    ),
    "one speed": (runs(speed_deg_s=30.0), (), ("backlash", "latency")),
    "one speed, one direction": (runs(ONE_WAY, speed_deg_s=30.0), (), ("latency",)),
    "one speed, filter": (runs(ONE_WAY, speed_deg_s=30.0), (), ("filter_lag",)),
    "one speed, channels": (runs(ONE_WAY, speed_deg_s=30.0), (), ("channel_skew",)),
    "one speed a run": (
        runs(turns=1.0, reversals=(0.5,), start_deg=0.0, speed_deg_s=30.0),
        (),
        ("clock_drift", "scale_error"),
    ),
    "no speed": (RICH, ("velocity", "time"), ("latency",)),
    "no speed, filter": (RICH, ("velocity", "time"), ("filter_lag",)),
    "no speed, channels": (RICH, ("velocity", "time"), ("channel_skew",)),
    "no speed, clock": (RICH, ("velocity", "time"), ("clock_drift",)),
    "no speed, reversals": (
        RICH,
        ("velocity", "time"),
        ("backlash", "presliding_hysteresis"),
    ),
    "no time": (RICH, ("velocity", "time"), ("time_periodic",)),
    "no temperature": (RICH, ("temperature",), ("thermal_drift",)),
    "one temperature": (runs(temperature_C=25.0), (), ("thermal_drift",)),
    "few runs at a temperature": (
        [replace(run, temperature_C=20.0 + 15.0 * (k % 2)) for k, run in enumerate(RICH[:3])],
        (),
        ("thermal_drift", "zero_slip"),
    ),
    "no torque": (RICH, ("torque",), ("torsional_compliance",)),
    "no load": (runs(gravity_Nm=0.0), (), ("torsional_compliance",)),
    "no load, gear": (runs(gravity_Nm=0.0), (), ("load_dependent_gear_error",)),
    "one load": (CONSTANT, (), ("torsional_compliance",)),
    "one load, cube": (CONSTANT, (), ("stiffening_compliance",)),
    "one load, gear": (CONSTANT, (), ("load_dependent_gear_error",)),
    "a load that does not turn": (
        [replace(run, gravity_Nm=0.0, torque_Nm=5.0 * (k % 3 - 1)) for k, run in enumerate(RICH)],
        (),
        ("torque_hysteresis",),
    ),
    "load and temperature": (
        [
            replace(run, gravity_Nm=0.0, torque_Nm=5.0 * (k % 2), temperature_C=20.0 + 15 * (k % 2))
            for k, run in enumerate(RICH)
        ],
        (),
        ("thermal_drift", "torsional_compliance", "load_dependent_gear_error"),
    ),
    "no current": (RICH, (), ("current_coupling",)),
    "no mount": (RICH, ("mount",), ("reference_error",)),
    "one mount": (runs(mount_deg=0.0), (), ("reference_error", "missing_order")),
    "one run": (RICH[:1], (), ("non_integer_order", "missing_order")),
    "a direction per run": (
        [replace(run, direction=1 if k > 1 else -1, reversals=()) for k, run in enumerate(RICH)],
        (),
        ("backlash", "zero_slip"),
    ),
    "a grid": (
        GRID,
        (),
        ("missing_order", "sidebands", "argument_error", "local_defect"),
    ),
}

#: Diagnoses asked of each cause, shared by several first measurements with a plan each, and the
#: share that must name it.
NIGHTLY = bool(os.environ.get("TRUEANGLE_NIGHTLY"))
SEEDS = int(os.environ.get("TRUEANGLE_EXAM_SEEDS", "20")) if NIGHTLY else 3
FIRSTS = 2 if NIGHTLY else 1
WANTED = 0.95


def blanked(measured, lacking):
    """Runs without some columns."""
    return [replace(run, **dict.fromkeys(lacking)) for run in measured]


def believed(cause):
    """What is believed of the joint; the argument matters where lines are steep."""
    return replace(SIM, harmonics=STEEP) if cause == "argument_error" else SIM


def hidden(cause):
    """An effect of this cause that is clearly there, seen by a run in which all varies."""
    if cause == "argument_error":
        return ArgumentShift(-1.0)
    varied = [replace(run, current_A=2.0 * (k % 3 - 1)) for k, run in enumerate(RICH)]
    rich = join_runs(simulate(SIM, 0, varied))
    return effect_of_size(cause, SIZE, rich, SIM.surroundings)


def followed(entry, cause, seeds, seed):
    """How often the cause is named once its plan was followed, and the plan; None: named before."""
    designs, lacking, _ = ENTRIES[entry]
    sim = believed(cause)
    truth = sim.with_effects([hidden(cause)])
    rng = np.random.default_rng(seed)
    first = blanked(simulate(truth, rng, designs), lacking)
    found = ta.diagnose(first, sim)
    if trial_outcome(found, cause).is_named and not any(
        cause in spot.causes for spot in found.not_identifiable
    ):
        return seeds, None
    asked = [s.causes for s in found.not_identifiable if cause in s.causes]
    plan = ta.plan_after(
        first, sim, between=asked[0] if asked else None, limits=LIMITS, within=None, seeds=4
    )
    named = 0
    for _ in range(seeds):
        ideal = simulate(sim, rng, plan.runs) if plan.runs else []
        earlier = [] if plan.alone else simulate(sim, rng, designs)
        measured = simulate_along(truth, [*earlier, *ideal], rng)
        measured = [*blanked(measured[: len(earlier)], lacking), *measured[len(earlier) :]]
        named += trial_outcome(ta.diagnose(measured, sim), cause).is_named
    return named, plan


ASKED = [(entry, cause) for entry, (_, _, causes) in ENTRIES.items() for cause in causes]
FEW = [
    ("one speed", "latency"),
    ("one temperature", "thermal_drift"),
    ("no current", "current_coupling"),
]


@pytest.mark.parametrize(("entry", "cause"), ASKED if NIGHTLY else FEW)
def test_a_plan_that_is_followed_names_the_cause(entry, cause):
    """The seeds are always the same: a share of 95 % in 20 is missed by chance all too often."""
    named = 0
    for first in range(FIRSTS):
        seed = [zlib.crc32(f"{entry}: {cause}".encode()), first]
        found, plan = followed(entry, cause, SEEDS // FIRSTS, seed)
        print(entry, cause, found, plan)
        assert plan is None or plan.runs
        assert plan is None or plan.between[0].told
        named += found
    assert named >= WANTED * (SEEDS // FIRSTS * FIRSTS)
