"""What a report says of runs as they were measured: closed forms, the same in every unit."""

from dataclasses import replace

import numpy as np
import pytest

import trueangle as ta
from trueangle.fitting.heldout import hold_out
from trueangle.reports import demo
from trueangle.reports.diagnosed import unknown_content
from trueangle.reports.measured import error_size, measured_content
from trueangle.reports.modelled import gain_content, given_model
from trueangle.simulation import Backlash, simulate

PERIODS = (360.0, 2.0 * np.pi, 1.0)


def run(period=360.0, zero=0.0, there_and_back=True, **more):
    """A whole turn in 18 s and back at the same speed; 0.05 sin x and half of it in sin 3 x."""
    time = np.arange(0.0, 36.0 if there_and_back else 18.0, 0.05)
    turns = np.where(time < 18.0, time, 36.0 - time) / 18.0
    x = 2.0 * np.pi * turns
    error = (0.05 * np.sin(x) + 0.025 * np.sin(3.0 * x)) / 360.0 + zero
    return ta.CalibrationRun(turns * period, (turns + error) * period, period, time=time, **more)


@pytest.mark.parametrize("period", PERIODS)
def test_a_run_is_told_with_its_conditions_and_its_error_about_its_own_zero(period):
    there = run(period, 0.25, label="there", torque=np.linspace(1.0, 3.0, 720), temperature=21.0,
                mount=period / 8.0)  # fmt: skip
    content = measured_content([there, run(period, -0.1, there_and_back=False)])
    first, second = content["runs"]
    assert (first["label"], second["label"]) == ("there", "2")
    assert (first["readings"], second["readings"], content["readings"]) == (720, 360, 1080)
    assert first["start_deg"] == pytest.approx(0.0, abs=1e-9)
    assert first["travel_deg"] == pytest.approx(360.0)
    assert second["travel_deg"] == pytest.approx(359.0)
    assert (first["direction"], second["direction"]) == ("both", "forward")
    assert first["speed_deg_s"] == pytest.approx(20.0)
    assert first["torque_Nm"] == pytest.approx(2.0)
    assert (first["temperature_C"], second["temperature_C"]) == (21.0, None)
    assert first["mount_deg"] == pytest.approx(45.0)
    assert second["mount_deg"] is None
    assert first["zero_deg"] == pytest.approx(90.0, abs=1e-3)
    assert second["zero_deg"] == pytest.approx(-36.0, abs=1e-3)
    rms = 180.0 * np.sqrt(0.5 * (1.0 + 0.25))
    for told in (first, second, content["error"]):
        assert told["rms_arcsec"] == pytest.approx(rms, rel=1e-3)
    x = np.linspace(0.0, 2.0 * np.pi, 100_000)
    wave = 180.0 * (np.sin(x) + 0.5 * np.sin(3.0 * x))
    assert first["peak_to_peak_arcsec"] == pytest.approx(np.ptp(wave), rel=1e-3)
    assert first["max_abs_arcsec"] == pytest.approx(wave.max(), rel=1e-3)


def test_sizes_are_of_all_parts_together_and_about_nought():
    """Not about their mean: a zero that is left is an error."""
    for sign in (1.0, -1.0):
        parts = [sign * np.array([3.0]), sign * np.array([4.0, -1.0])]
        assert error_size(parts) == pytest.approx(
            {"rms_arcsec": np.sqrt(26.0 / 3.0), "peak_to_peak_arcsec": 5.0, "max_abs_arcsec": 4.0}
        )


@pytest.mark.parametrize("period", PERIODS)
def test_a_given_model_takes_its_part_and_every_run_keeps_its_zero(period):
    """The first line taken off, the third is left, wherever the reference has its zero."""
    shaft = ta.Shaft("output", 1, [1], [0.0], [0.05 / 360.0])
    model = ta.HarmonicModel([shaft], period=1.0)
    runs = [replace(run(period), reference=run(period).reference + k * period) for k in (0.2, -0.3)]
    found = given_model(model, runs)
    assert found["before_arcsec"] == pytest.approx(180.0 * np.sqrt(0.625), rel=2e-3)
    assert found["after_arcsec"] == pytest.approx(90.0 * np.sqrt(0.5), rel=2e-3)


def test_what_is_gained_is_that_of_each_run_and_of_all():
    theta = np.arange(0.0, 360.0, 2.0)
    rng = np.random.default_rng(7)
    runs = []
    for k in range(4):
        error = 0.01 * np.sin(np.radians(theta)) + rng.normal(0.0, 0.001 * (k + 1), theta.size)
        runs.append(ta.CalibrationRun(theta, theta + error, 360.0, label=f"r{k}"))
    held = hold_out(ta.fit(runs, [1]))
    told = gain_content(held)
    before, after = (
        np.array([[entry[name]["rms_arcsec"] for entry in told["runs"]]]).ravel()
        for name in ("before", "after")
    )
    assert [entry["label"] for entry in told["runs"]] == ["r0", "r1", "r2", "r3"]
    np.testing.assert_allclose(after, 3.6 * np.arange(1.0, 5.0), rtol=0.25)
    assert (before > after).all()
    # Runs of equal length: the squares of all are the means of theirs.
    assert told["before"]["rms_arcsec"] == pytest.approx(np.sqrt(np.mean(before**2)), rel=1e-9)
    assert told["after"]["rms_arcsec"] == pytest.approx(np.sqrt(np.mean(after**2)), rel=1e-9)
    low, high = 100.0 * np.array(held.reduction_interval)
    assert (told["reduction_low_percent"], told["reduction_high_percent"]) == (low, high)
    assert low < told["reduction_percent"] < high


def told(*runs):
    return " ".join(
        f"{entry['what']}: {entry['because']}" for entry in unknown_content(runs, None, None)
    )


def test_what_is_unknown_follows_from_what_was_not_done():
    """Each condition opens its own question and no other."""
    first = {"temperature": 20.0, "torque": 0.0, "mount": 0.0}
    every = told(run(**first))
    assert "one direction" not in every
    assert "reversal error" in told(run(there_and_back=False, **first))
    quick = run(**first)
    faster = ta.CalibrationRun(
        quick.reference, quick.indicated, 360.0, time=0.3 * quick.time, **first
    )
    for more, said in (
        (faster, "delay"),
        (run(**{**first, "temperature": 30.0}), "thermal drift"),
        (run(**{**first, "torque": 5.0}), "compliance"),
        (run(**{**first, "mount": 130.0}), "the reference's own error"),
    ):
        assert said in every
        assert said not in told(run(**first), more)
        others = [s for s in ("delay", "thermal", "compliance", "own error") if s not in said]
        assert all(s in told(run(**first), more) for s in others), said


@pytest.mark.parametrize("seed", [0, 7])
def test_it_is_of_the_readings_of_its_seed_and_its_effect(seed, monkeypatch):
    asked = []
    monkeypatch.setattr(demo, "report", lambda runs, path, **more: asked.append((runs, more)))
    hidden = Backlash(5.0)
    demo.demo_report(hidden=hidden, seed=seed)
    ((runs, more),) = asked
    believed = demo.demo_simulation()
    assert more["simulation"] == believed
    wanted = simulate(believed.with_effects([hidden]), seed)
    for run, other in zip(runs, wanted, strict=True):
        np.testing.assert_array_equal(run.indicated, other.indicated)
