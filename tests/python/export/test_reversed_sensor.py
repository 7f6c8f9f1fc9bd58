"""Every target of a sensor that counts the other way: by its own arithmetic, of what is read."""

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.export import TARGETS
from trueangle.export.pattern import TurnPattern
from trueangle.model.records import FitRecord

from .test_bounds import AT_READINGS, c_program, existing, random_model, wrapped
from .test_targets import ENDINGS

SEED = 60_211
NOTE = (
    "the sensor counts the other way than the reference: readings, corrected angles, velocity and "
    "direction count as the sensor does"
)
OPTIONS = {
    "tinymovr": {"bits": 14, "entries": 256},
    "pmac": {"counts_per_turn": 1 << 20},
    "admt4000": {},
}


def left(found, wanted):
    """Degrees rms by which angles differ, their zero apart."""
    off = wrapped(found - wanted - (found - wanted)[0])
    return float(np.std(off))


def reversed_model(folder, steep=0.03, top=8):
    """A model of the angle that the joint takes minus its sensor's reading to be."""
    print(f"seed {SEED}")
    model = random_model(np.random.default_rng(SEED), steep, top=top).replace(indicated_sign=-1)
    model.save(folder / "m.json")
    return model


def table_of(target, model, folder, **options):
    """What is exported from the file of the model."""
    if target == "klipper":  # its own list is that of the sensor's readings
        options["existing"] = existing(folder, model.in_sensor_sense())
    return ta.export_model(folder / "m.json", target, folder / f"t{ENDINGS[target]}", **options)


@pytest.mark.parametrize("name", list(AT_READINGS))
def test_the_device_corrects_what_its_sensor_reads(name, tmp_path):
    machine, options, bits = AT_READINGS[name]
    model = reversed_model(tmp_path)
    made = table_of(name.split(",")[0], model, tmp_path, **options)
    rng = np.random.default_rng(SEED + 1)
    theta = np.sort(rng.uniform(0.0, 360.0, 4000))
    read = -(theta + np.asarray(model.error(theta))) % 360.0
    if bits is not None:
        read = np.floor(read * (1 << bits) / 360.0) * (360.0 / (1 << bits))
    before, after = left(read, -theta), left(machine(made, read, rng), -theta)
    assert after < 0.1 * before
    assert NOTE in made.notes


#: Targets of constants of channels, which hold their sense.
OF_CHANNELS = {"vesc", "lerobot", "ax2000", "ax5000"}


@pytest.mark.parametrize("target", [name for name in TARGETS if name not in OF_CHANNELS])
def test_a_table_read_back_takes_the_same_off_as_correct(target, tmp_path):
    """By each target's own reading, rounding and lines included; the model file of the import."""
    model = reversed_model(tmp_path, top=4 if target == "admt4000" else 8)
    options = OPTIONS.get(target, {})
    made = table_of(target, model, tmp_path, **options)
    asked = {k: v for k, v in options.items() if k != "entries"}
    back = ta.import_model(tmp_path / f"t{ENDINGS[target]}", target, **asked)
    theta = np.linspace(0.0, 360.0, 3601)
    read = -(theta + np.asarray(model.error(theta)))
    if TARGETS[target].argument == "reference" and target != "mujoco":
        read = read + model.constant  # the zero is set before such a table is used
    device = ta.correct(read, back)
    assert left(device, -theta) < 0.1 * left(read, -theta)
    assert (NOTE in made.notes) == (target != "mujoco")  # whose angle is the joint's own
    result = ta.compare(model, back)
    assert result.max_abs_arcsec < 1.1 * made.max_difference_arcsec + 1e-6


def test_a_compiled_header_takes_and_gives_what_the_sensor_counts(tmp_path):
    model = reversed_model(tmp_path, steep=0.2)
    made = table_of("c", model, tmp_path, bits=12)
    theta = np.linspace(0.0, 359.0, 2000)
    read = -(theta + np.asarray(model.error(theta)))
    places = np.floor(read / 360.0 * 2.0**32).astype(np.int64) % 2**32
    text = made.text.replace("t_", "table_")
    out = c_program(tmp_path, text, "table_correct", "(uint32_t)in", places)
    off = wrapped(out / 2.0**32 * 360.0 + theta)
    assert float(np.max(np.abs(off))) * 3600.0 <= made.max_difference_arcsec + 1e-3


