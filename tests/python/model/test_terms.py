"""Terms: their parameters, their checks, their place in the model file."""

import csv
import json
import math
import pickle

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

import trueangle as ta
from trueangle import errors
from trueangle.cli import main
from trueangle.model.terms import (
    TERMS,
    ChannelSkew,
    CurrentCoupling,
    Curve,
    DirectionalPattern,
    JointCoupling,
    ScaleError,
    VaryingLine,
)

numbers = st.floats(-1e-3, 1e-3)
lines = st.lists(st.tuples(st.floats(0.5, 500.0), numbers, numbers), max_size=3).map(
    lambda rows: {
        name: tuple(row[i] for row in rows) for i, name in enumerate(("orders", "cosine", "sine"))
    }
)


@st.composite
def any_terms(draw):
    return (
        ta.Backlash(draw(numbers)),
        ta.PreslidingHysteresis(
            draw(numbers), draw(st.floats(0.1, 100.0)), draw(st.floats(0.0, 1.0))
        ),
        DirectionalPattern(**draw(lines)),
        ChannelSkew(draw(numbers), draw(st.floats(0.5, 500.0)), draw(numbers)),
        VaryingLine(**draw(lines), follows=draw(st.sampled_from(["speed", "torque"]))),
        ta.Latency(draw(numbers)),
        ta.FilterLag(draw(st.floats(0.1, 1e4))),
        ta.ThermalDrift(draw(numbers), draw(numbers), **draw(lines), reference_C=draw(numbers)),
        ta.TorsionalCompliance(draw(numbers), **draw(lines)),
        ta.StiffeningCompliance(
            draw(numbers), draw(numbers), draw(numbers), draw(st.floats(0.0, 9.0)), draw(numbers)
        ),
        CurrentCoupling(draw(numbers), **draw(lines)),
        JointCoupling(draw(st.text(min_size=1, max_size=9)), draw(numbers)),
        ta.LoadDependentGearError(
            **draw(lines), torque=draw(st.sampled_from(["signed", "absolute"]))
        ),
        ta.LocalDefect(
            draw(numbers), draw(st.floats(1.0, 9.0)), draw(numbers), draw(st.floats(0.1, 200.0))
        ),
        ScaleError(
            draw(st.floats(-0.3, 0.3)), draw(st.floats(-9.0, 0.0)), draw(st.floats(1.0, 9.0))
        ),
        Curve("torque", (draw(st.floats(-9.0, 0.0)), 1.0, 2.5), draw(st.tuples(*[numbers] * 3))),
    )


def model_with(*terms, **changes):
    shaft = ta.Shaft("output", 1.0, (1, 2), (0.01, 0.0), (0.0, 0.02))
    return ta.HarmonicModel((shaft,), period=360.0, terms=terms, **changes)


@given(terms=any_terms())
def test_every_term_survives_the_file_bit_for_bit(terms, tmp_path_factory):
    path = tmp_path_factory.mktemp("models") / "m.json"
    model = model_with(*terms)
    model.save(path)
    back = ta.load_model(path)
    assert back == model
    assert [repr(term) for term in back.terms] == [repr(term) for term in terms]
    assert {term.kind for term in terms} == set(TERMS)


def test_a_model_with_terms_is_a_value():
    model = model_with(ta.Backlash(0.01), ta.ThermalDrift(1e-3, orders=[1], cosine=[0], sine=[1]))
    assert pickle.loads(pickle.dumps(model)) == model
    assert hash(model) == hash(model.replace())
    assert model != model.replace(terms=())


def saved(tmp_path, term):
    path = tmp_path / "m.json"
    model_with(ta.Backlash(0.01)).save(path)
    content = json.loads(path.read_text())
    content["terms"] = [term]
    path.write_text(json.dumps(content))
    return path


