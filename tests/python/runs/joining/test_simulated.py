"""What is taken off the readings is the same in every unit, row by row, and told in its size."""

from __future__ import annotations

import re
from dataclasses import replace

import numpy as np
import pytest

import trueangle as ta
from trueangle.runs.joining import minus_simulated
from trueangle.runs.joining.result import Gap, Joined

SEED = 62_000
UNITS = (360.0, 1.0, 2.0 * np.pi)
ARCSEC = 3600.0


def swing(t: np.ndarray) -> np.ndarray:
    return 150.0 - 120.0 * np.cos(0.9 * t) + 20.0 * np.sin(0.4 * t)


def believed(t: np.ndarray) -> np.ndarray:
    return 0.2 * np.sin(np.radians(2.0 * swing(t)))


def log(period: float = 360.0, *, start: float = 0.0, timed: bool = True, noise: float = 0.0):
    t = np.arange(0.0, 20.0, 0.01)
    said = swing(t) + believed(t) + noise * np.random.default_rng(SEED).normal(size=t.size)
    scale = period / 360.0
    return ta.CalibrationRun(
        scale * swing(t), scale * said, period, time=t + start if timed else None
    )


def measured(period: float = 360.0, *, timed: bool = True, label: str | None = None):
    t = np.sort(np.random.default_rng(SEED + 1).uniform(0.5, 19.0, 400))
    rest = 0.01 * np.sin(np.radians(5.0 * swing(t)))
    scale = period / 360.0
    return ta.CalibrationRun(
        scale * swing(t), scale * (swing(t) + believed(t) + rest), period,
        time=t if timed else None, temperature=20.0 + t, label=label,
        signals={"current": 24.0 + t}, weights=1.0 + t, columns={"row": np.arange(t.size)},
    )  # fmt: skip


def left(run: ta.CalibrationRun) -> np.ndarray:
    """Beyond what is known to be left, degrees."""
    scale = 360.0 / run.period
    return scale * run.error - 0.01 * np.sin(np.radians(5.0 * scale * run.reference))


@pytest.mark.parametrize("run_in", UNITS)
@pytest.mark.parametrize("log_in", UNITS)
@pytest.mark.parametrize("by", ["time", "angle"])
def test_every_unit_leaves_the_same(run_in: float, log_in: float, by: str) -> None:
    """In time by cubics; by angle by lines over some degrees."""
    found = minus_simulated(measured(run_in), log(log_in), by=by)
    assert found.by == (by,)
    assert np.abs(left(found.runs[0])).max() < (1e-5 if by == "time" else 2e-3)
    plain = minus_simulated(measured(), log(), by=by)
    np.testing.assert_allclose(left(found.runs[0]), left(plain.runs[0]), atol=1e-9)
    assert found.std_arcsec == pytest.approx(plain.std_arcsec, rel=1e-6)


def test_readings_keep_their_rows() -> None:
    """Signals, weights, columns and time of those at which the log says something."""
    t = np.arange(0.0, 12.0, 0.01)
    part = ta.CalibrationRun(swing(t), swing(t) + believed(t), 360.0, time=t)
    runs = [measured(label="a"), measured(label="b")]
    found = minus_simulated(runs, part, by="time")
    gone = int(np.count_nonzero(runs[0].time > 11.991))
    assert 100 < gone < 200
    assert found.left_out == 2 * gone
    for run in found.runs:
        time = run.time
        np.testing.assert_allclose(run.temperature, 20.0 + time)
        np.testing.assert_allclose(run.signals["current"], 24.0 + time)
        np.testing.assert_allclose(run.weights, 1.0 + time)
        np.testing.assert_array_equal(run.columns["row"], np.arange(time.size))
        np.testing.assert_allclose(run.reference, swing(time))


@pytest.mark.parametrize("start", [-7.5, 0.0, 1000.0])
def test_the_offset_of_a_clock_leads_to_the_log(start: float) -> None:
    found = minus_simulated(measured(), log(start=start))
    assert found.offsets_s[0] == pytest.approx(start, abs=1e-4)
    # The offset's error times the speed of the error.
    assert np.abs(left(found.runs[0])).max() < 1e-4


@pytest.mark.parametrize("period", UNITS)
@pytest.mark.parametrize("logs", [1, 3])
def test_the_noise_of_a_log_is_told_in_its_size(period: float, logs: int) -> None:
    """Second differences of white noise have six times its variance, less six deviations' tails."""
    sigma = 2.0 / ARCSEC
    found = minus_simulated([measured() for _ in range(logs)], log(period, noise=sigma))
    # Error of a mean square of 2000 that are correlated: some 3 %.
    assert found.noise_arcsec == pytest.approx(2.0, rel=0.1)


@pytest.mark.parametrize("period", UNITS)
def test_an_error_that_alternates_is_told_by_its_second_differences(period: float) -> None:
    """They are four times its amplitude, and those of white noise the root of six times."""
    x = np.arange(0.0, 300.0, 0.5)
    error = 2.5 / ARCSEC * (-1.0) ** np.arange(x.size)
    log = ta.CalibrationRun(x / 360.0 * period, (x + error) / 360.0 * period, period)
    run = ta.CalibrationRun(x, x, 360.0)
    wanted = 2.5 * 4.0 / np.sqrt(6.0)
    assert minus_simulated(run, log).noise_arcsec == pytest.approx(wanted, rel=1e-6)


