"""Diagnosis of measured data (see the data's own README); skipped without it.

What is in each file was worked out with numpy alone, by the regressions in the tests of this
module whose names begin with ``test_numpy``. The diagnosis has to come to the same.
"""

from __future__ import annotations

from itertools import pairwise
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

import trueangle as ta
from trueangle.simulation import Harmonic

Array = NDArray[np.float64]

#: Smoothing of the haptic joint's velocity: 41 samples of 1 ms, below its fastest reversal.
SMOOTH = 41

#: Rows of the haptic joint and of the servo that a test reads: one in so many.
EVERY = 8

DIRECT = """
[joint]
gear_ratio = {ratio!r}
fixed_member = "none"
encoder_side = "{side}"
pole_pairs = 1
"""


def simulation(folder: Path, ratio: float = 1.0, side: str = "output", lines: str = ""):
    path = folder / "joint.toml"
    path.write_text(DIRECT.format(ratio=ratio, side=side) + lines, encoding="utf-8")
    return ta.load_simulation(path)


def table(path: Path) -> Array:
    return np.genfromtxt(path, delimiter=",", names=True)


def fit(y: Array, *columns: Array) -> tuple[Array, float]:
    """Least squares by numpy: coefficients and the standard deviation of what is left."""
    design = np.column_stack([np.ones_like(y), *columns])
    solution = np.linalg.lstsq(design, y, rcond=1e-10)[0]
    return solution[1:], float(np.std(y - design @ solution))


def lines(angle: Array, orders) -> list[Array]:
    """Cosine and sine columns of orders at an angle in degrees."""
    return [f(k * np.radians(angle)) for k in orders for f in (np.cos, np.sin)]


def findings(runs, simulation) -> list[dict]:
    """The findings as they are printed."""
    return ta.diagnose(runs, simulation).to_dict()["findings"]


def named(found: list[dict]) -> set[str]:
    return {finding["cause"] for finding in found}


def orders(found: list[dict], shaft: str) -> set[int]:
    """Missing orders of one shaft."""
    lines = [f["parameters"] for f in found if f["cause"] == "missing_order"]
    return {round(p["order"]["value"]) for p in lines if p["shaft"]["value"] == shaft}


# --- haptic joint: motor encoder against output encoder, 189 reversals in 63 s ---------------


@pytest.fixture(scope="module")
def haptic(data_dir):
    data = table(data_dir / "haptic_joint_dual_encoder.csv")
    time, motor, output = data["time_s"], data["motor_deg"], data["reference_deg"]
    # The ratio is not documented: the slope of the motor's angle over the output's.
    ratio = float(np.polyfit(output, motor, 1)[0])
    speed = np.convolve(np.gradient(output, time), np.ones(SMOOTH) / SMOOTH, "same")
    return time, motor / ratio, output, speed, ratio


def test_numpy_haptic_joint(haptic) -> None:
    _, indicated, output, speed, ratio = haptic
    assert 7.29 < ratio < 7.31
    error = indicated - output
    moving = np.abs(speed) > 2.0
    motor = lines(ratio * output, (1, 2, 4))
    columns = [c[moving] for c in (output, *motor)]
    sign, velocity = np.sign(speed[moving]), speed[moving]
    (*_, half), plain = fit(error[moving], *columns, sign)
    # Direction alone: +-0.20 deg. With velocity beside it: +-0.12 deg and 0.49 ms.
    assert half == pytest.approx(0.20, abs=0.01)
    solution, both = fit(error[moving], *columns, sign, velocity)
    assert solution[-2] == pytest.approx(0.12, abs=0.01)
    assert solution[-1] == pytest.approx(0.49e-3, abs=0.03e-3)
    assert both < 0.6 * plain
    amplitudes = np.hypot(solution[1:7:2], solution[2:7:2])
    assert amplitudes == pytest.approx([0.036, 0.043, 0.024], abs=0.003)


def test_haptic_joint_has_a_reversal_error_a_delay_and_motor_lines(haptic, tmp_path) -> None:
    time, indicated, output, speed, ratio = (
        column[::EVERY] if isinstance(column, np.ndarray) else column for column in haptic
    )
    edges = np.linspace(0, time.size, 11).astype(int)
    runs = [
        ta.CalibrationRun(
            output[a:b],
            indicated[a:b],
            period=360.0,
            time=time[a:b],
            velocity=speed[a:b],
            label=f"part{i}",
        )
        for i, (a, b) in enumerate(pairwise(edges))
    ]
    found = findings(runs, simulation(tmp_path, ratio, "motor"))
    assert {1, 2, 4} <= orders(found, "motor")
    by_cause = {f["cause"]: f["parameters"] for f in found}
    # The indicated angle leads: what lags is the reference. Play and delay of a joint that hardly
    # changes its speed trade against each other: both agree with the fit by hand of both, each
    # within its own error.
    delay = by_cause["latency"]["delay_s"]
    assert abs(delay["value"] + 0.49e-3) < 2.0 * delay["std"] < 1.2e-3
    (reversal,) = {"backlash", "presliding_hysteresis"} & set(by_cause)
    half = next(iter(by_cause[reversal].values()))
    assert abs(half["value"] / 3600.0 - 0.12) < 2.0 * half["std"] / 3600.0 < 0.3


