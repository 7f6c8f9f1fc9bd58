"""Figures of causes of the scatter, of what every run draws anew, and of where things stand."""

from dataclasses import replace

import numpy as np
import pytest

import trueangle as ta
from trueangle.effects import EFFECTS, Outliers
from trueangle.effects.randomphase import RandomPhaseLine
from trueangle.estimation.regression import Regression
from trueangle.joint.joint import Bearing
from trueangle.joint.pattern import line_columns
from trueangle.joint.signals import join_runs

from .test_stated_errors import NEAR, NOISE, SIM, signal_of, stated


@pytest.fixture(scope="module")
def signals():
    runs = [replace(run, samples=200, turns=2.6) for run in SIM.runs]
    return join_runs(ta.simulate(replace(SIM, runs=tuple(runs)), 3))


# -- causes of the scatter, and what every run draws anew ------------------------------

#: Of 80 deviations of pulls, each known to 8 %: three of them.
PULLS, WIDE = range(83_000, 83_080), (0.76, 1.24)


def test_outliers_are_told_by_share_size_and_row():
    """Few readings, so that the share is known by its count; several runs, one of them short."""
    sigma, size, share = 2.0, 80.0, 0.02
    sizes = (240, 40, 320)
    angle = np.concatenate([np.linspace(0.0, 350.0, n) for n in sizes])
    cuts = np.cumsum(sizes)[:-1]
    runs = [
        ta.CalibrationRun(part, part, period=360.0, label=f"run {k}")
        for k, part in enumerate(np.split(angle, cuts))
    ]
    signals = join_runs(runs)
    pulls, pulls_of_size, told, bursts, missed, wrong = [], [], [], [], 0, 0
    print(f"seeds {PULLS}")
    for seed in PULLS:
        rng = np.random.default_rng(seed)
        far = np.flatnonzero(rng.random(angle.size) < share)
        error = sigma * rng.standard_normal(angle.size)
        error[far] += size * rng.standard_normal(far.size)
        start = Regression.of(signals, error, ta.Simulation().surroundings, rho=0.0)
        found = Outliers.find_scatter(start)
        if found is None:
            assert far.size < 4, seed
            continue
        parameters = found.parameters
        rows = [int(k) for label, row in parameters["rows"].value
                for k in [[0, 240, 280][int(label.split()[1])] + row]]  # fmt: skip
        beyond = far[np.abs(error[far]) > 6.0 * sigma]
        missed += len({*beyond.tolist()} - {*rows})
        wrong += len({*rows} - {*far.tolist()})
        stretches = np.split(np.array(rows), np.flatnonzero(np.diff(rows) > 1) + 1)
        bursts.append(sum(len(part) > 1 for part in stretches))
        assert ("bursts" in parameters) == (bursts[-1] > 0), seed
        assert bursts[-1] == (parameters["bursts"].value if bursts[-1] else 0), seed
        fraction = parameters["fraction"]
        pulls.append((fraction.value - share) / fraction.std)
        told.append(parameters["size_arcsec"].value)
        # A deviation of a few numbers is skewed, and its logarithm is not.
        relative = parameters["size_arcsec"].std / told[-1]
        assert relative == pytest.approx(1.0 / np.sqrt(2.0 * len(rows)))
        pulls_of_size.append(np.log(told[-1] / size) / relative)
    print(np.mean(pulls), np.std(pulls), np.sqrt(np.mean(np.square(told))), missed, wrong)
    assert WIDE[0] < np.std(pulls) < WIDE[1]
    assert abs(np.mean(pulls)) < 0.4
    print(np.mean(pulls_of_size), np.std(pulls_of_size))
    assert WIDE[0] < np.std(pulls_of_size) < WIDE[1]
    assert abs(np.mean(pulls_of_size)) < 0.4
    # Two next to each other, of unlike size, may pass for a transition.
    assert missed + wrong < 0.02 * len(PULLS) * share * angle.size
    # Some 960 of them: their deviation is known to 2.3 %.
    assert np.sqrt(np.mean(np.square(told))) == pytest.approx(size, rel=0.08)


