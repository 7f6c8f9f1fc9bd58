"""The round for every family of effects: found, written into the simulator, and nothing is beyond.

A second MuJoCo with an encoder of its own stands for the real joint: the effect is hidden in its
log, by code that is none of the package's.
"""

from __future__ import annotations

import json
import shutil

import mujoco
import numpy as np
import pytest

from trueangle.cli import main
from trueangle.simulators.mujoco import SensorLayer

ARCSEC = np.pi / 648_000.0
ROBOT = """
<mujoco>
  @include@
  <option timestep="0.002" gravity="0 0 0"/>
  <worldbody>
    <body>
      <joint name="elbow" type="hinge" axis="0 0 1" damping="2" armature="0.5"/>
      <geom type="box" size="0.3 0.02 0.02" pos="0.3 0 0" mass="2"/>
    </body>
  </worldbody>
  <actuator><position joint="elbow" kp="2000" kv="40"/></actuator>
</mujoco>
"""
NOISE = 3.0
#: Speed (rad/s) and load (Nm) of every run, a turn there and back.
RUNS = ((0.4, 12.0), (1.2, -12.0), (0.4, -4.0), (1.2, 4.0))
COLUMNS = ("time_s", "reference_rad", "indicated_rad", "velocity_rad_s", "torque_Nm")


def periodic(angle, velocity, torque):
    return 8.0 * np.sin(2.0 * angle + 0.5)


def play(angle, velocity, torque):
    return 6.0 * np.sign(velocity)


def compliance(angle, velocity, torque):
    return 0.6 * torque


def latency(angle, velocity, torque):
    return -4e-5 * velocity / ARCSEC


def friction(angle, velocity, torque):
    """A spring that winds up over 4 degrees after each reversal, relaxed at first."""
    z, errors = 0.0, []
    for step, way in zip(np.diff(angle, prepend=angle[0]), np.sign(velocity), strict=True):
        z = way - (way - z) * np.exp(-abs(step) / np.radians(4.0))
        errors.append(8.0 * z)
    return np.array(errors)


#: Of each family: the error in arcsec, 1 to 3 standard deviations of the noise; its cause and
#: parameters.
FAMILIES = {
    "periodic": (periodic, "missing_order", {"amplitude_arcsec": 8.0}),
    "play": (play, "backlash", {"half_width_arcsec": 6.0}),
    "compliance": (compliance, "torsional_compliance", {"arcsec_per_Nm": 0.6}),
    "latency": (latency, "latency", {"delay_s": 4e-5}),
    "friction": (friction, "presliding_hysteresis", {"amplitude_arcsec": 8.0}),
}


def motions(folder, include=""):
    """Of each run: what `COLUMNS` name, with the encoder of MuJoCo."""
    (folder / "robot.xml").write_text(ROBOT.replace("@include@", include))
    model = mujoco.MjModel.from_xml_path(str(folder / "robot.xml"))
    for speed, load in RUNS:
        data = mujoco.MjData(model)
        layer = SensorLayer(model) if include else None
        half, rows = 2.0 * np.pi / speed, []
        every = max(1, round(0.02 / speed / 0.002))
        data.qfrc_applied[0] = load
        while data.time < 2.0 * half:
            data.ctrl[0] = speed * min(data.time, 2.0 * half - data.time)
            mujoco.mj_forward(model, data)
            if round(data.time / 0.002) % every == 0:
                reading = data.qpos[0] if layer is None else layer.read(data)[0]
                state = (data.qvel[0], data.qfrc_actuator[0])
                rows.append((data.time, data.qpos[0], reading, *state))
            mujoco.mj_step(model, data)
        # The load is taken up within a moment.
        yield np.array(rows)[20:].T


def written(path, runs):
    lines = ["run," + ",".join(COLUMNS)]
    for k, columns in enumerate(runs):
        rows = zip(*(column.tolist() for column in columns), strict=True)
        lines += [f"{k}," + ",".join(map(repr, row)) for row in rows]
    path.write_text("\n".join(lines) + "\n")
    return str(path)


def diagnosed(capsys, *arguments):
    capsys.readouterr()
    assert main(["diagnose", *arguments, "--json"]) == 0
    out = capsys.readouterr().out
    return json.loads(out[out.index("{") :])


@pytest.mark.parametrize("into", ["mujoco", "fmu"])
@pytest.mark.parametrize("family", list(FAMILIES))
def test_the_round_closes(family, into, tmp_path, capsys):
    error, cause, parameters = FAMILIES[family]
    rng = np.random.default_rng(20261124)
    print("seed 20261124")
    ideal = list(motions(tmp_path))
    real = []
    for time, angle, _, velocity, torque in ideal:
        noise = rng.normal(0.0, NOISE, angle.size)
        said = angle + ARCSEC * (error(angle, velocity, torque) + noise)
        real.append((time, angle, said, velocity, torque))
    measured = written(tmp_path / "real.csv", real)
    sensor = tmp_path / f"sensor.{'fmu' if into == 'fmu' else 'xml'}"
    more = ("--extend-into", str(sensor), *(() if into == "fmu" else ("--into-joint", "elbow")))
    log = written(tmp_path / "model.csv", ideal)
    found = diagnosed(capsys, measured, "--simulated", log, *more)
    told = {f["cause"]: f["parameters"] for f in found["findings"] if f["status"] == "confirmed"}
    assert list(told) == [cause], told
    for name, value in parameters.items():
        got = told[cause][name]
        print(f"{name}: {got['value']} +- {got['std']}")
        assert abs(got["value"] - value) < 2.0 * got["std"]
    if into == "mujoco":
        again = list(motions(tmp_path, '<include file="sensor.xml"/>'))
    else:
        again = list(simulated(sensor, ideal))
    found = diagnosed(capsys, measured, "--simulated", written(tmp_path / "again.csv", again))
    print([(f["cause"], f["status"]) for f in found["findings"]], found["unexplained"]["found"])
    assert [f for f in found["findings"] if f["status"] == "confirmed"] == []
    assert found["simulation"]["rms_arcsec"] == pytest.approx(NOISE, rel=0.1)


def simulated(sensor, runs):
    """The runs with what the unit says of their true angles."""
    fmpy = pytest.importorskip("fmpy")
    if shutil.which("cc") is None:
        pytest.skip("not installed: cc")
    for time, angle, _, velocity, torque in runs:
        names = ("time", "true_angle", "velocity", "torque", "temperature")
        given = np.zeros(time.size, [(name, "f8") for name in names])
        given["true_angle"], given["velocity"], given["torque"] = angle, velocity, torque
        step = float(time[1] - time[0])
        given["time"] = np.arange(time.size) * step
        out = fmpy.simulate_fmu(
            str(sensor), stop_time=time.size * step, output_interval=step, input=given,
            output=["indicated"],
        )  # fmt: skip
        # A step's output is of the input at its begin.
        yield time, angle, out["indicated"][1 : time.size + 1], velocity, torque
