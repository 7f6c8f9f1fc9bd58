"""What a design of runs can tell: each rule on both of its sides, without a look at the errors."""

from dataclasses import replace

import numpy as np
import pytest

from trueangle.diagnosis.identifiability import ambiguity_of_cause, open_origins
from trueangle.effects.blindspots import blind_spots
from trueangle.effects.missing_order import MissingOrder
from trueangle.estimation.regression import Regression
from trueangle.joint.signals import join_runs
from trueangle.simulation import Harmonic, Joint, RunDesign, Simulation, simulate

JOINT = Joint(50.0, "circular_spline", "motor")
LINES = (Harmonic("output", 1, 14.0, 243.0), Harmonic("motor", 2, 10.0, 248.0))

#: A design that tells everything but what needs a column that no design of runs has.
LEVELS = [(v, load, t) for v in (5.0, 30.0) for load in (-5.0, 2.0, 5.0) for t in (20.0, 35.0)]
RICH = tuple(
    RunDesign(
        direction=1 if k % 2 else -1,
        speed_deg_s=v,
        samples=150,
        start_deg=37.0 * k,
        turns=1.3,
        reversals=(0.3, 0.6, 0.8),
        gravity_Nm=load,
        temperature_C=t,
        mount_deg=(0.0, 130.0, 250.0)[k % 3],
    )
    for k, (v, load, t) in enumerate(LEVELS * 2)
)


def regression(designs, **changes):
    """Readings of these runs; ``changes`` are of the signals (None: was not recorded)."""
    sim = Simulation(JOINT, LINES, sigma_arcsec=1.0, runs=tuple(designs))
    signals = replace(join_runs(simulate(sim, 1)), **changes)
    rng = np.random.default_rng(2)
    return Regression.of(signals, rng.normal(size=len(signals)), sim.surroundings)


def spots(*args, **changes):
    return blind_spots(regression(*args, **changes))


def told(found):
    return {spot.causes for spot in found}


def of(found, *causes):
    (spot,) = [spot for spot in found if spot.causes == causes]
    return spot


def runs(**changes):
    return [replace(run, **changes) for run in RICH]


@pytest.fixture(scope="module")
def rich():
    return spots(RICH)


def test_a_rich_design_is_blind_to_what_it_lacks_a_column_for_only(rich):
    assert told(rich) == {("current_coupling",)}


#: Change of the rich design, what it then cannot tell, and what is said of it.
RULES = {
    "one direction": (
        runs(direction=1, reversals=()),
        {},
        ("backlash",),
        "one direction",
    ),
    "one direction for hysteresis": (
        runs(direction=1, reversals=()),
        {},
        ("presliding_hysteresis",),
        "one direction",
    ),
    "one direction for a pattern of it": (
        runs(direction=1, reversals=()),
        {},
        ("direction_dependent_pattern",),
        "one direction",
    ),
    "one direction for a ramp": (
        runs(direction=1, reversals=(), start_deg=0.0, spacing="uniform"),
        {},
        ("scale_error", "drift_within_run"),
        "ramp in angle is a ramp in time",
    ),
    "one speed": (runs(speed_deg_s=30.0), {}, ("backlash", "latency"), "one speed"),
    "one speed in one direction": (
        runs(speed_deg_s=30.0, direction=1, reversals=()),
        {},
        ("latency",),
        "part of the zero",
    ),
    "one speed in one direction for a filter": (
        runs(speed_deg_s=30.0, direction=1, reversals=()),
        {},
        ("filter_lag",),
        "only another pattern",
    ),
    "one speed in one direction for the channels": (
        runs(speed_deg_s=30.0, direction=1, reversals=()),
        {},
        ("channel_skew",),
        "part of a line",
    ),
    "no speed": (RICH, {"velocity": None}, ("latency",), "no velocity were recorded"),
    "no speed for a filter": (RICH, {"velocity": None}, ("filter_lag",), "no velocity"),
    "no speed for reversals": (
        RICH,
        {"velocity": None},
        ("backlash", "latency", "presliding_hysteresis"),
        "velocity is unknown",
    ),
    "no time": (RICH, {"time": None}, ("time_periodic",), "no time stamps"),
    "no temperature": (RICH, {"temperature": None}, ("thermal_drift",), "no temperature was"),
    "one temperature": (runs(temperature_C=25.0), {}, ("thermal_drift",), "less than 2 K"),
    "no torque": (RICH, {"torque": None}, ("torsional_compliance",), "no torque was recorded"),
    "no load": (runs(gravity_Nm=0.0), {}, ("torsional_compliance",), "unloaded"),
    "no load for gear lines": (
        runs(gravity_Nm=0.0),
        {},
        ("load_dependent_gear_error",),
        "unloaded",
    ),
    "one load": (runs(gravity_Nm=5.0), {}, ("torsional_compliance",), "one load"),
    "one load for its cube": (
        [replace(run, gravity_Nm=0.0, torque_Nm=5.0) for run in RICH],
        {},
        ("stiffening_compliance",),
        "too few loads",
    ),
    "one load for gear lines": (
        [replace(run, gravity_Nm=0.0, torque_Nm=5.0) for run in RICH],
        {},
        ("load_dependent_gear_error",),
        "one load",
    ),
    "a load that turns round in no run": (
        [replace(run, gravity_Nm=0.0, torque_Nm=5.0 * (k % 3 - 1)) for k, run in enumerate(RICH)],
        {},
        ("torque_hysteresis",),
        "loads and unloads",
    ),
    "load and temperature together": (
        [
            replace(run, gravity_Nm=0.0, torque_Nm=5.0 * (k % 2), temperature_C=20.0 + 15 * (k % 2))
            for k, run in enumerate(RICH)
        ],
        {},
        ("thermal_drift", "torsional_compliance", "load_dependent_gear_error"),
        "change together",
    ),
    "load of either sign and temperature together": (
        [
            replace(
                run,
                gravity_Nm=0.0,
                torque_Nm=5.0 * (k % 2) * (1 if k % 4 > 1 else -1),
                temperature_C=20.0 + 15 * (k % 2),
            )
            for k, run in enumerate(RICH)
        ],
        {},
        ("thermal_drift", "torsional_compliance", "load_dependent_gear_error"),
        "change together",
    ),
    "no mount": (RICH, {"mount": None}, ("reference_error",), "mount of the reference was not"),
    "one mount": (
        runs(mount_deg=0.0),
        {},
        ("reference_error", "missing_order"),
        "never turned on its mount",
    ),
    "one run": (RICH[:1], {}, ("non_integer_order", "missing_order"), "one run"),
    "a direction per run, two of one": (
        [replace(run, direction=1 if k > 1 else -1, reversals=()) for k, run in enumerate(RICH)],
        {},
        ("backlash", "zero_slip"),
        "only 2 in one of them",
    ),
    "a grid": (
        runs(samples=36, spacing="uniform", turns=1.0, reversals=(), start_deg=0.0),
        {},
        ("missing_order", "sidebands", "argument_error", "local_defect"),
        "36 positions",
    ),
}


