"""``selfcal`` of a sine and a cosine channel: sense, limits, what is blind, measured channels."""

from __future__ import annotations

import json
import math

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.errors import FileError
from trueangle.runs.channelangle import demodulated
from trueangle.runs.files import read_runs
from trueangle.runs.rawchannels import Channels


def log(channels, turns=1.0, noise=1e-3, n=2000, seed=0, **more):
    rng = np.random.default_rng(seed)
    phase = 2.0 * math.pi * turns * np.arange(n) / n
    sine, cosine = channels.curve(phase)
    size = noise * abs(channels.fundamental)
    return {
        "sine": sine + size * rng.normal(size=n),
        "cosine": cosine + size * rng.normal(size=n),
        **{name: values(phase) for name, values in more.items()},
    }


COUNTS = Channels(
    offset_sine=2100.0, offset_cosine=2040.0, amplitude=900.0, gain_ratio=1.05, phase_deg=-3.0
)


def test_constants_of_an_unsigned_converter_come_back_with_their_errors():
    found = ta.selfcal(log(COUNTS))
    plain = found.to_dict()
    assert plain["method"] == "channels"
    for name in ("offset_sine", "offset_cosine", "gain_ratio", "phase_deg"):
        entry = plain["channels"][name]
        assert abs(entry["value"] - getattr(COUNTS, name)) < 5.0 * entry["std"]
        assert entry["std"] > 0.0
    assert plain["coverage_deg"] == pytest.approx(360.0)
    # Orders 1 and 2, two coefficients each: 2 sigma / sqrt(n).
    wanted = math.degrees(2e-3 / math.sqrt(2000)) * 3600.0
    assert plain["limit_arcsec"] == pytest.approx(wanted, rel=0.2)
    assert {o for b in plain["blind"] for o in b["orders"]} >= {0, 2}


@pytest.mark.parametrize("periods", [1, 7])
def test_the_sense_is_that_of_another_angle_else_of_the_travel(periods):
    turns = 2.0

    def angle(sign):
        return lambda phase: sign * np.degrees(phase) / periods

    for sign in (1, -1):
        known = ta.selfcal(
            log(COUNTS, turns, indicated_deg=angle(sign)),
            method="channels",
            periods_per_turn=periods,
        )
        assert known.channels.direction == sign
        assert known.channels.periods_per_turn == periods
    backward = {name: values[::-1] for name, values in log(COUNTS, turns).items()}
    found = ta.selfcal(backward, method="channels", periods_per_turn=periods)
    assert found.channels.direction == -1
    assert any("sign of the angle is the other one" in note for note in found.notes)
    angles = np.unwrap(found.channels.angle(**backward), period=360.0 / periods)
    assert np.ptp(angles) == pytest.approx(360.0 * turns / periods, rel=1e-2)
    assert angles[-1] > angles[0]


def test_an_eccentric_magnet_is_never_made_worse_without_a_word():
    """``z_0`` and ``z_2`` of one size: the curve is that of an offset, and the error is not."""
    for seed in range(10):
        rng = np.random.default_rng(seed)
        z = 0.02 * np.exp(2j * math.pi * rng.uniform())
        offset = z * np.exp(0.3j)
        magnet = Channels(
            offset_sine=offset.imag,
            offset_cosine=offset.real,
            harmonics=((2, z.real, z.imag, 0.0),),
            period=360.0,
        )
        phase = 2.0 * math.pi * np.arange(720) / 720
        true = np.degrees(phase)
        found = ta.selfcal(log(magnet, seed=seed), method="channels")

        def left(angles, true=true):
            off = np.exp(1j * np.radians(angles - true))
            return float(np.degrees(np.std(np.angle(off / off.mean()))))

        sine, cosine = magnet.curve(phase)
        before = left(np.degrees(np.arctan2(sine, cosine)))
        after = left(found.channels.correct(sine, cosine))
        if after > before:
            (blind,) = (b for b in found.blind if b.orders == (1.0,))
            assert "magnet" in blind.because
            bound = float(blind.because.split("up to ")[1].split(" deg")[0])
            assert (after - before) * math.sqrt(2.0) < bound


