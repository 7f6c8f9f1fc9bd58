"""The joints of a robot: corrected together as each alone, saved in one file."""

import json
import pickle

import numpy as np
import pytest

import trueangle as ta


def models(seed, count=6, terms=False):
    """Models drawn at random; with terms every other one follows travel or needs torque."""
    rng = np.random.default_rng(seed)
    print(f"seed {seed}")
    made = {}
    for j in range(count):
        period = float(rng.choice([360.0, 2.0 * np.pi, 1.0]))
        sizes = rng.normal(0.0, 1e-4 * period, (2, 4)).tolist()
        added = (ta.Backlash(1e-4 * period), ta.TorsionalCompliance(1e-6 * period))
        made[f"q{j}"] = ta.HarmonicModel(
            [ta.Shaft("output", 1.0, [1, 2, 3, 7], *sizes)],
            period=period,
            terms=[added[j // 2 % 2]] if terms and j % 2 else [],
        )
    return made


def positions(made, rows, seed):
    rng = np.random.default_rng(seed)
    turn = np.array([model.period for model in made.values()])
    return np.cumsum(rng.normal(0.0, 0.05, (rows, len(made))), axis=0) * turn


SIGNALS = {"torque": [[3.0, -1.0, 2.0, 5.0, 0.5, -4.0]], "direction": 1.0}


@pytest.mark.parametrize("terms", [False, True])
def test_joints_together_are_corrected_as_each_alone(terms):
    made = models(1, terms=terms)
    robot = ta.Robot(made, name="arm")
    angles = positions(made, 300, 2)
    given = {"torque": np.tile(SIGNALS["torque"], (300, 1)), "velocity": np.gradient(angles)[0]}
    together = robot.correct(angles, **(given if terms else {}))
    assert together.shape == angles.shape
    step, alone = robot.compensator(), [model.compensator() for model in made.values()]
    for i, row in enumerate(angles):
        signals = {name: values[i] for name, values in given.items()}
        taken = step(row, **signals)
        for j, one in enumerate(alone):
            own = {name: float(values[j]) for name, values in signals.items()}
            assert taken[j] == one(float(row[j]), **own)
    for j, model in enumerate(made.values()):
        own = {name: values[:, j] for name, values in given.items()}
        np.testing.assert_array_equal(together[:, j], model.correct(angles[:, j], **own))


def test_one_position_is_a_row():
    made = models(3)
    robot = ta.Robot(made)
    (row,) = positions(made, 1, 4)
    np.testing.assert_array_equal(robot.correct(row), robot.compensator()(row))
    assert robot.correct(row.astype(np.float32)).dtype == np.float32
    np.testing.assert_array_equal(robot.correct(row.tolist()), robot.correct(row[None])[0])


@pytest.mark.parametrize("kind", [list, tuple, np.float32, np.int64, "strided"])
def test_a_step_takes_what_numpy_makes_angles_of(kind):
    made = models(5)
    step = ta.Robot(made).compensator()
    row = np.array([7.0, 1.0, 2.0, 3.0, 4.0, 5.0])
    given = row.astype(kind) if isinstance(kind, type) and issubclass(kind, np.generic) else row
    given = np.repeat(row, 2)[::2] if kind == "strided" else given
    given = kind(row.tolist()) if kind in (list, tuple) else given
    np.testing.assert_array_equal(step(given), step(row))


def test_a_step_writes_where_it_is_asked_to():
    made = models(6)
    step = ta.Robot(made).compensator()
    (row,) = positions(made, 1, 7)
    wanted, out = step(row), np.zeros(6)
    assert step(row, out=out) is out
    np.testing.assert_array_equal(out, wanted)
    assert step(row, out) is out
    assert step(row, out=row) is row
    np.testing.assert_array_equal(row, wanted)
    locked = np.zeros(6)
    locked.flags.writeable = False
    for wrong in (np.zeros(5), np.zeros(6, np.float32), np.zeros(12)[::2], locked, [0.0] * 6):
        with pytest.raises(ta.errors.ArgumentError, match="out must"):
            step(row, out=wrong)


def test_no_joint_moves_where_one_lacks_a_signal():
    made = models(8, terms=True)
    step, other = ta.Robot(made).compensator(), ta.Robot(made).compensator()
    row, later = positions(made, 2, 9)
    with pytest.raises(ta.errors.MissingSignalError, match=r"joint q3: .*torque"):
        step(row, direction=1.0)
    given = {"torque": SIGNALS["torque"][0], "direction": 1.0}
    np.testing.assert_array_equal(step(later, **given), other(later, **given))


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (
            lambda step, row: step(row[:5]),
            r"positions must have the shape \(6,\), .* q5; got \(5,\)",
        ),
        (lambda step, row: step(["a"] * 6), "positions must be real numbers"),
        (lambda step, row: step(row, velocity=[1.0, 2.0]), r"velocity must have the shape \(6,\)"),
        (lambda step, row: step(row, speed=1.0), "unexpected keyword argument 'speed'"),
        (lambda step, row: step(), "argument"),
        (lambda step, row: step(row, row, row), "argument"),
    ],
)
def test_wrong_arguments_of_a_step_are_named(call, says):
    made = models(10)
    (row,) = positions(made, 1, 11)
    with pytest.raises((TypeError, ta.errors.ArgumentError), match=says):
        call(ta.Robot(made).compensator(), row)