def test_the_noise_of_several_logs_is_that_of_all() -> None:
    """Of 2 and 2.6 arcsec: the root of the mean of their squares."""
    t = np.arange(0.0, 20.0, 0.01)
    rng = np.random.default_rng(SEED + 2)
    logs = [
        ta.CalibrationRun(
            swing(t), swing(t) + sigma / ARCSEC * rng.normal(size=t.size), 360.0, label=label
        )
        for sigma, label in ((2.0, "a"), (2.6, "b"))
    ]
    found = minus_simulated([measured(label="a"), measured(label="b")], logs, by="angle")
    assert found.noise_arcsec == pytest.approx(np.hypot(2.0, 2.6) / np.sqrt(2.0), rel=0.07)


def test_what_joining_adds_is_the_root_of_the_mean_square_of_the_runs() -> None:
    """A log whose passes differ by 6 arcsec either way from their mean; one run or three."""
    x = np.repeat(np.arange(0.0, 300.0), 2)
    wide = np.tile([6.0, -6.0], 300) / ARCSEC
    simulated = ta.CalibrationRun(x, x + wide, 360.0)
    run = ta.CalibrationRun(np.arange(0.5, 290.0), np.arange(0.5, 290.0), 360.0)
    for count in (1, 3):
        assert minus_simulated([run] * count, simulated).std_arcsec == pytest.approx(6.0)
    exact = ta.CalibrationRun(x[::2], x[::2], 360.0, label="b")
    wider = ta.CalibrationRun(x, x + wide, 360.0, label="a")
    both = [
        ta.CalibrationRun(run.reference, run.indicated, 360.0, label=label) for label in ("a", "b")
    ]
    found = minus_simulated(both, [wider, exact])
    assert found.std_arcsec == pytest.approx(6.0 / np.sqrt(2.0))
    assert found.to_dict()["std_arcsec"] == found.std_arcsec


def test_a_mirrored_joint_leaves_the_mirror() -> None:
    def mirrored(run: ta.CalibrationRun) -> ta.CalibrationRun:
        return ta.CalibrationRun(-run.reference, -run.indicated, 360.0, time=run.time)

    for by in ("time", "angle"):
        plain = minus_simulated(measured(), log(), by=by).runs[0]
        other = minus_simulated(mirrored(measured()), mirrored(log()), by=by).runs[0]
        # Bins of neighbours are counted from the other end.
        np.testing.assert_allclose(-other.error, plain.error, atol=1e-9 if by == "time" else 2e-3)


@pytest.mark.parametrize("turns", [-2, 0, 3])
def test_whole_turns_between_log_and_readings_do_not_matter(turns: int) -> None:
    run = measured(timed=False)
    far = ta.CalibrationRun(run.reference + 360.0 * turns, run.indicated + 360.0 * turns, 360.0)
    found = minus_simulated(far, log(timed=False))
    plain = minus_simulated(run, log(timed=False))
    assert found.left_out == plain.left_out == 0
    np.testing.assert_allclose(found.runs[0].error, plain.runs[0].error, atol=1e-9)


#: Printed to two digits of the error.
DIGITS = 0.06

#: No two figures alike.
ANGLE = np.linspace(0.0, 350.0, 36)
FOUND = Joined(
    [ta.CalibrationRun(ANGLE[:n], ANGLE[:n], period=360.0) for n in (20, 36)],
    12.3456, -78.9, 0.0123, 4.56, 0.789, (Gap(1.0, 2.0, 3), Gap(4.0, 5.5, 4)), 17, (), (),
)  # fmt: skip


@pytest.mark.parametrize(("errors_in", "per"), [("arcsec", 1.0), ("mrad", np.pi / 648.0)])
def test_every_figure_stands_with_its_own_error(errors_in, per) -> None:
    plain, text = FOUND.to_dict(), FOUND.summary(errors_in)
    said = dict(re.findall(r"^  (\w+) +(.*)$", text, re.M))
    for name, unit in (("offset", "s"), ("rate", "ppm")):
        value, std = re.fullmatch(rf"(\S+) \+- (\S+) {unit}", said[name]).groups()
        wanted = plain[f"{name}_std_{unit}"]
        assert float(std) == pytest.approx(wanted, rel=DIGITS)
        assert float(value) == pytest.approx(plain[f"{name}_{unit}"], abs=DIGITS * wanted)
    added = re.fullmatch(rf"adds (\S+) {errors_in} standard deviation", said["joining"])
    assert float(added[1]) == pytest.approx(per * plain["std_arcsec"], rel=1e-3)
    assert int(said["gaps"]) == len(plain["gaps"]) == 2
    counts = re.match(r"(\d+) of (\d+) readings joined in (\d+) runs", text)
    readings, runs = (plain[key] for key in ("readings", "runs"))
    assert [*map(int, counts.groups())] == [readings, 17 + readings, runs]
    kept = replace(FOUND, left_out=0).summary(errors_in)
    assert kept.startswith("56 readings joined in 2 runs")
    assert (plain["readings"], plain["left_out"]) == (56, 17)


def test_what_is_declared_has_no_error() -> None:
    declared = replace(FOUND, offset_std_s=None, rate_std_ppm=None)
    assert "+-" not in declared.summary()
    assert declared.to_dict()["offset_std_s"] is declared.to_dict()["rate_std_ppm"] is None
