"""Going on where a run stopped: only outputs of the same request count, and turns stay counted."""

import json

import numpy as np
import pytest

import trueangle as ta
from trueangle.cli import main
from trueangle.model.terms import Backlash, ThermalDrift

from .conftest import made_angles, made_model

FILES = 4
ROWS = 500


def write_log(path, angles, name="indicated_deg"):
    rows = zip(angles, np.linspace(20.0, 30.0, angles.size), 90.0 + angles, strict=True)
    lines = (f"{a:.9f},{t:.3f},{b:.9f}" for a, t, b in rows)
    path.write_text("\n".join([f"{name},temperature_C,other_deg", *lines]) + "\n")


@pytest.fixture
def angles():
    """One recording over 9.3 turns, cut into logs."""
    return np.split(made_angles(FILES * ROWS, turns=9.3), FILES)


@pytest.fixture
def logs(angles, tmp_path):
    folder = tmp_path / "logs"
    folder.mkdir()
    for i, part in enumerate(angles):
        write_log(folder / f"{i}.csv", part)
    return folder


def outputs(folder):
    return {path.name: path.read_bytes() for path in folder.glob("*.csv")}


def statuses(report):
    return [log.status for log in report.logs]


def other_model():
    model = made_model()
    shaft = model.shafts[0]
    changed = ta.Shaft(shaft.name, 1, shaft.orders, shaft.cosine, [0.4, -0.050000001])
    return ta.HarmonicModel([changed], constant=model.constant, period=360.0)


#: What may change from run to run, and the request before.
CHANGES = {
    "model": ({}, {"model": other_model()}),
    "unit": ({}, {"unit": "rad"}),
    "unit in counts": (
        {"unit": "count", "counts_per_turn": 360.0},
        {"unit": "count", "counts_per_turn": 361.0},
    ),
    "column": ({"column": "indicated_deg"}, {"column": "other_deg"}),
    "argument": ({}, {"model": made_model(argument="indicated")}),
    "terms": (
        {},
        {
            "model": ta.HarmonicModel(
                made_model().shafts,
                constant=0.2,
                period=360.0,
                terms=[Backlash(half_width=0.01)],
            )
        },
    ),
}


@pytest.mark.parametrize("change", CHANGES)
def test_outputs_of_another_request_are_made_anew(change, logs, tmp_path):
    first, second = CHANGES[change]
    first, second = ({"model": made_model()} | request for request in (first, second))
    out, fresh = tmp_path / "out", tmp_path / "fresh"
    made, known = (ta.correct_logs(logs, output=out, **first) for _ in range(2))
    assert statuses(made) == ["done"] * FILES
    assert statuses(known) == ["done before"] * FILES
    # Rows are those that were corrected now; each log tells its own.
    each = [entry["rows"] for entry in made.to_dict()["files"]]
    assert [entry["rows"] for entry in known.to_dict()["files"]] == each
    assert (made.to_dict()["rows"], known.to_dict()["rows"]) == (sum(each), 0)
    before = outputs(out)
    assert statuses(ta.correct_logs(logs, output=out, **second)) == ["done"] * FILES
    ta.correct_logs(logs, output=fresh, **second)
    assert outputs(out) == outputs(fresh)
    assert outputs(out) != before
    # And back: the line of the first request is not taken for that of the last output.
    assert statuses(ta.correct_logs(logs, output=out, **first)) == ["done"] * FILES
    assert outputs(out) == before


def test_another_model_in_a_file_of_the_same_name_is_seen(logs, tmp_path, capsys):
    model, out = tmp_path / "joint.json", tmp_path / "out"
    command = ["correct", str(logs), "-m", str(model), "-o", str(out), "--json"]
    for made, expected in (
        (made_model(), "done"),
        (made_model(), "done before"),
        (other_model(), "done"),
    ):
        made.save(model)
        capsys.readouterr()
        assert main(command) == 0
        files = json.loads(capsys.readouterr().out)["files"]
        assert {file["status"] for file in files} == {expected}


def test_in_place_another_model_does_not_pass_for_done(logs):
    assert ta.correct_logs(logs, made_model(), in_place=True).is_done
    before = outputs(logs)
    report = ta.correct_logs(logs, other_model(), in_place=True)
    assert statuses(report) == ["failed"] * FILES
    assert all("corrected_deg" in str(log.error) for log in report.logs)
    assert outputs(logs) == before


def turning():
    """Its motor turns 50.3 times in a turn of the output: turns must be counted."""
    return made_model(ratio=50.3)


def corrected(folder):
    text = "".join(path.read_text() for path in sorted(folder.glob("*.csv")))
    lines = (line for line in text.splitlines() if not line.startswith("indicated"))
    return np.array([float(line.rpartition(",")[2]) for line in lines])


def expected(angles):
    """The whole recording at once, its turns counted by numpy."""
    whole = np.concatenate(angles).round(9)
    unwrapped = np.unwrap(whole, period=360.0)
    assert np.abs(unwrapped - whole).max() > 8 * 360.0  # turns pass, and matter:
    assert np.ptp(turning().error(np.array([10.0, 370.0, 730.0]))) > 0.01
    return turning().correct(unwrapped) - (unwrapped - whole)


