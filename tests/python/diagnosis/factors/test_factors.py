"""What an error follows, whether or not it has a name: forms that no cause has."""

from __future__ import annotations

import json

import numpy as np
import pytest

import trueangle as ta
from trueangle.diagnosis.factors.extension import plain_numbers
from trueangle.diagnosis.factors.groups import grid_of, knots_of
from trueangle.joint.signals import join_runs
from trueangle.simulation import Joint, Simulation

from ..test_arc import sweeps

NOISE = 1.2

#: A direct joint of which nothing is believed.
EMPTY = Simulation(Joint(1.0, "none"), sigma_arcsec=NOISE)

SPEEDS = (9.0, 24.0, 55.0)


def measured(rng, error, speeds=SPEEDS, repeats=2, readings=300, span=650.0, **recorded):
    """Runs there and back, in which ``error(theta, direction, v, t, run)`` was measured."""
    runs, clock = [], 0.0
    for r in range(len(speeds) * repeats):
        v = speeds[r % len(speeds)]
        t = np.sort(rng.uniform(0.0, 2.0 * span / v, readings))
        up = t < span / v
        theta = rng.uniform(0.0, 360.0) + np.where(up, v * t, 2.0 * span - v * t)
        e = error(theta, np.where(up, 1.0, -1.0), v, t, r) + NOISE * rng.standard_normal(readings)
        signals = {name: value(t, r) for name, value in recorded.items()}
        runs.append(
            ta.CalibrationRun(theta, theta + e / 3600.0, period=360.0, time=clock + t, **signals)
        )
        clock += t[-1] + 30.0
    return runs


def confirmed(found):
    return [finding.cause for finding in found.findings if finding.confirmed]


@pytest.fixture
def rng(request):
    return np.random.default_rng(4711)


def test_nothing_follows_nothing(rng):
    found = ta.diagnose(measured(rng, lambda theta, *_: 0.0 * theta), EMPTY)
    assert found.factors == []


def test_a_zero_that_follows_the_speed_is_no_new_zero_of_each_run(rng):
    runs = measured(rng, lambda theta, d, v, t, r: np.full(theta.size, v / 11.0), repeats=3)
    found = ta.diagnose(runs, EMPTY)
    assert "zero_slip" not in confirmed(found)
    speed = found.factors[0]
    assert speed.factor == "speed"
    truth = np.std([v / 11.0 for v in SPEEDS])
    assert speed.low < truth < speed.high
    assert speed.named_by == ()
    assert "The error follows the speed" in found.summary()


def test_interpolation_that_follows_the_temperature_is_stated_with_its_order(rng):
    def kelvin(t, r):
        return 21.0 + 9.0 * (r % 2) + 2.0 * (1.0 - np.exp(-t / 20.0))

    def error(theta, d, v, t, r):
        return 0.35 * (kelvin(t, r) - 21.0) * np.sin(np.radians(48.0 * theta + 70.0))

    runs = measured(rng, error, speeds=(31.0,), repeats=2, readings=700, temperature=kelvin)
    found = ta.diagnose(runs, EMPTY)
    first = found.factors[0]
    assert first.factor == "temperature_place"
    assert first.orders == (48.0,)
    # With temperature the amplitude rises from nothing.
    assert first.curve.value[0] < 0.5 < 2.5 < first.curve.value[-1]


def test_a_flat_facet_is_a_function_of_the_place_and_no_row_of_bumps(rng):
    def error(theta, *_):
        return 9.0 * (np.abs((theta - 140.0) % 360.0 - 180.0) > 173.0)

    found = ta.diagnose(measured(rng, error, readings=400), EMPTY)
    assert "local_defect" not in confirmed(found)
    assert {factor.factor for factor in found.factors} == {"place"}
    (up, size), (down, fall) = found.factors[0].jumps
    assert (up, down) == (pytest.approx(133.0, abs=1.0), pytest.approx(147.0, abs=1.0))
    assert (size, fall) == (pytest.approx(9.0, abs=1.0), pytest.approx(-9.0, abs=1.0))
    assert "a jump of" in found.summary()
    theta = np.linspace(0.0, 360.0, 1500)
    fresh = ta.CalibrationRun(theta, theta, period=360.0, time=theta / 20.0)
    left = error(theta) - found.extended.predict(fresh)
    assert np.std(left) < 0.2 * np.std(error(theta))
    assert all(0.0 <= factor.share <= 1.0 for factor in found.factors)