@pytest.mark.parametrize(
    ("term", "said"),
    [
        ({"kind": "wobble", "size": 1.0}, r"terms\[0\].kind.*'wobble' is unknown.*backlash"),
        ({"half_width": 1.0}, r"terms\[0\].kind.*null is unknown"),
        ({"kind": "backlash"}, r"terms\[0\].*needs the parameter 'half_width'"),
        ({"kind": "backlash", "half_width": 1.0, "x": 2}, r"terms\[0\].*no parameter 'x'"),
        ({"kind": "backlash", "half_width": "1"}, r"terms\[0\].*half_width must be a finite"),
        ({"kind": "backlash", "half_width": True}, r"terms\[0\].*half_width.*number"),
        ({"kind": "backlash", "half_width": None}, r"terms\[0\].*half_width must be a finite"),
        ({"kind": "filter_lag", "cutoff_hz": 0}, r"terms\[0\].*cutoff_hz must be positive"),
        ({"kind": "thermal_drift", "orders": [1]}, r"terms\[0\].*equally long"),
        ({"kind": "thermal_drift", "orders": 1}, r"terms\[0\].*orders must be a list"),
        ("backlash", r"terms\[0\].*an object"),
    ],
)
def test_files_with_impossible_terms_are_refused(tmp_path, term, said):
    path = saved(tmp_path, term)
    with pytest.raises(errors.ModelFileError, match=said) as caught:
        ta.load_model(path)
    assert str(path) in str(caught.value)


@pytest.mark.parametrize(
    ("make", "said"),
    [
        (lambda: ta.Backlash(math.nan), "half_width must be a finite number"),
        (lambda: ta.PreslidingHysteresis(1.0, 0.0), "length must be positive"),
        (lambda: ta.PreslidingHysteresis(1.0, 1.0, 1.5), "start must be from 0 to 1"),
        (lambda: ta.LocalDefect(0.0, 0.0, 1.0), "width must be positive"),
        (lambda: ScaleError(0.1, 3.0, 3.0), r"stop must be beyond start \(3.0\)"),
        (lambda: ScaleError(1.0, 0.0, 3.0), "relative_error must be between -1 and 1"),
        (lambda: ta.LocalDefect(0.0, 1.0, 1.0, -1.0), "cycles_per_turn must be positive"),
        (lambda: ta.StiffeningCompliance(knee_Nm=-1.0), "knee_Nm must be 0 or more"),
        (lambda: ta.LoadDependentGearError([0.0], [1.0], [1.0]), "orders must be positive"),
        (lambda: ta.LoadDependentGearError([1], [1], [1], "both"), "torque must be one of signed"),
        (lambda: ta.LoadDependentGearError([1], [1, 2], [1]), "equally long"),
        (lambda: model_with("backlash"), r"terms\[0\] must be a term"),
    ],
)
def test_parameters_are_checked(make, said):
    with pytest.raises(errors.ArgumentError, match=said):
        make()


def test_friction_too_steep_to_invert_is_refused():
    # d error / d angle reaches 2 h / L right after a reversal.
    model_with(ta.PreslidingHysteresis(0.45, 1.0))
    with pytest.raises(errors.NotInvertibleError):
        model_with(ta.PreslidingHysteresis(0.5, 1.0))


def test_models_name_the_signals_they_need():
    assert model_with().signals == ()
    assert model_with(ta.Backlash(1.0)).signals == ()
    assert model_with(ta.Backlash(1.0)).uses_signals == ("direction", "velocity")
    assert model_with(ta.Backlash(-1.0)).signals == ("direction",)
    every = model_with(ta.Latency(1e-3), ta.ThermalDrift(1e-3), ta.TorsionalCompliance(1e-3))
    assert every.signals == every.uses_signals == ("velocity", "temperature", "torque")


def test_lines_of_broken_order_make_the_model_aperiodic():
    assert model_with(ta.TorsionalCompliance(0.0, [3], [1e-3], [0])).is_periodic
    assert not model_with(ta.TorsionalCompliance(0.0, [2.5], [1e-3], [0])).is_periodic


SIGNALS = ("velocity_deg_s", "temperature_C", "torque_Nm", "current_A")