@pytest.mark.parametrize("rule", RULES)
def test_what_a_design_cannot_tell(rule, rich):
    designs, changes, causes, because = RULES[rule]
    assert causes not in told(rich)
    spot = of(spots(designs, **changes), *causes)
    assert because in spot.because
    assert spot.measure


#: Designs on the seeing side of a rule, as near as makes no doubt.
ENOUGH = {
    "three runs of one direction": (
        [replace(run, direction=1 if k > 2 else -1, reversals=()) for k, run in enumerate(RICH)],
        ("backlash", "zero_slip"),
    ),
    "3 kelvin": (
        [replace(run, temperature_C=20.0 + 3.0 * (k % 2)) for k, run in enumerate(RICH)],
        ("thermal_drift",),
    ),
    "two speeds a factor of three apart": (
        [replace(run, speed_deg_s=10.0 + 20.0 * (k % 2)) for k, run in enumerate(RICH)],
        ("backlash", "latency"),
    ),
    "two loads": (
        [replace(run, gravity_Nm=0.0, torque_Nm=5.0 * (k % 2)) for k, run in enumerate(RICH)],
        ("torsional_compliance",),
    ),
    "two mounts": (
        [replace(run, mount_deg=10.0 * (k % 2)) for k, run in enumerate(RICH)],
        ("reference_error", "missing_order"),
    ),
    "two runs": (RICH[:2], ("non_integer_order", "missing_order")),
    "a grid fine enough": (
        runs(samples=720, spacing="uniform", turns=1.0, reversals=(), start_deg=0.0)[:2],
        ("missing_order", "sidebands", "argument_error", "local_defect"),
    ),
    "free angles": (
        runs(samples=36, spacing="random", turns=1.0, reversals=(), start_deg=0.0),
        ("missing_order", "sidebands", "argument_error", "local_defect"),
    ),
}


@pytest.mark.parametrize("design", ENOUGH)
def test_what_a_design_can_tell(design):
    designs, causes = ENOUGH[design]
    assert causes not in told(spots(designs))


def test_temperatures_need_runs_of_their_own():
    """Two temperatures in three runs: a new zero each would explain as much."""
    few = [replace(run, temperature_C=20.0 + 15.0 * (k % 2)) for k, run in enumerate(RICH[:3])]
    enough = [replace(run, temperature_C=20.0 + 15.0 * (k % 2)) for k, run in enumerate(RICH[:6])]
    causes = ("thermal_drift", "zero_slip")
    assert "runs' own zeros" in of(spots(few), *causes).because
    assert causes not in told(spots(enough))


def line(fitted, order):
    return MissingOrder.at(fitted, order)


def origins(fitted, order):
    """Pairs of causes that may have made a line, and whether it is doubted at all."""
    found = blind_spots(fitted)
    assert ambiguity_of_cause(line(fitted, order), fitted, found) is None
    return [spot.causes for spot in open_origins(line(fitted, order), fitted, found)]


def test_a_line_is_one_whatever_made_it():
    assert origins(regression(RICH), 3.0) == []
    one_mount = regression(runs(mount_deg=0.0))
    assert origins(one_mount, 3.0) == [("missing_order", "reference_error")]
    # Orders of the gear are not the reference's.
    assert origins(one_mount, 50.0) == []
    one_load = regression(runs(gravity_Nm=5.0))
    assert origins(one_load, 1.0) == [("missing_order", "torsional_compliance")]
    assert origins(one_load, 2.0) == []
    both = regression(runs(gravity_Nm=5.0, mount_deg=0.0))
    assert [causes[1] for causes in origins(both, 1.0)] == [
        "reference_error",
        "torsional_compliance",
    ]
    constant = regression([replace(run, gravity_Nm=0.0, torque_Nm=5.0) for run in RICH])
    assert origins(constant, 102.0) == [("missing_order", "load_dependent_gear_error")]


def test_a_line_behind_which_the_gear_may_stand_is_doubted():
    grid = regression(runs(samples=36, spacing="uniform", turns=1.0, reversals=(), start_deg=0.0))
    doubt = ambiguity_of_cause(line(grid, 8.0), grid, blind_spots(grid))
    assert "order 8 looks like 100, 28, 44 at" in doubt.because
    # None of the gear's orders looks like order 3 at these positions.
    assert origins(grid, 3.0) == []
