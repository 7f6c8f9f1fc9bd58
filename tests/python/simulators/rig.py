"""A joint in MuJoCo that stands for the real one, its logs, and the same encoder by FMPy."""

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
  <actuator><position name="drive" joint="elbow" kp="2000" kv="40"/></actuator>
</mujoco>
"""
INCLUDE = '<include file="sensor.xml"/>'
#: Standard deviation of a reading, arcsec, and of the drive's torque, Nm.
NOISE, TORQUE_NOISE = 3.0, 0.06
#: Speed (rad/s) and load (Nm) of every run, a turn there and back.
RUNS = ((0.4, 12.0), (1.2, -12.0), (0.4, -4.0), (1.2, 4.0))
#: Readings within which the load is taken up and the side of the play is found.
BEGUN = 20
COLUMNS = ("time_s", "reference_rad", "indicated_rad", "velocity_rad_s", "torque_Nm")


def still(angle):
    """No torque beside the drive's."""
    return 0.0


def motions(folder, include="", ripple=still, **layer):
    """Of each run: what `COLUMNS` name, with the encoder of MuJoCo and the torque of its drive."""
    (folder / "robot.xml").write_text(ROBOT.replace("@include@", include))
    model = mujoco.MjModel.from_xml_path(str(folder / "robot.xml"))
    drive = model.actuator("drive").id
    encoder = SensorLayer(model, **layer) if include else None
    for speed, load in RUNS:
        data = mujoco.MjData(model)
        if encoder is not None:
            encoder.reset()
        half, rows = 2.0 * np.pi / speed, []
        every = max(1, round(0.02 / speed / 0.002))
        while data.time < 2.0 * half:
            data.ctrl[0] = speed * min(data.time, 2.0 * half - data.time)
            data.qfrc_applied[0] = load + ripple(data.qpos[0])
            mujoco.mj_forward(model, data)
            if round(data.time / 0.002) % every == 0:
                said = data.qpos[0] if encoder is None else encoder.read(data)[0]
                rows.append((data.time, data.qpos[0], said, data.qvel[0]))
                rows[-1] += (data.actuator_force[drive],)
            mujoco.mj_step(model, data)
        yield np.array(rows)[BEGUN:].T


def measured(runs, error, seed):
    """The runs as a real encoder and a real drive say them."""
    print(f"seed {seed}")
    rng = np.random.default_rng(seed)
    for time, angle, _, velocity, torque in runs:
        noise = rng.normal(0.0, NOISE, angle.size)
        said = angle + ARCSEC * (error(angle, velocity, torque) + noise)
        yield time, angle, said, velocity, torque + rng.normal(0.0, TORQUE_NOISE, angle.size)


def by_fmpy(sensor, runs, **start):
    """The runs with what the unit says of their true angles."""
    fmpy = pytest.importorskip("fmpy")
    if shutil.which("cc") is None:
        pytest.skip("not installed: cc")
    for k, (time, angle, _, velocity, torque) in enumerate(runs):
        names = ("time", "true_angle", "velocity", "torque", "temperature")
        given = np.zeros(time.size, [(name, "f8") for name in names])
        given["true_angle"], given["velocity"], given["torque"] = angle, velocity, torque
        step = float(time[1] - time[0])
        given["time"] = np.arange(time.size) * step
        out = fmpy.simulate_fmu(
            str(sensor), stop_time=time.size * step, output_interval=step, input=given,
            start_values={"seed": k + 1.0, **start}, output=["indicated"],
        )  # fmt: skip
        # A step's output is of the input at its begin.
        yield time, angle, out["indicated"][1 : time.size + 1], velocity, torque


def written(path, runs):
    """A log of the runs.

    Before the first motion nobody knows on which side of its play a joint stands: the first
    reading is left out.
    """
    lines = ["run," + ",".join(COLUMNS)]
    for k, columns in enumerate(runs):
        rows = zip(*(column.tolist()[1:] for column in columns), strict=True)
        lines += [f"{k}," + ",".join(map(repr, row)) for row in rows]
    path.write_text("\n".join(lines) + "\n")
    return str(path)


def diagnosed(capsys, *arguments):
    """What ``trueangle diagnose`` prints as JSON."""
    capsys.readouterr()
    assert main(["diagnose", *arguments, "--json", "--within", "60"]) == 0
    out = capsys.readouterr().out
    return json.loads(out[out.index("{") :])


def confirmed(found, key="cause"):
    """Parameters of what was confirmed, by cause or, in the torque, by effect."""
    return {f[key]: f["parameters"] for f in found["findings"] if f["status"] == "confirmed"}