@pytest.fixture
def joint():
    """A model in radians with every kind of signal."""
    shaft = ta.Shaft("output", 1.0, (1,), (0.003,), (0.002,))
    terms = [
        ta.Backlash(2e-4),
        ta.Latency(2e-3),
        ta.ThermalDrift(1e-5),
        ta.TorsionalCompliance(3e-5),
        CurrentCoupling(4e-5, orders=[2], cosine=[1e-5], sine=[0.0]),
    ]
    return ta.HarmonicModel([shaft], period=2.0 * math.pi, terms=terms)


def written_log(path, joint, rows=40_000, columns=SIGNALS):
    """A log of many blocks that ends in another direction than it begins, in degrees."""
    t = np.arange(rows) * 1e-3
    theta = 200.0 * np.sin(0.4 * t)
    speed = 80.0 * np.cos(0.4 * t)
    warm, load, current = 20.0 + 0.3 * t, 5.0 * np.sin(t), 2.0 * np.cos(3.0 * t)
    error = joint.error(
        np.radians(theta),
        velocity=np.radians(speed),
        temperature=warm,
        torque=load,
        current=current,
    )
    every = {
        "time_s": t,
        "velocity_deg_s": speed,
        "temperature_C": warm,
        "torque_Nm": load,
        "current_A": current,
        "indicated_deg": theta + np.degrees(error),
    }
    names = [name for name in every if name in ("indicated_deg", *columns)]
    with path.open("w", newline="") as file:
        writer = csv.writer(file)
        writer.writerow(names)
        writer.writerows(zip(*(every[name].tolist() for name in names), strict=True))
    return theta


def run(joint, folder, *options):
    joint.save(folder / "joint.json")
    log, out = folder / "log.csv", folder / "out.csv"
    status = main(["correct", str(log), "-m", str(folder / "joint.json"), "-o", str(out), *options])
    return status, out


def corrected(out):
    with out.open(newline="") as file:
        return np.array([float(row["corrected_deg"]) for row in csv.DictReader(file)])


def test_signals_come_from_their_columns_and_travel_crosses_blocks(tmp_path, joint):
    theta = written_log(tmp_path / "log.csv", joint)
    status, out = run(joint, tmp_path)
    assert status == 0
    # 1e-12 of a turn.
    np.testing.assert_allclose(corrected(out), theta, rtol=0, atol=3.6e-10)


def test_time_stamps_stand_in_for_the_velocity(tmp_path, joint):
    columns = ("time_s", "temperature_C", "torque_Nm", "current_A")
    theta = written_log(tmp_path / "log.csv", joint, columns=columns)
    status, out = run(joint, tmp_path)
    assert status == 0
    left = corrected(out)[1:] - theta[1:]
    # The velocity of the indicated angle, half a sample late: |error'| and acceleration
    # times the delay: 80 deg/s, slope 0.0036, 2 ms; 32 deg/s^2, 0.5 ms, 2 ms.
    bound = 80.0 * 0.0036 * 2e-3 + 32.0 * 0.5e-3 * 2e-3
    assert np.sort(np.abs(left))[-40] < 1.1 * bound
    # At a reversal the log jumps by the whole play within one step of 1 ms.
    jump = 2.0 * np.degrees(2e-4) * (2e-3 / 1e-3)
    assert np.abs(left).max() < 1.1 * (bound + jump)


@pytest.mark.parametrize(
    ("missing", "said"),
    [
        ("velocity_deg_s", "velocity_deg_s or time_s: the model's term 'latency'"),
        ("temperature_C", "temperature_C: the model's term 'thermal_drift'"),
        ("torque_Nm", "torque_Nm: the model's term 'torsional_compliance'"),
        ("current_A", "current_A: the model's term 'current_coupling'"),
    ],
)
def test_a_missing_column_is_named(tmp_path, joint, capsys, missing, said):
    columns = {*SIGNALS} - {missing}
    written_log(tmp_path / "log.csv", joint, rows=5, columns=columns)
    status, out = run(joint, tmp_path)
    assert status == 1
    error = capsys.readouterr().err
    assert said in error
    assert "log.csv" in error
    assert not out.exists()


