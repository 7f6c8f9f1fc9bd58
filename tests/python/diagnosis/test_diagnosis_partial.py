"""Diagnosis over a part of a turn, with few passes: what may and may not be told apart."""

from __future__ import annotations

import numpy as np
import pytest

import trueangle as ta
from trueangle.effects import Latency, Outliers, ThermalDrift
from trueangle.estimation.regression import Regression, repeated_part
from trueangle.simulation import Joint, RunDesign, Simulation, join_runs, simulate

JOINT = Joint(7.3, "none", "motor")


def sweeps(rng, runs=4, span=130.0, n=600, error=lambda theta, time, direction: 0.0, sigma=2.0):
    """Runs to and fro over ``span`` degrees, errors in arcsec."""
    made = []
    for j in range(runs):
        up = np.sort(rng.uniform(20.0, 20.0 + span, n // 2))
        theta = np.concatenate([up, np.sort(rng.uniform(20.0, 20.0 + span, n // 2))[::-1]])
        time = np.arange(n) * 0.02
        direction = np.repeat([1.0, -1.0], n // 2)
        e = error(theta, time, direction) + sigma * rng.standard_normal(n)
        made.append(ta.CalibrationRun(theta, theta + e / 3600.0, 360.0, time=time, label=str(j)))
    return made


def space_of(runs):
    signals = join_runs(runs)
    residual = np.concatenate([(run.indicated - run.reference) * 3600.0 for run in runs])
    return Regression.of(signals, residual, Simulation(JOINT, sigma_arcsec=1.0).surroundings)


def test_a_motor_line_is_named_where_the_travel_does_not_resolve_its_neighbours():
    def line(theta, *_):
        return 40.0 * np.sin(np.radians(2 * JOINT.gear_ratio * theta + 50.0))

    said = 0
    for seed in range(6):
        runs = sweeps(np.random.default_rng(seed), error=line, sigma=40.0)
        (found,) = ta.diagnose(runs, Simulation(JOINT, sigma_arcsec=1.0), gain=False).findings
        assert found.cause == "missing_order"
        names = found.parameters
        assert (names["shaft"].value, names["order"].value) == ("motor", 2)
        # Over 0.36 of a turn orders half an order apart explain about nine tenths of it.
        said += "hardly_told_from_output_orders" in names
    assert said >= 3


def test_a_wide_bump_on_a_shaft_is_low_orders_and_a_narrow_one_is_a_defect():
    rng = np.random.default_rng(8)

    def bump(width):
        def error(theta, *_):
            away = (JOINT.gear_ratio * theta - 100.0 + 180.0) % 360.0 - 180.0
            return 60.0 * np.exp(-0.5 * (away / width) ** 2)

        return error

    for width, local in ((40.0, False), (6.0, True)):
        runs = sweeps(rng, error=bump(width))
        found = ta.diagnose(runs, Simulation(JOINT, sigma_arcsec=1.0), gain=False).findings
        widths = [f.parameters["width_deg"].value for f in found if f.cause == "local_defect"]
        assert all(w <= 16.0 for w in widths)
        assert (found[0].cause == "local_defect") is local


@pytest.mark.parametrize("seed", [1, 2])
def test_what_repeats_at_an_angle_is_told_from_what_wanders_in_time(seed):
    rng = np.random.default_rng(seed)
    pattern = space_of(sweeps(rng, error=lambda theta, *_: 30.0 * np.sin(np.radians(5 * theta))))
    repeated = repeated_part(pattern.left, pattern.signals)
    assert np.std(pattern.left - repeated) < 0.25 * np.std(pattern.left)
    assert pattern.without_repeats().variance < 0.1 * np.var(pattern.left)

    def walk(theta, time, direction):
        return np.cumsum(rng.standard_normal(time.size))

    wander = space_of(sweeps(rng, runs=8, error=walk))
    assert not repeated_part(wander.left, wander.signals).any()
    assert wander.without_repeats() is wander


def with_glitches(space, rows):
    """The readings without terms, some of them 80 arcsec off."""
    glitches = np.zeros(space.n)
    glitches[rows] = -80.0
    return space.of_readings(space.readings.less(glitches))


def test_wild_readings_stand_alone_and_transitions_do_not():
    rng = np.random.default_rng(3)
    single = space_of(sweeps(rng))
    rows = np.arange(20, 2400, 100)
    found = Outliers.find_scatter(with_glitches(single, rows))
    assert found is not None
    assert len(found.parameters["rows"].value) == rows.size
    # A few in a row are a burst; what lasts longer is an error of the mean.
    for length, named in ((3, True), (6, False)):
        row = space_of(sweeps(rng))
        many = (rows[:, None] + np.arange(length)).ravel()
        found = Outliers.find_scatter(with_glitches(row, many))
        assert (found is not None) == named
        if found is not None:
            assert len(found.parameters["rows"].value) == length * rows.size
            assert found.parameters["bursts"].value == rows.size


def test_elements_of_a_spring_have_one_sign_and_play_may_depend_on_the_place():
    rng = np.random.default_rng(5)

    def error(theta, time, direction):
        return direction * (60.0 + 50.0 * np.sin(np.radians(theta - 40.0)))

    made = []
    for j, speed in enumerate((5.0, 5.0, 40.0, 40.0)):
        theta = np.concatenate([np.linspace(0, 300, 500), np.linspace(300, 0, 500)[1:]])
        theta = theta + 0.1 * rng.standard_normal(theta.size)
        direction = np.repeat([1.0, -1.0], [500, 499])
        time = np.arange(theta.size) * (0.6 / speed)
        e = error(theta, time, direction) + 2.0 * rng.standard_normal(theta.size)
        made.append(
            ta.CalibrationRun(
                theta,
                theta + e / 3600.0,
                360.0,
                time=time,
                velocity=speed * direction,
                label=str(j),
            )
        )
    found = ta.diagnose(made, Simulation(JOINT, sigma_arcsec=1.0), gain=False).findings
    (play,) = [f for f in found if f.cause in ("backlash", "presliding_hysteresis")]
    assert next(iter(play.parameters.values())).value == pytest.approx(60.0, abs=1.0)
    (place,) = [f for f in found if f.cause == "direction_dependent_pattern"]
    assert place.parameters["orders"].value == [1.0]
    assert place.parameters["amplitudes"].value[0] == pytest.approx(50.0, abs=1.5)
    assert place.parameters["phases_deg"].value[0] == pytest.approx(320.0, abs=2.0)


def test_gain_is_measured_on_levels_that_were_left_out():
    speeds = (5.0, 15.0, 30.0)
    sim = Simulation(
        sigma_arcsec=1.0,
        runs=tuple(
            RunDesign(
                samples=200,
                reversals=(0.5,),
                speed_deg_s=speeds[j % 3],
                temperature_C=20.0 + 10.0 * (j % 2),
            )
            for j in range(12)
        ),
    )
    runs = simulate(sim.with_effects([Latency(1e-4), ThermalDrift(0.5)]), 3)
    result = ta.diagnose(runs, sim)
    gains = {f.cause: f.gain.by_level for f in result.findings}
    assert set(gains) == {"latency", "thermal_drift"}
    speed = gains["latency"]
    assert speed.held_out == speed.levels == pytest.approx(speeds, rel=0.1)
    # Carried to a speed that was not there: the law is linear, all of it goes.
    assert speed.reducible_share == pytest.approx(1.0, abs=0.05)
    assert speed.rms_after < 1.1 < speed.rms_before
    assert speed.interval[0] < speed.reducible_share < speed.interval[1]
    # One temperature alone is part of the zero: nothing can be left out of two.
    heat = gains["thermal_drift"]
    assert (heat.held_out, heat.reducible_share) == ([], None)
    assert heat.levels == pytest.approx([20.0, 30.0])
    text = result.summary()
    assert "Gain with each velocity held out in turn (5, 15, 30 deg/s)" in " ".join(text.split())
    shown = result.to_dict()["findings"][0]["gain"]["by_level"]
    assert {"factor", "levels", "held_out", "reducible_share", "note"} <= set(shown)


def test_a_law_that_does_not_reach_another_level_gains_nothing_there():
    # Hidden: a delay at the fast speed alone, as no latency has it.
    sim = Simulation(
        sigma_arcsec=1.0,
        runs=tuple(
            RunDesign(samples=300, reversals=(0.5,), speed_deg_s=v) for v in (5.0, 10.0, 30.0) * 4
        ),
    )
    runs = [
        ta.CalibrationRun(
            run.reference,
            run.indicated - (run.speed > 20.0) * run.speed * 3e-5
            - (run.speed < -20.0) * run.speed * 3e-5,
            run.period,
            time=run.time,
            label=run.label,
        )
        for run in simulate(sim, 4)
    ]  # fmt: skip
    result = ta.diagnose(runs, sim)
    found = {f.cause: f.gain for f in result.findings}
    # What its form leaves is no play: there is none. The speed has it, in a form without a name.
    assert set(found) == {"latency"}
    assert not any(f.confirmed for f in result.findings)
    (factor,) = result.factors
    assert (factor.factor, factor.named_by) == ("speed", ())
    assert not result.unexplained.found
    assert result.noise == pytest.approx(1.0, abs=0.04)
    assert result.gain["rms_after_arcsec"] < 1.02
    gain = found["latency"]
    assert gain.reducible_share > 0.8
    assert gain.by_level.reducible_share < gain.reducible_share - 0.3


def test_rounding_of_runs_without_noise_has_no_cause():
    design = tuple(RunDesign(samples=200, speed_deg_s=v, reversals=(0.5,)) for v in (5.0, 30.0) * 3)
    sim = Simulation(runs=design)
    runs = simulate(sim.with_effects([Latency(1e-4)]), 1)
    (found,) = ta.diagnose(runs, sim, gain=False).findings
    assert found.cause == "latency"
    assert found.parameters["delay_s"].value == pytest.approx(1e-4, rel=1e-9)
