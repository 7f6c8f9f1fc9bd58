"""Functional mock-up units, validated and simulated by FMPy, against the model."""

import os
import shutil
import xml.etree.ElementTree as ElementTree
import zipfile

import numpy as np
import pytest

import trueangle as ta
from trueangle import terms as T
from trueangle.cli import main
from trueangle.errors import FileError
from trueangle.export.fmu import variables_of
from trueangle.simulation import RunDesign

fmpy = pytest.importorskip("fmpy")
from fmpy.validation import validate_fmu  # noqa: E402

#: Radians by which a unit may differ from its model.
WITHIN = 1e-9
A = np.pi / 648_000.0
R = np.pi / 180.0
STEP = 0.002
COUNT = 1500
#: Random inputs of a unit that is stepped by hand.
INPUTS = 1_000_000 if os.environ.get("TRUEANGLE_NIGHTLY") else 20_000
OUTPUT = ta.Shaft("output", 1, (1, 2, 5), (0.3 * R, 0.0, 0.01 * R), (0.0, 0.1 * R, 0.02 * R))
MOTOR = ta.Shaft("motor", 100.5, (1, 2), (0.008 * R, 0.0), (0.0, 0.003 * R))
TERMS = {
    "harmonics alone": (),
    "play": (T.Backlash(20 * A),),
    "all": (
        T.Backlash(5 * A, (1.0, 3.0), (2 * A, 0.0), (A, 3 * A)),
        T.PreslidingHysteresis(30 * A, 0.5 * R, 0.3), T.Latency(0.002), T.FilterLag(100.0, 0.5),
        T.ThermalDrift(2 * A, 1e-3), T.TorsionalCompliance(3 * A), T.LocalDefect(1.0, 0.03, 60 * A),
        T.StiffeningCompliance(A, 0.01 * A, A, 4.0, gravity=0.5), T.CurrentCoupling(A),
        T.Curve("temperature", (18.0, 21.0, 25.0), (-30 * A, 9 * A, 20 * A)),
    ),
}  # fmt: skip


def motion(seed, count=COUNT):
    """Angles of a joint that turns back and rests, and its signals in SI units."""
    rng = np.random.default_rng(seed)
    legs = count // 50
    velocity = np.repeat(rng.normal(0.0, 1.0, legs) * (rng.random(legs) < 0.8), 50)
    return {
        "time": np.arange(count) * STEP,
        "angle": np.cumsum(velocity * STEP) + 3.0,
        "velocity": velocity,
        "torque": rng.normal(0.0, 5.0, count),
        "temperature": 293.15 + rng.normal(0.0, 5.0, count),
        "current": rng.normal(0.0, 1.0, count),
    }


def simulated(path, into, out, moved, kind):
    names = [v.name for v in fmpy.read_model_description(str(path)).modelVariables]
    columns = ["time", into, *(k for k in moved if k not in ("time", into) and k in names)]
    given = np.zeros(COUNT, [(name, "f8") for name in columns])
    for name in given.dtype.names:
        given[name] = moved["angle" if name == into and name not in moved else name]
    found = fmpy.simulate_fmu(
        str(path), stop_time=moved["time"][-1], output_interval=STEP, step_size=STEP, input=given,
        output=[out], fmi_type=kind, solver="Euler",
    )[out]  # fmt: skip
    # A step of a co-simulation gives the output of the input at its begin.
    return found[1:] if kind == "CoSimulation" else found


def signals_of(model, moved):
    given = {name: moved[name] for name in model.signals if name in moved}
    if "direction" in model.signals:
        given["velocity"] = moved["velocity"]
    if "temperature" in given:
        given["temperature"] = given["temperature"] - 273.15
    return given


@pytest.fixture(autouse=True)
def _compiler():
    if shutil.which("cc") is None:
        pytest.skip("not installed: cc")