@pytest.mark.parametrize("way", [-1.0, 1.0])
def test_a_dent_that_is_met_in_one_direction_is_no_play(rng, way):
    """Half of it is a bump, half a pattern of the direction, and its mean a play: one function."""

    def error(theta, d, *_):
        away = (theta - 20.0) % 360.0 - 180.0
        return 9.0 * (d == way) * np.exp(-0.5 * (away / 14.0) ** 2)

    found = ta.diagnose(measured(rng, error), EMPTY)
    assert not {"backlash", "local_defect", "direction_dependent_pattern"} & {*confirmed(found)}
    (only,) = found.factors
    assert only.factor == "direction_place"
    theta = np.linspace(0.0, 360.0, 1500)
    for d in (-1.0, 1.0):
        fresh = ta.CalibrationRun(d * theta, d * theta, period=360.0, time=theta / 20.0)
        left = error(d * theta, np.full(1500, d)) - found.extended.predict(fresh)
        assert np.std(left) < 0.15 * 9.0


def test_a_bump_beside_a_play_keeps_its_name(rng):
    def error(theta, d, *_):
        away = (theta - 20.0) % 360.0 - 180.0
        return 4.0 * d + 12.0 * np.exp(-0.5 * (away / 14.0) ** 2)

    assert {"backlash", "local_defect"} <= {*confirmed(ta.diagnose(measured(rng, error), EMPTY))}


def test_late_readings_of_one_segment_are_events_and_no_lost_counts(rng):
    """There and back at other speeds: the error is a step only where the speed is one."""

    def error(theta, d, v, t, r):
        late = (r == 2) & (t > 0.4 * t[-1]) & (t < 0.7 * t[-1])
        return 12.0 * late * d * (v / max(SPEEDS))

    found = ta.diagnose(measured(rng, error), EMPTY)
    assert "missed_counts" not in confirmed(found)
    (stated,) = (factor for factor in found.factors if factor.events)
    assert stated.factor == "run_time"
    assert {run for run, _ in stated.events} == {"3"}
    rows = sorted(row for _, row in stated.events)
    assert [rows[0], rows[-1]] == pytest.approx([0.4 * 300, 0.7 * 300], abs=12)


@pytest.mark.parametrize("order", [3, 9])
def test_an_order_that_one_run_alone_has_follows_run_and_place_and_is_no_event(rng, order):
    def error(theta, d, v, t, r):
        return 20.0 * (r == 3) * np.cos(np.radians(order * theta))

    found = ta.diagnose(measured(rng, error), EMPTY)
    first = found.factors[0]
    assert (first.factor, first.orders) == ("run_place", (float(order),))
    assert not any(factor.events for factor in found.factors)
    assert first.curve.value[3] == pytest.approx(20.0, abs=1.0)


def test_a_size_beside_what_runs_differ_by_is_that_beside_it_in_the_model():
    """Where a path in time stood for it, an order of 20 arcsec was 27 +- 5."""
    pulls, theta = [], np.arange(60) * 6.0
    for seed in range(10):
        rng, runs = np.random.default_rng([4912, seed]), []
        for _ in range(4):
            own, at = 60.0 + 25.0 * rng.standard_normal(), 40.0 + 20.0 * rng.standard_normal()
            error = own * np.cos(np.radians(theta - at)) + 20.0 * np.cos(np.radians(2.0 * theta))
            error += NOISE * rng.standard_normal(60)
            runs.append(
                ta.CalibrationRun(theta, theta + error / 3600.0, period=360.0, time=0.05 * theta)
            )
        for finding in ta.diagnose(runs, EMPTY, gain=False).findings:
            if finding.confirmed and finding.parameters["order"].value == 2.0:
                size = finding.parameters["amplitude_arcsec"]
                pulls.append((size.value - 20.0) / size.std)
                assert size.std < 0.5
    assert len(pulls) >= 7
    assert np.sqrt(np.mean(np.square(pulls))) < 1.6


def test_what_one_speed_cannot_tell_is_stated_together(rng):
    runs = measured(rng, lambda theta, d, *_: 4.0 * d, speeds=(20.0,), repeats=4)
    found = ta.diagnose(runs, EMPTY)
    (first,) = found.factors
    assert {first.factor, *first.not_distinguished_from} == {"direction", "speed"}


def test_a_name_that_fits_names_its_factor(rng):
    found = ta.diagnose(measured(rng, lambda theta, d, *_: 4.0 * d), EMPTY)
    assert confirmed(found) == ["backlash"]
    (first,) = found.factors
    assert first.factor == "direction"
    assert first.named_by == ("backlash",)
    assert first.low < 4.0 < first.high
    np.testing.assert_allclose(first.curve.value, [-4.0, 4.0], atol=0.3)
    printed = json.loads(found.to_json())["factors"][0]
    assert printed["factor"] == "direction"
    assert printed["curve"]["unit"] == "sign"
    assert printed["orders"] is None


