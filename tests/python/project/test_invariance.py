"""The physical answer does not depend on units, the order of runs, or which way is forward."""

import math

import numpy as np
import pytest

import trueangle as ta
from trueangle.simulation import Joint, Simulation

SEED = 83_110

#: Angles of a few hundred degrees in other units differ by their rounding, 1e-10 arcsec; what is
#: computed of them by a thousand times that.
ABSOLUTE = 1e-6
RELATIVE = 1e-6  # the noise is searched to where a step gains 1e-5

#: The variance that zeros are drawn from is found by a search that ends at a hundred-millionth,
#: and so are the rivals' parameters; of a difference of deviances ten times that is left.
SEARCHED = 1e-6

PERIODS = {"degrees": 360.0, "radians": 2.0 * np.pi, "turns": 1.0, "counts": 16384.0}


def sweeps(sign=1.0):
    """Four runs there and back with play, two orders and zeros; degrees."""
    rng = np.random.default_rng(SEED)
    for r in range(4):
        there = np.arange(0.0, 400.0, 2.0) + rng.uniform(0.0, 1.0)
        x = np.concatenate([there, there[::-1] + 0.3])
        way = np.repeat([1.0, -1.0], there.size)
        error = 0.05 * np.sin(np.radians(x) + 1.0) + 0.02 * np.sin(np.radians(3.0 * x) + 2.0)
        error += 0.004 * way + 0.002 * rng.standard_normal(x.size) + 30.0 * r
        yield f"r{r}", sign * x, sign * error, np.arange(x.size) * 0.1


def runs(period=360.0, sign=1.0):
    unit = period / 360.0
    return [
        ta.CalibrationRun(x * unit, (x + e) * unit, period, time=t, label=label)
        for label, x, e, t in sweeps(sign)
    ]


SIMULATION = Simulation(Joint(50.0, "circular_spline", "output"), (), sigma_arcsec=7.2)

ASKED = {
    "fit": lambda data: ta.fit(data, gear_ratio=50.0).to_dict(),
    "orders": lambda data: ta.select_orders(data, gear_ratio=50.0).to_dict(),
    "diagnose": lambda data: without_evidence(ta.diagnose(data, SIMULATION).to_dict()),
    "check": lambda data: ta.check(data).to_dict(),
    "fit of orders": lambda data: ta.fit(data, [1, 3]).to_dict(),
}


def without_evidence(account):
    """A diagnosis less evidence of factors: beside zeros of 30 deg it is 9e10, known to 1e-4."""
    for factor in account["factors"]:
        del factor["log_bayes_factor"]
    for finding in account["findings"]:
        del finding["status_reason"]
    return account


def differences(a, b, relative=RELATIVE, path=""):
    """Places at which two answers differ."""
    if isinstance(a, dict) and isinstance(b, dict):
        for key in a.keys() | b.keys():
            yield from differences(a.get(key), b.get(key), relative, f"{path}.{key}")
    elif isinstance(a, (list, tuple)) and isinstance(b, (list, tuple)):
        if len(a) != len(b):
            yield f"{path}: {len(a)} and {len(b)} entries"
        for k, (x, y) in enumerate(zip(a, b, strict=False)):
            yield from differences(x, y, relative, f"{path}[{k}]")
    elif isinstance(a, float) and isinstance(b, (int, float)) and not isinstance(b, bool):
        if not math.isclose(a, b, rel_tol=relative, abs_tol=ABSOLUTE):
            yield f"{path}: {a!r} and {b!r}"
    elif a != b:
        yield f"{path}: {a!r} and {b!r}"


@pytest.fixture(scope="module")
def in_degrees():
    print(f"seed {SEED}")
    return {name: ask(runs()) for name, ask in ASKED.items()}


@pytest.mark.parametrize("name", ASKED)
@pytest.mark.parametrize("unit", [u for u in PERIODS if u != "degrees"])
def test_units(name, unit, in_degrees):
    found = ASKED[name](runs(PERIODS[unit]))
    relative = SEARCHED if name == "diagnose" else RELATIVE
    assert not list(differences(in_degrees[name], found, relative))


#: Columns of a table in each unit, and how many make a turn.
COLUMNS = {
    "degrees": ("deg", 360.0, {}),
    "radians": ("rad", 2.0 * np.pi, {}),
    "turns": ("turn", 1.0, {}),
    "counts": (
        "count",
        16384.0,
        {"counts_per_turn": 16384.0, "counts_per_turn_reference": 16384.0},
    ),
}


