"""Fits of a sine and a cosine channel against a reference."""

from __future__ import annotations

import math

import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import ArgumentError, FileError


def table(periods, sign, zero, n=3000, seed=0, shaft=0.0, noise=1e-3):
    """An ellipse with counts of a converter; the shaft's own error on top, in degrees."""
    rng = np.random.default_rng(seed)
    theta = np.sort(rng.uniform(0.0, 360.0, n))
    indicated = theta + shaft * np.sin(np.radians(theta))
    phase = sign * periods * np.radians(indicated) + zero
    return {
        "reference_deg": theta,
        "sine": 2100.0 + 930.0 * np.sin(phase + 0.03) + 900.0 * noise * rng.normal(size=n),
        "cosine": 2040.0 + 900.0 * np.cos(phase) + 900.0 * noise * rng.normal(size=n),
    }


@pytest.mark.parametrize("periods", [1, 5])
@pytest.mark.parametrize("sign", [1, -1])
def test_constants_and_the_shaft_are_one_model(periods, sign):
    # Of one period a turn the shaft's own error is one with harmonics of the channels.
    shaft = 0.5 if periods > 1 else 0.0
    found = ta.fit(table(periods, sign, 0.4, shaft=shaft), periods_per_turn=periods)
    channels = found.model.channels
    assert channels.direction == sign
    plain = channels.to_dict()
    wanted = {"offset_sine": 2100.0, "offset_cosine": 2040.0, "gain_ratio": 930.0 / 900.0}
    for name, value in {**wanted, "phase_deg": math.degrees(0.03)}.items():
        # The shaft's error modulates the phase: a few more than the errors of the noise.
        assert abs(plain[name]["value"] - value) < 6.0 * plain[name]["std"] + 1e-3 * abs(value)
    assert found.residual_std < 1.2 * math.degrees(1e-3) / periods
    assert found.to_dict()["channels"] == plain


def test_pulls_of_the_constants():
    pulls = []
    for seed in range(40):
        found = ta.fit(table(1, 1, 0.0, n=400, seed=seed), orders=[]).model.channels
        std = np.sqrt(np.diag(found.covariance))
        off = [found.offset_cosine - 2040.0, found.offset_sine - 2100.0, found.amplitude - 900.0]
        off += [found.gain_ratio - 930.0 / 900.0, found.phase_deg - math.degrees(0.03)]
        pulls.append(off / std)
    # 200 numbers.
    assert 0.85 < math.sqrt(np.mean(np.square(pulls))) < 1.15


def test_a_perfect_shaft_needs_no_order_and_the_model_corrects(tmp_path):
    given = table(1, -1, 1.0)
    model = ta.fit(given).model
    assert model.orders == ()
    model.save(tmp_path / "m.json")
    loaded = ta.load_model(tmp_path / "m.json")
    assert loaded == model
    step = loaded.compensator()
    off = step(given["sine"][7], given["cosine"][7]) - given["reference_deg"][7]
    assert abs((off + 180.0) % 360.0 - 180.0) < 0.5


def test_runs_with_zeros_of_their_own_share_the_constants():
    parts = [table(1, 1, zero, n=500, seed=i) for i, zero in enumerate((0.0, 1.0, 2.5))]
    both = {name: np.concatenate([part[name] for part in parts]) for name in parts[0]}
    found = ta.fit({**both, "run": np.repeat(["a", "b", "c"], 500)}, orders=[1, 2])
    assert found.model.channels.gain_ratio == pytest.approx(930.0 / 900.0, abs=3e-4)
    assert np.max(found.amplitudes) < 0.02


def test_runs_with_and_without_channels_are_refused():
    theta = np.linspace(0.0, 350.0, 36)
    plain = ta.CalibrationRun(theta, theta, 360.0)
    (decoded,) = ta.read_runs(table(1, 1, 0.0, n=100))
    with pytest.raises(ArgumentError, match="sine and cosine channels"):
        ta.fit([decoded, plain])


def test_measured_channels_are_as_good_as_the_angle_of_the_chip(data_dir):
    """RM44: with a reference the channels add names, not accuracy."""
    file = data_dir / "rm44_channels.csv"
    runs = [run for run in ta.read_runs(file, periods_per_turn=1) if run.label == "xs_300u"]
    found = ta.fit(runs, orders=range(1, 9))
    chip = [run for run in ta.read_runs(file) if run.label == "xs_300u"]
    assert found.model.channels.direction == -1
    assert found.residual_std < 1.1 * ta.fit(chip, orders=range(1, 9)).residual_std


def turn_of(periods=1, clip=math.inf, sign=1):
    x = np.arange(0.0, 720.0, 0.6)
    phase = sign * periods * np.radians(x)
    rng = np.random.default_rng(3)
    sine, cosine = (
        np.clip(v + 1e-3 * rng.normal(size=x.size), -clip, clip)
        for v in (np.sin(phase), np.cos(phase))
    )
    return {"reference_deg": x, "sine": sine, "cosine": cosine}


def test_clipped_channels_are_said_and_too_few_readings_refused():
    with pytest.raises(FileError, match=r"not at a rail \(clipped\) .* and 12 are needed"):
        ta.fit(turn_of(clip=0.6), orders=[])
    notes = ta.fit(turn_of(clip=0.9), orders=[]).notes
    for role in ("sine", "cosine"):
        assert sum(f"of the {role} channel are at its rail (clipped)" in n for n in notes) == 1
    assert not any("rail" in note for note in ta.fit(turn_of(), orders=[]).notes)


@pytest.mark.parametrize("sign", [1, -1])
def test_a_phase_that_falls_is_said(sign):
    notes = ta.fit(turn_of(sign=sign), orders=[]).notes
    assert any("falls as the recorded angle rises" in note for note in notes) == (sign < 0)


@pytest.mark.parametrize("sign", [1, -1])
def test_periods_that_the_reference_counts_are_asked_for(sign):
    with pytest.raises(FileError, match=r"3 periods in a turn .* give --periods-per-turn 3"):
        ta.fit(turn_of(periods=3, sign=sign), orders=[])
    assert ta.fit(turn_of(3, sign=sign), [], periods_per_turn=3).model.channels is not None