@pytest.mark.parametrize("argument", ["reference", "indicated"])
@pytest.mark.parametrize("fmi", ["3", "2"])
@pytest.mark.parametrize("name", list(TERMS))
def test_a_correction_is_that_of_the_model(name, fmi, argument, tmp_path):
    seed = int(np.random.SeedSequence().generate_state(1)[0])
    print(f"seed {seed}")
    model = ta.HarmonicModel((OUTPUT, MOTOR), 0.01, argument=argument, terms=TERMS[name])
    path = tmp_path / "joint.fmu"
    made = ta.export_model(model, "fmu", path, fmi=fmi)
    assert made.max_difference_total_arcsec == pytest.approx(WITHIN / A, rel=0.01)
    assert validate_fmu(str(path)) == []
    moved = motion(seed)
    want = model.corrector()(moved["angle"], **signals_of(model, moved))
    for kind in ("CoSimulation", "ModelExchange"):
        found = simulated(path, "indicated", "true_angle", moved, kind)
        worst = np.max(np.abs(found - want[: len(found)]))
        print(f"{kind}: {worst}")
        assert worst <= WITHIN
    assert np.max(np.abs(want - moved["angle"])) > 1e-3
    assert ta.import_model(path, "fmu") == model


@pytest.mark.parametrize("fmi", ["3", "2"])
@pytest.mark.parametrize("name", list(TERMS))
def test_a_sensor_says_what_the_model_does(name, fmi, tmp_path):
    seed = int(np.random.SeedSequence().generate_state(1)[0])
    print(f"seed {seed}")
    model = ta.HarmonicModel((OUTPUT, MOTOR), 0.01, terms=TERMS[name])
    path = tmp_path / "joint.fmu"
    ta.export_model(model, "fmu", path, fmi=fmi, variant="sensor")
    assert validate_fmu(str(path)) == []
    moved = motion(seed)
    want = moved["angle"] + model.error(moved["angle"], **signals_of(model, moved))
    found = simulated(path, "true_angle", "indicated", moved, "CoSimulation")
    worst = np.max(np.abs(found - want[: len(found)]))
    print(worst)
    assert worst <= WITHIN


@pytest.mark.parametrize(
    ("name", "fmi", "direction", "periods", "second"),
    [
        *[("channels alone", "3", 1, 1, 0), ("harmonics alone", "2", -1, 3, 0)],
        *[("all", "3", -1, 1, 0), ("channels alone", "2", -1, 16, 15)],
    ],
)
def test_a_correction_of_two_channels_takes_sine_and_cosine(
    name, fmi, direction, periods, second, tmp_path
):
    """What it decodes and corrects is a step's angle; at its starts that of the phase zero."""
    seed = int(np.random.SeedSequence().generate_state(1)[0])
    print(f"seed {seed}")
    channels = ta.Channels(
        offset_sine=2100.0, offset_cosine=1980.0, amplitude=905.0, gain_ratio=1.07, phase_deg=-4.0,
        direction=direction, periods_per_turn=periods,
    )  # fmt: skip
    other = ta.Channels(offset_sine=0.1, periods_per_turn=second or 1)
    if second:
        channels = channels.replace(second=other, second_zero_deg=100.0)
    shafts = () if name == "channels alone" else (OUTPUT,)
    model = ta.HarmonicModel(shafts, 0.01, terms=TERMS.get(name, ()), channels=channels)
    path = tmp_path / "joint.fmu"
    ta.export_model(model, "fmu", path, fmi=fmi)
    assert validate_fmu(str(path)) == []
    moved = motion(seed)
    readings = [*channels.curve(moved["angle"] * periods * direction)]
    if second:
        readings += other.curve(moved["angle"] * second + np.radians(100.0))
    want = model.corrector()(channels.angle(*readings), **signals_of(model, moved))
    if not model.terms:
        step = model.compensator()
        assert [step(*row) for row in np.transpose(readings)[:9].tolist()] == [*want[:9]]
    given = dict(zip(channels.roles, readings, strict=True))
    given |= {k: v for k, v in moved.items() if k != "angle"}
    for kind in ("CoSimulation", "ModelExchange"):
        found = simulated(path, "sine", "true_angle", given, kind)
        worst = np.max(np.abs(found - want[: len(found)]))
        print(f"{kind}: {worst}")
        assert worst <= WITHIN
    names = [v.name for v in variables_of(model, False)]
    assert tuple(names[1 : 1 + len(readings)]) == channels.roles
    assert "indicated" not in names
    assert ta.import_model(path, "fmu") == model