# --- arm joints against a digital protractor: 190 deg, two dates -----------------------------


def test_numpy_arm_joint(data_dir) -> None:
    runs = {run.label: run for run in ta.read_runs(data_dir / "arm_joint_protractor.csv")}
    first, second = runs["joint1_2021-05-28"], runs["joint1_2021-06-05"]
    angle = np.concatenate([first.reference, second.reference])
    error = np.concatenate([first.error, second.error])
    date = np.repeat([0.0, 1.0], [len(first), len(second)])
    sign = np.concatenate([first.direction, second.direction])
    pattern = lines(angle, (1, 2, 3, 6.1, 8.7, 11.2, 13.1, 18.6))
    solution, left = fit(error, *pattern, date, sign)
    # The zero moved by 2.8 deg; the sweeps differ by 2 * 0.16 deg on average.
    assert solution[-2] == pytest.approx(2.77, abs=0.1)
    assert solution[-1] == pytest.approx(0.16, abs=0.02)
    assert left == pytest.approx(0.31, abs=0.02)
    # The outlier is in joint 2: one row, 18 deg off.
    other = runs["joint2_2021-06-06"]
    rest = np.abs(other.centred_error - np.median(other.centred_error))
    assert np.flatnonzero(rest > 5.0).tolist() == [178]


@pytest.mark.parametrize("joint", ["joint1", "joint2"])
def test_arm_joint_has_a_new_zero(data_dir, tmp_path, joint) -> None:
    runs = [r for r in ta.read_runs(data_dir / "arm_joint_protractor.csv") if joint in r.label]
    assert "zero_slip" in named(findings(runs, simulation(tmp_path)))


def test_arm_joint_has_a_reversal_error_that_is_not_named_but_estimated(data_dir, tmp_path) -> None:
    # No time and no velocity, one reversal in each of two runs: play, winding up, a delay
    # and a wander in time give these readings alike, so none may be named. What a
    # calibration needs, the size of the reversal error, is there all the same.
    runs = [r for r in ta.read_runs(data_dir / "arm_joint_protractor.csv") if "joint1" in r.label]
    result = ta.diagnose(runs, simulation(tmp_path)).to_dict()
    unsure = {"backlash", "presliding_hysteresis", "latency", "drift_within_run"}
    assert not unsure & named(result["findings"])
    (seen,) = [
        spot
        for spot in result["not_identifiable"]
        if spot["supported"] and "backlash" in spot["causes"]
    ]
    assert unsure == set(seen["causes"])
    half = seen["estimates"]["backlash"]["half_width_arcsec"]
    assert half["value"] / 3600.0 == pytest.approx(0.16, abs=0.02)
    assert 0.0 < half["std"] / 3600.0 < 0.03


@pytest.mark.usefixtures("patient")
def test_arm_joint_has_one_wild_reading(data_dir, tmp_path) -> None:
    runs = [r for r in ta.read_runs(data_dir / "arm_joint_protractor.csv") if "joint2" in r.label]
    (wild,) = [f for f in findings(runs, simulation(tmp_path)) if f["cause"] == "outliers"]
    assert ["joint2_2021-06-06", 178] in [list(row) for row in wild["parameters"]["rows"]["value"]]


# --- resolver against a stepper's own steps --------------------------------------------------


def test_numpy_resolver(data_dir) -> None:
    (run,) = ta.read_runs(data_dir / "resolver_stepper.csv")
    error = run.indicated - run.reference
    tried = (1, 2, 3, *range(4, 41, 4), 50, 100)
    solution, by_true = fit(error, *lines(run.reference, tried))
    _, by_indicated = fit(error, *lines(run.indicated, tried))
    amplitudes = dict(zip(tried, np.hypot(solution[::2], solution[1::2]), strict=True))
    assert amplitudes[4] == pytest.approx(7.41, abs=0.02)
    assert amplitudes[8] == pytest.approx(0.54, abs=0.02)
    assert amplitudes[12] == pytest.approx(0.39, abs=0.02)
    assert by_true < 0.2 * by_indicated


