"""Encoders in MuJoCo: readings against the model, of one environment and of many."""

import mujoco
import numpy as np
import pytest

import trueangle as ta
from trueangle import terms as T
from trueangle.errors import ArgumentError, MissingSignalError
from trueangle.simulators.mujoco import SensorLayer

A = np.pi / 648_000.0
ROBOT = """
<mujoco>
  @include@
  <worldbody>
    <body>
      <joint name="elbow"@class@/>
      <geom size=".1" mass="1"/>
      <body>
        <joint name="wrist" axis="0 1 0"/>
        <joint name="rail" type="slide"/>
        <geom size=".1" mass="1"/>
      </body>
    </body>
  </worldbody>
  <sensor><jointpos name="encoder" joint="wrist"/><clock name="clock"/></sensor>
</mujoco>
"""
#: With a state at the true angle, and in degrees at the indicated one.
ELBOW = ta.HarmonicModel(
    [ta.Shaft("output", 1, [1, 2], [0.002, 0.0], [0.0, 0.001])],
    constant=0.01,
    terms=[T.Backlash(20 * A), T.Latency(0.002), T.TorsionalCompliance(3 * A)],
)
WRIST = ta.HarmonicModel(
    [ta.Shaft("output", 1, [1, 2], [0.002, 0.0], [0.0, 0.1])],
    period=360.0,
    argument="indicated",
    terms=[T.PreslidingHysteresis(0.01, 0.5)],
)
PLAIN = ta.HarmonicModel([ta.Shaft("output", 1, [1], [0.0], [0.002])])


NAMES = ("elbow", "wrist")


def robot(include="", group=""):
    return mujoco.MjModel.from_xml_string(
        ROBOT.replace("@include@", include).replace("@class@", group)
    )


def poses(count=400):
    t = np.arange(count)
    angles = np.stack([2.0 * np.sin(t / 50.0), np.cos(t / 30.0), 0.0 * t], axis=1)
    return angles, np.gradient(angles, 0.002, axis=0)


def walked(layer, mj):
    data, rows = mujoco.MjData(mj), []
    for angle, velocity in zip(*poses(), strict=True):
        data.qpos[:], data.qvel[:] = angle, velocity
        mujoco.mj_forward(mj, data)
        rows.append(layer.read(data, torque=2.0))
    return np.array(rows)


def test_readings_are_those_of_the_models_in_the_order_of_the_mapping():
    mj = robot()
    layer = SensorLayer(mj, {"encoder": WRIST, "elbow": ELBOW})
    assert layer.names == ("encoder", "elbow")
    readings = walked(layer, mj)
    angles, velocities = poses()
    error = ELBOW.error(angles[:, 0], velocity=velocities[:, 0], torque=2.0)
    assert np.max(np.abs(readings[:, 1] - angles[:, 0] - error)) < 1e-14
    back = WRIST.corrector()(np.degrees(readings[:, 0]), velocity=np.degrees(velocities[:, 1]))
    assert np.max(np.abs(np.radians(back) - angles[:, 1])) < 1e-12
    layer.reset()
    assert np.array_equal(walked(layer, mj), readings)
    # Without a reset the travel before is known, and the first reading is another.
    assert walked(layer, mj)[0, 0] != readings[0, 0]