def test_sizes_hold_the_truth_as_often_as_stated():
    inside = []
    for seed in range(12):
        rng = np.random.default_rng(seed)
        phase = rng.uniform(0.0, 6.0)
        found = ta.diagnose(
            measured(rng, lambda theta, *_, p=phase: 0.8 * np.sin(np.radians(5.0 * theta) + p)),
            EMPTY,
            gain=False,
        )
        first = found.factors[0]
        assert (first.factor, first.orders) == ("place", (5.0,))
        inside.append(first.low < 0.8 / np.sqrt(2.0) < first.high)
    assert sum(inside) >= 9, "12 intervals of 95 %: fewer than 9 hold once in 20 000"


def left_on(simulation, runs):
    """Error of runs less a simulation, arcsec, one zero of all aside."""
    left = []
    for run in runs:
        error = 3600.0 * (np.mod(run.indicated - run.reference + 180.0, 360.0) - 180.0)
        left.append(error - simulation.predict(join_runs([run])))
    return float(np.std(np.concatenate(left)))


def kelvin(t, r):
    return 21.0 + 9.0 * (r % 2) + 2.0 * (1.0 - np.exp(-t / 20.0))


#: Errors that no cause has, and the factor that each follows first.
NAMELESS = {
    "speed": lambda theta, d, v, t, r: np.full(theta.size, np.sqrt(v)),
    "temperature_place": lambda theta, d, v, t, r: (
        0.35 * (kelvin(t, r) - 21.0) * np.sin(np.radians(48.0 * theta + 70.0))
    ),
    "place": lambda theta, *_: 9.0 * (np.abs((theta - 140.0) % 360.0 - 180.0) > 173.0),
    "direction_place": lambda theta, d, *_: d * np.where(np.sin(np.radians(theta)) > 0.4, 3.0, 0.0),
}


@pytest.mark.parametrize("factor", NAMELESS)
def test_a_curve_leaves_the_noise_on_fresh_runs_and_after_correction(factor):
    def runs(seed):
        made = np.random.default_rng(seed)
        return measured(made, NAMELESS[factor], repeats=3, temperature=kelvin)

    found = ta.diagnose(runs(1), EMPTY)
    assert factor in {one.factor for one in found.factors}
    fresh = runs(2)
    before, after = left_on(EMPTY, fresh), left_on(found.simulation(), fresh)
    # A flat top has corners that no 48 lines have.
    assert after < 1.15 * NOISE < 0.75 * before
    claimed = found.gain["rms_after_arcsec"] / found.gain["rms_before_arcsec"]
    # In the readings that were fitted, of which a curve of many lines takes some noise.
    assert claimed == pytest.approx(after / before, rel=0.15)
    model = found.correction()
    left = []
    for run in fresh:
        signals = {"velocity": run.speed, "temperature": run.temperature}
        theta = model.correct(run.indicated, direction=np.sign(run.speed), **signals)
        left.append(3600.0 * (np.mod(theta - run.reference + 180.0, 360.0) - 180.0))
    assert np.std(np.concatenate(left)) < 1.15 * NOISE


def test_what_loses_its_name_is_named_factor_by_factor():
    """One pattern of three orders stood for a play and a pattern of one."""
    found = ta.diagnose(sweeps(6512), Simulation())
    named = {factor.factor: factor.named_by for factor in found.factors}
    assert named["direction"] == ("backlash",)
    assert named["direction_place"] == ("direction_dependent_pattern",)
    pattern = next(f for f in found.findings if f.cause == "direction_dependent_pattern")
    assert pattern.parameters["orders"].value == [2.0]


@pytest.mark.parametrize(
    ("cause", "factor", "error"),
    [
        ("thermal_drift", "temperature", lambda r, zeros: 0.4 * (kelvin(0.0, r) - 21.0)),
        ("zero_slip", "run", lambda r, zeros: zeros[r]),
    ],
)
def test_zeros_and_temperature_are_told_by_the_factor_with_evidence(rng, cause, factor, error):
    zeros = rng.normal(0.0, 3.0, 9)

    def of_run(theta, d, v, t, r):
        return np.full(theta.size, error(r, zeros))

    runs = measured(
        rng, of_run, repeats=3, temperature=lambda t, r: np.full(t.size, kelvin(0.0, r))
    )
    found = ta.diagnose(runs, EMPTY)
    assert confirmed(found) == [cause]
    assert found.factors[0].factor == factor
    assert found.factors[0].named_by == (cause,)