def coasting(unit):
    """A spindle that coasts, its angle in a unit."""
    suffix, period, given = COLUMNS[unit]
    rng = np.random.default_rng(SEED)
    t = np.arange(4000) / 500.0
    x = 2.0 * np.pi * 60.0 * (1.0 - np.exp(-t / 12.0))
    x = x + 1e-3 * np.sin(2.0 * x) + 4e-4 * np.cos(5.0 * x) + 1e-4 * rng.normal(size=t.size)
    table = {"time_s": t, f"indicated_{suffix}": x / (2.0 * np.pi) * period}
    counts = given.get("counts_per_turn")
    return ta.selfcal(table, orders=[1, 2, 3, 5], loop="open", counts_per_turn=counts)


def units_of_a_design(unit):
    """Eight units measured once, one of them eccentric, angles in a unit."""
    suffix, period, given = COLUMNS[unit]
    rng = np.random.default_rng(SEED + 1)
    x = np.tile(np.arange(0.0, 360.0, 4.0), 8)
    unit_of = np.repeat(np.arange(8), 90)
    size = (0.02 + 0.001 * rng.standard_normal(8))[unit_of]
    error = size * np.cos(np.radians(x)) + 0.005 * np.cos(np.radians(2.0 * x) + unit_of)
    error += 0.05 * (unit_of == 5) * np.sin(np.radians(x)) + 1e-4 * rng.standard_normal(x.size)
    scale = period / 360.0
    table = {
        "run": [f"r{k}" for k in unit_of],
        "unit": [f"u{k}" for k in unit_of],
        f"reference_{suffix}": x * scale,
        f"indicated_{suffix}": (x + error) * scale,
    }
    return ta.fleet(table, orders=[1, 2], **given)


@pytest.mark.parametrize("ask", [coasting, units_of_a_design])
def test_tables_in_other_units_say_the_same(ask):
    found = {unit: ask(unit).to_dict() for unit in COLUMNS}
    for unit in ("radians", "turns", "counts"):
        assert not list(differences(found["degrees"], found[unit], RELATIVE)), unit


def lines_of(fitted):
    return {
        row["order"]: (row["amplitude_arcsec"], row["phase_deg"], row["std_arcsec"])
        for row in fitted["orders"]
    }


def test_the_order_of_runs_does_not_matter(in_degrees):
    there = ASKED["fit"](runs()[::-1])
    assert not list(differences(lines_of(in_degrees["fit"]), lines_of(there)))
    for key in ("residual_arcsec", "offset_spread_arcsec", "readings", "runs"):
        assert there[key] == pytest.approx(in_degrees["fit"][key], rel=RELATIVE)


def test_a_mirrored_joint_has_mirrored_lines_and_the_same_play(in_degrees):
    """-e(-x): amplitudes and their errors stay, phases change sign; so does nothing of a play."""
    mirrored = lines_of(ASKED["fit"](runs(sign=-1.0)))
    straight = lines_of(in_degrees["fit"])
    assert mirrored.keys() == straight.keys() == {1, 3}
    for order, (amplitude, phase, std) in straight.items():
        assert mirrored[order][0] == pytest.approx(amplitude, rel=RELATIVE)
        assert mirrored[order][1] == pytest.approx(-phase % 360.0, abs=ABSOLUTE)
        assert mirrored[order][2] == pytest.approx(std, rel=RELATIVE)
    told, mirror = (
        {f["cause"]: f["parameters"] for f in found["findings"]}
        for found in (in_degrees["diagnose"], ASKED["diagnose"](runs(sign=-1.0)))
    )
    assert told.keys() == mirror.keys()
    a, b = told["missing_order"], mirror["missing_order"]
    assert b["amplitude_arcsec"]["value"] == pytest.approx(
        a["amplitude_arcsec"]["value"], rel=SEARCHED
    )
    assert b["amplitude_arcsec"]["std"] == pytest.approx(a["amplitude_arcsec"]["std"], rel=SEARCHED)
    assert b["phase_deg"]["value"] == pytest.approx(-a["phase_deg"]["value"] % 360.0, abs=1e-4)


@pytest.mark.parametrize("apart", [0.0, 0.2, 3.0, 90.0])
def test_zeros_of_runs_change_nothing_else_that_is_found(apart):
    """Encoders that count from where they were switched on: their zeros are anything."""
    data = [
        ta.CalibrationRun(
            run.reference,
            run.indicated - 30.0 * k + apart * k * (-1.0) ** k,
            360.0,
            time=run.time,
            label=run.label,
        )
        for k, run in enumerate(runs())
    ]
    found = ta.diagnose(data, SIMULATION)
    lines = {
        f.parameters["output_order"].value: f.parameters["amplitude_arcsec"]
        for f in found.findings
        if f.cause == "missing_order" and f.confirmed
    }
    assert abs(lines[3.0].value - 72.0) < 4.0 * lines[3.0].std
    assert not found.unexplained.found
    assert ("zero_slip" in {f.cause for f in found.findings}) == (apart > 0.0)
