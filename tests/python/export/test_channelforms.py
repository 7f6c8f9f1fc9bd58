"""Constants of a sine and a cosine channel in forms of firmware: each against its own formula."""

from __future__ import annotations

import json
import math
import re
import shutil
import subprocess

import numpy as np
import pytest

import trueangle as ta
from trueangle.errors import ArgumentError, FileError

FORMS = [
    ("vesc", {"volts_per_count": 3.3 / 4095}, ".xml"),
    ("lerobot", {}, ".json"),
    ("simplefoc", {"variant": "linearhall"}, ".h"),
    ("moteus", {"variant": "common"}, ".cfg"),
    ("ax2000", {"volts_per_count": 3.3 / 4095}, ".txt"),
    ("ax5000", {}, ".txt"),
]


def drawn(seed, harmonic=0.0, **fields):
    rng = np.random.default_rng(seed)
    channels = ta.Channels(
        **{
            "offset_sine": 2048.0 + 60.0 * rng.normal(),
            "offset_cosine": 2048.0 + 60.0 * rng.normal(),
            "amplitude": rng.uniform(600.0, 1500.0),
            "gain_ratio": rng.uniform(0.9, 1.1),
            "phase_deg": rng.uniform(-5.0, 5.0),
            "period": 360.0,
            **fields,
        }
    )
    shafts = [ta.Shaft("output", 1, [4], [harmonic], [0.0])] if harmonic else []
    return ta.HarmonicModel(shafts, 0.0, 360.0, channels=channels)


def decoded(name, text, sine, cosine):
    """Phase in radians as the target's own source has it, restated from its numbers in the text."""
    if name == "vesc":
        value = {k: float(v) for k, v in re.findall(r"<m_encoder_(\w+)>([^<]+)<", text)}
        volts = 3.3 / 4095
        s = (sine * volts - value["sin_offset"]) / value["sin_amp"]
        c = (cosine * volts - value["cos_offset"]) / value["cos_amp"]
        turn = math.radians(value["sincos_phase_correction"])
        return np.arctan2(s, (c + s * math.sin(turn)) / math.cos(turn))
    if name == "lerobot":
        (joint,) = json.loads(text)["joints"]
        p = np.array([cosine - 4095 / 2, sine - 4095 / 2])
        z = np.array(joint["T"]) @ (p - np.array(joint["center_fit"])[:, None])
        return np.arctan2(z[1], z[0]) - joint["zero_offset"]
    if name == "simplefoc":
        a, b = map(int, re.search(r"COSINE, (-?\d+), (-?\d+), \d+\);", text).groups())
        return np.arctan2(sine - a, cosine - b)
    if name == "ax2000":
        a, b = map(int, re.findall(r"OFFS (-?\d+)", text))
        return np.arctan2(sine * 3300 / 4095 - a, cosine * 3300 / 4095 - b)
    if name == "ax5000":
        a, b, g, h = map(int, re.findall(r"= (-?\d+)", text))
        return np.arctan2((sine - a) * g, (cosine - b) * h)
    common = float(re.search(r"common (\d+)", text)[1])
    return np.arctan2(sine - common, cosine - common)


@pytest.mark.parametrize(("name", "options", "_ending"), FORMS)
@pytest.mark.parametrize("direction", [1, -1])
def test_what_is_stated_is_what_the_form_leaves(name, options, _ending, direction):
    for seed in range(8):
        model = drawn(seed, harmonic=0.1 * (seed % 2), direction=direction)
        made = ta.export_model(model, name, **options)
        phase = 2.0 * math.pi * np.arange(4096) / 4096
        sine, cosine = model.channels.curve(phase)
        wanted = model.correct(model.channels.angle(sine, cosine))
        got = direction * np.degrees(decoded(name, made.text, sine, cosine)) - made.zero_deg
        off = (got - wanted + 180.0) % 360.0 - 180.0
        largest = np.abs(off).max() * 3600.0
        assert largest <= made.max_difference_arcsec * (1.0 + 1e-9) + 1e-6
        assert largest >= 0.98 * made.max_difference_arcsec - 0.1
        rms = math.sqrt(np.mean(off**2)) * 3600.0
        assert rms == pytest.approx(made.rms_difference_arcsec, rel=0.02, abs=0.1)


