"""Terms at run time in exported C and Rust: against the corrector, over random trajectories."""

import os
import re
import subprocess

import numpy as np
import pytest

import trueangle as ta
from trueangle import terms as T
from trueangle.errors import ArgumentError
from trueangle.export.pattern import TurnPattern
from trueangle.export.targets import TARGETS
from trueangle.model.records import FitRecord

from .test_machines import ARM, HERE, STRICT, figures, run, tool
from .trajectories import UNIT, trajectories, trajectory

A = 1.0 / 3600.0
#: What C leaves undefined ends the program.
UNDEFINED = ("-fsanitize=undefined,float-cast-overflow", "-fno-sanitize-recover=all")
#: Readings of a random trajectory against the corrector.
SAMPLES = 10_000_000 if os.environ.get("TRUEANGLE_NIGHTLY") else 20_000
LINES = {"orders": (1.0, 3.0), "cosine": (2 * A, 0.0), "sine": (A, 3 * A)}
FIT = FitRecord(
    900, 1, (0.0, 360.0), 0.001,
    signals=(("velocity", -300.0, 300.0), ("temperature", 10.0, 40.0), ("torque", -20.0, 20.0),
             ("current", -5.0, 5.0)),
)  # fmt: skip
OUTPUT = ta.Shaft("output", 1, (1, 2, 5), (0.3, 0.0, 0.01), (0.0, 0.1, 0.02))
MOTOR = ta.Shaft("motor", 100, (1, 2), (0.008, 0.0), (0.0, 0.003))
FRACTION = ta.Shaft("motor", 100.5, (1, 2), (0.004, 0.0), (0.0, 0.003))
SPRING = T.PreslidingHysteresis(30 * A, 0.5, 0.3)

#: Shafts, argument and terms of each.
CASES = {
    "play": ((), "reference", (T.Backlash(20 * A),)),
    "play by velocity": ((OUTPUT,), "reference", (T.Backlash(20 * A, **LINES), T.Latency(0.002))),
    "negative play": ((), "reference", (T.DirectionalPattern(**LINES),)),
    "springs": ((), "reference", (SPRING, T.PreslidingHysteresis(10 * A, 3.0), T.Backlash(5 * A))),
    "springs by velocity": ((OUTPUT,), "indicated", (SPRING, T.Latency(0.001))),
    "low-pass": ((OUTPUT, MOTOR), "reference", (T.FilterLag(30.0), T.Backlash(5 * A))),
    "damped, of a fraction": ((OUTPUT, FRACTION), "reference", (T.FilterLag(60.0, 0.5),)),
    "heat": ((OUTPUT,), "reference", (T.ThermalDrift(2 * A, pattern_per_K=1e-3),)),
    "loads": ((), "reference", (
        T.TorsionalCompliance(3 * A), T.StiffeningCompliance(2 * A, 0.01 * A, A, 5.0),
        T.LoadDependentGearError((100.5,), (A,), (0.5 * A,)), T.CurrentCoupling(A))),
    "gravity": ((), "indicated", (T.StiffeningCompliance(2 * A, gravity=30.0),)),
    "a place and a ratio": ((), "reference", (
        T.LocalDefect(100.0, 2.0, 60 * A), T.ScaleError(1e-4, -1000.0, 700.0))),
    "all": ((OUTPUT, MOTOR), "reference", (
        T.Backlash(5 * A), SPRING, T.Latency(0.002), T.FilterLag(100.0), T.ThermalDrift(2 * A),
        T.TorsionalCompliance(3 * A), T.LocalDefect(100.0, 2.0, 60 * A))),
}  # fmt: skip


def model_of(case):
    shafts, argument, terms = CASES[case]
    return ta.HarmonicModel(
        shafts, constant=0.7, period=360.0, argument=argument, terms=terms, fit=FIT
    )


def exported(model, target, path):
    return ta.export_model(model, target, path, bits=12, method="cubic", number="q31", entries=512)


def wanted(corrector, rows, fields):
    """The corrector's angles, of the same readings and signals."""
    given = {name: rows[name].astype(np.float64) for name in fields}
    if "velocity" in given:
        given["velocity"] *= 360.0
    return corrector(rows["place"] * UNIT, **given)


def fields_of(model):
    options = TARGETS["c"].checked({})
    return TARGETS["c"].at_run_time(TurnPattern(model), options).signals


