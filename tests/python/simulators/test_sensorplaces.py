"""Encoders of several joints, sensors and environments: each reading is of its own place."""

from __future__ import annotations

from types import SimpleNamespace

import mujoco
import numpy as np
import pytest

import trueangle as ta
from trueangle import terms as T
from trueangle.errors import ArgumentError, MissingSignalError
from trueangle.simulators.mujoco import SensorLayer

A = np.pi / 648_000.0


def robot(more: str = "") -> mujoco.MjModel:
    """Four hinges and a slide behind a free body: places, velocities and numbers differ."""
    bodies = "".join(
        f"<body><joint name='{name}'/><geom size='.1'/>" for name in ("q0", "q1", "q2", "q3")
    )
    # A ball and a vector before them: the numbers of sensors are not their addresses.
    sensors = (
        "<sensor><gyro name='gyro' site='here'/><jointpos name='near' joint='q1'/>"
        "<accelerometer name='push' site='here'/><jointpos name='far' joint='q3'/></sensor>"
    )
    return mujoco.MjModel.from_xml_string(
        f"<mujoco>{more}<worldbody><body><freejoint/><geom size='.1'/><site name='here'/>{bodies}"
        f"<body><joint name='rail' type='slide'/><geom size='.1'/></body>{'</body>' * 4}</body>"
        f"</worldbody>{sensors}</mujoco>"
    )


ANGLES = np.array([0.3, -0.7, 1.2, 2.1])


def posed(mj: mujoco.MjModel) -> mujoco.MjData:
    data = mujoco.MjData(mj)
    data.qpos[7:11], data.qpos[11] = ANGLES, 5.0
    mujoco.mj_forward(mj, data)
    return data


def eccentric(arcsec: float, **more: object) -> ta.HarmonicModel:
    return ta.HarmonicModel([ta.Shaft("output", 1, [1], [0.0], [arcsec * A])], **more)


def coupled(**factors: float) -> ta.HarmonicModel:
    return ta.HarmonicModel([], terms=[T.JointCoupling(q, k) for q, k in factors.items()])


def test_each_sensor_is_read_at_its_address() -> None:
    mj = robot()
    data = posed(mj)
    layer = SensorLayer(mj, {"far": eccentric(40.0), "q2": eccentric(9.0), "near": eccentric(25.0)})
    # What the sensor says is in the reading, with a noise or delay of its own.
    for name, angle in (("near", -0.8), ("far", 2.3)):
        data.sensordata[mj.sensor(name).adr] = angle
    said = np.array([2.3, 1.2, -0.8])
    wanted = said + np.array([40.0, 9.0, 25.0]) * A * np.sin(said)
    np.testing.assert_allclose(layer.read(data), wanted, rtol=1e-14)


def test_a_joint_goes_before_a_sensor_of_its_name() -> None:
    """The sensor ``q2`` is of another joint."""
    xml = (
        "<mujoco><worldbody><body><joint name='q1'/><geom size='.1'/><body><joint name='q2'/>"
        "<geom size='.1'/></body></body></worldbody><sensor><jointpos name='q2' joint='q1'/>"
        "</sensor></mujoco>"
    )
    mj = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(mj)
    data.qpos[:] = 0.3, 1.2
    mujoco.mj_forward(mj, data)
    assert SensorLayer(mj, {"q2": ta.HarmonicModel([])}).read(data) == pytest.approx([1.2])


def test_couplings_are_read_in_an_order_in_which_each_has_its_own() -> None:
    """Chains, two at once, a joint that only a sensor reads, and one that nobody reads."""
    mj = robot()
    data = posed(mj)
    models = {
        "q0": coupled(q1=0.1, q2=0.02, q3=0.003),
        "q2": coupled(q1=0.05, q3=0.2),
        "near": eccentric(5000.0),
    }
    layer = SensorLayer(mj, models)
    q0, q2, q1 = layer.read(data)
    assert q1 == pytest.approx(-0.7 + 5000.0 * A * np.sin(-0.7), rel=1e-14)
    assert q2 == pytest.approx(1.2 + 0.05 * q1 + 0.2 * 2.1, rel=1e-14)
    assert q0 == pytest.approx(0.3 + 0.1 * q1 + 0.02 * q2 + 0.003 * 2.1, rel=1e-14)