@pytest.mark.parametrize(("name", "options", "ending"), FORMS)
def test_forms_come_back(name, options, ending, tmp_path):
    model = drawn(3)
    file = tmp_path / f"out{ending}"
    ta.export_model(model, name, file, **options)
    back = ta.import_model(file, name, **options).channels
    middle = 0.5 * (model.channels.offset_sine + model.channels.offset_cosine)
    assert 0.5 * (back.offset_sine + back.offset_cosine) == pytest.approx(middle, abs=1.3)
    if name in ("vesc", "lerobot"):
        assert back.gain_ratio == pytest.approx(model.channels.gain_ratio, abs=2e-3)
        assert back.phase_deg == pytest.approx(model.channels.phase_deg, abs=1e-3)
        assert back.amplitude == pytest.approx(model.channels.amplitude, rel=1e-3)
        assert back.offset_sine == pytest.approx(model.channels.offset_sine, abs=1.0)
    file.write_text("nothing of it\n")
    with pytest.raises(FileError, match=str(file)):
        ta.import_model(file, name, **options)


@pytest.mark.parametrize(("name", "options", "_ending"), FORMS)
def test_a_model_without_channels_is_refused(name, options, _ending):
    model = ta.HarmonicModel([ta.Shaft("output", 1, [1], [0.1], [0.0])], 0.0, 360.0)
    with pytest.raises(ArgumentError, match="selfcal LOG --method channels"):
        ta.export_model(model, name, **options)


def test_units_that_a_form_cannot_hold_are_refused():
    with pytest.raises(ArgumentError, match="volts_per_count"):
        ta.export_model(drawn(1), "vesc")
    with pytest.raises(ArgumentError, match="12-bit"):
        ta.export_model(drawn(1, offset_sine=9000.0), "moteus", variant="common")
    with pytest.raises(ArgumentError, match="aux must be 1 or 2"):
        ta.export_model(drawn(1), "moteus", variant="common", aux=3)


def test_a_table_of_the_angle_states_how_the_channels_are_decoded():
    model = drawn(5, harmonic=0.2, direction=-1)
    (note,) = (n for n in ta.export_model(model, "c", bits=10).notes if "decoded from" in n)
    numbers = [float(v) for v in re.findall(r"(?<=[-*] )\d[\d.e+-]*|(?<=\* )-?\d[\d.e+-]*", note)]
    sine, cosine = model.channels.curve(np.array([0.7]))
    x = (cosine - numbers[0]) * numbers[1]
    y = (sine - numbers[2]) * numbers[3] - x * numbers[4]
    wanted = np.radians(model.channels.angle(sine, cosine))
    assert -np.arctan2(y, x) == pytest.approx(wanted, abs=1e-7)


#: Reads rows of doubles from a file, writes pairs of decoded and corrected angles.
C_MAIN = """#include <stdint.h>
#include <stdio.h>
#include "joint.h"
int main(void) {
    double row[COUNT];
    while (fread(row, 8, COUNT, stdin) == COUNT) {
        uint32_t angle = joint_decode(READINGS);
        uint32_t both[2] = {angle, joint_correct(angle)};
        fwrite(both, 4, 2, stdout);
    }
    return joint_self_test();
}
"""
RUST_MAIN = """#![deny(warnings)]
mod joint;
use std::io::{Read, Write};
fn main() {
    let mut bytes = Vec::new();
    std::io::stdin().read_to_end(&mut bytes).unwrap();
    let number = |b: &[u8], i: usize| f64::from_le_bytes(b[8 * i..][..8].try_into().unwrap());
    for row in bytes.chunks(8 * COUNT) {
        let angle = joint::decode(READINGS);
        for value in [angle, joint::correct(angle)] {
            std::io::stdout().write_all(&value.to_le_bytes()).unwrap();
        }
    }
    assert_eq!(joint::SELF_TEST[0].1, joint::correct(joint::SELF_TEST[0].0));
}
"""