def test_a_free_path_of_the_noise_is_no_group_of_names():
    """It has as many columns as readings: the account has a noise of its own."""
    rng = np.random.default_rng(5)
    paths = iter(np.cumsum(rng.normal(0.0, 0.5, (6, 300)), axis=1))
    found = ta.diagnose(measured(rng, lambda theta, *_: next(paths)), EMPTY)
    assert found.complete
    assert confirmed(found) == []


@pytest.mark.parametrize("kind", range(5))
def test_points_of_a_curve_increase_whatever_a_factor_takes(kind):
    """Two speeds that a velocity of noise goes round, levels, a range that is small to its size."""
    rng = np.random.default_rng([7, kind])
    for _ in range(200):
        n = int(rng.integers(2, 200))
        x = rng.standard_normal(n) * 10.0 ** rng.uniform(-6.0, 6.0)
        made = (
            x,
            20.0 * np.sign(x) + rng.standard_normal(n) * 10.0 ** rng.uniform(-6.0, -2.0),
            np.resize(x[:3], n) + 1e3,
            np.abs(x) + 1e3,
            rng.integers(-3, 4, n).astype(np.float64),
        )[kind]
        if np.ptp(made) > 1e-9 * np.abs(made).max():
            assert (np.diff(plain_numbers(grid_of(knots_of(made)))) > 0.0).all()


@pytest.mark.parametrize(
    ("step", "noise", "turns"), [(1.3, 0.0, 3), (1.1, 0.04, 2), (2.4, 0.03, 6)]
)
def test_a_sensor_that_does_not_use_all_of_its_counts_jumps_where_they_begin(
    rng, step, noise, turns
):
    """Low orders had been confirmed, or nothing: even places were taken for the sensor's counts."""
    theta = np.arange(0.0, 360.0 * turns, step)
    counts = np.floor(
        40.0 + 16310.0 * (theta % 360.0) / 360.0 + rng.normal(0.0, 45.5 * noise, theta.size)
    )
    runs = [ta.CalibrationRun(theta, counts * 360.0 / 16384.0, period=360.0)]
    found = ta.diagnose(runs, Simulation(sigma_arcsec=60.0))
    assert not confirmed(found)
    (factor,) = found.factors
    ((place, size),) = factor.jumps
    assert factor.factor == "place"
    assert abs((place + 180.0) % 360.0 - 180.0) < 2.0 * step
    assert size == pytest.approx(74.0 / 16384.0 * 1296000.0, rel=0.03)
    assert "a jump of" in found.summary()


@pytest.mark.parametrize(("stays", "settles"), [(0.7, 0.06), (0.0, 0.12), (0.5, 0.04)])
def test_a_slip_that_settles_is_an_event_of_its_run_and_no_lost_counts(rng, stays, settles):
    """Several steps of different sizes had been confirmed as lost counts."""
    hit, span = 2, 650.0

    def error(theta, d, v, t, r):
        whole = 2.0 * span / v
        since = t - 0.35 * whole
        slip = 18.0 * (stays + (1.0 - stays) * np.exp(-np.maximum(since, 0.0) / (settles * whole)))
        return slip * (since > 0.0) if r == hit else np.full(theta.size, 18.0 * stays * (r > hit))

    runs = measured(rng, error, speeds=(28.0,), repeats=5, readings=350, span=span)
    found = ta.diagnose(runs, EMPTY)
    assert "missed_counts" not in confirmed(found)
    first = found.factors[0]
    assert first.factor == "run_time"
    ((run, row),) = first.events
    assert run == str(hit + 1)
    assert abs(row - 0.35 * 350) < 12
    assert not found.unexplained.found
    assert f"event at reading {row + 1} of run {run}" in " ".join(found.summary().split())


def load(t, r):
    return (2.0 + r) * np.sin(0.21 * t + r) + 1.5 * r


def pattern(error):
    """Runs in which a function of the place in turns and of all else was measured."""
    return lambda rng: measured(rng, lambda x, *of: error((x / 360.0) % 1.0, *of), torque=load)


