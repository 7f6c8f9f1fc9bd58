"""What is stated of a table against what a machine makes of its file: never above, and close."""

import re
import shutil
import subprocess

import numpy as np
import pytest

import trueangle as ta
from trueangle.export.klipper import calibrated, solved_knots
from trueangle.export.moteus import compensated
from trueangle.export.proof import rounded_up
from trueangle.export.simplefoc import corrected_float, corrected_short
from trueangle.export.tinymovr import tinymovr_rectified
from trueangle.model.term import TERMS

SEED = 40_771

#: A bound is at most so much above what was found; inputs evaluated here lie between those of
#: the proof, and a table's worst place is met within a percent.
TIGHT = 1.1

#: Printed numbers are read back in double precision, arcsec.
ROUNDING = 1e-9


def random_model(rng, steep, argument="reference", top=9, count=3, zero=None):
    """Orders up to ``top`` whose slopes add up to ``steep``, and any zero; degrees."""
    orders = np.sort(rng.choice(np.arange(1, top + 1), count, replace=False))
    size = rng.uniform(0.1, 1.0, count) / orders
    size *= np.degrees(steep) / (size @ orders)
    phase = rng.uniform(0.0, 2.0 * np.pi, count)
    shaft = ta.Shaft(
        "output", 1, [int(k) for k in orders], size * np.sin(phase), size * np.cos(phase)
    )
    zero = rng.uniform(-180.0, 180.0) if zero is None else zero
    return ta.HarmonicModel([shaft], constant=zero, period=360.0, argument=argument)


def numbers(made):
    cells = made.text.split("{")[1].split("}")[0]
    return np.array([float(cell) for cell in cells.split(",")])


def everywhere(rng):
    """Readings between those of any grid, and some on it."""
    return np.concatenate([rng.uniform(0.0, 360.0, 60_000), np.arange(0.0, 360.0, 0.125)])


def csv_machine(made, x, rng):
    table = np.loadtxt(made.text.splitlines()[1:], delimiter=",")
    return x - np.interp(x, *table.T)


def simplefoc_machine(made, x, rng):
    raw = np.radians(x).astype(np.float32)
    variant = re.search("variant ([a-z0-9-]+):", made.text)[1]
    table = numbers(made)[: made.entries]
    if variant == "minus-u16":
        out = corrected_short(raw, table.astype(np.uint16))
    else:
        sign = 1.0 if variant == "plus-float" else -1.0
        out = corrected_float(raw, table.astype(np.float32), sign)
    return np.degrees(out.astype(float))


def moteus_machine(made, x, rng):
    scale, *table = (float(n) for n in re.findall(r"^conf set \S+ (\S+)$", made.text, re.M))
    counts = (x / 360.0 * 65536).astype(int)
    table = np.array(table, np.int8)
    return compensated(counts, table, np.float32(scale), 65536) / 65536 * 360.0


def tinymovr_machine(made, x, rng):
    counts = (x / 360.0 * 8192).astype(int)
    return tinymovr_rectified(counts, numbers(made).astype(int), 13) / 8192 * 360.0


def mechaduino_machine(made, x, rng):
    return numbers(made).astype(np.float32).astype(float)[(x / 360.0 * 16384).astype(int)]


def klipper_machine(made, x, rng):
    values = np.array([float(n) for n in made.text.split("calibrate =")[1].split(",")])
    counts = (x / 360.0 * 65536).astype(int)
    return calibrated(counts, solved_knots(values)[0]) / 65536 * 360.0


def existing(folder, model):
    """The list that Klipper would have made of this motor."""
    places = np.arange(200) * 1.8
    reading = (places + model.error(places)) % 360.0 / 360.0 * 65536.0
    reading = np.roll(np.round(reading, 1) % 65536.0, -(int(np.argmin(reading)) & ~3))
    path = folder / "printer.cfg"
    path.write_text("[angle a]\ncalibrate = " + ", ".join(f"{v:.1f}" for v in reading) + "\n")
    return str(path)


AT_READINGS = {
    "csv": (csv_machine, {}, None),
    "csv, few lines": (csv_machine, {"entries": 47}, None),
    "simplefoc, u16": (simplefoc_machine, {"variant": "minus-u16", "bits": 16}, 16),
    "simplefoc, float": (simplefoc_machine, {"variant": "minus-float", "bits": 16}, 16),
    "simplefoc, old": (simplefoc_machine, {"variant": "plus-float", "bits": 16}, 16),
    "moteus": (moteus_machine, {"bits": 16}, 16),
    "tinymovr": (tinymovr_machine, {}, 13),
    "mechaduino": (mechaduino_machine, {}, 14),
    "klipper": (klipper_machine, {}, 16),
}