def test_time_stamps_of_several_turns_give_the_order_that_the_curve_cannot():
    magnet = Channels(offset_sine=0.02, harmonics=((2, 0.0, 0.02, 0.0),), period=360.0)

    def coast(phase):
        return -30.0 * np.log1p(-phase / 300.0)

    smooth = log(magnet, 40.0, n=20_000, time_s=coast)
    found = ta.selfcal(smooth, method="channels", loop="open")
    assert all(b.orders != (1.0,) for b in found.blind)
    angle = found.model.channels.angle(smooth["sine"], smooth["cosine"])
    off = np.radians(found.model.correct(angle)) - 2.0 * math.pi * 40.0 * np.arange(20_000) / 2e4
    off = np.exp(1j * off)
    left = np.degrees(np.std(np.angle(off / off.mean())))
    # Noise of one reading is 0.057 deg; the magnet's order 1 alone would be 1.1 deg.
    assert left < 0.07


def test_runs_whose_curves_differ_are_reported():
    far = log(COUNTS)
    near = {name: 1.5 * values for name, values in log(COUNTS, seed=1).items()}
    runs = np.repeat(["far", "near"], 2000)
    both = {name: np.concatenate([far[name], near[name]]) for name in far}
    found = ta.selfcal({**both, "run": runs}, method="channels")
    assert any("calibrate each run alone" in note for note in found.notes)


@pytest.mark.filterwarnings("always::trueangle.errors.UnitWarning")
def test_the_command_writes_a_model_that_corrects_a_log_of_channels(tmp_path, capsys):
    given = log(COUNTS, 3.0)
    file = tmp_path / "adc.csv"
    rows = zip(given["sine"].tolist(), given["cosine"].tolist(), strict=True)
    file.write_text("sine,cosine,note\n" + "".join(f"{s!r},{c!r},x\n" for s, c in rows))
    model, out = tmp_path / "joint.json", tmp_path / "out.csv"
    assert main(["selfcal", str(file), "-o", str(model), "--json"]) == 0
    plain = json.loads(capsys.readouterr().out)
    assert plain["channels"]["direction"] == {"value": 1, "std": 0.0}
    assert main(["correct", str(file), "-m", str(model), "-o", str(out)]) == 0
    lines = out.read_text().splitlines()
    assert lines[0] == "sine,cosine,note,corrected_deg"
    loaded = ta.load_model(model)
    step = loaded.compensator()
    for line in lines[1:20]:
        sine, cosine, _, corrected = line.split(",")
        assert step(float(sine), float(cosine)) == float(corrected)
    angle = loaded.channels.angle(given["sine"], given["cosine"])
    assert loaded.correct(angle)[5] == step(given["sine"][5], given["cosine"][5])
    file.write_text("sine,cosine\n" + "".join(f"{s!r},0.3\n" for s in given["sine"].tolist()))
    assert main(["correct", str(file), "-m", str(model), "-o", f"{out}.csv"]) == 0
    assert "the cosine channel is constant (0.3): a dead channel" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda t: {**t, "cosine": np.zeros(2000)}, "the cosine channel is constant"),
        (lambda t: {**t, "cosine": t["sine"]}, "are one signal"),
        (lambda t: {k: v[:250] for k, v in t.items()}, "turn the shaft"),
        (lambda t: {"sine": t["sine"]}, "sine and cosine"),
    ],
)
def test_bad_channels_end_with_status_1_and_one_line(tmp_path, capsys, change, words):
    # A quarter of a period at most, and noise that drowns the curvature.
    table = change(log(COUNTS, 1.0, noise=4e-3))
    file = tmp_path / "adc.csv"
    rows = zip(*table.values(), strict=True)
    text = ",".join(table) + "\n" + "".join(",".join(map(repr, map(float, r))) + "\n" for r in rows)
    file.write_text(text)
    assert main(["selfcal", str(file), "--method", "channels", "-o", str(tmp_path / "m.json")]) == 1
    captured = capsys.readouterr()
    assert words in captured.err
    assert len(captured.err.strip().splitlines()) == 1
    assert not (tmp_path / "m.json").exists()


def test_measured_optical_channels_leave_little_of_the_radius(data_dir):
    file = data_dir / "optical_channels.csv"
    found = ta.selfcal(file, method="channels", signals={"sine": "a_count", "cosine": "b_count"})
    # An ellipse leaves 6 %.
    assert found.beside["radius_left_relative"] < 0.02
    assert found.beside["clipped"] == {}


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