def test_a_circle_is_told_by_the_names_that_were_given() -> None:
    mj = robot()
    ring = {"q0": coupled(q1=0.1), "near": coupled(q0=0.1), "q2": coupled(q3=0.1, q0=0.2)}
    with pytest.raises(ArgumentError, match=r"^joints q0, near, q2 are coupled in a circle: none"):
        SensorLayer(mj, {**ring, "far": eccentric(1.0)})
    # Also where the first of several is known, or the last.
    for order in ({"q3": 0.1, "q1": 0.2}, {"q1": 0.2, "q3": 0.1}):
        ring = {"q0": coupled(**order), "q1": coupled(q0=0.1), "q3": eccentric(1.0)}
        with pytest.raises(ArgumentError, match=r"^joints q0, q1 are coupled in a circle"):
            SensorLayer(mj, ring)


def test_a_model_in_degrees_reads_what_the_one_in_radians_does() -> None:
    """Lines alone, of the true angle and of the indicated one, and what a load does."""
    mj = robot()
    data = posed(mj)
    degree = 180.0 / np.pi
    for argument in ("reference", "indicated"):
        for torque in (0.0, 4e-3):
            first, second = (
                ta.HarmonicModel(
                    [ta.Shaft("output", 1, [1, 3], [0.01 * unit, 0.0], [0.0, 0.02 * unit])],
                    period=2.0 * np.pi * unit,
                    argument=argument,
                    constant=0.003 * unit,
                    terms=[T.TorsionalCompliance(torque * unit)] if torque else [],
                )
                for unit in (1.0, degree)
            )
            models = {"q1": first, "q3": second}, {"q3": first, "q1": second}
            one, other = (SensorLayer(mj, each).read(data, torque=2.0) for each in models)
            np.testing.assert_allclose(one, other[::-1], rtol=1e-13)


def test_what_is_one_environment_and_what_are_several() -> None:
    mj = robot()
    model = eccentric(30.0, terms=[T.Latency(1e-3)])
    data = posed(mj)
    one = SensorLayer(mj, {"q0": model, "q2": model}).read(data)
    assert one.shape == (2,)
    layer = SensorLayer(mj, {"q0": model, "q2": model})
    # Its number may change, where none has a past: more, one, fewer, none.
    for count in (2, 3, 1, 2, 0, 1):
        for worlds in ([data] * count, (data,) * count):
            if count:
                np.testing.assert_array_equal(layer.read(worlds), np.tile(one, (count, 1)))
        batch = SimpleNamespace(qpos=np.tile(data.qpos, (count, 1)), qvel=np.zeros((count, mj.nv)))
        np.testing.assert_array_equal(layer.read(batch), np.tile(one, (count, 1)))
    np.testing.assert_array_equal(layer.read(data), one)


def test_a_reading_at_its_indicated_angle_solves_its_equation() -> None:
    """r - e(r) = true angle, for errors of either sign that grow by up to 0.7 a radian."""
    mj = robot()
    print("seed 8")
    angles = np.random.default_rng(8).uniform(-3.0, 3.0, (7, 4))
    # At one of them there is nothing to look for.
    angles[0] = 0.0
    slopes = {"q0": 0.0007, "q1": -0.7, "q2": 0.7, "q3": -0.02}
    models = {
        name: ta.HarmonicModel(
            [ta.Shaft("output", 1, [1], [0.0], [slope * unit])],
            period=2.0 * np.pi * unit,
            argument="indicated",
        )
        for (name, slope), unit in zip(slopes.items(), (1.0, 180.0 / np.pi, 1.0, 2e3), strict=True)
    }
    layer = SensorLayer(mj, models)
    for part in (angles, *angles[:, None], angles[:0]):
        qpos = np.zeros((len(part), mj.nq))
        qpos[:, 7:11] = part
        found = layer.read(SimpleNamespace(qpos=qpos, qvel=np.zeros((len(part), mj.nv))))
        left = found - np.array([*slopes.values()]) * np.sin(found) - part
        assert np.max(np.abs(left), initial=0.0) < 5e-13
        layer.reset()