def wrapped(degrees):
    return degrees - np.round(degrees / 360.0) * 360.0


def check(made, worst_arcsec):
    print(f"stated {made.max_difference_arcsec}, found {worst_arcsec:.9g}")
    assert worst_arcsec <= made.max_difference_arcsec + ROUNDING
    assert made.max_difference_arcsec <= TIGHT * worst_arcsec


@pytest.mark.parametrize("steep", [0.02, 0.45, 0.75])
@pytest.mark.parametrize("name", list(AT_READINGS))
def test_a_table_that_is_looked_up_at_the_reading(name, steep, tmp_path):
    machine, options, bits = AT_READINGS[name]
    target = name.split(",")[0]
    seed = SEED + len(name) + int(100 * steep)
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    model = random_model(rng, steep)
    if target == "klipper":
        options = {**options, "existing": existing(tmp_path, model)}
    made = ta.export_model(model, target, **options)
    x = everywhere(rng) if bits is None else np.arange(1 << bits) * (360.0 / (1 << bits))
    off = wrapped(machine(made, x, rng) - np.asarray(model.correct(x)) - made.zero_deg) * 3600.0
    check(made, float(np.max(np.abs(off))))


def columns(made, variant):
    """Nominal degrees and trims to add of a LinuxCNC or TwinCAT file."""
    if variant == "cnc":
        start, interval = (
            int(re.search(rf"{key} (-?\d+)", made.text)[1]) for key in ("kw_startpos", "interval")
        )
        pos, neg = (
            -np.array([int(n) for n in re.findall(rf"\.{way} (-?\d+)", made.text)]) / 1e4
            for way in ("pos", "neg")
        )
        return (start + interval * np.arange(len(pos))) / 1e4, pos, neg
    rows = []
    for line in made.text.splitlines():
        try:
            rows.append([float(word) for word in line.replace(",", " ").split()[:3]])
        except ValueError:
            if rows:
                break
    table = np.array(rows).T
    if variant == "0":
        table[1:] = table[0] - table[1:]
    return table


@pytest.mark.parametrize("steep", [0.1, 0.9])
@pytest.mark.parametrize(
    ("target", "variant", "entries"),
    [("linuxcnc", "0", 72), ("linuxcnc", "1", 180), ("twincat", "cnc", 120), ("twincat", "nc", 90)],
)
@pytest.mark.parametrize("argument", ["reference", "indicated"])
def test_a_set_point_that_is_moved(target, variant, entries, steep, argument):
    """The joint stands where the encoder reads the set point and its trim: by bisection."""
    seed = SEED + entries + int(100 * steep)
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    model = random_model(rng, steep, argument)
    options = {"type" if target == "linuxcnc" else "variant": variant}
    made = ta.export_model(model, target, entries=entries, **options)
    nominal, *trims = columns(made, variant)
    x = everywhere(rng)
    plain = model.replace(constant=0.0)
    for trim in trims:
        told = x + np.interp(x, nominal, trim)
        if argument == "reference":
            low, high = told - 180.0, told + 180.0
            for _ in range(60):
                middle = (low + high) / 2.0
                beyond = middle + np.asarray(plain.error(middle)) > told
                low, high = np.where(beyond, low, middle), np.where(beyond, middle, high)
            joint = low
        else:
            joint = told - np.asarray(model.error(told + model.constant)) + model.constant
        check(made, float(np.max(np.abs(joint - x))) * 3600.0)


def test_directions_are_bounded_at_the_joint():
    model = random_model(np.random.default_rng(SEED), 0.8).replace(
        terms=(ta.Backlash(0.02), TERMS["direction_dependent_pattern"]((2.0,), (0.01,), (0.004,)))
    )
    made = ta.export_model(model, "linuxcnc", entries=120)
    assert made.left_out == []
    nominal, *trims = columns(made, "1")
    x = np.arange(0.0, 360.0, 0.01)
    plain = model.replace(constant=0.0)
    worst = 0.0
    for trim, way in zip(trims, (1.0, -1.0), strict=True):
        told = x + np.interp(x, nominal, trim)
        joint = plain.correct(told[:: int(way)], direction=way)[:: int(way)]
        worst = max(worst, float(np.max(np.abs(joint - x)[10:-10])) * 3600.0)
    check(made, worst)