@pytest.mark.parametrize("sensor", [False, True])
def test_what_is_not_told_is_at_rest_at_the_temperature_that_terms_count_from(sensor):
    """Starts in SI units, as the model takes them: all terms but the pattern are nothing then."""
    model = ta.HarmonicModel((OUTPUT, MOTOR), 0.01, terms=TERMS["all"])
    starts = {v.name: (v.start, v.unit) for v in variables_of(model, sensor)}
    rest = {"velocity": "rad/s", "torque": "N.m", "current": "A"}
    assert {name: starts[name] for name in rest} == {name: (0.0, u) for name, u in rest.items()}
    kelvin, unit = starts["temperature"]
    assert unit == "K"
    assert kelvin - 273.15 == pytest.approx(T.ThermalDrift().reference_C)
    assert kelvin - 273.15 == pytest.approx(RunDesign().temperature_C)


def stepped(path, moved):
    """Outputs of a unit that is given inputs one by one."""
    description = fmpy.read_model_description(str(path))
    unit = fmpy.instantiate_fmu(fmpy.extract(str(path)), description, "CoSimulation")
    inputs = [v for v in description.modelVariables if v.causality == "input"]
    (out,) = (v.valueReference for v in description.modelVariables if v.causality == "output")
    columns = [moved[v.name if v.name in moved else "angle"].astype(np.float64) for v in inputs]
    references = [v.valueReference for v in inputs]
    unit.enterInitializationMode()
    unit.exitInitializationMode()
    found = np.empty(len(moved["angle"]))
    for i, row in enumerate(np.column_stack(columns).tolist()):
        unit.setFloat64(references, row)
        unit.doStep(i * STEP, STEP)
        (found[i],) = unit.getFloat64([out])
    unit.terminate()
    unit.freeInstance()
    return found


def wanted(model, variant, moved):
    angle, signals = moved["angle"], signals_of(model, moved)
    if variant == "correction":
        return model.corrector()(angle, **signals)
    return angle + model.error(angle, **signals)


@pytest.mark.parametrize("variant", ["correction", "sensor"])
@pytest.mark.parametrize("name", list(TERMS))
def test_random_inputs(name, variant, tmp_path):
    seed = int(np.random.SeedSequence().generate_state(1)[0])
    print(f"seed {seed}")
    model = ta.HarmonicModel((OUTPUT, MOTOR), 0.01, terms=TERMS[name])
    path = tmp_path / "joint.fmu"
    ta.export_model(model, "fmu", path, variant=variant)
    moved = motion(seed, INPUTS)
    worst = np.max(np.abs(stepped(path, moved) - wanted(model, variant, moved)))
    print(f"{worst} of {INPUTS} inputs")
    assert worst <= WITHIN


@pytest.mark.parametrize("variant", ["correction", "sensor"])
def test_inputs_that_are_no_numbers_give_none_and_leave_no_trace(variant, tmp_path):
    """As of the corrector: the readings after them are those of the last good ones."""
    model = ta.HarmonicModel((OUTPUT, MOTOR), 0.01, terms=TERMS["all"])
    path = tmp_path / "joint.fmu"
    ta.export_model(model, "fmu", path, variant=variant)
    moved = motion(29, 600)
    for i, name in enumerate(["angle", "velocity", "torque", "temperature", "current"]):
        for j, fault in enumerate([np.nan, np.inf, -np.inf]):
            moved[name][[3 * i + j, 17 * (i + 1) + j, 200 + 31 * i + 7 * j]] = fault
    found, want = stepped(path, moved), wanted(model, variant, moved)
    known = np.isfinite(want)
    assert 500 < np.sum(known) < 560
    assert np.max(np.abs(found - want)[known]) <= WITHIN
    assert np.all(np.isnan(found[~known]))


def test_a_sensor_at_the_indicated_angle_is_what_is_corrected(tmp_path):
    model = ta.HarmonicModel((OUTPUT,), 0.01, argument="indicated")
    path = tmp_path / "joint.fmu"
    ta.export_model(model, "fmu", path, variant="sensor")
    moved = motion(3)
    found = simulated(path, "true_angle", "indicated", moved, "CoSimulation")
    off = np.abs(model.correct(found) - moved["angle"][: len(found)])
    assert np.max(off) <= WITHIN


