"""A joint in MuJoCo against the real one: what its model lacks, found from two logs.

The model is a position servo: a command, a joint that follows it late. The real joint (here made
by the same servo) has 0.1 arcmin of play to either side and an encoder whose magnet is tilted:
40 arcsec twice a turn, and 2 arcsec of noise. Both logs hold the same motion.

    python examples/mujoco_joint.py [FOLDER]

writes model.csv and real.csv and prints what the model lacks. Needs mujoco.
"""

from __future__ import annotations

import sys
from pathlib import Path

import mujoco
import numpy as np

import trueangle as ta

ARCSEC = np.pi / 648_000.0
SPEEDS = (np.radians(15.0), np.radians(60.0))  # rad/s, a turn there and back at each
MODEL = """
<mujoco>
  <option timestep="0.001" gravity="0 0 0"/>
  <worldbody>
    <body>
      <joint name="joint" type="hinge" axis="0 0 1" damping="20" armature="0.5"/>
      <geom type="box" size="0.3 0.02 0.02" pos="0.3 0 0" mass="2"/>
    </body>
  </worldbody>
  <actuator><position joint="joint" kp="2000" kv="40"/></actuator>
</mujoco>
"""


def motion(speed: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Time, the joint's angle and the command, a turn there and back."""
    model = mujoco.MjModel.from_xml_string(MODEL)
    data = mujoco.MjData(model)
    half = 2.0 * np.pi / speed
    rows = []
    while data.time < 2.0 * half:
        data.ctrl[0] = speed * min(data.time, 2.0 * half - data.time)
        rows.append((data.time, data.qpos[0], data.ctrl[0]))
        mujoco.mj_step(model, data)
    time, angle, command = np.array(rows)[::5].T
    return time, angle, command


def write_logs(folder: Path) -> tuple[Path, Path]:
    """The model's log, and the measured one."""
    rng = np.random.default_rng(7)
    logs = {"model": ["run,time_s,reference_rad,indicated_rad"]}
    logs["real"] = list(logs["model"])
    for speed in SPEEDS:
        time, angle, command = motion(speed)
        play = 6.0 * np.sign(np.gradient(angle, time))
        encoder = 40.0 * np.sin(2.0 * angle + 0.5) + 2.0 * rng.standard_normal(angle.size)
        for name, indicated in (("model", command), ("real", command + ARCSEC * (play + encoder))):
            label = f"{np.degrees(speed):.0f} deg/s"
            columns = zip(time.tolist(), angle.tolist(), indicated.tolist(), strict=True)
            logs[name] += [f"{label},{t!r},{x!r},{y!r}" for t, x, y in columns]
    paths = folder / "model.csv", folder / "real.csv"
    for path, lines in zip(paths, logs.values(), strict=True):
        path.write_text("\n".join(lines) + "\n")
    return paths


def main(folder: str = ".") -> None:
    model, real = write_logs(Path(folder))
    found = ta.diagnose(ta.read_runs(real), simulated=model)
    print(found.summary())
    found.extended.save(Path(folder) / "on_top.toml")


if __name__ == "__main__":
    main(*sys.argv[1:])
