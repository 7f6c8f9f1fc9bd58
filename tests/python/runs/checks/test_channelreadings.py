"""Faults of a sine and a cosine channel, in the same words by every command."""

from __future__ import annotations

import math

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.runs.checks.channelreadings import ChannelReadings

pytestmark = [
    pytest.mark.filterwarnings("always::trueangle.errors.UnitWarning"),
    pytest.mark.filterwarnings("always::trueangle.errors.EmptyCellsWarning"),
]
N = 900
PHASE = 4.0 * math.pi * np.arange(N) / N


def codes(amplitude=900.0, middle=2100.0, seed=0):
    """Two turns of a converter: the sine 5 % larger, and not quite at right angles."""
    noise = np.random.default_rng(seed).normal(size=(2, N))
    sine = middle + 1.05 * amplitude * np.sin(PHASE - 0.05) + 0.8 * noise[0]
    return np.rint(sine), np.rint(middle - 60.0 + amplitude * np.cos(PHASE) + 0.8 * noise[1])


def held(sine, cosine, value):
    rows = slice(300, 345)
    sine[rows], cosine[rows] = value, value
    return sine, cosine


def unsigned(*channels):
    return [np.mod(channel, 65536.0) for channel in channels]


def overflown(*channels):
    return [np.mod(channel + 32768.0, 65536.0) - 32768.0 for channel in channels]


SCATTER = np.random.default_rng(7)
#: What is done to sound channels, and the words of the fault; empty where there is none.
CASES = {
    "dropouts at zero": (lambda: held(*codes(), 0.0), "45 readings of the channels are off"),
    "dropouts at the rail": (lambda: held(*codes(), 4095.0), "45 readings of the channels are off"),
    "dropouts in the middle": (
        lambda: held(*codes(middle=30.0), 0.0), "45 readings of the channels are off"
    ),
    "signed integers as unsigned": (
        lambda: unsigned(*codes(25_000.0, 30.0)), "jumps by 65536 codes (a counter that wraps)"
    ),
    "a counter that is too narrow": (
        lambda: overflown(*codes(33_100.0, 30.0)), "jumps by 65536 codes (a counter that wraps)"
    ),
    "a dead channel": (lambda: (codes()[0], np.full(N, 2040.0)), "the cosine channel is constant"),
    "a dead channel with noise": (
        lambda: (codes()[0], 2040.0 + np.rint(SCATTER.normal(size=N))),
        "the cosine channel is constant",
    ),
    "one channel twice": (lambda: (codes()[0], codes()[0] - 3.0), "sine and cosine are one signal"),
    "one channel at its rails": (
        lambda: (np.clip(codes()[0], 2100.0, 2100.1), codes()[1]), "channel is constant"
    ),
    "no middle": (codes, "the channels do not go round zero but about 2"),
}  # fmt: skip


def written(path, sine, cosine, reference=False):
    table = {"sine": sine, "cosine": cosine}
    if reference:
        table = {"reference_deg": np.degrees(PHASE), **table}
    rows = np.column_stack(list(table.values()))
    np.savetxt(path, rows, delimiter=",", header=",".join(table), comments="", fmt="%.10g")
    return str(path)


@pytest.mark.parametrize("name", list(CASES))
def test_every_command_states_a_fault_in_the_same_words(name, tmp_path, capsys):
    make, words = CASES[name]
    bare = written(tmp_path / "bare.csv", *make())
    known = written(tmp_path / "known.csv", *make(), reference=True)
    is_fatal = not any(part in words for part in ("are off", "go round"))
    model = str(tmp_path / "m.json")
    for command in (
        ["check", bare],
        ["check", known],
        ["selfcal", bare, "-o", model],
        ["fit", known, "-o", str(tmp_path / "f.json")],
    ):
        assert main(command) == int(is_fatal), command
        out, err = capsys.readouterr()
        told = " ".join(f"{out} {err}".split())
        assert words in told, command
        if is_fatal and command[0] != "check":
            assert len(err.strip().splitlines()) == 1
            assert "run: trueangle" not in err  # no other command helps


def test_sound_channels_have_no_fault(tmp_path, capsys):
    """Of few readings a turn too, and where all of them are at the same places."""
    for n in (12, 13, 40, N):
        for middle in (0.0, 30.0):
            phase = 2.0 * math.pi * np.arange(n) / n
            sine, cosine = (np.rint(middle + 900.0 * f(phase + 0.1)) for f in (np.sin, np.cos))
            found = ChannelReadings.of(np.tile(sine, 3), np.tile(cosine, 3))
            assert not found.flags.any()
            assert found.problem == ""
            assert found.middle == (0.0, 0.0)
    file = written(tmp_path / "adc.csv", *codes(middle=30.0), reference=True)
    assert main(["check", file]) == 0
    assert "No fault" in capsys.readouterr().out


@pytest.mark.parametrize("value", [0.0, 4095.0])
def test_dropouts_do_not_move_the_constants(value):
    sound, bad = codes(), held(*codes(), value)
    kept = np.delete(np.arange(N), np.s_[300:345])
    reference = np.degrees(PHASE)

    def numbers(channels):
        return [getattr(channels, name) for name in ("offset_sine", "amplitude", "gain_ratio")]

    without = ta.selfcal({"sine": sound[0][kept], "cosine": sound[1][kept]}, method="channels")
    found = ta.selfcal({"sine": bad[0], "cosine": bad[1]}, method="channels")
    assert numbers(found.channels) == pytest.approx(numbers(without.channels), rel=1e-9)
    table = {"reference_deg": reference, "sine": bad[0], "cosine": bad[1]}
    found = ta.fit(table).model
    table = {name: values[kept] for name, values in table.items()}
    assert numbers(found.channels) == pytest.approx(numbers(ta.fit(table).model.channels), rel=1e-9)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda s, c: (s, c), ""),
        (lambda s, c: held(s.copy(), c.copy(), 0.0), "45 readings of the channels are off their"),
        (lambda s, c: (s, np.full(N, 2040.0)), "the cosine channel is constant (2040)"),
        (lambda s, c: (np.full(N, 2100.0), c), "the sine channel is constant (2100)"),
        (lambda s, c: (s, s), "sine and cosine are one signal"),
        (lambda s, c: (c, s), "they are swapped"),
        (lambda s, c: (s + 9000.0, c), "900 of 900 readings of the channels are off the curve"),
        (lambda s, c: (s[:9], c[:9]), ""),
        (lambda s, c: (np.full(N, s[3]), np.full(N, c[3])), ""),
        (lambda s, c: (1.2 * s - 420.0, 1.2 * c - 408.0), ""),
    ],
)
def test_correct_states_what_is_wrong_with_the_channels_of_a_log(change, words, tmp_path, capsys):
    sine, cosine = codes()
    model = tmp_path / "m.json"
    ta.selfcal({"sine": sine, "cosine": cosine}, method="channels").model.save(model)
    log = written(tmp_path / "log.csv", *change(sine, cosine))
    assert main(["correct", log, "-m", str(model), "-o", str(tmp_path / "out.csv")]) == 0
    err = capsys.readouterr().err.strip()
    assert words in err
    assert len(err.splitlines()) == bool(words)