def test_a_step_goes_on_after_a_pickle_and_begins_anew_after_a_reset():
    made = models(12, terms=True)
    angles = positions(made, 40, 13)
    given = {"torque": SIGNALS["torque"][0]}
    step = ta.Robot(made).compensator()
    for row in angles[:20]:
        step(row, velocity=np.ones(6), **given)
    again = pickle.loads(pickle.dumps(step))
    back = {"velocity": -np.ones(6), **given}
    begun = [step(row, **back) for row in angles[20:]]
    np.testing.assert_array_equal([again(row, **back) for row in angles[20:]], begun)
    step.func.__self__.reset()
    fresh = ta.Robot(made).compensator()
    np.testing.assert_array_equal(
        step(angles[0], direction=1.0, **given), fresh(angles[0], direction=1.0, **given)
    )


def test_a_robot_is_saved_and_read_back_bit_for_bit(tmp_path):
    robot = ta.Robot(
        models(14, terms=True), name="arm", signals={"q1": {"indicated": ("elbow", "rad")}}
    )
    robot.save(tmp_path / "robot.json")
    content = json.loads((tmp_path / "robot.json").read_text())
    assert (content["format"], content["version"]) == ("trueangle-robot", 1)
    assert list(content["joints"]) == list(robot.joints)
    found = ta.load_robot(tmp_path / "robot.json")
    assert (found, found.name, found.signals) == (robot, "arm", robot.signals)
    assert hash(found) == hash(robot)
    assert pickle.loads(pickle.dumps(found)) == robot
    robot["q0"].save(tmp_path / "one.json")
    assert content["joints"]["q0"] == json.loads((tmp_path / "one.json").read_text())


def test_each_loader_names_the_other(tmp_path):
    robot = ta.Robot(models(15, count=2))
    robot.save(tmp_path / "robot.json")
    robot["q0"].save(tmp_path / "one.json")
    with pytest.raises(ta.errors.ModelFileError, match=r"ta\.load_robot"):
        ta.load_model(tmp_path / "robot.json")
    with pytest.raises(ta.errors.ModelFileError, match=r"ta\.load_model"):
        ta.load_robot(tmp_path / "one.json")