@pytest.mark.parametrize(
    "given",
    [
        {"cosine": 0.9, "sine": -0.5},
        {"cosine": 0.6, "sine": 0.9, "order": 2.0},
        {"per_deg_s": 0.06},
        {"per_Nm": 0.4},
    ],
)
def test_weights_are_those_of_the_noise_that_is_told(given, signals):
    """The told effect makes the hidden noise, and the weights are its inverse variances."""
    effect = EFFECTS["heteroscedastic_noise"]
    factor = effect(**given).noise_factor(signals, SIM.surroundings)
    noise = factor * np.random.default_rng(31).standard_normal(len(signals))
    found = effect.find_scatter(Regression.of(signals, noise, SIM.surroundings, rho=0.0))
    factors = [one.noise_factor(signals, SIM.surroundings) for one in found.effects]
    variance = np.prod(factors, axis=0) ** 2
    weights = 1.0 / variance
    np.testing.assert_allclose(found.weights, weights / weights.mean(), rtol=1e-9)
    # Of 1600 readings the logarithm of the variance is known to some 4 % a coefficient.
    away = np.log(variance) - 2.0 * np.log(factor)
    assert np.std(away) < 0.12
    assert np.std(np.log(factor)) > 0.2


@pytest.mark.parametrize("form", ["ramp", "walk"])
def test_a_drift_is_told_by_run_and_by_second_alike(form, signals):
    effect, rng = EFFECTS["drift_within_run"], np.random.default_rng(37)
    hidden = effect(0.5) if form == "ramp" else effect(0.0, 9.0)
    error = hidden.signal(signals, SIM.surroundings, rng) + rng.standard_normal(len(signals))
    start = Regression.of(signals, error, SIM.surroundings, rho=0.0)
    full = start.with_terms([effect._proposal(start, form)])
    parameters, (told,) = effect.report(full, [(*full.fitted()[0], np.zeros((0, 0)))])
    per_run, per_second = parameters["arcsec_per_run"], parameters["arcsec_per_s"]
    spans = [signals.clock[b - 1] - signals.clock[a] for a, b in signals.run_bounds()]
    assert per_run.value == pytest.approx(per_second.value * np.mean(spans))
    for one in (per_run, per_second):
        assert one.std == pytest.approx(one.value / np.sqrt(2.0 * signals.runs))
    wanted = (per_second.value, 0.0) if form == "ramp" else (0.0, per_run.value)
    assert (told.arcsec_per_s, told.wander_arcsec) == pytest.approx(wanted)


def test_a_frequency_that_wanders_is_known_as_a_mean_of_runs(signals):
    """No better than the frequencies of the runs scatter, over the root of their number."""
    effect, rng = EFFECTS["time_periodic"], np.random.default_rng(41)
    frequencies = 1.7 * (1.0 + 0.01 * rng.standard_normal(signals.runs))
    waves = effect.waves(signals, frequencies.tolist())
    drawn = rng.normal(0.0, 4.0, (signals.runs, 2))[signals.run]
    error = np.sum(waves * drawn, axis=1) + rng.standard_normal(len(signals))
    start = Regression.of(signals, error, SIM.surroundings, rho=0.0)
    shape = {"frequency_hz": frequencies.tolist()}
    full = start.with_terms([start.propose_run_effect("time_periodic", shape, waves)])
    parameters, _ = effect.report(full, [(*full.fitted()[0], np.zeros((0, 0)))])
    told = parameters["frequency_hz"]
    assert told.value == pytest.approx(np.median(frequencies))
    assert parameters["frequencies_hz"].value == pytest.approx(frequencies.tolist())
    assert told.std == pytest.approx(frequencies.std() / np.sqrt(signals.runs), rel=1e-9)


def test_a_drawn_amplitude_is_without_what_noise_adds_and_as_well_known_as_noise_lets_it(signals):
    """By lstsq of each run: its square less the variances of cosine and sine."""
    frequency, rng = 1.7, np.random.default_rng(43)
    for runs in (8, 1):
        few = signals.take(signals.run < runs)
        waves = EFFECTS["time_periodic"].waves(few, [frequency] * runs)
        error = 2.0 * waves[:, 0] + NOISE * rng.standard_normal(len(few))
        start = Regression.of(few, error, SIM.surroundings, rho=0.0)
        shape = {"frequency_hz": [frequency] * runs}
        full = start.with_terms([start.propose_run_effect("time_periodic", shape, waves)])
        amplitude, std = RandomPhaseLine(full, "time_periodic", waves).amplitude()
        squares, spread = [], []
        for a, b in few.run_bounds():
            wave = waves[a:b] - waves[a:b].mean(axis=0)
            squares.append(np.sum(np.linalg.lstsq(wave, full.left[a:b], rcond=None)[0] ** 2))
            spread.append(full.variance * np.trace(np.linalg.inv(wave.T @ wave)))
        assert amplitude**2 == pytest.approx(np.mean(squares) - np.mean(spread), rel=2e-3)
        # Of one run cosine alone tells it, of eight with phases alike the mean of them.
        assert std >= np.sqrt(np.mean(spread) / 2.0 / runs) * 0.97
        if runs == 1:
            assert std == pytest.approx(np.sqrt(spread[0] / 2.0), rel=0.03)


