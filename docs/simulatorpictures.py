"""Pictures of the pages on simulators: what one lacks, and what is left with its sensor written."""

from __future__ import annotations

import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path

import fmpy
import matplotlib.pyplot as plt
import mujoco
import numpy as np

import trueangle as ta
from trueangle.plots import palette
from trueangle.simulators.mujoco import SensorLayer

__all__ = ["simulator_pictures"]

ARCSEC = np.pi / 648_000.0
SPEEDS = (0.4, 1.2)

#: Inputs of the unit that this sensor does not look at.
UNUSED = ("velocity", "torque", "temperature")
ROBOT = """
<mujoco>
  @include@
  <option timestep="0.002" gravity="0 0 0"/>
  <worldbody>
    <body>
      <joint name="elbow" type="hinge" axis="0 0 1" damping="20" armature="0.5"/>
      <geom type="box" size="0.3 0.02 0.02" pos="0.3 0 0" mass="2"/>
    </body>
  </worldbody>
  <actuator><position joint="elbow" kp="2000" kv="40"/></actuator>
</mujoco>
"""


def simulator_pictures(folder: Path) -> None:
    """Write ``mujoco.svg`` and ``fmu.svg``: measured minus simulated, before and after."""
    with tempfile.TemporaryDirectory() as place:
        work = Path(place)
        ideal = list(motions(work))
        real = list(measured(ideal))
        before = ta.diagnose(cut(real), simulated=cut(ideal))
        sensor = before.sensor()
        drawn: dict[str, Callable[[], list[ta.CalibrationRun]]] = {
            "mujoco": lambda: with_mujoco(work, sensor),
            "fmu": lambda: with_fmu(work, sensor, ideal),
        }
        for name, simulated in drawn.items():
            after = ta.diagnose(cut(real), simulated=cut(simulated()))
            picture(before, after, folder / f"{name}.svg")


def cut(runs: list[ta.CalibrationRun]) -> list[ta.CalibrationRun]:
    """Runs from the second reading on: before it nobody knows the side of the play."""
    return [
        ta.CalibrationRun(r.reference[1:], r.indicated[1:], time=r.time[1:], label=r.label)
        for r in runs
    ]


def motions(folder: Path, include: str = "") -> Iterator[ta.CalibrationRun]:
    """A turn there and back at each speed, and what the simulator's encoder says."""
    (folder / "robot.xml").write_text(ROBOT.replace("@include@", include))
    model = mujoco.MjModel.from_xml_path(str(folder / "robot.xml"))
    for speed in SPEEDS:
        data = mujoco.MjData(model)
        layer = SensorLayer(model) if include else None
        half, every, rows = 2.0 * np.pi / speed, max(1, round(5.0 / speed)), []
        while data.time < 2.0 * half:
            data.ctrl[0] = speed * min(data.time, 2.0 * half - data.time)
            if round(data.time / 0.002) % every == 0:
                said = data.qpos[0] if layer is None else layer.read(data)[0]
                rows.append((data.time, data.qpos[0], said))
            mujoco.mj_step(model, data)
        time, angle, indicated = np.array(rows).T
        yield ta.CalibrationRun(angle, indicated, time=time, label=f"{speed:g} rad/s")


def measured(ideal: list[ta.CalibrationRun]) -> Iterator[ta.CalibrationRun]:
    """The real encoder: 40 arcsec twice a turn, 20 of play to either side, 3 of noise."""
    rng = np.random.default_rng(5)
    for run in ideal:
        time, angle = np.asarray(run.time), np.asarray(run.reference)
        error = 40.0 * np.sin(2.0 * angle + 0.5) + 20.0 * np.sign(np.gradient(angle, time))
        said = angle + ARCSEC * (error + rng.normal(0.0, 3.0, angle.size))
        yield ta.CalibrationRun(angle, said, time=time, label=run.label)


def with_mujoco(folder: Path, sensor: ta.HarmonicModel) -> list[ta.CalibrationRun]:
    """The motions again, with the sensor's fragment included."""
    ta.export_model(sensor, "mujoco", folder / "sensor.xml", joint="elbow")
    return list(motions(folder, '<include file="sensor.xml"/>'))


def with_fmu(
    folder: Path, sensor: ta.HarmonicModel, ideal: list[ta.CalibrationRun]
) -> list[ta.CalibrationRun]:
    """The same by FMPy."""
    ta.export_model(sensor, "fmu", folder / "sensor.fmu", variant="sensor")
    runs = []
    for run in ideal:
        time, angle = np.asarray(run.time), np.asarray(run.reference)
        step = float(time[1] - time[0])
        given = np.zeros(time.size, [(name, "f8") for name in ("time", "true_angle", *UNUSED)])
        given["time"], given["true_angle"] = time, angle
        out = fmpy.simulate_fmu(
            str(folder / "sensor.fmu"),
            start_time=time[0],
            stop_time=time[-1] + step,
            output_interval=step,
            input=given,
            output=["indicated"],
        )
        # A step's output is of the input at its begin.
        said = out["indicated"][1 : time.size + 1]
        runs.append(ta.CalibrationRun(angle, said, time=time, label=run.label))
    return runs


def picture(before: ta.Diagnosis, after: ta.Diagnosis, path: Path) -> None:
    """Two charts, one above the other, on one scale."""
    figure, axes = plt.subplots(2, 1, sharex=True, sharey=True, figsize=(6.4, 4.2))
    for ax, diagnosis, colour, name in (
        (axes[0], before, palette.BEFORE, "as the simulator was"),
        (axes[1], after, palette.AFTER, "with the sensor written by --extend-into"),
    ):
        for run in diagnosis.simulated.runs:
            error = (np.asarray(run.indicated) - np.asarray(run.reference)) / ARCSEC
            ax.plot(
                np.degrees(run.reference), error, ".", color=colour, markersize=2, rasterized=True
            )
        rms = diagnosis.discrepancy.rms
        ax.set_title(f"{name}: {rms:.1f} arcsec rms", fontsize="medium", loc="left")
        ax.set_ylabel("arcsec")
    axes[1].set_xlabel("joint angle / deg")
    figure.supylabel("measured minus simulated", fontsize="medium")
    figure.tight_layout()
    figure.savefig(path, dpi=150)
    plt.close(figure)