def test_a_damaged_log_in_the_middle_does_not_shift_the_turns_after_it(logs, angles, tmp_path):
    out = tmp_path / "out"
    whole = (logs / "1.csv").read_bytes()
    (logs / "1.csv").write_bytes(whole.replace(b"\n", b"\nx", 300))
    report = ta.correct_logs(logs, turning(), out)
    assert statuses(report) == ["done", "failed", *["not started"] * (FILES - 2)]
    assert outputs(out).keys() == {"0.csv"}
    (logs / "1.csv").write_bytes(whole)
    report = ta.correct_logs(logs, turning(), out)
    assert statuses(report) == ["done before", *["done"] * (FILES - 1)]
    np.testing.assert_allclose(corrected(out), expected(angles), atol=2e-9)


@pytest.mark.parametrize("lost", range(FILES))
def test_a_lost_output_is_made_anew_in_its_own_turns(lost, logs, angles, tmp_path):
    """Where the logs before stopped is known from the manifest alone."""
    out = tmp_path / "out"
    ta.correct_logs(logs, turning(), out)
    before = outputs(out)
    (out / f"{lost}.csv").unlink()
    report = ta.correct_logs(logs, turning(), out)
    assert [log.status == "done" for log in report.logs] == [i == lost for i in range(FILES)]
    assert outputs(out) == before
    np.testing.assert_allclose(corrected(out), expected(angles), atol=2e-9)


def test_a_log_after_a_damaged_one_begins_its_own_travel(logs, tmp_path):
    """Of a model that asks for the direction only: the others are corrected nevertheless."""
    shafts = made_model().shafts
    model = ta.HarmonicModel(shafts, constant=0.2, period=360.0, terms=[Backlash(half_width=0.02)])
    damaged = (logs / "1.csv").read_bytes()
    (logs / "1.csv").write_bytes(damaged.replace(b"\n", b"\nx", 300))
    report = ta.correct_logs(logs, model, tmp_path / "out")
    assert statuses(report) == ["done", "failed", "done", "done"]
    ta.correct_logs(logs / "2.csv", model, tmp_path / "alone.csv")
    assert (tmp_path / "out" / "2.csv").read_bytes() == (tmp_path / "alone.csv").read_bytes()


def test_a_changed_output_is_made_anew(logs, tmp_path):
    """Someone's hand in an output: it is not what the manifest tells of."""
    out = tmp_path / "out"
    ta.correct_logs(logs, made_model(), out)
    before = outputs(out)
    (out / "1.csv").write_text("something else\n")
    report = ta.correct_logs(logs, made_model(), out)
    assert [log.status == "done" for log in report.logs] == [False, True, False, False]
    assert outputs(out) == before


#: Terms of a model, and what its joint is told to read: the request before, and another.
READ = {
    "column of a signal": (
        [ThermalDrift(zero_per_K=0.001)],
        {"temperature": "temperature_C"},
        {"temperature": "other_deg"},
    ),
    "unit of a joint": (
        [],
        {"indicated": ("indicated_deg", "deg")},
        {"indicated": ("indicated_deg", "rad")},
    ),
}


@pytest.mark.parametrize("what", READ)
def test_what_a_joint_reads_belongs_to_the_request(what, logs, tmp_path):
    terms, first, second = READ[what]
    shafts, out = made_model().shafts, tmp_path / "out"
    model = ta.HarmonicModel(shafts, constant=0.2, period=360.0, terms=terms)
    assert statuses(ta.correct_logs(logs, model, out, signals=first)) == ["done"] * FILES
    assert statuses(ta.correct_logs(logs, model, out, signals=first)) == ["done before"] * FILES
    before = outputs(out)
    assert statuses(ta.correct_logs(logs, model, out, signals=second)) == ["done"] * FILES
    assert outputs(out) != before


def test_single_precision_stays_where_turns_are_counted(angles, tmp_path):
    pa = pytest.importorskip("pyarrow")
    pq = pytest.importorskip("pyarrow.parquet")

    single = np.concatenate(angles).astype(np.float32)
    pq.write_table(pa.table({"indicated_deg": single}), tmp_path / "a.parquet")
    ta.correct_logs(tmp_path / "a.parquet", turning(), tmp_path / "b.parquet")
    found = pq.read_table(tmp_path / "b.parquet")["corrected_deg"]
    assert found.type == pa.float32()
    unwrapped = np.unwrap(single.astype(float), period=360.0)
    whole = turning().correct(unwrapped) - (unwrapped - single)
    # Ten turns in single precision: its rounding at 3600.
    np.testing.assert_allclose(found.to_numpy(), whole, atol=4e-4)


@pytest.mark.parametrize("dtype", [np.float32, np.float64, np.int32])
def test_corrected_readings_have_the_precision_of_the_column(dtype):
    """Where turns are counted too: a format that takes what it is given must get it right."""
    from trueangle.logs.joints import LogJoint, LogSettings

    (channel,) = LogSettings((LogJoint(turning()),)).channels("log", ["indicated_deg"])
    assert channel.counts_turns
    found = channel.correct(np.array([350, 5, 20], dtype=dtype))
    assert found.dtype == (np.float32 if dtype is np.float32 else np.float64)


def test_every_setting_that_changes_the_output_belongs_to_the_request():
    from dataclasses import replace

    from trueangle.logs.joints import LogJoint, LogSettings

    plain = LogSettings((LogJoint(made_model()),), "deg", 4096.0, "/joints", "/corrected", 2)
    changes = {
        "unit": "rad",
        "counts_per_turn": 8192.0,
        "topic": "/other",
        "output_topic": "/other",
        "joints": (LogJoint(made_model(), unit="rad"),),
    }
    digests = {plain.digest, *(replace(plain, **{k: v}).digest for k, v in changes.items())}
    assert len(digests) == 1 + len(changes)
    assert replace(plain, threads=1).digest == plain.digest