def test_environments_are_read_at_once_and_each_has_its_own_travel():
    mj = robot()
    angles, velocities = poses()
    worlds = [mujoco.MjData(mj) for _ in range(3)]
    layer = SensorLayer(mj, {"elbow": ELBOW, "wrist": PLAIN})
    shifts = np.array([0.0, 0.4, -0.3])
    found = []
    for angle, velocity in zip(angles, velocities, strict=True):
        for world, shift, sign in zip(worlds, shifts, (1.0, -1.0, 1.0), strict=True):
            world.qpos[:], world.qvel[:] = sign * angle + shift, sign * velocity
        found.append(layer.read(worlds, torque=np.zeros((3, 2))))
    found = np.array(found)
    assert found.shape == (400, 3, 2)
    for e, (shift, sign) in enumerate(zip(shifts, (1.0, -1.0, 1.0), strict=True)):
        angle = sign * angles[:, 0] + shift
        error = ELBOW.error(angle, velocity=sign * velocities[:, 0], torque=0.0)
        assert np.max(np.abs(found[:, e, 0] - angle - error)) < 1e-14

    # Arrays of a batch do as well, where a model has no state.
    class Batch:
        qpos = np.stack([world.qpos for world in worlds])
        qvel = np.stack([world.qvel for world in worlds])

    plain = SensorLayer(mj, {"wrist": PLAIN}).read(Batch())
    assert np.array_equal(plain, found[-1][:, 1:])
    with pytest.raises(ArgumentError, match="3 environments were read before, and 2 now"):
        layer.read(worlds[:2], torque=0.0)
    layer.reset([True, False, False])
    layer.read(worlds, torque=0.0)


def test_a_model_in_degrees_gives_the_same_reading():
    degrees = ta.HarmonicModel([], period=360.0, terms=[T.Latency(0.002)])
    radians = ta.HarmonicModel([], terms=[T.Latency(0.002)])
    mj = robot()
    data = mujoco.MjData(mj)
    data.qpos[0], data.qvel[0] = 0.3, 2.0
    for model in (degrees, radians):
        assert SensorLayer(mj, {"elbow": model}).read(data)[0] == pytest.approx(0.296, rel=1e-12)


def test_a_torque_is_that_of_the_actuators():
    xml = (
        ROBOT.replace("@include@", "")
        .replace("@class@", "")
        .replace("</mujoco>", "<actuator><motor joint='elbow'/></actuator></mujoco>")
    )
    mj = mujoco.MjModel.from_xml_string(xml)
    data = mujoco.MjData(mj)
    data.ctrl[0] = 4.0
    mujoco.mj_forward(mj, data)
    soft = ta.HarmonicModel([], terms=[T.TorsionalCompliance(3 * A)])
    assert SensorLayer(mj, {"elbow": soft}).read(data)[0] == pytest.approx(12 * A, rel=1e-12)


def test_a_fragment_is_included(tmp_path):
    path = tmp_path / "sensor.xml"
    made = ta.export_model(
        ELBOW, "mujoco", path, joint="elbow", damping=2.0, frictionloss=0.1, armature=0.02,
        stiffness=1.5, ripple="4:0.1:30,1:0.02:0",
    )  # fmt: skip
    assert made.left_out == []
    (tmp_path / "robot.xml").write_text(
        ROBOT.replace("@include@", '<include file="sensor.xml"/>').replace(
            "@class@", ' class="trueangle_elbow"'
        )
    )
    mj = mujoco.MjModel.from_xml_path(str(tmp_path / "robot.xml"))
    assert list(mj.dof_damping) == [2.0, 0.0, 0.0]
    assert list(mj.dof_frictionloss) == [0.1, 0.0, 0.0]
    assert list(mj.dof_armature) == [0.02, 0.0, 0.0]
    assert list(mj.jnt_stiffness) == [1.5, 0.0, 0.0]
    data = mujoco.MjData(mj)
    for angle in np.linspace(-4.0, 4.0, 17):
        data.qpos[0] = angle
        mujoco.mj_forward(mj, data)
        ripple = 0.1 * np.sin(4.0 * angle + np.radians(30.0)) + 0.02 * np.sin(angle)
        assert data.qfrc_actuator[0] == pytest.approx(ripple, abs=1e-15)
    embedded = SensorLayer(mj)
    assert embedded.names == ("elbow",)
    given = SensorLayer(robot(), {"elbow": ELBOW})
    assert np.array_equal(walked(embedded, mj), walked(given, robot()))
    assert ta.import_model(path, "mujoco") == ELBOW
    (tmp_path / "none.xml").write_text("<mujoco/>")
    with pytest.raises(ta.errors.FileError, match="holds no model of joint"):
        ta.import_model(tmp_path / "none.xml", "mujoco")