def test_a_reading_that_is_refused_leaves_the_travel_before() -> None:
    """A spring that is wound up stays so: the next reading is as without the failure."""
    mj = robot()
    steep = ta.HarmonicModel(
        [ta.Shaft("output", 1, [1], [0.0], [1.5])],
        argument="indicated",
        terms=[T.PreslidingHysteresis(300 * A, 0.3)],
    )
    layers = [SensorLayer(mj, {"near": steep}) for _ in range(2)]
    data = posed(mj)
    # Of readings at which the error hardly changes, and wound up downwards.
    down, data.qvel[:] = np.linspace(0.5, 0.3, 9), -1.0
    for angle in down[:-1]:
        data.sensordata[mj.sensor("near").adr] = angle
        first, second = (layer.read(data) for layer in layers)
        np.testing.assert_array_equal(first, second)
    # At a reading near pi the error falls by more than the angle grows.
    data.sensordata[mj.sensor("near").adr], data.qvel[:] = 2.8, 1.0
    refusal = """^the model of joint 'near' gives no reading .* `argument="reference"`$"""
    with pytest.raises(ArgumentError, match=refusal):
        layers[0].read(data)
    data.sensordata[mj.sensor("near").adr], data.qvel[:] = down[-1], -1.0
    np.testing.assert_array_equal(*(layer.read(data) for layer in layers))


def test_every_joint_is_reset_and_one_before_any_reading() -> None:
    mj = robot()
    model = ta.HarmonicModel([], terms=[T.PreslidingHysteresis(30 * A, 0.1)])
    layer, fresh = (SensorLayer(mj, dict.fromkeys(("q0", "q1", "q2"), model)) for _ in range(2))
    layer.reset()
    layer.reset([7])  # nothing was read: there is nothing to forget
    ways = [mujoco.MjData(mj) for _ in range(4)]
    for step in range(20):
        for k, data in enumerate(ways):
            data.qpos[7:11], data.qvel[:] = (k + 1.0) * 0.01 * step, 1.0
        layer.read(ways)
    for data in ways:
        data.qpos[7:11], data.qvel[:] = data.qpos[7:11] - 0.01, -1.0
    before = layer.read(ways)
    layer.reset([-1, 1])
    now, first = layer.read(ways), fresh.read(ways)
    np.testing.assert_array_equal(now[[1, 3]], first[[1, 3]])
    np.testing.assert_array_equal(now[[0, 2]], before[[0, 2]])
    assert not np.isclose(before, first, rtol=0.0, atol=A).any()
    for wrong, told in (([4], r"\[4\]"), ([True] * 3, r"\[True, True, True\]")):
        mask = "a mask of the 4 that were read, or numbers below 4, got "
        with pytest.raises(ArgumentError, match=mask + told + "$"):
            layer.reset(wrong)
    with pytest.raises(ArgumentError) as refused:
        layer.reset([False] * 99)
    assert len(str(refused.value)) < 160
    layer.reset()
    np.testing.assert_array_equal(layer.read(ways), first)


