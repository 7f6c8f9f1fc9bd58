"""A resolver sampled with its excitation: demodulated, calibrated and corrected."""

from __future__ import annotations

import math

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.errors import FileError
from trueangle.runs.channelangle import demodulated
from trueangle.runs.files import read_runs

#: Readings in a period of the carrier, lag of the transformer, and ratio of its coils.
PERIOD, LAG, RATIO = 12.7, 0.35, 0.5
N = 40_000


def resolver(noise=0.0, turns=1.5, lag=LAG, seed=0, n=N):
    """Samples of a carrier and of two coils whose gains and angle are off; places in degrees."""
    rng = np.random.default_rng(seed)
    time = np.arange(n)
    theta = 2.0 * math.pi * turns * time / n
    phase = 2.0 * math.pi * time / PERIOD + 1.1
    carrier = 0.02 + 2.0 * np.sin(phase)
    induced = RATIO * 2.0 * np.sin(phase + lag)
    channels = {
        "excitation": carrier,
        "sine": 0.1 + 1.03 * np.sin(theta - 0.02) * induced,
        "cosine": -0.2 + np.cos(theta) * induced,
    }
    noisy = {name: v + noise * rng.normal(size=n) for name, v in channels.items()}
    return {"reference_deg": np.degrees(theta), **noisy}


def bare(log):
    return {name: values for name, values in log.items() if name != "reference_deg"}


def off(angle, reference):
    unit = np.exp(1j * np.radians(angle - reference))
    return np.degrees(np.angle(unit / unit.mean()))


@pytest.mark.parametrize("lag", [LAG, -1.2, 0.0])
def test_the_constants_are_those_of_the_coils(lag):
    found = ta.selfcal(bare(resolver(1e-3, lag=lag)), method="channels")
    channels = found.channels
    assert found.readings == N // PERIOD
    assert channels.excitation_deg == pytest.approx(math.degrees(lag), abs=0.02)
    for name, wanted in (("gain_ratio", 1.03), ("phase_deg", math.degrees(-0.02))):
        entry = channels.to_dict()[name]
        assert abs(entry["value"] - wanted) < 5.0 * entry["std"] + 1e-4
    assert channels.amplitude == pytest.approx(RATIO, rel=1e-3)
    # Constants of the converter are not those of the carrier's amplitude.
    assert abs(channels.offset_sine) < 1e-4
    assert abs(channels.offset_cosine) < 1e-4


def test_the_noise_of_an_angle_is_at_its_limit():
    """Cramer-Rao: the variance of an amplitude in ``n`` readings is ``2 σ² / n``."""
    noise = 0.01
    (run,) = read_runs(resolver(noise, turns=0.5), periods_per_turn=1)
    model = ta.fit(run, orders=[]).model
    sine, cosine = run.signals["sine"], run.signals["cosine"]
    error = off(model.channels.angle(sine, cosine), run.reference)
    # Also the carrier itself is read with noise, whose size cancels in the angle.
    limit = math.degrees(noise * math.sqrt(2.0 / PERIOD) / (2.0 * RATIO))
    assert 0.95 < np.std(error) / limit < 1.15


@pytest.mark.parametrize("reference", [False, True])
def test_the_commands_read_and_correct_the_raw_samples(reference, tmp_path, capsys):
    log = resolver(1e-3, n=12_000)
    columns = log if reference else bare(log)
    file, model, out = tmp_path / "adc.csv", tmp_path / "m.json", tmp_path / "out.csv"
    rows = np.column_stack(list(columns.values()))
    np.savetxt(file, rows, delimiter=",", header=",".join(columns), comments="", fmt="%.9g")
    assert main(["check", str(file)]) == 0
    command = ["fit", str(file)] if reference else ["selfcal", str(file), "--method", "channels"]
    assert main([*command, "-o", str(model)]) == 0
    assert "phase to the excitation" in capsys.readouterr().out
    assert main(["correct", str(file), "-m", str(model), "-o", str(out)]) == 0
    assert capsys.readouterr().err == ""
    corrected = np.genfromtxt(out, delimiter=",", names=True)["corrected_deg"]
    assert corrected.size == 12_000
    error = off(corrected, log["reference_deg"])
    # Half a period of travel, 0.57 deg in all, and the noise of one period.
    assert np.abs(error).max() < 0.57
    assert ta.load_model(model).channels.excitation_deg == pytest.approx(20.05, abs=0.2)


def test_runs_are_demodulated_each_with_one_phase():
    logs = [resolver(1e-3, seed=seed, n=8000 + 3 * seed) for seed in range(3)]
    both = {name: np.concatenate([log[name] for log in logs]) for name in logs[0]}
    both["run"] = np.repeat(["a", "b", "c"], [8000, 8003, 8006])
    runs = read_runs(both, periods_per_turn=1)
    assert [len(run) for run in runs] == [629, 630, 630]
    for run in runs:
        assert np.std(off(run.indicated, run.reference)) < 1.0


@pytest.mark.parametrize(
    ("change", "words"),
    [
        ({"excitation": np.full(N, 2.0)}, "'excitation' has no periods of 4 readings and more"),
        ({"excitation": np.tile([1.0, -1.0], N // 2)}, "has no periods of 4 readings and more"),
        ({"sine": np.where(np.arange(N) == 77, np.nan, 1.0)}, "this cell is empty|finite"),
    ],
)
def test_what_is_no_excitation_is_refused_in_one_line(change, words):
    for run in (lambda log: ta.selfcal(log, method="channels"), ta.fit):
        with pytest.raises(FileError, match=words) as caught:
            run({**resolver(), **change})
        assert "\n" not in str(caught.value)


def test_a_table_without_excitation_stays_as_it_is():
    (run,) = read_runs({k: v for k, v in resolver().items() if k != "excitation"} | {
        "sine": np.sin(np.linspace(0.0, 9.0, N)), "cosine": np.cos(np.linspace(0.0, 9.0, N)),
        "reference_deg": np.degrees(np.linspace(0.0, 9.0, N)),
    })  # fmt: skip
    assert len(run) == N
    assert run.channels.excitation_deg is None
    assert demodulated.__doc__