def test_a_joint_of_a_floating_base_is_read_where_it_stands():
    """A free body has 7 places and 6 velocities, and torques, before those of its joints."""
    floating = (
        ROBOT.replace("@include@", "").replace("@class@", "").replace("<body>", "<body><freejoint/>"
        "<geom size='.1' mass='1'/><body>", 1).replace("</worldbody>", "</body></worldbody>")
    )  # fmt: skip
    floating = floating.replace(
        "</mujoco>", "<actuator><motor joint='wrist' ctrlrange='-9 9'/></actuator></mujoco>"
    )
    mj = mujoco.MjModel.from_xml_string(floating)
    data = mujoco.MjData(mj)
    rng = np.random.default_rng(5)
    data.qpos[7:], data.qvel[:] = [0.4, 1.1, 0.0], rng.normal(size=mj.nv)
    data.ctrl[:] = 3.0
    mujoco.mj_forward(mj, data)
    model = ELBOW.replace(terms=(T.Latency(0.002), T.TorsionalCompliance(3 * A)))
    readings = SensorLayer(mj, {"elbow": model, "wrist": model}).read(data)
    expected = [
        angle + float(model.error(angle, velocity=velocity, torque=torque))
        for angle, velocity, torque in zip((0.4, 1.1), data.qvel[6:8], (0.0, 3.0), strict=True)
    ]
    np.testing.assert_allclose(readings, expected, rtol=1e-12)


def test_the_noise_of_a_file_is_that_of_its_joint():
    made = ta.export_model(PLAIN, "mujoco", joint="elbow", noise_std=2e-4)
    include = made.text.partition("<mujoco>")[2].rpartition("</mujoco>")[0]
    mj = robot(include)
    data = mujoco.MjData(mj)
    noise = SensorLayer(mj, seed=6).read([data] * 2000)
    assert np.std(noise) == pytest.approx(2e-4, rel=5.0 / np.sqrt(4000.0))
    assert not SensorLayer(mj, {"elbow": PLAIN}).read(data).any()
    # Beside a joint that has none.
    both = ""
    for joint, std in (("elbow", 2e-4), ("wrist", 0.0)):
        text = ta.export_model(PLAIN, "mujoco", joint=joint, noise_std=std).text
        both += text.partition("<mujoco>")[2].rpartition("</mujoco>")[0]
    layer = SensorLayer(robot(both), seed=6)
    noise = layer.read([data] * 2000).std(axis=0)[[layer.names.index(n) for n in NAMES]]
    assert noise == pytest.approx([2e-4, 0.0], rel=5.0 / np.sqrt(4000.0))


def test_noise_is_new_in_every_environment_and_joint():
    """Of their own sizes, and what one reads tells nothing of another."""
    mj = robot()
    data = mujoco.MjData(mj)
    layer = SensorLayer(mj, {"elbow": PLAIN, "wrist": PLAIN}, noise_std=1e-4, seed=4)
    noise = np.concatenate([layer.read([data] * 500) for _ in range(4)])
    # Five deviations of 2000 readings each.
    np.testing.assert_allclose(noise.std(axis=0), 1e-4, rtol=5.0 / np.sqrt(4000.0))
    assert abs(np.corrcoef(noise.T)[0, 1]) < 5.0 / np.sqrt(2000.0)
    assert abs(np.corrcoef(noise[:-1, 0], noise[1:, 0])[0, 1]) < 5.0 / np.sqrt(2000.0)


def test_noise_is_white_and_of_the_stated_size():
    mj = robot()
    data = mujoco.MjData(mj)
    layer = SensorLayer(mj, {"wrist": PLAIN}, noise_std=1e-4, seed=3)
    noise = np.array([layer.read(data)[0] for _ in range(4000)])
    assert np.std(noise) == pytest.approx(1e-4, rel=0.06)  # of four thousand, five deviations
    again = SensorLayer(mj, {"wrist": PLAIN}, noise_std=1e-4, seed=3)
    assert again.read(data)[0] == noise[0]