def test_noise_of_a_sensor(tmp_path):
    path = tmp_path / "joint.fmu"
    model = ta.HarmonicModel((OUTPUT,))
    ta.export_model(model, "fmu", path, variant="sensor")
    zeros = np.zeros(4001, [(n, "f8") for n in (
        "time", "true_angle", "velocity", "torque", "temperature")])  # fmt: skip
    zeros["time"] = np.arange(4001) * STEP
    told = {}
    for seed in (1.0, 2.0):
        out = fmpy.simulate_fmu(
            str(path), stop_time=4000 * STEP, output_interval=STEP, input=zeros,
            start_values={"noise_std": 1e-4, "seed": seed}, output=["indicated"],
        )  # fmt: skip
        told[seed] = out["indicated"][1:] - model.error(0.0)
    for noise in told.values():
        assert np.std(noise) == pytest.approx(1e-4, rel=0.06)  # of four thousand, five deviations
        assert abs(np.mean(noise)) < 1e-5
        assert abs(np.corrcoef(noise[1:], noise[:-1])[0, 1]) < 0.08
    assert abs(np.corrcoef(*told.values())[0, 1]) < 0.08


def test_what_the_unit_says_of_itself(tmp_path):
    model = ta.HarmonicModel((OUTPUT,), terms=TERMS["play"])
    model.save(tmp_path / "m.json")
    path = tmp_path / "joint.fmu"
    assert main(["export", str(tmp_path / "m.json"), "--to", "fmu", "-o", str(path)]) == 0
    with zipfile.ZipFile(path) as archive:
        names = archive.namelist()
        root = ElementTree.fromstring(archive.read("modelDescription.xml"))
        source = archive.read("sources/model.c").decode()
    assert {"sources/model.c", "sources/buildDescription.xml"} <= set(names)
    assert any(name.startswith("binaries/") for name in names)
    assert root.get("fmiVersion") == "3.0"
    units = {v.get("name"): (v.get("causality"), v.get("unit")) for v in root.iter("Float64")}
    assert units["indicated"] == ("input", "rad")
    assert units["true_angle"] == ("output", "rad")
    assert units["velocity"] == ("input", "rad/s")
    assert units["torque"] == ("input", "N.m")
    assert units["temperature"] == ("input", "K")
    assert "m.json, sha256" in source
    again = tmp_path / "again.fmu"
    ta.export_model(tmp_path / "m.json", "fmu", again)
    assert again.read_bytes() == path.read_bytes()


def test_a_state_is_kept_and_taken_back(tmp_path):
    path = tmp_path / "joint.fmu"
    model = ta.HarmonicModel((), terms=TERMS["play"])
    ta.export_model(model, "fmu", path)
    description = fmpy.read_model_description(str(path))
    unit = fmpy.instantiate_fmu(fmpy.extract(str(path)), description, "CoSimulation")
    reference = {v.name: v.valueReference for v in description.modelVariables}

    def step(at, angle):
        unit.setFloat64([reference["indicated"]], [angle])
        unit.doStep(at, STEP)
        return unit.getFloat64([reference["true_angle"]])[0]

    unit.enterInitializationMode()
    unit.exitInitializationMode()
    step(0.0, 0.0)
    ahead = step(STEP, 0.1)
    kept = unit.getFMUState()
    assert ahead == pytest.approx(0.1 - 20 * A, abs=WITHIN)
    assert step(2 * STEP, 0.0) == pytest.approx(20 * A, abs=WITHIN)
    unit.setFMUState(kept)
    assert step(2 * STEP, 0.1) == ahead
    unit.freeFMUState(kept)
    unit.terminate()
    unit.freeInstance()


def test_without_a_compiler_the_sources_are_there(tmp_path, monkeypatch):
    monkeypatch.setattr(shutil, "which", lambda name: None)
    made = ta.export_model(ta.HarmonicModel((OUTPUT,)), "fmu", tmp_path / "joint.fmu")
    assert any("holds no binary, as no C compiler" in note for note in made.notes)
    with zipfile.ZipFile(tmp_path / "joint.fmu") as archive:
        names = archive.namelist()
    assert "sources/model.c" in names
    assert not any(name.startswith("binaries/") for name in names)


def test_another_archive_is_no_unit(tmp_path):
    path = tmp_path / "other.fmu"
    for content in (b"PK nothing", b""):
        path.write_bytes(content)
        with pytest.raises(FileError, match="no functional mock-up unit of trueangle"):
            ta.import_model(path, "fmu")