def test_a_column_of_another_name(tmp_path, joint):
    theta = written_log(tmp_path / "log.csv", joint, rows=100)
    log = tmp_path / "log.csv"
    log.write_text(log.read_text().replace("temperature_C", "T_motor"))
    status, out = run(joint, tmp_path, "--signal", "temperature=T_motor")
    assert status == 0
    np.testing.assert_allclose(corrected(out), theta, rtol=0, atol=3.6e-10)


@pytest.fixture
def recording(tmp_path):
    """One recording cut in three logs, right after a reversal and while a spring winds up."""
    pytest.importorskip("pyarrow.parquet")
    theta = np.concatenate([np.linspace(0.0, 300.0, 900), np.linspace(300.0, 100.0, 1100)])
    terms = [ta.Backlash(0.3), ta.PreslidingHysteresis(0.2, 40.0)]
    model = ta.HarmonicModel([ta.Shaft("output", 1, [1], [0.1], [0.2])], period=360.0, terms=terms)
    said = np.mod(theta + model.error(theta) + 1e-3, 360.0)
    folder = tmp_path / "logs"
    folder.mkdir()
    for name, part in (("1", slice(0, 905)), ("2", slice(905, 930)), ("10", slice(930, 2000))):
        rows = "\n".join(repr(x) for x in said[part].tolist())
        (folder / f"{name}.csv").write_text(f"indicated_deg\n{rows}\n")
    return model, folder, model.correct(said)


def parts(out):
    return np.concatenate([corrected(out / f"{name}.csv") for name in ("1", "2", "10")])


def test_travel_crosses_the_borders_of_files(recording, tmp_path):
    model, folder, whole = recording
    assert ta.correct_logs(folder, model, tmp_path / "out").is_done
    np.testing.assert_array_equal(parts(tmp_path / "out"), whole)
    alone = ta.correct_logs(folder / "2.csv", model, tmp_path / "2.csv")
    assert alone.is_done
    # Without the log before, neither the direction nor the spring is known: the border counts.
    assert abs(corrected(tmp_path / "2.csv")[0] - whole[905]) > 0.1


def test_travel_is_taken_up_again_by_the_run_that_resumes(recording, tmp_path):
    model, folder, whole = recording
    out = tmp_path / "out"
    assert ta.correct_logs(folder, model, out).is_done
    (out / "2.csv").unlink()
    (out / "10.csv").unlink()
    report = ta.correct_logs(folder, model, out)
    assert [log.status for log in report.logs] == ["done before", "done", "done"]
    np.testing.assert_array_equal(parts(out), whole)


@pytest.mark.filterwarnings("default")  # the cluster's own warnings are not ours
def test_travel_crosses_files_on_a_cluster(recording, tmp_path):
    distributed = pytest.importorskip("distributed")
    model, folder, whole = recording
    with distributed.LocalCluster(
        n_workers=2, threads_per_worker=1, dashboard_address=":0", silence_logs=50
    ) as found:
        report = ta.correct_logs(folder, model, tmp_path / "out", scheduler=found.scheduler_address)
    assert report.is_done
    np.testing.assert_array_equal(parts(tmp_path / "out"), whole)


def test_a_velocity_without_a_unit_has_that_of_the_angle():
    """A log in radians whose speeds are named without a unit: radians per second."""
    from trueangle.logs.joints import _with_unit
    from trueangle.support.roles import RoleColumn

    speed = RoleColumn("velocity", "v", None)
    for unit in ("deg", "rad", "turn"):
        assert _with_unit(speed, unit).unit == f"{unit}/s"
    told = RoleColumn("velocity", "v", "rad/s")
    assert _with_unit(told, "deg") is told
    torque = RoleColumn("torque", "t", None)
    assert _with_unit(torque, "rad") is torque