def test_signals_that_mujoco_does_not_have_are_asked_for():
    mj = robot()
    data = mujoco.MjData(mj)
    warm = ta.HarmonicModel([], terms=[T.ThermalDrift(2 * A)])
    layer = SensorLayer(mj, {"elbow": warm})
    with pytest.raises(MissingSignalError, match="needs temperature, which MuJoCo does not have"):
        layer.read(data)
    assert layer.read(data, temperature=25.0)[0] == pytest.approx(10 * A, rel=1e-12)
    with pytest.raises(
        ArgumentError, match=r"no signal `temprature=`; .* did you mean temperature\?"
    ):
        layer.read(data, temprature=25.0)
    with pytest.raises(ArgumentError, match="noise_std must be 0 or more"):
        SensorLayer(mj, {"elbow": PLAIN}, noise_std=-1.0)


def arm(joints):
    bodies = "".join(f"<body><joint name='q{j}'/><geom size='.1'/>" for j in range(joints))
    return mujoco.MjModel.from_xml_string(
        f"<mujoco><worldbody>{bodies}{'</body>' * joints}</worldbody></mujoco>"
    )


class Batch:
    def __init__(self, qpos, qvel):
        self.qpos, self.qvel = qpos, qvel


def test_many_environments_each_have_the_state_that_one_alone_has():
    rng = np.random.default_rng(91)
    print("seed 91")
    series = ta.Shaft("output", 1, [1, 2], [1e-4, 0.0], [0.0, 3e-5])
    springs = (T.Backlash(5 * A), T.PreslidingHysteresis(30 * A, 0.01, 0.3), T.Latency(1e-3))
    models = {
        "q0": ta.HarmonicModel([series], terms=springs),
        "q1": ta.HarmonicModel([series], argument="indicated", terms=springs[:1]),
        "q2": ta.HarmonicModel([series]),
    }
    count, steps = 300, 40  # more than a block of the core
    layer = SensorLayer(arm(3), models)
    qpos = np.cumsum(rng.normal(0.0, 0.02, (steps, count, 3)), axis=0)
    qvel = rng.normal(0.0, 1.0, (steps, count, 3))
    found = np.array([layer.read(Batch(*both)) for both in zip(qpos, qvel, strict=True)])
    for e in (0, 131, 299):
        alone = SensorLayer(arm(3), models)
        one = [alone.read(Batch(x[e], v[e])) for x, v in zip(qpos, qvel, strict=True)]
        np.testing.assert_array_equal(found[:, e], np.array(one))
        error = models["q0"].error(qpos[:, e, 0], velocity=qvel[:, e, 0])
        np.testing.assert_array_equal(found[:, e, 0], qpos[:, e, 0] + error)
    layer.reset([131])
    before = layer.read(Batch(qpos[0], qvel[0]))
    np.testing.assert_array_equal(before[131], found[0, 131])


@pytest.mark.parametrize(
    ("asked", "forgot"),
    [
        (None, {0, 1, 2}),
        ([False, True, True], {1, 2}),  # as numbers, 0 and 1
        ([True, False, True], {0, 2}),
        ([2, 0], {0, 2}),
        (1, {1}),
        ([], set()),
    ],
)
def test_environments_that_are_reset_forget_their_travel_and_the_others_none(asked, forgot):
    """Play after a way up and a little down: the side is still the upper one."""
    models = {"q0": ta.HarmonicModel([], terms=[T.PreslidingHysteresis(30 * A, 0.1)])}
    layers = [SensorLayer(arm(1), models) for _ in range(3)]
    ups = np.linspace(0.0, 1.0, 20)[:, None, None] + np.zeros((1, 3, 1))
    for up in ups:
        for layer in layers[:2]:
            layer.read(Batch(up, np.ones((3, 1))))
    some, none, fresh = layers
    some.reset(asked)
    down = Batch(ups[-1] - 0.01, -np.ones((3, 1)))
    found, kept, first = (layer.read(down)[:, 0] for layer in (some, none, fresh))
    assert not np.isclose(kept, first).any()
    wanted = [first[e] if e in forgot else kept[e] for e in range(3)]
    np.testing.assert_array_equal(found, wanted)
    for other in ([3], [True, False], 0.5):
        with pytest.raises(ArgumentError, match="a mask of the 3 that were read, or numbers below"):
            some.reset(other)