@pytest.mark.parametrize("argument", ["reference", "indicated"])
def test_a_pattern_in_the_sensors_sense_has_the_record_of_its_sense(argument):
    model = random_model(np.random.default_rng(SEED), 0.3, argument)
    record = FitRecord(
        40, 2, (10.0, 200.0), 0.1, offsets=(0.5, 0.7),
        signals=(("velocity", -3.0, 9.0), ("torque", -1.0, 2.0)),
    )  # fmt: skip
    root = np.random.default_rng(SEED).normal(size=(7, 7)) * 1e-3
    model = model.replace(indicated_sign=-1, fit=record, covariance=root @ root.T)
    own = model.in_sensor_sense()
    assert own.indicated_sign == 1
    assert own.in_sensor_sense() is own
    assert own.partial_span == (-200.0, -10.0)
    assert own.fit.offsets == (-0.5, -0.7)
    assert own.fit.signals == (("velocity", -9.0, 3.0), ("torque", -1.0, 2.0))
    x = np.linspace(40.0, 170.0, 77)
    np.testing.assert_allclose(own.band(-x), model.band(x), rtol=1e-9)
    np.testing.assert_allclose(own.error(-x), -model.error(x), atol=1e-12)
    y = x + model.constant
    np.testing.assert_allclose(own.correct(-y), -model.correct(y), atol=1e-12)
    assert TurnPattern(own).zero == -TurnPattern(model).zero


@pytest.mark.parametrize("typed", ["enc", "-enc"])
def test_from_the_readings_to_the_firmware(typed, tmp_path, capsys, monkeypatch):
    """A 14-bit sensor against a stepper's steps; whichever way `correct` is told its column."""
    monkeypatch.chdir(tmp_path)
    rng = np.random.default_rng(SEED)
    theta = np.concatenate([np.arange(0.0, 360.0, 0.72), np.arange(360.0, 0.0, -0.72)])
    error = 0.9 * np.cos(np.radians(theta) + 0.4) + 0.3 * np.sin(np.radians(3 * theta) - 1.0)
    counts = np.floor(-(theta + error + 77.0 + rng.normal(0.0, 0.02, theta.size)) / 360 * 16384)
    rows = zip(theta / 0.9, counts % 16384, strict=True)
    text = "\n".join(["step,enc", *(f"{s:.6f},{n:.0f}" for s, n in rows)])
    (tmp_path / "steps.csv").write_text(text + "\n")
    columns = ["--signal", f"indicated={typed}:count", "--counts-per-turn", "16384"]
    fitted = ["--signal", "reference=step:count", "--counts-per-turn-reference", "400"]
    minus = ["--signal", "indicated=-enc:count", "--counts-per-turn", "16384"]
    assert main(["fit", "steps.csv", *fitted, *minus, "-o", "m.json"]) == 0
    assert "  indicated  minus what the sensor reads\n" in capsys.readouterr().out
    assert ta.load_model("m.json").indicated_sign == -1
    assert "reversed sensor" in repr(ta.load_model("m.json"))
    assert main(["correct", "steps.csv", *columns, "-m", "m.json", "-o", "out.csv"]) == 0
    capsys.readouterr()
    assert main(["export", "m.json", "--to", "csv", "-o", "table.csv"]) == 0
    assert NOTE in " ".join(capsys.readouterr().out.split())
    corrected = np.loadtxt("out.csv", delimiter=",", skiprows=1)[:, -1] * 360.0 / 16384
    grid = np.loadtxt("table.csv", delimiter=",", skiprows=1)
    read = (counts % 16384) * 360.0 / 16384
    device = read - np.interp(read, *grid.T)
    assert left(read, -theta) > 0.6
    assert left(device, -theta) < 0.03
    assert left(corrected, -theta) < 0.03
