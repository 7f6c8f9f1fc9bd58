"""The loop closed: what a diagnosis finds goes into the simulator, and nothing is beyond then."""

import json
import shutil

import mujoco
import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.simulators.mujoco import SensorLayer

ARCSEC = np.pi / 648_000.0
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
SEED = 20261123  # one in a hundred says by design that something is left
SPEEDS = (0.4, 1.2)  # rad/s, a turn there and back at each


def motions(folder, include=""):
    """Of each speed: time, the joint's angle, and what its encoder says in MuJoCo."""
    (folder / "robot.xml").write_text(ROBOT.replace("@include@", include))
    model = mujoco.MjModel.from_xml_path(str(folder / "robot.xml"))
    for speed in SPEEDS:
        data = mujoco.MjData(model)
        layer = SensorLayer(model) if include else None
        half, rows = 2.0 * np.pi / speed, []
        every = max(1, round(0.01 / speed / 0.002))
        while data.time < 2.0 * half:
            data.ctrl[0] = speed * min(data.time, 2.0 * half - data.time)
            if round(data.time / 0.002) % every == 0:
                reading = data.qpos[0] if layer is None else layer.read(data)[0]
                rows.append((data.time, data.qpos[0], reading))
            mujoco.mj_step(model, data)
        yield np.array(rows).T


def written(path, runs):
    lines = ["run,time_s,reference_rad,indicated_rad"]
    for k, (time, angle, indicated) in enumerate(runs):
        # Before the first motion nobody knows on which side of its play a joint stands.
        columns = (column.tolist()[1:] for column in (time, angle, indicated))
        lines += [f"{k},{t!r},{x!r},{y!r}" for t, x, y in zip(*columns, strict=True)]
    path.write_text("\n".join(lines) + "\n")
    return str(path)


def measured(runs, seed):
    """The real joint's encoder: 40 arcsec twice a turn, 20 of play to either side, 3 of noise."""
    rng = np.random.default_rng(seed)
    for time, angle, _ in runs:
        error = 40.0 * np.sin(2.0 * angle + 0.5) + 20.0 * np.sign(np.gradient(angle, time))
        yield time, angle, angle + ARCSEC * (error + rng.normal(0.0, 3.0, angle.size))


def diagnosed(capsys, *arguments):
    assert main(["diagnose", *arguments, "--json"]) == 0
    out = capsys.readouterr().out
    return json.loads(out[out.index("{") :])


@pytest.fixture
def first(tmp_path, capsys):
    """An ideal encoder in MuJoCo against the real one: both logs."""
    ideal = list(motions(tmp_path))
    real = written(tmp_path / "real.csv", measured(ideal, SEED))
    return ideal, real, written(tmp_path / "model.csv", ideal)


def nothing_beyond(found):
    print([(f["cause"], f["status"]) for f in found["findings"]], found["unexplained"])
    assert found["findings"] == []
    assert not found["unexplained"]["found"]
    assert found["simulation"]["rms_arcsec"] == pytest.approx(3.0, rel=0.15)


def test_mujoco(first, tmp_path, capsys):
    _, real, log = first
    sensor = tmp_path / "sensor.xml"
    more = ("--extend-into", str(sensor), "--into-joint", "elbow")
    found = diagnosed(capsys, real, "--simulated", log, *more)
    assert {f["cause"] for f in found["findings"]} == {"missing_order", "backlash"}
    again = list(motions(tmp_path, '<include file="sensor.xml"/>'))
    found = diagnosed(capsys, real, "--simulated", written(tmp_path / "again.csv", again))
    nothing_beyond(found)


def test_a_sensor_holds_what_the_simulators_own_encoder_lacks(first, tmp_path):
    """An encoder of the simulator that has an error of its own, 60 arcsec twice a turn."""
    ideal, _, _ = first
    own = [(t, x, y + 60.0 * ARCSEC * np.sin(2.0 * x)) for t, x, y in ideal]
    both = [
        (t, x, y + said - x)
        for (t, x, y), (_, _, said) in zip(measured(ideal, SEED), own, strict=True)
    ]
    real, log = (
        ta.read_runs(written(tmp_path / f"{name}.csv", runs))
        for name, runs in (("both", both), ("own", own))
    )
    sensor = ta.diagnose(real, simulated=log).sensor()
    assert sensor.orders == (2.0,)
    turn = 1_296_000.0 / sensor.period
    assert sensor.amplitudes[0] * turn == pytest.approx(40.0, abs=0.5)
    assert sensor.terms[0].half_width * turn == pytest.approx(20.0, abs=0.5)


def test_fmu(first, tmp_path, capsys):
    fmpy = pytest.importorskip("fmpy")
    if shutil.which("cc") is None:
        pytest.skip("not installed: cc")
    ideal, real, log = first
    sensor = tmp_path / "sensor.fmu"
    diagnosed(capsys, real, "--simulated", log, "--extend-into", str(sensor))
    again = []
    for time, angle, _ in ideal:
        unused = ("velocity", "torque", "temperature")
        given = np.zeros(time.size, [(name, "f8") for name in ("time", "true_angle", *unused)])
        given["time"], given["true_angle"] = time, angle
        step = float(time[1] - time[0])
        out = fmpy.simulate_fmu(
            str(sensor), stop_time=time[-1] + step, output_interval=step, input=given,
            output=["indicated"],
        )  # fmt: skip
        # A step's output is of the input at its begin.
        again.append((time, angle, out["indicated"][1 : time.size + 1]))
    found = diagnosed(capsys, real, "--simulated", written(tmp_path / "again.csv", again))
    nothing_beyond(found)


def test_where_nothing_is_confirmed_nothing_is_written(tmp_path, capsys):
    ideal = list(motions(tmp_path))[:1]
    log = written(tmp_path / "model.csv", ideal)
    rng = np.random.default_rng(1)
    noisy = [(t, x, x + rng.normal(0.0, 3.0 * ARCSEC, x.size)) for t, x, _ in ideal]
    real = written(tmp_path / "real.csv", noisy)
    sensor = tmp_path / "sensor.xml"
    more = ["--simulated", log, "--extend-into", str(sensor)]
    assert main(["diagnose", real, *more]) == 1
    assert "nothing was confirmed" in capsys.readouterr().err
    assert not sensor.exists()
    assert main(["diagnose", real, "--simulated", log, "--extend-into", "sensor.csv"]) != 0