@pytest.mark.parametrize(
    ("signal", "value", "term"),
    [
        ("temperature", 25.0, T.ThermalDrift(2 * A)),
        ("torque", 5.0, T.TorsionalCompliance(2 * A)),
        ("velocity", 5.0, T.Latency(2 * A)),
        ("current", 5.0, T.CurrentCoupling(2 * A)),
    ],
)
def test_a_signal_that_is_given_is_taken_in_place_of_mujocos(signal, value, term):
    layer = SensorLayer(arm(1), {"q0": ta.HarmonicModel([], terms=[term])})
    sign = -1.0 if signal == "velocity" else 1.0  # a late reading lags behind
    data = Batch(np.full((1, 1), 0.5), np.zeros((1, 1)))
    found = layer.read(data, **{signal: value})[0, 0] - 0.5
    assert found == pytest.approx(sign * 10 * A, rel=1e-9)


def test_a_coupled_joint_takes_the_reading_of_the_other():
    series = ta.Shaft("output", 1, [1], [0.0], [1e-3])
    eccentric = ta.HarmonicModel([series])
    degrees = ta.HarmonicModel([], period=360.0, terms=[T.JointCoupling("q1", 0.1)])
    mj = arm(3)
    data = mujoco.MjData(mj)
    data.qpos[:] = 0.3, 0.7, -0.2
    layer = SensorLayer(mj, {"q0": degrees, "q1": eccentric})
    reading = layer.read(data)
    assert reading[0] == pytest.approx(0.3 + 0.1 * reading[1], abs=1e-14)
    # Of a joint that the layer does not read, the angle itself.
    assert SensorLayer(mj, {"q0": degrees}).read(data)[0] == pytest.approx(0.37, abs=1e-14)
    circle = ta.HarmonicModel([], terms=[T.JointCoupling("q0", 0.1)])
    # Those that can be read are none of the circle.
    with pytest.raises(ArgumentError, match=r"^joints q0, q1 are coupled in a circle"):
        SensorLayer(mj, {"q2": eccentric, "q0": degrees, "q1": circle})
    nobody = ta.HarmonicModel([], terms=[T.JointCoupling("q9", 0.1)])
    with pytest.raises(ArgumentError, match="no joint 'q9'"):
        SensorLayer(mj, {"q0": nobody})


@pytest.mark.parametrize("environments", [None, 3])
def test_each_joint_has_a_temperature_of_its_own(environments):
    mj = robot()
    grows = {"elbow": 2.0, "wrist": 5.0}
    models = {
        name: ta.HarmonicModel([], terms=[T.ThermalDrift(a * A)]) for name, a in grows.items()
    }
    layer = SensorLayer(mj, models)
    warm = np.array([30.0, 45.0])
    if environments is None:
        found = layer.read(mujoco.MjData(mj), temperature=warm)
        np.testing.assert_allclose(found, np.array([2.0 * 10.0, 5.0 * 25.0]) * A, rtol=1e-12)
        return
    all_of_it = warm + np.arange(environments)[:, None]
    data = [mujoco.MjData(mj) for _ in range(environments)]
    found = layer.read(data, temperature=all_of_it)
    wanted = np.array([2.0, 5.0]) * (all_of_it - 20.0) * A
    np.testing.assert_allclose(found, wanted, rtol=1e-12)
