"""The targets' own code, where it is present: folders of their repositories in TRUEANGLE_PEERS.

    TRUEANGLE_PEERS=~/src pytest tests/python/export/test_peers.py

with ``moteus`` (mjbots/moteus), ``klipper`` (Klipper3d/klipper), ``Arduino-FOC-drivers``
(simplefoc) checked out there. Nothing of theirs is part of this project.
"""

import os
import re
import shutil
import subprocess
import sys
import types
from pathlib import Path

import numpy as np
import pytest

import trueangle as ta
from trueangle.export.klipper import calibrated, solved_knots
from trueangle.export.moteus import compensated
from trueangle.export.simplefoc import corrected_float

from .conftest import golden_model, truth
from .test_golden import printer_config


def source(*names):
    folder = os.environ.get("TRUEANGLE_PEERS")
    if folder is None:
        pytest.skip("TRUEANGLE_PEERS names no folder with the targets' repositories")
    path = Path(folder).joinpath(*names)
    if not path.is_file():
        pytest.skip(f"no {path}")
    return path


def compiled(text, folder, values, kind):
    """Output of a C++ program that reads float32 or uint32 and writes float32."""
    if shutil.which("g++") is None:
        pytest.skip("no g++")
    (folder / "p.cpp").write_text(text)
    command = [
        "g++",
        "-O2",
        "-ffp-contract=off",
        "-w",
        "-o",
        str(folder / "p"),
        str(folder / "p.cpp"),
    ]
    subprocess.run(command, check=True)
    done = subprocess.run(
        [str(folder / "p")], input=values.astype(kind).tobytes(), stdout=subprocess.PIPE, check=True
    )
    return np.frombuffer(done.stdout, np.float32)


def body(text, opening):
    """A function from ``opening`` to its closing brace."""
    start = text.index(opening)
    depth, at = 0, text.index("{", start)
    while True:
        depth += {"{": 1, "}": -1}.get(text[at], 0)
        at += 1
        if depth == 0:
            return text[start:at]


def test_moteus(tmp_path):
    text = source("moteus", "fw", "motor_position.h").read_text()
    lerp = body(text, "template <typename Array>\n  static float lerp")
    wrap = body(text, "static float WrapCpr(float value, float cpr) MOTEUS")
    table = ta.export_model(golden_model(), "moteus", bits=14)
    numbers = [float(x) for x in re.findall(r"^conf set \S+ (\S+)$", table.text, re.M)]
    scale, entries = np.float32(numbers[0]), np.array(numbers[1:], np.int8)
    program = f"""
#include <algorithm>
#include <array>
#include <cstdint>
#include <cstdio>
#define MOTEUS_CCM_ATTRIBUTE
struct S {{ {lerp} {wrap} }};
int main() {{
  std::array<int8_t, 256> table = {{{", ".join(map(str, entries))}}};
  float scale = {float(scale)!r}f, cpr = 16384.0f; uint32_t v;
  while (fread(&v, 4, 1, stdin) == 1) {{
    float out = S::WrapCpr(v + S::lerp(table, scale / 127.0f, (float)v / cpr) * cpr, cpr);
    fwrite(&out, 4, 1, stdout);
  }}
}}"""
    counts = np.arange(16384)
    out = compiled(program, tmp_path, counts, np.uint32)
    assert np.array_equal(out, compensated(counts.astype(np.uint32), entries, scale, 16384))
    left = (out / 16384 - truth(counts * (2 * np.pi / 16384)) / (2 * np.pi)) * 1_296_000
    left -= np.rint(left / 1_296_000) * 1_296_000
    print(f"moteus's own code: {np.sqrt(np.mean(left**2)):.3f} rms, {np.max(np.abs(left)):.2f} max")
    assert np.max(np.abs(left)) <= table.max_difference_arcsec * 1.0001


def test_simplefoc(tmp_path):
    text = source("Arduino-FOC-drivers", "src", "encoders", "calibrated", "CalibratedSensor.cpp")
    function = body(text.read_text(), "float CalibratedSensor::getSensorAngle()")
    added = "rawAngle+interpolatedOffset" in function
    variant = "plus-float" if added else "minus-float"
    made = ta.export_model(golden_model(), "simplefoc", variant=variant, bits=18)
    array = made.text.split("{")[1].split("}")[0]
    table = np.array([float(x) for x in array.split(",")], np.float32)[: made.entries]
    cells = ", ".join(f"{float(x):.9e}f" for x in [*table, table[0]])
    program = f"""
#include <cmath>
#include <cstdio>
using std::floor;
#define _2PI 6.28318530718f
struct Sensor {{ float at; float getMechanicalAngle() {{ return at; }} }};
struct CalibratedSensor {{
  Sensor _wrapped;
  int n_lut = {made.entries};
  float calibrationLut[{made.entries + 1}] = {{{cells}}};
  float getSensorAngle();
}};
{function}
int main() {{
  CalibratedSensor s;
  while (fread(&s._wrapped.at, 4, 1, stdin) == 1) {{
    float out = s.getSensorAngle();
    fwrite(&out, 4, 1, stdout);
  }}
}}"""
    raw = (np.arange(1 << 18) * (2 * np.pi / (1 << 18))).astype(np.float32)
    out = compiled(program, tmp_path, raw, np.float32)
    assert np.array_equal(out, corrected_float(raw, table, 1.0 if added else -1.0))
    left = out.astype(float) - truth(raw.astype(float))
    left = (left - np.mean(left)) * (648_000 / np.pi)  # the table's mean was taken out
    print(f"SimpleFOC's own code, {variant}: {np.sqrt(np.mean(left**2)):.3f} rms")
    assert np.sqrt(np.mean(left**2)) <= made.rms_difference_arcsec * 1.02


def test_klipper(tmp_path):
    text = source("klipper", "klippy", "extras", "angle.py").read_text()
    head = text[: text.index("class HelperA1333")].replace("from . import bus, bulk_sensor", "")
    module = types.ModuleType("angle")
    exec(compile(head, "angle.py", "exec"), module.__dict__)
    made = ta.export_model(golden_model(), "klipper", existing=printer_config(tmp_path))
    values = [float(x) for x in made.text.split("calibrate =")[1].split(",")]
    own = module.AngleCalibration.__new__(module.AngleCalibration)
    own.load_calibration(list(values))
    knots, _ = solved_knots(np.array(values))
    assert own.calibration == knots.tolist()
    own.mcu_pos_offset = 0.0
    own.mcu_stepper = types.SimpleNamespace(mcu_to_commanded_position=lambda offset: offset)
    samples = [(0.0, int(count)) for count in range(65536)]
    own.apply_calibration(samples)
    out = np.array([angle for _, angle in samples])
    counts = np.arange(65536)
    assert np.array_equal(out, calibrated(counts, knots))
    left = out / 65536 - truth(counts * (2 * np.pi / 65536)) / (2 * np.pi)
    left = (left - np.mean(left)) * 1_296_000
    print(f"Klipper's own code: {np.sqrt(np.mean(left**2)):.3f} rms")
    assert np.sqrt(np.mean(left**2)) <= made.rms_difference_arcsec * 1.001
    assert sys.modules.get("angle") is None