def test_resolver_has_every_fourth_order_of_the_true_angle(data_dir, tmp_path) -> None:
    runs = ta.read_runs(data_dir / "resolver_stepper.csv")
    found = findings(runs, simulation(tmp_path))
    assert {4, 8, 12, 16, 20, 24} <= orders(found, "output")
    assert "argument_error" not in named(found)


# --- hobby servo: potentiometer at the output against the motor's encoder --------------------


@pytest.fixture(scope="module")
def servo(data_dir):
    data = table(data_dir / "servo_gear_train_potentiometer.csv")
    indicated = data["indicated_deg"]
    loaded = data["time_s"] >= 63.0
    return data["time_s"], indicated, indicated - data["indicated_minus_motor_deg"], \
        data["direction"], loaded.astype(float)  # fmt: skip


def test_numpy_servo(servo) -> None:
    _, indicated, motor, sign, loaded = servo
    moving = sign != 0.0
    error, motor, sign, loaded = (c[moving] for c in (indicated - motor, motor, sign, loaded))
    pattern = lines(motor, np.arange(1, 41) * 1.5)
    solution, constant = fit(error, *pattern, loaded, sign)
    # The reversal error is -0.19 deg on average, the offset under load 0.58 deg.
    assert solution[-1] == pytest.approx(-0.19, abs=0.02)
    assert solution[-2] == pytest.approx(0.58, abs=0.03)
    # It depends on the place: -0.5 deg at the ends of the travel, nothing in the middle.
    place = [sign * column for column in lines(motor, (1, 2))]
    _, varying = fit(error, *pattern, loaded, sign, *place)
    assert varying < 0.75 * constant


def test_servo_has_a_reversal_error_and_an_offset_under_load(servo, tmp_path) -> None:
    time, indicated, motor, _, loaded = servo
    edges = np.r_[np.linspace(0, 60, 7), np.linspace(66, 126, 7)]
    runs = []
    for start, end in pairwise(edges):
        here = (time >= start) & (time < end)
        if loaded[here].min() == loaded[here].max():
            here &= np.arange(time.size) % EVERY == 0
            runs.append(
                ta.CalibrationRun(
                    motor[here],
                    indicated[here],
                    period=360.0,
                    time=time[here],
                    torque=loaded[here],
                    label=f"from {start:.0f} s",
                )
            )
    result = ta.diagnose(runs, simulation(tmp_path))
    found = {f.cause: f.parameters for f in result.findings}
    assert {"torsional_compliance", "stiffening_compliance"} & set(found)
    (reversal,) = {"backlash", "presliding_hysteresis"} & set(found)
    # It depends on the place, about as much as it is large: nothing in the middle.
    half = next(iter(found[reversal].values())).value
    place = found["direction_dependent_pattern"]["amplitudes"].value
    assert half < 0.0
    assert 0.5 < max(place) / -half < 2.0
    assert "direction_dependent_pattern" in result.summary(verbose=True)


def test_a_line_in_time_is_no_order(data_dir):
    """Twelve runs at one turn a second: a line at 255 to 258 Hz, new in every run."""
    runs = ta.read_runs(data_dir / "rm44_repeat.csv")
    (shaft,) = ta.fit(runs, range(1, 18)).model.shafts
    lines = tuple(
        Harmonic("output", k, 3600.0 * float(c), float(np.degrees(phase)))
        for k, c, phase in zip(shaft.orders, shaft.amplitudes, shaft.phases, strict=True)
    )
    found = ta.diagnose(runs, ta.Simulation(harmonics=lines), gain=False).findings
    (line,) = [f for f in found if f.cause == "time_periodic"]
    assert 254.0 < line.parameters["frequency_hz"].value < 259.0
    # 0.046 to 0.062 deg in single runs.
    assert 150.0 < line.parameters["amplitude_arcsec"].value < 250.0
    assert not {"non_integer_order", "drift_within_run"} & {f.cause for f in found}


@pytest.mark.parametrize("name", ["resolver_two_clocks_fit", "resolver_two_clocks_test"])
def test_a_line_that_is_nearly_all_there_is_is_confirmed(data_dir, name):
    """Order 4 of 7.4 deg, of which a ten-thousandth of the energy follows the direction."""
    runs = ta.read_runs(data_dir / f"{name}.csv")
    found = ta.diagnose(runs, ta.Simulation()).findings
    (line,) = [f for f in found if f.confirmed and f.parameters["output_order"].value == 4.0]
    assert line.parameters["amplitude_arcsec"].value / 3600.0 == pytest.approx(7.45, abs=0.05)
    assert line.gain is not None
    assert line.gain.interval is not None
    assert line.gain.interval[0] > 0.99
