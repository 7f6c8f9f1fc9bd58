"""The loop closed: what a diagnosis finds goes into the simulator, and nothing is beyond then."""

import math

import mujoco
import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.simulators.mujoco import SensorLayer

from .rig import ARCSEC, INCLUDE, NOISE, by_fmpy, confirmed, diagnosed, measured, motions, written

SEED = 20261123  # one in a hundred says by design that something is left


def tilt_and_play(angle, velocity, torque):
    """40 arcsec twice a turn, and 20 of play to either side."""
    return 40.0 * np.sin(2.0 * angle + 0.5) + 20.0 * np.sign(velocity)


@pytest.fixture
def first(tmp_path, capsys):
    """An ideal encoder in MuJoCo against the real one: both logs."""
    ideal = list(motions(tmp_path))
    real = written(tmp_path / "real.csv", measured(ideal, tilt_and_play, SEED))
    return ideal, real, written(tmp_path / "model.csv", ideal)


def nothing_beyond(found, noise=NOISE):
    print([(e["test"], e["p"]) for e in found["unexplained"]["evidence"][:4]])
    assert found["findings"] == []
    assert not found["unexplained"]["found"]
    assert found["noise_arcsec"] == pytest.approx(noise, rel=0.05)


@pytest.mark.parametrize("into", ["xml", "fmu"])
def test_two_effects_at_once_and_the_noise(into, first, tmp_path, capsys):
    ideal, real, log = first
    sensor = tmp_path / f"sensor.{into}"
    more = ("--extend-into", str(sensor), *(("--into-joint", "elbow") if into == "xml" else ()))
    found = diagnosed(capsys, real, "--simulated", log, *more)
    assert set(confirmed(found)) == {"missing_order", "backlash"}

    def again(**noise):
        runs = (
            by_fmpy(sensor, ideal, **noise)
            if into == "fmu"
            else motions(tmp_path, INCLUDE, **noise)
        )
        return diagnosed(capsys, real, "--simulated", written(tmp_path / "again.csv", runs))

    nothing_beyond(again(noise_std=0.0))
    # The file holds the noise as well: what is left is that of two encoders.
    nothing_beyond(again(), math.sqrt(2.0) * NOISE)


def test_the_noise_that_is_written_is_what_the_simulator_lacks(first, tmp_path):
    ideal, real, log = first
    rng = np.random.default_rng(6)
    for own, lacking in ((0.0, 3.0), (2.0, math.sqrt(3.0**2 - 2.0**2)), (3.0, 0.0)):
        noisy = [
            (t, x, y + rng.normal(0.0, own * ARCSEC, y.size), *more) for t, x, y, *more in ideal
        ]
        log = written(tmp_path / "noisy.csv", noisy)
        found = ta.diagnose(real, simulated=ta.read_runs(log))
        assert found.simulated.noise_arcsec == pytest.approx(own, abs=0.15)
        # Two variances of 2500 readings each differ by 0.7 arcsec^2 by chance, and their root
        # is taken: twice that.
        left = (found.sensor_noise() / ARCSEC) ** 2
        assert left == pytest.approx(lacking**2, abs=1.4)


def test_a_sensor_holds_what_the_simulators_own_encoder_lacks(first, tmp_path):
    """An encoder of the simulator that has an error of its own, 60 arcsec twice a turn."""
    ideal, _, _ = first
    own = [(t, x, y + 60.0 * ARCSEC * np.sin(2.0 * x), *more) for t, x, y, *more in ideal]
    both = [
        (t, x, y + said - x, *more)
        for (t, x, y, *more), (_, _, said, *_) in zip(
            measured(ideal, tilt_and_play, SEED), own, strict=True
        )
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


def test_where_nothing_is_confirmed_nothing_is_written(tmp_path, capsys):
    ideal = list(motions(tmp_path))[:1]
    log = written(tmp_path / "model.csv", ideal)
    real = written(tmp_path / "real.csv", measured(ideal, lambda *_: 0.0, 1))
    sensor = tmp_path / "sensor.xml"
    more = ["--simulated", log, "--extend-into", str(sensor)]
    assert main(["diagnose", real, *more]) == 1
    assert "no confirmed cause can be corrected" in capsys.readouterr().err
    assert not sensor.exists()
    assert main(["diagnose", real, "--simulated", log, "--extend-into", "sensor.csv"]) != 0


def test_a_ripple_alone_is_a_file_of_mujoco_and_no_unit(tmp_path, capsys):
    ideal = list(motions(tmp_path))
    log = written(tmp_path / "model.csv", ideal)
    rippled = [(t, x, y, v, torque - 0.2 * np.sin(4.0 * x + 0.5)) for t, x, y, v, torque in ideal]
    real = written(tmp_path / "real.csv", measured(rippled, lambda *_: 0.0, SEED))
    sensor = tmp_path / "sensor.xml"
    more = ["--simulated", log, "--within", "60", "--extend-into"]
    assert main(["diagnose", real, *more, str(tmp_path / "sensor.fmu")]) == 1
    said = capsys.readouterr()
    assert "Confirmed in the drive's torque: torque ripple: order 4" in said.out
    assert "a torque ripple is for MuJoCo: --extend-into sensor.xml" in said.err
    assert main(["diagnose", real, *more, str(sensor), "--into-joint", "elbow"]) == 0
    text = sensor.read_text()
    assert text.count("<dcmotor") == 1
    (tmp_path / "robot.xml").write_text(
        f"<mujoco>{INCLUDE}<worldbody><body><joint name='elbow'/><geom size='.1'/></body>"
        "</worldbody></mujoco>"
    )
    model = mujoco.MjModel.from_xml_path(str(tmp_path / "robot.xml"))
    data = mujoco.MjData(model)
    data.qpos[0] = 0.7
    mujoco.mj_forward(model, data)
    assert data.qfrc_actuator[0] == pytest.approx(0.2 * np.sin(4.0 * 0.7 + 0.5), abs=0.01)
    assert SensorLayer(model, noise_std=0.0).read(data)[0] == 0.7