def test_signals_are_those_of_each_joint_and_environment() -> None:
    """Given as numbers, of each joint, or each environment; velocities in place of MuJoCo's."""
    mj = robot()
    factors = {"q2": 3e-4, "q0": 5e-4, "near": 7e-4}
    models = {name: ta.HarmonicModel([], terms=[T.Latency(k)]) for name, k in factors.items()}
    late = np.array([*factors.values()])
    worlds = [posed(mj) for _ in range(2)]
    for e, data in enumerate(worlds):
        data.qvel[6:10] = np.array([1.0, 2.0, 4.0, 8.0]) * (1.0 - 3.0 * e)
    own = np.array([[4.0, 1.0, 2.0], [-8.0, -2.0, -4.0]])
    layer = SensorLayer(mj, models)
    still = ANGLES[[2, 0, 1]]
    np.testing.assert_allclose(layer.read(worlds), still - late * own, rtol=1e-13)
    for given in (0.5, np.array([0.3, 0.2, 0.1]), np.array([[2.0], [5.0]]), own + 1.0):
        found = layer.read(worlds, velocity=given)
        np.testing.assert_allclose(found, still - late * given * np.ones((2, 3)), rtol=1e-13)


def test_the_signal_that_is_missing_first_is_told_with_its_joint() -> None:
    mj = robot()
    data = posed(mj)
    both = ta.HarmonicModel([], terms=[T.CurrentCoupling(A), T.ThermalDrift(A), T.Backlash(A)])
    layer = SensorLayer(mj, {"q0": eccentric(1.0), "far": both})
    first, second = (name for name in both.signals if name != "direction")
    said = rf"the model of joint 'far' needs {first}, .*: give read\(data, {first}=...\)$"
    with pytest.raises(MissingSignalError, match=said):
        layer.read(data)
    with pytest.raises(MissingSignalError, match=f"needs {second}, "):
        layer.read(data, **{first: 1.0})
    # The direction of travel is that of the velocity, or of the angle.
    way = ta.HarmonicModel([], terms=[T.DirectionalPattern((1.0,), (3.0 * A,), (0.0,))])
    assert way.signals == ("direction",)
    data.qvel[:] = -1.0
    found = SensorLayer(mj, {"q1": way}).read(data)[0] + 0.7
    assert found == pytest.approx(-3.0 * A * np.cos(-0.7), rel=1e-9)
    # Of batches that have no torque.
    soft = SensorLayer(mj, {"q1": ta.HarmonicModel([], terms=[T.TorsionalCompliance(A)])})
    bare = SimpleNamespace(qpos=data.qpos, qvel=data.qvel)
    with pytest.raises(MissingSignalError, match="joint 'q1' needs torque"):
        soft.read(bare)
    said = "^there is no signal `mass=`; there are velocity, torque, temperature, current$"
    with pytest.raises(ArgumentError, match=said):
        layer.read(data, current=1.0, mass=2.0)
    with pytest.raises(ArgumentError, match="no signal `direction=`"):
        layer.read(data, direction=1.0)


def test_names_that_are_none_are_told_with_those_that_there_are() -> None:
    mj = robot()
    plain = eccentric(1.0)
    for wrong, said in (
        ({"q0": plain, "q": plain}, "no joint 'q'.*; it has , q0, q1, q2, q3, rail; did"),
        ({"q0": plain, "raile": plain}, r"no joint 'raile'; it has .*; did you mean rail\?"),
        ({"q0": plain, "push": plain}, "^sensor 'push' is not a jointpos"),
        ({"q0": plain, "gyro": plain}, "^sensor 'gyro' is not a jointpos"),
        ({"q0": plain, "rail": plain}, "^joint 'rail' is not a hinge"),
        ({"q0": plain, "q1": 7.0}, r"^models\['q1'\] must be a HarmonicModel, got float: of a fit"),
        ({}, r'^models must name a joint .*`ta.export_model\(model, "mujoco"\)` writes$'),
    ):
        with pytest.raises(ArgumentError, match=said):
            SensorLayer(mj, wrong)
    ball = "<body><joint name='hip' type='ball'/><geom size='.1'/></body>"
    for bodies, said in (
        (ball, "joint 'hip' is not a hinge"),
        ("", "no joint 'hip'; it has none$"),
    ):
        other = mujoco.MjModel.from_xml_string(
            f"<mujoco><worldbody><geom size='.1'/>{bodies}</worldbody></mujoco>"
        )
        with pytest.raises(ArgumentError, match=said):
            SensorLayer(other, {"hip": plain})