def one_way(error):
    """Runs of a turn in one direction each, under loads and at speeds that are unrelated."""

    def drawn(rng):
        runs = []
        for r, weight in enumerate(rng.permutation(np.linspace(-15.0, 15.0, 8))):
            v, d = SPEEDS[r % 3], (-1.0) ** (r // 2)
            t = np.sort(rng.uniform(0.0, 380.0 / v, 320))
            torque = weight + np.sin(0.9 * t + r)
            theta = d * v * (t - t.mean())
            e = error(theta, d, torque) + NOISE * rng.standard_normal(t.size)
            at = theta + rng.uniform(0.0, 360.0)
            run = ta.CalibrationRun(at, at + e / 3600.0, period=360.0, time=t, torque=torque)
            runs.append(run)
        return runs

    return drawn


def flank(rng):
    """At a level of nought the load has the sign of its noise."""

    def held(t, r):
        return 10.0 * (np.floor(t / 5.3 + 2 * r) % 5 - 2.0) + 0.05 * np.sin(11.0 * t)

    return measured(rng, lambda x, d, v, t, r: 3.0 * np.sign(np.round(held(t, r))), torque=held)


def creep_at_rest(rng):
    """It grows with the time since the stop, to the side that the joint came from."""
    t = np.arange(0.0, 150.0, 0.11)
    rest = np.maximum(np.mod(t, 10.0) - 3.0, 0.0)
    d = np.where(np.mod(t, 20.0) < 10.0, 1.0, -1.0)
    e = 5.0 * d * np.sqrt(rest / 7.0)
    runs = []
    for _ in range(3):
        speed = rng.uniform(20.0, 40.0, 15)[(t // 10.0).astype(int)]
        theta = 90.0 + np.cumsum(np.where(rest > 0.0, 0.0, d * speed)) * 0.11
        noise = NOISE * rng.standard_normal(t.size)
        runs.append(ta.CalibrationRun(theta, theta + (e + noise) / 3600.0, period=360.0, time=t))
    return runs


def slips(rng):
    """Parts on both sides of a step are looked at for further ones."""
    path = np.repeat([0.0, 9.0, 2.0, 7.0, -3.0], (150, 270, 280, 310, 290))
    return measured(rng, lambda *_: path, speeds=(21.0,), repeats=1, readings=1300, span=1500.0)


FORMS = {
    "chirp": (
        "place",
        pattern(lambda x, d, v, t, r: 9.0 * np.sin(2.0 * np.pi * (3.0 * x + 9.0 * x**2))),
    ),
    "edges on a pole": (
        "place",
        pattern(lambda x, d, v, t, r: 9.0 * ((30.0 * x + 0.2) % 1.0 < 0.3)),
    ),
    "falls with the speed": (
        "speed",
        lambda rng: measured(rng, lambda x, d, v, *_: 7 * d * np.exp(-v / 12), (3, 6, 12, 30, 55)),
    ),
    "root of the speed": ("speed", pattern(lambda x, d, v, t, r: 1.5 * d * np.sqrt(v))),
    "a cam under load": (
        "load_place",
        pattern(lambda x, d, v, t, r: 0.2 * load(t, r) ** 2 * np.sin(6.0 * np.pi * x + 1.0)),
    ),
    "play under load": ("direction_load", one_way(lambda x, d, torque: 0.4 * d * np.abs(torque))),
    "creep under load": ("travel_load", one_way(lambda x, d, torque: 0.003 * torque * d * x)),
    "flanks at levels of the load": ("load_sign", flank),
    "creep at rest": ("reversal_time", creep_at_rest),
    "slips": ("run_time", slips),
}


@pytest.mark.parametrize("form", FORMS)
def test_a_form_without_a_name_is_stated_by_its_factor_and_gets_none(rng, form):
    """They had been named: rows of bumps and orders, play, springs, or two factors that cancel."""
    factor, runs = FORMS[form]
    joint = Joint(30.0, "none") if "pole" in form else EMPTY.joint
    found = ta.diagnose(runs(rng), Simulation(joint, sigma_arcsec=NOISE))
    assert confirmed(found) == []
    assert found.factors[0].factor == factor
    assert found.factors[0].rms < found.discrepancy.rms
    if form == "slips":
        assert len(found.factors[0].events) == 4


@pytest.mark.parametrize("seed", range(6))
def test_of_shafts_whose_lines_are_one_column_the_lower_number_is_stated(seed):
    """Order 1 of the motor and order 11 of the output, at places of a polygon: rounding chose."""
    rng = np.random.default_rng([7, seed])
    theta = np.tile(np.arange(36) * 10.0, 4)
    e = 9.0 * np.sin(np.radians(25.0 * theta + 40.0 * seed)) + NOISE * rng.standard_normal(144)
    runs = [ta.CalibrationRun(theta, theta + e / 3600.0, period=360.0)]
    found = ta.diagnose(runs, Simulation(Joint(25.0, "none"), sigma_arcsec=NOISE))
    assert [(f.shaft, f.orders) for f in found.factors] == [("motor", (1.0,))]