def walk_in_c(model, folder, flags=()):
    """What was exported, and the program that walks through rows with it."""
    tool("gcc")
    made = exported(model, "c", folder / "j.h")
    setting = " ".join(f"signals.{name} = row.{name};" for name in fields_of(model))
    program = folder / "walk"
    run(["gcc", *STRICT, *flags, f"-I{folder}", '-DHEADER="j.h"', "-DSTATE=j_state",
         "-DSIGNALS=j_signals", "-DSTEP=j_step_unwrapped",
         f"-DSET={setting or 'signals.none = 0;'}", HERE / "walk.c", "-o", program])  # fmt: skip
    return made, program


def walked_in_c(model, rows, folder, flags=()):
    made, program = walk_in_c(model, folder, flags)
    done = subprocess.run([program], input=rows.tobytes(), capture_output=True, check=True)
    return made, np.frombuffer(done.stdout, "<i8") * UNIT


def walked_in_rust(model, rows, folder, flags=()):
    tool("rustc")
    made = exported(model, "rust", folder / "j.rs")
    places = {"velocity": 8, "temperature": 12, "torque": 16, "current": 20}
    setting = ", ".join(f"{name}: number({places[name]})" for name in fields_of(model))
    (folder / "walk.rs").write_text(
        "#[allow(dead_code)]\nmod j;\nuse std::io::{Read, Write};\nfn main() {\n"
        "    let (mut all, mut out) = (Vec::new(), Vec::new());\n"
        "    std::io::stdin().read_to_end(&mut all).unwrap();\n"
        "    let mut state = j::State::default();\n    for row in all.chunks(32) {\n"
        "        let place = i64::from_le_bytes(row[..8].try_into().unwrap());\n"
        "        let number = |i: usize| f32::from_le_bytes(row[i..i + 4].try_into().unwrap());\n"
        f"        let signals = j::Signals {{ {setting} }};\n        let _ = number(8);\n"
        "        let turns = (place >> 32) as i32;\n"
        "        let found = j::step_unwrapped(&mut state, turns, place as u32, &signals);\n"
        "        out.extend(found.to_le_bytes());\n    }\n"
        "    std::io::stdout().write_all(&out).unwrap();\n}\n"
    )
    run(["rustc", "--edition", "2021", "-O", *flags, "-D", "warnings", folder / "walk.rs", "-o",
         folder / "walk"])  # fmt: skip
    (folder / "lib.rs").write_text("#![no_std]\npub mod j;\n")
    run(["rustc", "--edition", "2021", "--crate-type", "rlib", folder / "lib.rs", "-o",
         folder / "lib.rlib"])  # fmt: skip
    done = subprocess.run([folder / "walk"], input=rows.tobytes(), capture_output=True, check=True)
    return made, np.frombuffer(done.stdout, "<i8") * UNIT


@pytest.mark.parametrize("case", list(CASES))
def test_c_against_the_corrector(case, tmp_path):
    seed = int(np.random.SeedSequence().generate_state(1)[0])
    print(f"seed {seed}")
    model = model_of(case)
    made, program = walk_in_c(model, tmp_path)
    readings, angles = tmp_path / "readings", tmp_path / "angles"
    with readings.open("wb") as file:
        for rows in trajectories(seed, SAMPLES):
            file.write(rows.tobytes())
    with readings.open("rb") as into, angles.open("wb") as out:
        subprocess.run([program], stdin=into, stdout=out, check=True)
    corrector, plain = model.corrector(), model.replace(terms=(), fit=None)
    off = without = 0.0
    with angles.open("rb") as file:
        for rows in trajectories(seed, SAMPLES):
            found = np.frombuffer(file.read(8 * len(rows)), "<i8") * UNIT
            assert len(found) == len(rows)
            away = found - wanted(corrector, rows, fields_of(model))
            off = max(off, np.max(np.abs(away)) * 3600.0)
            without = max(without, np.max(np.abs(plain.correct(rows["place"] * UNIT) - found)))
    print(f"{case}: {off:.6f} of {made.max_difference_total_arcsec} arcsec")
    assert off <= made.max_difference_total_arcsec
    assert made.left_out == []
    if made.max_difference_arcsec < 1e-3:
        # Nothing but the terms: what their float arithmetic adds, in units of 2^-32 turns.
        assert off / 3600.0 / UNIT < 5.0
    assert without * 3600.0 > 4.0 * off + 1.0  # the terms are there


@pytest.mark.parametrize("case", ["all", "springs", "damped, of a fraction", "gravity", "loads",
                                  "a place and a ratio"])  # fmt: skip
def test_rust_makes_the_same_as_c(case, tmp_path):
    model, rows = model_of(case), trajectory(7, 5_000)
    (tmp_path / "rust").mkdir()
    _, found = walked_in_rust(model, rows, tmp_path / "rust")
    _, same = walked_in_c(model, rows, tmp_path, ("-ffp-contract=off",))
    assert np.max(np.abs(found - same)) <= 2.0 * UNIT