def c_program(folder, text, function, arguments, places):
    """What a function of an exported header makes of places in 2^-32 turns."""
    if shutil.which("gcc") is None:
        pytest.skip("no gcc")
    (folder / "table.h").write_text(text)
    (folder / "p.c").write_text(
        '#include <stdio.h>\n#include "table.h"\n'
        "int main(void) { int64_t in, out; while (fread(&in, 8, 1, stdin) == 1) {\n"
        f"  out = (int64_t){function}({arguments}); fwrite(&out, 8, 1, stdout); }}\n"
        "  return table_self_test(); }\n"
    )
    flags = ["-std=c99", "-O2", "-Wall", "-Wextra", "-Wconversion", "-Werror", "-ffp-contract=off"]
    subprocess.run(
        ["gcc", *flags, "-Wno-unused-function", "p.c", "-o", "p"], cwd=folder, check=True
    )
    done = subprocess.run(
        [str(folder / "p")],
        input=places.astype(np.int64).tobytes(),
        capture_output=True,
        check=True,
    )
    return np.frombuffer(done.stdout, np.int64)


def test_headers_of_200_random_models_never_exceed_what_they_print():
    """The zero is rounded to 2^-32 turns, and what is printed is not below what was found."""
    rng = np.random.default_rng(SEED)
    print(f"seed {SEED}")
    bits = 10
    places = np.arange(1 << bits, dtype=np.int64) << (32 - bits)
    from trueangle.export.chain import make_chain
    from trueangle.export.pattern import TurnPattern

    for _ in range(200):
        model = random_model(
            rng, rng.uniform(1e-6, 0.3), str(rng.choice(["reference", "indicated"]))
        )
        method, number = str(rng.choice(["linear", "cubic"])), str(rng.choice(["q15", "q31"]))
        entries = int(rng.choice([64, 512]))
        options = {"method": method, "number": number, "entries": entries}
        made = ta.export_model(model, "c", bits=bits, **options)
        printed = float(re.search(r"at most (\S+) arcsec", made.text)[1])
        assert printed == made.max_difference_arcsec == rounded_up(printed)
        chain = make_chain(TurnPattern(model), method, number, entries)
        device = chain.corrected(places.astype(np.uint32)) / 2.0**32 * 360.0
        off = wrapped(device - np.asarray(model.correct(places / 2.0**32 * 360.0))) * 3600.0
        worst = float(np.max(np.abs(off)))
        assert worst <= printed
        assert printed <= TIGHT * worst + 1e-5


@pytest.mark.parametrize("ratio", [100.5, 50 / 3, 7.25, 0.5, np.pi * 10])
@pytest.mark.parametrize("argument", ["reference", "indicated"])
def test_a_fractional_gear_over_several_turns(ratio, argument, tmp_path):
    """The compiled header, with the turns of the output, against the model."""
    seed = SEED + int(ratio)
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    model = ta.HarmonicModel(
        [
            ta.Shaft("output", 1, [1, 3], [0.02, 0.0], [0.0, 0.01]),
            ta.Shaft("motor", ratio, [1, 2], [0.01, 0.003], [0.0, 0.002]),
        ],
        constant=-400.0,
        period=360.0,
        argument=argument,
    )
    made = ta.export_model(model, "c", tmp_path / "table.h", number="q31", entries=64, bits=20)
    turns = rng.integers(-9, 9, 40_000)
    angle = rng.integers(0, 2**32, 40_000)
    places = turns * 2**32 + angle
    arguments = "(int32_t)(in >> 32), (uint32_t)in"
    found = c_program(tmp_path, made.text, "table_correct_unwrapped", arguments, places)
    truth = np.asarray(model.correct(places / 2.0**32 * 360.0))
    off = (found / 2.0**32 * 360.0 - truth) * 3600.0
    worst = float(np.max(np.abs(off)))
    print(f"stated {made.max_difference_arcsec}, found {worst}")
    assert worst <= made.max_difference_arcsec
    assert made.max_difference_arcsec <= TIGHT * 1.05 * worst  # of some places of all
    assert ("table_correct(" in made.text) == (ratio == int(ratio))


def test_whole_gears_have_the_turns_as_well(joint, tmp_path):
    model = joint.replace(constant=12.5)
    made = ta.export_model(model, "c", tmp_path / "table.h", number="q31", entries=256, bits=32)
    places = np.random.default_rng(SEED).integers(-(2**35), 2**35, 20_000)
    arguments = "(int32_t)(in >> 32), (uint32_t)in"
    found = c_program(tmp_path, made.text, "table_correct_unwrapped", arguments, places)
    truth = np.asarray(model.correct(places / 2.0**32 * 360.0))
    assert np.max(np.abs(found / 2.0**32 * 360.0 - truth)) * 3600.0 <= made.max_difference_arcsec