def test_a_drawn_amplitude_of_unlike_runs_is_known_as_a_mean_of_their_squares(signals):
    """Half of the standard error of the mean square, over the amplitude: no noise says as much."""
    frequency, rng = 1.7, np.random.default_rng(47)
    waves = EFFECTS["time_periodic"].waves(signals, [frequency] * signals.runs)
    sizes = np.linspace(4.0, 40.0, signals.runs)
    error = sizes[signals.run] * waves[:, 1] + NOISE * rng.standard_normal(len(signals))
    start = Regression.of(signals, error, SIM.surroundings, rho=0.0)
    shape = {"frequency_hz": [frequency] * signals.runs}
    full = start.with_terms([start.propose_run_effect("time_periodic", shape, waves)])
    amplitude, std = RandomPhaseLine(full, "time_periodic", waves).amplitude()
    assert amplitude**2 == pytest.approx(np.mean(sizes**2), rel=0.02)
    wanted = np.std(sizes**2, ddof=1) / np.sqrt(signals.runs) / (2.0 * amplitude)
    assert std == pytest.approx(wanted, rel=0.02)


# -- figures of places ------------------------------------------------------------------


def test_a_natural_frequency_is_known_as_it_and_the_damping_shape_the_pattern(signals):
    """Jointly with the damping, by the slopes of the filter's own signal."""
    effect = EFFECTS["filter_lag"]
    frequency, damping = 24.0, 0.6
    hidden = effect(frequency / (2.0 * damping), damping)
    parameters, effects, base = stated("filter_lag", signal_of(hidden, signals), signals, 61_500)
    told = parameters["natural_frequency_hz"]
    columns = []
    for step in ((1e-3 * frequency, 0.0), (0.0, 1e-3)):
        ahead, behind = (
            signal_of(
                effect(
                    (frequency + s * step[0]) / (2.0 * (damping + s * step[1])),
                    damping + s * step[1],
                ),
                signals,
            )
            for s in (1.0, -1.0)
        )
        columns.append((ahead - behind) / (2.0 * sum(step)))
    x = np.column_stack(columns)
    q = np.linalg.qr(base)[0]
    x -= q @ (q.T @ x)
    bound = NOISE * np.sqrt(np.linalg.inv(x.T @ x)[0, 0])
    assert NEAR[0] < told.std / bound < NEAR[1]
    assert abs(told.value - frequency) < 4.0 * bound
    assert told.value == pytest.approx(
        2.0 * parameters["damping"].value * parameters["cutoff_hz"].value
    )
    assert effects[0].cutoff_hz == pytest.approx(parameters["cutoff_hz"].value)


def test_a_wrong_ratio_is_told_with_the_orders_of_its_lines(signals):
    effect = EFFECTS["wrong_gear_ratio"]
    hidden = signal_of(effect(53.0), signals)
    parameters, effects, _ = stated("wrong_gear_ratio", hidden, signals, 61_600)
    assert parameters["gear_ratio"].value == 53.0
    joint = replace(SIM.joint, gear_ratio=53.0)
    geared = [joint.output_order(h.shaft, h.order) for h in SIM.harmonics if h.shaft != "output"]
    assert sorted(parameters["orders"].value) == pytest.approx(sorted(geared))
    np.testing.assert_allclose(signal_of(effects[0], signals), hidden, atol=1e-9)


def test_a_ratio_of_angles_holds_over_the_travel_measured(signals):
    hidden = EFFECTS["scale_error"](4e-6)
    _, (told,), _ = stated("scale_error", signal_of(hidden, signals), signals, 61_700)
    degrees = np.degrees(signals.theta)
    assert (told.start_deg, told.stop_deg) == pytest.approx((degrees.min(), degrees.max()))
    assert told.start_deg < -90.0


def test_a_bearing_is_named_by_where_its_line_stands():
    """The outer race of nine balls at 3.69 a turn, with slip; rounded, nothing stands there."""
    joint = replace(SIM.joint, bearings=(Bearing("output", 9, 0.18),))
    sim = replace(SIM, joint=joint, runs=SIM.runs[:4])
    signals = join_runs(ta.simulate(sim, 3))
    effect, waves = EFFECTS["non_integer_order"], line_columns(signals.theta, 3.71)
    error = 3.0 * waves[:, 0] + np.random.default_rng(47).standard_normal(len(signals))
    start = Regression.of(signals, error, sim.surroundings, rho=0.0)
    term = start.propose_run_effect(effect.kind, {"order": 3.71}, waves)
    full = start.with_terms([term])
    parameters, _ = effect.report(full, [(full.terms[0], np.zeros(0), np.zeros((0, 0)))])
    assert parameters["explanations"].value == ["bearing on output: outer race"]