#: Values that no sensor measures, one of them in each signal that a model needs.
FAULTS = np.array([np.nan, np.inf, -np.inf, 1e38, 3e9, -3e9, -1e38], np.float32)


def with_faults(model, count):
    """A trajectory with a fault in every seventh row, and the same with the last good values."""
    rows = trajectory(13, count)
    good = rows.copy()
    for i in range(7, count, 7):
        for name in fields_of(model):
            rows[name][i], good[name][i] = FAULTS[i // 7 % len(FAULTS)], good[name][i - 1]
    return rows, good


@pytest.mark.parametrize("walked", ["c", "rust"])
@pytest.mark.parametrize("case", ["play by velocity", "heat", "loads", "gravity", "all"])
def test_a_signal_that_is_no_measurement_holds_its_last_good_value(case, walked, tmp_path):
    model = model_of(case)
    rows, good = with_faults(model, 2_000)
    if walked == "c":
        made, found = walked_in_c(model, rows, tmp_path, UNDEFINED)
    else:
        made, found = walked_in_rust(model, rows, tmp_path, ("-C", "overflow-checks=on"))
    off = np.abs(found - wanted(model.corrector(), good, fields_of(model))) * 3600.0
    assert np.max(off) <= made.max_difference_total_arcsec
    comment = re.sub(r"[\s/!*]+", " ", made.text)
    assert "counts as its last good value, 0 before the first" in comment


@pytest.mark.parametrize("walked", ["c", "rust"])
@pytest.mark.parametrize("case", ["springs by velocity", "a place and a ratio", "all"])
def test_no_count_of_turns_overflows(case, walked, tmp_path):
    """Of readings at either end; from 2^29 turns on they are held."""
    model = model_of(case).replace(constant=-200.0)
    rows = trajectory(17, 600)
    ends = np.array([-(2**31), 2**31 - 1, -(2**29), 2**29, 0])[np.arange(600) // 40 % 5]
    rows["place"] = ends * 2**32 + rows["place"] % 2**32
    if walked == "c":
        _, found = walked_in_c(model, rows, tmp_path, UNDEFINED)
    else:
        _, found = walked_in_rust(model, rows, tmp_path, ("-C", "overflow-checks=on"))
    turns = np.clip(ends, -(2**29), 2**29)
    assert np.max(np.abs(np.round(found / 360.0) - turns)) <= 2.0


def test_a_state_without_advance_is_found(tmp_path):
    """The fault planted: springs that forget where the travel began."""
    model, rows = model_of("springs"), trajectory(11, 5_000)
    made, found = walked_in_c(model, rows, tmp_path)
    text = (tmp_path / "j.h").read_text()
    planted = text.replace("next.place = state->farthest;", "next.place = 0;")
    assert planted != text
    (tmp_path / "j.h").write_text(planted)
    program = tmp_path / "planted"
    run(["gcc", "-O2", f"-I{tmp_path}", '-DHEADER="j.h"', "-DSTATE=j_state",
         "-DSIGNALS=j_signals", "-DSTEP=j_step_unwrapped", "-DSET=signals.none = 0;",
         HERE / "walk.c", "-o", program])  # fmt: skip
    done = subprocess.run([program], input=rows.tobytes(), capture_output=True, check=True)
    off = np.abs(np.frombuffer(done.stdout, "<i8") * UNIT - found)
    assert np.max(off) * 3600.0 > 10.0 * made.max_difference_total_arcsec


def test_direction_as_a_signal(tmp_path):
    model, rows = model_of("negative play"), trajectory(5, 5_000)
    ta.export_model(model, "c", tmp_path / "j.h", bits=12, direction="signal")
    text = (tmp_path / "j.h").read_text()
    assert "int8_t direction; /* of travel: 1, -1, 0 as before */" in text
    program = tmp_path / "walk"
    tool("gcc")
    run(["gcc", *STRICT, f"-I{tmp_path}", '-DHEADER="j.h"', "-DSTATE=j_state",
         "-DSIGNALS=j_signals", "-DSTEP=j_step_unwrapped",
         "-DSET=signals.direction = (int8_t)row.direction;", HERE / "walk.c", "-o",
         program])  # fmt: skip
    done = subprocess.run([program], input=rows.tobytes(), capture_output=True, check=True)
    found = np.frombuffer(done.stdout, "<i8") * UNIT
    assert np.max(np.abs(found - wanted(model.corrector(), rows, ["direction"]))) / UNIT < 5.0
    with pytest.raises(ArgumentError, match="does not show in the angle"):
        ta.export_model(model, "c", bits=12, direction="angle")


def test_what_is_read_back_names_the_terms_that_are_not(tmp_path):
    model = model_of("all")
    for target, ending in (("c", ".h"), ("rust", ".rs")):
        exported(model, target, tmp_path / f"j{ending}")
        back = ta.import_model(tmp_path / f"j{ending}", target)
        assert back.terms == ()
        assert "backlash, presliding_hysteresis, latency, filter_lag" in back.fit.note
        assert "is not in the model" in back.fit.note


def test_terms_too_steep_for_a_bound():
    fit = FitRecord(900, 1, (0.0, 360.0), 0.001, signals=(("torque", -1e6, 1e6),))
    steep = T.LoadDependentGearError((100.0,), (A,), (0.0,))
    model = ta.HarmonicModel([OUTPUT], period=360.0, terms=(steep,), fit=fit)
    with pytest.raises(ArgumentError, match="as steep as"):
        ta.export_model(model, "c", bits=12)


#: A step of a play, a latency and a warm zero; and of springs.
STEPS = {
    "linear": (T.Backlash(20 * A), T.Latency(0.002), T.ThermalDrift(2 * A)),
    "springs": (SPRING, T.Latency(0.002)),
}


def walk_header(name, folder):
    """A header whose ``walk_correct`` steps with signals made of the angle."""
    model = ta.HarmonicModel([OUTPUT], constant=0.7, period=360.0, terms=STEPS[name], fit=FIT)
    ta.export_model(model, "c", folder / "j.h", bits=12, method="linear", number="q31", entries=128)
    setting = "signals.velocity = (float)(int16_t)(angle >> 3) * 1e-4f;"
    if "temperature" in fields_of(model):
        setting += " signals.temperature = (float)(uint8_t)angle;"
    (folder / "walk.h").write_text(
        '#include "j.h"\nstatic j_state walk_state;\n'
        "static inline uint32_t walk_correct(uint32_t angle)\n{\n    j_signals signals;\n"
        f"    {setting}\n    return j_step(&walk_state, angle, &signals);\n}}\n"
        "static inline int32_t walk_cost(uint32_t angle)\n{\n"
        "    return (int32_t)walk_correct(angle);\n}\n"
    )
    return ['-DHEADER="walk.h"', "-DFUNCTION=walk_cost", "-DCORRECT=walk_correct",
            "-DTEST=j_self_test", "-DCOUNT=256", "-DTIMES=50"]  # fmt: skip


@pytest.mark.parametrize("name", list(STEPS))
def test_the_same_bits_on_microcontrollers(name, tmp_path):
    tool("gcc", "arm-none-eabi-gcc", "qemu-system-arm", "avr-gcc", "simavr")
    defines = walk_header(name, tmp_path)
    host = tmp_path / "host"
    run(["gcc", *STRICT, "-ffp-contract=off", f"-I{tmp_path}", *defines, HERE / "harness.c",
         HERE / "host.c", "-o", host])  # fmt: skip
    expected = figures(run([host]))
    assert expected["self"] == 0
    for cpu, (machine, flags, per_tick) in ARM.items():
        build = ["arm-none-eabi-gcc", f"-mcpu={cpu}", "-mthumb", *flags, *STRICT,
                 "-ffp-contract=off"]  # fmt: skip
        run([*build, "-c", f"-I{tmp_path}", *defines, HERE / "harness.c", "-o",
             tmp_path / "harness.o"])  # fmt: skip
        run([*build, "-Wno-pedantic", "-ffreestanding", "-nostdlib", "-T", HERE / "arm.ld",
             HERE / "arm.c", tmp_path / "harness.o", "-lgcc",
             "-o", tmp_path / "arm.elf"])  # fmt: skip
        found = figures(run(["timeout", "120", "qemu-system-arm", "-M", machine, "-nographic",
                             "-semihosting", "-icount", "shift=3", "-kernel",
                             tmp_path / "arm.elf"]))  # fmt: skip
        assert found["hash"] == expected["hash"]
        cost = (found["call"] - found["loop"]) * per_tick / 50
        print(f"{cpu} {name}: {cost:.0f} instructions")
    run(["avr-gcc", "-mmcu=atmega328p", *STRICT, "-Os", "-DF_CPU=16000000UL", f"-I{tmp_path}",
         "-ffp-contract=off", *defines, HERE / "harness.c", HERE / "avr.c", "-o",
         tmp_path / "avr.elf"])  # fmt: skip
    found = figures(run(["timeout", "120", "simavr", "-m", "atmega328p", "-f", "16000000",
                         tmp_path / "avr.elf"]))  # fmt: skip
    assert found["hash"] == expected["hash"]
    print(f"avr {name}: {(found['call'] - found['loop']) / 50:.0f} cycles")