@pytest.mark.parametrize("target", ["c", "rust"])
@pytest.mark.parametrize(
    ("direction", "periods", "alone", "second"),
    [
        *[(1, 1, False, None), (-1, 3, False, None), (1, 1, True, None)],
        *[(-1, 16, False, 15), (1, 5, True, 32), (1, 7, True, 1), (1, 1, True, 9)],
    ],
)
def test_both_channels_are_decoded_and_corrected_as_by_a_step(
    tmp_path, target, direction, periods, alone, second
):
    compiler = {"c": "gcc", "rust": "rustc"}[target]
    if shutil.which(compiler) is None:
        pytest.skip(f"no {compiler}")
    model = drawn(8, 0.3, direction=direction, periods_per_turn=periods)
    if alone:
        model = model.replace(shafts=())
    if second is not None:
        other = drawn(9, direction=-1, periods_per_turn=second, offset_sine=-3.0).channels
        tracks = model.channels.replace(second=other, second_zero_deg=77.0)
        model = model.replace(channels=tracks)
    ending = {"c": ".h", "rust": ".rs"}[target]
    made = ta.export_model(model, target, tmp_path / f"joint{ending}", bits=16)
    main = tmp_path / ("main.c" if target == "c" else "main.rs")
    count = len(model.channels.roles)
    text, one = {"c": (C_MAIN, "row[{}]"), "rust": (RUST_MAIN, "number(row, {})")}[target]
    text = text.replace("READINGS", ", ".join(map(one.format, range(count))))
    main.write_text(text.replace("COUNT", str(count)))
    flags = ["-O2", "-std=c99", "-Wall", "-Werror", "-ffp-contract=off"]
    flags = flags if target == "c" else ["--edition", "2021", "-O"]
    subprocess.run([compiler, *flags, main, "-o", tmp_path / "main"], check=True, cwd=tmp_path)
    rng = np.random.default_rng(3)
    pairs = 2048.0 + 1000.0 * rng.normal(size=(5000, count))
    if second is None:
        pairs[0] = math.nan
    else:  # of a sensor, so that the period is not a matter of the last digit
        phase = np.linspace(0.0, 2.0 * math.pi, 5000)
        first = tracks.curve(tracks.direction * periods * phase)
        coarse = other.curve(-second * (phase + math.radians(77.0) / second))
        pairs = np.transpose([*first, *coarse]) + 0.01 * rng.normal(size=pairs.shape)
    ran = subprocess.run(
        [tmp_path / "main"], input=pairs.tobytes(), capture_output=True, check=True
    )
    angle, corrected = np.frombuffer(ran.stdout, np.uint32).reshape(-1, 2).T
    assert angle[0] == 0 or second is not None
    exact = model.channels.angle(*pairs[1:].T) * (2.0**32 / 360.0)
    # The same double, rounded to the unit of the device, and so are the periods of two tracks;
    # halves may fall to either side.
    off = (angle[1:].astype(np.float64) - exact + 2.0**31) % 2.0**32 - 2.0**31
    assert np.abs(off).max() < (0.5001 if second is None else 1.0001)
    step = model.compensator()
    wanted = np.array([step(*row) for row in pairs[1:].tolist()]) / 360.0
    off = (corrected[1:] / 2.0**32 - wanted + 0.5) % 1.0 - 0.5
    assert np.abs(off).max() * 1296000.0 <= made.max_difference_arcsec + 0.01
    if second is not None:
        bent = {"harmonics": ((3, 0.2, 0.1, 0.0),)}
        far = tracks.replace(second=other.replace(**bent), **bent)
        with pytest.raises(ArgumentError, match="of a period by up to"):
            ta.export_model(model.replace(channels=far), target)