@pytest.mark.parametrize(
    ("change", "says"),
    [
        (lambda c: c.update(version=9), "key 'version': 9 is later than 1"),
        (lambda c: c.update(joints={}), "key 'joints': 1 to 256 joints"),
        (lambda c: c["joints"]["q1"].update(period=0.0), "key 'joints.q1.period': one turn"),
        (lambda c: c["joints"]["q1"]["shafts"][0].update(sine=["x"] * 4), r"joints.q1.shafts\[0\]"),
        (lambda c: c["joints"].update(q1=5), "key 'joints.q1': is not a model file"),
        (lambda c: c.update(signals={"q9": {}}), "no joint 'q9'; the joints are q0, q1"),
        (lambda c: c.update(signals={"q0": {"indicated": 5}}), "signals.q0.indicated"),
        (lambda c: c.update(more=1), "key 'more': is unknown"),
    ],
)
def test_a_file_that_is_no_robot_says_where(change, says, tmp_path):
    ta.Robot(models(16, count=2)).save(tmp_path / "robot.json")
    content = json.loads((tmp_path / "robot.json").read_text())
    change(content)
    (tmp_path / "robot.json").write_text(json.dumps(content))
    with pytest.raises(ta.errors.ModelFileError, match=says):
        ta.load_robot(tmp_path / "robot.json")


@pytest.mark.parametrize(
    ("call", "says"),
    [
        (lambda m: ta.Robot({}), "models is empty"),
        (lambda m: ta.Robot({"a": 5}), r"models\['a'\] must be a trueangle.HarmonicModel"),
        (lambda m: ta.Robot({1: m["q0"]}), "a joint's name must be a text"),
        (lambda m: ta.Robot(m, signals={"x": {}}), "no joint 'x'; the joints are q0, q1"),
        (lambda m: ta.Robot(m).correct([1.0]), r"positions must have the shape \(2,\) or \(N, 2\)"),
        (lambda m: ta.Robot(m).correct(["a", "b"]), "positions must be real numbers"),
        (lambda m: ta.Robot(m).correct([1.0, 2.0], torque=[1.0] * 3), "torque must have the shape"),
    ],
)
def test_what_is_no_robot_is_refused_in_words(call, says):
    with pytest.raises(ta.errors.ArgumentError, match=says):
        call(models(17, count=2))


def test_a_log_of_all_joints_is_corrected_by_the_file_of_the_robot(tmp_path):
    made = models(18, count=3)
    names = {joint: f"{joint} pos" for joint in made}
    signals = {joint: {"indicated": (name, None)} for joint, name in names.items()}
    angles = positions(made, 50, 19)
    table = {name: angles[:, j] for j, name in enumerate(names.values())}
    robot = ta.Robot(made, signals=signals)
    robot.save(tmp_path / "robot.json")
    wanted = robot.correct(angles)
    for model in (robot, tmp_path / "robot.json"):
        found = ta.correct(_frame(table), model)
        added = [name for name in found.columns if name not in table]
        np.testing.assert_allclose(found[added].to_numpy(), wanted, rtol=0, atol=1e-12)
    other = {joint: angles[:, j] for j, joint in enumerate(made)}
    found = ta.correct(_frame(other), robot, column={joint: joint for joint in made})
    np.testing.assert_allclose(found.to_numpy()[:, 3:], wanted, rtol=0, atol=1e-12)


def _frame(table):
    import pandas as pd

    return pd.DataFrame(table)


def test_a_result_that_nobody_holds_is_used_again():
    shaft = ta.Shaft("output", 1, [1], [0.0], [0.5])
    robot = ta.Robot({name: ta.HarmonicModel([shaft], period=360.0) for name in "abc"})
    step = robot.compensator()
    x = np.array([90.5, 0.0, 180.0])
    kept = [step(x + k) for k in range(5)]
    assert len({id(array) for array in kept}) == 5
    for k, array in enumerate(kept):
        np.testing.assert_array_equal(array, robot.correct(x + k))
    # Views and results taken as angles are held, too.
    view = step(x)[1:]
    held = view.copy()
    later = step(step(step(x + 7.0)))
    np.testing.assert_array_equal(view, held)
    np.testing.assert_array_equal(later, robot.correct(robot.correct(robot.correct(x + 7.0))))
    places = {id(step(x)) for _ in range(50)}
    assert len(places) <= 2
    frozen = step(x)
    frozen.flags.writeable = False
    was = frozen.copy()
    del kept, later
    for _ in range(4):
        step(x + 1.0)
    np.testing.assert_array_equal(frozen, was)
