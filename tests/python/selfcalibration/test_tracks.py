"""Two tracks of a nonius or vernier sensor: the absolute angle, and the margin of its period."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.errors import ArgumentError, NoModelError
from trueangle.estimation.tracks import joined
from trueangle.runs.rawchannels import TRACKS


def sensor(first, second, senses=(1, 1), period=360.0):
    """Two tracks, each off in offsets, gain, phase and third harmonic."""
    return (
        ta.Channels(
            offset_sine=0.06, offset_cosine=-0.03, gain_ratio=1.05, phase_deg=2.0, period=period,
            harmonics=((-3, 0.006, 0.002, 0.0),), direction=senses[0], periods_per_turn=first,
        ),
        ta.Channels(
            offset_sine=-0.02, offset_cosine=0.05, gain_ratio=0.94, phase_deg=-3.0, period=period,
            harmonics=((-3, -0.004, 0.005, 0.0),), direction=senses[1], periods_per_turn=second,
        ),
    )  # fmt: skip


def readings(tracks, theta, noise=0.0, seed=0, zero=0.8):
    """Columns of all channels at places in radians, by the curves of the tracks alone."""
    found = []
    for track, at in zip(tracks, (0.0, zero), strict=True):
        found += track.curve(track.direction * track.periods_per_turn * theta + at)
    rng = np.random.default_rng(seed)
    return [values + noise * rng.normal(size=values.size) for values in found]


def off(found, theta, period):
    """Errors within half a turn, without their mean."""
    unit = np.exp(2j * math.pi * found / period - 1j * theta)
    return np.angle(unit / (unit.mean() / abs(unit.mean())))


@pytest.mark.parametrize("period", [360.0, 1.0])
@pytest.mark.parametrize("senses", [(1, 1), (1, -1), (-1, 1)])
@pytest.mark.parametrize(
    ("first", "second"), [(32, 31), (31, 32), (5, 3), (16, 1), (1, 7), (20, 9)]
)
def test_the_angle_is_absolute_over_the_turn(first, second, senses, period):
    rng = np.random.default_rng(first * second)
    theta = rng.uniform(-math.pi, math.pi, 2000)
    tracks = sensor(first, second, senses, period)
    values = readings(tracks, theta)
    found = joined(tracks[0], tracks[1].replace(direction=1), values, "log")
    assert found.second.direction == senses[1]
    assert np.abs(found.mismatch(*values)).max() < 1e-9
    angle = found.correct(*values)
    # The phase of the second track is not that of its harmonics' zero: both have a constant.
    assert np.abs(off(angle, theta, period)).max() < 1e-9
    assert -0.5 * period < angle.min() < angle.max() <= 0.5 * period


@pytest.mark.parametrize("noise", [2e-3, 8e-3])
def test_the_mismatch_is_that_of_the_noise_of_both_tracks(noise):
    """Variance ``(p1² + p2²) (σ / 2 pi)²`` in periods, and jumps of whole periods beyond 0.5."""
    theta = 2.0 * math.pi * np.arange(6000) / 6000
    tracks = (
        ta.Channels(periods_per_turn=32, period=360.0),
        ta.Channels(periods_per_turn=31, period=360.0),
    )
    values = readings(tracks, theta, noise)
    found = joined(*tracks, values, "log")
    mismatch = found.mismatch(*values)
    wanted = noise * math.hypot(32.0, 31.0) / (2.0 * math.pi)
    assert np.sqrt(np.mean(mismatch**2)) == pytest.approx(wanted, rel=0.04)
    error = off(found.correct(*values), theta, 360.0)
    assert np.abs(error).max() < math.pi / 32


def test_a_wrong_period_is_a_jump_of_whole_periods():
    theta = 2.0 * math.pi * np.arange(4000) / 4000
    tracks = sensor(16, 15)
    found = joined(*tracks, readings(tracks, theta), "log")
    wrong = readings(tracks, theta, noise=0.08, seed=1)
    error = off(found.correct(*wrong), theta, 360.0) * 16 / (2.0 * math.pi)
    jumps = np.rint(error)
    assert 0 < np.count_nonzero(jumps) < 400
    assert np.abs(error - jumps).max() < 0.2


def table(tracks, noise=2e-3, n=3000, reference=True):
    theta = 2.0 * math.pi * np.arange(n) / n
    found = dict(zip(TRACKS, readings(tracks, theta, noise), strict=True))
    return {"reference_deg": np.degrees(theta), **found} if reference else found


def written(path, columns):
    rows = np.column_stack(list(columns.values()))
    np.savetxt(path, rows, delimiter=",", header=",".join(columns), comments="", fmt="%.12g")
    return str(path)


@pytest.mark.filterwarnings("always::trueangle.errors.UnitWarning")
@pytest.mark.parametrize("reference", [False, True])
def test_the_commands_calibrate_correct_and_watch_the_margin(reference, tmp_path, capsys):
    tracks = sensor(16, 15)
    columns = table(tracks, reference=reference)
    log, model = written(tmp_path / "log.csv", columns), str(tmp_path / "m.json")
    periods = ["--periods-per-turn", "16,15"]
    assert main(["check", log, *periods]) == 0
    command = ["fit", log] if reference else ["selfcal", log, "--method", "channels"]
    assert ("at most, margin 0.4" in capsys.readouterr().out) is not reference
    assert main([*command, *periods, "-o", model, "--json"]) == 0
    plain = json.loads(capsys.readouterr().out)
    assert any("the second track chooses the period" in n.lower() for n in plain["notes"])
    loaded = ta.load_model(model)
    assert loaded.channels.second.periods_per_turn == 15
    if not reference:
        wanted = 2e-3 * math.hypot(16.0, 15.0) / (2.0 * math.pi)
        assert plain["beside"]["mismatch_periods"]["rms"] == pytest.approx(wanted, rel=0.1)
        assert abs(loaded.channels.second.offset_cosine - 0.05) < 3e-4
    out = tmp_path / "out.csv"
    assert main(["correct", log, "-m", model, "-o", str(out)]) == 0
    assert capsys.readouterr().err == ""
    corrected = np.genfromtxt(out, delimiter=",", names=True)["corrected_deg"]
    theta = 2.0 * math.pi * np.arange(corrected.size) / corrected.size
    # Noise of one reading over the periods; a wrong period is 22.5 degrees.
    assert np.degrees(np.abs(off(corrected, theta, 360.0)).max()) < 6.0 * math.degrees(2e-3 / 16)
    step = loaded.compensator()
    row = [columns[role][77] for role in TRACKS]
    assert step(*row) == pytest.approx(corrected[77], abs=1e-9)
    assert json.loads((tmp_path / "m.json").read_text())["channels"]["second_zero_deg"] != 0.0
    late = {**columns, "sine2": columns["sine2"] + 0.15}
    late = written(tmp_path / "late.csv", late)
    assert main(["correct", late, "-m", model, "-o", str(tmp_path / "late_out.csv")]) == 0
    err = capsys.readouterr().err
    assert "from 0.5 on a period is wrong" in err
    assert len(err.strip().splitlines()) == 1


@pytest.mark.parametrize(
    ("periods", "change", "words"),
    [
        ((16, 13), {}, "16 and 13 periods do not agree on a period"),
        ((16, 15), {"sine2": np.zeros(3000)}, "second track: the sine channel is constant"),
    ],
)
def test_tracks_that_settle_no_period_are_refused_in_one_line(periods, change, words):
    columns = {**table(sensor(16, 15), reference=False), **change}
    with pytest.raises(NoModelError, match=words):
        ta.selfcal(columns, method="channels", periods_per_turn=periods)


@pytest.mark.parametrize("periods", [(16, 14), (16, 16), (5, 4, 3), (16, 1.5), ()])
def test_periods_that_choose_nothing_are_refused(periods):
    with pytest.raises(ArgumentError, match="periods_per_turn must be"):
        ta.selfcal({"sine": [0.0], "cosine": [1.0]}, periods_per_turn=periods)


def test_a_second_track_needs_its_columns():
    columns = {k: v for k, v in table(sensor(16, 15)).items() if k != "cosine2"}
    for run in (ta.fit, lambda t, **k: ta.selfcal(t, method="channels", **k)):
        with pytest.raises(ta.TrueAngleError, match="cosine2"):
            run(columns, periods_per_turn=(16, 15))
